"""A simulated servo drive after CiA 402: power state machine, cyclic synchronous modes, stops and supervision.

The inner loops (current, velocity, position) run in the plant; this is the firmware around them. Objects are in
`drive402_objects.py`, the table of states in `power_states.py`.
"""

import math
from dataclasses import dataclass

from sim_backend.nodes.communication import HEARTBEAT_LOST, CanopenNode, NodeOptions
from sim_backend.nodes.drive402_objects import CSP, CST, CSV, I32_MAX, I32_MIN, NO_WINDOW, DriveConfig, drive_type
from sim_backend.nodes.object_dictionary import AbortCode, AbortError
from sim_backend.nodes.power_states import FAULT_RESET, HALT, POWERED, TARGETS, TRANSITIONS, Command, PowerState, decode
from sim_backend.nodes.units import round_half_away, to_i16, wrap_i32
from sim_backend.ports import AxisMode, PlantPort, PlantReading

FOLLOWING_ERROR = 0x8611
STOP_TIME_OUT = 0.5
"""s after the end of a ramp: a shaft that still turns then is switched off all the same."""

_VOLTAGE, _REMOTE, _REACHED, _LIMIT, _FOLLOWS, _MODE_ERROR = 0x0010, 0x0200, 0x0400, 0x0800, 0x1000, 0x2000
_INNER_LOOPS = {CSP: AxisMode.POSITION, CSV: AxisMode.VELOCITY, CST: AxisMode.TORQUE}
_ENABLED_WORD = 0x0F
_RPM = math.tau / 60.0
_SLOW_RAMP, _QUICK_RAMP = 1, 2
_STAY = 4
"""Quick-stop option codes 5 to 8 are 1 to 4 with the drive staying in quick stop active."""


@dataclass(frozen=True, slots=True)
class _Stop:
    """A ramp to standstill: start instant (s), start speed (rad/s), rate (rad/s^2), and the state that follows.

    Without a state the drive holds standstill.
    """

    start: float
    speed: float
    rate: float
    then: PowerState | None

    def target(self, time: float) -> float:
        """Speed (rad/s) the ramp asks for at `time`."""
        left = abs(self.speed) - self.rate * (time - self.start) if self.rate < math.inf else 0.0
        return math.copysign(left, self.speed) if left > 0 else 0.0

    def overdue(self, time: float) -> bool:
        """Whether the shaft had more than enough time to stop."""
        return time > self.start + abs(self.speed) / self.rate + STOP_TIME_OUT


