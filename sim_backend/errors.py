"""Errors of the simulated bench; it shares no code with the drivers, the application translates them."""


class ModelError(ValueError):
    """A parameter or a state that the model cannot have. The message names it, its value, unit and range."""


class NotFiniteError(ModelError):
    """The plant's numbers left the finite ones. `time`: s, where the plant stands; `signals`: what was lost."""

    def __init__(self, message: str, *, time: float, signals: tuple[str, ...]) -> None:
        super().__init__(message)
        self.time = time
        self.signals = signals
