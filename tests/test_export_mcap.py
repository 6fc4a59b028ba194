"""What was found, as mcap: read back by mcap's own reader and protobuf's own decoder."""

import json
from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest
from exported import LOST_FROM, SILENT, UNKNOWN, N, S, exported
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.SceneEntityDeletion_pb2 import SceneEntityDeletion
from mcap.reader import make_reader
from mcap_doctor import Doctor
from mcap_protobuf.decoder import DecoderFactory
from scipy import stats

from slamreplay.errors import SlamreplayError
from slamreplay.evidence import colours
from slamreplay.evidence.scene import Met
from slamreplay.evidence.scene_of import scene_of
from slamreplay.evidence.scene_scans import scans_in_pieces, scene_scans
from slamreplay.export.foxglove import write_foxglove
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import turned
from slamreplay.geometry.times import NS_PER_S
from slamreplay.ingest.pipeline import ingest
from slamreplay.postmortem import postmortem
from slamreplay.testing.synthetic import START_NS, synthetic_bundle
from slamreplay.verdict.judgement import ConstantOffset

TYPES = {
    PackedElementField.FLOAT32: "<f4",
    PackedElementField.UINT8: "u1",
    PackedElementField.INT8: "i1",
}


class Read:
    """A file's messages by topic, with the times they were recorded at."""

    def __init__(self, path) -> None:
        self.path = path
        self.times: list[int] = []
        self.by_topic = defaultdict(list)
        self.schemas = {}
        with path.open("rb") as stream:
            reader = make_reader(stream, decoder_factories=[DecoderFactory()], validate_crcs=True)
            self.summary = reader.get_summary()
            self.metadata = {m.name: m.metadata for m in reader.iter_metadata()}
            self.attachments = {a.name: a for a in reader.iter_attachments()}
            for schema, channel, message, content in reader.iter_decoded_messages(
                log_time_order=False
            ):
                assert message.publish_time == message.log_time
                self.times.append(message.log_time)
                self.by_topic[channel.topic].append((message.log_time, content))
                self.schemas[channel.topic] = schema.name

    def __getitem__(self, topic):
        return self.by_topic.get(f"/slamreplay/{topic}", [])


@pytest.fixture(scope="module")
def found():
    return exported()


def written(found, folder, **options) -> Read:
    bundle, post, runs = found
    write_foxglove(post, bundle.view(), folder, runs=runs, **options)
    return Read(folder / "slamreplay.mcap")


@pytest.fixture(scope="module")
def read(found, tmp_path_factory) -> Read:
    return written(found, tmp_path_factory.mktemp("mcap"), report_json='{"a": 1}')


def ns_of(stamp) -> int:
    return stamp.seconds * NS_PER_S + stamp.nanos


def xyyaw(pose) -> np.ndarray:
    q = pose.orientation
    assert q.x == q.y == 0.0
    return np.array([pose.position.x, pose.position.y, 2.0 * np.arctan2(q.z, q.w)])


def table(message, count=None) -> np.ndarray:
    """A cloud's or a grid's bytes by the fields it names."""
    stride = getattr(message, "point_stride", 0) or message.cell_stride
    names = [f.name for f in message.fields]
    kind = np.dtype(
        {
            "names": names,
            "formats": [TYPES[f.type] for f in message.fields],
            "offsets": [f.offset for f in message.fields],
            "itemsize": stride,
        }
    )
    return np.frombuffer(message.data, dtype=kind)


def in_map(cloud) -> np.ndarray:
    points = table(cloud)
    ends = np.column_stack([points["x"], points["y"]])
    return se2.transform_points(xyyaw(cloud.pose), ends)


def test_times_are_those_of_the_log_and_never_run_backwards(found, read):
    manifest = found[1].manifest

    assert read.times == sorted(read.times)
    assert manifest.start_ns <= read.times[0]
    assert read.times[-1] <= manifest.end_ns
    for topic, messages in read.by_topic.items():
        for t_ns, message in messages:
            if read.schemas[topic] == "foxglove.FrameTransforms":
                stamps = {ns_of(t.timestamp) for t in message.transforms}
            elif read.schemas[topic] == "foxglove.SceneUpdate":
                # A scene tells older entities again, but none of later.
                newest = [ns_of(e.timestamp) for e in message.entities]
                stamps = {max(newest)} if newest else {t_ns}
            else:
                stamps = {ns_of(message.timestamp)}
            assert stamps == {t_ns}, topic


