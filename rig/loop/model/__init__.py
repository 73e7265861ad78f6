"""The model: equations, base parameters, what can be added to it, and what it predicts."""
