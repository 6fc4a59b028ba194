"""All figures of a set of judged logs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bench.baselines import FIELD_THRESHOLDS
from slamreplay.bench.measure import Measured
from slamreplay.bench.rates import Rate, auc, best_f1, clustered, f1, share
from slamreplay.consistency.evidence.hindsight_size import HindsightSize
from slamreplay.verdict.reliability import Bin

FOUR = ("healthy", "lost", "map_changed", "lost_and_map_changed")
#: Moments this near to a true edge are left out; the figure with them stands beside.
EDGE_S = 0.5
#: AUC and thresholds look at one moment in so many: neighbours say the same.
_THIN = 5
_BINS = 10


def scores(logs: Sequence[Measured]) -> dict[str, Any]:
    """Every figure of the benchmark, as JSON: rates are [value, low, high], unknown ones null."""
    judged = [m for m in logs if m.moments and m.case.kind != "wrong_map"]
    out: dict[str, Any] = {
        "logs": len(logs),
        "failed": sum("error" in m.facts for m in logs),
        "log_accuracy": _log_accuracy(logs).as_json(),
        "wrong_map_told": _wrong_map(logs).as_json(),
        "lost_on_healthy_logs": sum(_lost_on_healthy(m) for m in logs),
        "healthy_logs": sum(m.facts.get("state") == "healthy" for m in logs),
    }
    for name in ("lost", "changed"):
        out[name] = _per_moment(judged, name, kept=_off_edges)
        out[f"{name}_with_edges"] = _per_moment(judged, name, kept=_all)
        out[name]["delay_s"] = _delays(judged, name)
    out["unjudged_share"] = _count(judged, lambda m: m["unjudged"]).as_json()
    out["hindsight"] = _hindsight(judged)
    out["regions"] = _regions(judged)
    out["auc_lost_against_changed"] = _auc(judged, "ratio", against_changed=True).as_json()
    out["auc_identical_aisle_against_changed"] = _auc(
        [m for m in judged if m.case.kind == "identical_aisles" or not m.moments["lost"].any()],
        "ratio",
        against_changed=True,
    ).as_json()
    out["calibration"] = calibration(judged)
    out["baselines"] = {name: _baseline(judged, name) for name in FIELD_THRESHOLDS}
    return out


def is_right(one: Measured) -> bool:
    """Whether the state of the log is the true one."""
    return bool(one.facts.get("judged") == one.facts.get("state") and "error" not in one.facts)


def named(logs: Sequence[Measured]) -> dict[str, int]:
    """How often each failure mode was named, the most frequent first."""
    counts = Counter(m.facts["failure_mode"] for m in logs if "failure_mode" in m.facts)
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))


def _log_accuracy(logs: Sequence[Measured]) -> Rate:
    four = [m for m in logs if m.case.kind != "wrong_map"]
    return share(np.array([is_right(m) for m in four]), np.ones(len(four)))


def _wrong_map(logs: Sequence[Measured]) -> Rate:
    wrong = [m for m in logs if m.case.kind == "wrong_map"]
    told = [is_right(m) and "SR-MAP-WRONG" in m.facts["findings"] for m in wrong]
    return share(np.array(told), np.ones(len(wrong)))


def _lost_on_healthy(one: Measured) -> bool:
    return one.facts.get("state") == "healthy" and one.facts.get("judged") in (
        "lost",
        "lost_and_map_changed",
    )


def _all(m: dict[str, NDArray], name: str) -> NDArray[np.bool_]:  # noqa: ARG001 - as _off_edges
    return np.ones(len(m["t_s"]), dtype=bool)


def _off_edges(m: dict[str, NDArray], name: str) -> NDArray[np.bool_]:
    """Moments farther than half a second from where the truth changes its mind."""
    t, flags = m["t_s"], m[name]
    edges = 0.5 * (t[1:] + t[:-1])[flags[1:] != flags[:-1]]
    kept = np.ones(len(t), dtype=bool)
    for edge in edges:
        kept &= np.abs(t - edge) > EDGE_S
    return kept


def _per_moment(
    logs: Sequence[Measured],
    name: str,
    kept: Callable[[dict[str, NDArray], str], NDArray[np.bool_]],
) -> dict[str, Any]:
    """Precision, recall and F1 of one question; a moment that was not judged says no."""
    true, false, missed = (np.zeros(len(logs)) for _ in range(3))
    for i, one in enumerate(logs):
        m, use = one.moments, kept(one.moments, name)
        said, is_so = m[f"judged_{name}"][use], m[name][use]
        true[i], false[i] = (said & is_so).sum(), (said & ~is_so).sum()
        missed[i] = (~said & is_so).sum()
    return {
        "precision": share(true, true + false).as_json(),
        "recall": share(true, true + missed).as_json(),
        "f1": f1(true, false, missed).as_json(),
        "moments": int((true + missed).sum()),
    }


def _delays(logs: Sequence[Measured], name: str) -> dict[str, Any]:
    """From the start of each true stretch to the first moment in it that was called so, s."""
    found, missed = [], 0
    for one in logs:
        m = one.moments
        flags = np.concatenate([[False], m[name], [False]])
        first, end = (
            np.flatnonzero(flags[1:] & ~flags[:-1]),
            np.flatnonzero(flags[:-1] & ~flags[1:]),
        )
        for a, b in zip(first, end, strict=True):
            said = np.flatnonzero(m[f"judged_{name}"][a:b])
            missed += not len(said)
            found += [float(m["t_s"][a + said[0]] - m["t_s"][a])] if len(said) else []
    median, late = np.quantile(found, [0.5, 0.95]) if found else (None, None)
    return {
        "stretches": len(found) + missed,
        "missed": missed,
        "median": None if median is None else float(median),
        "p95": None if late is None else float(late),
    }


def _count(logs: Sequence[Measured], flags: Callable[[dict[str, NDArray]], NDArray]) -> Rate:
    hits = np.array([flags(m.moments).sum() for m in logs])
    return share(hits, np.array([len(m.moments["t_s"]) for m in logs]))


def _hindsight(logs: Sequence[Measured]) -> dict[str, Any]:
    """Errors of all poses hindsight gives, and how many it gives."""
    rows = [m.moments["error_m"] for m in logs]
    turned = [m.moments["error_rad"] for m in logs]
    values = np.concatenate(rows) if rows else np.zeros(0)
    log = np.repeat(np.arange(len(rows)), [len(r) for r in rows])
    good = np.isfinite(values)
    order = np.argsort(values[good], kind="stable")
    sorted_m, log_of = values[good][order], log[good][order]

    def quantile(q: float) -> Rate:
        def of(weights: NDArray) -> float:
            w = np.cumsum(weights[log_of])
            return float(sorted_m[np.searchsorted(w, q * w[-1])]) if len(w) and w[-1] else np.nan

        return clustered(of, len(rows))

    radians = np.concatenate(turned)[good] if turned else np.zeros(0)
    return {
        "median_m": quantile(0.5).as_json(),
        "p95_m": quantile(0.95).as_json(),
        "p95_rad": float(np.quantile(radians, 0.95)) if len(radians) else None,
        "over_half_m": _count(logs, lambda m: m["error_m"] > 0.5).as_json(),
        "coverage": _count(logs, lambda m: np.isfinite(m["error_m"])).as_json(),
    }


def _regions(logs: Sequence[Measured]) -> dict[str, Any]:
    there = np.array([m.facts["regions"] for m in logs], dtype=np.float64)
    found = np.array([m.facts["regions_found"] for m in logs], dtype=np.float64)
    false = np.array([m.facts["false_area_m2"] for m in logs], dtype=np.float64)
    unchanged = np.array([not m.facts["regions"] for m in logs], dtype=bool)
    return {
        "recall": share(found, there).as_json(),
        "there": int(there.sum()),
        "false_area_m2_per_log": share(false, np.ones(len(logs))).as_json(),
        "false_area_m2_per_unchanged_log": share(
            np.where(unchanged, false, 0.0), unchanged
        ).as_json(),
    }


def _thinned(logs: Sequence[Measured], name: str) -> tuple[NDArray, ...]:
    """One moment in `_THIN`, off the edges: score, lost, changed, log."""
    parts: list[tuple[NDArray, ...]] = []
    for i, one in enumerate(logs):
        m = one.moments
        rows = np.flatnonzero(_off_edges(m, "lost") & _off_edges(m, "changed"))[::_THIN]
        parts.append((m[name][rows], m["lost"][rows], m["changed"][rows], np.full(len(rows), i)))
    if not parts:
        return np.zeros(0), np.zeros(0, bool), np.zeros(0, bool), np.zeros(0, np.int64)
    return tuple(np.concatenate(column) for column in zip(*parts, strict=True))


def _auc(logs: Sequence[Measured], name: str, *, against_changed: bool) -> Rate:
    """Lost moments against changed ones (those that are both left out), or against all others."""
    score, lost, changed, log = _thinned(logs, name)
    use = lost ^ changed if against_changed else np.ones(len(lost), dtype=bool)
    return auc(score[use], lost[use], log[use], len(logs))


def _baseline(logs: Sequence[Measured], name: str) -> dict[str, Any]:
    score, lost, _, log = _thinned(logs, name)
    best, _ = best_f1(score, lost)
    out: dict[str, Any] = {
        "auc_lost": _auc(logs, name, against_changed=False).as_json(),
        "auc_lost_against_changed": _auc(logs, name, against_changed=True).as_json(),
    }
    for title, threshold in (("field", FIELD_THRESHOLDS[name]), ("best", best)):
        with np.errstate(invalid="ignore"):
            said = score >= threshold
        true, false, missed = (
            np.bincount(log, flags, minlength=len(logs))
            for flags in (said & lost, said & ~lost, ~said & lost)
        )
        out[f"f1_lost_{title}"] = f1(true, false, missed).as_json()
        out[f"threshold_{title}"] = float(threshold) if np.isfinite(threshold) else None
    return out


def calibration(logs: Sequence[Measured]) -> dict[str, Any]:
    """Whether confidences are frequencies: expected calibration error (Naeini et al., 2015).

    Per moment, off the edges: the confidence of its interval against whether its state is right.
    """
    sure, right, log = [], [], []
    for i, one in enumerate(logs):
        m = one.moments
        use = _off_edges(m, "lost") & _off_edges(m, "changed") & np.isfinite(m["confidence"])
        sure.append(m["confidence"][use])
        both = (m["judged_lost"] == m["lost"]) & (m["judged_changed"] == m["changed"])
        right.append(both[use])
        log.append(np.full(int(use.sum()), i))
    if not sure or not sum(len(s) for s in sure):
        return {"ece": [None, None, None], "bins": [], "log_ece": None}
    p, ok, of = np.concatenate(sure), np.concatenate(right), np.concatenate(log)
    at = np.minimum((p * _BINS).astype(np.int64), _BINS - 1)

    def ece(weights: NDArray) -> float:
        w = weights[of]
        gap = np.bincount(at, w * p, _BINS) - np.bincount(at, w * ok, _BINS)
        return float(np.abs(gap).sum() / w.sum()) if w.sum() else np.nan

    bins = [
        asdict(Bin(k / _BINS, (k + 1) / _BINS, float(p[at == k].mean()), float(ok[at == k].mean()),
                   int((at == k).sum()), len(set(of[at == k].tolist()))))
        for k in range(_BINS) if (at == k).any()
    ]  # fmt: skip
    whole = [(m.facts["confidence"], is_right(m)) for m in logs]
    said = [(c, r) for c, r in whole if c is not None]
    return {"ece": clustered(ece, len(logs)).as_json(), "bins": bins, "log_ece": _log_ece(said)}


def _log_ece(said: Sequence[tuple[float, bool]]) -> float | None:
    if not said:
        return None
    p, ok = np.array([c for c, _ in said]), np.array([r for _, r in said], dtype=np.float64)
    at = np.minimum((p * _BINS).astype(np.int64), _BINS - 1)
    gap = np.bincount(at, p, _BINS) - np.bincount(at, ok, _BINS)
    return float(np.abs(gap).sum() / len(p))


def hindsight_size(logs: Sequence[Measured], seed: int, split: str) -> HindsightSize | None:
    """How much too small hindsight's own sigma was; None where no log had a place."""
    factors = []
    for m in logs:
        values = [m.moments.get(name) for name in ("nees_xy", "nees_yaw")]
        told = [v[np.isfinite(v)] for v in values if v is not None]
        if len(told) == 2 and all(len(v) for v in told):
            factors.append([float(told[0].mean()) / 2.0, float(told[1].mean())])
    if not factors:
        return None
    sizes = (np.mean(factors, axis=0), *np.quantile(factors, (0.5, 0.95), axis=0))
    numbers = np.sqrt(np.concatenate(sizes)).tolist()
    return HindsightSize(len(factors), seed, split, *numbers)
