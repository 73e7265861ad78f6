"""Evidence is told in words with its unit, and the page of the loop explains every key."""

import re
from pathlib import Path

from rig.loop.files.evidence_keys import KEYS, in_words
from rig.loop.result import EquationResult, Open, Verdict
from rig.loop.table import _statement

ROOT = Path(__file__).parents[3]
NESTED = {"counts", "correlation", "rad", "time_s"}
"""Keys within a value."""
SAID = {"equation", "procedure", "meaning"}
SIGNALS = {"motor_temperature", "motor_torque", "output_position", "output_torque", "temperature"}


def test_every_key_of_the_code_has_its_words_and_every_one_with_words_is_in_the_code() -> None:
    files = ("before_after.py", "open_statements.py", "wrong_experiment.py")
    code = "".join((ROOT / "rig/loop/statements" / name).read_text() for name in files)
    used = set(re.findall(r'"([a-z_]+)": ', code)) - NESTED - SAID - SIGNALS
    assert used == set(KEYS)


def test_the_page_of_the_loop_explains_every_key() -> None:
    page = (ROOT / "docs/loop.md").read_text()
    for name, key in KEYS.items():
        assert f"| `{name}` | {key.words} | {key.unit or '-'} | {key.meaning} |" in page


def test_an_error_is_told_in_the_unit_of_the_table_also_within_a_list() -> None:
    evidence = {"rms_slow": [2e-6, 3e-6], "rms_slow_of_noise": 1e-6, "rho": 0.5, "unit": "rad", "missing": None}
    assert in_words(evidence, ("urad", 1e6)) == [
        ("rms_slow", "slow rms", [2.0, 3.0], "urad"),
        ("rms_slow_of_noise", "slow rms of noise alone", 1.0, "urad"),
        ("rho", "correlation of replicates", 0.5, ""),
    ]
    several = in_words({"rms_slow": [2e-6, 3e-4], "unit": "rad, N*m"}, ("", 1.0))
    assert several == [("rms_slow", "slow rms", [2e-6, 3e-4], ""), ("unit", "unit", "rad, N*m", "")]


def test_a_statement_of_the_table_has_no_key_of_the_file() -> None:
    evidence = {"equation": "torsion", "meaning": "it remembers", "ljung_box_per_lag": 100.4, "rms_slow": 2e-6}
    text = _statement(Open(Verdict.UNTRACED, evidence), {"torsion": EquationResult("rad", None, None)})
    assert text == "untraced: torsion: it remembers (memory (Ljung-Box per lag) 100, slow rms 2 urad)"
