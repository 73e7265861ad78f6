"""A simulated bench for tests of the runner: open it, run a procedure, look at log and world."""

from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.types import DeviceEvent, Sample
from procedures.intents import Steps
from rig.config.bench import BenchFile, load_bench
from rig.config.dut import default_dut
from rig.config.toml_file import parse_toml
from rig.log.run import RunEvent
from rig.operator import SimulatedOperator
from rig.runner import RunOutcome, execute
from rig.simulation import SimulatedBench, simulate
from rig.stop import Stop


@dataclass
class MemoryLog:
    samples: list[Sample] = field(default_factory=list)
    events: list[RunEvent] = field(default_factory=list)
    device_events: list[DeviceEvent] = field(default_factory=list)
    on_sample: Callable[[Sample], None] = lambda _: None

    def write(self, sample: Sample) -> None:
        self.samples.append(sample)
        self.on_sample(sample)

    def event(self, event: RunEvent) -> None:
        self.events.append(event)

    def device_event(self, event: DeviceEvent) -> None:
        self.device_events.append(event)

    def texts(self, kind: str) -> list[str]:
        return [event.text for event in self.events if event.kind == kind]


def sim_bench(*changes: tuple[str, str], seed: int = 1) -> SimulatedBench:
    text = load_bench("sim")[1]
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return simulate(parse_toml(text, BenchFile, "bench.toml"), default_dut()[0], seed=seed)


def run_on(sim: SimulatedBench, steps: Steps, log: MemoryLog, stop: Stop | None = None) -> RunOutcome:
    return execute(sim.bench, steps, log, SimulatedOperator(), stop or Stop())
