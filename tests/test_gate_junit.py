"""junit.xml of a gate, by the rules of junit-10.xsd of Jenkins' xUnit plugin.

No package that is at hand carries that schema (pytest's junitxml.py only links to it), so its rules
stand here as assertions. GitLab's own: files below 30 MB, of two cases of one name the second is
dropped.
"""

import re
from xml.etree import ElementTree as ET

import gated
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slamreplay.gate.junit import junit_xml
from slamreplay.report.junit_suites import Case, Suite, junit_text

# xunit-plugin, src/main/resources/org/jenkinsci/plugins/xunit/types/model/xsd/junit-10.xsd:
# attributes (required, optional) and children of each element that is written here.
JUNIT_10 = {
    "testsuites": ("", "name time tests failures errors", "testsuite"),
    "testsuite": (
        "name tests failures errors",
        "group time skipped timestamp hostname id package file log url",
        "testsuite properties testcase system-out system-err",
    ),
    "properties": ("", "", "property"),
    "property": ("name value", "", ""),
    "testcase": (
        "name",
        "time classname group",
        "skipped error failure system-out system-err",  # and reruns, which there are none of
    ),
    "failure": ("", "type message", ""),
    "error": ("", "type message", ""),
    "skipped": ("", "type message", ""),
    "system-out": ("", "", ""),
}
SUREFIRE_TIME = r"(([0-9]{0,3},)*[0-9]{3}|[0-9]{0,3})*(\.[0-9]*)?"


def valid(text):
    """The root of a file that keeps the schema, and whose counts are right."""
    root = ET.fromstring(text.encode())  # bytes, as CI reads it
    assert root.tag == "testsuites"
    for element in root.iter():
        required, optional, children = (words.split() for words in JUNIT_10[element.tag])
        assert set(required) <= set(element.attrib) <= {*required, *optional}, element.tag
        assert {child.tag for child in element} <= set(children), element.tag
        if "time" in element.attrib and element.tag != "testcase":
            assert re.fullmatch(SUREFIRE_TIME, element.get("time"))
    counted = {"failures": "failure", "errors": "error", "skipped": "skipped", "tests": None}
    for element in (root, *root):
        for key in set(counted) & set(element.attrib):
            cases = list(element.iter("testcase"))
            tag = counted[key]
            assert int(element.get(key)) == sum(
                tag is None or c.find(tag) is not None for c in cases
            )
    names = [(case.get("classname"), case.get("name")) for case in root.iter("testcase")]
    assert len(set(names)) == len(names)
    assert len(text.encode()) < 30_000_000
    return root


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
    made = gated.many()

    text = junit_xml(made)

    assert valid(text).get("failures") == "30000"
    assert text == junit_xml(made)
