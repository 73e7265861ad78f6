"""Errors of the simulated bench; it shares no code with the drivers, the application translates them."""


class ModelError(ValueError):
    """A parameter or a state that the model cannot have. The message names it, its value, unit and range."""


class NotFiniteError(ModelError):
    """The plant's numbers left the finite ones. `time`: s, where the plant stands; `signals`: what was lost."""

    def __init__(self, message: str, *, time: float, signals: tuple[str, ...]) -> None:
        super().__init__(message)
        self.time = time
        self.signals = signals


class ParameterError(ModelError):
    """One number that the model cannot have, with the facts of the message: `rule` is range, unit and equation."""

    def __init__(self, name: str, value: float, unit: str, rule: str) -> None:
        super().__init__(f"{f'{name} = {value!r} {unit}'.rstrip()} is not possible: it {rule}.")
        self.name = name
        self.value = value
        self.unit = unit
        self.rule = rule
