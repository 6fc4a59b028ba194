"""gate.sarif: what failed, as SARIF 2.1.0 within what GitHub's code scanning takes.

Only what failed is a result. GitHub makes an alert of every result, whatever its `kind`, so that
one which passed or could not be assessed must not be one; the latter are told as notifications.
Results are cut at 5000, the most that GitHub shows of the 25 000 that it takes (docs.github.com,
"SARIF results exceed one or more limits"), the worst first; how many were cut is told.
"""

from __future__ import annotations

import gzip
import json
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any
from urllib.parse import quote

from slamreplay.bundle.findings import SEVERITIES, Severity
from slamreplay.evidence.clean import clean, one_line, straight
from slamreplay.gate.check_texts import check_texts
from slamreplay.gate.failures import Failure, failures, relative, span_s, told
from slamreplay.gate.outcome import GateResult, Outcome
from slamreplay.version import __version__

SCHEMA = (
    "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
)
MOST_RESULTS = 5_000
MOST_RULES = 25_000
#: Of the file after gzip; it is rejected above 10 MB.
MOST_PACKED_BYTES = 10_000_000
#: Notifications of one kind; no limit of GitHub's, but nobody reads more.
MOST_NOTIFICATIONS = 1_000
_LETTERS = 1_000

_ABSOLUTE = re.compile("/|[A-Za-z]:/")

_LEVEL: dict[Severity, str] = {"error": "error", "warning": "warning", "info": "note"}
_PROBLEM: dict[Severity, str] = {"error": "error", "warning": "warning", "info": "recommendation"}
_NOTIFICATIONS = {
    "unreadable": "A log could not be read.",
    "not-assessable": "A check could not be made on a log.",
    "cut": "Results were left out.",
}


