"""Read a TOML file into a frozen model and report every mistake at once, with its path."""

import math
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, NamedTuple, Self, TypeVar, get_args

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    ModelWrapValidatorHandler,
    PlainValidator,
    ValidationError,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import InitErrorDetails, PydanticCustomError

from drivers.errors import ConfigError, Mistake
from drivers.spelling import did_you_mean
from rig.terminal import MAX_SHOWN, shortened

MAX_BYTES = 1_000_000
"""A configuration is a page of text; anything larger is another file."""

_PLACE = re.compile(r"(?P<what>.*) \(at (line (?P<line>\d+), column \d+|end of document)\)", re.DOTALL)

Table = Mapping[str, Any]

Place = tuple[str | int, ...]
"""Keys, from the outermost table on."""


def whole_number_is_a_number(value: object) -> object:
    """Let a whole number stand where a real one is meant; before validation."""
    if not isinstance(value, int) or isinstance(value, bool):
        return value
    try:
        return float(value)
    except OverflowError:
        raise ValueError("too large for a number") from None


Number = Annotated[float, BeforeValidator(whole_number_is_a_number)]
"""A number in a file, where 100 may stand for 100.0. Neither true nor a text is one."""


def plain_value(value: object) -> object:
    """Give a value that is true, false, a finite number or text; of its kinds, a union would name each as a mistake."""
    if isinstance(value, bool | int | str) or (isinstance(value, float) and math.isfinite(value)):
        return value
    raise ValueError("expected true, false, a finite number or text")


PlainValue = Annotated[bool | int | float | str, PlainValidator(plain_value)]


@dataclass(frozen=True, slots=True)
class Quantity:
    """What a number in a file is, part of the annotation of its field: its unit, and what needs it."""

    unit: str
    needed_by: str


_WRONG_NUMBER: Mapping[str, str] = MappingProxyType(
    {
        "greater_than": "",
        "greater_than_equal": "",
        "less_than": "",
        "less_than_equal": "",
        "finite_number": "finite, ",
        "float_type": "a number, ",
        "int_type": "a whole number, ",
        "int_from_float": "a whole number, ",
    }
)
"""What pydantic finds wrong with a number, and how it is then told what it must be."""

_BOUNDS: Mapping[str, str] = MappingProxyType({"ge": "at least", "gt": "above", "le": "at most", "lt": "below"})
"""Bounds as pydantic's metadata name them."""


class Conflict(NamedTuple):
    """A rule between values that is broken: the place within the table (empty: all of it), what stands there."""

    place: tuple[str, ...]
    value: object
    rule: str


class FileModel(BaseModel):
    """Base of everything read from a file: frozen, no unknown keys, no numbers from text, no infinities."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    @classmethod
    def conflicts(cls, table: Table) -> Iterable[Conflict]:
        """Give the rules between values that `table` breaks: as written, with None for each value that is wrong."""
        return ()

    @model_validator(mode="wrap")
    @classmethod
    def _everything_at_once(cls, data: object, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Check the rules between values also where a value is wrong by itself, and report both."""
        try:
            model = handler(data)
        except ValidationError as error:
            wrong = error.errors(include_url=False)
            found = [_line(item["loc"], item["input"], cls._rule(item), item["type"]) for item in wrong]
            no_numbers = {item["loc"] for item in wrong if item["type"] in _WRONG_NUMBER}
            table = _without(data, {item["loc"] for item in wrong}, whole=no_numbers)
        else:
            found, table = [], data
        if isinstance(table, Mapping):
            found += [_line(*conflict) for conflict in cls.conflicts(table)]
        if found:
            raise ValidationError.from_exception_data(cls.__name__, found)
        return model

    @classmethod
    def _rule(cls, item: Mapping[str, Any]) -> str:
        if item["type"] == "extra_forbidden" and len(item["loc"]) == 1:
            known = [field.alias or name for name, field in cls.model_fields.items()]
            return f"unknown key{did_you_mean(str(item['loc'][0]), known)}; there are {', '.join(known)}"
        wanted = cls.wanted(str(item["loc"][0])) if item["type"] in _WRONG_NUMBER and len(item["loc"]) == 1 else ""
        if wanted:
            return f"must be {_WRONG_NUMBER[item['type']]}{wanted}"
        return str(item["msg"]).removeprefix("Value error, ")

    @classmethod
    def wanted(cls, name: str) -> str:
        """Give what a number must be, `above 0 and at most 2 N*m; THIS needs it`; empty where no quantity is stated."""
        field = cls.model_fields[name]
        quantity = next((item for item in field.metadata if isinstance(item, Quantity)), None)
        if quantity is None:
            return ""
        bounds = list(_bounds(field))
        lower = max((bound for bound in bounds if bound[0] in ("ge", "gt")), key=itemgetter(1), default=None)
        upper = min((bound for bound in bounds if bound[0] in ("le", "lt")), key=itemgetter(1), default=None)
        limits = " and ".join(f"{_BOUNDS[kind]} {limit:.6g}" for kind, limit in filter(None, (lower, upper)))
        return f"{limits} {quantity.unit}".rstrip() + f"; {quantity.needed_by} needs it"


