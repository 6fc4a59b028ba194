"""gl-code-quality.json."""

import json
from dataclasses import replace

import gated
from ci_rules import code_quality as valid
from hypothesis import given
from hypothesis import strategies as st

from slamreplay.gate.gitlab import code_quality_json


def test_an_entry_for_each_failure():
    entries = valid(code_quality_json(gated.mixed()))

    assert [(e["location"]["path"], e["check_name"], e["severity"]) for e in entries] == [
        ("logs/e.bag", "read", "blocker"),
        ("logs/b c.mcap", "forbid/SR-LOC-001", "critical"),
        ("logs/b c.mcap", "limit/error_max_m", "major"),
    ]
    assert entries[2]["description"] == "what limit/error_max_m demands: 0.61 m, for 3.0 s"


def test_a_fingerprint_outlives_numbers_and_neighbours():
    before = gated.mixed()
    worse = replace(before.logs[1].outcomes[0], message="0.93 m", value=0.93, start_ns=None)
    moved = replace(before.logs[1], log="logs/b c.mcap", outcomes=(worse,), summary="other")
    after = replace(before, recipe="elsewhere.yaml", logs=(moved,))

    (entry,) = valid(code_quality_json(after))

    assert entry["fingerprint"] == valid(code_quality_json(before))[2]["fingerprint"]


def test_absolute_paths_lose_their_slash():
    (entry,) = valid(code_quality_json(gated.result(gated.log("/b/x/../a.mcap", gated.outcome()))))

    assert entry["location"]["path"] == "b/a.mcap"


def test_texts_of_a_log_and_many_of_them():
    valid(code_quality_json(gated.hostile()))
    assert len(valid(code_quality_json(gated.many()))) == 30_000
    assert json.loads(code_quality_json(gated.result())) == []


@given(st.text(st.characters(exclude_categories=()), min_size=1, max_size=30))
def test_any_text_can_be_read_again(text):
    valid(code_quality_json(gated.result(gated.log("a", gated.outcome(text, message=text)))))
