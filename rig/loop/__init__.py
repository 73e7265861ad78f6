"""Fit the base model to a campaign of runs, trace what it leaves, and report the error before and after."""
