"""The simulated drive under a master that shares nothing with ours: the npm package `canopen`, in a Node process.

`make foreign` installs it into this folder. The bridge below carries raw frames between the process's pipes and the
lock-step bus, and lets simulated time run while the process is silent.
"""

import os
import select
import shutil
import subprocess
from pathlib import Path

import can
import pytest

from sim_backend.nodes.bench import bench_nodes
from sim_backend.ports import AxisMode
from sim_backend.world import World
from tests.sim_backend.fake_plant import FakePlant

HERE = Path(__file__).parent

NODE = shutil.which("node")

MOST_TIME = 60.0
"""Simulated time, s, after which the conversation has failed."""

pytestmark = [
    pytest.mark.skipif(NODE is None, reason="no Node.js on this machine"),
    pytest.mark.skipif(
        not (HERE / "node_modules" / "canopen").is_dir(),
        reason="the npm package canopen is not installed: make foreign",
    ),
]


class RecordingPlant(FakePlant):
    """Keeps every command that a drive gave its shaft."""

    def __init__(self) -> None:
        super().__init__()
        self.history: list[tuple[str, AxisMode, float]] = []
        self.show(motor_position=1.0)

    def command(self, axis: str, mode: AxisMode, target: float) -> None:
        self.history.append((axis, mode, target))
        super().command(axis, mode, target)


def converse(world: World, process: "subprocess.Popen[bytes]") -> None:
    """Carry frames until the process closes its end; a silent millisecond of its time is one of simulated time."""
    assert process.stdin is not None
    assert process.stdout is not None
    waiting = b""
    while world.time < MOST_TIME:
        if select.select([process.stdout], [], [], 1e-3)[0]:
            chunk = os.read(process.stdout.fileno(), 4096)
            if not chunk:
                return
            *lines, waiting = (waiting + chunk).split(b"\n")
            for line in lines:
                can_id, data = line.split(b" ")
                message = can.Message(
                    arbitration_id=int(can_id, 16), data=bytes.fromhex(data.decode()), is_extended_id=False
                )
                world.bus.send(message)
        else:
            world.advance_to(world.time + world.tick)
        answers = b""
        while (received := world.bus.recv(0)) is not None:
            answers += f"{received.arbitration_id:x} {received.data.hex()}\n".encode()
        if answers:
            os.write(process.stdin.fileno(), answers)
    raise AssertionError(f"the master was not done after {MOST_TIME} s")


def test_an_independent_master_takes_the_drive_from_boot_up_to_torque_and_back() -> None:
    plant = RecordingPlant()
    world = World(plant, bench_nodes(plant))
    with subprocess.Popen(
        [str(NODE), "master.js"], cwd=HERE, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        try:
            converse(world, process)
            assert process.stderr is not None
            told = process.stderr.read().decode()
            assert process.wait(10) == 0, told
        finally:
            process.kill()
    # 100 per mille of the motor's 188 mN*m, and the shaft free in the end
    assert ("motor", AxisMode.TORQUE, pytest.approx(0.0188)) in plant.history
    assert plant.commands["motor"][0] is AxisMode.OFF
