"""What hindsight and injected faults show on logs of real robots: findings that are trusted."""

import numpy as np
import pytest

from slamreplay.bench import inject, moments, real_rows
from slamreplay.bundle.scans import scan_set
from slamreplay.consistency.evidence.sensed import sensed_references
from slamreplay.geometry import se2, se3
from slamreplay.geometry.times import NS_PER_S, ns
from slamreplay.hindsight.pipeline import hindsight
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest


def poses_of(table):
    """Times (N,) and planar poses (N, 3) of a table's rows, each stamp once."""
    table = table.sorted_by_time()
    t_ns, first = np.unique(table.t_ns, return_index=True)
    yaw = se3.yaw_from_quaternion(table["orientation_xyzw"])
    return t_ns, np.column_stack([table["position_xyz"][:, :2], yaw])[first]


def error_after_alignment(track, t_ns, poses):
    """Distances (M,) after the best rigid transform (Umeyama in the plane, no scale)."""
    inside = (track.t_ns >= t_ns[0]) & (track.t_ns <= t_ns[-1]) & track.has_pose
    a, b = se2.interpolate(t_ns, poses, track.t_ns[inside])[:, :2], track.xyyaw[inside, :2]
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    S = a.T @ b
    turn = np.arctan2(S[0, 1] - S[1, 0], S[0, 0] + S[1, 1])
    return np.hypot(*(se2.transform_points(np.array([0.0, 0.0, turn]), a) - b).T)


def heading_lag_s(track, t_ns, poses):
    """By how much stamps (M,) of poses must grow for the headings to turn when the track does.

    Difference of the headings regressed on the turn rate, beside a constant and a drift.
    """
    inside = (track.t_ns >= t_ns[0]) & (track.t_ns <= t_ns[-1]) & track.has_pose
    at_s = (track.t_ns[inside] - t_ns[0]) / NS_PER_S
    ours = np.unwrap(track.xyyaw[inside, 2])
    theirs = np.unwrap(se2.interpolate(t_ns, poses, track.t_ns[inside])[:, 2])
    rows = np.column_stack([np.gradient(ours, at_s), np.ones(len(at_s)), at_s])
    return -np.linalg.lstsq(rows, ours - theirs, rcond=None)[0][0]


def test_hindsight_agrees_with_the_reflectors(real_logs, tmp_path):
    folder = real_logs / "inesctec_jarvis"
    options = IngestOptions(map=folder / "maps/i-108_10mm.yaml")
    bundle = ingest([folder / "jarvis_circular_path_fast.bag"], tmp_path / "b", options)
    found = hindsight(bundle.view())
    t_ns, poses = poses_of(bundle.table("references"))

    assert found.coverage > 0.99
    error = error_after_alignment(found.track, t_ns, poses)
    assert np.median(error) < 0.03
    assert np.percentile(error, 95) < 0.05
    # The two do not share a clock; turns alone tell by how much, no place or transform enters.
    lag_s = heading_lag_s(found.track, t_ns, poses)
    assert 0.1 < lag_s < 0.16
    error = error_after_alignment(found.track, t_ns + ns(lag_s), poses)
    assert np.median(error) < 0.012
    assert np.percentile(error, 95) < 0.03


def test_hindsight_agrees_with_tags_on_the_ceiling(real_logs, tmp_path):
    bundle = ingest([real_logs / "olin_neato/ac109_1_demo.bag"], tmp_path / "b")
    found = hindsight(bundle.view())
    poses = bundle.table("poses")
    t_ns, tags = poses_of(poses.take(poses["topic"] == "/map_pose"))

    assert np.median(error_after_alignment(found.track, t_ns, tags)) < 0.12
    seen = bundle.view().table("references")
    apart = {
        kind: next(f for f in sensed_references(bundle, h, ["fiducial"]) if f.id == "SR-REF-002")
        for kind, h in (("used", found), ("out", hindsight(bundle.view(["fiducial"]))))
    }
    assert found.joined["fiducial"] > 50
    assert apart["out"].value < 0.05  # the camera is not on tf: its place was found as well
    assert apart["used"].value <= apart["out"].value + 0.002
    assert apart["used"].high < apart["out"].high
    assert set(seen["child_frame_id"][seen["kind"] == "fiducial"]) == {
        f"tag_{i}" for i in (0, 1, 3, 4, 6, 7)
    }


@pytest.fixture(scope="module")
def aisle(real_logs, tmp_path_factory):
    """A real log before anything happened in it, with a localizer that is right."""
    folder = real_logs / "zaki_kidnap/dec13"
    options = IngestOptions(map=folder / "map/before_kidnap.yaml", end_s=60.0)
    target = tmp_path_factory.mktemp("aisle") / "b"
    return real_rows.recorded(ingest([folder / "target_before.bag"], target, options).view())


def test_kidnap_in_a_real_log_is_found(aisle):
    start = int(aisle.track_ns[0]) + ns(25.0)
    injection = inject.kidnap(aisle.view, start, start + ns(13.0))
    scans = scan_set(injection.view)
    index = np.searchsorted(aisle.track_ns, injection.recorded_ns(scans.t_ns))
    true = aisle.xyyaw[np.minimum(index, len(aisle.track_ns) - 1)]

    found = hindsight(injection.view)
    apart = np.hypot(*(found.track.xyyaw - true)[:, :2].T)
    lost = moments.true_lost(injection.view, scans.t_ns, true)

    assert np.nanpercentile(apart, 95) < 0.1
    assert lost[scans.t_ns > start + NS_PER_S].mean() > 0.95
    row = real_rows.row("kidnap", injection, aisle)
    assert row.lost.f1 > 0.95


def test_belief_put_aside_in_a_real_log_is_found(aisle):
    start = int(aisle.track_ns[0]) + ns(20.0)
    injection = inject.wrong_start(aisle.view, start, (1.0, 0.6, 0.4))

    assert real_rows.row("wrong start", injection, aisle).lost.f1 > 0.95
