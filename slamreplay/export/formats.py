"""The formats of an export, what each needs, and what is told when it is done.

Light on purpose: the command line asks it before anything heavy is loaded.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from importlib.util import find_spec
from typing import Any

from slamreplay.errors import UsageError

#: By which an exported folder is known.
MARKER = "export.json"


class Format(StrEnum):
    """What can be written."""

    TUM = "tum"
    CSV = "csv"
    MCAP = "mcap"
    RERUN = "rerun"
    RVIZ = "rviz"


class Only(StrEnum):
    """Halves of an export: what the robot recorded, and what was found in it."""

    RECORDED = "recorded"
    ANALYSIS = "analysis"


@dataclass(frozen=True)
class Needs:
    """What a format is made of: `recorded` evidence, the `analysis` of it, or both."""

    recorded: bool
    analysis: bool


_OF_FORMAT = {
    Format.TUM: Needs(recorded=True, analysis=False),
    Format.CSV: Needs(recorded=True, analysis=True),
    Format.MCAP: Needs(recorded=True, analysis=True),
    Format.RERUN: Needs(recorded=False, analysis=True),
    Format.RVIZ: Needs(recorded=False, analysis=True),
}


@dataclass(frozen=True)
class NotAsRecorded:
    """Something of the log that the format has no place for, or tells in another way."""

    what: str
    count: int
    reason: str


@dataclass(frozen=True)
class Written:
    """What came of it: `head` is export.json, whose files are relative to the folder."""

    head: dict[str, Any]
    not_as_recorded: tuple[NotAsRecorded, ...]

    @property
    def files(self) -> list[str]:
        """Names of the files, sorted."""
        return list(self.head["files"])


def needs(to: Format, only: Only | None, *, covariance: bool = False) -> Needs:
    """What is written in a format, of which maybe only one half is asked for.

    Raises:
        UsageError: an option that the format has no use for, or a library that is not there.
    """
    both = _OF_FORMAT[to]
    if only is not None and not (both.recorded and both.analysis):
        raise UsageError(f"--to {to} takes no --only", hint="--to mcap and --to csv do")
    if covariance and to is not Format.TUM:
        raise UsageError(f"--to {to} takes no --covariance", hint="--to tum does")
    if to is Format.RERUN and find_spec("rerun") is None:
        raise UsageError("rerun is not installed", hint="the extra slamreplay[rerun] has it")
    if only is None:
        return both
    return Needs(only is Only.RECORDED, only is Only.ANALYSIS)
