"""JUnit XML of suites of test cases, as Jenkins, GitLab and others read it.

The elements and attributes are those of junit-10.xsd of Jenkins' xUnit plugin, which pytest's own
files follow as well; there is no standard.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal
from xml.etree import ElementTree as ET

from slamreplay.evidence.clean import clean

#: What a case that did not pass has inside, and in which attribute of a suite it is counted.
_COUNTED = {"failure": "failures", "error": "errors", "skipped": "skipped"}


@dataclass(frozen=True)
class Case:
    """One test case.

    Attributes:
        name: within its suite.
        ended: None where it passed.
        type: of the failure or error, a stable id.
        message: of a case that did not pass, one line.
        text: what else there is to say.
    """

    name: str
    ended: Literal["failure", "error", "skipped"] | None = None
    type: str = ""
    message: str = ""
    text: str = ""


@dataclass(frozen=True)
class Suite:
    """The cases of one log; `properties` are shown with them."""

    name: str
    cases: Sequence[Case]
    properties: Mapping[str, str] = field(default_factory=dict)


def junit_text(suites: Iterable[Suite]) -> str:
    """The file. Durations are 0: it does not depend on how fast the machine was."""
    root = ET.Element("testsuites", name="slamreplay")
    totals = dict.fromkeys(("tests", "failures", "errors"), 0)
    for suite in suites:
        element = ET.SubElement(root, "testsuite", name=clean(suite.name))
        counts = dict.fromkeys(("tests", *_COUNTED.values()), 0)
        if suite.properties:
            properties = ET.SubElement(element, "properties")
            for name, value in suite.properties.items():
                ET.SubElement(properties, "property", name=name, value=clean(value))
        for case in suite.cases:
            _add(element, case)
            counts["tests"] += 1
            if case.ended:
                counts[_COUNTED[case.ended]] += 1
        _count(element, counts)
        totals = {key: totals[key] + counts[key] for key in totals}
    _count(root, totals)
    ET.indent(root, " ")
    text = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def _add(suite: ET.Element, case: Case) -> None:
    names = {"classname": suite.attrib["name"], "name": clean(case.name), "time": "0"}
    element = ET.SubElement(suite, "testcase", names)
    if case.ended:
        ended = ET.SubElement(element, case.ended, message=clean(case.message))
        if case.type:
            ended.set("type", case.type)
        ended.text = clean(case.text) or None
    elif case.text:
        ET.SubElement(element, "system-out").text = clean(case.text)


def _count(element: ET.Element, counts: Mapping[str, int]) -> None:
    for key, value in counts.items():
        element.set(key, str(value))
    element.set("time", "0")
