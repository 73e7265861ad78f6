"""Names from files made fit for use as file names and as log fields."""

import re
from collections.abc import Iterable

_MAX_LENGTH = 80
_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)


def safe_name(text: str) -> str:
    """Give `text` as a plain file name: no folder, no leading dot, no character that a shell or HTML would notice."""
    name = re.sub(r"[^0-9A-Za-z._-]+", "_", text).strip("._-")[:_MAX_LENGTH].rstrip("._-") or "x"
    return f"x{name}" if _RESERVED.fullmatch(name) else name


def plain_name(text: str, taken: Iterable[str] = ()) -> str:
    """Give `text` as a name of letters, digits and underscores that is not `taken`; "x" where nothing is left."""
    name = re.sub(r"[^0-9A-Za-z_]+", "_", text).strip("_")[:_MAX_LENGTH] or "x"
    if name[0].isdigit():
        name = f"x{name}"
    used, free, count = set(taken), name, 2
    while free in used:
        free, count = f"{name}_{count}", count + 1
    return free
