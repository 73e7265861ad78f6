"""Reading and writing `model.json`: what is read has been held against the schema and the catalogue."""

import json
from pathlib import Path

from pydantic import ValidationError

from drivers.errors import ConfigError, Mistake
from rig.config.toml_file import mistakes_of
from rig.loop.files.model_check import mistakes_in
from rig.loop.files.model_file import Model

MODEL_NAME = "model.json"
"""What `rig loop` calls the model in its folder."""

MAX_BYTES = 5_000_000

_HINT = "Correct it (`rig effects NAME` says what an effect has), or write it anew with `rig loop`."


def write_model(model: Model, path: Path) -> None:
    """Write the file; what was there is replaced."""
    text = json.dumps(model.model_dump(mode="json", by_alias=True), indent=2, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")


def load_model(path: Path) -> Model:
    """Read the file. Raises ConfigError with every mistake and its path, also of what the catalogue does not know."""
    try:
        data = path.read_bytes()
    except OSError as error:
        inside = path / MODEL_NAME
        rule = "is a folder, no model" if path.is_dir() else error.strerror or str(error)
        hint = f"The model in it is {inside}." if inside.is_file() else ""
        raise ConfigError(str(path), [Mistake("file", path.name, rule)], hint=hint) from error
    if len(data) > MAX_BYTES:
        raise ConfigError(str(path), [Mistake("file", f"{len(data)} bytes", f"at most {MAX_BYTES} bytes")])
    try:
        content = json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:  # not UTF-8, no JSON, or a number of 5000 digits
        raise ConfigError(str(path), [Mistake("JSON", path.name, str(error) or "nested too deeply")]) from error
    try:
        model = Model.model_validate(content)
    except ValidationError as error:
        raise ConfigError(str(path), mistakes_of(error), hint=_HINT) from error
    mistakes = mistakes_in(model)
    if mistakes:
        raise ConfigError(str(path), mistakes, hint=_HINT)
    return model
