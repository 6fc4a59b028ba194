"""What a check is, for the catalogue of rules that SARIF files carry."""

from __future__ import annotations

import re
from dataclasses import dataclass
from fnmatch import fnmatchcase

from slamreplay.bundle.findings import FINDINGS
from slamreplay.evidence.clean import as_markdown, one_line
from slamreplay.gate.metrics import METRICS

#: GitHub takes 1024 letters of a description.
_LETTERS = 1_000

#: By the first part of a check's id: what it demands; and where to look when it fails.
_DEMANDS = {
    "read": "The log can be read.",
    "expect": "What the recipe expects of the log was found.",
    "forbid": "What the recipe forbids was not found in the log.",
    "assessable": "Something of the log can be assessed.",
    "severity": "No finding that nobody expects is worse than the recipe allows.",
    "limit": "A number of the log keeps the recipe's limit.",
    "baseline": "A number is no worse than in the baseline, by more than chance.",
}
_MENDING = {
    "read": "A log that cannot be read is judged by no other check. Look at the message: the file "
    "may be missing, cut off, or a pointer of Git LFS.",
    "expect": "The recipe lists it under `expect`. Where the log rightly no longer shows it, take "
    "it out of the list.",
    "forbid": "The recipe lists it under `forbid`. Open the log's report for the evidence.",
    "assessable": "A gate that can assess nothing would pass on nothing. Look at what each check "
    "says it lacks: a map, scans, a localizer.",
    "severity": "The recipe's `max_severity` says how bad a finding may be. A finding that is "
    "right for this log belongs under `expect`.",
    "limit": "The recipe lists it under `limits`. Open the log's report for the number over time.",
    "baseline": "The baseline is a file of earlier numbers. Where the change is wanted, commit the "
    "baseline that the gate has written.",
}


@dataclass(frozen=True)
class CheckTexts:
    """Texts of a rule: two short ones, and help as plain text and as Markdown."""

    short: str
    full: str
    text: str
    markdown: str


def check_texts(check: str, title: str) -> CheckTexts:
    """The texts of one check.

    Args:
        check: its id.
        title: what it demands; empty where logs differ in it.
    """
    kind, _, about = check.partition("/")
    demand = _DEMANDS.get(kind, "A check of the gate.")
    mending = _MENDING.get(kind, "The recipe demands it.")
    named = f"{demand.rstrip('.')}: {about}." if about else demand
    ids = [id_ for id_ in FINDINGS if fnmatchcase(id_, about)] if about else []
    explained = FINDINGS[ids[0]] if len(ids) == 1 else None
    short = one_line(title or (f"{check}: {explained.title}" if explained else named), _LETTERS)
    sections = [("", named), ("", mending)]
    if explained is not None:
        sections += [
            (ids[0], f"{explained.title}."),
            ("Asks", explained.asks),
            ("Method", explained.method),
            ("Misleads", explained.misleads),
        ]
    elif ids:
        sections += [(id_, f"{FINDINGS[id_].title}.") for id_ in ids]
    sections += [
        (name, f"{METRICS[name].doc}; {METRICS[name].unit or 'without a unit'}.")
        for name in re.split("[/.]", about)
        if name in METRICS
    ]
    told = [(name, one_line(text, 4 * _LETTERS)) for name, text in sections]
    plain = "\n\n".join(f"{name}: {text}" if name else text for name, text in told)
    marked = "\n\n".join(
        f"**{name}** {as_markdown(text)}" if name else as_markdown(text) for name, text in told
    )
    return CheckTexts(short, one_line(f"{named} {mending}", _LETTERS), plain, marked)
