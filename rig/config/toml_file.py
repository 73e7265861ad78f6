"""Read a TOML file into a frozen model and report every mistake at once, with its path."""

import tomllib
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from drivers.errors import ConfigError, Mistake

MAX_BYTES = 1_000_000
"""A configuration is a page of text; anything larger is another file."""


def whole_number_is_a_number(value: object) -> object:
    """Let a whole number stand where a real one is meant; before validation."""
    if not isinstance(value, int) or isinstance(value, bool):
        return value
    try:
        return float(value)
    except OverflowError:
        raise ValueError("too large for a number") from None


class FileModel(BaseModel):
    """Base of everything read from a file: frozen, no unknown keys, no numbers from text, no infinities."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


Model = TypeVar("Model", bound=FileModel)


def read_text(path: Path) -> str:
    """Give the file's text. Raises ConfigError if it cannot be read or is no UTF-8 text of sensible size."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ConfigError(str(path), [Mistake("file", path.name, error.strerror or str(error))]) from error
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
        raise ConfigError(source, [Mistake("TOML", "", str(error) or "nested too deeply")]) from error
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise ConfigError(source, mistakes_of(error)) from error


def mistakes_of(error: ValidationError) -> list[Mistake]:
    """Give everything that a model found wrong, with its path and what stood there."""
    return [
        Mistake(
            ".".join(str(part) for part in item["loc"]) or "file",
            None if item["type"] == "missing" else _shown(item.get("input")),
            item["msg"].removeprefix("Value error, "),
        )
        for item in error.errors(include_url=False)
    ]


def _shown(value: object) -> object:
    """Give a value short enough for a message; whole tables are named, not printed."""
    if isinstance(value, dict):
        return "table"
    text = repr(value)
    return value if len(text) <= 60 else text[:57] + "..."
