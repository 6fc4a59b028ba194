"""One log in, one post-mortem out: the stages meet, and the judging reference only judges."""

import json
from dataclasses import replace
from itertools import pairwise

import jsonschema
import numpy as np
import pytest

from slamreplay.bundle.belief import belief_times
from slamreplay.bundle.run import Estimate, Run, Trial
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.postmortem import postmortem
from slamreplay.report.assess import not_assessable
from slamreplay.report.build import build
from slamreplay.report.model import schema_text
from slamreplay.testing.edits import rebuilt
from slamreplay.testing.synthetic import START_NS, room_grid, synthetic_bundle, true_path


@pytest.fixture(scope="module")
def lost():
    bundle = synthetic_bundle(seconds=20.0, belief_offset_xyyaw=(1.5, 0.5, 0.1), offset_from_s=8.0)
    steps: list[float] = []
    return bundle, postmortem(bundle, progress=lambda _what, share: steps.append(share)), steps


def test_lost_log_is_called_lost_and_its_report_is_valid(lost):
    _, post, _ = lost
    content = json.loads(build(post).json_text())

    jsonschema.validate(content, json.loads(schema_text()))
    assert content["verdict"]["state"] == "lost"
    spans = [(i["start_ns"], i["end_ns"]) for i in content["intervals"]]
    assert spans[0][0] == content["bundle"]["start_ns"]
    assert spans[-1][1] == content["bundle"]["end_ns"]
    assert all(a[1] == b[0] for a, b in pairwise(spans))
    assert "SR-LOC-001" in [f["id"] for f in content["findings"]]
    assert content["reference"]["kind"] == "hindsight"


def test_nees_is_measured_against_the_logs_own_reference(lost):
    _, post, _ = lost

    assert post.reference_kind == "simulation"
    assert post.nees.summary().test.mean > 100.0
    said = [f.message for f in post.findings if f.id.startswith("SR-CON-0")]
    assert any("against simulation" in message for message in said)


def test_a_reference_that_was_not_used_does_not_undo_what_another_one_told():
    bundle = synthetic_bundle(seconds=20.0, with_map=False)
    table = bundle.table("references")
    elsewhere = table.replace(
        topic=np.full(len(table), "/mocap", dtype=object),
        frame_id=np.full(len(table), "lab", dtype=object),
    )
    both = rebuilt(bundle, {"references": Table.concat(TABLES["references"], [table, elsewhere])})
    post = postmortem(both)

    assert any("/mocap was not used" in f.message for f in post.findings)
    post = replace(post, findings=tuple(f for f in post.findings if f.id == "SR-CON-003"))
    assert "SR-CON-001" not in not_assessable(post)
    unknown = replace(post, reference_kind="hindsight")
    assert "/mocap" in not_assessable(unknown)["SR-CON-001"]


def test_findings_come_worst_first(lost):
    order = ["error", "warning", "info"]
    ranks = [order.index(f.severity) for f in lost[1].findings]

    assert ranks == sorted(ranks)


def test_progress_ends_at_one_and_never_goes_back(lost):
    steps = lost[2]

    assert steps[-1] == 1.0
    assert steps == sorted(steps)


def test_poisoned_reference_changes_nothing_but_what_is_measured_against_it(lost):
    bundle, post, _ = lost
    table = bundle.table("references")
    far = table.replace(position_xyz=table["position_xyz"] + 100.0)
    tables = {name: bundle.table(name) for name in ("scans", "odometry", "transforms", "poses")}
    poisoned = Bundle(
        bundle.manifest,
        {**tables, "initial_poses": bundle.table("initial_poses"), "references": far},
        {bundle.manifest.maps[0].version: room_grid()},
    )

    other = postmortem(poisoned)

    assert other.judgement == post.judgement
    np.testing.assert_array_equal(other.hindsight.track.xyyaw, post.hindsight.track.xyyaw)
    assert other.nees.summary().test.mean != post.nees.summary().test.mean


def test_trials_are_measured_beside_each_other():
    bundle = synthetic_bundle(seconds=6.0)
    t = belief_times(bundle.view())
    truth = true_path((t - START_NS) / 1e9)
    runs = []
    for k, (perturbation, level) in enumerate([(None, None), ("tf_delay.all", 0.2)]):
        track = PoseTrack.without_covariance(
            "map", "base_link", t, truth + np.array([0.6 * k, 0.0, 0.0])
        )
        unit = "s" if perturbation else ""
        trial = Trial(bundle.manifest.bundle_id, "amcl", 0, perturbation, level, unit)
        runs.append(Run(trial, Estimate(track)))

    content = json.loads(build(postmortem(bundle, runs)).json_text())["trials"]

    assert [t["level"] for t in content] == [None, 0.2]
    assert content[0]["metrics"]["lost_share"] == 0.0
    assert content[1]["metrics"]["lost_share"] > 0.9
    assert content[1]["metrics"]["baseline_max_m"] == pytest.approx(0.6)
    assert content[1]["metrics"]["reference_rmse_m"] == pytest.approx(0.6, abs=0.01)


def test_log_without_map_or_belief_is_not_judged():
    post = postmortem(synthetic_bundle(seconds=3.0, with_map=False, with_belief=False))

    assert post.judgement.state == "insufficient_data"
    assert post.hindsight is None
    assert post.belief is None
    assert post.odometry is not None
    assert build(post).reference.trajectory is None


def test_belief_is_asked_for_at_scans_else_at_odometry():
    bundle = synthetic_bundle(seconds=3.0)
    view = bundle.view()
    without = view.with_table(Table.empty(view.table("scans").schema))

    np.testing.assert_array_equal(belief_times(view), view.table("scans").t_ns)
    np.testing.assert_array_equal(belief_times(without), view.table("odometry").t_ns)
