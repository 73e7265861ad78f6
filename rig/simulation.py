"""Build the simulated bench for a bench file: plant from the device under test or a fitted model, nodes, bus, clock."""

import math
import secrets
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Any

from drivers.clock import VirtualClock
from drivers.errors import ConfigError, Mistake, RigError
from rig.bench import Bench
from rig.config.bench import SIMULATED, BenchFile, Device, Lock
from rig.config.catalogue import beyond_limits
from rig.config.dut import Dut, Rotation, default_dut
from rig.loop.files.model_file import Model, ModelEffect, ModelLine
from rig.loop.model.frames import turned, turned_shape
from rig.loop.model.parameters import flexspline_entries
from rig.loop.model.shapes import ShapeTerm, named_effect
from rig.loop.model.terms import Entry, Line, TermClass, is_line, periodic_effects
from rig.operator import Answered
from sim_backend.errors import ModelError, NotFiniteError, ParameterError
from sim_backend.model.compliance import LAWS, Compliance
from sim_backend.model.effects import CATALOGUE, ActiveEffect, Effect
from sim_backend.model.estimation import LOSS, PIECEWISE_EQUATION, flexspline_from_catalogue, wave_generator_from_tests
from sim_backend.model.parameters import Cubic, HarmonicDrive, Piecewise, PlantConfig
from sim_backend.nodes.bench import LOAD_DRIVE, MOTOR_DRIVE, OUTPUT_ENCODER, TORQUE_TRANSDUCER
from sim_backend.nodes.communication import CanopenNode
from sim_backend.nodes.drive402 import drive_node
from sim_backend.nodes.encoder406 import encoder_node
from sim_backend.nodes.torque404 import torque_node
from sim_backend.plant import Plant
from sim_backend.world import World

LEAST_RATED_TORQUE = 1e-3
MOST_RATED_TORQUE = (2**32 - 1) * 1e-3
"""N*m; the rated torque of a CiA 402 drive (0x6076) is a whole number of mN*m in 32 bits."""

MOST_RATED_CURRENT = (2**32 - 1) * 1e-3
"""A; the rated current (0x6075) is a whole number of mA in 32 bits."""

DRIVE_MARGIN = 1.175
"""Rated torque of the simulated drives over what the gear's rated torque asks of them."""

LOAD_MOTOR_INERTIA = 5e-3
"""Rotor of the simulated load drive, kg*m^2, rigidly on the output."""

SUBDIVISION = "encoder-subdivision-error"
"""Effect whose order is the line count of the output encoder, or twice it."""

PLANT_LAWS: Mapping[Compliance, type[Cubic] | type[Piecewise]] = MappingProxyType(
    {Compliance.CUBIC: Cubic, Compliance.PIECEWISE: Piecewise}
)
"""Laws that the plant takes in place of the drive's own."""

SAME_ORDER = 1e-3
"""1/rev within which a line has the order that an effect of fixed order has."""

VISCOUS_SHARE = 0.01
"""Assumed viscous friction at the motor, N*m*s per N*m of starting torque: 1.2e-4 N*m*s for 12 mN*m."""


@dataclass(frozen=True, slots=True)
class SimulatedBench:
    """A bench (not opened yet) with its world, and what had to be assumed to build it."""

    bench: Bench
    world: World
    plant: Plant
    assumed: tuple[str, ...]


class SimulationError(RigError):
    """The simulated plant was lost: its numbers would not stay finite. `time`: s; `signals`: what was lost."""

    def __init__(self, message: str, *, time: float, signals: tuple[str, ...]) -> None:
        self.time = time
        self.signals = signals
        super().__init__(message, time=time, signals=list(signals))


