"""The page as a document: addresses, headings, tables, colours, size, and text nobody can trust."""

import base64
import hashlib
import re
from dataclasses import replace
from importlib.resources import files
from itertools import pairwise
from urllib.parse import unquote

import numpy as np
import pytest
from documents import Document
from posts import bare_post, lost_post

from slamreplay.audit.log_audit import LogAudit
from slamreplay.bundle.findings import Finding
from slamreplay.consistency.audits.inspection import clock_and_frames
from slamreplay.evidence.scene import Scene
from slamreplay.evidence.words import confidence_text
from slamreplay.ingest.pipeline import ingest
from slamreplay.postmortem import postmortem
from slamreplay.report.audit_tables import edges, streams
from slamreplay.report.cells import MOST_ROWS, table
from slamreplay.report.facts import deciding_facts
from slamreplay.report.figures.canvas import FAINT, INK
from slamreplay.report.figures.neutral import DARK_PAPER, dark_of
from slamreplay.report.finding_rows import MOST_FINDINGS
from slamreplay.report.html import html
from slamreplay.report.moments import moment_link
from slamreplay.report.page import page as page_told_of
from slamreplay.report.phrases import percent
from slamreplay.report.print_style import print_style
from slamreplay.report.sections import sections
from slamreplay.testing.synthetic import START_NS, synthetic_bundle

S = 1_000_000_000
NOTHING = Scene((), None, None, np.zeros((3, 2)), (), ())


@pytest.fixture(scope="module")
def posts():
    """A log that went wrong, with a replay and an audit, and one that holds nothing."""
    lost = lost_post()
    audit = clock_and_frames(LogAudit(synthetic_bundle(seconds=5.0).view()))
    return {"lost": replace(lost, scene=NOTHING, audit=audit), "bare": bare_post(lost)}


@pytest.fixture(scope="module")
def pages(posts):
    return {name: Document(html(post)) for name, post in posts.items()}


@pytest.mark.parametrize("name", ["lost", "bare"])
def test_every_address_on_the_page_is_there_once_and_every_tag_is_closed(pages, name):
    page = pages[name]
    ids = page.ids()
    inner = [a["href"][1:] for a in page.all("a") if not a["href"].startswith("#t=")]

    assert not page.unclosed
    assert not page.open
    assert len(ids) == len(set(ids))
    assert {"verdict", "when", "findings", "basis", "ticket"} <= set(ids)
    assert set(inner) <= set(ids)
    named = [a["aria-labelledby"] for _, a, _ in page.tags if "aria-labelledby" in a]
    assert named
    assert set(named) <= set(ids)
    referred = re.findall(r'fill="url\(#([\w-]+)\)"', page.text)
    assert referred
    assert set(referred) <= set(ids)


@pytest.mark.parametrize("name", ["lost", "bare"])
def test_headings_are_in_order_and_landmarks_are_there_once(pages, name):
    page = pages[name]
    levels = [int(tag[1]) for tag, _, _ in page.tags if re.fullmatch(r"h[1-6]", tag)]

    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(below <= above + 1 for above, below in pairwise(levels))
    for landmark in ("header", "main", "footer"):
        assert len(page.all(landmark)) == 1
    assert all(a.get("aria-label") for a in page.all("nav"))
    assert page.all("html")[0]["lang"] == "en"
    assert page.all("a")[0] == {"class": "skip", "href": "#verdict"}


@pytest.mark.parametrize("name", ["lost", "bare"])
def test_pictures_and_tables_say_what_they_are(pages, name):
    page = pages[name]

    assert all(image["alt"].strip() for image in page.all("img"))
    assert all(a.get("aria-label") or a.get("aria-hidden") for a in page.all("svg"))
    assert len(page.all("caption")) == len(page.all("table"))
    assert all(a.get("scope") for a in page.all("th"))
    scrolled = [a for a in page.all("div") if a.get("class", "").startswith("scroll")]
    assert all(a["tabindex"] == "0" and a["aria-label"] for a in scrolled)


def test_contents_name_every_section(pages):
    for page in pages.values():
        sections = [a["id"] for a in page.all("section")]
        bar = re.search(r'<nav class="contents bar".*?</nav>', page.text, re.DOTALL)[0]
        assert re.findall(r'href="#([\w-]+)"', bar) == sections


def test_the_timeline_is_told_in_words(pages):
    told = next(a["aria-label"] for a in pages["lost"].all("svg") if "aria-label" in a)

    assert "Healthy: 0.0 to 10.0 s" in told
    assert "Robot lost: 10.0" in told
    assert "Stop 1 at 12.0 s" in told


