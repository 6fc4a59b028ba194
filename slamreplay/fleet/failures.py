"""Logs that could not be read or judged."""

from __future__ import annotations

from slamreplay.fleet.answers import Failure
from slamreplay.fleet.counted import Counted


def failures(logs: Counted) -> tuple[Failure, ...]:
    """By site, name and key; those whose site nobody told come last."""
    rows = logs.failed.nonzero()[0].tolist()
    texts = logs.texts
    found = [
        Failure(
            key=texts["key"][k],
            log=texts["log"][k],
            site=texts["site"][k],
            robot=texts["robot"][k],
            error=texts["error"][k] or "",
        )
        for k in rows
    ]
    return tuple(sorted(found, key=lambda f: (f.site is None, f.site or "", f.log, f.key)))