class _BenchPlant:
    """The plant in the world of a bench: that it was lost ends a run as a fault of the bench does."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self.set_lock = plant.set_lock

    def advance_to(self, time: float) -> None:
        """Integrate up to `time` (s). Raises SimulationError."""
        try:
            self._plant.advance_to(time)
        except NotFiniteError as error:
            raise SimulationError(str(error), time=error.time, signals=error.signals) from error


class _WorldLock:
    """The fixture of the simulated bench; it needs no time and no hands."""

    def __init__(self, world: World) -> None:
        self._world = world

    def set_lock(self, locked: bool) -> Answered:
        """Lock or release the output at once."""
        self._world.set_lock(locked)
        return lambda: True


def as_simulated(bench: BenchFile) -> BenchFile:
    """Give the same bench with every device simulated on one bus, for a dry run against its limits."""
    devices = {
        role: Device(driver=device.driver, interface=SIMULATED, channel="dry run", node=node)
        for node, (role, device) in enumerate(bench.devices.items(), start=1)
    }
    lock = Lock.NONE if bench.fixture.lock is Lock.NONE else Lock.SIMULATED
    return bench.model_copy(update={"devices": devices, "fixture": bench.fixture.model_copy(update={"lock": lock})})


def simulate(
    bench: BenchFile,
    dut: Dut,
    model: Model | None = None,
    effects: Sequence[ActiveEffect] = (),
    seed: int | None = None,
    revise: Callable[[PlantConfig], PlantConfig] = lambda config: config,
) -> SimulatedBench:
    """Build the bench that is not there.

    `effects` are added to those of `model`; `seed` fixes the instruments' noise, None draws one; `revise` changes what
    dut or model do not say. Raises ConfigError if they, or its result, describe a drive that cannot be.
    """
    assumed: list[str] = []
    source = f"model of '{dut.name}'" if model is not None else f"dut '{dut.name}'"
    mistakes = [*_drive_mistakes(bench, dut), *_catalogue_mistakes(dut, model)]
    if dut.gear.rotation is Rotation.SAME:
        bench = _motor_mirrored(bench)
    if mistakes:
        raise ConfigError(source, mistakes, hint="The simulated bench, which a dry run needs too, cannot be built.")
    try:
        config = revise(_plant_config(bench, dut, model, assumed))
        active = (*(effects_of_model(model, assumed) if model is not None else ()), *effects)
        _check_output_encoder(active, dut)
        plant = Plant(config, active, seed=secrets.randbits(31) if seed is None else seed)
        nodes = tuple(_node(role, device, plant, dut) for role, device in bench.devices.items())
    except (ModelError, OverflowError) as error:
        raise ConfigError(source, [Mistake("simulated bench", dut.name, str(error).rstrip("."))]) from error
    world = World(_BenchPlant(plant), nodes)
    keys = {(device.interface, device.channel) for device in bench.devices.values()}
    if len(keys) > 1:
        raise ConfigError(
            bench.name,
            [Mistake("devices", sorted(keys), "the simulated bench has one bus; give its devices one channel")],
        )
    fixture = _WorldLock(world) if bench.fixture.lock is Lock.SIMULATED else None
    clock = VirtualClock(world)
    return SimulatedBench(Bench(bench, clock, fixture, dict.fromkeys(keys, world.bus)), world, plant, tuple(assumed))


def _motor_mirrored(bench: BenchFile) -> BenchFile:
    """Count the motor's angle and torque the other way round: the plant turns its output against the motor only."""
    motor = bench.devices["motor"]
    turned = {name: -motor.sign.get(name, 1) for name in ("motor_position", "motor_torque")}
    mirrored = motor.model_copy(update={"sign": {**motor.sign, **turned}})
    return bench.model_copy(update={"devices": {**bench.devices, "motor": mirrored}})


def _plant_config(bench: BenchFile, dut: Dut, model: Model | None, assumed: list[str]) -> PlantConfig:
    drive = _drive_from_dut(dut, assumed) if model is None else drive_of_model(model, assumed)
    config = PlantConfig(
        drive=drive,
        flexspline=None if model is None else flexspline_of_model(model),
        torque_constant=_torque_constant(dut),
        encoder_counts=_motor_counts(dut),
        motor_rated_torque=_motor_rated_torque(dut),
        load_rated_torque=_load_rated_torque(dut),
    )
    if dut.motor.inertia is not None:
        config = replace(config, rotor_inertia=dut.motor.inertia)
    output = config.output_inertia if dut.output.inertia is None else dut.output.inertia
    return replace(config, output_inertia=output + (LOAD_MOTOR_INERTIA if "load" in bench.devices else 0.0))


def _drive_mistakes(bench: BenchFile, dut: Dut) -> Iterator[Mistake]:
    """Name the rated torque or torque constant for which a drive has no numbers."""
    drives = {"motor": _motor_rated_torque(dut), "load": _load_rated_torque(dut)}
    for role, torque in drives.items():
        if role in bench.devices and not LEAST_RATED_TORQUE <= torque <= MOST_RATED_TORQUE:
            rule = (
                f"asks for a {role} drive with a rated torque of {torque:.4g} N*m, which can be "
                f"{LEAST_RATED_TORQUE:g} to {MOST_RATED_TORQUE:.4g} N*m"
            )
            yield Mistake("gear.rated_torque", dut.gear.rated_torque, rule)
            return
    constant = dut.motor.torque_constant
    if constant is not None and drives["motor"] / constant > MOST_RATED_CURRENT:
        rule = f"asks for a rated current of {drives['motor'] / constant:.4g} A, at most {MOST_RATED_CURRENT:.4g} A"
        yield Mistake("motor.torque_constant", constant, rule)


