"""The mean NEES of a belief against one source, part by part."""

from __future__ import annotations

from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.evidence.nees_summary import NeesSummary
from slamreplay.consistency.evidence.parts import Part, judged_parts
from slamreplay.consistency.evidence.source import Evidence
from slamreplay.consistency.statistics.mean_test import mean_test


def summaries_of(evidence: Evidence, updates: PoseTrack) -> list[tuple[Part, NeesSummary]]:
    """The mean NEES of each part that is judged, against its interval."""
    return [
        (part, NeesSummary(f"the {part.name}", mean_test(part.white(evidence)),
                           bool(evidence.at_most)))
        for part in judged_parts(evidence, updates)
    ]  # fmt: skip
