"""junit.xml: one test case per question and log, for any CI that reads JUnit."""

from __future__ import annotations

from xml.etree import ElementTree as ET

from slamreplay.bundle.findings import FINDINGS, Finding
from slamreplay.evidence.clean import clean
from slamreplay.evidence.result import Postmortem
from slamreplay.geometry.times import decimal_seconds
from slamreplay.report.assess import not_assessable, title_of


def junit_xml(post: Postmortem) -> str:
    """One suite for the log: error findings fail, what could not be asked is skipped.

    A warning or info passes and is quoted in the case's output. Durations are 0: the report does
    not depend on how fast the machine was.
    """
    skipped = not_assessable(post)
    name = ", ".join(source.name for source in post.manifest.sources) or post.manifest.bundle_id
    found = [finding.id for finding in post.findings]
    ids = [*FINDINGS, *sorted(set(found) - set(FINDINGS))]
    suite = ET.Element("testsuite", name=clean(name))
    failures = 0
    for id_ in ids:
        case = ET.SubElement(
            suite, "testcase", classname=clean(name), name=f"{id_} {title_of(id_)}", time="0"
        )
        answers = [finding for finding in post.findings if finding.id == id_]
        errors = [finding for finding in answers if finding.severity == "error"]
        if errors:
            failures += 1
            failure = ET.SubElement(case, "failure", type=id_, message=clean(errors[0].message))
            failure.text = "\n".join(_line(finding, post) for finding in answers)
        elif answers:
            out = ET.SubElement(case, "system-out")
            out.text = "\n".join(_line(finding, post) for finding in answers)
        elif id_ in skipped:
            ET.SubElement(case, "skipped", message=clean(skipped[id_]))
    counts = {
        "tests": str(len(ids)),
        "failures": str(failures),
        "errors": "0",
        "skipped": str(len(suite.findall("testcase/skipped"))),
        "time": "0",
    }
    for key, value in counts.items():
        suite.set(key, value)
    root = ET.Element("testsuites", {"name": "slamreplay", **counts})
    root.append(suite)
    ET.indent(root, " ")
    text = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def _line(finding: Finding, post: Postmortem) -> str:
    start = post.manifest.start_ns
    times = [t for t in (finding.start_ns, finding.end_ns) if t is not None]
    span = " to ".join(decimal_seconds(int(t) - start)[:-6] for t in times)
    where = f" [{span} s]" if span else ""
    return clean(f"{finding.severity}{where}: {finding.message}")
