"""GitLab's code quality report: what failed, for the widget of a merge request.

The format is that of docs.gitlab.com, "Code Quality report format": a JSON list whose entries have
a description, a check name, a fingerprint of their own, a severity and a place.
"""

from __future__ import annotations

import json

from slamreplay.bundle.findings import Severity
from slamreplay.evidence.clean import clean, one_line, straight
from slamreplay.gate.failures import Failure, failures, relative, told
from slamreplay.gate.outcome import GateResult

_SEVERITY: dict[Severity, str] = {"error": "critical", "warning": "major", "info": "minor"}
_LETTERS = 1_000


def code_quality_json(result: GateResult) -> str:
    """The file's text; the same result gives the same bytes.

    One entry for each check that failed and each log that could not be read (a `blocker`), worst
    first. GitLab compares two of these files by fingerprint: an entry that is only in the older
    one counts as mended, so a check that the newer log does not let be assessed does, too.
    """
    entries = [_entry(failure) for failure in failures(result)]
    return json.dumps(entries, indent=1, ensure_ascii=False) + "\n"


def _entry(failure: Failure) -> dict[str, object]:
    outcome = failure.outcome
    unreadable = outcome.status == "error"
    return {
        "description": one_line(told(outcome), _LETTERS),
        "check_name": one_line(outcome.check, _LETTERS),
        "fingerprint": failure.fingerprint,
        "severity": "blocker" if unreadable else _SEVERITY[failure.severity],
        # A log has no lines; GitLab wants one.
        "location": {"path": straight(clean(relative(failure.log.log))), "lines": {"begin": 1}},
    }
