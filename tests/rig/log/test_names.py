"""Names from files never become a path or a broken log field."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.log.names import plain_name, safe_name


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("run-1", "run-1"),
        ("../../etc/passwd", "etc_passwd"),
        ("C:\\temp\\a b", "C_temp_a_b"),
        ("", "x"),
        ("...", "x"),
        ("con", "xcon"),
        ("<script>", "script"),
    ],
)
def test_a_safe_name_keeps_what_is_plain(text: str, expected: str) -> None:
    assert safe_name(text) == expected


@given(st.text())
def test_a_safe_name_is_a_single_visible_file_name(text: str) -> None:
    name = safe_name(text)
    assert Path(name).name == name
    assert re.fullmatch(r"[0-9A-Za-z_][0-9A-Za-z._-]*", name)
    assert safe_name(name) == name


@given(st.lists(st.text(max_size=5), max_size=8))
def test_plain_names_are_identifiers_and_differ(texts: list[str]) -> None:
    names: list[str] = []
    for text in texts:
        names.append(plain_name(text, names))
    assert len(set(names)) == len(names)
    assert all(re.fullmatch(r"[A-Za-z_][0-9A-Za-z_]*", name) for name in names)
