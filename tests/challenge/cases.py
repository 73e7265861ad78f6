"""The cases of the blind test: from family and seed, what is hidden in which campaign, and how large it is to be."""

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from tests.challenge.outside import OUTSIDE, acting, draw_constants
from tests.independent.campaign import NESTED_PEAKS, STANDARD, Campaign, Plan
from tests.independent.draws import DRAWN, draw
from tests.independent.instruments import Instruments, NoiseKind
from tests.independent.laws import Drive, shd_17_100
from tests.independent.terms import Effects, Line, Term

DEVELOPMENT = range(1000, 10000)
"""Seeds to work with."""

REPORT = range(50000, 90000)
"""Seeds for figures that are told: not to be looked at while the loop is changed."""

UNSEEN = range(82000, REPORT.stop)
"""Those of them that no table has been made of: to be moved on with every figure that is told."""

RATE = 100.0
"""Samples a second of the generator's campaigns."""

RICH = replace(STANDARD, free_runs=4, loaded_free_runs=2)
"""As the standard campaign, but with a free run under load on either side: that of the standard one is held out, and
what shows there alone cannot be learnt."""

LEAN = Plan(
    locked_angles=6,
    locked_pairs=1,
    backdrives=3,
    backdrive_pairs=1,
    free_runs=2,
    free_run_pairs=1,
    peaks=NESTED_PEAKS,
)
"""Few runs, short and at usual rates: no holds, no load while turning, no ladder of speeds, nearly one temperature."""

PLANS: Mapping[str, Plan] = MappingProxyType({"rich": RICH, "lean": LEAN})

EFFECTS = ("kinematic-error", "cogging", "gravity-load", *(name for name in DRAWN if name != "inertia"))
"""Every effect of the catalogue that is no base term."""

EVENT = "encoder-missed-counts"
"""What does not repeat."""

SHOWN_BY: Mapping[str, frozenset[str]] = MappingProxyType(
    {
        "rates and holds": frozenset({"creep", "rate-dependent-hysteresis"}),
        "loads while turning": frozenset({"torque-ripple", "load-dependent-friction", "torque-constant-saturation"}),
        "a ladder of speeds": frozenset({"stribeck-friction"}),
        "cold and warm": frozenset(
            {
                "temperature-dependent-stiffness",
                "temperature-dependent-friction",
                "thermal-expansion",
                "torque-sensor-drift",
            }
        ),
    }
)
"""What `LEAN` lacks, and which effects docs/effects.md tells apart by it: there a set that holds the truth is right."""

NOISE_SHARES = (0.55, 0.15, 0.15, 0.15)
"""How often white, coloured, heavy-tailed and load-proportional noise comes with an effect."""


@dataclass(frozen=True, slots=True)
class AmbiguousDesign:
    """A campaign that cannot tell, and effects that it cannot tell from others.

    `size`: in floors, None where the base takes up nearly all of it: then as usually drawn. `without`: signals that
    are not recorded.
    """

    plan: Plan
    effects: tuple[str, ...]
    size: float | None = 2.0
    without: tuple[str, ...] = ()


AMBIGUOUS: Mapping[str, AmbiguousDesign] = MappingProxyType(
    {
        "one start angle": AmbiguousDesign(
            replace(LEAN, locked_angles=1, sweeps_per_angle=6, locked_pairs=2, free_runs=0, free_run_pairs=0),
            ("kinematic-error", "stiffness-modulation"),
        ),
        "one rate": AmbiguousDesign(
            replace(LEAN, locked_angles=8, locked_pairs=2, torque_rates=(4.0,), sine_share=0.0),
            ("channel-delay", "torque-sensor-lag"),
        ),
        "locked sweeps alone": AmbiguousDesign(
            replace(
                LEAN,
                locked_angles=8,
                locked_pairs=2,
                backdrives=0,
                backdrive_pairs=0,
                free_runs=0,
                free_run_pairs=0,
            ),
            ("fixture-compliance", "torque-sensor-gain", "torque-constant-error"),
            None,
        ),
        "one direction, one current, no output encoder": AmbiguousDesign(
            replace(
                LEAN,
                locked_angles=0,
                locked_pairs=0,
                backdrives=0,
                backdrive_pairs=0,
                free_runs=4,
                one_way=True,
                slow_speed=(20.0, 22.0),
                fast_speed=(28.0, 30.0),
            ),
            ("cogging", "position-dependent-friction", "torque-ripple"),
            without=("output_position",),
        ),
        "encoder never re-clocked": AmbiguousDesign(RICH, ("motor-encoder-eccentricity",)),
    }
)
"""By name; the sets are those of docs/effects.md, "group that other data would not split"."""