def test_poses_and_frames_are_belief_and_hindsight(found, read):
    _, post, _ = found
    for name, frame, track in (
        ("belief", "base_believed", post.belief),
        ("hindsight", "base_hindsight", post.hindsight.track),
    ):
        known = track.take(track.has_pose)
        poses = read[f"{name}/pose"]
        steps = [
            (t_ns, step)
            for t_ns, message in read["transforms"]
            for step in message.transforms
            if step.child_frame_id == frame
        ]

        assert [t for t, _ in poses] == [t for t, _ in steps] == known.t_ns.tolist()
        for row, (_, message) in enumerate(poses):
            np.testing.assert_allclose(xyyaw(message.pose), known.xyyaw[row], atol=1e-12)
            step = steps[row][1]
            assert message.frame_id == step.parent_frame_id == "map"
            assert (step.translation.x, step.translation.y) == tuple(known.xyyaw[row, :2])
            turn = message.pose.orientation
            assert (step.rotation.z, step.rotation.w) == (turn.z, turn.w)


def test_ellipses_hold_95_percent(found, read):
    belief = found[1].belief
    drawn = {t: m.entities[0] for t, m in read["belief/ellipse"] if m.entities}
    row = 20
    ring = np.array([[p.x, p.y] for p in drawn[int(belief.t_ns[row])].lines[0].points])
    off = ring - belief.xyyaw[row, :2]
    squared = np.einsum("ni,ij,nj->n", off, np.linalg.inv(belief.cov[row, :2, :2]), off)

    np.testing.assert_allclose(squared, stats.chi2.ppf(0.95, 2))
    without = [t for t, m in read["belief/ellipse"] if not m.entities]
    assert without == [int(belief.t_ns[10])]  # taken away once, and not drawn again until row 12
    assert int(belief.t_ns[11]) not in drawn
    assert int(belief.t_ns[12]) in drawn


def test_scans_lie_where_each_robot_saw_them(found, read):
    _, post, _ = found
    scans = post.scene.scans[0]
    for name, track, lacking in (
        ("belief", post.belief, range(*SILENT.indices(N))),
        ("hindsight", post.hindsight.track, range(*UNKNOWN.indices(N))),
    ):
        clouds = dict(read[f"{name}/scan"])
        for row, t_ns in enumerate(scans.t_ns.tolist()):
            if row in lacking:
                # What was drawn before is taken away, once.
                assert (t_ns in clouds) == (row == lacking[0] > 0)
                assert t_ns not in clouds or not clouds[t_ns].data
                continue
            hit = scans.is_hit[row]
            ends = se2.transform_points(track.xyyaw[row], scans.ends_m[row][hit])
            np.testing.assert_allclose(in_map(clouds[t_ns]), ends, atol=1e-6)
            points = table(clouds[t_ns])
            assert points["met"].tolist() == scans.met[row][hit].tolist()
    assert len(read["belief/scan_2"]) == len(post.scene.scans[1].t_ns) - 3


def test_each_class_of_beams_has_its_own_colour(read):
    points = table(read["belief/scan"][0][1])
    shown = {Met(p["met"]): (p["red"], p["green"], p["blue"]) for p in points if p["alpha"] == 255}

    assert shown == {met: colours.rgb(colours.BEAMS[met]) for met in Met if met != Met.INVALID}
    meaning = [shown[m] for m in (Met.MAPPED, Met.APPEARED, Met.REMOVED, Met.MOVING, Met.OTHER)]
    assert len(set(meaning)) == len(meaning)


def test_the_map_lies_where_the_grid_lies(found, read):
    grid = found[1].grid
    ((t_ns, message),) = read["map"]
    cells = table(message).reshape(-1, message.column_count)

    assert t_ns == found[1].manifest.start_ns
    np.testing.assert_array_equal(cells["occupancy"], grid.cells)
    assert message.row_stride == message.column_count * message.cell_stride
    row, col = 70, 3
    middle = np.array([[(col + 0.5) * message.cell_size.x, (row + 0.5) * message.cell_size.y]])
    at = se2.transform_points(xyyaw(message.pose), middle)[0]
    np.testing.assert_allclose(at, grid.centre_of([row, col]), atol=1e-9)
    assert len({tuple(c) for c in cells[["red", "green", "blue"]].ravel()}) == 2


def cells_of(message, value) -> set[tuple[float, float]]:
    """Centres of the cells of one kind, in the map frame, to a tenth of a millimetre."""
    change = table(message).reshape(-1, message.column_count)["change"]
    centres = (np.argwhere(change == value)[:, ::-1] + 0.5) * message.cell_size.x
    return {tuple(p) for p in np.round(se2.transform_points(xyyaw(message.pose), centres), 4)}


