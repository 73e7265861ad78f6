"""The items of the second paper: what they obtain, beside its figures and closed forms."""

import math

import numpy as np
import pytest

from rig.papers import castejon2009
from rig.papers.castejon2009.bench import CHOSEN_ERROR, PRINTED_ACCURACY, paper_transmission
from rig.papers.castejon2009.motion import _lagrange
from rig.papers.castejon2009.printed import matrix_35, matrix_of_28_to_31
from rig.papers.castejon2009.spectra import highest_bin, line_order, order_spectrum
from rig.papers.item import Outcome, Workbench
from sim_backend.model import lagrange
from sim_backend.model.driven import laws
from sim_backend.model.fourier_error import FourierError, pure_error


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory) -> dict[str, Outcome]:
    bench = Workbench(tmp_path_factory.mktemp("papers"), quick=True)
    return {item.what: item.run(bench) for item in castejon2009.ITEMS}


def obtained(outcome: Outcome, beginning: str):
    (value,) = (row.obtained for row in outcome.rows if row.quantity.startswith(beginning))
    return value


def test_what_the_paper_draws_with_numbers_is_drawn(outcomes):
    assert {name for name, outcome in outcomes.items() if outcome.figures} == {
        *(f"Fig. {n}" for n in (3, 8, 9, 10, 11, 12)),
        "conclusions",
    }


def test_the_title_of_every_figure_names_the_paper(outcomes):
    for what, outcome in outcomes.items():
        for figure in outcome.figures.values():
            assert figure.get_suptitle().startswith(f"Castejon 2009, {what}: ")


@pytest.mark.parametrize("what", ["Fig. 9", "Fig. 10"])
def test_the_curves_over_a_motor_turn_have_no_corners(outcomes, what):
    # the fastest speed makes 54 samples of a turn at 1 kHz; 500 are 70 in each wave of order 7
    axes = outcomes[what].figures[""].axes
    for line in (line for panel in axes for line in panel.lines):
        assert len(line.get_xdata()) > 480
    if what == "Fig. 9":
        assert axes[0].get_xlim() == (0.0, 2.0 * math.pi)
        for line in axes[0].lines:
            assert line.get_xdata()[-1] >= 2.0 * math.pi


def test_the_figures_mark_what_the_paper_prints(outcomes):
    over_time, _ = outcomes["Fig. 12"].figures[""].axes
    told = over_time.get_legend_handles_labels()[1]
    assert {"printed 10.25 Hz", "twice the speed, 10.33 Hz"} <= set(told)
    shares, windup = outcomes["conclusions"].figures[""].axes
    (printed,) = (line for line in shares.lines if "printed" in str(line.get_label()))
    assert (printed.get_xdata()[0], printed.get_ydata()[0]) == pytest.approx((310.0, 5.0))
    assert windup.get_ylabel() == "angle at the output [urad]"


def test_every_row_says_something_that_can_be_read(outcomes):
    for outcome in outcomes.values():
        assert outcome.rows
        for row in outcome.rows:
            assert isinstance(row.obtained, float | str)
            assert not isinstance(row.obtained, float) or math.isfinite(row.obtained)


def test_the_modes_are_602_hertz_and_stable_in_both_senses(outcomes):
    for rotation in ("opposed", "same"):
        assert obtained(outcomes["table 1"], f"torsional mode, {rotation}") == pytest.approx(602.4, abs=0.05)
        assert obtained(outcomes["table 1"], f"its decay, {rotation}") < -0.6
    assert obtained(outcomes["table 1"], "decay of the speed, opposed") == pytest.approx(-0.408, abs=5e-4)
    assert obtained(outcomes["table 1"], "torsional mode, J_wg") == pytest.approx(602.5, abs=0.05)


def test_the_printed_matrix_is_unstable_and_that_of_its_equations_is_not(outcomes):
    matrices = outcomes["eq. (26)-(40)"]
    assert obtained(matrices, "largest real part of A (35)") == pytest.approx(0.632, abs=5e-4)
    assert obtained(matrices, "second largest") == pytest.approx(0.593, abs=5e-4)
    (corrected,) = (row.obtained for row in matrices.rows if row.quantity == "largest real part of A")
    assert abs(corrected) < 1e-9
    assert obtained(matrices, "mode of (28)-(31)") == pytest.approx(602.3, abs=0.05)
    assert obtained(matrices, "A less the Jacobian") < 1e-12
    for row in ("row 1 of A less", "row 2 of A less", "row 4 of A less"):
        assert obtained(matrices, row) < 1e-12
    # the printed matrices differ in signs and in a factor N of the stiffness only
    t = paper_transmission()
    ratio = np.abs(matrix_35(t)[1::2] / matrix_of_28_to_31(t)[1::2])
    assert ratio == pytest.approx(np.array([[1, 1, 1, 1], [50, 1, 50, 1]]))


