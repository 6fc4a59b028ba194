"""The whole benchmark: cases on several processes, resumed where it stopped, and its figures."""

from __future__ import annotations

import json
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from slamreplay.bench.conditions import CONDITIONS
from slamreplay.bench.failures import write_case
from slamreplay.bench.incidents import KINDS
from slamreplay.bench.measure import Measured, measured
from slamreplay.bench.resumed import RESULTS, played_into
from slamreplay.bench.schedule import Case, Split, schedule
from slamreplay.bench.scores import hindsight_size, is_right, named, scores
from slamreplay.bench.store import fingerprint
from slamreplay.bench.table import page
from slamreplay.bundle.atomic import write_file
from slamreplay.report.figures import canvas
from slamreplay.report.figures.reliability import reliability_figure
from slamreplay.verdict.reliability import Bin, Reliability

PAGE, FAILURES = "results.md", "failures"
RELIABILITY, DIAGRAM = "reliability.json", "reliability.svg"
#: The record that `consistency.evidence.hindsight_size` ships with, from logs to develop with.
HINDSIGHT_SIZE = "hindsight_size.json"
#: Kinds that are a hard condition by themselves.
_HARD_KINDS = ("half_changed",)


def run_benchmark(
    target: Path,
    *,
    logs: int,
    seed: int = 0,
    split: Split = "held",
    kinds: Sequence[str] = KINDS,
    conditions: Sequence[str] = tuple(CONDITIONS),
    jobs: int = 2,
    reports: bool = False,
    progress: Callable[[str, float], None] | None = None,
) -> dict[str, Any]:
    """Judge incidents and write results.json and results.md; the results.

    Logs that the same code has judged before in this folder are not judged again. With `reports`
    each log that was judged wrongly gets its report, in the folder `failures`.

    Raises:
        OutputError: the folder is somebody else's or cannot be written.
    """
    cases = schedule(logs, seed, split, kinds, conditions)
    found = played_into(target, cases, fingerprint(), jobs, measured_or_failed, progress)
    results = results_of(found, seed, split)
    write_file(target / PAGE, page(results).encode())
    _write_reliability(target, results)
    size = hindsight_size(found, seed, split)
    if size is not None:
        text = json.dumps(size.as_json(), indent=1, allow_nan=False)
        write_file(target / HINDSIGHT_SIZE, (text + "\n").encode())
    text = json.dumps(results, indent=1, allow_nan=False, sort_keys=True)
    write_file(target / RESULTS, text.encode())
    wrong = [m.case for m in found if reports and not is_right(m) and "error" not in m.facts]
    for i, case in enumerate(wrong):
        if progress is not None:
            progress(f"report of {case.name}", i / len(wrong))
        write_case(case, target / FAILURES)
    return results


def results_of(found: Sequence[Measured], seed: int, split: Split) -> dict[str, Any]:
    """All figures, over everything and by kind and condition, and what became of each case."""
    plain = [m for m in found if not m.case.conditions]
    kinds = [k for k in KINDS if any(m.case.kind == k for m in plain)]
    hard = [c for c in CONDITIONS if any(c in m.case.conditions for m in found)]
    return {
        "complete": True,
        "seed": seed,
        "split": split,
        "scores": scores(found),
        "kinds": {k: scores([m for m in plain if m.case.kind == k]) for k in kinds},
        "conditions": {
            **{c: scores([m for m in found if c in m.case.conditions]) for c in hard},
            **{k: scores(half) for k in _HARD_KINDS if (half := _of_kind(found, k))},
        },
        "failure_modes": {k: named(_of_kind(found, k)) for k in KINDS if _of_kind(found, k)},
        "cases": [_told(m) for m in found],
    }


def _of_kind(found: Sequence[Measured], kind: str) -> list[Measured]:
    return [m for m in found if m.case.kind == kind]


def _write_reliability(target: Path, results: dict[str, Any]) -> None:
    """The record a version ships with (`slamreplay.verdict.reliability`), and its diagram."""
    total = results["scores"]
    sure = total["calibration"]
    bins = tuple(Bin(**b) for b in sure["bins"])
    record = Reliability(total["logs"], results["seed"], sure["ece"][0], bins)
    text = json.dumps(record.as_json(), indent=1, allow_nan=False)
    write_file(target / RELIABILITY, (text + "\n").encode())
    with canvas.plain_style():
        figure = reliability_figure(record, canvas.BESIDE)
        if figure is not None:
            write_file(target / DIAGRAM, canvas.svg_bytes(figure))


def measured_or_failed(case: Case) -> Measured:
    """A case judged; a fault of ours becomes its result, and the other cases go on."""
    try:
        return measured(case)
    except Exception as error:  # whatever it is, it must stand in the table
        text = f"{type(error).__name__}: {error} at {traceback.extract_tb(error.__traceback__)[-1]}"
        return Measured(case, {"error": text, "judged": None, "state": None, "findings": []})


def _told(one: Measured) -> dict[str, Any]:
    case = one.case
    said = {
        "case": case.name,
        "kind": case.kind,
        "seed": case.seed,
        "conditions": list(case.conditions),
        "right": is_right(one),
        **one.facts,
    }
    m = one.moments
    if m:
        for name in ("lost", "changed", "judged_lost", "judged_changed", "unjudged"):
            said[f"{name}_share"] = float(m[name].mean())
        error = m["error_m"][np.isfinite(m["error_m"])]
        for name, q in (("median", 0.5), ("p95", 0.95)):
            said[f"hindsight_{name}_m"] = float(np.quantile(error, q)) if len(error) else None
    return said
