"""`report --figures`: each panel as PNG and SVG that say which log they are of, and captions."""

import json
import re
from dataclasses import replace
from xml.etree import ElementTree as ET

import pytest
from matplotlib.figure import Figure
from PIL import Image

from slamreplay.bundle.manifest import Source
from slamreplay.postmortem import postmortem
from slamreplay.report.figure_files import write_figures
from slamreplay.report.figures import canvas
from slamreplay.report.figures.panels import PANELS, caption
from slamreplay.report.figures.written import wrapped
from slamreplay.rootcause.result import Candidate, RootCause
from slamreplay.testing.synthetic import synthetic_bundle

HOSTILE = "a<b>&\"'_*`$x^2$\x00\x1b[31m.mcap"


@pytest.fixture(scope="module")
def post():
    bundle = synthetic_bundle(seconds=8.0, belief_offset_xyyaw=(1.5, 0.5, 0.1), offset_from_s=3.0)
    found = postmortem(bundle, cause=False)
    source = Source(name=HOSTILE, format="mcap", bytes=7, sha256="ab" * 32)
    start = bundle.manifest.start_ns
    candidates = tuple(
        Candidate(kind, name, 1.5, "m", start, -3.0, share, "it did so")
        for kind, name, share in (
            ("wrong_initial_pose", "initial_pose.offset", 0.97),
            ("none", None, 0.03),
        )
    )
    cause = RootCause(start, bundle.manifest.end_ns, candidates[0].kind, 0.97, candidates, 4)
    manifest = bundle.manifest.model_copy(update={"sources": [source]})
    return replace(found, root_cause=cause, manifest=manifest)


@pytest.fixture(scope="module")
def folder(post, tmp_path_factory):
    target = tmp_path_factory.mktemp("figures") / "f"
    write_figures(post, target)
    return target


def test_every_panel_the_log_has_is_written_in_both_formats(post, folder):
    drawn = [name for name, panel in PANELS.items() if panel.parts(post)]

    assert drawn == ["map", "course", "root_cause", "covariance", "consistency", "reliability"]
    assert {p.name for p in folder.iterdir()} == {
        "captions.md",
        "figures.json",
        *(f"{name}.{kind}" for name in drawn for kind in ("png", "svg")),
    }
    listed = json.loads((folder / "figures.json").read_text("utf-8"))
    assert [one["name"] for one in listed["figures"]] == drawn
    assert listed["bundle"] == post.manifest.bundle_id


@pytest.mark.parametrize("name", ["map", "course", "covariance", "root_cause"])
def test_pictures_carry_title_and_caption_and_no_date(post, folder, name):
    panel = PANELS[name]
    told = caption(panel, post)

    with Image.open(folder / f"{name}.png") as picture:
        assert picture.text["Title"] == panel.title
        assert picture.text["Description"] == told
        assert picture.info["dpi"] == pytest.approx((300, 300), abs=0.1)
        assert picture.width == pytest.approx(300 * panel.width_in, abs=1)
        assert set(picture.text) == {"Title", "Description", "Software"}
    text = (folder / f"{name}.svg").read_text("utf-8")
    title, desc = list(ET.fromstring(text))[:2]
    assert title.text == panel.title
    assert desc.text == told
    assert not re.search(r"<dc:date>|\d{4}-\d\d-\d\dT", text)


def test_caption_names_log_bundle_and_numbers(post):
    told = caption(PANELS["covariance"], post)

    assert "Log a<b>&\"'_*`$x^2$\ufffd\ufffd[31m.mcap" in told
    assert post.manifest.bundle_id in told
    assert re.search(r"\(n = \d+, n_eff = [\d.]+\), 3 expected", told)
    assert "simulation" in told
    assert "\n" not in told
    assert "1.59 m apart at worst" in caption(PANELS["map"], post)
    assert "Verdict: robot lost" in caption(PANELS["map"], post)


def test_names_from_the_log_are_no_markup(folder):
    text = (folder / "captions.md").read_text("utf-8")

    assert "a\\<b\\>\\&\"'\\_\\*\\`\\$x^2\\$" in text
    assert "<b>" not in text


def test_same_input_same_bytes(post, folder, tmp_path, monkeypatch):
    some = {name: PANELS[name] for name in ("root_cause", "consistency")}
    monkeypatch.setattr("slamreplay.report.figure_files.PANELS", some)
    *pictures, _ = write_figures(post, tmp_path / "g")

    assert len(pictures) == 4
    for again in pictures:
        assert again.read_bytes() == (folder / again.name).read_bytes(), again.name


def test_each_part_is_drawn_in_anybodys_axes(post):
    for panel in PANELS.values():
        for part in panel.parts(post):
            axes = Figure().add_subplot()
            handles = part.draw(axes, 8.0)
            assert axes.has_data(), part.name
            assert handles, part.name
            assert "[" in axes.get_xlabel(), part.name


def test_a_log_without_anything_has_no_figure_but_what_confidence_means(tmp_path):
    bare = postmortem(synthetic_bundle(seconds=2.0, with_map=False), cause=False)
    nothing = replace(
        bare, belief=None, hindsight=None, odometry=None, nees=None, consistency=(), grid=None
    )

    files = write_figures(nothing, tmp_path / "f")

    assert [p.name for p in files] == ["reliability.png", "reliability.svg", "captions.md"]


def test_words_are_wrapped_and_long_ones_cut():
    assert wrapped("ab cd efghijk", 5, len) == ["ab cd", "efghi", "jk"]
    assert wrapped("", 5, len) == []


def test_text_is_smaller_on_narrow_paper():
    assert canvas.text_size(canvas.COLUMN) == canvas.text_size(canvas.PAGE) == 8.0
    assert canvas.text_size(canvas.WIDE) == 9.5
