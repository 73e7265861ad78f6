"""An endless angle from a wrapping counter."""

from hypothesis import given
from hypothesis import strategies as st

from drivers.canopen.unwrap import Unwrapper


@given(st.integers(8, 2**32), st.integers(-(2**40), 2**40), st.data())
def test_a_path_of_plausible_steps_is_followed_over_any_number_of_wraps(
    span: int, start: int, data: st.DataObject
) -> None:
    unwrapper = Unwrapper(span)
    unwrapper.start(start % span)
    path = [unwrapper.counts]
    for step in data.draw(st.lists(st.integers(-(span // 4), span // 4), max_size=30)):
        path.append(path[-1] + step)
        unwrapper.step(path[-1] % span)
        assert unwrapper.counts == path[-1]
        assert unwrapper.plausible


def test_a_counter_that_starts_just_below_zero_is_read_as_just_below_zero() -> None:
    unwrapper = Unwrapper(1000)
    unwrapper.start(998)
    assert unwrapper.counts == -2


def test_a_step_of_more_than_a_quarter_range_is_called_implausible() -> None:
    unwrapper = Unwrapper(1000)
    unwrapper.start(0)
    unwrapper.step(251)
    assert not unwrapper.plausible
    unwrapper.step(252)
    assert unwrapper.plausible


def test_a_step_of_more_than_the_shaft_can_turn_is_called_implausible() -> None:
    unwrapper = Unwrapper(1000, 50)
    unwrapper.start(0)
    unwrapper.step(949)
    assert not unwrapper.plausible
    unwrapper.step(999)
    assert unwrapper.plausible


def test_one_count_backwards_from_zero_is_minus_one() -> None:
    unwrapper = Unwrapper(4096)
    unwrapper.start(0)
    unwrapper.step(4095)
    assert unwrapper.counts == -1
