"""One case from the draw to its line in the results: hide, let the loop answer, freeze the answer, score it."""

import json
import multiprocessing
import resource
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from drivers.errors import LimitError, RigError
from rig.config.dut import Dut
from rig.log.run import Run
from rig.loop.campaign import LoopOptions
from rig.loop.trace import trace
from rig.provenance import git_state
from tests.challenge import on_bench
from tests.challenge.cases import Case, make_case
from tests.challenge.scoring import score
from tests.challenge.sizes import Hidden, floor_of, hide, logs_of, oracle_errors
from tests.rig.loop.runs import dut as default_dut


def answer_of(runs: Sequence[Run], dut: Dut, held_out: tuple[str, ...]) -> str:
    """Let the loop answer, and freeze what it says as JSON: it is given the logs and the device file, nothing else."""
    started = processor_seconds()
    try:
        result = trace(runs, dut, LoopOptions(held_out=held_out))
    except RigError as error:
        return json.dumps({"error": str(error)})
    except Exception as error:  # a crash is no answer, and no reason to lose the other cases
        return json.dumps({"error": f"crash, {type(error).__name__}: {error}"})
    base = {name: value.model_dump() for name, value in result.model.base.parameters.items()}
    # of this process: on a busy machine the wall clock measures the others
    return json.dumps({**result.to_json(), "base": base, "processor_s": processor_seconds() - started})


def processor_seconds() -> float:
    """Give the processor time of this process and of those that it has ended, s."""
    return sum(
        used.ru_utime + used.ru_stime
        for used in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )


def run_case(family: str, seed: int) -> dict[str, Any]:
    """Give the line of one case."""
    case = make_case(family, seed)
    if family == "bench":
        floor, hidden, runs, dut, held_out = on_bench.prepared(case)
        oracle = floor.held_out
    else:
        floor, dut = floor_of(case), default_dut()
        hidden = hide(case, floor)
        runs, held_out = logs_of(case, hidden)
        oracle = oracle_errors(case, hidden, floor, runs, held_out)
    frozen = answer_of(runs, dut, held_out)
    answer = json.loads(frozen)
    samples = sum(run.time.size for run in runs)
    return {
        **_told(case, hidden),
        "runs": len(runs),
        "samples": samples,
        **score(case, hidden, oracle, floor.held_out, answer),
        **_brief(answer),
    }


def _told(case: Case, hidden: Hidden) -> dict[str, Any]:
    return {
        "family": case.family,
        "seed": case.seed,
        "design": case.design,
        "noise": case.noise.value,
        "hidden": list(case.ids) or ([case.outside] if case.outside else []),
        "wanted": case.size,
        "sizes": list(hidden.sizes),
        "in": list(hidden.equations),
        "scales": list(hidden.scales),
        "lacks": case.needs,
        "truth": [asdict(effects) for effects in hidden.effects],
        "constants": {**case.constants, "amplitude": hidden.outside_amplitude} if case.outside else {},
    }


def _brief(answer: dict[str, Any]) -> dict[str, Any]:
    """Give what one wants to see of the answer to know where it fails."""
    if "error" in answer:
        return {}
    keep = ("verdict", "effect", "set", "variable", "shape", "equation", "p_value", "lines")
    return {
        "steps": [{key: step[key] for key in keep} for step in answer["steps"]],
        "open": [
            {"verdict": item["verdict"], "group": item["group"], "meaning": item["evidence"].get("meaning")}
            for item in answer["open"]
        ],
        "seconds": answer["processor_s"],
        "warnings": [text for text in answer["warnings"] if text.startswith("Found, not added")],
    }


def run_all(cases: Iterable[tuple[str, int]], folder: Path, workers: int) -> None:
    """Run every case that this code has no line of in the folder's files; each is appended as soon as it is there."""
    folder.mkdir(parents=True, exist_ok=True)
    code = git_state()
    known = done(folder, code)
    open_cases = [(family, seed, folder, code) for family, seed in cases if (family, seed) not in known]
    if workers == 1:
        for item in open_cases:
            _append(item)
        return
    with multiprocessing.get_context("spawn").Pool(workers, maxtasksperchild=20) as pool:
        for _ in pool.imap_unordered(_append, open_cases):
            pass


def _append(item: tuple[str, int, Path, str]) -> None:
    family, seed, folder, code = item
    if (family, seed) in done(folder, code):  # another process was faster
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            line = run_case(family, seed)
        except LimitError as error:
            # an effect so large that no campaign can be recorded with it: no case
            print(f"{family} {seed}: not recorded, a limit of the bench ended a run: {error}", flush=True)
            return
    with (folder / f"{family}.jsonl").open("a") as file:
        file.write(json.dumps({**line, "code": code}) + "\n")
    found = ", ".join(line.get("added", [])) or line.get("error", "-")
    print(
        f"{family} {seed} {line['design']} {line['noise']}: {', '.join(line['hidden'])} -> {line['naming']}: {found}",
        flush=True,
    )


def done(folder: Path, code: str) -> set[tuple[str, int]]:
    """Give the cases that have a line of this code, a commit: what another loop answered is asked again."""
    return {(line["family"], line["seed"]) for line in lines_in(folder) if line.get("code") == code}


def lines_in(folder: Path) -> list[dict[str, Any]]:
    """Give the lines of all results in a folder, one a case, by family and seed."""
    found: dict[tuple[str, int], dict[str, Any]] = {}
    for path in sorted(folder.glob("*.jsonl")):
        for text in path.read_text("utf-8").splitlines():
            line = json.loads(text)
            found[line["family"], line["seed"]] = line
    return [found[key] for key in sorted(found)]
