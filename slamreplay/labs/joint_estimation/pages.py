"""The answer as tables, sentences and a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.special import stdtrit

from slamreplay.consistency.statistics.intervals import mean_interval
from slamreplay.geometry.se2 import Array
from slamreplay.labs.intervals import median_interval
from slamreplay.labs.joint_estimation.drive import Drive
from slamreplay.labs.joint_estimation.trials import DOF, JOINT, WAYS, Trial, odometry_error_m
from slamreplay.labs.lab import LabResults, ResultTable
from slamreplay.report.figures.joint_estimation import Curve, Plan, joint_figure

_HEAD = (
    "way",
    "position error [m]",
    "sigma claimed [m]",
    "largest error [m]",
    "map error [m]",
    "mean NEES",
    "95 % interval",
    "of the median log",
    "sigma too small by",
)
_MISS = 0.05


def results(
    drives: Sequence[Drive], trials: Sequence[Mapping[str, Trial]], step_m: float
) -> LabResults:
    """What all logs say together."""
    found = {way: _summary([t[way] for t in trials]) for way in WAYS}
    odometry = np.array([odometry_error_m(d) for d in drives])
    numbers: dict[str, Any] = {
        "logs": len(trials),
        "poses": len(drives[0].xyyaw),
        "sightings": [len(d.evidence.reach) for d in drives],
        "odometry_rms_error_m": _six(_rms(odometry)),
        "odometry_end_error_m": _six(_rms(odometry[:, -1])),
        "ways": found,
    }
    rows = [("odometry alone", f"{_rms(odometry):.3f}", "", f"{odometry.max():.2f}", *[""] * 5)]
    rows += [_row(way, found[way]) for way in WAYS]
    return LabResults(
        numbers=numbers,
        tables=[ResultTable(f"Over {len(trials)} logs", _HEAD, rows)],
        notes=[
            "position error, sigma and map error: root mean square over all poses of all logs.",
            (
                f"mean NEES: over all poses of all logs, {DOF} where the claim is honest; its "
                "interval from the means of the logs, which are independent (Student's t)."
            ),
            "sigma too small by: the root of mean NEES over its degrees of freedom.",
        ],
        figures={"joint_estimation": lambda: _figure(drives, trials, step_m)},
    )


def _summary(trials: Sequence[Trial]) -> dict[str, Any]:
    """One way over all logs, to six digits."""
    errors = np.array([t.error_m for t in trials])
    means = np.array([t.nees.mean() for t in trials])
    half = float(stdtrit(len(means) - 1, 1.0 - _MISS / 2.0)) * means.std(ddof=1)
    half /= np.sqrt(len(means))
    return {
        "rms_error_m": _six(_rms(errors)),
        "largest_error_m": _six(errors.max()),
        "end_rms_error_m": _six(_rms(errors[:, -1])),
        "sigma_m": _six(_rms(np.array([t.sigma_m for t in trials]))),
        "map_rms_error_m": _six(_rms(np.array([t.map_error_m for t in trials]))),
        "anees": _six(means.mean()),
        "anees_low": _six(means.mean() - half),
        "anees_high": _six(means.mean() + half),
        "median_nees": [
            _six(v) if np.isfinite(v) else None for v in median_interval(means.tolist())
        ],
        "sigma_too_small_by": _six(np.sqrt(means.mean() / DOF)),
    }


def _row(way: str, found: Mapping[str, Any]) -> tuple[str, ...]:
    digits = 2 if found["anees"] < 10.0 else 0
    return (
        way,
        f"{found['rms_error_m']:.3f}",
        f"{found['sigma_m']:.3f}",
        f"{found['largest_error_m']:.2f}",
        f"{found['map_rms_error_m']:.3f}",
        f"{found['anees']:.{digits}f}",
        f"{found['anees_low']:.{digits}f} to {found['anees_high']:.{digits}f}",
        f"{found['median_nees'][0]:.{digits}f}",
        f"{found['sigma_too_small_by']:.2g}",
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _six(value: float) -> float:
    return float(f"{value:.6g}")


def _figure(
    drives: Sequence[Drive], trials: Sequence[Mapping[str, Trial]], step_m: float
) -> Figure:
    # The log to show is neither the worst nor the best of the first way.
    order = np.argsort([_rms(t[WAYS[0]].error_m) for t in trials], kind="stable")
    shown = int(order[len(order) // 2])
    plans = [
        Plan(
            way,
            drives[shown].xyyaw,
            drives[shown].landmarks,
            trials[shown][way].estimate.xyyaw,
            trials[shown][way].estimate.cov,
            trials[shown][way].estimate.landmarks,
        )
        for way in WAYS
    ]
    curves = {}
    for way in WAYS:
        every = [t[way] for t in trials]
        curves[way] = Curve(
            np.sqrt(np.mean([t.error_m**2 for t in every], axis=0)),
            np.sqrt(np.mean([t.sigma_m**2 for t in every], axis=0)),
            np.mean([t.nees for t in every], axis=0),
        )
    way_m = np.asarray(step_m * np.arange(1.0, len(curves[JOINT].nees) + 1.0), dtype=np.float64)
    return joint_figure(plans, curves, way_m, mean_interval(DOF, len(trials), _MISS))
