"""Checks of what was found: `expect/...`, `forbid/...` and `severity`."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

from slamreplay.bundle.findings import FINDINGS, SEVERITIES, Finding, Severity
from slamreplay.evidence.result import Postmortem
from slamreplay.gate.asked import Asked, asked
from slamreplay.gate.outcome import Outcome
from slamreplay.verdict.judgement import UNDECIDED, Interval

#: So many findings are quoted in one sentence.
_QUOTED = 3


def expected(
    texts: Sequence[str], post: Postmortem, why_not: Mapping[str, str], *, cause: bool
) -> Iterator[Outcome]:
    """One outcome for each entry of `expect`.

    A state is always assessable, for every log has one: who expects a healthy log and is given one
    that cannot be judged is told so by a failure.

    Args:
        texts: the entries.
        post: the post-mortem.
        why_not: findings that could not be looked for, with the reason.
        cause: whether root causes were looked for.
    """
    for text in texts:
        entry, check = asked(text), f"expect/{text}"
        title = f"{_said(entry)} is found"
        if entry.kind == "finding":
            found = [f for f in post.findings if entry.fits(f.id)]
            why = _reason([id_ for id_ in entry.names if id_ in why_not], why_not)
            if found:
                yield _of_finding(check, title, found[0])
            elif all(id_ in why_not for id_ in entry.names):
                yield Outcome(check, title, "skipped", "error", f"could not be looked for: {why}")
            else:
                yield Outcome(check, title, "failed", "error", _found_instead(post))
            continue
        is_, message = _actual(entry, post, cause=cause)
        if is_ is None and entry.kind != "state":
            yield Outcome(check, title, "skipped", "error", message)
        elif is_ is not None and entry.fits(is_):
            yield Outcome(check, title, "passed", "error", message)
        else:
            yield Outcome(check, title, "failed", "error", message)


def forbidden(
    texts: Sequence[str],
    expected_texts: Sequence[str],
    post: Postmortem,
    why_not: Mapping[str, str],
    *,
    cause: bool,
) -> Iterator[Outcome]:
    """One outcome for each finding, state, ... that is forbidden, of a pattern for each it names.

    What is expected by its very name is not forbidden by a pattern.

    Args:
        texts: the entries.
        expected_texts: those of `expect`.
        post: the post-mortem.
        why_not: findings that could not be looked for, with the reason.
        cause: whether root causes were looked for.
    """
    done: set[str] = set()
    for text in texts:
        entry = asked(text)
        names = list(entry.names)
        if entry.kind == "finding":
            names += [f.id for f in post.findings if entry.fits(f.id)]
        for name in dict.fromkeys(names):
            whole = name if entry.kind == "finding" else f"{entry.kind}={name}"
            if whole in done or (entry.is_pattern and whole in expected_texts):
                continue
            done.add(whole)
            one = Asked(whole, entry.kind, name)
            title, check = f"{_said(one)} is not found", f"forbid/{whole}"
            if entry.kind == "finding":
                yield _absent(check, title, name, post, why_not)
                continue
            is_, message = _actual(one, post, cause=cause)
            if is_ == name:
                yield Outcome(check, title, "failed", "error", message)
            else:
                yield Outcome(check, title, "skipped" if is_ is None else "passed", "error",
                              message)  # fmt: skip


def severity(most: Severity, expected_texts: Sequence[str], post: Postmortem) -> Iterator[Outcome]:
    """Whether a finding that nobody expects is worse than it may be.

    Expected are the findings that `expect` names, and those that made a state which it names.
    """
    excused = _excused([asked(text) for text in expected_texts], post)
    title = f"nothing worse than {most}"
    worse = [
        f for f in post.findings
        if SEVERITIES.index(f.severity) > SEVERITIES.index(most) and f.id not in excused
    ]  # fmt: skip
    if worse:
        kinds = list(dict.fromkeys(f.id for f in worse))
        told = [f"{f.id} {f.message}" for f in worse[:_QUOTED]]
        more = f"; and {len(worse) - _QUOTED} more" if len(worse) > _QUOTED else ""
        named = f"{len(kinds)} finding{'s' if len(kinds) > 1 else ''} worse than {most}"
        yield Outcome(
            "severity",
            title,
            "failed",
            worse[0].severity,
            f"{named}: {'; '.join(told)}{more}",
            worse[0].start_ns,
            worse[0].end_ns,
        )
    elif post.judgement.state in UNDECIDED:
        why = f"the log could not be judged: {post.judgement.summary}"
        yield Outcome("severity", title, "skipped", "error", why)
    else:
        count = sum(f.id not in excused for f in post.findings)
        counted = f"{count} findings that nobody expects, none worse than {most}"
        yield Outcome("severity", title, "passed", "error", counted)


def _absent(
    check: str, title: str, id_: str, post: Postmortem, why_not: Mapping[str, str]
) -> Outcome:
    found = [f for f in post.findings if f.id == id_]
    if found:
        more = f" (one of {len(found)})" if len(found) > 1 else ""
        return _of_finding(check, title, found[0], failed=True, more=more)
    if id_ in why_not:
        why = f"could not be looked for: {why_not[id_]}"
        return Outcome(check, title, "skipped", "error", why)
    return Outcome(check, title, "passed", "error", "not found")


def _of_finding(
    check: str, title: str, finding: Finding, *, failed: bool = False, more: str = ""
) -> Outcome:
    """What a finding says, at its time; a failure is a warning at least."""
    grave: Severity = "warning" if failed and finding.severity == "info" else finding.severity
    return Outcome(
        check,
        title,
        "failed" if failed else "passed",
        grave if failed else "error",
        f"{finding.message}{more}",
        finding.start_ns,
        finding.end_ns,
        finding.value,
        None,
        finding.unit,
    )


def _actual(entry: Asked, post: Postmortem, *, cause: bool) -> tuple[str | None, str]:
    """What the log has of a kind, None where it cannot be told, and a sentence."""
    judgement = post.judgement
    undecided = judgement.state in UNDECIDED
    if entry.kind == "state":
        # Whether a log that cannot be judged is in another state nobody knows.
        named = undecided and not entry.fits(judgement.state)
        return None if named else judgement.state, f"{judgement.state}: {judgement.summary}"
    if entry.kind == "failure_mode":
        mode = judgement.failure_mode
        told = "; ".join(mode.evidence) or judgement.summary
        return (None if undecided and mode.kind == "none" else mode.kind), f"{mode.kind}: {told}"
    began = post.root_cause
    if began is None:
        if not cause:
            return None, "root causes were not looked for"
        return (None if undecided else "none"), f"no incident: {judgement.summary}"
    if began.reason or not began.candidates:
        return None, began.reason or "no cause was tried"
    return began.began_as, f"{began.began_as}: {began.candidates[0].text}"


def _excused(entries: Collection[Asked], post: Postmortem) -> set[str]:
    ids = {f.id for f in post.findings for e in entries if e.kind == "finding" and e.fits(f.id)}
    state = post.judgement.state
    if any(e.kind == "state" and e.fits(state) for e in entries):
        for interval in post.judgement.intervals:
            if _made(interval, state):
                ids |= set(interval.findings)
    return ids


def _made(interval: Interval, state: str) -> bool:
    """Whether an interval is of what the log's state says."""
    if state in UNDECIDED:
        return interval.state == state
    lost = interval.is_lost and "lost" in state
    return lost or (interval.is_changed and "map_changed" in state)


def _said(entry: Asked) -> str:
    if entry.kind != "finding":
        return entry.text.replace("=", " ").replace("_", " ", 1)
    known = FINDINGS.get(entry.pattern)
    return entry.text if known is None else f"{entry.text} ({known.title})"


def _reason(ids: Sequence[str], why_not: Mapping[str, str]) -> str:
    return "; ".join(dict.fromkeys(why_not[id_] for id_ in ids))


def _found_instead(post: Postmortem) -> str:
    return f"not found; {post.judgement.state}: {post.judgement.summary}"