def sarif_text(result: GateResult) -> str:
    """The file's text; the same result gives the same bytes.

    A result lies in its log, which is binary and has no lines; GitHub wants a region all the same
    and is given the first letter. `partialFingerprints` hold log and check, and no number: an
    alert is followed over commits. A log that could not be read makes the run a failed one (SARIF
    3.20.21), and GitHub then leaves all alerts as they were rather than closing what was not
    looked at.
    """
    found = failures(result)
    kept = found[:MOST_RESULTS]
    text = _text(result, found, kept)
    while len(text) > MOST_PACKED_BYTES // 4 and _packed(text) > MOST_PACKED_BYTES and kept:
        kept = kept[: len(kept) * 3 // 4]
        text = _text(result, found, kept)
    return text


def _packed(text: str) -> int:
    # The weakest packing: whoever uploads the file may pack no better.
    return len(gzip.compress(text.encode(), compresslevel=1, mtime=0))


def _text(result: GateResult, found: Sequence[Failure], kept: Sequence[Failure]) -> str:
    rules = _rules(result, kept)
    places = {rule["id"]: index for index, rule in enumerate(rules)}
    checks = {_id(outcome.check) for log in result.logs for outcome in log.outcomes}
    cut = {"results": len(found) - len(kept), "rules": len(checks) - len(rules)}
    invocation = {
        "executionSuccessful": not any(x.outcome.status == "error" for x in found),
        "exitCode": result.exit_code,
        "toolExecutionNotifications": _notifications(result, found, cut, places),
    }
    run = {
        "tool": {
            "driver": {
                "name": "slamreplay",
                "version": __version__,
                "semanticVersion": __version__,
                "rules": rules,
                "notifications": [
                    {"id": id_, "shortDescription": {"text": text}}
                    for id_, text in _NOTIFICATIONS.items()
                ],
            }
        },
        # Two gates of one commit are told apart by this; GitHub refuses a second of the same name.
        "automationDetails": {"id": f"slamreplay-gate/{_uri(result.recipe)}/"},
        "invocations": [invocation],
        "originalUriBaseIds": {"SRCROOT": {"description": {"text": "The root of the repository."}}},
        "columnKind": "unicodeCodePoints",
        "results": [_result(failure, result, places) for failure in kept],
        "properties": {
            "question": one_line(result.question, _LETTERS),
            "logs": dict(Counter(log.status for log in result.single)),
            "cut": cut,
        },
    }
    content = {"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _rules(result: GateResult, kept: Sequence[Failure]) -> list[dict[str, Any]]:
    """Those of the results first, then those of all other checks, as far as there is room."""
    outcomes: dict[str, list[Outcome]] = {_id(failure.outcome.check): [] for failure in kept}
    for log in result.logs:
        for outcome in log.outcomes:
            outcomes.setdefault(_id(outcome.check), []).append(outcome)
    return [_rule(check, of_check) for check, of_check in list(outcomes.items())[:MOST_RULES]]


def _rule(check: str, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    titles = {outcome.title for outcome in outcomes}
    texts = check_texts(check, titles.pop() if len(titles) == 1 else "")
    found: set[Severity] = {"error" if x.status == "error" else x.severity for x in outcomes}
    worst = max(found, key=SEVERITIES.index)
    kind = check.partition("/")[0]
    return {
        "id": check,
        "shortDescription": {"text": texts.short},
        "fullDescription": {"text": texts.full},
        "help": {"text": texts.text, "markdown": texts.markdown},
        "defaultConfiguration": {"level": _LEVEL[worst]},
        "properties": {
            "tags": ["localization", one_line(kind, 50)],
            "problem.severity": _PROBLEM[worst],
        },
    }


def _result(failure: Failure, result: GateResult, places: Mapping[str, int]) -> dict[str, Any]:
    outcome = failure.outcome
    numbers = {"value": outcome.value, "limit": outcome.limit}
    measured: dict[str, Any] = {
        name: value for name, value in numbers.items() if value is not None and math.isfinite(value)
    }
    if outcome.unit:
        measured["unit"] = one_line(outcome.unit, 50)
    if span := span_s(failure.log, outcome):
        measured["span_s"] = [float(second) for second in span]
    id_ = _id(outcome.check)
    where = {"physicalLocation": _place(failure.log.log)}
    recipe = {"id": 1, "message": {"text": "The recipe that demands it."}}
    return {
        "ruleId": id_,
        "ruleIndex": places[id_],
        "level": _LEVEL[failure.severity],
        "message": {"text": _message(told(outcome))},
        "locations": [where],
        "relatedLocations": [{**recipe, "physicalLocation": _place(result.recipe)}],
        # GitHub goes by this name alone; ours is as its own: a hash and how often it has occurred.
        "partialFingerprints": {"primaryLocationLineHash": f"{failure.fingerprint}:{failure.nth}"},
        **({"properties": measured} if measured else {}),
    }


def _notifications(
    result: GateResult, found: Sequence[Failure], cut: Mapping[str, int], places: Mapping[str, int]
) -> list[dict[str, Any]]:
    unread = [failure for failure in found if failure.outcome.status == "error"]
    notes = [
        {
            **_notification("unreadable", "error", told(failure.outcome)),
            "locations": [{"physicalLocation": _place(failure.log.log)}],
        }
        for failure in unread[:MOST_NOTIFICATIONS]
    ]
    if len(unread) > MOST_NOTIFICATIONS:
        more = f"{len(unread) - MOST_NOTIFICATIONS} more logs could not be read."
        notes.append(_notification("unreadable", "error", more))
    if any(cut.values()):
        left_out = (
            f"{cut['results']} results and {cut['rules']} rules were left out, the least severe, "
            f"for GitHub shows {MOST_RESULTS} results of a run: junit.xml has them all."
        )
        notes.append(_notification("cut", "warning", left_out))
    skipped: dict[str, list[Outcome]] = {}
    single = Counter[str]()
    for log in result.logs:
        for outcome in log.outcomes:
            if outcome.status == "skipped":
                skipped.setdefault(_id(outcome.check), []).append(outcome)
                single[_id(outcome.check)] += not log.is_of_all
    for check, outcomes in list(skipped.items())[:MOST_NOTIFICATIONS]:
        where = f" in {single[check]} of {len(result.single)} logs" if single[check] else ""
        why = f"Not assessable{where}: {outcomes[0].message}"
        of_check = _notification("not-assessable", "note", why)
        if check in places:
            of_check["associatedRule"] = {"id": check, "index": places[check]}
        notes.append(of_check)
    return notes


def _notification(id_: str, level: str, text: str) -> dict[str, Any]:
    index = list(_NOTIFICATIONS).index(id_)
    descriptor = {"id": id_, "index": index}
    return {"descriptor": descriptor, "level": level, "message": {"text": _message(text)}}


def _message(text: str) -> str:
    """A plain text message (SARIF 3.11): no placeholder and no link can be in what a log wrote."""
    shown = one_line(text, _LETTERS).replace("{", "{{").replace("}", "}}")
    return shown.replace("](", "] (") or "-"


def _id(check: str) -> str:
    return one_line(check, 200) or "-"


def _place(path: str) -> dict[str, Any]:
    start = {"startLine": 1, "startColumn": 1, "endLine": 1, "endColumn": 1}
    if _ABSOLUTE.match(path):
        where = {"uri": f"file:///{quote(_shown(path.lstrip('/')), safe='/:')}"}
    else:
        where = {"uri": _uri(path), "uriBaseId": "SRCROOT"}
    return {"artifactLocation": where, "region": start}


def _uri(path: str) -> str:
    """A relative reference of RFC 3986: a colon in its first part would make that a scheme."""
    return quote(_shown(relative(path))) or "."


def _shown(path: str) -> str:
    return straight(clean(path))
