"""Errors of the simulated bench; it shares no code with the drivers, the application translates them."""

import math

_MOST_SHOWN = 60
"""Characters of a value in a message."""


def shown(value: object) -> str:
    """Give a value as a message shows it: short, also a whole number of hundreds of digits or a long list."""
    if isinstance(value, int) and abs(value) > 10**_MOST_SHOWN:  # of 4300 digits Python would print none
        return f"about {'-' if value < 0 else ''}1e+{round(math.log10(abs(value)))}"
    if isinstance(value, str):  # of an enum its text alone
        value = str(value)
    try:
        text = repr(value)
    except ValueError:  # such a number within a list
        return f"a {type(value).__name__}"
    return text if len(text) <= _MOST_SHOWN else f"{text[:_MOST_SHOWN]}..."


class ModelError(ValueError):
    """A parameter or a state that the model cannot have. The message names it, its value, unit and range."""

    def __reduce__(self) -> tuple[object, ...]:
        """Travel between processes as made, whatever the constructor of a subclass takes."""
        return _restored, (type(self), self.args, self.__dict__)


def _restored(kind: "type[ModelError]", args: tuple[object, ...], state: dict[str, object]) -> "ModelError":
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


class NotFiniteError(ModelError):
    """The plant's numbers left the finite ones. `time`: s, where the plant stands; `signals`: what was lost."""

    def __init__(self, message: str, *, time: float, signals: tuple[str, ...]) -> None:
        super().__init__(message)
        self.time = time
        self.signals = signals


class ParameterError(ModelError):
    """One number that the model cannot have, with the facts of the message: `rule` is range, unit and equation."""

    def __init__(self, name: str, value: object, unit: str, rule: str) -> None:
        super().__init__(f"{f'{name} = {shown(value)} {unit}'.rstrip()} is not possible: it {rule}.")
        self.name = name
        self.value = value
        self.unit = unit
        self.rule = rule