Model = TypeVar("Model", bound=FileModel)


def _bounds(part: Any) -> Iterator[tuple[str, float]]:
    """Give kind and limit of every bound within an annotation, at whatever depth it stands."""
    if isinstance(part, FieldInfo):
        for item in part.metadata:
            yield from ((kind, getattr(item, kind)) for kind in _BOUNDS if hasattr(item, kind))
        yield from _bounds(part.annotation)
    else:
        for inner in get_args(part):
            yield from _bounds(inner)


def read_text(path: Path) -> str:
    """Give the file's text. Raises ConfigError if it cannot be read or is no UTF-8 text of sensible size."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ConfigError(str(path), [Mistake("file", str(path), error.strerror or str(error))]) from error
    if len(data) > MAX_BYTES:
        raise ConfigError(str(path), [Mistake("file", f"{len(data)} bytes", f"at most {MAX_BYTES} bytes")])
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ConfigError(str(path), [Mistake("file", path.name, f"not UTF-8 text: {error.reason}")]) from error


def parse_toml(text: str, model: type[Model], source: str) -> Model:
    """Give the model for a TOML text. Raises ConfigError naming `source` and every mistake with its path."""
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # TOML errors are ValueErrors, as are numbers of 5000 digits
        raise ConfigError(source, [_syntax_mistake(text, str(error))]) from error
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise ConfigError(source, mistakes_of(error)) from error


def mistakes_of(error: ValidationError) -> list[Mistake]:
    """Give everything that a model found wrong, with its path and what stood there."""
    return [
        Mistake(
            ".".join(shortened(str(part)) for part in item["loc"]) or "file",
            None if item["type"] == "missing" else _shown(item.get("input")),
            item["msg"].removeprefix("Value error, "),
        )
        for item in error.errors(include_url=False)
    ]


def _line(place: Sequence[str | int], value: object, rule: str, kind: str = "rule") -> InitErrorDetails:
    # the rule is an argument of the template, since braces in it would be taken for places to fill
    told = PydanticCustomError(kind, "{rule}", {"rule": rule})
    return InitErrorDetails(type=told, loc=tuple(place), input=value)


def _without(data: object, places: Set[Place], *, whole: Set[Place]) -> object:
    """Give the data with None at each of the places; a table there stays, but for those in `whole`."""
    begun = {place[:end] for place in places for end in range(len(place) + 1)}

    def left(value: object, at: Place) -> object:
        if at not in begun:
            return value
        if isinstance(value, Mapping) and at not in whole:
            return {key: left(inner, (*at, key)) for key, inner in value.items()}
        return None

    return left(data, ())


def _syntax_mistake(text: str, message: str) -> Mistake:
    """Name the line that is no TOML, and the key or table that is there twice."""
    match = _PLACE.fullmatch(message)
    if match is None:
        return Mistake("file", "no TOML", message or "nested too deeply")
    number = int(match["line"]) if match["line"] else max(1, len(text.splitlines()))
    line = text.split("\n")[number - 1].strip() if number <= len(text.split("\n")) else ""
    rule = f"no TOML: {match['what']}"
    if match["what"] == "Cannot overwrite a value":
        rule = f"the key '{shortened(line.partition('=')[0].strip())}' is there twice"
    elif match["what"].startswith("Cannot declare"):
        rule = f"the table '{shortened(line.strip('[] '))}' is there twice"
    return Mistake(f"line {number}", shortened(line), rule)


def _shown(value: object) -> object:
    """Give a value short enough for a message; whole tables are named, not printed."""
    if isinstance(value, dict):
        return "table"
    if isinstance(value, str):
        return shortened(value)
    text = repr(value)
    return value if len(text) <= MAX_SHOWN else shortened(text)
