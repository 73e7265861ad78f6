"""How long the loop takes on campaigns of a given size, by the wall clock. Run alone: `-m tests.challenge.speed`."""

from dataclasses import dataclass, replace

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
"""A plan of 20 runs."""

SEED = 5


@dataclass(frozen=True, slots=True)
class Size:
    """A campaign of so many samples over 20 runs, and the seconds in which it is to be traced on two cores."""

    samples: int
    bar: float


SIZES = (Size(200_000, 10.0), Size(1_000_000, 60.0))


def campaign_of(samples: int) -> Campaign:
    """Give a campaign with a kinematic error and about so many samples, at whatever rate that takes."""
    campaign = Campaign(SEED, draw("kinematic-error", np.random.default_rng(SEED)), plan=TWENTY, rate=20.0)
    seconds = sum(float(recording.time[-1]) for recording in campaign.recordings())
    return replace(campaign, rate=samples / seconds)


def seconds_for(size: Size) -> tuple[int, int, float, tuple[str, ...]]:
    """Give runs, samples, seconds and what was found."""
    recordings = campaign_of(size.samples).recordings()
    runs = as_runs(recordings)
    clock = RealClock()
    started = clock.now()
    result = trace(runs, dut(), LoopOptions(held_out=held_out(recordings)))
    return len(runs), sum(run.time.size for run in runs), clock.now() - started, result.effects


def main() -> None:
    print("| runs | samples | seconds | bar | found |\n| --- | --- | --- | --- | --- |")
    for size in SIZES:
        runs, samples, seconds, found = seconds_for(size)
        print(f"| {runs} | {samples} | {seconds:.1f} | < {size.bar:g} | {', '.join(found)} |", flush=True)


if __name__ == "__main__":
    main()
