"""The report's files say what the post-mortem says, and nothing a log holds can break them."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree as ET

import jsonschema
import numpy as np
import pytest
import yaml
from linear_filter import filters
from PIL import Image
from posts import bare_post, lost_post

from slamreplay.bundle.findings import FINDINGS, Finding
from slamreplay.bundle.run import Estimate, Run, Trial
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.tum import tum
from slamreplay.consistency.belief.summary import ConsistencySummary, PartSummary
from slamreplay.consistency.statistics.distribution import distribution
from slamreplay.consistency.statistics.mean_test import mean_test
from slamreplay.errors import OutputError
from slamreplay.evidence.result import Postmortem, TrialResult
from slamreplay.maps.map_server import read_map
from slamreplay.report.assess import not_assessable
from slamreplay.report.build import build
from slamreplay.report.facts import deciding_facts
from slamreplay.report.html import html
from slamreplay.report.innovations import innovations
from slamreplay.report.junit import junit_xml
from slamreplay.report.latency import latency_note, usage_table
from slamreplay.report.model import SCHEMA_FILE, Report, schema_text
from slamreplay.report.phrases import bound
from slamreplay.report.tables import trials as trial_table
from slamreplay.report.writer import write_report
from slamreplay.testing.synthetic import synthetic_bundle
from slamreplay.verdict.latency.latency import latency, usages
from slamreplay.verdict.reliability import Bin, Reliability


@pytest.fixture(scope="module")
def post() -> Postmortem:
    """A log of 20 s."""
    return lost_post()


@pytest.fixture(scope="module")
def folder(post, tmp_path_factory) -> Path:
    """The report of `post`."""
    return write_report(post, tmp_path_factory.mktemp("reports") / "r").parent


@pytest.fixture(scope="module")
def bare(post) -> Postmortem:
    """The same log with nothing in it."""
    return bare_post(post)


def test_the_trial_table_says_that_parameters_were_given(post):
    given = Trial("b", "amcl", 0, parameters='{"alpha1":0.1,"z_hit":0.9}')
    runs = (*post.trials, TrialResult(Run(given, post.trials[0].run.estimate), {}))
    post = replace(post, trials=runs)

    table = trial_table(post)

    assert [row[0].aside for row in table.rows] == ["", "", "2 parameters given", ""]
    told = [t["parameters"] for t in json.loads(build(post).json_text())["trials"]]
    assert told == [None, None, None, {"alpha1": 0.1, "z_hit": 0.9}]


def test_shipped_schema_is_the_models():
    assert SCHEMA_FILE.read_text(encoding="utf-8") == schema_text()
    jsonschema.Draft202012Validator.check_schema(json.loads(schema_text()))


def test_report_json_has_the_contracts_keys_and_is_valid(post, bare):
    schema = json.loads(schema_text())
    for each in (post, bare):
        content = json.loads(build(each).json_text(), parse_constant=pytest.fail)
        jsonschema.validate(content, schema)
        assert list(content) == [
            "schema_version", "slamreplay", "bundle", "verdict", "intervals", "changed_regions",
            "reference", "failure_mode", "root_cause", "stops", "actions", "findings", "trials",
            "design",
            "ledger", "jumps", "trace", "latency",
        ]  # fmt: skip
        assert Report.model_validate_json(build(each).json_text()) == build(each)


def test_the_age_of_the_pose_is_in_report_json_and_on_the_page(post, bare):
    found = latency(synthetic_bundle(seconds=5.0).view())
    aged = replace(post, latency=found, usages=usages(found))
    content = json.loads(build(aged).json_text(), parse_constant=pytest.fail)
    jsonschema.validate(content, json.loads(schema_text()))
    controller, planner = content["latency"]["consumers"]

    assert (content["latency"]["basis"], content["latency"]["dated"]) == ("shared", "scan")
    assert (controller["name"], controller["topic"], planner["rate_hz"]) == (
        "controller", None, None
    )  # fmt: skip
    assert controller["pose_s"]["p50"] <= controller["pose_s"]["p95"] <= controller["pose_s"]["max"]
    assert controller["correction_s"]["max"] < 0.51
    shown = usage_table(aged)
    assert [row[0].text for row in shown.rows] == ["controller", "planner"]
    assert "as if at the budget's rate" in shown.rows[0][0].aside
    assert "until its scan was there" in latency_note(aged)
    assert build(bare).latency is None
    assert usage_table(bare).rows == ()
    assert latency_note(bare) == ""


def test_every_key_is_there_and_the_unknown_is_null(post, bare):
    content = json.loads(build(bare).json_text())

    assert content["verdict"]["confidence"] is None
    assert content["bundle"]["map_version"] is None
    assert content["reference"] == {
        "kind": None, "trajectory": None, "sigma_m": None, "coverage": None
    }  # fmt: skip
    assert content["intervals"][0]["max_error_m"] is None
    assert content["stops"][0]["x_m"] is None
    assert content["actions"][0]["allowed"] is None
    full = json.loads(build(post).json_text())
    assert full["findings"][2]["value"] is None  # it was NaN
    assert full["findings"][2]["title"] == "OTHER-7"
    assert set(full["findings"][0]) == {
        "id", "severity", "title", "message", "start_ns", "end_ns", "value", "low", "high", "unit",
        "n", "n_eff", "p_value", "p_adjusted",
    }  # fmt: skip


def test_moved_region_names_its_old_place_and_others_none(post):
    regions = json.loads(build(post).json_text())["changed_regions"]

    assert regions[0]["from_bbox_m"] is None
    assert regions[1]["from_bbox_m"] == [5.0, 6.0, 7.0, 8.0]
    assert regions[1]["bbox_m"] == [1.0, 2.0, 3.0, 4.0]


def test_trial_that_does_not_apply_is_marked(post):
    trials = json.loads(build(post).json_text())["trials"]

    assert [t["perturbation"] for t in trials] == [None, "tf_delay.all", "particles.n"]
    assert trials[0]["level"] is None
    assert trials[1] == {
        "estimator": "amcl", "perturbation": "tf_delay.all", "level": 0.2, "unit": "s",
        "parameters": None, "metrics": {"nees_mean": 4.0},
    }  # fmt: skip
    assert trials[2]["metrics"] == {"not_applicable": True}


def test_unknown_state_is_refused(post):
    judgement = replace(post.judgement, state="confused")

    with pytest.raises(ValueError, match="state"):
        build(replace(post, judgement=judgement))


def test_numpy_numbers_become_plain_ones(post):
    finding = Finding("SR-LOC-001", "error", "m", np.int64(1), value=np.float64(2.0), n=np.int64(3))

    row = json.loads(build(replace(post, findings=(finding,))).json_text())["findings"][0]

    assert (row["start_ns"], row["value"], row["n"]) == (1, 2.0, 3)


def test_tum_has_exact_stamps_in_order_and_no_rows_without_pose():
    t = np.array([1_700_000_000_123_456_789, 1_700_000_000_000_000_001, 5], dtype=np.int64)
    xyyaw = np.array([[1.0, -2.0, np.pi / 2], [-1e-12, 0.5, 0.0], [np.nan, 0.0, 0.0]])

    lines = tum(PoseTrack.without_covariance("map", "base", t, xyyaw)).splitlines()

    level = "0.000000 0.000000000 0.000000000"
    assert lines == [
        f"1700000000.000000001 0.000000 0.500000 {level} 0.000000000 1.000000000",
        f"1700000000.123456789 1.000000 -2.000000 {level} 0.707106781 0.707106781",
    ]


def test_changed_map_lies_on_the_map(post, folder):
    pixels = np.flipud(np.asarray(Image.open(folder / "changed.pgm")))
    meta = yaml.safe_load((folder / "changed.yaml").read_text())
    grid = read_map(folder / "changed.yaml", warn=pytest.fail)

    assert pixels.shape == post.grid.cells.shape
    np.testing.assert_array_equal(pixels == 0, post.hindsight.changes.appeared)
    np.testing.assert_array_equal(pixels == 254, post.hindsight.changes.removed)
    assert (pixels == 205).sum() == pixels.size - (pixels == 0).sum() - (pixels == 254).sum()
    assert meta["origin"] == post.grid.origin_xyyaw.tolist()
    assert grid.resolution_m == post.grid.resolution_m


def test_without_a_map_there_is_no_trajectory_and_no_changed_map(bare, tmp_path):
    page = write_report(bare, tmp_path / "r")

    assert page == tmp_path / "r" / "report.html"
    assert sorted(p.name for p in page.parent.iterdir()) == [
        "junit.xml", "report.html", "report.json"
    ]  # fmt: skip


def test_same_post_mortem_gives_same_bytes_whatever_the_users_style(post, folder, tmp_path):
    import matplotlib as mpl

    with mpl.rc_context({"axes.facecolor": "black", "font.size": 30.0, "lines.linewidth": 9.0}):
        write_report(post, tmp_path / "two")

    names = sorted(p.name for p in folder.iterdir())
    assert names == [
        "changed.pgm", "changed.yaml", "hindsight.tum", "junit.xml", "report.html", "report.json"
    ]  # fmt: skip
    for name in names:
        assert (folder / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_own_report_is_replaced_and_a_foreign_folder_is_not(post, bare, tmp_path):
    write_report(replace(bare, grid=post.grid), tmp_path / "r")
    assert (tmp_path / "r" / "changed.pgm").exists()
    write_report(bare, tmp_path / "r")
    assert not (tmp_path / "r" / "changed.pgm").exists()

    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.tex").write_text("mine")
    with pytest.raises(OutputError, match=r"report\.json"):
        write_report(bare, tmp_path / "thesis")
    assert [p.name for p in (tmp_path / "thesis").iterdir()] == ["chapter.tex"]


class _Page(HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def all(self, name: str) -> list[dict[str, str | None]]:
        return [attributes for tag, attributes in self.tags if tag == name]


def test_page_runs_nothing_loads_nothing_and_escapes_the_log(folder):
    text = (folder / "report.html").read_text(encoding="utf-8")
    page = _Page(text)

    assert not page.all("script")
    assert "&lt;script&gt;alert(1)" in text
    assert "run &lt;1&gt; &amp; 2.mcap" in text
    assert not any(name.startswith("on") for _, found in page.tags for name in found)
    links = [a.get(k) for _, a in page.tags for k in ("src", "href", "srcset") if a.get(k)]
    assert links
    assert all(link.startswith(("data:image/svg+xml,%3Csvg", "#")) for link in links)
    policy = next(m["content"] for m in page.all("meta") if "http-equiv" in m)
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy


def test_pages_own_style_is_the_one_its_policy_allows(bare):
    import base64
    import hashlib

    text = html(bare)
    style = re.search(r"<style>(.*?)</style>", text, re.DOTALL).group(1)
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()

    assert f"&#39;sha256-{digest}&#39;" in text
    assert not any("style" in a for _, a in _Page(text).tags)


def test_page_shows_the_verdict_the_figures_and_what_is_missing(folder, bare):
    text = (folder / "report.html").read_text(encoding="utf-8")
    images = _Page(text).all("img")

    assert len(images) == 4
    assert all(image["alt"] for image in images)
    assert "The robot was lost for 10\N{NO-BREAK SPACE}s." in text
    assert FINDINGS["SR-LOC-001"].misleads in text
    assert "ab" * 32 in text
    assert "baseline 3" in text  # beside the perturbed number
    assert len(text) < 2_000_000
    empty = html(bare)
    assert "No path is known" in empty
    assert "no localizer spoke" in empty
    assert "No imu" in empty


def test_confidence_is_said_with_how_often_it_was_right(post, bare):
    record = Reliability(40, 0, 0.031, (Bin(0.9, 1.0, 0.97, 0.945, 12_000, 38),))
    sure = replace(post, judgement=replace(post.judgement, confidence=0.93), reliability=record)
    unheard = replace(sure, judgement=replace(post.judgement, confidence=0.2))

    page = html(sure)

    page = page.replace("\N{NO-BREAK SPACE}", " ")
    assert "said with 93 % confidence" in page
    assert "94.5 %" in page
    assert "40 simulated logs" in page
    assert "Nothing was ever said with 20 % confidence" in html(unheard).replace(
        "\N{NO-BREAK SPACE}", " "
    )
    assert "What the confidence means" not in html(
        replace(bare, reliability=replace(record, bins=()))
    )


def test_facts_are_numbers_of_the_post_mortem(post, bare):
    belief, world, where = deciding_facts(post)

    assert (belief.number, belief.alarming) == ("1.50 m", True)
    assert "±2 cm" in belief.detail
    assert world.number == "20.0 %"
    assert where.number == "±2 cm"
    assert [f.number for f in deciding_facts(bare)] == ["no belief", "no map", "none"]


def test_junit_fails_on_errors_and_skips_what_could_not_be_asked(post, bare):
    cases = {c.get("name").split()[0]: c for c in ET.fromstring(junit_xml(post)).iter("testcase")}

    assert set(cases) == {*FINDINGS, "OTHER-7"}
    assert cases["SR-LOC-001"].find("failure").get("message") == "off by 1.5 m"
    assert cases["SR-DAT-002"].find("failure") is None
    assert "<script>" in cases["SR-DAT-002"].find("system-out").text
    assert not list(cases["SR-MAP-001"])
    undecided = replace(post, findings=(Finding("SR-CON-003", "info", "too few updates"),))
    cases = {
        c.get("name").split()[0]: c for c in ET.fromstring(junit_xml(undecided)).iter("testcase")
    }
    assert cases["SR-CON-001"].find("skipped").get("message") == "too few updates"
    root = ET.fromstring(junit_xml(bare))
    assert set(root.attrib) == {"name", "time", "tests", "failures", "errors"}  # junit-10.xsd
    suite = root.find("testsuite")
    skipped = {c.get("name").split()[0] for c in suite if c.find("skipped") is not None}
    assert {"SR-LOC-001", "SR-MAP-001", "SR-CON-001"} <= skipped
    assert int(suite.get("skipped")) == len(skipped)
    assert int(suite.get("tests")) == len(suite.findall("testcase"))
    assert suite.get("failures") == "0"


def test_innovations_stand_beside_what_chance_allows(post, bare):
    seen = filters(1, bias=0.04)[0]
    few = replace(seen[1], t_ns=seen[1].t_ns[:9], residual=seen[1].residual[:9], S=seen[1].S[:9])
    few = replace(few, accepted=np.arange(9) % 3 > 0, source="few")
    estimate = Estimate(post.belief, (*seen, few))
    runs = [Run(Trial("b", "ekf", 0), estimate), Run(Trial("b", "ekf", 0, "x", 1.0), estimate)]
    page = innovations(replace(post, trials=tuple(TrialResult(run) for run in runs)))

    rows = [[cell.text for cell in row] for row in page.rows]
    assert [row[:5] for row in rows] == [
        ["ekf", "position", "x", "500", "all"],
        ["ekf", "position", "y", "500", "all"],
        ["ekf", "range", "range", "500", "all"],
        ["ekf", "few", "range", "9", "67 %"],
    ]
    assert rows[2][5:] == ["1.11", "0.02", "3.71 cm"]
    assert [cell.aside for cell in page.rows[2][5:]] == [
        "chance: 0.87 to 1.14",
        "chance: within 0.09",
        "95 %: 2.76 to 4.67",
    ]
    assert page.rows[3][3].aside == "too few to judge"
    assert innovations(post).rows == innovations(bare).rows == ()
    assert "Is what it measures" not in html(post)


def test_a_belief_without_covariance_is_said_to_be_judged_by_its_particles(bare):
    said = "no covariance of the belief, so its own uncertainty cannot be judged"
    assert said in html(bare)
    white = np.random.default_rng(0).standard_normal((60, 2))
    mean = mean_test(white)
    part = PartSummary("position", mean, mean.p_value, None, distribution(white), None)
    summary = ConsistencySummary("survey /truth", "survey", shared=False, at_most="", parts=(part,))
    page = html(replace(bare, consistency=(summary,)))

    assert said not in page
    assert "judged by the particles of the localizer" in page


def test_what_a_run_leaves_undecided_is_no_reason_for_the_robots_own_belief(post):
    of_run = Finding("SR-CON-003", "info", "amcl: too few innovations")
    assert "SR-CON-001" not in not_assessable(replace(post, findings=(of_run,)))


def test_numbers_are_tied_to_their_units():
    tied = bound("from 0.2 s to 3 m, 8 % of 4 more m")

    assert tied.split(" ") == [
        "from",
        "0.2\xa0s",
        "to",
        "3\xa0m,",
        "8\xa0%",
        "of",
        "4",
        "more",
        "m",
    ]


def test_templates_ship_with_the_package():
    folder = Path(SCHEMA_FILE).parent / "templates"

    assert {"report.css", "report.html.j2", "macros.html.j2"} <= {p.name for p in folder.iterdir()}
    assert all(p.name.endswith(".html.j2") for p in (folder / "sections").iterdir())
