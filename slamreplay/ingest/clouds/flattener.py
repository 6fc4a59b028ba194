"""Clouds in, batch after batch, rows of table `scans` out."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Clock, Loss
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.tables import Ragged
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry.times import Times
from slamreplay.ingest.clouds.body import without_body
from slamreplay.ingest.clouds.fields import Clouds
from slamreplay.ingest.clouds.place import place_of
from slamreplay.ingest.clouds.setting import Setting, settle
from slamreplay.ingest.clouds.sweep import sweep_motion
from slamreplay.ingest.row_times import row_times
from slamreplay.ingest.rows import TopicRows


@dataclass(eq=False)
class Flattener:
    """Makes scans of one topic's clouds, a batch of which is in memory at a time.

    Attributes:
        topic: name of the clouds' topic.
        type: message type.
        view: transforms, odometry and frames of the log.
        clock: the one the view's times are on.
        band: height band that the user asks for, m.
        setting: what the first batch told; None before it.
    """

    topic: str
    type: str
    view: BundleView
    clock: Clock
    band: tuple[float, float] | None = None
    setting: Setting | None = None
    _track: PoseTrack | None = field(init=False, default=None)
    _parts: list[_Part] = field(init=False, default_factory=list)
    _lost: Counter[str] = field(init=False, default_factory=Counter)
    _still: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        self._track = odometry_track(self.view)

    def add(self, clouds: Clouds) -> None:
        """Flatten the next clouds."""
        from slamreplay.ingest.clouds.flatten import flattened  # numba

        self._lost["no x y z fields, or fewer bytes than said"] += clouds.lost
        if not len(clouds):
            return
        if self.setting is None:
            names, counts = np.unique(clouds.frame_id.astype(str), return_counts=True)
            frame = str(names[np.argmax(counts)])
            first = clouds.take(np.flatnonzero(clouds.frame_id == frame))
            place = place_of(self.view, frame, self._times(first))
            self.setting = settle(first, place, self.band)
        frame = self.setting.place.frame
        own = np.flatnonzero(clouds.frame_id == frame)
        if len(own) < len(clouds):
            self._lost[f"not in {frame} as the others are"] += len(clouds) - len(own)
            clouds = clouds.take(own)
        t_ns = self._times(clouds)
        times = self.setting.times
        motion = sweep_motion(clouds, t_ns, None if isinstance(times, str) else times, self._track)
        self._still += motion.still
        mounts = self.setting.place.at(self.view, t_ns)
        ranges, reach, outside = flattened(clouds, self.setting, mounts, motion)
        self._lost["returns beyond the field of view of the first clouds"] += outside
        self._parts.append(_Part(ranges, reach, t_ns, clouds.t_sensor_ns, clouds.t_log_ns))

    def finish(self) -> tuple[TopicRows | None, list[Loss]]:
        """The rows, None where no cloud could be read, and what was lost on the way."""
        if self.setting is None:
            return None, self._losses(0)
        setting = self.setting
        order = np.argsort(np.concatenate([p.t_log_ns for p in self._parts]), kind="stable")

        def joined(name: str) -> NDArray[Any]:
            return np.concatenate([getattr(p, name) for p in self._parts])[order]

        n = len(order)
        ranges = without_body(joined("ranges_m"), joined("t_ns"), self._track)
        columns = {
            "frame_id": np.full(n, setting.place.level_frame, dtype=object),
            "angle_min_rad": np.full(n, setting.angle_min),
            "angle_increment_rad": np.full(n, setting.increment),
            "time_increment_s": np.zeros(n),  # nothing is left to take out
            "scan_time_s": np.zeros(n),
            "range_min_m": np.full(n, setting.range_min_m),
            "range_max_m": joined("range_max_m"),
            "ranges_m": Ragged(ranges.ravel(), np.arange(n + 1, dtype=np.int64) * setting.beams),
        }
        stamps = (joined("t_sensor_ns"), joined("t_log_ns"))
        return TopicRows(self.topic, self.type, n, "scans", columns, *stamps), self._losses(n)

    def _times(self, clouds: Clouds) -> Times:
        stub = TopicRows(self.topic, self.type, len(clouds), "scans", {},
                         clouds.t_sensor_ns, clouds.t_log_ns)  # fmt: skip
        return row_times(stub, self.clock)[0]

    def _losses(self, count: int) -> list[Loss]:
        """What was lost or left as it was."""
        said = [("lost", number, reason) for reason, number in sorted(self._lost.items())]
        reason = self.uncompensated
        if reason is not None:
            said.append(("skipped", count, f"motion within a sweep is not taken out: {reason}"))
        elif self._still:
            reason = "no odometry then, or no times of points"
            number = self._still
            said.append(("skipped", number, f"motion within a sweep is not taken out: {reason}"))
        return [
            Loss(kind=kind, what=self.topic, count=number, reason=reason)  # type: ignore[arg-type]
            for kind, number, reason in said if number
        ]  # fmt: skip

    @property
    def told(self) -> str:
        """In words: from which heights scans were made, and whether motion was taken out."""
        assert self.setting is not None
        setting, place = self.setting, self.setting.place
        if not setting.is_floor_seen:
            floor = f"which no cloud shows: taken at {setting.floor[0]:.2f} m in the base frame"
        elif np.isfinite(setting.sensor_height_m):
            floor = f"{setting.sensor_height_m:.2f} m below {place.frame}"
        else:
            floor = f"at {setting.floor[0]:.2f} m in {place.frame}"
        band = f"{setting.band.low_m:.2f} to {setting.band.high_m:.2f} m above the floor ({floor})"
        motion = "as swept" if self.uncompensated else "motion within a sweep taken out"
        return f"flattened from {band}, {np.degrees(setting.increment):.1f} deg a beam, {motion}"

    @property
    def uncompensated(self) -> str | None:
        """Why no sweep's motion is taken out, or None."""
        if self.setting is not None and isinstance(self.setting.times, str):
            return self.setting.times
        return "the log has no odometry" if self._track is None or not len(self._track) else None


@dataclass(frozen=True, eq=False)
class _Part:
    """Scans of one batch."""

    ranges_m: NDArray[np.float32]
    range_max_m: NDArray[np.float64]
    t_ns: Times
    t_sensor_ns: Times
    t_log_ns: Times
