"""When the torque of legs so fast that the drive no longer follows a line of it is left out."""

from types import SimpleNamespace
from typing import cast

import pytest

from rig.loop.model.terms import Entry
from rig.loop.search.decision import Selection
from rig.loop.search.followed import takes_over


def selection(entries: tuple[Entry, ...], decisions: int) -> Selection:
    lines = [SimpleNamespace(kind=SimpleNamespace(entry=entry)) for entry in entries]
    found = SimpleNamespace(fit=SimpleNamespace(model=SimpleNamespace(lines=lines)), decisions=("any",) * decisions)
    return cast("Selection", found)


@pytest.mark.parametrize(
    ("slow", "every", "stays"),
    [
        (((Entry.MOTOR,), 1), ((), 1), True),
        (((Entry.MOTOR,), 1), ((), 2), True),
        (((Entry.MOTOR,), 1), ((Entry.MOTOR,), 1), False),
        (((Entry.TORSION,), 1), ((), 1), False),
        (((), 2), ((), 1), True),
        (((), 1), ((), 1), False),
    ],
    ids=[
        "a line of the torque for another effect",
        "a line of the torque for two other effects",
        "nothing new",
        "a line of an angle, which speed does not hide",
        "one effect more",
        "as many without a line",
    ],
)
def test_a_torque_line_that_slow_legs_show_is_worth_the_fast_ones(
    slow: tuple[tuple[Entry, ...], int], every: tuple[tuple[Entry, ...], int], stays: bool
) -> None:
    assert takes_over(selection(*slow), selection(*every)) is stays
