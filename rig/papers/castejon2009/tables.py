"""Tables 1 and 2: the modes of motor, drive and load, and the motor's speed against its voltage."""

from dataclasses import replace

from rig.papers.castejon2009.bench import AtSpeed, paper_motor, paper_transmission, rpm
from rig.papers.castejon2009.modes import decay, mode, poles
from rig.papers.castejon2009.printed import double_count
from rig.papers.item import Outcome, Row, Workbench
from sim_backend.model.dc_motor import RPM, TABLE_2, steady_speed, voltage_for
from sim_backend.model.parameters import Rotation
from sim_backend.model.state_space import state_space
from sim_backend.model.transmission import hdc_40


def table_1(_: Workbench) -> Outcome:
    """Find the modes of the corrected matrix."""
    rows = []
    for rotation in Rotation:
        found = poles(state_space(hdc_40(rotation)).A)
        note = "(12) as printed" if rotation is Rotation.OPPOSED else "theta_m' - theta_l' in (12)"
        rows += [
            Row(f"torsional mode, {rotation}", None, mode(found), "Hz", note),
            Row(f"its decay, {rotation}", None, float(found.real[found.imag.argmax()]), "1/s", note),
            Row(f"decay of the speed, {rotation}", None, decay(found), "1/s", note),
        ]
    J_m_alone = poles(state_space(replace(paper_transmission(), wave_generator_inertia=0.0)).A)
    rows.append(Row("torsional mode, J_wg dropped", None, mode(J_m_alone), "Hz", "as (15) prints it"))
    return Outcome(tuple(rows))


def table_2(_: Workbench) -> Outcome:
    """Give the speed at every voltage."""
    motor, drag = paper_motor(), paper_transmission().drag
    note = f"R = {motor.resistance:g} ohm, L = {motor.inductance:g} H chosen: not printed"
    rows = [
        Row(f"speed at {voltage:g} V", speed / RPM, steady_speed(motor, voltage, drag) / RPM, "rpm", note)
        for voltage, speed in TABLE_2
    ]
    voltage, speed = TABLE_2[0]
    off = "off the line of the other rows"
    rows.append(Row(f"voltage for {rpm(speed)}", voltage, voltage_for(motor, speed, drag), "V", off))
    rows.append(Row("back-EMF constant", None, motor.constant, "V*s/rad", "last three rows; at most 0.2046"))
    return Outcome(tuple(rows))


def double_counts(runs: tuple[AtSpeed, ...]) -> tuple[float, ...]:
    """Give the wind-up (rad) that the double count of (27) would add in every run."""
    return tuple(double_count(paper_transmission(), float(at.run.motor_torque.mean())) for at in runs)
