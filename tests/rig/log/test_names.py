"""Names from files never become a path or a broken log field."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.log.names import gone_if_unused, plain_name, safe_name


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


def fail_in(folder: Path, *files: str):
    with gone_if_unused(folder):
        for name in files:
            (folder / name).touch()
        raise ZeroDivisionError


def test_a_folder_made_for_results_goes_again_where_there_are_none(tmp_path: Path):
    folder = tmp_path / "a" / "b"
    with pytest.raises(ZeroDivisionError):
        fail_in(folder)
    assert list(tmp_path.iterdir()) == []
    for files in (("kept",), ()):
        with pytest.raises(ZeroDivisionError):
            fail_in(folder, *files)
        assert (folder / "kept").is_file()
    with gone_if_unused(tmp_path / "c"):
        pass
    assert (tmp_path / "c").is_dir()


def test_an_empty_folder_that_was_there_before_stays(tmp_path: Path):
    with pytest.raises(ZeroDivisionError):
        fail_in(tmp_path)
    assert tmp_path.is_dir()