def test_times_lead_to_the_replay_where_there_is_one(posts, pages):
    links = {a["href"] for a in pages["lost"].all("a") if a["href"].startswith("#t=")}

    assert {"#t=0", "#t=10", "#t=12", "#t=13"} <= links
    assert moment_link(posts["lost"], START_NS + S // 4) == "#t=0.25"
    assert moment_link(posts["lost"], START_NS - 1) == ""
    assert "#t=" not in pages["bare"].text


def test_a_finding_opens_from_its_address_and_a_state_leads_to_it(pages):
    page = pages["lost"]
    place = next(opened for tag, a, opened in page.tags if a.get("id") == "SR-LOC-001")

    assert place[-1] == "details"  # a browser opens what is around an address, not the address
    assert {"href": "#SR-LOC-001"} in page.all("a")
    assert "finding-OTHER-7" in page.ids()


def test_findings_stand_by_severity_with_counts_and_each_has_an_address_of_its_own(posts):
    ids = ("findings", "h-when", "<b>", "SR-LOC-001", "SR-LOC-001", "")
    odd = [Finding(id_, "info", "m") for id_ in ids]
    many = [Finding("SR-ACT-001", "warning", f"no {k}") for k in range(10_000)]

    page = Document(html(replace(posts["bare"], findings=(*many, *odd))))

    ids = page.ids()
    assert len(ids) == len(set(ids))
    assert "10,000 warnings" in page.text
    assert f"{10_000 - MOST_FINDINGS:,} more in report.json" in page.text
    assert "6 notes" in page.text
    assert "SR-LOC-001-2" in ids
    assert len(page.text) < 1_000_000


def test_nothing_on_the_page_runs_loads_or_styles_inline(pages):
    for page in pages.values():
        for tag, attributes, _ in page.tags:
            assert tag not in ("iframe", "object", "embed", "base", "form", "link")
            assert not any(n == "style" or n.startswith("on") for n in attributes), attributes
            for name in ("src", "srcset", "href", "action", "poster", "data"):
                assert attributes.get(name, "#").startswith(("#", "data:image/svg+xml,"))
        policy = next(a["content"] for a in page.all("meta") if "http-equiv" in a)
        assert policy.startswith("default-src 'none'; img-src data:; style-src 'sha256-")
        assert "unsafe" not in policy
        styles = re.findall(r"<style>(.*?)</style>", page.text, re.DOTALL)
        for style in styles:
            digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
            assert f"'sha256-{digest}'" in policy
            assert not re.search(r"@import|https?:|url\((?!#)", style)


def test_a_fact_without_a_number_has_no_label_of_one(posts):
    for post in posts.values():
        facts = deciding_facts(post)
        labels = re.findall(r"<li[^>]*><strong>[^<]*</strong>(<em>)?", html(post))
        assert [bool(label) for label in labels] == [fact.is_known for fact in facts]
    assert not all(fact.is_known for fact in deciding_facts(posts["bare"]))


def test_what_was_counted_may_be_all_of_it_and_no_belief_is_certain():
    assert (percent(1.0), confidence_text(1.0)) == ("100 %", "99 %")
    assert confidence_text(None) == "not known"


def test_page_of_a_short_log_is_light(pages):
    assert len(pages["lost"].text.encode()) < 600_000
    assert len(pages["bare"].text.encode()) < 150_000


# Colours. WCAG 2.2, success criterion 1.4.3 and the definition of contrast ratio.


def schemes():
    style = files("slamreplay.report").joinpath("templates/report.css").read_text("utf-8")
    light, dark = re.findall(r":root \{(.*?)\}", style, re.DOTALL)[:2]
    told = [dict(re.findall(r"--([\w]+): (#[0-9a-f]{6})", text)) for text in (light, dark)]
    return {"light": told[0], "dark": {**told[0], **told[1]}}


def contrast(one: str, other: str) -> float:
    def luminance(colour):
        rgb = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
        rgb = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
        return float(rgb @ (0.2126, 0.7152, 0.0722)) + 0.05

    bright, dim = sorted((luminance(one), luminance(other)), reverse=True)
    return bright / dim


def test_contrast_is_that_of_the_standard():
    assert contrast("#ffffff", "#000000") == pytest.approx(21.0)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.005)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out_from_its_ground(scheme):
    colours = schemes()[scheme]
    text = ("ink", "soft", "link", "lost", "healthy", "map_changed", "both", "unobservable",
            "insufficient_data")  # fmt: skip

    low = {
        (name, ground): contrast(colours[name], colours[ground])
        for name in text
        for ground in ("paper", "card")
        if contrast(colours[name], colours[ground]) < 4.5
    }

    assert not low
    assert contrast(colours["paper"], colours["lost"]) >= 4.5  # a filled label
    assert contrast(colours["ink"], colours["rule"]) >= 4.5  # a count in the contents
    assert contrast(colours["edge"], colours["paper"]) >= 3.0


def test_text_of_figures_stands_out_on_both_papers():
    dark = "#" + "".join(f"{int(v):02x}" for v in DARK_PAPER)

    assert dark == schemes()["dark"]["card"]
    for colour in (INK, FAINT):
        assert contrast(colour, "#ffffff") >= 4.5
        assert contrast(dark_of(colour), dark) >= 4.5


# Text from a log.

EVIL = '"><script>alert(1)</script><img src=x onerror=alert(2)>\u202egnp.\u2066 \x07 ]]> {{ 7*7 }} '


