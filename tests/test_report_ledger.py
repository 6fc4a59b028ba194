"""The report keeps the ledger, tells jumps, and answers what moved the belief at a time."""

import json
import re
from pathlib import Path

import jsonschema
import numpy as np
import pandas as pd
import pytest
import typer
from typer.testing import CliRunner

from slamreplay.bundle.run import Estimate, Innovations, Run, Trial
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.store import write_bundle
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.cli import report
from slamreplay.cli.summary import show_summary
from slamreplay.errors import UsageError
from slamreplay.evidence.ledger import ledger_bytes, ledger_sets
from slamreplay.evidence.trace import trace
from slamreplay.geometry.times import ns
from slamreplay.postmortem import postmortem
from slamreplay.replay.design import design
from slamreplay.replay.folder import write_runs
from slamreplay.replay.runner import replay
from slamreplay.report.build import build
from slamreplay.report.html import html
from slamreplay.report.model import schema_text
from slamreplay.report.trace_text import jump_lines
from slamreplay.report.writer import write_report
from slamreplay.testing import edits, synthetic_bundle
from slamreplay.testing.synthetic import true_path
from slamreplay.testing.synthetic_rows import START_NS

JUMP_S = 4.0


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    made = synthetic_bundle(seconds=7.0, belief_offset_xyyaw=(0.9, 0.0, 0.1), offset_from_s=JUMP_S)
    tables = {name: made.table(name) for name in TABLES}
    path = tmp_path_factory.mktemp("log") / "b"
    write_bundle(path, made.manifest, tables, {"room": made.grid()})
    return Bundle.open(path)


def graph_run(bundle, n=60):
    """A run whose path was moved by one closure at 4 s, among 60 rows of odometry's."""
    t_ns = bundle.table("scans").t_ns
    path = true_path((t_ns - START_NS) / 1e9)
    path[t_ns >= START_NS + ns(JUMP_S)] += [0.0, 0.7, 0.0]
    track = PoseTrack("map", "base_link", t_ns, path, np.tile(np.eye(3), (len(t_ns), 1, 1)))
    odometry = Innovations("odometry", START_NS + ns(0.1) * np.arange(n), np.zeros((n, 1)),
                           np.ones((n, 1, 1)), np.ones(n, bool), ("forward m",),
                           moved=np.full((n, 3), 1e-3))  # fmt: skip
    closures = Innovations("loop closure", START_NS + np.array([ns(2.0), ns(JUMP_S - 0.05)]),
                           np.array([[9.0, 0.0], [0.3, 0.1]]), np.tile(np.eye(2) * 0.04, (2, 1, 1)),
                           np.array([False, True]), ("x m", "yaw rad"), "node_17",
                           np.array([[0.0, 0.0, 0.0], [0.0, 0.7, 0.0]]),
                           np.array(["node 17 -> node 99", "node 17 -> node 803"]),
                           np.array([0.2, 0.61]), is_predicted=False)  # fmt: skip
    trial = Trial(bundle.manifest.bundle_id, "pose_graph", 0)
    return Run(trial, Estimate(track, (odometry, closures)))


@pytest.fixture(scope="module")
def post(bundle):
    return postmortem(bundle, [graph_run(bundle)], trace_ns=START_NS + ns(JUMP_S))


def test_the_run_and_the_recorded_localizer_are_asked_what_moved_them(post):
    content = json.loads(build(post).json_text())
    recorded, graph = content["trace"]["runs"]

    jsonschema.validate(content, json.loads(schema_text()))
    assert (recorded["estimator"], graph["estimator"]) == ("recorded", "pose_graph")
    first = graph["rows"][0]
    assert (first["source"], first["about"]) == ("loop closure", "node 17 -> node 803")
    assert first["moved_m"] == pytest.approx(0.7)
    assert first["nis"] == pytest.approx((0.3**2 + 0.1**2) / 0.04)
    assert first["sigma"] == pytest.approx([0.2, 0.2])
    assert (first["score"], first["accepted"], first["frame_id"]) == (0.61, True, "node_17")
    assert recorded["rows"][0]["moved_m"] == pytest.approx(0.9, abs=0.1)
    assert recorded["rows"][0]["residual"] == [None] * 3
    sizes = [row["moved_m"] for row in graph["rows"]]
    assert sizes == sorted(sizes, reverse=True)