@dataclass(frozen=True, slots=True)
class Case:
    """One campaign and what is to be hidden in it. `size`: of every hidden thing, in floors; None: as drawn.

    `hidden`: effects as drawn, each to be scaled by itself; `outside` and `constants`: physics of no catalogue.
    `design`: name of the plan or of the ambiguous design. `without`: signals that are not recorded.
    """

    family: str
    seed: int
    design: str
    plan: Plan
    noise: NoiseKind
    drive: Drive
    hidden: tuple[Effects, ...] = ()
    outside: str | None = None
    constants: Mapping[str, float] = field(default_factory=dict)
    size: float | None = 1.0
    without: tuple[str, ...] = ()

    @property
    def ids(self) -> tuple[str, ...]:
        """Catalogue ids of what is hidden."""
        return tuple(effects.ids()[0] for effects in self.hidden)

    @property
    def needs(self) -> str | None:
        """What the plan lacks to show the hidden effect for what it is; None where it lacks nothing."""
        if self.plan != LEAN:
            return None
        return next((what for what, ids in SHOWN_BY.items() if ids & set(self.ids)), None)


def make_case(family: str, seed: int) -> Case:
    """Give the case of a family and a seed. Raises ValueError for an unknown family."""
    if family not in FAMILIES:
        raise ValueError(f"no family '{family}' of cases; there are: {', '.join(FAMILIES)}")
    return FAMILIES[family](seed, np.random.default_rng([seed, zlib.crc32(family.encode())]))


def campaign_of(case: Case, effects: Effects, outside_amplitude: float = 0.0, *, countless: bool = False) -> Campaign:
    """Give the campaign with these effects in it. `countless`: read by encoders without counts."""
    outside = None if case.outside is None else OUTSIDE[case.outside]
    turns = 0 if outside is not None and outside.absolute else Instruments().largest_turn
    instruments = Instruments(noise=case.noise, largest_turn=turns)
    if countless:
        instruments = replace(instruments, motor_counts=2**32, output_counts=2**37)
    further = None if case.outside is None else acting(case.outside, outside_amplitude, case.constants)
    return Campaign(case.seed, effects, case.drive, instruments, case.plan, RATE, further)


def scaled(effects: Effects, factor: float) -> Effects:
    """Give the same effect `factor` times as large: its amplitude, or everything that makes its size."""
    return Effects(
        tuple(Line(line.order, factor * line.amplitude, line.phase) for line in effects.kinematic_error),
        tuple(Line(line.order, factor * line.amplitude, line.phase) for line in effects.cogging),
        replace(effects.gravity_load, moment=factor * effects.gravity_load.moment),
        tuple(_scaled_term(item, factor) for item in effects.others),
    )


def together(hidden: tuple[Effects, ...]) -> Effects:
    """Give all of them at once."""
    joined = Effects()
    for effects in hidden:
        joined = joined + effects
    return joined


SIZES = frozenset({"per_kelvin", "per_second", "even", "odd", "delay", "time_constant"})
"""Parameters that make the size of an effect without an amplitude."""


def _scaled_term(item: Term, factor: float) -> Term:
    names = {name for name, _ in item.parameters}
    sizes = {"amplitude"} if "amplitude" in names else SIZES
    values = {name: factor * value if name in sizes else value for name, value in item.parameters}
    if item.id == EVENT:
        values["amplitude"] = max(1.0, round(values["amplitude"]))  # whole counts
    return Term(item.id, tuple(values.items()))


def _drive(rng: np.random.Generator) -> Drive:
    """Draw a drive near its catalogue: springs within 5 %, what a test measures within 10 %."""
    base = shd_17_100()
    near = {name: getattr(base, name) * float(rng.uniform(0.95, 1.05)) for name in ("K_F0", "C_F")}
    near |= {
        name: getattr(base, name) * float(rng.uniform(0.9, 1.1)) for name in ("K_w0", "C_w", "T_fs", "T_fb", "T_c", "b")
    }
    return replace(base, **near)


