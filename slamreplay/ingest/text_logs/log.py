"""What reading a text log gives: rows of the bundle's tables, as decoders give them."""

from __future__ import annotations

from dataclasses import dataclass

from slamreplay.bundle.manifest import Loss, Source
from slamreplay.ingest.rows import TopicRows


@dataclass(frozen=True, eq=False)
class TextLog:
    """A log that was written as lines of text.

    Attributes:
        sources: the files it was read from.
        topics: rows of all kinds of lines, ordered by log time.
        losses: what was skipped, lost or mended.
    """

    sources: tuple[Source, ...]
    topics: list[TopicRows]
    losses: list[Loss]
