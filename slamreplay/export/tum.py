"""Runs and bundles as TUM files: one per trial, or one per trajectory that was recorded."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

import numpy as np

from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.run import Run, Trial
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tum import tum_lines
from slamreplay.bundle.view import Bundle
from slamreplay.errors import UsageError
from slamreplay.geometry import se3
from slamreplay.geometry.times import NO_STAMP, Times
from slamreplay.perturb import PERTURBATIONS


def runs_as_tum(bundle: Bundle, runs: Sequence[Run]) -> dict[str, str]:
    """File name to content: one file per run that has an estimate.

    One line per row of the estimate (one per scan) in processing order, the robot's base, stamped
    as the scans were; nothing is dropped or sorted, a row without a pose is nan.

    Raises:
        UsageError: no run has an estimate.
    """
    seeds = {run.trial.seed for run in runs}
    content: dict[str, str] = {}
    for run in runs:
        if run.estimate is None:
            continue
        track = run.estimate.track
        name = _distinct(trial_name(run.trial, with_seed=len(seeds) > 1), run.trial.id, content)
        content[name] = tum_lines(stamps(bundle, track.t_ns), track.xyyaw)
    if not content:
        raise UsageError("no run has an estimate", hint="'report' says why of each")
    return content


def bundle_as_tum(bundle: Bundle) -> dict[str, str]:
    """File name to content: belief and odometry at each scan, and every trajectory of reference.

    Raises:
        UsageError: the bundle holds no trajectory.
    """
    view = bundle.view()
    odometry = odometry_track(view)
    table = view.role("scan")
    t_ns = table.sorted_by_time().t_ns if table is not None and len(table) else None
    if t_ns is None and odometry is not None:
        t_ns = odometry.t_ns
    content: dict[str, str] = {}
    if t_ns is not None:
        belief = recorded_belief(view, t_ns)
        tracks = {"belief": belief, "odometry": None if odometry is None else odometry.at(t_ns)}
        for name, track in tracks.items():
            if track is not None and track.has_pose.any():
                content[f"{name}.tum"] = tum_lines(stamps(bundle, t_ns), track.xyyaw)
    references = bundle.table("references")
    for topic in sorted(set(references["topic"])):
        rows = references.take(references["topic"] == topic)
        if len(set(rows["child_frame_id"])) > 1:
            continue  # sightings of many things are no trajectory
        yaw = se3.yaw_from_quaternion(rows["orientation_xyzw"])
        poses = np.column_stack([rows["position_xyz"][:, :2], yaw])
        stem = "reference-" + re.sub(r"[^A-Za-z0-9_.]+", "_", topic).strip("_.")
        content[_distinct(stem, str(len(content)), content)] = tum_lines(
            _or_clock(rows["t_sensor_ns"], rows.t_ns), poses
        )
    if not content:
        raise UsageError("the bundle holds no trajectory", hint="a LOG may need --topics or --map")
    return content


def trial_name(trial: Trial, *, with_seed: bool) -> str:
    """ESTIMATOR[-NAME-LEVEL][-sSEED]; a perturbation's first variant goes by its bare name."""
    parts = [trial.estimator]
    if trial.perturbation is not None and trial.level is not None:
        name, _, variant = trial.perturbation.partition(".")
        first = next(iter(PERTURBATIONS.load(name).variants))
        parts += [name if variant == first else trial.perturbation, f"{trial.level:g}"]
    if with_seed:
        parts.append(f"s{trial.seed}")
    return "-".join(parts)


def stamps(bundle: Bundle, t_ns: Times) -> Times:
    """(N,) header stamps of the rows at times (N,) on the bundle's clock, which they may not be."""
    for role, name in (("scan", "scans"), ("odometry", "odometry")):
        topic = bundle.manifest.topic_of(role)
        if topic is None or name not in TABLES:
            continue
        table = bundle.table(name)
        table = table.take(table["topic"] == topic).sorted_by_time()
        if np.array_equal(table.t_ns, t_ns):
            return _or_clock(table["t_sensor_ns"], t_ns)
    return t_ns


def _or_clock(stamp_ns: Times, t_ns: Times) -> Times:
    return np.where(stamp_ns == NO_STAMP, t_ns, stamp_ns)


def _distinct(stem: str, otherwise: str, taken: dict[str, str]) -> str:
    counts = Counter(taken)
    return f"{stem}.tum" if not counts[f"{stem}.tum"] else f"{stem}-{otherwise}.tum"
