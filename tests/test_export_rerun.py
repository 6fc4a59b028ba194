"""What was found, as a recording of Rerun's, read back by Rerun's own library."""

from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest
from exported import LOST_FROM, SILENT, N, S, exported

from slamreplay.errors import UsageError
from slamreplay.evidence import colours
from slamreplay.export import formats
from slamreplay.export.formats import Format, needs
from slamreplay.export.rerun import write_rerun
from slamreplay.geometry import se2
from slamreplay.testing.synthetic import START_NS

rr_chunk = pytest.importorskip("rerun.chunk", reason="the extra 'rerun' is not installed")


class Read:
    """Rows of a recording by entity and component, with their times; static ones have none."""

    def __init__(self, path) -> None:
        reader = rr_chunk.RrdReader(path)
        self.recordings, self.blueprints = reader.recordings(), reader.blueprints()
        self.timelines = set()
        self.rows = defaultdict(list)
        self.static = {}
        for chunk in reader.stream().to_chunks():
            batch = chunk.to_record_batch()
            self.timelines |= set(chunk.timeline_names)
            for name in batch.schema.names:
                if ":" not in name:
                    continue
                key = chunk.entity_path, name
                values = batch.column(name).to_pylist()
                if chunk.is_static:
                    self.static[key] = values[-1]
                    continue
                times = batch.column("log_time").cast("int64").to_pylist()
                self.rows[key] += [
                    (t, v) for t, v in zip(times, values, strict=True) if v is not None
                ]

    def __getitem__(self, key):
        return self.rows.get(key, [])


def written(found, folder, **options) -> Read:
    bundle, post, runs = found
    write_rerun(post, bundle.view(), folder, runs=runs, **options)
    return Read(folder / "slamreplay.rrd")


@pytest.fixture(scope="module")
def found():
    return exported()


@pytest.fixture(scope="module")
def read(found, tmp_path_factory) -> Read:
    return written(found, tmp_path_factory.mktemp("rerun"))


def rgba(hexadecimal) -> int:
    return int.from_bytes(bytes([*colours.rgb(hexadecimal), 255]), "big")


def test_one_recording_on_the_clock_of_the_log(found, read):
    manifest = found[1].manifest
    (recording,), (blueprint,) = read.recordings, read.blueprints

    assert (recording.application_id, recording.recording_id) == ("slamreplay", manifest.bundle_id)
    assert blueprint.application_id == "slamreplay"
    assert read.timelines == {"log_time"}  # and not Rerun's own: when it was written says nothing
    times = [t for rows in read.rows.values() for t, _ in rows]
    assert (min(times), max(times)) == (manifest.start_ns, int(found[1].belief.t_ns[-1]))


def test_poses_are_belief_and_hindsight(found, read):
    _, post, _ = found
    for name, track in (("belief", post.belief), ("hindsight", post.hindsight.track)):
        known = track.take(track.has_pose)
        places = read[f"/map/{name}", "Transform3D:translation"]
        turns = read[f"/map/{name}", "Transform3D:quaternion"]

        assert [t for t, _ in places] == [t for t, _ in turns] == known.t_ns.tolist()
        np.testing.assert_allclose(
            np.squeeze([v for _, v in places])[:, :2], known.xyyaw[:, :2], atol=1e-6
        )
        x, y, z, w = np.squeeze([v for _, v in turns]).T
        assert not np.any(x) | np.any(y)
        off = se2.wrap_angle(2.0 * np.arctan2(z, w) - known.xyyaw[:, 2])
        np.testing.assert_allclose(off, 0.0, atol=1e-6)


def test_scans_lie_below_their_robot(found, read):
    scans = found[1].scene.scans[0]
    places = read["/map/belief/scan", "Points3D:positions"]
    paint = dict(read["/map/belief/scan", "Points3D:colors"])

    assert [t for t, _ in places] == scans.t_ns.tolist()
    for row, (t_ns, points) in enumerate(places):
        if row < SILENT.stop:
            assert not points
            continue
        hit = scans.is_hit[row]
        np.testing.assert_array_equal(np.array(points)[:, :2], scans.ends_m[row][hit])
        wanted = [rgba(colours.BEAMS[met]) for met in sorted(colours.BEAMS)]
        assert paint[t_ns] == [wanted[met] for met in scans.met[row][hit]]
    assert len(read["/map/hindsight/scan_2", "Points3D:positions"]) == N // 2


