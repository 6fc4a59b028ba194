"""`export --to csv` and `--to rviz`: read back by pandas, PyYAML, Pillow and map_server's rules."""

import json
import shlex
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from PIL import Image

from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Ragged, Table
from slamreplay.bundle.view import Bundle
from slamreplay.errors import UsageError
from slamreplay.export.formats import Format
from slamreplay.export.spreadsheets.columns import cells_of
from slamreplay.export.writers import Request, window_of, write_export
from slamreplay.geometry.times import NO_STAMP
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.map_server import read_map
from slamreplay.postmortem import postmortem
from slamreplay.testing.synthetic import synthetic_bundle


@pytest.fixture(scope="module")
def looked_back():
    """A bundle and what was found in it."""
    bundle = synthetic_bundle(seconds=6.0, with_tags=True)
    return bundle, postmortem(bundle, cause=False)


def read(path, **how):
    return pd.read_csv(path, **how)


def equal(found, want):
    """To the last digit that pandas promises: one in the last place of a float."""
    np.testing.assert_allclose(found, want, rtol=3e-16, atol=0)


def test_tables_read_back_by_pandas_are_equal(looked_back, tmp_path):
    bundle, _ = looked_back
    write_export(Request(bundle), Format.CSV, tmp_path / "x")
    meanings = json.loads((tmp_path / "x" / "columns.json").read_text())
    for name, schema in TABLES.items():
        table, file = bundle.table(name), tmp_path / "x" / "tables" / f"{name}.csv"
        assert file.exists() == bool(len(table))
        if not len(table):
            continue
        frame = read(file, dtype={"t_sensor_ns": "Int64"})
        assert [m["name"] for m in meanings[f"tables/{name}.csv"]] == list(frame.columns)
        at = 0
        for column in schema.columns:
            want = table[column.name]
            width = max(column.size, 1)
            own = frame.iloc[:, at : at + width]
            at += width
            if isinstance(want, Ragged):
                rows = [
                    np.array(str(cell).split(), dtype=want.values.dtype) for cell in own.iloc[:, 0]
                ]
                np.testing.assert_array_equal(np.concatenate(rows), want.values)
            elif column.kind == "str":
                assert own.iloc[:, 0].fillna("").tolist() == want.tolist()
            elif column.name == "t_sensor_ns":
                assert own.iloc[:, 0].fillna(NO_STAMP).tolist() == want.tolist()
            else:
                equal(own.to_numpy().reshape(np.shape(want)), want)
                if column.kind == "int64":
                    assert own.iloc[:, 0].tolist() == want.tolist()
    told = {m["name"]: m for m in meanings["tables/odometry.csv"]}
    assert told["position_x"]["unit"] == "m"
    assert told["position_x"]["frame"] == "frame_id"
    assert "parent" not in told["t_ns"]["frame"]
    assert list(told)[-1] == "twist_covariance_rz_rz"


@pytest.mark.parametrize("before", ["", "\t", "\r", "\n"])
def test_a_spreadsheet_computes_no_text_of_a_log(before):
    row = {
        "t_ns": [1], "t_sensor_ns": [NO_STAMP], "t_log_ns": [1], "topic": ["/rosout"],
        "level": [1], "name": [f"{before}=HYPERLINK(0)"], "message": ["lost"],
    }  # fmt: skip
    cells = {c.name: c.values.to_pylist() for c in cells_of(Table(TABLES["health"], row))}
    assert (cells["name"], cells["message"]) == ([f"'{before}=HYPERLINK(0)"], ["lost"])
    assert cells["t_sensor_ns"] == [None]


def test_a_text_of_two_lines_stays_one_cell(looked_back, tmp_path):
    bundle, _ = looked_back
    row = {
        "t_ns": [bundle.manifest.start_ns], "t_sensor_ns": [NO_STAMP], "t_log_ns": [1],
        "topic": ["/rosout"], "level": [1], "name": ["n"], "message": ['a, "b"\nc'],
    }  # fmt: skip
    tables = {"health": Table(TABLES["health"], row)}
    write_export(Request(Bundle(bundle.manifest, tables, {})), Format.CSV, tmp_path / "x")
    frame = read(tmp_path / "x" / "tables" / "health.csv")
    assert frame["message"].tolist() == ['a, "b"\nc']


def test_answers_are_those_of_the_post_mortem(looked_back, tmp_path):
    bundle, post = looked_back
    request = Request(bundle, post=post, recorded=False)
    written = write_export(request, Format.CSV, tmp_path / "x")
    answers = tmp_path / "x" / "answers"
    assert not any(f.startswith("tables/") for f in written.files)
    assert read(answers / "verdict.csv")["state"].tolist() == [post.judgement.state]
    path = read(answers / "hindsight.csv")
    np.testing.assert_array_equal(path["t_ns"], post.hindsight.track.t_ns)
    equal(path[["x_m", "y_m", "yaw_rad"]], post.hindsight.track.xyyaw)
    equal(path["covariance_x_yaw"], post.hindsight.track.cov[:, 0, 2])
    equal(read(answers / "errors.csv")["distance_m"], post.error.distance_m)
    assert read(answers / "findings.csv")["id"].tolist() == [f.id for f in post.findings]
    spans = read(answers / "intervals.csv")[["start_ns", "end_ns"]].to_numpy().tolist()
    assert spans == [[i.start_ns, i.end_ns] for i in post.judgement.intervals]


