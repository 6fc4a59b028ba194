"""`import slamreplay as sr`: logs, reports and runs as values that show themselves."""

import inspect
import json
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from heavy_modules import HEAVY
from matplotlib.axes import Axes

import slamreplay as sr
from slamreplay.bundle.manifest import Source
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.errors import NotApplicableError, UsageError
from slamreplay.notebook import LogBundle, Report, Runs
from slamreplay.notebook.frames import parts_frame, table_frame
from slamreplay.notebook.progress import shown
from slamreplay.report.model import SCHEMA_VERSION, StopPart
from slamreplay.testing.synthetic import START_NS, synthetic_bundle

HOSTILE = "<script>alert(1)</script>&\"'**x** $y$\x00.mcap"


@pytest.fixture(scope="module", autouse=True)
def _own_cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        patch.setattr(mpl, "rcParams", mpl.rcParams.copy())
        yield


@pytest.fixture(scope="module")
def log():
    """8 s in a room, lost from 3 s on; its file has a name that is markup."""
    bundle = synthetic_bundle(seconds=8.0, belief_offset_xyyaw=(1.5, 0.5, 0.1), offset_from_s=3.0)
    source = Source(name=HOSTILE, format="mcap", bytes=7, sha256="ab" * 32)
    manifest = bundle.manifest.model_copy(update={"sources": [source]})
    bundle.manifest = manifest
    return LogBundle(bundle)


@pytest.fixture(scope="module")
def r(log):
    return sr.report(log, cause=False)


@pytest.fixture(scope="module")
def runs(log):
    return sr.perturb(log, "tf_delay=0.2", ["recorded", "dead_reckoning"])


class Markup(HTMLParser):
    """What a cell's HTML is made of."""

    def __init__(self, html):
        super().__init__()
        self.tags, self.names, self.text, self.sources = set(), set(), "", []
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.names |= {name for name, _ in attrs}
        self.sources += [value for name, value in attrs if name == "src"]

    def handle_data(self, data):
        self.text += data


