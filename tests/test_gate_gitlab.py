"""gl-code-quality.json, by the published rules.

docs.gitlab.com, "Code Quality report format": a JSON array without byte order mark; each entry has
`description`, `check_name`, `fingerprint` (unique to it), `severity` (one of five) and a
`location` with `path` (relative to the repository, without "./") and `lines.begin`.
"""

import json
from dataclasses import replace

import gated
from hypothesis import given
from hypothesis import strategies as st

from slamreplay.gate.gitlab import code_quality_json


def valid(text):
    entries = json.loads(text.encode())
    for entry in entries:
        assert set(entry) == {"description", "check_name", "fingerprint", "severity", "location"}
        for key in ("description", "check_name", "fingerprint"):
            assert entry[key]
            assert isinstance(entry[key], str)
        assert entry["severity"] in ("info", "minor", "major", "critical", "blocker")
        assert set(entry["location"]) == {"path", "lines"}
        assert not entry["location"]["path"].startswith(("./", "/"))
        assert type(entry["location"]["lines"]["begin"]) is int
    assert len({entry["fingerprint"] for entry in entries}) == len(entries)
    return entries


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
