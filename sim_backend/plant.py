"""The simulated bench's plant: motor, harmonic drive and output, with the drives' inner loops and the instruments.

The physics is in `model`; this class holds the state, takes commands, and adds the instruments' noise.
"""

import math
from collections.abc import Iterator, Sequence
from functools import partial
from operator import itemgetter
from typing import NamedTuple, NoReturn, cast

import numpy as np

from sim_backend.errors import ModelError, NotFiniteError, shown
from sim_backend.model import springs, stepper
from sim_backend.model.checks import is_series
from sim_backend.model.compiler import has_numba
from sim_backend.model.compliance import Compliance
from sim_backend.model.constants import derive
from sim_backend.model.effect_bounds import check_effects
from sim_backend.model.effects import ActiveEffect
from sim_backend.model.kernel import plant_kernel
from sim_backend.model.parameters import PlantConfig
from sim_backend.ports import AxisMode, PlantReading

_NOISE_BLOCK = 1024
"""Readings whose noise is drawn at once."""

_MOST_STEPS = 2**53
"""Steps since the start that the state, which counts them in a float, tells apart."""

_seen = itemgetter(
    stepper.MOTOR_POSITION,
    stepper.MOTOR_VELOCITY,
    stepper.SHOWN_TORQUE,
    stepper.OUTPUT_POSITION,
    stepper.OUTPUT_VELOCITY,
    stepper.LOAD_TORQUE,
    stepper.OUTPUT_TORQUE,
    stepper.GEAR_TEMPERATURE,
    stepper.WINDING_TEMPERATURE,
)
"""What the instruments see of the state; the load drive sits on the output shaft, so it sees the output's angle."""

_WATCHED = {
    "motor_position": stepper.MOTOR_POSITION,
    "motor_velocity": stepper.MOTOR_VELOCITY,
    "output_position": stepper.OUTPUT_POSITION,
    "output_velocity": stepper.OUTPUT_VELOCITY,
    "rim_position": stepper.RIM,
    "motor_torque": stepper.SHOWN_TORQUE,
    "load_torque": stepper.LOAD_TORQUE,
    "output_torque": stepper.OUTPUT_TORQUE,
    "flexspline_torque": stepper.T_F_NOW,
    "wave_generator_torque": stepper.T_W_NOW,
    "temperature": stepper.GEAR_TEMPERATURE,
    "motor_temperature": stepper.WINDING_TEMPERATURE,
    "error of motor_position": stepper.MOTOR_POSITION_ERROR,
    "error of motor_torque": stepper.MOTOR_TORQUE_ERROR,
    "error of output_position": stepper.OUTPUT_POSITION_ERROR,
    "error of output_torque": stepper.OUTPUT_TORQUE_ERROR,
    "work": stepper.WORK,
    "heat": stepper.DISSIPATED,
    "effect_work": stepper.EFFECT_WORK,
}
"""What tells, by not being finite, that the plant was lost; everything that moves goes into one of these."""

_MOST_NAMED = 4
"""Names of lost signals in a message."""

_errors = itemgetter(
    stepper.MOTOR_POSITION_ERROR,
    stepper.MOTOR_VELOCITY_ERROR,
    stepper.OUTPUT_POSITION_ERROR,
    stepper.OUTPUT_VELOCITY_ERROR,
    stepper.OUTPUT_TORQUE_ERROR,
)
"""What effects add to the readings; that of the motor torque is in SHOWN_TORQUE."""

_watched = itemgetter(*_WATCHED.values())

_new_reading = partial(tuple.__new__, PlantReading)
"""Make a reading of a tuple in half the time of `PlantReading(...)`: there is one in every tick."""

_AXES = {
    "motor": (stepper.MOTOR_MODE, stepper.MOTOR_TARGET, stepper.MOTOR_LIMIT, stepper.MOTOR_LIMITED),
    "load": (stepper.LOAD_MODE, stepper.LOAD_TARGET, stepper.LOAD_LIMIT, stepper.LOAD_LIMITED),
}


_MODES = frozenset(AxisMode)

_FLEXSPLINE_ENERGY = {
    Compliance.ARCTAN: springs.flexspline_energy,
    Compliance.CUBIC: springs.cubic_flexspline_energy,
    Compliance.PIECEWISE: springs.piecewise_flexspline_energy,
}