def test_import_loads_nothing_heavy_and_neither_do_help_and_completion():
    code = (
        "import sys, json, inspect; import slamreplay as sr\n"
        "dir(sr); sr.report; sr.open; sr.ingest.__doc__; inspect.signature(sr.perturb)\n"
        "print(json.dumps(sorted(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert not {*HEAVY, "pydantic"} & set(json.loads(done.stdout))


@pytest.mark.parametrize("name", ["ingest", "report", "perturb", "export", "simulate"])
def test_stages_are_packages_that_can_be_called(name):
    import slamreplay.notebook as functions

    stage, function = getattr(sr, name), getattr(functions, name)

    assert inspect.ismodule(stage)
    assert stage is sys.modules[f"slamreplay.{name}"]
    assert callable(stage)
    assert stage.__doc__ == function.__doc__
    assert inspect.signature(stage) == inspect.signature(function)
    assert inspect.getdoc(stage).startswith(inspect.getdoc(function)[:20])


def test_a_stage_stays_the_package_it_was(monkeypatch):
    import slamreplay.report.html
    from slamreplay import report

    monkeypatch.setattr("slamreplay.report.html.html", lambda post: "patched")

    assert slamreplay.report.html.html(None) == "patched"
    assert report is sr.report


def test_the_root_says_what_it_has():
    assert {"ingest", "report", "perturb", "export", "simulate", "open", "list"} <= set(dir(sr))
    with pytest.raises(AttributeError, match="no attribute 'reprot'"):
        sr.reprot  # noqa: B018


def test_a_fault_is_one_line_in_ipython():
    with pytest.raises(sr.SlamreplayError) as caught:
        sr.ingest("no_such.mcap")

    (line,) = caught.value._render_traceback_()
    assert line.startswith("LogError: no_such.mcap: ")
    assert "\n" not in line


# tables


def test_tables_are_frames_with_units(log):
    odometry = log.tables["odometry"]
    recorded = log.bundle.table("odometry")

    assert odometry["t_ns"].tolist() == recorded.t_ns.tolist()
    assert odometry["t_s"].iloc[0] == pytest.approx((recorded.t_ns[0] - START_NS) / 1e9)
    np.testing.assert_array_equal(odometry["position_y"], recorded["position_xyz"][:, 1])
    np.testing.assert_array_equal(odometry["orientation_w"], recorded["orientation_xyzw"][:, 3])
    assert odometry["pose_covariance"].iloc[3].shape == (6, 6)
    assert odometry.attrs["units"]["linear_velocity_x"] == "m/s"
    assert odometry.attrs["frames"]["linear_velocity_x"] == "child_frame_id"
    (first, *_) = log.tables["scans"]["ranges_m"]
    np.testing.assert_array_equal(first, log.bundle.table("scans")["ranges_m"][0])


def test_no_stamp_is_a_missing_integer_and_no_float():
    table = synthetic_bundle(seconds=1.0).table("poses")
    stamps = table["t_sensor_ns"].copy()
    stamps[1:] += 1  # beyond what a float holds
    stamps[0] = np.iinfo(np.int64).min
    frame = table_frame(table.replace(t_sensor_ns=stamps), START_NS)

    assert frame["t_sensor_ns"].isna().tolist()[:2] == [True, False]
    assert int(frame["t_sensor_ns"].iloc[1]) == int(stamps[1])


@pytest.mark.parametrize("name", list(TABLES))
def test_every_table_has_a_frame(name):
    frame = table_frame(Table.empty(TABLES[name]), START_NS)

    assert len(frame) == 0
    assert {"t_ns", "t_s"} <= set(frame)
    assert set(frame.attrs["units"]) == set(frame)


def test_tables_without_rows_are_not_listed_but_can_be_had(log):
    assert "imu" not in list(log.tables)
    assert len(log.tables["imu"]) == 0
    assert len(log.tables) == len(list(log.tables))
    with pytest.raises(UsageError, match="did you mean 'poses'"):
        log.tables["pose"]
    assert "pose" not in log.tables


def test_a_log_says_what_it_is(log):
    assert "missing: imu" in repr(log)
    assert set(log.missing["part"]) == set(log.manifest.missing_parts())
    (grid,) = log.maps.values()
    assert grid.cells.ndim == 2
    assert log.duration_s == pytest.approx(8.0, abs=0.2)
    assert "odometry" in set(log.roles["role"])


# reports


def test_intervals_and_findings_are_those_of_the_report(r):
    content = r.json()

    assert content["schema_version"] == SCHEMA_VERSION
    assert r.verdict.state == content["verdict"]["state"] == "lost"
    assert r.intervals["start_ns"].tolist() == [i["start_ns"] for i in content["intervals"]]
    assert r.intervals["start_s"].iloc[0] == 0.0
    assert r.intervals.attrs["units"]["max_error_m"] == "m"
    assert "SR-LOC-001" in set(r.findings["id"])
    assert r.findings["value"].dtype == "float64"
    assert r.findings["n"].dtype == "Int64"
    assert r.intervals["confidence"].dtype == "float64"
    assert r.regions["bbox_m"].dtype == "object"


def test_unknown_times_and_texts_are_missing_and_frames_keep_their_columns():
    stop = StopPart(t_ns=START_NS + 7, x_m=None, y_m=2.0, state="lost", cause="so")

    frame, empty = (parts_frame(parts, StopPart, START_NS) for parts in ([stop], []))

    assert frame["t_ns"].tolist() == [START_NS + 7]
    assert frame["t_s"].tolist() == [7e-9]
    assert np.isnan(frame["x_m"].iloc[0])
    assert list(empty) == list(frame)
    assert empty.dtypes.tolist() == frame.dtypes.tolist()


def test_trajectories_and_lanes(r):
    belief, hindsight = r.belief, r.hindsight

    assert belief["t_ns"].dtype == "int64"
    assert belief.attrs["frame_id"] == "map"
    far = np.hypot(belief["x_m"] - hindsight["x_m"], belief["y_m"] - hindsight["y_m"])
    assert np.nanmax(far) > 1.5
    np.testing.assert_allclose(belief["sigma_x_m"] ** 2, belief["cov_x_x"])
    lanes = r.lanes
    assert lanes.attrs["limits"]["error_m"] == 0.5
    error = lanes[lanes["lane"] == "error_m"]
    assert np.nanmax(error["value"]) == pytest.approx(np.nanmax(far))


def test_what_moved_the_belief_is_told_of_a_moment(log, r):
    traced = sr.report(log, cause=False, trace=4.0)

    assert len(r.trace) == 0
    assert set(r.ledger["estimator"]) == {"recorded"}
    assert set(traced.trace["estimator"]) == {"recorded"}
    assert traced.trace["t_s"].sub(4.0).abs().min() < 2.0
    assert "moved_m" in traced.trace.attrs["units"]


def test_every_figure_is_drawn_in_a_figure_that_pyplot_shows(r):
    before = dict(mpl.rcParams)
    for name in r.figures:
        axes = np.ravel(r.figure(name))
        assert all(isinstance(a, Axes) for a in axes), name
        assert plt.gcf() is axes[0].figure or plt.gcf() is axes[0].figure.figure, name
        plt.close("all")

    assert dict(mpl.rcParams) == before


def test_figures_go_into_axes_that_are_there(r):
    figure, (left, right) = plt.subplots(1, 2)

    assert r.plot.map(left) is left
    assert r.figure("error", ax=right) is right
    assert left.get_xlabel() == "x in map [m]"
    assert right.get_legend() is not None
    figure.canvas.draw()
    plt.close(figure)


def test_axes_that_do_not_fit_are_refused(r):
    figure, axes = plt.subplots(1, 2)
    with pytest.raises(UsageError, match="'course' needs 3 axes, 2 were given"):
        r.figure("course", ax=axes)
    with pytest.raises(UsageError, match="did you mean 'map'"):
        r.figure("mapp")
    with pytest.raises(NotApplicableError, match="this log has no 'doses'"):
        r.plot.doses()
    plt.close(figure)


def test_plot_completes_the_names_of_this_log(r):
    assert list(dir(r.plot)) == sorted(r.figures)
    assert r.plot.map.__name__ == "map"
    assert not hasattr(r.plot, "_ipython_display_")


def test_a_report_shows_itself_and_nothing_a_log_says_is_markup(r, log, runs):
    for value in (r, log, runs, log.tables):
        shown = Markup(value._repr_html_())
        assert shown.tags <= {"div", "strong", "span", "p", "table", "thead", "tbody", "tr", "th",
                              "td", "img"}  # fmt: skip
        assert shown.names <= {"style", "scope", "alt", "src"}
        assert all(source.startswith("data:image/svg+xml;base64,") for source in shown.sources)
    text = Markup(r._repr_html_()).text
    assert "Robot lost" in text
    assert "<script>alert(1)</script>" in text
    assert len(Markup(r._repr_html_()).sources) == 1
    assert "\x00" not in r._repr_html_() + repr(r)
    assert "\\*\\*x\\*\\*" in r._repr_markdown_()
    assert "\\<script\\>" in r._repr_markdown_()


def test_saved_and_opened_again_it_has_the_same_tables(r, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(
        "slamreplay.report.figure_files.write_figures", lambda _, folder: drawn.append(folder)
    )
    monkeypatch.setattr("slamreplay.report.writer.html", lambda _: "a page")  # slow, and not asked
    page = r.save(tmp_path / "r", figures=tmp_path / "f")
    again = sr.open(tmp_path / "r")

    assert page == tmp_path / "r" / "report.html"
    assert drawn == [tmp_path / "f"]
    with pytest.raises(UsageError, match="figures need a folder of their own"):
        r.save(tmp_path / "s", figures=tmp_path)
    assert not (tmp_path / "s").exists()
    assert isinstance(again, Report)
    assert again.json() == r.json() == json.loads((tmp_path / "r" / "report.json").read_text())
    for name in ("intervals", "findings", "stops", "jumps", "root_cause"):
        pd.testing.assert_frame_equal(getattr(again, name), getattr(r, name))
    assert again.figures == []
    assert "SR-LOC-001" in repr(again)
    assert "Robot lost" in again._repr_html_()
    with pytest.raises(UsageError, match="read from its file has no figures"):
        again.plot.map()
    with pytest.raises(UsageError, match="read from its file has no belief"):
        again.belief  # noqa: B018


def test_a_caption_is_had_by_name(r):
    assert "slamreplay" in r.caption("map")
    with pytest.raises(UsageError, match="there is no figure 'error'"):
        r.caption("error")


def test_what_is_no_evidence_is_refused_in_one_line(tmp_path, log):
    (tmp_path / "notes.txt").write_text("x")
    with pytest.raises(UsageError, match="neither a bundle, nor runs, nor a report"):
        sr.open(tmp_path / "notes.txt")
    (tmp_path / "report.json").write_text("{}")
    with pytest.raises(sr.SlamreplayError, match="not a report that this version reads"):
        sr.open(tmp_path)
    with pytest.raises(UsageError, match="map: only a log that has yet to be read"):
        sr.report(log, map="m.yaml")
    with pytest.raises(UsageError, match="there is no log to read"):
        sr.ingest([])


# runs


def test_runs_are_a_table_and_trajectories(runs):
    table = runs.table

    assert table["estimator"].tolist() == ["recorded", "dead_reckoning"] * 2
    assert table["perturbation"].tolist() == [None, None, *["tf_delay.odometry"] * 2]
    assert table["level"].iloc[2] == 0.2
    assert table["baseline_max_m"].iloc[1] == 0.0
    assert table.attrs["units"]["reference_rmse_m"] == "m"
    assert len(runs.trajectory(1)) == table["rows"].iloc[1]
    with pytest.raises(UsageError, match="there is no run 9"):
        runs.trajectory(9)
    assert "dead_reckoning" in repr(runs)


def test_a_report_of_runs_has_their_trials(runs):
    trials = sr.report(runs, cause=False).trials

    assert len(trials) == 4
    assert trials["perturbation"].tolist()[0] is None
    assert {"reference_rmse_m", "lost_share"} <= set(trials)


def test_a_trial_that_cannot_be_says_why(runs):
    run = runs.runs[0]
    without = replace(run, estimate=None, not_applicable="there is no floor")
    shown = Runs(runs.log, (without,), None)

    assert shown.table["not_applicable"].tolist() == ["there is no floor"]
    assert "there is no floor" in shown._repr_html_()
    with pytest.raises(UsageError, match="there is no floor"):
        shown.trajectory(0)


def test_names_are_checked_before_the_log_is_read():
    with pytest.raises(UsageError, match="did you mean 'tf_delay'"):
        sr.perturb("no_such.mcap", ["tf_dely=0.2"])
    with pytest.raises(UsageError, match="estimator"):
        sr.perturb("no_such.mcap", estimators=["amlc"])
    with pytest.raises(UsageError, match="leave perturbations and seed out"):
        sr.perturb("no_such.mcap", ["tf_delay=0.2"], recipe="r.yaml")


RECIPE = """\
version: 1
question: How late may odometry be?
seed: 1
seeds: 1
estimators: [dead_reckoning]
limits: {error_max_m: 0.1}
perturbations:
  - {name: tf_delay.odometry, levels_s: [0.5, 2.0]}
"""


def test_from_a_log_to_runs_of_a_recipe_and_back(tmp_path):
    path = sr.simulate("healthy_short", tmp_path / "log.mcap")
    (tmp_path / "r.yaml").write_text(RECIPE)
    log = sr.ingest(path, output=tmp_path / "log.bundle", end=8.0)

    runs = sr.perturb(tmp_path / "log.bundle", recipe=tmp_path / "r.yaml", output=tmp_path / "runs")
    again = sr.open(tmp_path / "runs")

    assert isinstance(sr.open(tmp_path / "log.bundle"), LogBundle)
    assert log.duration_s == pytest.approx(8.0, abs=0.3)
    assert runs.table["level"].dropna().tolist() == [0.5, 2.0]
    assert isinstance(again, Runs)
    pd.testing.assert_frame_equal(again.table, runs.table)
    assert again.design.question == "How late may odometry be?"
    axes = sr.report(again, cause=False).figure("doses")
    assert axes.get_title(loc="left") == "tf_delay.odometry"
    plt.close("all")
    files = sr.export(again, "tum", tmp_path / "tum")
    assert len(files) == 3
    assert all(file.exists() for file in files)
    with pytest.raises(UsageError, match="there is no format 'bag'"):
        sr.export(again, "bag", tmp_path / "bag")


# the rest


def test_lists_and_explanations():
    assert {"name", "unit", "baseline"} <= set(sr.list("perturbations"))
    told = sr.explain("sr-loc-001")
    assert told.id == "SR-LOC-001"
    assert told._repr_markdown_().startswith("### SR-LOC-001")
    with pytest.raises(UsageError, match="there is no list of 'figures'"):
        sr.list("figures")
    with pytest.raises(UsageError, match="did you mean 'SR-LOC-001'"):
        sr.explain("SR-LOC-01")


def test_progress_is_told_to_whoever_asks_and_scripts_are_silent(log, capsys, monkeypatch):
    told = []
    sr.report(log, cause=False, progress=lambda what, share: told.append(share))
    sr.report(log, cause=False)

    assert told[-1] == 1.0
    assert capsys.readouterr().err == ""
    with shown(progress=True) as tell:
        tell("reading", 0.5)
        line = capsys.readouterr().err
    assert line == "\r############............  50 % reading"
    assert capsys.readouterr().err.strip() == ""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with shown(None) as tell:
        assert tell is not None
    with shown(progress=False) as tell:
        assert tell is None
