"""Jumps as lines of plain text, for the terminal."""

from __future__ import annotations

from collections.abc import Iterator

from slamreplay.consistency.belief.jumps.check import sentence
from slamreplay.evidence.ledger import run_name
from slamreplay.evidence.result import Postmortem


def jump_lines(post: Postmortem) -> Iterator[str]:
    """The largest grave jump of each undisturbed run, what made it, and how many more there are.

    A run that is made to break jumps all the time: that is in the report, and no news here.
    """
    for trial, found in post.jumps:
        grave = [jump for jump in found if trial.perturbation is None and jump.step.is_grave]
        if grave:
            largest = max(grave, key=lambda jump: jump.step.size)
            more = f"; {len(grave) - 1} more in the report" if len(grave) > 1 else ""
            yield f"{run_name(trial)} jumped {sentence(largest, post.manifest.start_ns)}{more}"