def _noise(rng: np.random.Generator) -> NoiseKind:
    return list(NoiseKind)[int(rng.choice(len(NOISE_SHARES), p=NOISE_SHARES))]


def _single(seed: int, rng: np.random.Generator, family: str = "single", size: float = 1.0) -> Case:
    """All effects in turn on one plan, then all on the other."""
    effect, design = EFFECTS[seed % len(EFFECTS)], list(PLANS)[seed // len(EFFECTS) % len(PLANS)]
    drive, noise = _drive(rng), _noise(rng)
    return Case(family, seed, design, PLANS[design], noise, drive, (draw(effect, rng),), size=size)


def _third(seed: int, rng: np.random.Generator) -> Case:
    return _single(seed, rng, "third", 1.0 / 3.0)


GROUPS = (
    frozenset({"torque-sensor-gain", "torque-constant-error"}),
    frozenset({"torque-sensor-lag", "channel-delay"}),
    frozenset({"kinematic-error", "motor-encoder-eccentricity"}),
)
"""What no campaign here tells apart: not two of one group in a pair."""


def _pair(seed: int, rng: np.random.Generator) -> Case:
    """Two different effects, each of the floor's size; not two that the same page calls one group, and no event."""
    drive, noise = _drive(rng), _noise(rng)
    repeating = [name for name in EFFECTS if name != EVENT]
    while True:
        one, two = (str(name) for name in rng.choice(repeating, 2, replace=False))
        if not any({one, two} <= group for group in GROUPS):
            return Case("pair", seed, "rich", RICH, noise, drive, (draw(one, rng), draw(two, rng)))


def _outside(seed: int, rng: np.random.Generator) -> Case:
    kind = list(OUTSIDE)[seed % len(OUTSIDE)]
    design = "rich" if OUTSIDE[kind].rich else list(PLANS)[seed // len(OUTSIDE) % len(PLANS)]
    drive, noise = _drive(rng), _noise(rng)
    constants = draw_constants(kind, rng)
    return Case("outside", seed, design, PLANS[design], noise, drive, (), kind, constants)


def _none(seed: int, rng: np.random.Generator) -> Case:
    """The four kinds of noise in turn, then all on the other plan; lean ones three times as often as rich ones."""
    kinds = list(NoiseKind)
    design = "rich" if seed // len(kinds) % 4 == 0 else "lean"
    return Case("none", seed, design, PLANS[design], kinds[seed % len(kinds)], _drive(rng))


def _ambiguous(seed: int, rng: np.random.Generator) -> Case:
    all_of_them = [(name, effect) for name, design in AMBIGUOUS.items() for effect in design.effects]
    name, effect = all_of_them[seed % len(all_of_them)]
    design = AMBIGUOUS[name]
    drive, noise = _drive(rng), _noise(rng)
    hidden = draw(effect, rng)
    if hidden.cogging:  # two orders of a comb would give it away
        hidden = replace(hidden, cogging=hidden.cogging[:1])
    return Case("ambiguous", seed, name, design.plan, noise, drive, (hidden,), size=design.size, without=design.without)


def _bench(seed: int, rng: np.random.Generator) -> Case:
    """Give an effect as drawn: on the bench its size is what it is. Its procedures have one rate and no load."""
    order = np.random.default_rng(0).permutation(len(EFFECTS))  # neighbouring seeds are effects of different kinds
    hidden = draw(EFFECTS[order[seed % len(EFFECTS)]], rng)
    return Case("bench", seed, "procedures", LEAN, NoiseKind.WHITE, shd_17_100(), (hidden,))


FAMILIES: Mapping[str, Callable[[int, np.random.Generator], Case]] = MappingProxyType(
    {
        "single": _single,
        "third": _third,
        "pair": _pair,
        "outside": _outside,
        "none": _none,
        "ambiguous": _ambiguous,
        "bench": _bench,
    }
)
"""All of the independent generator but `bench`, of the simulated bench."""

LARGEST = 30.0
"""Times its drawn size that an effect is made at most; what is still too small then is told apart."""
