"""junit.xml: one test case per question and log, for any CI that reads JUnit."""

from __future__ import annotations

from slamreplay.bundle.findings import FINDINGS, Finding
from slamreplay.evidence.result import Postmortem
from slamreplay.geometry.times import decimal_seconds
from slamreplay.report.assess import not_assessable, title_of
from slamreplay.report.junit_suites import Case, Suite, junit_text


def junit_xml(post: Postmortem) -> str:
    """One suite for the log: error findings fail, what could not be asked is skipped.

    A warning or info passes and is quoted in the case's output.
    """
    skipped = not_assessable(post)
    name = ", ".join(source.name for source in post.manifest.sources) or post.manifest.bundle_id
    found = [finding.id for finding in post.findings]
    ids = [*FINDINGS, *sorted(set(found) - set(FINDINGS))]
    return junit_text([Suite(name, [_case(id_, post, skipped) for id_ in ids])])


def _case(id_: str, post: Postmortem, skipped: dict[str, str]) -> Case:
    name = f"{id_} {title_of(id_)}"
    answers = [finding for finding in post.findings if finding.id == id_]
    errors = [finding for finding in answers if finding.severity == "error"]
    text = "\n".join(_line(finding, post) for finding in answers)
    if errors:
        return Case(name, "failure", id_, errors[0].message, text)
    if not answers and id_ in skipped:
        return Case(name, "skipped", message=skipped[id_])
    return Case(name, text=text)


def _line(finding: Finding, post: Postmortem) -> str:
    start = post.manifest.start_ns
    times = [t for t in (finding.start_ns, finding.end_ns) if t is not None]
    span = " to ".join(decimal_seconds(int(t) - start)[:-6] for t in times)
    where = f" [{span} s]" if span else ""
    return f"{finding.severity}{where}: {finding.message}"