class Drive402:
    """The application half of a drive. `state` and `mode` are what its statusword and 0x6061 say."""

    moves = True

    def __init__(self, config: DriveConfig, plant: PlantPort) -> None:
        self.config = config
        self.device_type = drive_type(config)
        self.state = PowerState.NOT_READY
        self.mode = 0
        self._plant = plant
        self._position, self._velocity, self._torque = (
            PlantReading._fields.index(f"{config.axis}_{name}") for name in ("position", "velocity", "torque")
        )
        self._read = plant.read
        self._counts_per_radian = config.counts_per_radian
        self._refused = frozenset(config.refuse_modes)
        self._torque_unit = config.rated_torque / 1000.0
        self._next_mode: tuple[float, int] | None = None
        self._control_word = 0
        self._stop: _Stop | None = None
        self._cause_present = False
        self._limited = False
        self._blocked = 0
        self._remote = True
        self._speed_limit = config.max_speed
        self._travel_watched = False
        self._outside_since: float | None = None
        self._regulated: AxisMode | None = None
        self._target = 0.0

    def attach(self, node: CanopenNode) -> None:
        """Bind the objects to their behaviour."""
        self._node = node
        objects = node.dictionary
        for index, read in {
            0x603F: lambda: node.emergency.last_code,
            0x6041: self._status_word,
            0x6061: lambda: self.mode,
            0x6064: self._position_counts,
            0x606C: self._velocity_units,
            0x6074: self._torque_demand,
            0x6077: self._torque_per_mille,
            0x6078: self._torque_per_mille,
            0x60F4: self._following_error,
        }.items():
            objects[index, 0].read = read
        objects.together[(0x6041, 0), (0x6064, 0), (0x6077, 0)] = self._feedback
        self._options = {index: objects[index, 0] for index in (0x6007, 0x605A, 0x605B, 0x605C, 0x605D, 0x605E)}
        self._target_torque = objects[0x6071, 0]
        self._torque_offset = objects[0x60B2, 0]
        self._target_position = objects[0x607A, 0]
        self._target_velocity = objects[0x60FF, 0]
        self._max_speed = objects[0x6080, 0]
        self._travel = (objects[0x607D, 1], objects[0x607D, 2])
        self._following = (objects[0x6065, 0], objects[0x6066, 0])
        self._decelerations = {_SLOW_RAMP: objects[0x6084, 0], _QUICK_RAMP: objects[0x6085, 0]}
        self._torque_limits = tuple(objects[index, 0] for index in (0x6072, 0x6073, 0x60E0, 0x60E1))
        objects[0x6040, 0].changed = self._on_control_word
        objects[0x6060, 0].check = self._check_mode
        objects[0x6060, 0].changed = self._on_mode
        for target in (self._target_torque, self._torque_offset, self._target_position, self._target_velocity):
            target.changed = self._follow
        for limit in self._torque_limits:
            limit.changed = lambda _: self._set_torque_limit()
        for limit in (self._max_speed, *self._travel):
            limit.changed = lambda _: self._set_motion_limits()

    def start(self) -> None:
        """Power on: no torque, transitions 0 and 1, everything forgotten."""
        self.mode = 0
        self._next_mode = None
        self._control_word = 0
        self._cause_present = False
        self._remote = True
        self._regulated = None
        self._set_torque_limit()
        self._set_motion_limits()
        self._enter(PowerState.SWITCH_ON_DISABLED)

    def tick(self, time: float) -> None:
        """Let time (s) pass: mode changes, ramps and supervision."""
        if self._next_mode is not None and time >= self._next_mode[0]:
            self.mode = self._next_mode[1]
            self._next_mode = None
            self._outside_since = None
            self._follow()
        if self.state not in POWERED:
            return
        self._limited = self._plant.torque_limited(self.config.axis)
        if self._stop is not None:
            self._advance_stop(self._stop, time)
        elif self.state is PowerState.ENABLED:
            if self.mode == CSP:
                self._watch_following_error(time)
            else:
                self._watch_limits()

    def connection_lost(self) -> None:
        """React by 0x6007 if the power stage is on; a drive that is off has nothing to make safe."""
        if self.state not in POWERED and self.state is not PowerState.SWITCHED_ON:
            return
        reaction = self._options[0x6007].value
        if reaction == 1:
            self.fault(HEARTBEAT_LOST)
        elif reaction == 2 and self.state is not PowerState.FAULT_REACTION:
            self._enter(PowerState.SWITCH_ON_DISABLED)
        elif reaction == 3 and self.state is PowerState.ENABLED:
            self._transition(11)
        elif reaction == 3 and self.state is PowerState.SWITCHED_ON:
            self._transition(10)

    def fault(self, code: int, *, cause_stays: bool = False) -> None:
        """Transition 13: report the error `code`, react by 0x605E, then fault (14).

        A fault whose cause stays cannot be reset until `remove_cause`.
        """
        self._cause_present = cause_stays
        self._node.emergency.raise_error(code, latched=True)
        if self.state in (PowerState.FAULT, PowerState.FAULT_REACTION):
            return
        option = self._options[0x605E].value
        if self.state in POWERED and option:
            self._begin_stop(option, PowerState.FAULT, PowerState.FAULT_REACTION)
        else:
            self._enter(PowerState.FAULT)

    def remove_cause(self) -> None:
        """Let the cause of a fault go away; the fault stays until it is reset."""
        self._cause_present = False

    def refuse_modes(self, modes: frozenset[int]) -> None:
        """Refuse these modes from now on, by an abort or by silence as configured."""
        self._refused = modes

    def ignore_control_words(self) -> None:
        """Stay in the present state whatever the control word says, as a drive does that is not in remote operation."""
        self._remote = False

    def _on_control_word(self, word: int) -> None:
        if not self._remote:
            return
        previous, self._control_word = self._control_word, word
        if word == previous == _ENABLED_WORD and self.state is PowerState.ENABLED and self._stop is None:
            return  # every cycle of a running drive
        if self.state is PowerState.FAULT:
            if word & FAULT_RESET and not previous & FAULT_RESET and not self._cause_present:
                self._transition(15)
            return
        command = decode(word)
        if command is None:
            return
        for number in TRANSITIONS.get((self.state, command), ()):
            self._transition(number)
        if self.state is PowerState.ENABLED and command is Command.ENABLE_OPERATION:
            self._run_or_halt()

    def _transition(self, number: int) -> None:
        target = TARGETS[number]
        if number == 15:
            self._node.emergency.clear_all()
        if number == 16 and self._options[0x605A].value <= _STAY:
            return
        option = 0
        if number == 5:
            option = self._options[0x605C].value
        elif number == 8:
            option = self._options[0x605B].value
        if number == 11:
            self._quick_stop()
        elif option:
            if self._stop is None or self._stop.then is not target:
                self._begin_stop(option, target, PowerState.ENABLED)
        else:
            self._enter(target)

    def _quick_stop(self) -> None:
        option = self._options[0x605A].value
        if option == 0:
            self._enter(PowerState.SWITCH_ON_DISABLED)
        elif option <= _STAY:
            self._begin_stop(option, PowerState.SWITCH_ON_DISABLED, PowerState.QUICK_STOP)
        else:
            self._begin_stop(option - _STAY, None, PowerState.QUICK_STOP)

    def _run_or_halt(self) -> None:
        """Obey bit 8; either way a ramp that was to end in another state is taken back."""
        stop = self._stop
        if self._control_word & HALT:
            if stop is None or stop.then is not None:
                self._begin_stop(self._options[0x605D].value, None, PowerState.ENABLED)
        elif stop is not None:
            self._enter(PowerState.ENABLED)

    def _enter(self, state: PowerState) -> None:
        """Take the state at once: follow the targets if enabled, otherwise carry no torque."""
        self.state = state
        self._stop = None
        self._blocked = 0
        self._outside_since = None
        if state is PowerState.ENABLED:
            self._follow()
        else:
            self._limited = False
            self._command(AxisMode.OFF, 0.0)

    def _begin_stop(self, option: int, then: PowerState | None, meanwhile: PowerState) -> None:
        """Brake by a ramp (option 1, 2) or with all the current there is (3, 4); then enter `then`."""
        now = self._node.time
        ramp = self._decelerations.get(option)
        rate = max(ramp.value, 1) / self.config.velocity_scale if ramp is not None else math.inf
        self.state = meanwhile
        self._stop = _Stop(now, self._read()[self._velocity], rate, then)
        self._blocked = 0
        self._command(AxisMode.VELOCITY, self._stop.target(now))

    def _advance_stop(self, stop: _Stop, time: float) -> None:
        target = stop.target(time)
        still = target == 0.0 and abs(self._read()[self._velocity]) <= self.config.standstill_speed
        if stop.then is not None and (still or stop.overdue(time)):
            self._enter(stop.then)
        else:
            self._command(AxisMode.VELOCITY, target)

    def _check_mode(self, mode: int) -> None:
        if not self._accepts(mode) and not self.config.refuse_by_silence:
            raise AbortError(AbortCode.VALUE)

    def _on_mode(self, mode: int) -> None:
        if self._accepts(mode):
            self._next_mode = (self._node.time + self.config.mode_switch_time, mode)

    def _accepts(self, mode: int) -> bool:
        return mode == 0 or (mode in self.config.modes and mode not in self._refused)

    def _follow(self, _value: int = 0) -> None:
        """Hand the target of the active mode to the inner loop, bounded by speed and travel limits."""
        if self.state is not PowerState.ENABLED or self._stop is not None:
            return
        mode = self.mode
        if mode == CST:
            target = (self._target_torque.value + self._torque_offset.value) * self._torque_unit
        elif mode == CSV:
            limit = self._speed_limit
            target = min(max(self._target_velocity.value / self.config.velocity_scale, -limit), limit)
        elif mode == CSP:
            self._command(AxisMode.POSITION, self._position_target())
            return
        else:
            self._command(AxisMode.OFF, 0.0)
            return
        if target * self._blocked > 0:
            target = 0.0
        self._command(_INNER_LOOPS[mode], target)

    def _position_target(self) -> float:
        counts = self._target_position.value
        if self._travel_watched:
            counts = min(max(counts, self._travel[0].value), self._travel[1].value)
        actual = math.floor(self._read()[self._position] * self._counts_per_radian)
        # the middle of the count, so that a shaft at rest reads the target rather than its lower neighbour
        return (actual + wrap_i32(counts - actual) + 0.5) / self._counts_per_radian

    def _command(self, mode: AxisMode, target: float) -> None:
        if target != self._target or mode is not self._regulated:
            self._regulated, self._target = mode, target
            self._plant.command(self.config.axis, mode, target)

    def _set_torque_limit(self) -> None:
        limit = min(variable.value for variable in self._torque_limits) * self._torque_unit
        self._plant.set_torque_limit(self.config.axis, limit)

    def _set_motion_limits(self) -> None:
        low, high = self._travel[0].value, self._travel[1].value
        self._speed_limit = self._max_speed.value * _RPM
        self._travel_watched = low < high and (low > I32_MIN or high < I32_MAX)

    def _watch_limits(self) -> None:
        """Act on the speed limit (torque mode) and the travel limits: no further in the blocked direction."""
        blocked = 0
        if self._travel_watched:
            counts = self._position_counts()
            blocked = 1 if counts > self._travel[1].value else -1 if counts < self._travel[0].value else 0
        if self.mode == CST:
            speed, limit = self._read()[self._velocity], self._speed_limit
            if not -limit <= speed <= limit:
                blocked = 1 if speed > 0 else -1
        if blocked != self._blocked:
            self._blocked = blocked
            self._follow()

    def _watch_following_error(self, time: float) -> None:
        window, time_out = self._following
        if window.value == NO_WINDOW or abs(self._following_error()) <= window.value:
            self._outside_since = None
        elif self._outside_since is None:
            self._outside_since = time
        if self._outside_since is not None and time - self._outside_since >= time_out.value * 1e-3:
            self.fault(FOLLOWING_ERROR)

    def _status_word(self) -> int:
        state = self.state
        word = state | _VOLTAGE
        if self._remote:
            word |= _REMOTE
        if self._limited or self._blocked:
            word |= _LIMIT
        if state is PowerState.ENABLED and self._stop is None:
            if self.mode and not self._blocked:
                word |= _FOLLOWS
            if self._outside_since is not None:
                word |= _MODE_ERROR
        elif self._stop is not None and abs(self._read()[self._velocity]) <= self.config.standstill_speed:
            word |= _REACHED
        return word

    def _position_counts(self) -> int:
        counts = math.floor(self._read()[self._position] * self._counts_per_radian)
        return counts if I32_MIN <= counts <= I32_MAX else wrap_i32(counts)

    def _velocity_units(self) -> int:
        return wrap_i32(round_half_away(self._read()[self._velocity] * self.config.velocity_scale))

    def _torque_per_mille(self) -> int:
        return to_i16(self._read()[self._torque] / self._torque_unit)

    def _feedback(self) -> tuple[int, int, int]:
        """Give status word, position and torque in one go, as their objects give them one by one."""
        reading = self._read()
        counts = math.floor(reading[self._position] * self._counts_per_radian)
        return (
            self._status_word(),
            counts if I32_MIN <= counts <= I32_MAX else wrap_i32(counts),
            to_i16(reading[self._torque] / self._torque_unit),
        )

    def _torque_demand(self) -> int:
        if self.state is not PowerState.ENABLED or self._stop is not None or self.mode != CST or self._blocked:
            return 0
        return to_i16(self._target_torque.value + self._torque_offset.value)

    def _following_error(self) -> int:
        if self.mode != CSP or self.state is not PowerState.ENABLED:
            return 0
        return wrap_i32(self._target_position.value - self._position_counts())


def drive_node(config: DriveConfig, plant: PlantPort, options: NodeOptions | None = None) -> CanopenNode:
    """Give a drive on the bus."""
    return CanopenNode(config.node_id, Drive402(config, plant), options)
