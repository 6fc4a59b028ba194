"""What a bundle says about itself: sources, roles with reasons, clock, frames, losses, hashes."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict

from slamreplay.bundle.schema import FORMAT_VERSION
from slamreplay.geometry.times import Times


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Source(_Strict):
    """One file that was read. The name has no folder: the same log elsewhere is the same bundle."""

    name: str
    format: str
    bytes: int
    sha256: str


class Role(_Strict):
    """The topic that plays a role, and why it was chosen over the others."""

    role: str
    topic: str
    type: str
    messages: int
    reason: str


class Missing(_Strict):
    """A part of the replay bundle that the log does not have."""

    part: str
    reason: str
    consequence: str


class Clock(_Strict):
    """The clock that drives the replay.

    `knots` are pairs of (log time, time on this clock) in ns between which log times are carried
    over to it, for messages without a usable header stamp.
    """

    name: Literal["sensor", "log"]
    reason: str
    knots: list[tuple[int, int]]

    def from_log_time(self, t_log_ns: ArrayLike) -> Times:
        """Log times (N,) on this clock: linear between knots, a constant offset outside them."""
        t_log = np.asarray(t_log_ns, dtype=np.int64)
        if not self.knots:
            return t_log
        log, offset = np.array([k[0] for k in self.knots]), [k[1] - k[0] for k in self.knots]
        base = offset[0]  # differences stay small, so that float64 holds them to the nanosecond
        drift = np.interp(t_log - log[0], log - log[0], np.array([o - base for o in offset]))
        return t_log + base + np.rint(drift).astype(np.int64)


class FrameEdge(_Strict):
    """One parent -> child pair of the tf tree."""

    parent: str
    child: str
    is_static: bool
    samples: int


class LeftOutEdge(_Strict):
    """An edge that was on tf and is not in the tree, for with it there would be none."""

    parent: str
    child: str
    samples: int
    fault: Literal["second parent", "cycle"]
    reason: str


class Frames(_Strict):
    """The frames that carry the contract, null where the log has none, and the whole tree."""

    map: str | None
    odom: str | None
    base: str | None
    tree: list[FrameEdge]
    left_out: list[LeftOutEdge] = []


class MapVersion(_Strict):
    """A map under maps/<folder>/, where it came from, and when it held (pairs of ns)."""

    version: str
    folder: str
    source: str
    width: int
    height: int
    resolution_m: float
    held_ns: list[tuple[int, int]] = []


class TableEntry(_Strict):
    """One Parquet file: rows, time range on the bundle's clock (null if empty), hash."""

    rows: int
    start_ns: int | None
    end_ns: int | None
    sha256: str


#: Reasons of losses that an audit looks for.
LEADING_SLASH = "leading slash taken off frame names"
ODD_ANGLES = "angle_max does not fit angle_min, angle_increment and the beams: angle_max ignored"


class Loss(_Strict):
    """Something in the log that is not in the tables, or was mended on the way: what and how much.

    `kind`: skipped (no use for it), lost (could not be read), repaired (mended and kept). Of a
    damaged file also the bytes and messages that went with it, where somebody knows, and the log
    time of the last good message before.
    """

    kind: Literal["skipped", "lost", "repaired"]
    what: str
    count: int
    reason: str
    bytes: int | None = None
    messages: int | None = None
    last_good_ns: int | None = None


class Manifest(_Strict):
    """manifest.json."""

    format_version: int = FORMAT_VERSION
    bundle_id: str
    sources: list[Source]
    options: dict[str, str]
    start_ns: int
    end_ns: int
    clock: Clock
    frames: Frames
    roles: list[Role]
    missing: list[Missing]
    maps: list[MapVersion]
    losses: list[Loss]
    tables: dict[str, TableEntry]

    def topic_of(self, role: str) -> str | None:
        """The topic that plays `role`, or None."""
        return next((r.topic for r in self.roles if r.role == role), None)

    def missing_parts(self) -> list[str]:
        """Names of the missing parts."""
        return [m.part for m in self.missing]