def test_changed_cells_are_told_when_they_were_first_seen(found, read):
    _, post, _ = found
    changes, grid = post.hindsight.changes, post.grid
    (first_ns, first), (last_ns, last) = read["changed/cells"]
    wanted = {
        value: {tuple(p) for p in np.round(grid.centre_of(np.argwhere(mask)), 4)}
        for value, mask in ((1, changes.appeared), (2, changes.removed))
    }

    assert (first_ns, last_ns) == (START_NS + 35 * S // 10, START_NS + 45 * S // 10)
    assert (cells_of(first, 1), cells_of(first, 2)) == (set(), wanted[2])
    assert (cells_of(last, 1), cells_of(last, 2)) == (wanted[1], wanted[2])
    boxes = read["changed/regions"]
    assert [t for t, _ in boxes] == [first_ns, last_ns]
    facts = [{kv.key: kv.value for kv in e.metadata} for e in boxes[1][1].entities]
    assert [f["kind"] for f in facts] == ["removed", "appeared"]


def test_every_scene_is_told_whole(read):
    """A viewer that jumps is given the last message of each topic alone."""
    for topic, schema in read.schemas.items():
        if schema == "foxglove.SceneUpdate":
            for _, message in read.by_topic[topic]:
                assert [d.type for d in message.deletions] == [SceneEntityDeletion.ALL], topic
    assert len(read["stops"][-1][1].entities) == 1
    assert len(read["changed/regions"][-1][1].entities) == 2


def test_paths_have_gaps_where_nobody_knows(read):
    ((_, path),) = read["hindsight/path"]

    assert [len(line.points) for line in path.entities[0].lines] == [30, 26]


def test_the_robots_part_where_the_belief_is_lost(found, read):
    drawn = [t for t, m in read["parting"] if m.entities]

    assert drawn == found[1].belief.t_ns[LOST_FROM:].tolist()


def test_findings_are_lines_of_a_log(found, read):
    lines = [(t, m.level, m.name, m.message) for t, m in read["findings"]]
    lost_ns, start_ns = START_NS + LOST_FROM * S // 10, found[1].manifest.start_ns

    words = "Robot lost (confidence 98 %): The robot was lost for 2 s."
    assert lines[0] == (start_ns, Log.ERROR, "verdict", words)
    assert (start_ns, Log.WARNING, "SR-DAT-002", "of the whole log") in lines
    assert (lost_ns, Log.ERROR, "SR-LOC-001", "off by 1.5 m") in lines
    assert (lost_ns, Log.WARNING, "jump", "jumped by 1.5 m") in lines
    stops = [message for _, _, name, message in lines if name == "stop"]
    assert stops == ["stop 1: nobody knows where", "stop 2: it was \ufffd lost"]


def test_states_begin_and_end(found, read):
    told = [(t, m.state) for t, m in read["state"]]
    manifest, lost_ns = found[1].manifest, START_NS + LOST_FROM * S // 10

    begins = [told[k] for k in range(len(told)) if k == 0 or told[k][1] != told[k - 1][1]]
    assert begins == [(manifest.start_ns, "healthy"), (lost_ns, "lost")]
    assert told[-1] == (manifest.end_ns, "lost")
    assert max(np.diff([t for t, _ in told])) <= NS_PER_S
    ((_, verdict),) = read["verdict"]
    assert (verdict.state, verdict.confidence) == ("lost", 0.98)
    assert verdict.findings[0] == "error SR-LOC-001: off by 1.5 m"


def test_lanes_are_numbers_with_gaps(found, read):
    lane = found[1].scene.lanes[0]
    told = read["error_m"]

    assert [t for t, _ in told] == lane.t_ns.tolist()
    np.testing.assert_array_equal([m.value for _, m in told], lane.values)
    assert {m.unit for _, m in told} == {"m"}
    assert len(read["nees"]) == N // 3


def test_particles_and_plans(found, read):
    clouds, plans = found[1].scene.clouds, found[1].scene.plans
    points = [table(m) for _, m in read["particles"]]

    assert [len(p) for p in points] == [4, 0, 6]
    np.testing.assert_array_equal(points[2]["yaw"], clouds.xyyaw[4:, 2])
    drawn = [[(p.x, p.y) for p in m.entities[0].lines[0].points] for _, m in read["plan"]]
    np.testing.assert_array_equal(np.concatenate(drawn), plans.xy)


def test_runs_lie_beside_it_in_their_own_frames(found, read):
    assert {m.frame_id for _, m in read["runs/amcl/pose"]} == {"map"}
    assert {m.frame_id for _, m in read["runs/dead_reckoning/pose"]} == {"odom"}
    assert not read["runs/ekf/pose"]


def test_the_file_says_what_it_is_of(found, read):
    facts = read.metadata["slamreplay"]

    assert facts["bundle_id"] == found[1].manifest.bundle_id
    assert (facts["state"], facts["confidence"]) == ("lost", "0.9800")
    assert json.loads(read.attachments["report.json"].data) == {"a": 1}


def test_the_doctor_finds_nothing(read):
    Doctor(read.path).examine()
    assert len(set(read.by_topic)) == read.summary.statistics.channel_count


def test_same_findings_same_bytes(found, read, tmp_path):
    again = written(found, tmp_path, report_json='{"a": 1}')

    assert again.path.read_bytes() == read.path.read_bytes()
    layouts = [(r.path.parent / "layout.json").read_bytes() for r in (again, read)]
    assert layouts[0] == layouts[1]


def test_a_window_cuts_what_is_written(found, tmp_path):
    start_ns, end_ns = START_NS + 42 * S // 10, START_NS + 48 * S // 10
    read = written(found, tmp_path, start_ns=start_ns, end_ns=end_ns)

    assert (read.times[0], read.times[-1]) == (start_ns, end_ns)
    assert [t for t, _ in read["belief/pose"]] == [
        t for t in found[1].belief.t_ns.tolist() if start_ns <= t <= end_ns
    ]
    # What held already when it opens is told at its start.
    assert [t for t, _ in read["map"]] == [start_ns]
    assert [t for t, _ in read["changed/cells"]] == [start_ns, START_NS + 45 * S // 10]
    assert [(t, m.state) for t, m in read["state"]] == [(start_ns, "lost"), (end_ns, "lost")]
    assert "stops" not in {topic.rsplit("/")[-1] for topic in read.by_topic}
    names = [m.name for _, m in read["findings"]]
    assert names.count("verdict") == 2  # judged was all of it
    assert "SR-LOC-001" in names
    assert "jump" not in names


def test_no_verdict_is_told_to_be_certain(found, tmp_path):
    bundle, post, runs = found
    sure = replace(post, judgement=replace(post.judgement, confidence=1.0))
    read = written((bundle, sure, runs), tmp_path)

    assert read["findings"][0][1].message.startswith("Robot lost (confidence 99 %)")


def test_a_log_without_much_is_written_too(found, tmp_path):
    bundle, post, _ = found
    bare = replace(post, belief=None, hindsight=None, grid=None, scene=None)
    read = written((bundle, bare, ()), tmp_path)

    told = ("verdict", "findings", "state", "stops")
    assert set(read.by_topic) == {f"/slamreplay/{t}" for t in told}


def test_our_own_export_holds_no_evidence(read, tmp_path):
    """It is no log: reading it as one says so in one line."""
    with pytest.raises(SlamreplayError, match="no scan and no odometry"):
        ingest([read.path], tmp_path / "b")


@pytest.fixture(scope="module")
def looked_back():
    """A log that was really looked back on, its scene thinned out."""
    bundle = synthetic_bundle(seconds=4.0)
    post = postmortem(bundle, cause=False, scene=False)
    return bundle, replace(post, scene=scene_of(post, bundle.view(), most_scans=9))


def test_scans_that_a_scene_left_out_are_written_too(looked_back, tmp_path):
    bundle, post = looked_back
    read = written((bundle, post, ()), tmp_path)
    (whole,) = scene_scans(post, bundle.view(), (), None)
    clouds = read["hindsight/scan"]

    assert len(post.scene.scans[0].t_ns) < len(whole.t_ns) == len(clouds)
    for row, (t_ns, cloud) in enumerate(clouds):
        hit = whole.is_hit[row]
        assert t_ns == whole.t_ns[row]
        assert table(cloud)["met"].tolist() == whole.met[row][hit].tolist()
        np.testing.assert_array_equal(table(cloud)["x"], whole.ends_m[row][hit, 0])


def test_pieces_of_scans_are_the_whole(looked_back):
    bundle, post = looked_back
    view = bundle.view()
    (whole,) = scene_scans(post, view, (), None)
    parts = list(scans_in_pieces(post, view, 0, slice(3, 38), most=7))

    assert [len(p.t_ns) for p in parts] == [7, 7, 7, 7, 7]
    for name in ("t_ns", "ends_m", "is_hit", "met"):
        joined = np.concatenate([getattr(p, name) for p in parts])
        np.testing.assert_array_equal(joined, getattr(whole, name)[3:38])


def test_a_constant_offset_of_the_localizers_map_is_taken_out(found, tmp_path):
    bundle, post, _ = found
    offset = ConstantOffset((3.0, -1.0, 0.5), 3.2, 0.5, 0.1, "map")
    told = replace(post.belief, xyyaw=se2.compose(np.array(offset.xyyaw), post.belief.xyyaw),
                   cov=turned(post.belief.cov, np.full(len(post.belief), 0.5)))  # fmt: skip
    moved = replace(post, belief=told, frame_offset=offset)
    poses = []
    for one in (post, moved):
        said = written((bundle, one, ()), tmp_path)["belief/pose"]
        poses.append([xyyaw(message.pose) for _, message in said])
    own, there = poses

    assert len(own) > 10
    np.testing.assert_allclose(there, own, atol=1e-9)
    np.testing.assert_allclose(moved.belief_on_map.cov, post.belief.cov, atol=1e-12)
