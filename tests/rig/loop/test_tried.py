"""What was tried is told once, with what tells one row from another."""

from rig.loop.result import Candidate
from rig.loop.search.tried import by_gain


def test_what_cannot_be_told_apart_is_told_once_and_the_best_comes_first() -> None:
    weak = Candidate("torque-ripple", 5.0, 1.0, "motor_position", "motor balance, times torque", 36.0)
    same = Candidate("torque-ripple", 5.0, 1.0, "motor_position", "motor balance, times torque", 36.0 + 1e-9)
    other = Candidate("torque-ripple", 7.0, 0.1, "motor_position", "motor balance, times torque", 72.0)
    spring = Candidate("creep", 6.0, 0.2, "output_torque", "torsion")
    assert by_gain([weak, same, other, spring]) == (other, spring, weak)