class PlantTruth(NamedTuple):
    """The plant's state itself, without instruments: rad, rad/s, N*m, A, degC; energies in J since the start.

    `motor_current` is the one that the motor's drive believes in. `flexspline_torque` and `wave_generator_torque` are
    T_F and T_w. `work` is what both drives put in, `heat` what friction and dampers took, `effect_work` what the
    effects took; `stored` is elastic and kinetic energy now, the latter 0.5 J w(t - h/2) w(t + h/2) with the step h,
    which is what the integrator keeps. Since the start work - heat - effect_work = stored within 1e-4 of the work put
    in, at the default step, over any run at any torque up to the motor's speed limit, and the rest falls with the
    square of the step. The temperatures come of that heat, not on top of it.
    """

    time: float
    motor_position: float
    motor_velocity: float
    output_position: float
    output_velocity: float
    rim_position: float
    motor_torque: float
    load_torque: float
    output_torque: float
    flexspline_torque: float
    wave_generator_torque: float
    motor_current: float
    temperature: float
    motor_temperature: float
    work: float
    heat: float
    effect_work: float
    stored: float


class Plant:
    """A bench in simulated time; sense `opposed`. Implements `sim_backend.ports.PlantPort`.

    Raises ModelError if the plant cannot have an effect, or this bench not these effects (`model.effect_bounds`).
    It starts at rest without torque, motor at angle zero, both drives off, output free. `effects` are active for the
    plant's life. `seed` fixes the instruments' noise. `compiled=False` runs the same source as plain Python.
    """

    def __init__(
        self, config: PlantConfig, effects: Sequence[ActiveEffect] = (), seed: int = 0, compiled: bool = True
    ) -> None:
        _check_parts(config, effects)
        self.config = config
        self.effects = tuple(effects)
        check_effects(self.effects, config)
        _check_seed(seed)
        self._kernel = plant_kernel(self.effects, config.law, compiled=compiled)
        self._derived = derive(config)
        self._constants = np.array(self._derived, dtype=np.float64)
        self._state = np.zeros(self._kernel.state_size)
        self._inputs = np.zeros(stepper.INPUT_SIZE)
        self._inputs[stepper.MOTOR_LIMIT] = config.motor_rated_torque
        self._inputs[stepper.LOAD_LIMIT] = config.load_rated_torque
        self._state[stepper.GEAR_TEMPERATURE] = config.temperature
        self._state[stepper.WINDING_TEMPERATURE] = config.motor_temperature
        self._random = np.random.default_rng(seed)
        # single numbers go in and out of a memoryview in half the time that an array takes
        self._state_view = cast("memoryview[float]", self._state.data)
        self._inputs_view = cast("memoryview[float]", self._inputs.data)
        self._noise: Iterator[list[float]] = iter(())
        self._stepper = self._kernel.bind(self._state, self._inputs, self._constants)
        self._advance = self._stepper.advance
        if not (compiled and has_numba()):  # what is lost is told by an error; numpy's warnings would come before it
            self._advance = np.errstate(all="ignore")(self._advance)
        self._step = config.step
        self._steps = 0
        self._reading: PlantReading | None = None
        self._stepper.start(0)

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self._steps * self.config.step

    @property
    def locked(self) -> bool:
        """True while the fixture holds the output."""
        return bool(self._inputs[stepper.LOCKED])

    def advance_to(self, time: float) -> None:
        """Integrate up to the step nearest to `time` (s).

        Raises ModelError if that lies in the past, is no finite number or is more than 2^53 steps from the start, and
        NotFiniteError if the plant's own numbers do not stay finite. In all cases the plant stands where it stood.
        """
        try:
            steps = round(time / self._step) - self._steps
        except (TypeError, ValueError, OverflowError):
            if not (isinstance(time, int) or _is_finite(time)):
                raise ModelError(f"time = {shown(time)} s is not a finite number.") from None
            steps = _MOST_STEPS + 1 if time > 0.0 else -1  # more than a float can count
        if steps < 0:
            raise ModelError(f"time = {shown(time)} s is in the past: the plant stands at {self.time!r} s.")
        if self._steps + steps > _MOST_STEPS:
            raise ModelError(
                f"time = {shown(time)} s is further than the plant's clock can count: from {self.time!r} s where it "
                f"stands to {_MOST_STEPS * self._step:.6g} s, 2^53 steps of {self._step:g} s, time = steps * step."
            )
        if steps == 0:
            return
        before = self._state_view.tobytes()
        try:
            self._advance(steps)
        except (ArithmeticError, ValueError):  # from plain Python alone: compiled code goes on with what is no number
            raise self._lost(steps, before) from None
        if not math.isfinite(sum(_watched(self._state_view))):
            raise self._lost(steps, before)
        self._steps += steps
        self._reading = None

    def _lost(self, steps: int, before: bytes) -> NotFiniteError:
        """Put the state back to what it was, and give the error that says what was lost and why that may be."""
        signals = tuple(name for name, place in _WATCHED.items() if not math.isfinite(self._state_view[place]))
        self._state[:] = np.frombuffer(before)
        named = ", ".join(signals[:_MOST_NAMED]) or "its forces"
        if len(signals) > _MOST_NAMED:
            named += f" and {len(signals) - _MOST_NAMED} more"
        told = "; ".join(_told(active) for active in self.effects) or "none"
        return NotFiniteError(
            f"The simulated plant cannot be computed from {self.time:.6g} to {self.time + steps * self._step:.6g} s: "
            f"{named} would not be finite. The likely cause is an effect, a stiffness or "
            f"a damping that is too large for the plant or for its step = {self._step:g} s; its effects are: {told}. "
            f"Make them smaller, or the step shorter.",
            time=self.time,
            signals=signals,
        )

    def command(self, axis: str, mode: AxisMode, target: float) -> None:
        """Set what the inner loop of `axis` regulates: N*m, rad/s or rad; OFF leaves the shaft without torque.

        A change of mode takes over without a jump: the speed loop begins with the torque of the moment.
        """
        mode_place, target_place, _, _ = _AXES.get(axis) or _unknown(axis)
        if mode not in _MODES:
            raise ModelError(
                f"{axis}: mode = {shown(mode)} is unknown; a drive has {', '.join(m.name for m in AxisMode)}."
            )
        if not _is_finite(target):
            raise ModelError(f"{axis}: target = {shown(target)} in mode {AxisMode(mode).name} is not a finite float.")
        self._inputs_view[mode_place] = mode
        self._inputs_view[target_place] = target

    def set_torque_limit(self, axis: str, limit: float) -> None:
        """Bound the torque (N*m, magnitude) which the drive of `axis` can produce."""
        limit_place = (_AXES.get(axis) or _unknown(axis))[2]
        if not (_is_finite(limit) and limit >= 0.0):
            raise ModelError(f"{axis}: torque limit = {shown(limit)} N*m must be finite and at least 0 N*m.")
        self._inputs[limit_place] = limit

    def torque_limited(self, axis: str) -> bool:
        """Tell whether that bound acted since the last call."""
        place = (_AXES.get(axis) or _unknown(axis))[3]
        acted = self._state_view[place] != 0.0
        if acted:
            self._state_view[place] = 0.0
        return acted

    def set_lock(self, locked: bool) -> None:
        """Clamp the output to the fixture where it stands, or let it go."""
        if not isinstance(locked, bool | np.bool_):
            raise ModelError(f"locked = {shown(locked)} must be True (the fixture holds the output) or False.")
        if locked == self.locked:
            return
        before = self._stored_energy()  # of it, what a fixture that opens held is lost
        if self._kernel.yielding:
            self._stepper.change_lock(int(locked))
        self._inputs[stepper.LOCKED] = 1.0 if locked else 0.0
        self._inputs[stepper.LOCK_POSITION] = self._state[stepper.OUTPUT_POSITION]
        self._state[stepper.FIXTURE_TORQUE] = self._state[stepper.FIXTURE_DAMPER] = 0.0
        self._state[stepper.OUTPUT_TORQUE] = self._state[stepper.LOAD_TORQUE]
        lost = before - self._stored_energy()
        self._state[stepper.DISSIPATED] += lost
        self._state[stepper.HEAT_BEFORE] += lost  # it does not warm the gear
        self._reading = None

    def read(self) -> PlantReading:
        """Read the instruments now; repeated reads at one instant give the same values.

        `output_torque` is the transducer between the output flange and what is outside: load drive and fixture.
        """
        if self._reading is None:
            angle, velocity, torque, output_angle, output_velocity, load, outside, gear, winding = _seen(
                self._state_view
            )
            if self._kernel.readings:
                for_angle, for_velocity, for_output_angle, for_output_velocity, for_outside = _errors(self._state_view)
                angle += for_angle
                velocity += for_velocity
                output_angle += for_output_angle
                output_velocity += for_output_velocity
                outside += for_outside
            noise = next(self._noise, None)
            if noise is None:
                self._noise = self._draw_noise()
                noise = next(self._noise)
            n_angle, n_velocity, n_torque, n_output_angle, n_output_velocity, n_load, n_outside = noise
            output_angle += n_output_angle  # the noise of the one encoder that both output angles come from
            self._reading = _new_reading(
                (
                    angle + n_angle,
                    velocity + n_velocity,
                    torque + n_torque,
                    output_angle,
                    output_velocity + n_output_velocity,
                    load + n_load,
                    output_angle,
                    outside + n_outside,
                    gear,
                    winding,
                )
            )
        return self._reading

    def truth(self) -> PlantTruth:
        """Give the state itself, which no instrument shows."""
        s = self._state.tolist()
        return PlantTruth(
            time=self.time,
            motor_position=s[stepper.MOTOR_POSITION],
            motor_velocity=s[stepper.MOTOR_VELOCITY],
            output_position=s[stepper.OUTPUT_POSITION],
            output_velocity=s[stepper.OUTPUT_VELOCITY],
            rim_position=s[stepper.RIM],
            motor_torque=s[stepper.MOTOR_TORQUE],
            load_torque=s[stepper.LOAD_TORQUE],
            output_torque=s[stepper.OUTPUT_TORQUE],
            flexspline_torque=s[stepper.T_F_NOW],
            wave_generator_torque=s[stepper.T_W_NOW],
            motor_current=s[stepper.SHOWN_TORQUE] / self._derived.torque_constant,
            temperature=s[stepper.GEAR_TEMPERATURE],
            motor_temperature=s[stepper.WINDING_TEMPERATURE],
            work=s[stepper.WORK],
            heat=s[stepper.DISSIPATED],
            effect_work=s[stepper.EFFECT_WORK],
            stored=self._stored_energy(),
        )

    def _draw_noise(self) -> Iterator[list[float]]:
        """Draw the noise of the next readings, in the order of `_seen`; the temperatures have none."""
        c = self.config
        drawn = self._random.standard_normal((_NOISE_BLOCK, 7))
        drawn *= (
            c.motor_angle_noise,
            c.motor_velocity_noise,
            c.motor_torque_noise,
            c.output_angle_noise,
            c.load_velocity_noise,
            c.load_torque_noise,
            c.output_torque_noise,
        )
        return iter(drawn.tolist())

    def _stored_energy(self) -> float:
        s: list[float]
        s, c = self._state.tolist(), self._derived
        flexspline = s[stepper.OUTPUT_POSITION] - s[stepper.ERROR] - s[stepper.SERIES_ANGLE] - s[stepper.RIM]
        wave_generator = s[stepper.MOTOR_POSITION] + c.ratio * s[stepper.RIM] + s[stepper.COUPLING_ANGLE]
        energy = _FLEXSPLINE_ENERGY[self.config.law](flexspline, c)
        energy += springs.wave_generator_energy(wave_generator, c)
        # the speeds half a step before and after now differ from that of now by these
        kick_m = 0.5 * c.step * s[stepper.MOTOR_FORCE] / c.motor_inertia
        kick_o = 0.5 * c.step * (s[stepper.OUTPUT_FORCE] + s[stepper.FIXTURE_TORQUE]) / c.output_inertia
        energy += 0.5 * c.motor_inertia * (s[stepper.MOTOR_VELOCITY] ** 2 - kick_m**2)
        energy += 0.5 * c.output_inertia * (s[stepper.OUTPUT_VELOCITY] ** 2 - kick_o**2)
        return energy + self._fixture_energy()

    def _fixture_energy(self) -> float:
        """Give the energy in the fixture's spring, J; it is lost when the fixture opens."""
        if not self.locked:
            return 0.0
        stretch = float(self._state[stepper.OUTPUT_POSITION] - self._inputs[stepper.LOCK_POSITION])
        return 0.5 * self.config.fixture_stiffness * stretch**2