def hostile_post(logs, tmp_path):
    """The post-mortem of a log whose topics, frames and lines were named by an enemy."""
    evil = EVIL.replace("\x07", "")
    messages = []
    for k in range(60):
        t_ns = START_NS + k * S // 10
        stamp = {"header__stamp__sec": t_ns // S, "header__stamp__nanosec": t_ns % S}
        odom = logs.make("nav_msgs/msg/Odometry", **stamp, header__frame_id=f"odom{evil}",
                         child_frame_id=f"base{evil}",
                         pose__pose__orientation__w=1.0)  # fmt: skip
        pose = logs.make("geometry_msgs/msg/PoseWithCovarianceStamped", **stamp,
                         header__frame_id=f"map{evil}", pose__pose__orientation__w=1.0,
                         pose__pose__position__x=0.1 * k)  # fmt: skip
        line = logs.make("rcl_interfaces/msg/Log", level=40, name=f"amcl{EVIL}", msg=EVIL * 40,
                         stamp__sec=t_ns // S, stamp__nanosec=t_ns % S)  # fmt: skip
        messages += [
            (f"/odom{evil}", "nav_msgs/msg/Odometry", odom, t_ns),
            (f"/amcl_pose{evil}", "geometry_msgs/msg/PoseWithCovarianceStamped", pose, t_ns),
            ("/rosout", "rcl_interfaces/msg/Log", line, t_ns),
        ]
    log = logs.write("run.mcap", messages)
    named = log.with_name("a<b onload=x>\u202e&'.mcap")
    log.rename(named)
    return postmortem(ingest([named], tmp_path / "b"))


def test_what_an_enemy_wrote_into_a_log_is_text_on_the_page(logs, tmp_path):
    hostile = hostile_post(logs, tmp_path)
    odd = Finding(EVIL, "error", EVIL * 300, unit=EVIL, value=1.0)
    page = Document(html(replace(hostile, findings=(*hostile.findings, odd))))

    assert "&lt;script&gt;alert(1)" in page.text
    assert not page.unclosed
    bodies = re.findall(r"<script[^>]*>(.*?)</script>", page.text, re.DOTALL)
    assert len(bodies) == len(page.all("script"))  # none but the replay's data and its program
    assert not any("alert(" in body for body in bodies)
    assert not any(n.startswith("on") for _, a, _ in page.tags for n in a)
    assert "49 " not in page.text.split("]]&gt; ")[1][:10]  # not a template of ours either
    assert not re.search("[\x07\u202e\u2066]", page.text)
    assert "[U+202E]gnp." in page.text  # it cannot turn what stands around it
    for image in page.all("img", "source"):
        svg = unquote(image.get("src") or image["srcset"])
        assert "<script" not in svg
        assert " onerror=alert" not in re.sub(r">[^<]*<", "><", svg)  # outside its text
    ids = page.ids()
    assert len(ids) == len(set(ids))
    assert all(re.fullmatch(r"[\w.-]+", name) for name in ids)


def test_the_name_in_the_margin_is_one_string():
    style = print_style('x"}*{display:none}</style>\\\n\x00é')

    assert style.count('"') == print_style("plain").count('"')
    assert "</style" not in style
    assert "\\22 \\7d " in style
    assert "..." in print_style("long" * 50)


def test_the_audit_tells_rates_gaps_and_delays_of_each_stream_and_edge(posts):
    lost = posts["lost"]
    gap = {"start_ns": START_NS + 2 * S, "end_ns": START_NS + 5 * S, "missing": 29}
    audit = {**lost.audit, "clock": {**lost.audit["clock"]}}
    first, *others = audit["clock"]["topics"]
    audit["clock"]["topics"] = [
        {**first, "gap_count": 2, "gaps": [gap], "missing": 31, "backward_stamps": 3,
         "jumps": [{"seconds": -0.2}], "log_minus_stamp_median_s": 0.0123, "drift_ppm": 40.2},
        *others,
    ]  # fmt: skip
    found = streams(replace(lost, audit=audit))
    row = [(cell.text, cell.aside) for cell in found.rows[0]]

    assert row[0][0] == first["topic"]
    assert row[3] == ("2, up to 3.00 s", "31 messages missing")
    assert found.rows[0][3].links == (("2, up to 3.00 s", "#t=2"),)
    assert row[4][0] == "12.3 ms"
    assert row[5][0] == "+40 ppm"
    assert row[6][0] == "a jump of -0.200 s, 3 go back"
    pairs = [cells[0].text for cells in edges(lost).rows]
    assert "odom \N{RIGHTWARDS ARROW} base_link" in pairs
    assert streams(posts["bare"]).rows == edges(posts["bare"]).rows == ()
    assert postmortem(synthetic_bundle(seconds=4.0)).audit["frames"]["base"] == "base_link"


def test_contents_count_what_tables_leave_to_a_file():
    told = page_told_of(lost_post())
    many = table(("when", "how far"), [["1 s", "2 m"]] * (MOST_ROWS + 7))
    every = sections(replace(told, jumps=many, stops=many), {"reliability": None})

    counts = {section.anchor: section.count for section in every}
    assert counts["jumps"] == counts["stops"] == MOST_ROWS + 7