def _catalogue_mistakes(dut: Dut, model: Model | None) -> Iterator[Mistake]:
    """Name the catalogue values from which no drive can be estimated, in the dut's keys.

    Of a model, only what it lacks is estimated; that K2 is above K1, the arctan law alone needs.
    """
    beyond = list(beyond_limits(dut))
    if beyond:
        yield from beyond
        return
    values = _catalogue(dut)
    caps: dict[str, Any] = {field.name: field.default for field in fields(PlantConfig)}
    K1, K2, T1, T2 = (values[name] for name in ("K1", "K2", "T1", "T2"))
    try:
        if model is None or _lacks_arctan(model):
            flexspline_from_catalogue(K1, K2, T1, T2)
    except ParameterError as error:
        of = ("T1", "T2") if error.name in ("T1", "T2") else ("K1", "K2")
        yield _keys(dut, *of, rule=f"{error.name} {error.rule}")
    if model is not None:
        return
    if caps["flexspline_stiffness_cap"] <= K1:
        rule = f"must be below {caps['flexspline_stiffness_cap']:g} N*m/rad; {PIECEWISE_EQUATION} needs it"
        yield _keys(dut, "K1", rule=rule)
    most = 0.5 * caps["wave_generator_stiffness_cap"] * values["ratio"] * values["hysteresis_loss"]
    if values["starting_torque"] >= most:
        rule = f"starting_torque must be below {most:.4g} N*m with this ratio and hysteresis loss; {LOSS} needs it"
        yield _keys(dut, "starting_torque", "hysteresis_loss", "ratio", rule=rule)


def _lacks_arctan(model: Model) -> bool:
    """Tell whether the model's flexspline follows (24) and one of its parameters must come from the catalogue."""
    return model.base.law is Compliance.ARCTAN and not set(LAWS[Compliance.ARCTAN].parameters) <= set(
        model.base.parameters
    )


def _keys(dut: Dut, *names: str, rule: str) -> Mistake:
    values = _catalogue(dut)
    shown = (f"{values[name]:g}" + (" (assumed)" if getattr(dut.gear, name) is None else "") for name in names)
    return Mistake(", ".join(f"gear.{name}" for name in names), ", ".join(shown), rule)


def _catalogue(dut: Dut) -> dict[str, float]:
    """Give the values that a drive is estimated from; what the dut lacks comes from the shipped one."""
    shipped = default_dut()[0].gear
    names = ("ratio", "K1", "K2", "T1", "T2", "hysteresis_loss", "starting_torque")
    own = {name: getattr(dut.gear, name) for name in names}
    return {name: getattr(shipped, name) if value is None else value for name, value in own.items()}


def _drive_from_dut(dut: Dut, assumed: list[str]) -> HarmonicDrive:
    """Estimate the drive from catalogue values, Zhang (29)-(35)."""
    catalogue = _catalogue(dut)
    for name, value in catalogue.items():
        if getattr(dut.gear, name) is None:
            assumed.append(f"gear.{name} = {value:g} (not in the dut file)")
    values = _estimated(catalogue, _arctan_of_catalogue(catalogue))
    assumed.append(f"viscous friction {values['viscous_friction']:.3g} N*m*s at the motor")
    return HarmonicDrive(**values)


def drive_of_model(model: Model, assumed: list[str]) -> HarmonicDrive:
    """Give the drive that a fitted model describes; what it does not hold comes from its dut.

    The flexspline of this drive follows (24); see `flexspline_of_model` for another law.
    """
    fitted = {name: estimate.value for name, estimate in model.base.parameters.items()}
    catalogue = _catalogue(model.dut)
    values = _estimated(catalogue, _arctan_of_catalogue(catalogue) if _lacks_arctan(model) else _unused_arctan(model))
    values |= {name: fitted[name] for name in ("K_F0", "C_F", "K_w0", "C_w") if name in fitted}
    values["ratio"] = model.base.ratio or values["ratio"]
    # of free runs alone the running friction is known, and the plant has one level for both
    level = fitted.get("T_fs", fitted.get("T_c"))
    if level is not None and level > 0.0:
        values["friction_torque"] = values["ratio"] * level
    if "b" in fitted:
        values["viscous_friction"] = max(0.0, fitted["b"])
    needed = (*LAWS[model.base.law].parameters, "K_w0", "C_w", "T_fs", "b")
    missing = [name for name in needed if name not in fitted]
    if "T_fs" in missing and level is not None and level > 0.0:
        missing.remove("T_fs")
        assumed.append(f"T_fs as the running friction T_c, {level:.4g} N*m (no T_fs in the model)")
    if missing:
        assumed.append(f"{', '.join(missing)} from the dut's catalogue values (not in the model)")
    return HarmonicDrive(**values)


