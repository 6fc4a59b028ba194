"""Runs and bundles as TUM files: one per trial, or one per trajectory that was recorded.

There is no standard for a covariance behind the eight numbers. `Exported.openvins` is what
OpenVINS's ov_eval records and computes NEES from (Recorder.h): twelve more, upper triangles of the
rotation block and the position block. What position and heading have in common has no place there.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.run import Run, Trial
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tum import openvins_lines, tum_lines
from slamreplay.bundle.view import Bundle
from slamreplay.errors import UsageError
from slamreplay.export.formats import NotAsRecorded
from slamreplay.export.request import Request
from slamreplay.geometry import se2, se3
from slamreplay.geometry.covariance import planar_from_ros
from slamreplay.geometry.times import NO_STAMP, Times
from slamreplay.perturb import PERTURBATIONS

#: Letters of a name that a file may have; most file systems hold 255 bytes with everything added.
_MOST_LETTERS = 180


@dataclass(frozen=True, eq=False)
class Exported:
    """A trajectory on its way to a file.

    Attributes:
        stamps_ns: (N,) header stamps.
        t_ns: (N,) the same moments on the bundle's clock.
        xyyaw: (N, 3) poses, NaN where there is none.
        cov: (N, 3, 3) of x y yaw, NaN where there is none.
    """

    stamps_ns: Times
    t_ns: Times
    xyyaw: se2.Array
    cov: se2.Array

    @property
    def has_covariance(self) -> bool:
        """Whether any row has one."""
        return bool(np.isfinite(self.cov).all(axis=(1, 2)).any())

    def lines(self, holds: Callable[[Times], np.ndarray]) -> str:
        """TUM, of the rows whose time is to be written."""
        keep = holds(self.t_ns)
        return tum_lines(self.stamps_ns[keep], self.xyyaw[keep])

    def openvins(self, holds: Callable[[Times], np.ndarray]) -> str:
        """The same rows with OpenVINS's covariances."""
        keep = holds(self.t_ns)
        return openvins_lines(self.stamps_ns[keep], self.xyyaw[keep], self.cov[keep])


def write_tum(request: Request, folder: Path) -> list[NotAsRecorded]:
    """NAME.tum of every trajectory; NAME.openvins.txt of those with covariances, where asked.

    Returns:
        Trajectories of which covariances were asked for and there are none.

    Raises:
        UsageError: there is no trajectory.
    """
    found = (
        runs_as_tum(request.bundle, request.runs) if request.runs else bundle_as_tum(request.bundle)
    )
    missed = []
    for stem, one in found.items():
        (folder / f"{stem}.tum").write_text(one.lines(request.holds), encoding="utf-8")
        if request.covariance and one.has_covariance:
            text = one.openvins(request.holds)
            (folder / f"{stem}.openvins.txt").write_text(text, encoding="utf-8")
        elif request.covariance:
            poses = int(np.isfinite(one.xyyaw).all(axis=1).sum())
            missed.append(NotAsRecorded(f"covariances of {stem}", poses, "none are known"))
    return missed


def runs_as_tum(bundle: Bundle, runs: Sequence[Run]) -> dict[str, Exported]:
    """Name to trajectory: one per run that has an estimate.

    One line per row of the estimate (one per scan) in processing order, the robot's base, stamped
    as the scans were; nothing is dropped or sorted, a row without a pose is nan.

    Raises:
        UsageError: no run has an estimate.
    """
    seeds = {run.trial.seed for run in runs}
    found: dict[str, Exported] = {}
    for run in runs:
        if run.estimate is None:
            continue
        track = run.estimate.track
        stem = _file_stem(trial_name(run.trial, with_seed=len(seeds) > 1))
        name = _distinct(stem, run.trial.id, found)
        found[name] = Exported(stamps(bundle, track.t_ns), track.t_ns, track.xyyaw, track.cov)
    if not found:
        raise UsageError("no run has an estimate", hint="'report' says why of each")
    return found


def bundle_as_tum(bundle: Bundle) -> dict[str, Exported]:
    """Name to trajectory: belief and odometry at each scan, and every trajectory of reference.

    Raises:
        UsageError: the bundle holds no trajectory.
    """
    view = bundle.view()
    odometry = odometry_track(view)
    table = view.role("scan")
    t_ns = table.sorted_by_time().t_ns if table is not None and len(table) else None
    if t_ns is None and odometry is not None:
        t_ns = odometry.t_ns
    found: dict[str, Exported] = {}
    if t_ns is not None:
        belief = recorded_belief(view, t_ns)
        tracks = {"belief": belief, "odometry": None if odometry is None else odometry.at(t_ns)}
        for name, track in tracks.items():
            if track is not None and track.has_pose.any():
                found[name] = Exported(stamps(bundle, t_ns), t_ns, track.xyyaw, track.cov)
    references = bundle.table("references")
    for topic in sorted(set(references["topic"])):
        rows = references.take(references["topic"] == topic)
        if len(set(rows["child_frame_id"])) > 1:
            continue  # sightings of many things are no trajectory
        yaw = se3.yaw_from_quaternion(rows["orientation_xyzw"])
        poses = np.column_stack([rows["position_xyz"][:, :2], yaw])
        stem = f"reference-{_file_stem(topic)}"
        at_ns = _or_clock(rows["t_sensor_ns"], rows.t_ns)
        cov = planar_from_ros(rows["covariance"])
        found[_distinct(stem, str(len(found)), found)] = Exported(at_ns, rows.t_ns, poses, cov)
    if not found:
        raise UsageError("the bundle holds no trajectory", hint="a LOG may need --topics or --map")
    return found


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


def _file_stem(name: str) -> str:
    """A name that somebody else may have chosen as part of a file name: it leads nowhere else."""
    return re.sub(r"[^A-Za-z0-9_.+-]+", "_", name).strip("_.")[:_MOST_LETTERS]


def _distinct(stem: str, otherwise: str, taken: dict[str, Exported]) -> str:
    return f"{stem}-{otherwise}" if stem in taken else stem