def _check_parts(config: PlantConfig, effects: Sequence[ActiveEffect]) -> None:
    """Raise ModelError unless a plant can be made of these, whatever they say."""
    if not isinstance(config, PlantConfig):
        raise ModelError(f"config = {shown(config)} is not possible: a plant needs a PlantConfig.")
    if not is_series(effects):
        raise ModelError(f"effects = {shown(effects)} are not possible: they must be a sequence of ActiveEffect.")
    for number, active in enumerate(effects):
        if not isinstance(active, ActiveEffect):
            raise ModelError(f"effects[{number}] = {shown(active)} is not possible: it must be an ActiveEffect.")


def _check_seed(seed: object) -> None:
    """Raise ModelError unless the noise can be drawn from it."""
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise ModelError(f"seed = {shown(seed)} must be a whole number of at least 0; the instruments' noise needs it.")


def _is_finite(value: float) -> bool:
    """Tell whether a value is a finite number, whatever it is."""
    try:
        return math.isfinite(value)
    except (TypeError, OverflowError):
        return False


def _told(active: ActiveEffect) -> str:
    """Give an effect with its values, as a message names it."""
    pairs = zip(active.effect.parameters, active.values, strict=True)
    values = (f"{p.name} = {value:g}{'' if p.unit == '1' else f' {p.unit}'}" for p, value in pairs)
    return f"{active.effect.id} ({', '.join(values)})"


def _unknown(axis: str) -> NoReturn:
    raise ModelError(f"axis = {shown(axis)} is unknown; the plant has {', '.join(_AXES)}.")
