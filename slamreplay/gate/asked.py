"""What an entry of `expect` or `forbid` names: a finding, a state, how it failed or why."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
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
    """What a text asks for.

    Raises:
        UsageError: it names nothing that there is; the hint has the nearest.
    """
    kind, is_one, name = text.partition("=")
    if not is_one:
        entry = Asked(text, "finding", text)
        if not any(entry.fits(id_) for id_ in FINDINGS) and not _may_be_foreign(text):
            raise UsageError(f"there is no finding {text[:80]!r}", hint=_near(text, FINDINGS))
        return entry
    kinds = [one for one in _NAMES if one != "finding"]
    if kind not in kinds:
        raise UsageError(f"{text[:80]!r} asks for {kind[:40]!r}", hint=nearest(kind, kinds))
    for one in kinds:
        if one == kind:
            entry = Asked(text, one, name)
            if any(entry.fits(known) for known in _NAMES[one]):
                return entry
    said = kind.replace("_", " ")
    raise UsageError(f"there is no {said} {name[:80]!r}", hint=_near(name, _names_of(kind)))


def _names_of(kind: str) -> Sequence[str]:
    return STATES if kind == "state" else FAILURES


def _near(name: str, names: Iterable[str]) -> str:
    """The nearest one; of many not all, but where they are listed."""
    hint = nearest(name.upper() if names is FINDINGS else name, names)
    return "'slamreplay list findings' has them all" if len(hint) > 300 else hint


def _may_be_foreign(id_: str) -> bool:
    """Whether a check of another package may raise it: ours all begin with SR-."""
    return not id_.startswith("SR-") and any(not CHECKS.is_ours(name) for name in CHECKS)
