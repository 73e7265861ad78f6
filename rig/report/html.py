"""Elements of HTML and SVG: text is escaped where an element is made, so that no name from a file can become markup."""

import html
import re
from collections.abc import Iterable
from dataclasses import dataclass

_UNSEEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff\ud800-\udfff\ufff9-\ufffb]"
)
"""Characters that show nothing or turn the text around them: control characters, line and paragraph separators, marks
of direction, half a surrogate pair."""

_EMPTY = frozenset({"meta", "br", "col"})


@dataclass(frozen=True, slots=True)
class Markup:
    """HTML that may be written as it is."""

    text: str


Child = Markup | str | None
Value = str | float | int | bool | None

NOTHING = Markup("")


def visible(text: str) -> str:
    """Give the text with every unseen character spelled out by its number, as in a JSON file."""
    return _UNSEEN.sub(lambda found: f"\\u{ord(found.group()):04x}", text)


def escaped(text: str) -> Markup:
    """Give plain text as HTML, for a place between tags or within a quoted attribute."""
    return Markup(html.escape(visible(text), quote=True))


def element(name: str, *children: Child, **attributes: Value) -> Markup:
    """Give an element; strings among the children and values of attributes are escaped, None is left out.

    An attribute `class_` is written `class`, `data_x` is written `data-x`; True stands without a value.
    """
    written = "".join(_attribute(key, value) for key, value in attributes.items())
    if name in _EMPTY:
        return Markup(f"<{name}{written}>")
    return Markup(f"<{name}{written}>{joined(children).text}</{name}>")


def joined(children: Iterable[Child]) -> Markup:
    """Give the children one after the other."""
    return Markup("".join(_text(child) for child in children))


def _text(child: Child) -> str:
    if child is None:
        return ""
    return child.text if isinstance(child, Markup) else escaped(child).text


def _attribute(key: str, value: Value) -> str:
    name = key.rstrip("_").replace("_", "-")
    if value is None or value is False:
        return ""
    if value is True:
        return f" {name}"
    return f' {name}="{escaped(str(value)).text}"'