def _estimated(catalogue: Mapping[str, float], arctan: tuple[float, float]) -> dict[str, float]:
    """Estimate the values of a HarmonicDrive from a catalogue's: wave generator by Zhang (33)-(35), and friction.

    `arctan`: the flexspline's K_F0 (N*m/rad) and C_F (1/(N*m)).
    """
    ratio, starting_torque = catalogue["ratio"], catalogue["starting_torque"]
    K_w0, C_w = wave_generator_from_tests(ratio, catalogue["hysteresis_loss"], starting_torque)
    return {
        "ratio": ratio,
        "K_F0": arctan[0],
        "C_F": arctan[1],
        "K_w0": K_w0,
        "C_w": C_w,
        "friction_torque": ratio * starting_torque,
        "viscous_friction": VISCOUS_SHARE * starting_torque,
    }


def _arctan_of_catalogue(catalogue: Mapping[str, float]) -> tuple[float, float]:
    """Give K_F0 (N*m/rad) and C_F (1/(N*m)) of the arctan law (24). Raises ModelError if no drive has the catalogue."""
    return flexspline_from_catalogue(*(catalogue[name] for name in ("K1", "K2", "T1", "T2")))


def _unused_arctan(model: Model) -> tuple[float, float]:
    """Give a K_F0 (N*m/rad) and C_F (1/(N*m)) for a drive whose flexspline does not follow its catalogue's arctan.

    The model replaces them, or its flexspline follows another law; so the catalogue may be that of a drive that
    softens (K2 below K1), which the arctan law cannot have.
    """
    K_F0, C_F = (entry.centre for entry in flexspline_entries(model.dut.gear, Compliance.ARCTAN))
    return K_F0, C_F


def flexspline_of_model(model: Model) -> Cubic | Piecewise | None:
    """Give the flexspline's law of a fitted model where it is not (24), with what the model lacks from its dut."""
    law = PLANT_LAWS.get(model.base.law)
    if law is None:
        return None
    entries = flexspline_entries(model.dut.gear, model.base.law)
    fitted = {name: estimate.value for name, estimate in model.base.parameters.items()}
    return law(**{entry.name: fitted.get(entry.name, entry.centre) for entry in entries})


def effects_of_model(model: Model, assumed: list[str]) -> tuple[ActiveEffect, ...]:
    """Give the fitted effects as the plant takes them, one per line; what it cannot run is said in `assumed`.

    A term without a catalogue name runs as the catalogue's effect of the same equation, variable and shape; where there
    is none, as one that follows the other angle, through the gear.
    """
    active: list[ActiveEffect] = []
    for fitted in model.effects:
        effect = named_effect(fitted.effect, fitted.parameters.keys())
        if fitted.lines:
            own = effect if effect is not None and is_line(effect) else None
            for line in fitted.lines:
                active += _line_of_model(fitted, line, own, model, assumed)
        elif effect is None:
            assumed.append(f"'{fitted.effect}' is left out: the simulated bench has no such effect")
        else:
            active += _shape_of_model(fitted, effect, model.dut, assumed)
    return tuple(active)


def _line_of_model(
    fitted: ModelEffect, line: ModelLine, effect: Effect | None, model: Model, assumed: list[str]
) -> Iterator[ActiveEffect]:
    """Give one line as the plant takes it (`effect`: of its name); one that it cannot run is left out, and said."""
    if effect is None:
        effect, order, mirrored = _of_no_name(fitted, line.order, model.base.ratio)
    else:
        order, mirrored = line.order, False
    if effect is None:
        assumed.append(
            f"'{fitted.effect}' is left out: the simulated bench has no effect in '{fitted.enters}' that follows "
            f"{fitted.variable} at order {line.order:.6g}; its logs will lack the line of {line.amplitude:.3g}"
        )
        return
    sine, cosine = line.amplitude * math.cos(line.phase), line.amplitude * math.sin(line.phase)
    kind = TermClass(None, Entry(fitted.enters), fitted.variable)
    # the plant turns its output against the motor, whatever the log's frame is
    phase = turned(Line(kind, line.order, sine, cosine), model.dut).phase
    values = {"order": order, "amplitude": line.amplitude, "phase": math.pi - phase if mirrored else phase}
    yield ActiveEffect(effect, tuple(values[p.name] for p in effect.parameters))


