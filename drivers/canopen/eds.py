"""What an EDS or DCF file (CiA 306) says of a device, to be held against the device and what the driver does with it.

The files are read by the canopen library. Types and lengths must agree with the driver's own, and vendor and product
with the device on the bus: a drive that was exchanged, or a file of another version, is found before anything moves.
"""

import io
import logging
import textwrap
import warnings
from collections.abc import Mapping
from configparser import Error as SyntaxMistake
from dataclasses import dataclass
from pathlib import Path

from canopen import import_od
from canopen.objectdictionary import ObjectDictionary, ODVariable, datatypes

from drivers.canopen.objects import ObjectRef
from drivers.errors import ConfigError, Mistake

MAX_BYTES = 5_000_000
MAX_SHOWN = 120
"""Characters of the library's words that a message repeats."""
SUFFIXES = (".eds", ".dcf")

_CODES = {
    datatypes.INTEGER8: "b",
    datatypes.UNSIGNED8: "B",
    datatypes.INTEGER16: "h",
    datatypes.UNSIGNED16: "H",
    datatypes.INTEGER32: "i",
    datatypes.UNSIGNED32: "I",
}
"""Integer types of CiA 301 as `struct` names them; what is not among them the driver cannot use."""


@dataclass(frozen=True, slots=True)
class DeviceDescription:
    """The file's name, vendor and product number (None: not told), and the integer type of every object by address.

    `codes`: as in `struct`, empty for a type that is no integer of 1, 2 or 4 bytes.
    """

    source: str
    vendor: int | None
    product: int | None
    codes: Mapping[tuple[int, int], str]

    def disagreement(self, ref: ObjectRef) -> str:
        """Say how the file disagrees with what the driver holds of an object; empty if it does not."""
        code = self.codes.get((ref.index, ref.sub))
        if code is None:
            return f"{self.source} has no object {ref}"
        if code != ref.code:
            told = _NAMES.get(code, "another type")
            return f"{self.source} gives {ref} as {told}, the driver takes it for {_NAMES[ref.code]}"
        return ""


_NAMES = {
    "b": "INTEGER8",
    "B": "UNSIGNED8",
    "h": "INTEGER16",
    "H": "UNSIGNED16",
    "i": "INTEGER32",
    "I": "UNSIGNED32",
}


def load_description(path: Path, node_id: int, key: str) -> DeviceDescription:
    """Read a device's file. Raises ConfigError under the bench file's `key` if it cannot be read or understood."""

    def refused(rule: str) -> ConfigError:
        hint = "Take the file that belongs to the device's firmware, or leave the key out."
        return ConfigError("bench", [Mistake(key, str(path), rule)], hint=hint)

    if path.suffix.lower() not in SUFFIXES:
        raise refused(f"expected a file ending in {' or '.join(SUFFIXES)}")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise refused(error.strerror or str(error)) from error
    if len(data) > MAX_BYTES:
        raise refused(f"{len(data)} bytes, at most {MAX_BYTES}")
    stream = io.StringIO(_decoded(data))
    stream.name = f"description{path.suffix.lower()}"  # the library tells the format by it
    # what it has to say about the file is in the error, or in what the file then lacks
    logging.getLogger("canopen.objectdictionary").setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # the library's own use of the logging module
            # the node id is always passed: a DCF would bring its own
            found = import_od(stream, node_id)
    except (SyntaxMistake, ValueError, KeyError, AttributeError, IndexError, RecursionError) as error:
        raise refused(f"is no EDS that can be read: {_in_words(error)}") from error
    codes = dict(_codes_of(found))
    if not codes:
        raise refused("describes no object")
    told = found.device_information
    if told.vendor_number is None and told.product_number is None:
        raise refused("names neither vendor nor product, so that nothing tells whose file it is")
    return DeviceDescription(path.name, told.vendor_number, told.product_number, codes)


def _in_words(error: Exception) -> str:
    """Give what the library says in one short line of printable characters, whatever stood in the file."""
    text = "".join(c if c.isprintable() else " " for c in f"{type(error).__name__}: {error}")
    return textwrap.shorten(text, MAX_SHOWN, placeholder=" ...")


def _decoded(data: bytes) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def _codes_of(found: ObjectDictionary) -> list[tuple[tuple[int, int], str]]:
    variables: list[ODVariable] = []
    for entry in found.values():
        variables += [entry] if isinstance(entry, ODVariable) else list(entry.values())
    return [((variable.index, variable.subindex), _CODES.get(variable.data_type or 0, "")) for variable in variables]
