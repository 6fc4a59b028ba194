"""The answer as tables, sentences and a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from slamreplay.labs.covariance_collapse.trials import CHECKS, Claim
from slamreplay.labs.lab import LabResults, ResultTable
from slamreplay.report.figures.covariance_collapse import Course, Found, collapse_figure

Claims = Mapping[tuple[str, float], Sequence[Claim]]


def results(claims: Claims, every_s: Sequence[float | None]) -> LabResults:
    """What all logs say together.

    Args:
        claims: by estimator and scale of Q, one a log.
        every_s: seconds between references, None for a log without.
    """
    logs = len(next(iter(claims.values())))
    found = {key: _summary(runs, every_s) for key, runs in claims.items()}
    estimators: dict[str, dict[str, Any]] = {}
    for (name, scale), numbers in found.items():
        estimators.setdefault(name, {})[f"{scale:g}"] = numbers
    tables = [
        ResultTable(
            f"{name}, medians over {logs} logs",
            ("Q times", "largest error [m]", "sigma then [m]", "largest error [sigma]",
             "motions allowed", "of them deceived", *_heads(every_s)),
            [_row(scale, of, logs, every_s) for scale, of in by_scale.items()],
        )
        for name, by_scale in estimators.items()
    ]  # fmt: skip
    notes = [
        (
            "SR-CON-010 is a collapse, SR-CON-001 a mean NEES, SR-CON-006 innovations that do not "
            "fit: in so many logs a warning or an error says that a covariance is too small. "
            "References are codes in the floor that no estimator was given; innovations need none."
        ),
        (
            "Motions allowed: three sigma fit into the clearance; deceived: the error was larger "
            "than the clearance all the same."
        ),
    ]
    return LabResults(
        numbers={"logs": logs, "estimators": estimators},
        tables=tables,
        notes=notes,
        figures={"collapse": lambda: _figure(claims, every_s)},
    )


def _summary(runs: Sequence[Claim], every_s: Sequence[float | None]) -> dict[str, Any]:
    worst = [int(np.argmax(run.error_m)) for run in runs]
    return {
        "largest_error_m": _median([run.error_m[k] for run, k in zip(runs, worst, strict=True)]),
        "sigma_then_m": _median([run.sigma_m[k] for run, k in zip(runs, worst, strict=True)]),
        "largest_error_sigmas": _median([run.largest_sigmas for run in runs]),
        "motions": sum(run.motions for run in runs),
        "allowed": sum(run.allowed for run in runs),
        "deceived": sum(run.deceived for run in runs),
        "found": {
            _every(every): {check: _found(runs, check, every) for check in CHECKS}
            for every in every_s
        },
    }


def _found(runs: Sequence[Claim], check: str, every: float | None) -> dict[str, Any]:
    from_s = [run.found_s[check, every] for run in runs if (check, every) in run.found_s]
    return {"logs": len(from_s), "from_s": _median(from_s) if from_s else None}


def _every(every: float | None) -> str:
    return "no reference" if every is None else f"every {every:g} s"


def _heads(every_s: Sequence[float | None]) -> list[str]:
    return [*(f"collapse, {_every(e)}" for e in every_s), *(f"NEES, {_every(e)}" for e in every_s),
            "innovations"]  # fmt: skip


def _row(
    scale: str, of: Mapping[str, Any], logs: int, every_s: Sequence[float | None]
) -> tuple[str, ...]:
    def cell(check: str, every: float | None) -> str:
        return f"{of['found'][_every(every)][check]['logs']} of {logs}"

    return (
        scale,
        f"{of['largest_error_m']:.2f}",
        f"{of['sigma_then_m']:.2f}",
        f"{of['largest_error_sigmas']:.1f}",
        f"{of['allowed']} of {of['motions']}",
        str(of["deceived"]),
        *(cell("SR-CON-010", every) for every in every_s),
        *(cell("SR-CON-001", every) for every in every_s),
        cell("SR-CON-006", every_s[-1]),
    )


def _median(values: Sequence[float]) -> float:
    return float(f"{float(np.median(values)):.4g}")


def _figure(claims: Claims, every_s: Sequence[float | None]) -> Figure:
    name = next(iter(claims))[0]
    scales = [scale for one, scale in claims if one == name]
    shown = [scales[0], min(scales)]
    best = next((e for e in every_s if e is not None), None)
    courses = [
        Course(
            f"{name}, told {'its noise' if scale == 1.0 else f'{scale:g} of its noise'}",
            [(run.t_s, run.error_m, run.sigma_m) for run in claims[name, scale]],
            [run.found_s["SR-CON-010", best] for run in claims[name, scale]
             if ("SR-CON-010", best) in run.found_s],
        )
        for scale in dict.fromkeys(shown)
    ]  # fmt: skip
    lines = [
        Found(f"SR-CON-010, {_every(every)}",
              [(s, _share(claims[name, s], "SR-CON-010", every)) for s in scales])
        for every in every_s
    ]  # fmt: skip
    gate = [(s, _deceived(claims[name, s])) for s in scales]
    return collapse_figure(courses, lines, gate)


def _share(runs: Sequence[Claim], check: str, every: float | None) -> float:
    return sum((check, every) in run.found_s for run in runs) / len(runs)


def _deceived(runs: Sequence[Claim]) -> tuple[float, float]:
    """Shares of the motions that the gate allowed, and that it allowed in vain."""
    of = max(sum(run.motions for run in runs), 1)
    return sum(run.allowed for run in runs) / of, sum(run.deceived for run in runs) / of
