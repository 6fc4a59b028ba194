"""How often a root cause is named right: confusion matrix, accuracy, recall and calibration."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, get_args

import numpy as np

from slamreplay.bench.measure import Measured
from slamreplay.consistency.statistics.shares import wilson
from slamreplay.verdict.judgement import FailureKind
from slamreplay.verdict.reliability import Bin

#: Answers in the order of the columns.
NAMES: tuple[str, ...] = get_args(FailureKind)
_BINS = 10


def counted(right: int, of: int) -> list[float | None]:
    """A share and its 95 % interval; None with the whole range where nothing was counted."""
    share = right / of if of else None
    return [share, *wilson(share or 0.0, of)]


def cause_scores(logs: Sequence[Measured], name: str) -> dict[str, Any]:
    """Every figure of one answerer, as JSON.

    Only logs in which something happened that has a known cause are counted as incidents; those in
    which nothing happened stand under `no_incident`, where the cause that was put in without any
    effect is no false alarm either.

    Args:
        logs: as `slamreplay.bench.cause_measure` makes them.
        name: of the answerer.
    """
    whole = [m for m in logs if "error" not in m.facts]
    calm = [m for m in whole if m.facts["happened"] == "none"]
    unknown = [m for m in whole if m.facts["happened"] != "none" and not m.facts["accepted"]]
    # A log on which the program failed is one whose cause was not named.
    broken = [m for m in logs if "error" in m.facts]
    known = [m for m in whole if m.facts["happened"] != "none" and m.facts["accepted"]]
    right = sum(is_named(m, name) for m in known)
    of = len(known) + len(broken)
    recalls = _recalls(known, name)
    said = [m.facts["said"][name] for m in whole]
    return {
        "logs": len(logs),
        "failed": len(broken),
        "unknown_cause": len(unknown),
        "incidents": of,
        "right": right,
        "accuracy": counted(right, of),
        "balanced_accuracy": float(np.mean([r["share"][0] for r in recalls.values()]))
        if recalls
        else None,
        "among_first_two": counted(_first_two(known, name), of),
        "by_label": recalls,
        "by_kind": _by_kind(known, name),
        "confusion": confusion(known + calm, name),
        "no_incident": _calm(calm, name),
        "calibration": cause_calibration(known, name),
        "cpu_s": _quantiles([s["cpu_s"] for s in said]),
        "trials": _quantiles([s["trials"] for s in said]),
    }  # fmt: skip


def is_named(one: Measured, name: str) -> bool:
    """Whether the answer is one of the right ones."""
    return one.facts["said"][name]["kind"] in one.facts["accepted"]


def confusion(logs: Sequence[Measured], name: str) -> dict[str, dict[str, int]]:
    """Label to what was said of such logs, in counts; labels of several right answers last."""
    rows: dict[str, Counter[str]] = {}
    for m in logs:
        rows.setdefault(m.facts["label"], Counter())[m.facts["said"][name]["kind"]] += 1
    order = sorted(rows, key=lambda label: (" or " in label, _place(label.split(" or ")[0]), label))
    return {label: {n: rows[label][n] for n in NAMES if rows[label][n]} for label in order}


def cause_calibration(logs: Sequence[Measured], name: str) -> dict[str, Any]:
    """Whether probabilities are frequencies: expected calibration error (Naeini et al., 2015).

    One answer per incident; `moments` of the bins are answers, as are their `logs`.
    """
    said = [(m.facts["said"][name]["probability"], is_named(m, name)) for m in logs]
    known = [(p, ok) for p, ok in said if p is not None]
    if not known:
        return {"ece": None, "bins": [], "answers": 0}
    p, ok = np.array([p for p, _ in known]), np.array([ok for _, ok in known], dtype=np.float64)
    at = np.minimum((p * _BINS).astype(np.int64), _BINS - 1)
    gap = np.bincount(at, p, _BINS) - np.bincount(at, ok, _BINS)
    bins = [
        asdict(
            Bin(
                k / _BINS,
                (k + 1) / _BINS,
                float(p[at == k].mean()),
                float(ok[at == k].mean()),
                int((at == k).sum()),
                int((at == k).sum()),
            )
        )
        for k in range(_BINS)
        if (at == k).any()
    ]
    return {"ece": float(np.abs(gap).sum() / len(p)), "bins": bins, "answers": len(p)}


def _place(label: str) -> int:
    return NAMES.index(label) if label in NAMES else len(NAMES)


def _share(logs: Sequence[Measured], name: str) -> dict[str, Any]:
    right = sum(is_named(m, name) for m in logs)
    return {"logs": len(logs), "share": counted(right, len(logs))}


def _recalls(logs: Sequence[Measured], name: str) -> dict[str, Any]:
    labels = sorted({m.facts["label"] for m in logs}, key=lambda x: (" or " in x, _place(x), x))
    return {k: _share([m for m in logs if m.facts["label"] == k], name) for k in labels}


def _by_kind(logs: Sequence[Measured], name: str) -> dict[str, Any]:
    kinds = dict.fromkeys(m.case.kind for m in logs)
    return {k: _share([m for m in logs if m.case.kind == k], name) for k in kinds}


def _first_two(logs: Sequence[Measured], name: str) -> int:
    """How often a right answer is one of the first two."""
    hits = 0
    for m in logs:
        said = m.facts["said"][name]
        first = [said["kind"], *(kind for kind, _ in said["ranked"] if kind != said["kind"])][:2]
        hits += any(kind in m.facts["accepted"] for kind in first)
    return hits


def _calm(logs: Sequence[Measured], name: str) -> dict[str, int]:
    """What was said where nothing happened."""
    said = [(m.facts["said"][name]["kind"], m.facts["done"]) for m in logs]
    return {
        "logs": len(logs),
        "none": sum(kind == "none" for kind, _ in said),
        "what_was_put_in": sum(kind in done for kind, done in said),
        "something_else": sum(kind != "none" and kind not in done for kind, done in said),
    }


def _quantiles(values: Sequence[float]) -> dict[str, float | None]:
    if not values:
        return {"median": None, "p95": None, "max": None}
    median, p95, most = np.quantile(np.array(values, dtype=np.float64), [0.5, 0.95, 1.0])
    return {"median": float(median), "p95": float(p95), "max": float(most)}
