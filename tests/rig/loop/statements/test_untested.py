"""What no held-out run tests is said, and where the held-out runs speak against what was added."""

from dataclasses import replace

from rig.loop.campaign import LoopOptions
from rig.loop.result import EquationResult, Errors, Open, Verdict
from rig.loop.statements.before_after import made_worse, no_better, untested
from rig.loop.table import floor_remark
from rig.loop.trace import trace
from tests.rig.loop.runs import dut, turning_run

EQUATIONS = ("torsion", "motor-torque")


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


def test_an_error_above_the_floor_that_a_statement_about_two_equations_explains_is_not_taken_for_noise() -> None:
    runs = [turning_run(name, seed) for seed, name in enumerate("abc")]
    result = trace(runs, dut(), LoopOptions(held_out=("c",)))
    high = {"free-run": of(1.0, 1.0, (0.1, 0.2))}
    both = {
        name: EquationResult("rad", replace(of(1.0, 1.0, (0.1, 0.2)), by_procedure=high), None) for name in EQUATIONS
    }
    odd = Open(Verdict.UNTRACED, {"equation": ", ".join(EQUATIONS), "procedure": "free-run", "meaning": "x"})
    assert "without a statement" in floor_remark(replace(result, equations=both, open=()))
    assert "without a statement" not in floor_remark(replace(result, equations=both, open=(odd,)))


def held_out(**by_procedure: Errors) -> EquationResult:
    """Give an equation from 2 to 1 rad over all held-out runs, with its procedures."""
    return EquationResult("rad", Errors(2.0, 1.0, 3.0, 2.0, None, None, by_procedure), None)


def of(before: float, after: float, floor_ci95: tuple[float, float] | None = None) -> Errors:
    return Errors(before, after, 3.0, 2.0, None, floor_ci95)


def test_one_procedure_that_gets_worse_is_told_though_the_equation_gets_better() -> None:
    (item,) = made_worse({"torsion": held_out(backdrive=of(0.5, 0.8), locked=of(3.0, 1.0))})
    assert item.evidence["procedure"] == "backdrive"
    assert item.evidence["held_out_rms_after"] == 0.8
    # within its floor it is noise, and so is a little more than before
    assert made_worse({"torsion": held_out(backdrive=of(0.5, 0.8, (0.4, 0.9)), locked=of(1.0, 1.05))}) == []


def test_an_equation_that_gets_worse_is_told_once() -> None:
    errors = Errors(1.0, 1.1, 3.0, 2.0, None, None, {"backdrive": of(0.5, 0.8)})
    (item,) = made_worse({"torsion": EquationResult("rad", errors, None)})
    assert "procedure" not in item.evidence


def test_what_lowers_no_held_out_error_is_told() -> None:
    same = EquationResult("rad", of(1.0, 1.0), None)
    (text,) = no_better({"torsion": same, "motor-torque": EquationResult("N*m", of(1.0, 1.01), None)})
    assert text.startswith("What was added lowers no held-out error.")
    assert no_better({"torsion": same, "motor-torque": EquationResult("N*m", of(1.0, 0.9), None)}) == []
    assert no_better({"torsion": EquationResult("rad", None, of(1.0, 1.0))}) == []
