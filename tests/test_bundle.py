"""A bundle written and read back is the same bundle, and a damaged one is refused."""

import io
import json
import os

import numpy as np
import pytest

from slamreplay.bundle.atomic import check_target
from slamreplay.bundle.manifest import Clock, Frames, Manifest
from slamreplay.bundle.run import Estimate, Innovations, Run, Trial, read_run, run_bytes
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.store import is_bundle, write_bundle
from slamreplay.bundle.tables import Ragged, Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.errors import BundleError, OutputError
from slamreplay.geometry.times import NO_STAMP
from slamreplay.maps.grid import OccupancyGrid


def empty_manifest() -> Manifest:
    return Manifest(
        bundle_id="",
        sources=[],
        options={},
        start_ns=0,
        end_ns=10,
        clock=Clock(name="sensor", reason="test", knots=[(100, 0), (200, 150)]),
        frames=Frames(map=None, odom=None, base=None, tree=[]),
        roles=[],
        missing=[],
        maps=[],
        losses=[],
        tables={},
    )


def scans() -> Table:
    return Table(
        TABLES["scans"],
        {
            "t_ns": [1, 2, 3],
            "t_sensor_ns": [1, NO_STAMP, 3],
            "t_log_ns": [4, 5, 6],
            "topic": ["/scan"] * 3,
            "frame_id": ["laser"] * 3,
            "angle_min_rad": [0.0] * 3,
            "angle_increment_rad": [0.1] * 3,
            "time_increment_s": [0.0] * 3,
            "scan_time_s": [0.1] * 3,
            "range_min_m": [0.1] * 3,
            "range_max_m": [9.0] * 3,
            "ranges_m": [[1.0, np.inf], [], [np.nan, 2.0, 3.0]],
        },
    )


GRID = OccupancyGrid(np.array([[0, 100], [-1, 40]], dtype=np.int8), 0.05, np.array([1.0, 2.0, 0.3]))


def test_bundle_reads_back_what_was_written(tmp_path):
    write_bundle(tmp_path / "b", empty_manifest(), {"scans": scans()}, {"test": GRID})

    bundle = Bundle.open(tmp_path / "b")
    table = bundle.table("scans")

    assert set(bundle.manifest.tables) == set(TABLES)
    assert table["t_sensor_ns"].tolist() == [1, NO_STAMP, 3]
    np.testing.assert_array_equal(table["ranges_m"][2], np.float32([np.nan, 2, 3]))
    assert table.take(np.array([2, 0]))["ranges_m"].lengths.tolist() == [3, 2]
    assert bundle.grid().version == GRID.version
    assert len(bundle.table("imu")) == 0


def test_same_content_gives_same_bytes_and_is_kept(tmp_path):
    one = write_bundle(tmp_path / "b", empty_manifest(), {"scans": scans()}, {"test": GRID})
    stamp = (tmp_path / "b").stat().st_ino
    two = write_bundle(tmp_path / "b", empty_manifest(), {"scans": scans()}, {"test": GRID})

    assert one == two
    assert (tmp_path / "b").stat().st_ino == stamp


def test_damaged_table_is_refused(tmp_path):
    write_bundle(tmp_path / "b", empty_manifest(), {"scans": scans()}, {})
    file = tmp_path / "b" / "tables" / "scans.parquet"
    content = bytearray(file.read_bytes())
    content[10] ^= 1
    file.write_bytes(content)

    with pytest.raises(BundleError, match="hash"):
        Bundle.open(tmp_path / "b").table("scans")


def test_foreign_folder_is_refused_and_left_alone(tmp_path):
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "thesis.tex").write_text("mine")

    with pytest.raises(OutputError, match=r"manifest\.json"):
        write_bundle(tmp_path / "b", empty_manifest(), {}, {})

    assert not is_bundle(tmp_path / "b")
    assert [p.name for p in tmp_path.iterdir()] == ["b"]


def test_log_times_are_carried_over_between_knots():
    clock = empty_manifest().clock

    assert clock.from_log_time([0, 100, 150, 200, 300]).tolist() == [-100, 0, 75, 150, 250]


def test_run_reads_back_what_was_written(tmp_path):
    track = PoseTrack.without_covariance("map", "base", np.arange(4), np.ones((4, 3)))
    innovations = Innovations(
        "scans",
        np.arange(2),
        np.zeros((2, 1)),
        np.ones((2, 1, 1)),
        np.array([True, False]),
        ("range m",),
    )
    run = Run(
        Trial("id", "amcl", 7, "tf_delay.all", 0.2, "s"),
        Estimate(track, (innovations,), {"particles": np.arange(4.0)}, {"recoveries": 2.0}),
    )
    (tmp_path / "r.npz").write_bytes(run_bytes(run))

    back = read_run(tmp_path / "r.npz")

    assert back.trial == run.trial
    assert run_bytes(back) == run_bytes(run)
    assert back.estimate.diagnostics["particles"].tolist() == [0, 1, 2, 3]
    assert back.estimate.innovations[0].axes == ("range m",)
    assert back.estimate.scalars == {"recoveries": 2.0}


def test_a_run_of_another_format_is_refused_with_what_to_do(tmp_path):
    track = PoseTrack.without_covariance("map", "base", np.arange(1), np.ones((1, 3)))
    with np.load(io.BytesIO(run_bytes(Run(Trial("id", "amcl", 7), Estimate(track))))) as arrays:
        older = dict(arrays)
    head = {**json.loads(older["head"].tobytes()), "run_format": 1}
    older["head"] = np.frombuffer(json.dumps(head).encode(), dtype=np.uint8)
    np.savez(tmp_path / "r.npz", **older)

    with pytest.raises(BundleError, match="run format 1, this program reads 2") as refused:
        read_run(tmp_path / "r.npz")
    assert refused.value.hint == "run perturb again"


def test_ragged_take_repeats_and_reorders():
    ragged = Ragged.of([[1], [2, 3], []], np.int8)

    assert [ragged.take(np.array([2, 1, 1]))[i].tolist() for i in range(3)] == [[], [2, 3], [2, 3]]


def test_unwritable_place_is_refused_before_the_work(tmp_path):
    (tmp_path / "file").write_text("mine")
    (tmp_path / "locked").mkdir(mode=0o555)

    check_target(tmp_path / "new" / "folder", "manifest.json")
    with pytest.raises(OutputError, match="is no folder"):
        check_target(tmp_path / "file" / "b", "manifest.json")
    if os.geteuid() != 0:  # root may write anywhere
        with pytest.raises(OutputError, match="takes no new entries"):
            check_target(tmp_path / "locked" / "b", "manifest.json")


def test_a_robot_that_stood_is_where_it_was_however_seldom_it_says_so():
    """Samples 4 s apart: the first two agree, the next is a metre on; 20 s later nobody knows."""
    t_ns = np.array([0, 4, 8, 30]) * 1_000_000_000
    xyyaw = np.array([[1.0, 2.0, 0.1], [1.0, 2.02, 0.1], [2.0, 2.0, 0.1], [2.0, 2.0, 0.1]])
    track = PoseTrack.without_covariance("odom", "base", t_ns, xyyaw)

    at = track.at(np.array([2, 6, 20]) * 1_000_000_000).xyyaw
    np.testing.assert_allclose(at[0], [1.0, 2.01, 0.1])
    assert np.isnan(at[1:]).all()
