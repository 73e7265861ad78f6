import pytest

from rig.report.html import Markup, element, escaped, joined, visible


def test_text_between_tags_and_in_attributes_is_escaped() -> None:
    made = element("p", '<b> & "quoted"', title="it's <b>")
    assert made.text == '<p title="it&#x27;s &lt;b&gt;">&lt;b&gt; &amp; &quot;quoted&quot;</p>'


def test_elements_are_nested_without_being_escaped_again() -> None:
    assert element("p", element("b", "a<b"), None, " c").text == "<p><b>a&lt;b</b> c</p>"


def test_names_of_attributes_are_written_as_html_has_them() -> None:
    made = element("svg", class_="a", data_x="1", aria_hidden="true", viewBox="0 0 1 1", hidden=True, id=None)
    assert made.text == '<svg class="a" data-x="1" aria-hidden="true" viewBox="0 0 1 1" hidden></svg>'


def test_an_empty_element_has_no_end() -> None:
    assert element("meta", charset="utf-8").text == '<meta charset="utf-8">'


@pytest.mark.parametrize(
    "character", ["\x00", "\x1b", "\u2028", "\u2029", "\u202e", "\u200b", "\ud800", "\ufeff", "\x85"]
)
def test_what_shows_nothing_or_turns_the_text_is_spelled_out(character: str) -> None:
    assert visible(f"a{character}b") == f"a\\u{ord(character):04x}b"
    assert escaped(character).text.isascii()


def test_letters_of_any_script_stay_as_they_are() -> None:
    assert visible("Prüfstand Ω 测试\tx\ny") == "Prüfstand Ω 测试\tx\ny"


def test_pieces_are_joined_in_order() -> None:
    assert joined(["a", Markup("<br>"), None, "<"]).text == "a<br>&lt;"