def test_the_shipped_matrices_differ_from_the_printed_ones_where_the_errata_say_so(outcomes):
    found = {row.quantity: (row.printed, row.obtained) for row in outcomes["eq. (26)-(40)"].rows}
    assert found["inertia on theta_m''"] == pytest.approx((2.9e-4, 4.5e-4))
    assert found["decay of the motor's speed"] == pytest.approx((-0.632, -0.408), abs=5e-4)
    assert found["tau_m on the load, over tau_m"] == found["torque over tau_m in D"] == (50.0, 0.0)
    assert found["torque over theta_l in C"] == (0.0, -7160.0)
    # (17) differentiated: order 2 with 0.2 mrad makes most of it
    speed = 310.0 * math.pi / 30.0
    size = sum((n * amplitude) ** 2 for n, amplitude in enumerate(CHOSEN_ERROR.amplitudes, start=1))
    assert found["rate of theta_p at 310 rpm, rms"][1] == pytest.approx(speed * math.sqrt(0.5 * size), rel=1e-3)


def test_the_identification_returns_the_fifteen_chosen_coefficients(outcomes):
    found = outcomes["eq. (17)-(19)"]
    assert obtained(found, "coefficients") == 15.0
    errors = {row.quantity: row.obtained for row in found.rows}
    for letter, largest in (("a_n", 1.2e-4), ("b_n", 1.6e-4)):
        at_310 = errors[f"largest error of {letter} at 310 rpm"]
        # (2 omega)^2 J_l/K = 3e-4 of the coefficient of order 2
        assert at_310 == pytest.approx(2.94e-4 * largest, rel=0.05)
        assert errors[f"largest error of {letter} at 31 rpm"] == pytest.approx(at_310 / 100.0, rel=0.25)
        assert errors[f"largest error of {letter} at 310 rpm, with encoders"] < 3e-7
    assert obtained(found, "b_2 as printed") == pytest.approx(math.pi, rel=1e-3)
    assert len(found.grids[0].cells) == 15


def test_table_2_gives_three_rows_exactly_and_the_first_as_303_rpm(outcomes):
    table = outcomes["table 2"]
    for voltage, rpm in ((12, 560.0), (18, 840.0), (24, 1120.0)):
        assert obtained(table, f"speed at {voltage} V") == pytest.approx(rpm, rel=1e-9)
    assert obtained(table, "speed at 6.5 V") == pytest.approx(303.3, abs=0.05)
    assert obtained(table, "voltage for 310 rpm") == pytest.approx(6.64, abs=5e-3)
    assert 0.2 < obtained(table, "back-EMF") < 0.2046


def test_the_flexible_part_is_the_paper_s_at_most_5_percent_and_grows_with_the_square_of_the_speed(outcomes):
    shares = outcomes["conclusions"]
    assert obtained(shares, "share at 310 rpm, at most") < 0.05
    assert obtained(shares, "share grows") == "yes"
    for rpm, percent in ((310, 0.03), (560, 0.10), (840, 0.22), (1120, 0.38)):
        assert obtained(shares, f"share at {rpm} rpm, order 2") * 100.0 == pytest.approx(percent, abs=0.005)
    for rpm, windup in ((310, 4.15e-5), (560, 7.5e-5), (840, 1.12e-4), (1120, 1.50e-4)):
        # of (B_m + B_ml) alone, to two digits; the load itself costs 0.4 % more
        assert obtained(shares, f"wind-up counted twice at {rpm} rpm") == pytest.approx(windup, rel=1e-2)
    assert obtained(shares, "amplitude of which") == pytest.approx(8.3e-4, rel=5e-3)
    assert obtained(shares, "load inertia for 5 %") == pytest.approx(0.081, abs=5e-4)
    assert obtained(shares, "mode of that load") == pytest.approx(47.0, abs=0.5)


def test_the_spectrum_has_its_line_at_order_2_and_the_transform_shows_the_nearest_bin(outcomes):
    spectrum = outcomes["Fig. 12"]
    assert obtained(spectrum, "line over the motor angle") == pytest.approx(2.0, abs=1e-4)
    assert obtained(spectrum, "its frequency") == pytest.approx(10.333, abs=1e-3)
    for seconds, hertz in ((1, 10.0), (2, 10.5), (4, 10.25), (8, 10.375)):
        assert obtained(spectrum, f"highest bin, record of {seconds} s") == hertz
    assert obtained(spectrum, "line of a pure error of order 3") == pytest.approx(3.0, abs=1e-4)


