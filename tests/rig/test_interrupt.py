"""Stop signals outside of a run: what is raised may get lost, the wish to stop may not."""

import subprocess
import sys

import pytest

LOSING = """
import os, signal
from contextlib import suppress
from drivers.clock import RealClock
from rig.interrupt import Interrupted, interrupt_on_signals
from rig.stages import Stages
from rig.stop import Stop

def next_run():
    with Stop().listening():
        print("moves")

def next_stage():
    Stages(RealClock())("fits")

interrupt_on_signals()
for number in {signals}:
    with suppress(BaseException):
        os.kill(os.getpid(), number)
try:
    {then}()
except Interrupted as interrupted:
    print("interrupted by", interrupted.by)
"""
"""What loses every Interrupted, as C code that asks whether something exists does, and then goes on."""


@pytest.mark.parametrize("then", ["next_run", "next_stage"])
@pytest.mark.parametrize("signals", ["[signal.SIGINT]", "[signal.SIGINT, signal.SIGTERM]"])
def test_a_stop_signal_that_got_lost_ends_the_program_before_a_run_or_stage(signals, then):
    done = subprocess.run(
        [sys.executable, "-c", LOSING.format(signals=signals, then=then)], capture_output=True, text=True, check=True
    )
    assert done.stdout == "interrupted by SIGINT\n"
    assert done.stderr == ""


def test_a_third_signal_counts_again_when_the_first_got_lost():
    script = LOSING.format(signals="[signal.SIGTERM, signal.SIGTERM]", then="os.kill")
    done = subprocess.run(
        [sys.executable, "-c", script.replace("os.kill()", "os.kill(os.getpid(), signal.SIGINT)")],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "interrupted by SIGINT\n"


WRAPPING = """
import os, signal, sys
from rig.interrupt import interrupt_on_signals
from rig.terminal import carry_out

def command():
    try:
        os.kill(os.getpid(), signal.SIGINT)
    except BaseException as error:
        raise ValueError("the schema cannot be built") from error

interrupt_on_signals()
sys.exit(carry_out(command, as_json=False))
"""
"""What gives every Interrupted another name, as pydantic does while it builds the checks of a file."""


def test_a_stop_signal_that_a_library_wrapped_is_told_as_the_abort():
    done = subprocess.run([sys.executable, "-c", WRAPPING], capture_output=True, text=True, check=False)
    assert done.returncode == 4
    assert done.stderr.startswith("Aborted by SIGINT")
    assert len(done.stderr.splitlines()) == 1
