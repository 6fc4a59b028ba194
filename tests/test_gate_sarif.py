"""gate.sarif."""

import gzip
import json
from dataclasses import replace
from urllib.parse import unquote

import gated
import pytest
from ci_rules import sarif as valid
from hypothesis import given
from hypothesis import strategies as st

from slamreplay.bundle.findings import FINDINGS
from slamreplay.gate import sarif
from slamreplay.gate.check_texts import check_texts
from slamreplay.gate.sarif import sarif_text


def test_what_failed_is_a_result_and_nothing_else():
    text = sarif_text(gated.mixed())
    run = valid(text)

    assert text == sarif_text(gated.mixed())
    assert [(x["ruleId"], x["level"], x["message"]["text"]) for x in run["results"]] == [
        ("read", "error", "what read demands: not a log: it ends after 12 bytes"),
        (
            "forbid/SR-LOC-001",
            "error",
            "what forbid/SR-LOC-001 demands: The robot was lost for 12.0 s.",
        ),
        ("limit/error_max_m", "warning", "what limit/error_max_m demands: 0.61 m, for 3.0 s"),
    ]
    where = run["results"][2]["locations"][0]["physicalLocation"]["artifactLocation"]
    assert where == {"uri": "logs/b%20c.mcap", "uriBaseId": "SRCROOT"}
    assert run["results"][2]["properties"] == {
        "value": 0.61, "limit": 0.5, "unit": "m", "span_s": [12.0, 15.5],
    }  # fmt: skip
    assert [rule["id"] for rule in run["tool"]["driver"]["rules"]] == [
        "read", "forbid/SR-LOC-001", "limit/error_max_m", "baseline/error_mean_m",
    ]  # fmt: skip
    (invocation,) = run["invocations"]
    assert (invocation["executionSuccessful"], invocation["exitCode"]) == (False, 2)
    assert [
        (x["level"], x["message"]["text"]) for x in invocation["toolExecutionNotifications"]
    ] == [
        ("error", "what read demands: not a log: it ends after 12 bytes"),
        ("note", "Not assessable in 1 of 4 logs: no baseline of this log"),
        ("note", "Not assessable in 1 of 4 logs: no map"),
    ]
    assert run["automationDetails"]["id"] == "slamreplay-gate/ci/gate.yaml/"


def test_a_gate_that_failed_ran_well():
    (invocation,) = valid(sarif_text(gated.result(gated.log("a", gated.outcome()))))["invocations"]

    assert (invocation["executionSuccessful"], invocation["exitCode"]) == (True, 1)
    assert invocation["toolExecutionNotifications"] == []
    assert valid(sarif_text(gated.result()))["results"] == []


def test_an_alert_is_followed_while_its_numbers_move():
    before = gated.mixed()
    worse = replace(before.logs[1].outcomes[0], message="0.93 m", value=0.93, start_ns=None)
    after = replace(before, logs=(replace(before.logs[1], outcomes=(worse,), report=None),))

    old, new = valid(sarif_text(before))["results"][2], valid(sarif_text(after))["results"][0]

    assert new["partialFingerprints"] == old["partialFingerprints"]
    assert (new["ruleId"], new["locations"]) == (old["ruleId"], old["locations"])


def test_the_least_severe_are_cut_and_counted(monkeypatch):
    run = valid(sarif_text(gated.many()))

    assert {found["level"] for found in run["results"]} == {"error"}
    assert run["properties"]["cut"] == {"results": 25_000, "rules": 0}
    (told,) = run["invocations"][0]["toolExecutionNotifications"]
    assert told["level"] == "warning"
    assert told["message"]["text"].startswith("25000 results and 0 rules were left out")
    monkeypatch.setattr(sarif, "MOST_PACKED_BYTES", 20_000)
    small = sarif_text(gated.many(900))
    cut = json.loads(small)["runs"][0]["properties"]["cut"]["results"]
    assert len(gzip.compress(small.encode(), 1)) <= 20_000
    assert 0 < cut < 900
    assert valid(small)["results"] == valid(sarif_text(gated.many(900)))["results"]


def test_rules_of_results_come_before_others(monkeypatch):
    monkeypatch.setattr(sarif, "MOST_RULES", 2)
    passed = (gated.outcome(f"limit/{k}", "passed") for k in range(3))

    run = valid(sarif_text(gated.result(gated.log("a", *passed, gated.outcome("limit/z")))))

    assert [rule["id"] for rule in run["tool"]["driver"]["rules"]] == ["limit/z", "limit/0"]
    assert run["properties"]["cut"] == {"results": 0, "rules": 2}


def test_texts_of_a_log_are_neither_links_nor_placeholders():
    text = sarif_text(gated.hostile())
    run = valid(text)

    assert "\u202e" not in text
    messages = [found["message"]["text"] for found in run["results"]]
    assert "{{0}} {{name}} [here] (1) 100%25 %0A, a:b: " * 2 in {f"{m}: " for m in messages}
    odd = gated.result(gated.log("a:b?#[%20é.mcap", gated.outcome(value=float("nan"), limit=0.5)))
    (found,) = valid(sarif_text(odd))["results"]
    uri = found["locations"][0]["physicalLocation"]["artifactLocation"]["uri"]
    assert uri == "a%3Ab%3F%23%5B%2520%C3%A9.mcap"
    assert unquote(uri) == odd.logs[0].log
    assert found["properties"] == {"limit": 0.5}


@pytest.mark.parametrize(
    ("path", "uri"), [("/l/a b.mcap", "file:///l/a%20b.mcap"), ("C:/l/a", "file:///C:/l/a")]
)
def test_an_absolute_path_is_of_no_root(path, uri):
    (found,) = valid(sarif_text(gated.result(gated.log(path, gated.outcome()))))["results"]

    assert found["locations"][0]["physicalLocation"]["artifactLocation"] == {"uri": uri}


def test_rules_explain_their_findings():
    told = check_texts("forbid/SR-LOC-001", "")
    assert told.short == f"forbid/SR-LOC-001: {FINDINGS['SR-LOC-001'].title}"
    assert FINDINGS["SR-LOC-001"].misleads in told.text
    assert "**Misleads** " in told.markdown
    every = check_texts("forbid/SR-LOC-*", "No lost robot")
    assert every.short == "No lost robot"
    assert f"SR-LOC-003: {FINDINGS['SR-LOC-003'].title}." in every.text
    assert "limits" in check_texts("limit/error_max_m", "").full
    for check in ("limit/error_max_m", "limit/amcl.error_max_m/2", "baseline/error_max_m"):
        assert "greatest distance of the belief from hindsight" in check_texts(check, "").text
    assert check_texts("of-another-version/x", "").text


def test_a_rule_whose_demand_differs_between_logs_is_named_by_its_kind():
    made = gated.result(
        gated.log("a", gated.outcome(title="at most 0.5 m")),
        gated.log("b", gated.outcome(title="at most 2 m", severity="warning")),
    )

    (rule,) = valid(sarif_text(made))["tool"]["driver"]["rules"]

    assert rule["shortDescription"]["text"].startswith("A number of the log keeps")
    assert rule["defaultConfiguration"]["level"] == "error"


@given(st.text(st.characters(exclude_categories=()), min_size=1, max_size=30))
def test_any_text_can_be_read_again(text):
    check = gated.outcome(text, message=text, title=text, unit=text)

    valid(sarif_text(gated.result(gated.log(text, check), gated.log("b", check, state=text))))
