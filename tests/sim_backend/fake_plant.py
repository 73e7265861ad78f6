"""A plant without physics: shows what the test sets, remembers what it was told."""

from sim_backend.ports import AxisMode, PlantReading

ZERO = PlantReading(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 20.0, 20.0)


class FakePlant:
    """`reading` is what the instruments show; a shaft in velocity mode has its target speed at once."""

    def __init__(self, *, obedient: bool = True) -> None:
        self.reading = ZERO
        self.commands: dict[str, tuple[AxisMode, float]] = {}
        self.limits: dict[str, float] = {}
        self.limited: set[str] = set()
        self.locks: list[bool] = []
        self.advanced: list[float] = []
        self._time = 0.0
        self._obedient = obedient

    @property
    def time(self) -> float:
        return self._time

    def advance_to(self, time: float) -> None:
        self.advanced.append(time)
        self._time = time

    def command(self, axis: str, mode: AxisMode, target: float) -> None:
        self.commands[axis] = (mode, target)
        if mode is AxisMode.VELOCITY and self._obedient:
            self.show(**{f"{axis}_velocity": target})

    def set_torque_limit(self, axis: str, limit: float) -> None:
        self.limits[axis] = limit

    def torque_limited(self, axis: str) -> bool:
        return axis in self.limited

    def read(self) -> PlantReading:
        return self.reading

    def set_lock(self, locked: bool) -> None:
        self.locks.append(locked)

    def show(self, **values: float) -> None:
        self.reading = self.reading._replace(**values)
