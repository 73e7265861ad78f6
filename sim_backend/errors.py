"""Errors of the simulated bench; it shares no code with the drivers, the application translates them."""


class ModelError(ValueError):
    """A parameter or a state that the model cannot have. The message names it, its value, unit and range."""
