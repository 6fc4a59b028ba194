"""Jumps as lines of plain text, for the terminal."""

from __future__ import annotations

from collections.abc import Iterator

from slamreplay.consistency.belief.jumps.check import sentence
from slamreplay.evidence.ledger import run_name
from slamreplay.evidence.result import Postmortem

#: Jumps of one run that are told here; the report has all.
_JUMPS = 3


def jump_lines(post: Postmortem) -> Iterator[str]:
    """The grave jumps of undisturbed runs, the largest first, and what made them.

    A run that is made to break jumps all the time: that is in the report, and no news here.
    """
    for trial, found in post.jumps:
        if trial.perturbation is not None:
            continue
        grave = sorted((j for j in found if j.step.is_grave), key=lambda j: -j.step.size)
        for jump in grave[:_JUMPS]:
            yield f"{run_name(trial)} jumped {sentence(jump, post.manifest.start_ns)}"
        if len(grave) > _JUMPS:
            more = len(grave) - _JUMPS
            yield f"{run_name(trial)} jumped {more} more time{'s' if more > 1 else ''} as far"
