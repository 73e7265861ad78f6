import pytest

from procedures.intents import Measurement, Result
from procedures.results import mean_over_runs


def result(**values: tuple[float, float | None]) -> Result:
    return Result(tuple(Measurement(name, value, "N*m", error, "what") for name, (value, error) in values.items()))


def test_measurements_of_one_name_are_averaged_over_the_runs_that_have_them() -> None:
    joined = mean_over_runs([result(a=(1.0, 0.0), b=(5.0, 0.1)), result(a=(3.0, 0.0))])
    assert [(m.name, m.value) for m in joined.measurements] == [("a", 2.0), ("b", 5.0)]


def test_what_a_run_cannot_resolve_does_not_average_out() -> None:
    joined = mean_over_runs([result(a=(1.0, 0.3))] * 9)
    assert joined.measurements[0].uncertainty == pytest.approx(0.3)


def test_the_scatter_between_runs_adds_to_it() -> None:
    joined = mean_over_runs([result(a=(1.0, 0.3)), result(a=(1.8, 0.3))])
    # standard error of two values 0.8 apart: 0.4
    assert joined.measurements[0].uncertainty == pytest.approx(0.5)


def test_one_run_without_an_uncertainty_has_none() -> None:
    assert mean_over_runs([result(a=(1.0, None))]).measurements[0].uncertainty is None
