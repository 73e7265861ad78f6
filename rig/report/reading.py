"""Read the folder that `rig loop` wrote. What is wrong with it is said in one paragraph."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from pydantic import BaseModel, ValidationError

from drivers.errors import DataError
from rig.config.toml_file import mistakes_of
from rig.loop.files.model_storage import MODEL_NAME
from rig.loop.files.views_file import VIEWS_NAME, Views
from rig.loop.result import RESULT_NAME
from rig.report.loop_file import LoopFile, ModelFile
from rig.terminal import shortened

MAX_BYTES = 200_000_000
"""No file of a loop comes near this."""

MOST_MISTAKES = 3
"""Mistakes of a file that a message names."""

_SIDES = {"train": "training", "held_out": "held-out"}

AGAIN = "Write the folder anew: rig loop RUN... -o FOLDER."

Content = TypeVar("Content", bound=BaseModel)


@dataclass(frozen=True, slots=True)
class LoopRecord:
    """What a loop left in its folder. `name` of the folder; `model` None where there is no model.json."""

    name: str
    loop: LoopFile
    model: ModelFile | None
    views: Views


def is_loop(folder: Path) -> bool:
    """Whether the folder holds the result of a loop."""
    return (folder / RESULT_NAME).is_file()


def read_loop(folder: Path) -> LoopRecord:
    """Read the folder. Raises DataError where a file is missing (model.json may be), cut off or of another kind."""
    loop = _read(folder / RESULT_NAME, LoopFile)
    model = _read(folder / MODEL_NAME, ModelFile) if (folder / MODEL_NAME).is_file() else None
    if not (folder / VIEWS_NAME).is_file():
        raise DataError(
            str(folder),
            f"there is no {VIEWS_NAME}, which holds what the plots of the report show",
            expected=f"{RESULT_NAME} and {VIEWS_NAME} in one folder",
            hint=AGAIN,
        )
    views = _read(folder / VIEWS_NAME, Views)
    _check_one_loop(folder, loop, model, views)
    return LoopRecord(folder.resolve().name, loop, model, views)


def _check_one_loop(folder: Path, loop: LoopFile, model: ModelFile | None, views: Views) -> None:
    """Raise DataError where the names of the runs show that plots or model are those of another loop."""
    for side, told in (("train", loop.runs.train), ("held_out", loop.runs.held_out)):
        odd = {run.name for run in views.runs if run.side == side} ^ set(told)
        if odd:
            where = f"of {VIEWS_NAME} and {RESULT_NAME} one alone has {min(odd)} among the {_SIDES[side]} runs"
            raise _other_loop(folder / VIEWS_NAME, where)
    unknown = set() if model is None else set(model.runs) - set(loop.runs.train)
    if unknown:
        raise _other_loop(folder / MODEL_NAME, f"it was fitted to {min(unknown)}, which {RESULT_NAME} does not have")


def _other_loop(path: Path, why: str) -> DataError:
    return DataError(
        str(path), f"is of another loop: {why}", expected="files that one rig loop wrote together", hint=AGAIN
    )


def _read(path: Path, kind: type[Content]) -> Content:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DataError(str(path), f"cannot be read: {error.strerror or error}") from error
    if len(data) > MAX_BYTES:
        raise DataError(str(path), f"has {len(data)} bytes", expected=f"at most {MAX_BYTES} bytes")
    try:
        content: Any = json.loads(data.decode("utf-8-sig"), parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        raise DataError(
            str(path),
            f"is no JSON, or was cut off ({shortened(str(error) or 'nested too deeply', 100)})",
            expected="a file that rig loop wrote",
            hint=AGAIN,
        ) from error
    try:
        return kind.model_validate(content)
    except ValidationError as error:
        mistakes = mistakes_of(error)
        named = "; ".join(map(str, mistakes[:MOST_MISTAKES]))
        more = f"; {len(mistakes) - MOST_MISTAKES} more" if len(mistakes) > MOST_MISTAKES else ""
        raise DataError(
            str(path),
            f"does not say what a report needs: {named}{more}",
            expected="a file that rig loop wrote",
            hint=AGAIN,
        ) from error


def _no_number(word: str) -> NoReturn:
    raise ValueError(f"{word} is no number in JSON")
