"""Jumps of a belief are found by themselves, and what made them is named."""

from dataclasses import replace

import numpy as np
import pytest

from slamreplay.bundle.belief import belief_times, recorded_belief
from slamreplay.bundle.manifest import Role
from slamreplay.bundle.run import Innovations
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.belief.jumps.check import check
from slamreplay.consistency.belief.jumps.found import jumps_of
from slamreplay.consistency.belief.jumps.log_events import with_subjects
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence.source import Reference
from slamreplay.estimators.recorded import recorded_ledger
from slamreplay.geometry import se2
from slamreplay.geometry.times import ns
from slamreplay.testing import edits, synthetic_bundle
from slamreplay.testing.synthetic import true_path
from slamreplay.testing.synthetic_rows import START_NS, pose_columns, table_of

JUMPING = synthetic_bundle(
    seconds=8.0, with_initial_pose=False, belief_offset_xyyaw=(0.8, 0.0, 0.1), offset_from_s=4.0
)
AT_S = 4.0


def asked(bundle=JUMPING, *, references=()):
    view = bundle.view()
    return CheckContext(recorded_belief(view, belief_times(view)), references, view)


def replayed(*innovations, jump=(0.0, 0.9, 0.0), subject="pose_graph", smoothed=False):
    """A run whose path steps at 4 s, or whose path was smoothed since."""
    view = JUMPING.view()
    t_ns = JUMPING.table("scans").t_ns
    path = true_path((t_ns - START_NS) / 1e9)
    if not smoothed:
        path[t_ns >= START_NS + ns(AT_S)] += jump
    track = PoseTrack("map", "base_link", t_ns, path, np.tile(np.eye(3), (len(t_ns), 1, 1)))
    return CheckContext(track, (), view, subject, innovations)


def closures(*moved, at_s=AT_S - 0.02, **fields):
    n = len(moved)
    defaults = {
        "about": np.array([f"node {k} -> node {k + 17}" for k in range(n)]),
        "score": np.full(n, 0.61),
        "moved": np.array(moved, dtype=float),
    }
    t_ns = np.full(n, START_NS + ns(at_s))
    residual = np.tile([3.0, 0.0, 4.0], (n, 1))
    S = np.tile(np.eye(3), (n, 1, 1))
    return Innovations(
        fields.pop("source", "loop closure"), t_ns, residual, S,
        fields.pop("accepted", np.ones(n, bool)),
        **{**defaults, **fields},
    )  # fmt: skip


def test_a_jump_of_the_recorded_path_is_found_and_its_size_told():
    (jump,) = [j for j in jumps_of(asked()) if j.step.is_grave]

    assert jump.step.t_ns == START_NS + ns(AT_S)
    assert jump.step.metres == pytest.approx(0.8, abs=0.1)
    assert jump.cause == "an update of its own: nothing else in the log is near it"
    (finding,) = check(asked())
    assert (finding.id, finding.severity) == ("SR-LOC-005", "warning")
    assert "at 4.0 s by 0.8" in finding.message


def test_a_path_that_only_drives_has_none_and_without_odometry_nobody_knows():
    assert jumps_of(asked(synthetic_bundle(seconds=6.0))) == ()
    assert jumps_of(asked(edits.without(JUMPING, "odometry"))) == ()
    assert jumps_of(replace(asked(), belief=None)) == ()


def with_rows(bundle, table, role=""):
    manifest = bundle.manifest
    if role:
        topic = str(table["topic"][0])
        told = Role(role=role, topic=topic, type="t", messages=1, reason="the only one")
        manifest = manifest.model_copy(update={"roles": [*manifest.roles, told]})
    tables = {name: bundle.table(name) for name in TABLES} | {table.schema.name: table}
    return type(bundle)(manifest, tables, bundle.grids())


def closure_at(t_s):
    nowhere = np.full((1, 3), np.nan)
    return table_of("closures", "/info", np.array([t_s]), frame_id="map", kind="loop_closure",
                    from_id="803", to_id="17", number=0, from_xyz=nowhere, to_xyz=nowhere,
                    score=0.61)  # fmt: skip


def given_at(t_s):
    return table_of("initial_poses", "/initialpose", np.array([t_s]), frame_id="map",
                    covariance=np.full((1, 36), 0.1), **pose_columns(np.zeros((1, 3))))  # fmt: skip


def relocalized_at(t_s):
    return table_of("recoveries", "/r", np.array([t_s]), name="reinitialize_global_localization",
                    status="running", goal="", source="service")  # fmt: skip


def seen_at(*t_s):
    n = len(t_s)
    return table_of("references", "/tags", np.array(t_s), kind="fiducial", frame_id="base_link",
                    child_frame_id="tag_7", covariance=np.full((n, 36), np.nan),
                    **pose_columns(np.zeros((n, 3))))  # fmt: skip


@pytest.mark.parametrize(
    ("table", "role", "told"),
    [
        (closure_at(3.7), "", "loop closure node 803 -> node 17, score 0.61 0.3 s before"),
        (closure_at(6.0), "", "loop closure node 803 -> node 17, score 0.61 2.0 s later"),
        (
            relocalized_at(3.0),
            "",
            "relocalization was asked for (reinitialize_global_localization)",
        ),
        (seen_at(1.0, 1.1), "", "an update of its own"),
        (seen_at(3.9, 4.1), "", "an update of its own"),  # it is no news so soon after the start
        (given_at(3.9), "initial_pose", "a pose was given to it (/initialpose) 0.1 s before"),
        (given_at(1.0), "initial_pose", "an update of its own"),
    ],
)
def test_what_the_log_holds_near_a_recorded_jump_is_named(table, role, told):
    (jump,) = [j for j in jumps_of(asked(with_rows(JUMPING, table, role))) if j.step.is_grave]

    assert told in jump.cause