def test_the_figures_show_what_the_paper_says_of_them(outcomes):
    assert obtained(outcomes["Fig. 8"], "dominant order") == 2.0
    assert obtained(outcomes["Fig. 9"], "grows with speed") == "yes"
    assert obtained(outcomes["Fig. 9"], "periodic") == "yes"
    assert obtained(outcomes["Fig. 10"], "crossings") == pytest.approx(2.0, rel=0.05)
    assert obtained(outcomes["Fig. 11"], "bound") < PRINTED_ACCURACY
    assert obtained(outcomes["Fig. 2"], "teeth by which it falls behind in a turn") == pytest.approx(2.0)
    assert obtained(outcomes["Fig. 3"], "modulations") == 2.0
    (curve,) = outcomes["Fig. 3"].figures[""].axes[0].lines
    largest = float(np.max(np.abs(np.asarray(curve.get_ydata()))))
    assert obtained(outcomes["Fig. 3"], "largest error") == pytest.approx(1e-6 * largest)
    lines = outcomes["Fig. 9"].figures[""].axes[0].lines
    spans = [float(np.ptp(np.asarray(line.get_ydata()))) for line in lines]
    assert len(spans) == 4
    assert spans == sorted(spans)


def test_the_equations_of_motion_follow_from_the_energies_and_balance(outcomes):
    motion = outcomes["eq. (6)-(16)"]
    assert obtained(motion, "power in less") < 1e-10
    # rounding of the differences; forces are 10 N*m
    assert obtained(motion, "left side of (13)") < 1e-8
    assert obtained(motion, "left side of (14)") < 1e-8
    assert obtained(motion, "V at 1 mrad") == pytest.approx(0.5 * 7160.0 * 1e-6)
    # of a flexible part of 2.3 urad; the closed form has the motor at constant speed
    assert obtained(motion, "theta_l by (8)") < 1e-9
    assert obtained(motion, "mean transmitted torque") == pytest.approx(1.0, rel=1e-3)
    assert obtained(outcomes["eq. (4)-(5)"], "total less pure") < 1e-10
    assert obtained(outcomes["eq. (1)-(3)"], "power in less") == pytest.approx(0.0, abs=1e-12)


def test_the_differences_of_the_energies_would_show_a_wrong_equation_of_motion(monkeypatch):
    right = lagrange.accelerations

    def without_the_slope(theta_m, omega_m, theta_l, omega_l, tau_m, tau_l, k, c):
        """(15) with theta_p but without dtheta_p/dtheta_m, as (31) has it."""
        flat = [2.0 * lagrange.error_and_slope(theta_m, k)[0], 0.0, 0.0]
        return right(theta_m, omega_m, theta_l, omega_l, tau_m, tau_l, flat, c)

    state, c = [1.0, 100.0, 1e-3, 2.0], laws(paper_transmission())
    assert max(map(abs, _lagrange(state, c))) < 1e-8
    monkeypatch.setattr(lagrange, "accelerations", without_the_slope)
    assert max(map(abs, _lagrange(state, c))) > 1e-4


def test_the_chosen_error_stays_within_what_the_makers_promise():
    angle = np.linspace(0.0, 2.0 * math.pi, 2000)
    assert np.ptp(pure_error(angle, CHOSEN_ERROR)) < PRINTED_ACCURACY
    assert CHOSEN_ERROR.amplitudes[1] == pytest.approx(2.0e-4)


@pytest.mark.parametrize("order", [1, 2, 3, 4, 7])
def test_a_line_is_found_at_its_order_although_the_record_ends_within_a_turn(order):
    rng = np.random.default_rng(1)
    angle = np.cumsum(rng.uniform(0.01, 0.05, 4000))
    series = FourierError(1e-3, tuple(1e-4 if n == order else 0.0 for n in range(1, 8)), (0.0,) * 7)
    values = pure_error(angle, series)
    assert line_order(angle, values) == pytest.approx(order, abs=1e-3)
    assert order_spectrum(angle, values, np.array([float(order)]))[0] == pytest.approx(1e-4, rel=1e-2)


def test_the_highest_bin_is_the_line_s_where_it_lies_on_a_bin():
    time = np.arange(1000) * 1e-3
    assert highest_bin(3.0 + np.sin(2.0 * math.pi * 12.0 * time), 1e-3) == 12.0
