"""What no held-out run tests is said."""

from rig.loop.result import EquationResult, Errors
from rig.loop.statements.before_after import untested


def errors(*procedures: str) -> Errors:
    own = Errors(2.0, 1.0, 3.0, 2.0, None, None)
    return Errors(2.0, 1.0, 3.0, 2.0, None, None, dict.fromkeys(procedures, own))


def test_a_procedure_that_is_fitted_and_not_held_out_is_told() -> None:
    fitted = errors("locked-output", "backdrive")
    some = EquationResult("rad", errors("locked-output"), fitted)
    (text,) = untested({"torsion": some})
    assert text.startswith("No held-out run of the same kind tests torsion in backdrive:")
    assert untested({"torsion": EquationResult("rad", fitted, fitted)}) == []


def test_an_equation_without_any_held_out_run_is_told_with_all_its_procedures() -> None:
    (text,) = untested({"motor-torque": EquationResult("N*m", None, errors("backdrive", "free-run"))})
    assert "motor-torque in backdrive, free-run:" in text