def test_jumps_are_told_without_being_asked_for(post):
    jumps = json.loads(build(post).json_text())["jumps"]

    assert [j["estimator"] for j in jumps if j["metres"] > 0.5] == ["recorded", "pose_graph"]
    (own,) = [j for j in jumps if j["estimator"] == "pose_graph"]
    assert own["cause"].startswith("loop closure node 17 -> node 803, score 0.61, NIS 2.5")
    assert own["error_before_m"] < 0.2 < own["error_after_m"]
    assert [f.id for f in post.findings].count("SR-LOC-005") == 2


def test_the_ledger_is_written_whole_and_pandas_reads_it(post, tmp_path):
    write_report(post, tmp_path / "r")
    told = json.loads((tmp_path / "r" / "report.json").read_text())["ledger"]
    rows = pd.read_parquet(tmp_path / "r" / told["file"])

    assert told["rows"] == len(rows) == 14 + 60 + 2
    of_closures = rows[rows["source"] == "loop closure"]
    assert of_closures["accepted"].tolist() == [False, True]
    assert of_closures["residual"].iloc[1].tolist() == [0.3, 0.1]
    assert of_closures["S"].iloc[1].tolist() == [0.04, 0.0, 0.0, 0.04]
    assert of_closures["axes"].iloc[0].tolist() == ["x m", "yaw rad"]
    assert of_closures["moved_y_m"].tolist() == [0.0, 0.7]
    assert rows["t_ns"].dtype == np.int64
    assert rows[rows["estimator"] == "recorded"]["nis"].isna().all()
    sources = {s["source"]: s for s in told["sources"]}
    assert sources["loop closure"]["mean_nis"] is None  # its S was not predicted
    assert sources["odometry"]["mean_nis"] == 0.0
    assert sources["loop closure"]["largest_t_ns"] == START_NS + ns(JUMP_S - 0.05)
    assert (sources["loop closure"]["rows"], sources["loop closure"]["accepted"]) == (2, 1)


def test_the_same_ledger_gives_the_same_bytes(bundle):
    sets = ledger_sets([graph_run(bundle)])

    assert ledger_bytes(sets, clock="c") == ledger_bytes(
        ledger_sets([graph_run(bundle)]), clock="c"
    )


def test_the_page_and_the_terminal_say_it_too(post, capsys):
    show_summary(post, Path("report.html"))
    page, lines = html(post), capsys.readouterr().out

    assert "Which measurement moved the belief" in page
    for text in (page.replace("&gt;", ">"), lines):
        assert "node 17 -> node 803" in text
        assert "recorded" in text
        assert re.search(r"x 0\.3.m, yaw 5\.73.deg", text)
    assert "pose_graph jumped at 4.0 s by 0.70 m" in lines
    assert "more in ledger.parquet" in lines


def test_without_a_moment_and_without_a_localizer_nothing_is_made_up(bundle):
    silent = edits.without(bundle, "localizer")
    post = postmortem(silent)
    content = json.loads(build(post).json_text())

    assert content["trace"] is None
    assert content["jumps"] == []
    assert content["ledger"] == {"file": None, "rows": 0, "sources": []}
    assert not list(jump_lines(post))
    assert "Which measurement moved the belief" not in html(post)


def test_far_from_every_measurement_the_nearest_is_told(bundle):
    (one,) = trace([graph_run(bundle)], START_NS + ns(60.0))

    assert not one.near
    assert [(row.set.source, row.row) for row in one.rows] == [("odometry", 59)]


def invoke(*arguments):
    app = typer.Typer()
    app.callback()(lambda: None)
    report.register(app)
    return CliRunner().invoke(app, ["report", *map(str, arguments)], catch_exceptions=True)


def test_the_option_takes_seconds_after_the_start(bundle, tmp_path):
    runs = replay(bundle, design(bundle, ["recorded"], [], 0))
    write_runs(tmp_path / "R", bundle, runs)

    told = invoke(tmp_path / "R", "-o", tmp_path / "r", "--trace", "4")

    assert told.exit_code == 0, told.output
    assert "recorded jumped at 4.0 s by 0.9" in told.stdout
    assert "Measurements within 5 s of 4.0 s" in told.stdout
    assert told.stdout.splitlines()[-1] == str(tmp_path / "r" / "report.html")
    assert (tmp_path / "r" / "ledger.parquet").is_file()


@pytest.mark.parametrize("moment", ["-1", "500", "nan"])
def test_a_moment_outside_of_the_log_is_refused_before_the_work(bundle, tmp_path, moment):
    refused = invoke(bundle.path, "-o", tmp_path / "r", "--trace", moment)

    assert isinstance(refused.exception, UsageError)
    assert "7.0 s long" in str(refused.exception)
    assert not (tmp_path / "r").exists()
