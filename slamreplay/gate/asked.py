"""What an entry of `expect` or `forbid` names: a finding, a state, how it failed or why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Literal, get_args

from slamreplay.bundle.findings import FINDINGS
from slamreplay.consistency import CHECKS
from slamreplay.errors import UsageError
from slamreplay.registry import nearest
from slamreplay.verdict.judgement import STATES, FailureKind

Kind = Literal["finding", "state", "failure_mode", "root_cause"]

FAILURES: tuple[str, ...] = get_args(FailureKind)
_NAMES: dict[Kind, Sequence[str]] = {
    "finding": tuple(FINDINGS),
    "state": STATES,
    "failure_mode": FAILURES,
    "root_cause": FAILURES,
}
_GLOB = frozenset("*?[")


@dataclass(frozen=True)
class Asked:
    """One entry.

    Attributes:
        text: as it was written.
        kind: of what it names.
        pattern: a name, or a glob pattern of names.
    """

    text: str
    kind: Kind
    pattern: str

    @property
    def is_pattern(self) -> bool:
        """Whether it may name several."""
        return bool(_GLOB & set(self.pattern))

    @property
    def names(self) -> tuple[str, ...]:
        """Those that it names of what we know; a finding of another package stands for itself."""
        found = tuple(name for name in _NAMES[self.kind] if self.fits(name))
        return found or (self.pattern,)

    def fits(self, name: str) -> bool:
        """Whether it names this one."""
        return fnmatchcase(name, self.pattern)


def asked(text: str) -> Asked:
    """What a text asks for, whether or not there is such a thing."""
    kind, is_one, name = text.partition("=")
    for one in _NAMES:
        if is_one and one == kind != "finding":
            return Asked(text, one, name)
    return Asked(text, "finding", text)


def check_asked(text: str) -> None:
    """Refuse a text that names nothing there is.

    Raises:
        UsageError: with the nearest that there is.
    """
    entry = asked(text)
    known = _NAMES[entry.kind]
    kind, is_one, _ = text.partition("=")
    if is_one and entry.kind == "finding":
        kinds = [one for one in _NAMES if one != "finding"]
        raise UsageError(f"{text[:80]!r} asks for {kind[:40]!r}", hint=nearest(kind, kinds))
    if any(entry.fits(name) for name in known) or _may_be_foreign(entry):
        return
    said = entry.kind.replace("_", " ")
    name = entry.pattern.upper() if entry.kind == "finding" else entry.pattern
    hint = nearest(name, known)
    if len(hint) > 300:  # all findings there are would be a page
        hint = "'slamreplay list findings' has them all"
    raise UsageError(f"there is no {said} {entry.pattern[:80]!r}", hint=hint)


def _may_be_foreign(entry: Asked) -> bool:
    """Whether a check of another package may raise it: ours all begin with SR-."""
    if entry.kind != "finding" or entry.pattern.startswith("SR-"):
        return False
    return any(not CHECKS.is_ours(name) for name in CHECKS)
