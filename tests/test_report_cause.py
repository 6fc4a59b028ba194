"""The root cause in report.json, on the page and behind its option."""

from __future__ import annotations

import json
from dataclasses import replace

import jsonschema
import pytest

from slamreplay.postmortem import postmortem
from slamreplay.report.build import build
from slamreplay.report.cause_table import cause_note, causes
from slamreplay.report.html import html
from slamreplay.report.model import schema_text
from slamreplay.testing.synthetic import synthetic_bundle


@pytest.fixture(scope="module")
def post():
    """A belief that jumps while scans, odometry and map are as they should be."""
    return postmortem(
        synthetic_bundle(seconds=20.0, belief_offset_xyyaw=(1.5, 0.5, 0.1), offset_from_s=8.0)
    )


def test_report_json_has_the_candidates_and_the_mode_follows(post):
    content = json.loads(build(post).json_text())
    cause = content["root_cause"]

    jsonschema.validate(content, json.loads(schema_text()))
    assert cause["trials"] > 5
    probabilities = [c["probability"] for c in cause["candidates"]]
    assert probabilities == sorted(probabilities, reverse=True)
    assert sum(probabilities) == pytest.approx(1.0)
    assert content["failure_mode"]["kind"] == cause["began_as"]
    assert content["failure_mode"]["confidence"] == cause["probability"]


def test_the_page_ranks_what_was_tried(post):
    rows = causes(post).rows

    assert len(rows) == len(post.root_cause.candidates)
    assert "What it began with" in html(post)
    assert f"{post.root_cause.trials} times in all" in cause_note(post)


def test_nothing_is_replayed_where_nobody_asks(post, monkeypatch):
    monkeypatch.setattr("slamreplay.postmortem.root_cause", None)  # to call it would fail
    plain = postmortem(synthetic_bundle(seconds=4.0), cause=False)

    assert build(plain).root_cause is None
    assert "What it began with" not in html(plain)


def test_why_nothing_was_replayed_stands_on_the_page(post):
    cause = replace(post.root_cause, trials=0, reason="its scans fit nowhere in this map")

    told = cause_note(replace(post, root_cause=cause))

    assert told.startswith("Nothing was replayed: its scans fit nowhere")
    assert not causes(replace(post, root_cause=cause)).rows