def _of_no_name(fitted: ModelEffect, order: float, ratio: float | None) -> tuple[Effect | None, float, bool]:
    """Give an effect of the catalogue that acts alike, its order, and whether it follows the other angle.

    The other angle runs back, and its zero is the plant's: output_position = -motor_position / ratio.
    """
    geared = {} if ratio is None else {"motor_position": order * ratio, "output_position": order / ratio}
    other = {"motor_position": "output_position", "output_position": "motor_position"}.get(fitted.variable, "")
    for variable, there in ((fitted.variable, order), (other, geared.get(fitted.variable))):
        for kind in periodic_effects():
            low, high = kind.orders
            acts = (kind.variable, kind.enters) == (variable, fitted.enters) and kind.effect is not None
            if acts and there is not None and low - SAME_ORDER <= there <= high + SAME_ORDER:
                return CATALOGUE[kind.effect or ""], there, variable == other
    return None, order, False


def _shape_of_model(fitted: ModelEffect, effect: Effect, dut: Dut, assumed: list[str]) -> Iterator[ActiveEffect]:
    """Give an effect that is no line as the plant takes it; one with impossible values is left out, and said."""
    given = {name: estimate.value for name, estimate in fitted.parameters.items()}
    missing = [parameter.name for parameter in effect.parameters if parameter.name not in given]
    if missing:
        assumed.append(f"'{fitted.effect}' is left out: the model gives it no {', '.join(missing)}")
        return
    try:
        values = tuple(given[parameter.name] for parameter in effect.parameters)
        yield ActiveEffect(effect, turned_shape(ShapeTerm(effect, values), dut).values)
    except ModelError as error:
        assumed.append(f"'{fitted.effect}' is left out: {error}")


def _check_output_encoder(effects: Sequence[ActiveEffect], dut: Dut) -> None:
    """Raise ModelError if an effect assumes more lines of the output's encoder than the bench has."""
    output = _output_counts(dut)
    for active in effects:
        for parameter, value in zip(active.effect.parameters, active.values, strict=True):
            if active.effect.id == SUBDIVISION and parameter.name == "order" and value > output / 2:
                raise ModelError(
                    f"{active.effect.id}: order = {value!r} {parameter.unit} contradicts the bench, whose "
                    f"output encoder has {output} 1/rev: at most half of that; {active.effect.equation} needs it."
                )


def _motor_counts(dut: Dut) -> int:
    return dut.motor.encoder_counts or MOTOR_DRIVE.encoder_counts


def _output_counts(dut: Dut) -> int:
    return dut.output.encoder_counts or OUTPUT_ENCODER.encoder_counts


def _motor_rated_torque(dut: Dut) -> float:
    gear = dut.gear
    if gear.rated_torque is None or gear.ratio is None:
        return MOTOR_DRIVE.rated_torque
    return DRIVE_MARGIN * gear.rated_torque / gear.ratio


def _torque_constant(dut: Dut) -> float:
    return dut.motor.torque_constant or MOTOR_DRIVE.torque_constant


def _load_rated_torque(dut: Dut) -> float:
    return LOAD_DRIVE.rated_torque if dut.gear.rated_torque is None else 1.25 * dut.gear.rated_torque


def _node(role: str, device: Device, plant: Plant, dut: Dut) -> CanopenNode:
    match role:
        case "motor":
            config = replace(
                MOTOR_DRIVE,
                node_id=device.node,
                encoder_counts=_motor_counts(dut),
                rated_torque=_motor_rated_torque(dut),
                max_torque=3 * _motor_rated_torque(dut),
                torque_constant=_torque_constant(dut),
            )
            return drive_node(config, plant)
        case "load":
            rated = _load_rated_torque(dut)
            return drive_node(replace(LOAD_DRIVE, node_id=device.node, rated_torque=rated, max_torque=3 * rated), plant)
        case "output_encoder":
            counts = _output_counts(dut)
            turns = min(OUTPUT_ENCODER.turns, 2 ** int(math.log2(2**32 // counts)))
            return encoder_node(replace(OUTPUT_ENCODER, node_id=device.node, encoder_counts=counts, turns=turns), plant)
        case _:
            return torque_node(replace(TORQUE_TRANSDUCER, node_id=device.node), plant)
