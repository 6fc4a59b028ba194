"""What there is of each kind, and what a finding means: for terminals and notebooks."""

from __future__ import annotations

from difflib import get_close_matches
from math import isfinite
from typing import TYPE_CHECKING

from slamreplay.errors import UsageError

if TYPE_CHECKING:
    from slamreplay.bundle.findings import Explanation
    from slamreplay.registry import Registry

KINDS = (
    "estimators", "perturbations", "checks", "decoders", "scenarios", "findings", "labs", "metrics",
)  # fmt: skip


def catalogue(kind: str) -> list[dict[str, object]]:
    """One row per thing, with its name and one line about it.

    Raises:
        UsageError: there is no such kind.
    """
    if kind not in KINDS:
        raise UsageError(f"there is no list of '{kind}'", hint=f"there are: {', '.join(KINDS)}")
    if kind == "scenarios":
        from slamreplay.simulate import SCENARIOS

        return [{"name": name, "doc": doc} for name, doc in SCENARIOS.items()]
    if kind == "findings":
        from slamreplay.bundle.findings import FINDINGS

        return [{"name": name, "doc": what.title} for name, what in FINDINGS.items()]
    if kind == "perturbations":
        return _perturbations()
    if kind == "metrics":
        return _metrics()
    registry = _registry(kind)
    rows: list[dict[str, object]] = []
    for name in registry:
        thing = registry.load(name)
        if kind == "decoders":
            rows.append({"name": name, "doc": f"to table {thing.table}"})
        elif kind == "estimators":
            needs = ", ".join(sorted(thing.needs))
            rows.append({"name": name, "needs": needs, "doc": _first_line(thing)})
        else:
            rows.append({"name": name, "doc": _first_line(thing)})
    return rows


def _perturbations() -> list[dict[str, object]]:
    """A row per variant, with the unit and the baseline its level is given in."""
    from slamreplay.perturb import PERTURBATIONS

    rows: list[dict[str, object]] = []
    for name in PERTURBATIONS:
        perturbation = PERTURBATIONS.load(name)
        for variant, about in perturbation.variants.items():
            rows.append(
                {
                    "name": f"{name}.{variant}",
                    "unit": about.unit,
                    "baseline": about.baseline,
                    "low": about.low,
                    "high": about.high if isfinite(about.high) else None,
                    "is_switch": about.is_switch,
                    "touches": sorted(perturbation.touches),
                    "about": _first_line(perturbation),
                    "doc": about.doc,
                }
            )
    return rows


def _metrics() -> list[dict[str, object]]:
    """Those that a gate may limit: per log, over time, and of estimators that run again."""
    from slamreplay.gate.metrics import METRICS, OF_TRIALS

    named = [(name, "time" if of.over_time else "log", of) for name, of in METRICS.items()]
    named += [(f"ESTIMATOR.{name}", "run", of) for name, of in OF_TRIALS.items()]
    return [
        {"name": name, "per": per, "unit": of.unit, "better": of.better, "doc": of.doc}
        for name, per, of in named
    ]


def explanation_of(id_: str) -> tuple[str, Explanation]:
    """A finding's id as it is written, and what it means; upper and lower case are one.

    Raises:
        UsageError: there is no such finding.
    """
    from slamreplay.bundle.findings import FINDINGS

    known = {name.lower(): name for name in FINDINGS}
    if id_.lower() not in known:
        near = get_close_matches(id_.upper(), FINDINGS, n=1)
        hint = f"did you mean '{near[0]}'?" if near else "'slamreplay list findings' has them all"
        raise UsageError(f"there is no finding '{id_}'", hint=hint)
    name = known[id_.lower()]
    return name, FINDINGS[name]


def _registry(kind: str) -> Registry:
    if kind == "estimators":
        from slamreplay.estimators import ESTIMATORS

        return ESTIMATORS
    if kind == "checks":
        from slamreplay.consistency import CHECKS

        return CHECKS
    if kind == "labs":
        from slamreplay.labs import LABS

        return LABS
    from slamreplay.ingest import DECODERS

    return DECODERS


def _first_line(thing: object) -> str:
    text = (thing.__doc__ or "").strip()
    return text.splitlines()[0] if text else ""
