"""junit.xml of a gate."""

import gated
import pytest
from ci_rules import junit as valid
from hypothesis import given
from hypothesis import strategies as st

from slamreplay.gate.junit import junit_xml
from slamreplay.report.junit_suites import Case, Suite, junit_text


def test_a_case_for_each_check_of_each_log():
    root = valid(junit_xml(gated.mixed()))

    ended = {
        (case.get("classname"), case.get("name").split()[0]): [child.tag for child in case]
        for case in root.iter("testcase")
    }
    assert ended == {
        ("logs/a.mcap", "limit/error_max_m"): ["system-out"],
        ("logs/a.mcap", "forbid/SR-LOC-001"): ["system-out"],
        ("./logs/b c.mcap", "limit/error_max_m"): ["failure"],
        ("./logs/b c.mcap", "forbid/SR-LOC-001"): ["failure"],
        ("./logs/b c.mcap", "baseline/error_mean_m"): ["skipped"],
        ("logs/d", "forbid/SR-LOC-001"): ["skipped"],
        ("logs/e.bag", "read"): ["error"],
    }
    assert [root.get(key) for key in ("tests", "failures", "errors")] == ["7", "2", "1"]
    failure = root.find("testsuite[2]/testcase/failure")
    assert (failure.get("type"), failure.get("message")) == (
        "limit/error_max_m",
        "0.61 m, for 3.0 s",
    )
    assert failure.text.splitlines() == [
        "warning: 0.61 m, for 3.0 s",
        "from 12.000 to 15.500 s of the log",
        "0.61 against 0.5 m",
    ]
    assert root.find("testsuite[3]/testcase/skipped").get("message") == "no map"
    told = {p.get("name"): p.get("value") for p in root.findall("testsuite[1]/properties/property")}
    assert told == {
        "summary": "The robot knew where it was.",
        "recipe": "ci/gate.yaml",
        "state": "tracked",
        "report": "reports/a",
    }


def test_texts_of_a_log_break_nothing():
    text = junit_xml(gated.hostile())
    root = valid(text)

    assert "\u202e" not in text
    messages = [failure.get("message") for failure in root.iter("failure")]
    assert "]]><!-- &amp; <b>\"'</b> -->" in messages
    assert "whole pairs \U0001f916\U0010ffff" in messages
    assert any(message.endswith("... (1000000 letters in all)") for message in messages)
    assert not any("\n" in message for message in messages)


def test_suites_are_cleaned_whoever_makes_them():
    bad = "\x00\ud800"
    case = Case(bad, "failure", "SR-LOC-001", message=bad, text=bad)

    valid(junit_text([Suite(bad, [case, Case("b", text=bad)], {"summary": bad})]))


@given(st.text(st.characters(exclude_categories=()), max_size=40))
def test_any_text_can_be_read_again(text):
    made = gated.result(gated.log(text, gated.outcome(message=text, title=text), summary=text))

    valid(junit_xml(made))


@pytest.mark.parametrize("made", [gated.result(), gated.result(gated.log("a"))])
def test_a_gate_without_logs_or_checks_is_a_file_all_the_same(made):
    assert valid(junit_xml(made)).get("tests") == "0"


def test_thirty_thousand_failures():
    assert valid(junit_xml(gated.many())).get("failures") == "30000"
    assert junit_xml(gated.mixed()) == junit_xml(gated.mixed())