def test_the_recorded_ledger_says_what_the_log_holds_at_the_word_it_moved_most():
    view = with_rows(JUMPING, closure_at(3.7)).view()
    told = with_subjects(recorded_ledger(view), view)

    (row,) = np.flatnonzero(told.about != "")
    assert told.t_ns[row] == START_NS + ns(AT_S)
    assert told.about[row] == "loop closure node 803 -> node 17, score 0.61 0.3 s before"
    assert (
        with_subjects(recorded_ledger(JUMPING.view()), JUMPING.view()).about.tolist() == [""] * 16
    )


def test_a_tag_seen_after_a_while_is_news():
    late = synthetic_bundle(
        seconds=9.0, with_initial_pose=False, belief_offset_xyyaw=(0.8, 0, 0), offset_from_s=8.0
    )
    (jump,) = [j for j in jumps_of(asked(with_rows(late, seen_at(7.9)))) if j.step.is_grave]

    assert jump.cause == "fiducial tag_7 was seen first after 8 s 0.1 s before"


def test_a_jump_to_a_pose_that_was_given_accuses_nobody():
    (finding,) = check(asked(with_rows(JUMPING, given_at(3.9), "initial_pose")))

    assert finding.severity == "info"


def test_a_jump_that_leads_home_accuses_nobody_and_one_that_leads_astray_does():
    t_ns = JUMPING.table("scans").t_ns
    home = true_path((t_ns - START_NS) / 1e9)
    off = se2.compose(home, np.array([0.8, 0.0, 0.1]))
    told = []
    for where in (home, off):
        track = PoseTrack.without_covariance("map", "base_link", t_ns, where)
        (finding,) = check(asked(references=(Reference("simulation", "/truth", track),)))
        told.append((finding.severity, "m off to 0.8" in finding.message))

    assert told == [("warning", True), ("info", False)]


def test_particles_tell_whether_another_cluster_took_over():
    after = recorded_belief(JUMPING.view(), np.array([START_NS + ns(AT_S + 0.1)])).xyyaw[0]
    before = se2.compose(after, np.array([-3.0, 0.0, 0.0]))
    for place, told in ((after, "25 % of its particles stood there"), (before, "none of its")):
        cloud = np.array([before, before, before, place]).ravel()
        table = table_of("particles", "/cloud", np.array([3.5]), frame_id="map", xyyaw=[cloud],
                         weights=[np.empty(0)])  # fmt: skip
        bundle = with_rows(JUMPING, table, "particles")
        (jump,) = [j for j in jumps_of(asked(bundle)) if j.step.is_grave]
        assert told in jump.cause


def test_a_long_silence_before_a_jump_is_told():
    silent = {}
    for name in ("poses", "transforms"):
        table = JUMPING.table(name)
        keep = (table.t_ns < START_NS + ns(0.9)) | (table.t_ns > START_NS + ns(4.4))
        spoken = (
            table["child_frame"] == "odom" if name == "transforms" else np.ones(len(table), bool)
        )
        silent[name] = table.take(keep | ~spoken)
    (jump,) = [j for j in jumps_of(asked(edits.rebuilt(JUMPING, silent))) if j.step.is_grave]

    assert jump.cause == "its first word for 4.0 s"


def test_a_replayed_jump_is_traced_to_the_row_that_made_it():
    seen = closures([0.1, 0.0, 0.0], [0.0, 0.8, 0.1])
    small = closures([0.02, 0.0, 0.0], about=np.array(["tag 3"]))
    later = closures([5.0, 0.0, 0.0], at_s=6.0, accepted=np.zeros(1, bool))

    (jump,) = jumps_of(replayed(small, seen, later))

    assert jump.step.row == (1, 1)
    assert jump.cause == (
        "loop closure node 1 -> node 18, score 0.61, NIS 25, moved it by 0.80 m, 6 deg"
    )
    (finding,) = check(replayed(seen))
    assert finding.severity == "warning"


def test_a_row_that_did_not_move_it_by_half_is_no_cause():
    (jump,) = jumps_of(replayed(closures([0.1, 0.1, 0.0])))

    assert jump.cause == "nothing in its ledger explains it"


def test_a_row_that_does_not_tell_how_far_it_moved_is_named_as_such():
    (jump,) = jumps_of(replayed(closures([np.nan] * 3)))

    assert jump.cause.endswith("(how far it moved the belief was not told)")


def test_a_smoothed_path_still_tells_what_moved_the_belief_then():
    (jump,) = jumps_of(replayed(closures([0.0, 0.9, 0.0]), smoothed=True))

    assert jump.step.metres == pytest.approx(0.9)
    assert jump.error_before_m is None
    assert jump.cause.startswith("loop closure node 0 -> node 17")


def test_motion_that_a_ledger_holds_is_no_jump():
    driven = closures([0.0, 0.9, 0.0], source="odometry")

    assert jumps_of(replayed(driven, smoothed=True)) == ()
    (jump,) = jumps_of(replayed(driven, closures([0.0, 0.5, 0.0])))
    assert jump.cause.startswith("loop closure")


def test_empty_tables_and_paths_make_no_traceback():
    empty = replace(replayed(), belief=replayed().belief.take(np.zeros(80, dtype=bool)))

    assert jumps_of(empty) == ()
    assert Table.empty(TABLES["closures"]).t_ns.size == 0
