"""The search for what the model lacks: candidates, their trials, selection and withdrawal."""