def test_the_map_lies_where_the_grid_lies(found, read):
    grid = found[1].grid
    ((t_ns, (data,)),) = read["/map/grid", "GridMap:data"]
    ((_, (form,)),) = read["/map/grid", "GridMap:format"]
    picture = np.array(data, dtype=np.uint8).reshape(form["height"], form["width"], 4)
    ((_, (corner,)),) = read["/map/grid", "GridMap:translation"]
    ((_, (turn,)),) = read["/map/grid", "GridMap:quaternion"]

    assert t_ns == found[1].manifest.start_ns
    assert picture.shape[:2] == grid.cells.shape
    is_wall = (picture[::-1, :, :3] == colours.rgb(colours.WALL)).all(axis=2)
    np.testing.assert_array_equal(is_wall, grid.occupied)
    yaw = 2.0 * np.arctan2(turn[2], turn[3])
    np.testing.assert_allclose([*corner[:2], yaw], grid.origin_xyyaw, atol=1e-6)


def test_changes_are_told_when_they_were_first_seen(read):
    boxes = read["/map/changed/regions", "LineStrips3D:strips"]
    names = read["/map/changed/regions", "LineStrips3D:labels"]

    times = [START_NS + 35 * S // 10, START_NS + 45 * S // 10]
    assert [(t, len(v)) for t, v in boxes] == [(times[0], 1), (times[1], 2)]
    assert [v for _, v in names] == [["removed"], ["removed", "appeared"]]
    assert [t for t, _ in read["/map/changed", "GridMap:data"]] == times


def test_ellipses_and_parting_vanish_when_they_do_not_hold(found, read):
    t_ns = found[1].belief.t_ns
    rings = dict(read["/map/belief_ellipse", "LineStrips3D:strips"])
    apart = [t for t, v in read["/map/parting", "LineStrips3D:strips"] if v]

    drawn = [t for t in t_ns.tolist() if rings[t]]
    assert drawn == [*t_ns[SILENT.stop : 10], *t_ns[12:]]
    assert apart == t_ns[LOST_FROM:].tolist()
    assert len(read.static["/map/hindsight_path", "LineStrips3D:strips"]) == 2  # a gap between


def test_runs_lie_in_their_own_frames(read):
    paths = {entity for entity, name in read.static if name == "LineStrips3D:strips"}

    assert {"/map/runs/amcl", "/frames/odom/runs/dead_reckoning"} <= paths


def test_lanes_states_and_findings(found, read):
    _, post, _ = found
    lane = post.scene.lanes[0]
    told = read["/lanes/error_m", "Scalars:scalars"]
    states = [(t, v) for t, (v,) in read["/state", "StateChange:state"]]
    lines = [v for _, (v,) in read["/findings", "TextLog:text"]]
    ((verdict,),) = [v for (entity, name), v in read.static.items() if name == "TextDocument:text"]

    assert [t for t, _ in told] == lane.t_ns.tolist()
    np.testing.assert_array_equal(np.squeeze([v for _, v in told]), lane.values)
    lost_ns = START_NS + LOST_FROM * S // 10
    assert states == [(START_NS, "healthy"), (lost_ns, "lost")]
    assert "SR-LOC-001: off by 1.5 m" in lines
    assert "The robot was lost for 2 s." in verdict


def test_particles_and_plans(found, read):
    clouds = read["/map/particles", "Points3D:positions"]
    plans = read["/map/plan", "LineStrips3D:strips"]

    assert [len(v) for _, v in clouds] == [4, 0, 6]
    assert [len(v[0]) for _, v in plans] == [3, 7]


def test_same_findings_same_content(found, read, tmp_path):
    again = written(found, tmp_path)

    assert repr(again.rows) == repr(read.rows)  # a NaN is no equal of itself
    assert repr(sorted(again.static.items())) == repr(sorted(read.static.items()))


def test_a_window_cuts_what_is_written(found, tmp_path):
    start_ns, end_ns = START_NS + 42 * S // 10, START_NS + 48 * S // 10
    read = written(found, tmp_path, start_ns=start_ns, end_ns=end_ns)

    times = [t for rows in read.rows.values() for t, _ in rows]
    assert (min(times), max(times)) == (start_ns, end_ns)


def test_a_log_without_much_is_written_too(found, tmp_path):
    bundle, post, _ = found
    bare = replace(post, belief=None, hindsight=None, grid=None, scene=None)

    assert written((bundle, bare, ()), tmp_path)["/state", "StateChange:state"]


def test_without_the_library_it_says_so_in_one_line(monkeypatch):
    monkeypatch.setattr(formats, "find_spec", lambda name: None)

    with pytest.raises(UsageError, match="not installed") as error:
        needs(Format.RERUN, None)
    assert "slamreplay[rerun]" in str(error.value.hint)
