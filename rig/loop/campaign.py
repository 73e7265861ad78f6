"""A campaign: which runs are fitted and which are held out, decided before the first fit.

Runs are the unit; replicates stay on one side; without `--held-out` about a quarter of the runs of each procedure is
drawn with a seed, those last that alone went somewhere: what only they show is learnt from them or not at all.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import PurePath

import numpy as np

from drivers.errors import ConfigError, DataError, Mistake
from rig.log.run import Run
from rig.loop.files.model_file import Model
from rig.loop.outermost import outermost
from sim_backend.model.compliance import Compliance

FEWEST_RUNS = 2
"""Runs of a campaign at least: one to fit, one to hold out."""

MOST_LISTED = 8
"""Names of runs in a message."""

HELD_OUT_SHARE = 0.25
"""Share of each procedure's groups that is held out when nothing is said; at least one where there are two."""


@dataclass(frozen=True, slots=True)
class LoopOptions:
    """`held_out`: patterns of file names; `alpha`: false-alarm probability; `base`: model to start from.

    `compliance`: law of the flexspline; None: that of `base`, or the arctan. `scheduler`: address of a Dask scheduler
    on whose workers the runs are worked on; None: this machine.
    """

    held_out: tuple[str, ...] = ()
    alpha: float = 0.01
    seed: int = 0
    base: Model | None = None
    compliance: Compliance | None = None
    scheduler: str | None = None

    @property
    def law(self) -> Compliance:
        """The law of the flexspline to fit."""
        return self.compliance or (Compliance.ARCTAN if self.base is None else self.base.base.law)


@dataclass(frozen=True, slots=True)
class Campaign:
    """Runs to fit and runs to look at once, at the end."""

    train: tuple[Run, ...]
    held_out: tuple[Run, ...]
    warnings: tuple[str, ...]


def split_runs(runs: Sequence[Run], options: LoopOptions) -> Campaign:
    """Divide the runs. Raises DataError where nothing can be held out, ConfigError on patterns that leave one side."""
    names = [run.name for run in runs]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise DataError(twice[0], "two runs have this name", expected="one name a run", hint="Rename one of the files.")
    if len(runs) < FEWEST_RUNS:
        what = names[0] if names else "no run"
        raise DataError(
            what,
            f"{len(runs)} run(s): nothing can be held out",
            value=len(runs),
            expected="at least two runs",
            hint="Record a further run, or cut one recording into runs with [run.split] of the mapping.",
        )
    warnings: list[str] = []
    if options.held_out:
        train, held_out = _by_pattern(runs, options.held_out, warnings)
    else:
        train, held_out = _drawn(runs, options.seed, warnings)
    if not options.held_out and not held_out:
        groups = sorted({run.replicate for run in runs if run.replicate is not None})
        raise DataError(
            _listed(names),
            f"{len(runs)} runs, but no procedure has two that are no replicates of each other"
            + (f" (replicates of {', '.join(groups)})" if groups else "")
            + ": nothing can be held out",
            value=len(runs),
            expected="a procedure with two runs under different conditions",
            hint="Record a further run at another start angle or rate, or name the run to hold out with --held-out.",
        )
    blocks = sum(run.metadata.get("split", "") != "" for run in runs)
    if blocks:
        warnings.append(
            f"Weak hold-out: {blocks} runs are parts of one recording; drift, load and direction are not tested by it."
        )
    if len(train) == 1:
        warnings.append(
            f"Weak fit: only one run is fitted: {train[0].name}. What it alone shows cannot be told from what every "
            "run shows: record further runs, at other angles and rates."
        )
    return Campaign(tuple(train), tuple(held_out), tuple(warnings))


def _by_pattern(runs: Sequence[Run], patterns: Sequence[str], warnings: list[str]) -> tuple[list[Run], list[Run]]:
    def matches(run: Run, pattern: str) -> bool:
        # a path, as other commands take it, ends in the name of the file
        meant = (pattern, PurePath(pattern).name)
        return any(fnmatch(name, one) for name in (run.file.name, run.file.stem, run.name) for one in meant)

    idle = [pattern for pattern in patterns if not any(matches(run, pattern) for run in runs)]
    if idle:
        rule = f"matches none of the {len(runs)} runs: {_listed([run.name for run in runs])}"
        raise ConfigError("--held-out", [Mistake("pattern", pattern, rule) for pattern in idle])
    chosen = {run.name for run in runs if any(matches(run, pattern) for pattern in patterns)}
    groups = {(run.procedure, run.replicate) for run in runs if run.name in chosen and run.replicate is not None}
    moved = [run for run in runs if (run.procedure, run.replicate) in groups and run.name not in chosen]
    if moved:
        names = ", ".join(run.name for run in moved)
        warnings.append(f"Replicates stay on one side: held out as well: {names}.")
    out = chosen | {run.name for run in moved}
    if len(out) == len(runs):
        rule = "no run is left to fit; replicates of a run go with it: " + _listed([run.name for run in runs])
        raise ConfigError("--held-out", [Mistake("pattern", " ".join(patterns), rule)])
    return [run for run in runs if run.name not in out], [run for run in runs if run.name in out]


def _drawn(runs: Sequence[Run], seed: int, warnings: list[str]) -> tuple[list[Run], list[Run]]:
    rng = np.random.default_rng(seed)
    out: set[str] = set()
    for procedure in dict.fromkeys(run.procedure for run in runs):
        groups: dict[str, list[Run]] = {}
        for run in runs:
            if run.procedure is procedure:
                groups.setdefault(run.replicate or f"run {run.name}", []).append(run)
        single = [name for name, members in groups.items() if len(members) == 1]
        several = [name for name, members in groups.items() if len(members) > 1]
        if len(groups) < 2:
            continue
        count = min(max(1, round(HELD_OUT_SHARE * len(groups))), len(groups) - 1)
        # replicates measure the floor: single runs are held out first
        order = [single[k] for k in rng.permutation(len(single))] + [several[k] for k in rng.permutation(len(several))]
        lone = outermost(groups)
        order.sort(key=lambda name: name in lone)
        out |= {run.name for name in order[:count] for run in groups[name]}
    warnings.append(f"Held out (drawn with seed {seed}): {', '.join(sorted(out)) or 'none'}.")
    return [run for run in runs if run.name not in out], [run for run in runs if run.name in out]


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST_LISTED} more" if len(names) > MOST_LISTED else ""
    return ", ".join(names[:MOST_LISTED]) + more
