"""Incidents are the same for the same seed, and their labels are what the definitions say."""

from functools import cache

import numpy as np
import pytest

from slamreplay.bench.incidents import KINDS, incident
from slamreplay.bench.logs import bundle_of
from slamreplay.bundle.scans import scan_set
from slamreplay.errors import UsageError
from slamreplay.geometry.times import NS_PER_S
from slamreplay.ingest.pipeline import ingest
from slamreplay.simulate.topics import START_NS, records
from slamreplay.simulate.truth import in_stretches, stretches
from slamreplay.simulate.writer import write_log


@cache
def made(kind, seed, conditions=()):
    return incident(kind, seed, conditions)


@cache
def logged(kind, seed, conditions=()):
    return bundle_of(made(kind, seed, conditions))


def test_bundle_in_memory_is_what_ingest_makes_of_the_written_file(tmp_path):
    log = tmp_path / "wrong_start.mcap"
    write_log(log, lambda messages: records(made("wrong_start", 2).recording, messages))
    on_disk = ingest([log], tmp_path / "bundle")
    bundle, _ = logged("wrong_start", 2)

    assert bundle.path is None
    assert bundle.manifest == on_disk.manifest
    assert bundle.grid().version == on_disk.grid().version
    for name in ("scans", "odometry", "transforms", "poses", "references"):
        assert bundle.table(name).t_ns.tolist() == on_disk.table(name).t_ns.tolist()
    np.testing.assert_array_equal(
        scan_set(bundle.view()).ranges_m, scan_set(on_disk.view()).ranges_m
    )


def test_wrong_start_is_lost_by_truth_and_nothing_has_changed():
    _, truth = logged("wrong_start", 2)

    assert truth.state == "lost"
    assert set(truth.states) <= {"lost", "healthy"}
    assert not truth.regions


def test_boxes_are_regions_with_their_place_and_time():
    found, truth = logged("boxes_added", 0)[1], None
    truth = found

    assert truth.state == "map_changed"
    assert {r.kind for r in truth.regions} == {"appeared"}
    assert any(r.seen_s > 4.0 for r in truth.regions)
    assert 0.0 < truth.changed.mean() <= 1.0
    assert not truth.lost.any()


def test_map_in_another_frame_moves_the_truth_and_not_the_label():
    made_of, (_, truth) = made("map_frame", 0), logged("map_frame", 0)
    own = made_of.recording.motion.poses_at((truth.t_ns - START_NS) / 1e9)

    assert truth.state == "healthy"
    assert np.hypot(*truth.frame_offset[:2]) > 0.5
    assert np.hypot(*(truth.xyyaw - own)[:, :2].T).max() > 0.3


def test_late_stamps_part_stamp_and_sweep():
    for seed in range(8):
        story = made("late_stamps", seed).recording.scenario
        if story.scan_late_s:
            break
    _, truth = logged("late_stamps", seed)

    assert 0.05 <= story.scan_late_s <= 0.4
    assert np.hypot(*(truth.xyyaw - truth.xyyaw_taken)[:, :2].T).max() > 0.02


def test_dropped_scans_leave_holes():
    bundle, truth = logged("dropped_scans", 0)

    assert np.diff(truth.t_ns).max() > 0.7e9
    assert len(bundle.table("scans")) == len(truth.t_ns)


@pytest.mark.parametrize("condition", ["no_odometry", "no_tf", "two_lasers"])
def test_condition_leaves_out_or_adds_topics(condition):
    bundle, _ = logged("healthy", 1, (condition,))
    scans = set(bundle.table("scans")["topic"])
    moving = bundle.table("transforms")
    moving = moving.take(~moving["is_static"])

    assert scans == ({"/scan_front", "/scan_rear"} if condition == "two_lasers" else {"/scan"})
    assert (len(bundle.table("odometry")) == 0) == (condition == "no_odometry")
    assert (len(moving) == 0) == (condition in ("no_odometry", "no_tf"))
    assert len(bundle.table("poses")) > 10


def test_same_seed_is_the_same_incident_and_another_is_not():
    one, same, other = incident("push", 5), made("push", 5), made("push", 6)

    np.testing.assert_array_equal(one.recording.motion.xyyaw, same.recording.motion.xyyaw)
    np.testing.assert_array_equal(one.recording.scans.ranges, same.recording.scans.ranges)
    assert one.recording.scenario.mapped != other.recording.scenario.mapped


def test_stretches_must_last_and_short_gaps_do_not_end_them():
    t_ns = np.arange(100) * NS_PER_S // 10
    holds = np.zeros(100, bool)
    holds[10:25], holds[30:50], holds[70:80] = True, True, True

    assert stretches(t_ns, holds, 2 * NS_PER_S, NS_PER_S) == [(10, 49)]
    kept = in_stretches(t_ns, holds, 2 * NS_PER_S, NS_PER_S)
    assert np.flatnonzero(kept).tolist() == list(range(10, 50))
    assert stretches(t_ns, holds & False, 2 * NS_PER_S, NS_PER_S) == []


def test_unknown_names_are_refused():
    with pytest.raises(UsageError, match="people"):
        incident("lost", 0)
    with pytest.raises(UsageError, match="no_tf"):
        incident(KINDS[0], 0, ("fog",))
