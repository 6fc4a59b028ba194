"""What a user can say about a log that the log does not say itself."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class IngestOptions:
    """Options of ingest; all of them have a default that looks into the log.

    Attributes:
        map: map_server yaml that was driven on; wins over a map in the log.
        topics: yaml of `role: topic` that wins over our choice.
        robot: namespace of the robot to look at.
        reference: TUM or CSV file with poses that judge (kind survey).
        start_s: leave out what is earlier, s after the log's start.
        end_s: leave out what is later, s after the log's start.
    """

    map: Path | None = None
    topics: Path | None = None
    robot: str | None = None
    reference: Path | None = None
    start_s: float | None = None
    end_s: float | None = None
