"""Put the loop beside selectors of other packages on the same campaigns: `python -m tests.challenge.peers -o DIR`."""

import argparse
import json
import time
import warnings
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np

from rig.provenance import git_state
from tests.challenge.cases import DEVELOPMENT, GROUPS, UNSEEN, Case, campaign_of, make_case
from tests.challenge.expected import expected_of
from tests.challenge.peers import narmax, sindy
from tests.challenge.peers.columns import Floats, Prepared, Task, prepare_columns
from tests.challenge.run import answer_of, done, lines_in, processor_seconds
from tests.challenge.scoring import RIGHT, naming_of
from tests.challenge.sizes import as_runs, base_floor, floor_of, hide, logs_of
from tests.independent.terms import Effects
from tests.rig.loop.runs import dut as default_dut

SELECTORS: dict[str, Callable[[Task], Floats]] = {
    "PySINDy STLSQ": sindy.stlsq,
    "PySINDy FROLS": sindy.frols,
    "SysIdentPy FROLS, BIC": narmax.frols_bic,
}

LOOP = "rig loop"
NEAR = 1.05
REFUSED: dict[str, Any] = {"groups": ["refused"], "over_oracle": float("inf"), "exact": False}
"""What a campaign that the loop refuses counts as: no answer, and no silence."""

COUNTS = {"single": 10, "outside": 5, "none": 8}
"""Campaigns of each family."""


def compare(family: str, seed: int) -> dict[str, Any]:
    """Give what the loop and every selector say of one case."""
    case, dut = make_case(family, seed), default_dut()
    without_it = floor_of(case)
    hidden = hide(case, without_it)
    runs, held_out = logs_of(case, hidden)
    with_it = base_floor(runs, held_out, dut)
    without = as_runs(campaign_of(case, Effects()).recordings())
    floor = _left(prepare_columns(without_it.fit, without, held_out, dut))
    started = processor_seconds()
    answer = json.loads(answer_of(runs, dut, held_out))
    seconds = processor_seconds() - started
    found: dict[str, Any] = {LOOP: REFUSED | {"seconds": seconds}}
    if "error" not in answer:
        after = {name: item["held_out"]["rms_after"] for name, item in answer["equations"].items()}
        groups = [step["effect"] for step in answer["steps"]]
        found[LOOP] = _told(groups, after, without_it.held_out, seconds)
        found[LOOP]["exact"] = naming_of(expected_of(case), answer)[0] == RIGHT
    started = time.process_time()
    prepared = prepare_columns(with_it.fit, runs, held_out, dut)
    shared = time.process_time() - started
    before = _left(prepared)
    for name, select in SELECTORS.items():
        started = time.process_time()
        coefficients = select(prepared.task)
        seconds = shared + time.process_time() - started
        # what a column explains: columns have unit size
        order = np.argsort(-np.abs(coefficients))
        groups = list(dict.fromkeys(prepared.task.groups[k] for k in order if coefficients[k]))
        after = prepared.rms(coefficients)
        found[name] = _told(groups, after, floor, seconds)
        found[name]["over_before"] = max(rms / before[equation] for equation, rms in after.items())
        found[name]["exact"] = _exact(groups, case)
    return {
        "family": family,
        "seed": seed,
        "hidden": [*case.ids, *([case.outside] if case.outside else [])],
        "found": found,
    }


def _exact(groups: Collection[str], case: Case) -> bool:
    """Whether what is hidden is named, and nothing else but what may come along.

    Of two effects that no campaign here tells apart either name will do. The loop is judged alike by `naming_of`.
    """
    hidden = frozenset(case.ids)
    named = set(groups) - (expected_of(case).companions - hidden)
    return len(named) == 1 and any(named | hidden <= same for same in (hidden, *GROUPS))


def _left(prepared: Prepared) -> dict[str, float]:
    """Give what is left of the held-out runs where nothing is added."""
    return prepared.rms(np.zeros(len(prepared.task.groups)))


def _told(groups: list[str], after: dict[str, float], oracle: dict[str, float], seconds: float) -> dict[str, Any]:
    return {"groups": groups, "over_oracle": max(after[name] / oracle[name] for name in after), "seconds": seconds}


def report(lines: list[dict[str, Any]]) -> str:
    """Give the table: one row for the loop and for every selector."""
    rows = [
        "| | exact | first group right | groups claimed | silent on noise | held-out <= 1.05 oracle, known | "
        "after / oracle, unlisted physics | processor seconds |",
        "|" + "---|" * 8,
    ]
    for name in (LOOP, *SELECTORS):
        some = {
            family: [(x["hidden"], x["found"][name]) for x in lines if x["family"] == family and name in x["found"]]
            for family in COUNTS
        }
        single, none, outside = some["single"], some["none"], some["outside"]
        cells = [
            f"{sum(f['exact'] for _, f in single)}/{len(single)}",
            f"{sum(_first(h, f['groups']) for h, f in single)}/{len(single)}",
            f"{np.mean([len(f['groups']) for _, f in single]):.1f}" if single else "-",
            f"{sum(not f['groups'] for _, f in none)}/{len(none)}",
            f"{sum(f['over_oracle'] <= NEAR for _, f in single)}/{len(single)}",
            ", ".join(f"{f['over_oracle']:.2f}" for _, f in outside) or "-",
            f"{np.median([f['seconds'] for both in some.values() for _, f in both]):.0f}" if lines else "-",
        ]
        rows.append(f"| {name} | " + " | ".join(cells) + " |")
    codes = ", ".join(sorted({line.get("code", "unknown") for line in lines}))
    return "\n".join([*rows, "", f"Answers of {codes}."]) + "\n"


def _first(hidden: list[str], groups: list[str]) -> bool:
    return bool(groups) and hidden[0] in groups[0].removeprefix("ambiguous:").split("|")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.challenge.peers", description=__doc__)
    parser.add_argument("--family", action="append", choices=list(COUNTS), help="only this one; may be repeated")
    parser.add_argument("--dev", action="store_true", help="seeds for development")
    parser.add_argument("--scale", type=float, default=1.0, help="times the default number of campaigns")
    parser.add_argument("--table", type=Path, help="only print the table of what is in this folder")
    parser.add_argument("-o", "--out", type=Path, default=Path("runs/peers"))
    asked = parser.parse_args()
    folder = asked.table or asked.out
    folder.mkdir(parents=True, exist_ok=True)
    if asked.table is None:
        code = git_state()
        known = done(folder, code)
        seeds = DEVELOPMENT if asked.dev else UNSEEN
        for family in asked.family or COUNTS:
            for k in range(max(1, round(asked.scale * COUNTS[family]))):
                seed = _seed_of(family, seeds, k)
                if (family, seed) in known:
                    continue
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    line = compare(family, seed)
                with (folder / "peers.jsonl").open("a") as file:
                    file.write(json.dumps(line | {"code": code}) + "\n")
                print(line["hidden"], {name: item["groups"] for name, item in line["found"].items()}, flush=True)
    print(report(lines_in(folder)))


def _seed_of(family: str, seeds: range, number: int) -> int:
    """Give the number-th seed of the range with a case that suits: effects of the rich plan that repeat, spread out."""
    step = 7 if family == "single" else 1
    suited = (
        seed
        for seed in seeds[::step]
        if family != "single"
        or (make_case(family, seed).design == "rich" and "encoder-missed-counts" not in make_case(family, seed).ids)
    )
    return next(seed for k, seed in enumerate(suited) if k == number)


if __name__ == "__main__":
    main()
