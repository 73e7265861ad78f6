"""What no held-out run tests is said."""

from rig.loop.result import EquationResult, Errors, Verdict
from rig.loop.statements.before_after import unjudged, untested


def errors(*procedures: str) -> Errors:
    own = Errors(2.0, 1.0, 3.0, 2.0, None, None)
    return Errors(2.0, 1.0, 3.0, 2.0, None, None, dict.fromkeys(procedures, own))


def test_a_procedure_that_is_fitted_and_not_held_out_is_told() -> None:
    fitted = errors("locked-output", "backdrive")
    some = EquationResult("rad", errors("locked-output"), fitted)
    (text,) = untested({"torsion": some})
    assert text.startswith("No held-out run tests torsion in backdrive:")
    assert untested({"torsion": EquationResult("rad", fitted, fitted)}) == []


def test_an_equation_without_any_held_out_run_is_told_with_all_its_procedures() -> None:
    (text,) = untested({"motor-torque": EquationResult("N*m", None, errors("backdrive", "free-run"))})
    assert "motor-torque in backdrive, free-run:" in text


def test_an_error_far_above_the_floor_in_runs_that_are_not_judged_is_told() -> None:
    own = Errors(2.0, 1.6, 3.0, 2.0, 0.9, (0.8, 1.0))
    some = Errors(2.0, 1.6, 3.0, 2.0, 0.9, (0.8, 1.0), {"free-run": own})
    whole, without = EquationResult("rad", some, some), EquationResult("rad", None, some)
    (item,) = unjudged({"torsion": whole}, {"torsion": without})
    assert item.verdict is Verdict.UNTRACED
    assert item.evidence["procedure"] == "free-run"
    assert unjudged({"torsion": whole}, {"torsion": whole}) == []
    near = Errors(2.0, 1.4, 3.0, 2.0, 0.9, (0.8, 1.0), {"free-run": Errors(2.0, 1.4, 3.0, 2.0, 0.9, (0.8, 1.0))})
    assert unjudged({"torsion": EquationResult("rad", near, some)}, {"torsion": without}) == []
