"""The loop by the wall clock: cost by samples, by runs and by processes, and campaigns of the sizes that have a bar."""

import statistics
from dataclasses import dataclass, replace
from unittest.mock import patch

import numpy as np

from drivers.clock import RealClock
from rig.loop.campaign import LoopOptions
from rig.loop.trace import trace
from tests.challenge.sizes import as_runs
from tests.independent.campaign import Campaign, Plan, held_out
from tests.independent.draws import draw
from tests.rig.loop.runs import dut

TWENTY = Plan(
    locked_angles=8, locked_pairs=2, backdrives=5, backdrive_pairs=1, free_runs=3, free_run_pairs=1, output_turns=1.2
)
TEN = replace(TWENTY, locked_angles=4, locked_pairs=1, backdrives=2, free_runs=1)
FORTY = replace(
    TWENTY, locked_angles=16, locked_pairs=4, backdrives=10, backdrive_pairs=2, free_runs=6, free_run_pairs=2
)
"""Plans of 20, 10 and 40 runs."""

SEED = 5
ROUNDS = 3


@dataclass(frozen=True, slots=True)
class Size:
    """A campaign of so many samples; `bar`: seconds it may take on two cores, None where none is set."""

    plan: Plan
    samples: int
    bar: float | None = None


REFERENCE = Size(TWENTY, 200_000, 10.0)
SIZES = (
    REFERENCE,
    Size(TWENTY, 100_000),
    Size(TWENTY, 400_000),
    Size(TEN, 100_000),
    Size(FORTY, 400_000),
    Size(TWENTY, 1_000_000, 60.0),
)


@dataclass(frozen=True, slots=True)
class Taken:
    """What tracing took: runs and samples of the campaign, seconds, and what was found."""

    runs: int
    samples: int
    seconds: float
    effects: tuple[str, ...]


def campaign_of(plan: Plan, samples: int) -> Campaign:
    """Give a campaign with a kinematic error and about so many samples, at whatever rate that takes."""
    campaign = Campaign(SEED, draw("kinematic-error", np.random.default_rng(SEED)), plan=plan, rate=20.0)
    seconds = sum(float(recording.time[-1]) for recording in campaign.recordings())
    return replace(campaign, rate=samples / seconds)


def traced(size: Size, processes: int) -> Taken:
    """Trace a campaign with so many processes."""
    recordings = campaign_of(size.plan, size.samples).recordings()
    runs = as_runs(recordings)
    clock = RealClock()
    started = clock.now()
    with patch("rig.loop.workers.hold.cores", return_value=processes):
        result = trace(runs, dut(), LoopOptions(held_out=held_out(recordings)))
    return Taken(len(runs), sum(run.time.size for run in runs), clock.now() - started, result.effects)


def main() -> None:
    traced(Size(TEN, 20_000), 1)  # compiles what is not compiled yet
    rounds = [(traced(REFERENCE, 1).seconds, traced(REFERENCE, 2).seconds) for _ in range(ROUNDS)]
    one, two = (statistics.median(row[k] for row in rounds) for k in (0, 1))
    gains = sorted(row[0] / row[1] for row in rounds)
    print(f"  {REFERENCE.samples} samples in 20 runs: {one:.1f} s in one process, {two:.1f} s in two")
    print(f"  speed-up {statistics.median(gains):.2f} ({gains[0]:.2f} to {gains[-1]:.2f} of {ROUNDS})")
    print("  | runs | samples | seconds, two processes | us a sample | wanted | found |")
    print("  | --- | --- | --- | --- | --- | --- |")
    for size in SIZES:
        taken = traced(size, 2)
        wanted = "" if size.bar is None else f"< {size.bar:g} s"
        each = 1e6 * taken.seconds / taken.samples
        effects = ", ".join(taken.effects)
        print(
            f"  | {taken.runs} | {taken.samples} | {taken.seconds:.1f} | {each:.0f} | {wanted} | {effects} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
