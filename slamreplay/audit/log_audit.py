"""All that is measured of one log, each when it is first asked for."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from slamreplay.audit.delays import Delays, delays
from slamreplay.audit.lasers import LaserNumbers, laser_numbers
from slamreplay.audit.leads import Lead, lead
from slamreplay.audit.numbers import OddNumbers, odd_numbers
from slamreplay.audit.rates import OddStamps, Rate, odd_stamps, rate
from slamreplay.audit.streams import SENSOR_TABLES, Stream, streams
from slamreplay.audit.tf_cover import Cover, cover
from slamreplay.audit.tf_publishers import Disagreement, disagreement
from slamreplay.audit.tf_steps import Corrections, Steps, corrections, odometry_jumps
from slamreplay.audit.tf_tree import LooseFrame, TreeFault, loose_frames, tree_faults
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.scans import SCAN_ROLES
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry.transforms import Edge


class LogAudit:
    """Measurements of a log's clocks, transforms and numbers, as it was recorded.

    Args:
        view: the log; references that only judge are not in it.
        read: gives its tables; by default those of the view, with their placeholders. Clouds are
            large, and then read only where no laser plays the scan's role.
    """

    def __init__(self, view: BundleView, read: Callable[[str], Table] | None = None) -> None:
        self.view = view
        self.read = read or self._evidence

    def _evidence(self, name: str) -> Table:
        if name == "points" and self.view.manifest.topic_of("scan") is not None:
            return Table.empty(TABLES[name])
        return self.view.recorded(name)

    @cached_property
    def streams(self) -> list[Stream]:
        """Every topic, and of tf every edge."""
        return streams(self.read)

    @cached_property
    def edges(self) -> list[Stream]:
        """The edges of tf."""
        return [s for s in self.streams if s.edge is not None]

    @cached_property
    def sensors(self) -> list[Stream]:
        """Streams of measurements, and odometry on tf."""
        frames = self.view.manifest.frames
        carried = [s for s in self.edges if not s.is_static and s.is_edge(frames.odom, frames.base)]
        return [s for s in self.streams if s.table in SENSOR_TABLES] + carried

    @cached_property
    def moving(self) -> list[Stream]:
        """Moving edges between map, odometry, base and sensors: not those to things seen."""
        frames, buffer = self.view.manifest.frames, self.view.transforms
        own: set[str | None] = {frames.map, frames.odom}
        for frame in (frames.odom, *self.sensor_frames):
            own |= {f for edge in self._way(frame) for f in (edge.parent, edge.child)}
        corrects = [e for e in buffer.edges.values() if {e.parent, e.child} <= own]
        pairs = {(e.parent, e.child) for e in corrects if not e.is_static}
        return [s for s in self.edges if s.edge in pairs]

    @cached_property
    def sensor_frames(self) -> list[str]:
        """Frames that scans, points and IMU are in."""
        tables = [self.read(name) for name in ("scans", "points", "imu")]
        return sorted({frame for table in tables for frame in table["frame_id"]})

    def _way(self, frame: str | None) -> list[Edge]:
        """The edges between the base and a frame, none where they are not tied."""
        base, buffer = self.view.manifest.frames.base, self.view.transforms
        if base is None or frame is None or not buffer.has_path(base, frame):
            return []
        return buffer.path(base, frame)

    @cached_property
    def mounts(self) -> set[tuple[str, str]]:
        """Edges that sensors, or odometry, hang on."""
        ways = [self._way(f) for f in (self.view.manifest.frames.odom, *self.sensor_frames)]
        return {(edge.parent, edge.child) for way in ways for edge in way}

    @cached_property
    def delays(self) -> dict[str, Delays | None]:
        """How late each stream was recorded, by the stream's name and table."""
        return {key(s): delays(s.t_log_ns, s.t_sensor_ns) for s in self.streams}

    @cached_property
    def rates(self) -> dict[str, Rate]:
        """The rhythm of each stream."""
        manifest = self.view.manifest
        return {key(s): rate(s.t_ns, manifest.start_ns, manifest.end_ns) for s in self.streams}

    @cached_property
    def odd_stamps(self) -> dict[str, OddStamps]:
        """What is odd about each stream's stamps."""
        return {key(s): odd_stamps(s.t_sensor_ns) for s in self.streams}

    @cached_property
    def leads(self) -> dict[str, Lead]:
        """Edges that are dated ahead on purpose."""
        frames, clock = self.view.manifest.frames, self.view.manifest.clock
        found = {}
        for edge in self.edges:
            corrects = edge.is_edge(frames.map, frames.odom)
            own = lead(edge, clock, self.scans("scan") if corrects else None)
            if own is not None and not edge.topic.endswith("tf_static"):
                found[key(edge)] = own
        return found

    def scans(self, role: str) -> Stream | None:
        """The stream that plays a laser's role."""
        topic = self.view.manifest.topic_of(role)
        return next((s for s in self.streams if s.table == "scans" and s.topic == topic), None)

    @cached_property
    def odometry(self) -> PoseTrack | None:
        """Dead reckoning, as estimators read it."""
        return odometry_track(self.view)

    @cached_property
    def odometry_jumps(self) -> Steps | None:
        """Steps of it that no robot makes; None without odometry."""
        return None if self.odometry is None else odometry_jumps(self.odometry)

    @cached_property
    def corrections(self) -> Corrections | None:
        """What the localizer's transforms changed; None where there are none."""
        frames, clock = self.view.manifest.frames, self.view.manifest.clock
        if frames.map is None or frames.odom is None or self.odometry is None:
            return None
        transforms = self.read("transforms")
        return corrections(self.edges, transforms, (frames.map, frames.odom), self.odometry, clock)

    @cached_property
    def covers(self) -> dict[str, Cover]:
        """By topic of a laser with a role, how tf between odometry and it carries its scans."""
        odom, buffer, found = self.view.manifest.frames.odom, self.view.transforms, {}
        for role in SCAN_ROLES:
            scans = self.scans(role)
            if scans is None or odom is None:
                continue
            frame = str(self.read("scans")["frame_id"][scans.rows[0]])
            if not buffer.has_path(odom, frame):
                continue
            moving = {(e.parent, e.child) for e in buffer.path(odom, frame) if not e.is_static}
            told = cover(scans, [e for e in self.edges if e.edge in moving])
            if told is not None:
                found[scans.topic] = told
        return found

    @cached_property
    def tree_faults(self) -> list[TreeFault]:
        """What keeps tf from being a tree."""
        return tree_faults(self.view.manifest, self.read("transforms"), self.edges)

    @cached_property
    def disagreements(self) -> list[Disagreement]:
        """Edges in the robot's tree that are told in two ways by turns."""
        transforms = self.read("transforms")
        found = [disagreement(edge, transforms) for edge in self.moving]
        return [d for d in found if d is not None]

    @cached_property
    def loose_frames(self) -> list[LooseFrame]:
        """Frames that messages name and tf does not tie to the robot."""
        return loose_frames(self.read, self.view.transforms, self.view.manifest.frames.base)

    @cached_property
    def lasers(self) -> dict[str, LaserNumbers]:
        """By topic, whether a laser's numbers fit each other."""
        table, found = self.read("scans"), {}
        for stream in self.streams:
            if stream.table == "scans":
                alone = len(stream) == len(table)  # scans are large: not copied without need
                rows = table if alone else table.take(np.sort(stream.rows))
                found[stream.topic] = laser_numbers(rows, self.odometry)
        return found

    @cached_property
    def odd_numbers(self) -> list[OddNumbers]:
        """Placeholders and numbers that are none."""
        return odd_numbers(self.read, self.view.manifest.frames.map)

    @cached_property
    def simulated(self) -> Stream | None:
        """What /clock said, where the log has it."""
        if "clock" not in TABLES:
            return None
        table = self.read("clock")
        if not len(table):
            return None
        rows = np.argsort(table["t_log_ns"], kind="stable")
        told = table["clock_ns"][rows]
        return Stream(
            topic=str(table["topic"][0]),
            table="clock",
            edge=None,
            is_static=False,
            rows=rows,
            t_ns=table.t_ns[rows],
            t_sensor_ns=told,
            t_log_ns=table["t_log_ns"][rows],
        )


def key(stream: Stream) -> str:
    """What a stream is looked up by: its name, and its table, for a topic may fill two."""
    return f"{stream.name} ({stream.table})"