def test_a_window_cuts_csv(looked_back, tmp_path):
    bundle, post = looked_back
    window = window_of(bundle, 2.0, 4.0)
    write_export(Request(bundle, window=window, post=post), Format.CSV, tmp_path / "x")
    for file in ("tables/scans.csv", "answers/belief.csv", "answers/errors.csv"):
        t_ns = read(tmp_path / "x" / file)["t_ns"].to_numpy()
        assert len(t_ns) == 21
        assert window.holds(t_ns).all()


def test_rviz_is_given_maps_that_map_server_reads(looked_back, tmp_path):
    bundle, post = looked_back
    changes = post.hindsight.changes
    appeared = np.zeros_like(changes.appeared)
    appeared[3:5, 7:11] = True
    removed = np.zeros_like(appeared)
    removed[-1, 0] = True
    changes = replace(changes, appeared=appeared, removed=removed)
    post = replace(post, hindsight=replace(post.hindsight, changes=changes))
    written = write_export(Request(bundle, post=post), Format.RVIZ, tmp_path / "x")

    folder = tmp_path / "x"
    assert written.files == ["README.txt", "appeared.pgm", "appeared.yaml", "map.pgm", "map.yaml",
                             "overlays.mcap", "removed.pgm", "removed.yaml",
                             "slamreplay.rviz"]  # fmt: skip
    warnings = []
    grids = {n: read_map(folder / f"{n}.yaml", warn=warnings.append)
             for n in ("map", "appeared", "removed")}  # fmt: skip
    assert not warnings
    assert (grids["map"].occupied == post.grid.occupied).all()
    np.testing.assert_array_equal(grids["appeared"].cells, np.where(appeared, 100, 0))
    np.testing.assert_array_equal(grids["removed"].cells, np.where(removed, 99, 0))
    for name in grids:
        meta = yaml.safe_load((folder / f"{name}.yaml").read_text())
        np.testing.assert_array_equal(meta["origin"], post.grid.origin_xyyaw)
    with Image.open(folder / "removed.pgm") as image:
        assert np.asarray(image)[0, 0] == 99  # the map's last row is the image's first


def test_rviz_shows_what_the_log_plays(looked_back, tmp_path):
    bundle, post = looked_back
    window = window_of(bundle, 1.0, 3.0)
    write_export(Request(bundle, window=window, post=post), Format.RVIZ, tmp_path / "x")
    config = yaml.safe_load((tmp_path / "x" / "slamreplay.rviz").read_text())
    manager = config["Visualization Manager"]
    shown = {d["Topic"]["Value"]: d for d in manager["Displays"]}
    assert manager["Global Options"]["Fixed Frame"] == post.grid.frame_id
    assert {d["Class"] for d in shown.values()} == {
        "rviz_default_plugins/Map", "rviz_default_plugins/Path",
    }  # fmt: skip
    with (tmp_path / "x" / "overlays.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        played = {c.topic: (c, m) for _, c, _, m in reader.iter_decoded_messages()}
    assert set(played) == set(shown)
    for topic, (channel, message) in played.items():
        (qos,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
        assert qos["durability"] == 1  # as shown: Transient Local
        assert shown[topic]["Topic"]["Durability Policy"] == "Transient Local"
        assert message.header.frame_id == post.grid.frame_id
    path = played["/slamreplay/hindsight"][1]
    assert len(path.poses) == 21
    start = post.hindsight.track.xyyaw[10]
    assert path.poses[0].pose.position.x == pytest.approx(start[0])
    readme = (tmp_path / "x" / "README.txt").read_text()
    assert "ros2 run nav2_map_server map_server" in readme


def test_a_frame_of_a_log_does_nothing_in_a_shell(looked_back, tmp_path):
    bundle, post = looked_back
    frame = "map; touch 'x'"
    grid = OccupancyGrid(post.grid.cells, post.grid.resolution_m, post.grid.origin_xyyaw, frame)
    write_export(Request(bundle, post=replace(post, grid=grid)), Format.RVIZ, tmp_path / "x")
    text = (tmp_path / "x" / "README.txt").read_text()
    command = text[text.index("ros2 run nav2_map_server") :].split("\n  ros2")[0]
    assert f"frame_id:={frame}" in shlex.split(command.replace("\\\n", " "))


def test_without_a_map_rviz_has_nothing_to_show(looked_back, tmp_path):
    bundle, post = looked_back
    with pytest.raises(UsageError, match="no map"):
        write_export(Request(bundle, post=replace(post, grid=None)), Format.RVIZ, tmp_path / "x")
    assert not (tmp_path / "x").exists()
