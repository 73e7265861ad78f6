"""What a run measured, as its log's outcome keeps it."""

import json
from collections.abc import Mapping
from typing import Any

from procedures.intents import Measurement

MEASUREMENTS = "outcome.measurements"
"""Key of a log's metadata under which what the run measured is kept."""


def measurements_in(metadata: Mapping[str, str]) -> tuple[Measurement, ...]:
    """Give the measurements of a log; none where its text is not what `rig run` writes."""
    try:
        return tuple(_measurement(item) for item in json.loads(metadata.get(MEASUREMENTS, "[]")))
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError):
        return ()


def _measurement(item: Mapping[str, Any]) -> Measurement:
    spread = item.get("uncertainty")
    return Measurement(
        name=str(item["name"]),
        value=float(item["value"]),
        unit=str(item["unit"]),
        uncertainty=None if spread is None else float(spread),
        meaning=str(item.get("meaning", "")),
    )
