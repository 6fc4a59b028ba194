"""MRCLAM folders: several robots, their speeds, the landmarks they saw, and motion capture.

The UTIAS Multi-Robot Cooperative Localization and Mapping data sets (Leung, Halpern, Barfoot and
Liu, IJRR 30(8), 2011): RobotN_Odometry.dat (t, v, w), RobotN_Measurement.dat (t, barcode, range,
bearing), RobotN_Groundtruth.dat (t, x, y, heading), Landmark_Groundtruth.dat (subject, x, y and
their standard deviations), Barcodes.dat (subject, barcode). The camera sits at the robot's origin.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Loss, Source
from slamreplay.errors import LogError, UsageError
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S, Times, from_decimal_seconds, in_order
from slamreplay.ingest.rows import TopicRows
from slamreplay.ingest.text_logs.lines import read_text
from slamreplay.ingest.text_logs.log import TextLog
from slamreplay.ingest.text_logs.numbers import table_of_numbers
from slamreplay.ingest.text_logs.rows import odometry_rows, reference_rows, static_rows

_ODOMETRY = re.compile(r"Robot(\d+)_Odometry\.dat\Z")
_LANDMARKS, _BARCODES = "Landmark_Groundtruth.dat", "Barcodes.dat"
#: Longer without a new speed, the last one is held over a gap, ns.
_GAP_NS = NS_PER_S
#: Subjects up to this number are the robots, the others landmarks.
_ROBOTS = 5


def robots_of(folder: Path) -> list[int]:
    """Numbers of the robots whose odometry lies in a folder, ascending."""
    names = (_ODOMETRY.match(path.name) for path in folder.iterdir())
    return sorted(int(name[1]) for name in names if name)


def read_mrclam(path: Path, robot: str | None) -> TextLog:
    """One robot of an MRCLAM folder; frames map, odom, base_link, landmark_6 and so on.

    Args:
        path: the folder.
        robot: "3", "robot3" or "Robot3"; may be None where there is only one.

    Raises:
        UsageError: several robots and none chosen, or one that is not there.
        LogError: a file cannot be read, or nothing usable is in it.
    """
    number = _chosen(robots_of(path), robot)
    files = _Files(path)
    name = f"Robot{number}"
    topics = [_odometry(files, f"{name}_Odometry.dat")]
    landmarks = _landmarks(files)
    topics += _sightings(files, f"{name}_Measurement.dat")
    topics += _truth(files, f"{name}_Groundtruth.dat")
    if landmarks:
        frames = [f"landmark_{subject}" for subject in landmarks]
        # A landmark is a point: that its frame has the map's axes says nothing of a heading.
        poses = np.array([[*xy, 0.0] for xy in landmarks.values()])
        first = min(int(topic.t_log_ns[0]) for topic in topics if len(topic))
        topics.append(static_rows("map", frames, poses, "mrclam", first))
    return TextLog(tuple(files.sources), topics, files.losses)


def _chosen(robots: list[int], robot: str | None) -> int:
    known = ", ".join(f"Robot{n}" for n in robots)
    if robot is None:
        if len(robots) > 1:
            raise UsageError(
                f"the log holds {len(robots)} robots: {known}",
                hint=f"choose one, as in --robot {robots[0]}",
            )
        return robots[0]
    digits = robot.strip("/").lower().removeprefix("robot").removeprefix("_")
    number = int(digits) if digits.isdecimal() and digits.isascii() else None
    if number not in robots or number is None:
        raise UsageError(
            f"there is no robot '{robot}'", where="--robot", hint=f"there are: {known}"
        )
    return number


@dataclass
class _Files:
    """The folder's files, each read once, and what was lost of them."""

    folder: Path
    sources: list[Source] = field(default_factory=list)
    losses: list[Loss] = field(default_factory=list)

    def columns(self, name: str, width: int, least: int) -> tuple[list[bytes], NDArray[np.float64]]:
        """First fields as text and all numbers (N, width) of a file's sound lines.

        Args:
            name: of the file; one that is missing has no lines, and that is counted.
            width: numbers that are wanted of a line.
            least: numbers that a line must have; what it lacks of `width` is NaN.
        """
        path = self.folder / name
        if not path.is_file():
            self.lose("lost", name, 1, "the file is missing")
            return [], np.empty((0, width))
        text = read_text(path, "mrclam")
        self.sources.append(text.source)
        self.losses += text.losses
        words = [line.split() for line in text.lines]
        words = [w for w in words if w and not w[0].startswith(b"#")]
        fitting = [w for w in words if least <= len(w) <= width]
        self.lose("lost", name, len(words) - len(fitting), "wrong number of columns")
        padded = [b" ".join(w + [b"nan"] * (width - len(w))) for w in fitting]
        values, sound = table_of_numbers(padded, width)
        sound &= np.isfinite(values[:, :least]).all(axis=1)
        self.lose("lost", name, int((~sound).sum()), "a field is no finite number")
        return [w[0] for w, good in zip(fitting, sound.tolist(), strict=True) if good], values[
            sound
        ]

    def timed(self, name: str, width: int) -> tuple[Times, NDArray[np.float64]]:
        """Times (N,) and numbers (N, width - 1) of a file whose first column is time in s."""
        texts, values = self.columns(name, width, width)
        t_ns, is_time = from_decimal_seconds(texts)
        self.lose("lost", name, int((~is_time).sum()), "a time is no number")
        return t_ns[is_time], values[is_time, 1:]

    def lose(self, kind: str, name: str, count: int, reason: str) -> None:
        """Count something that was left out or mended."""
        if count:
            loss = Loss(kind=kind, what=name, count=count, reason=reason)  # type: ignore[arg-type]
            self.losses.append(loss)


def _odometry(files: _Files, name: str) -> TopicRows:
    t_ns, velocity = files.timed(name, 3)
    if not len(t_ns):
        raise LogError("no odometry in it", where=files.folder / name)
    steady, moved = in_order(t_ns)
    files.lose("repaired", name, int(moved.sum()), "times step back, the order of the lines holds")
    gaps = int((np.diff(steady) > _GAP_NS).sum())
    files.lose("repaired", name, gaps, "gaps of more than a second: the last speed is held")
    reason = "speeds, integrated to poses along arcs of constant speed"
    files.lose("repaired", name, len(t_ns), reason)
    xyyaw = integrated(steady, velocity)
    return odometry_rows(
        name.removesuffix(".dat"), "mrclam/Odometry", xyyaw, velocity, t_ns, steady
    )


def integrated(t_ns: Times, velocity: se2.Array) -> se2.Array:
    """Poses (N, 3) from the origin on, each speed held until the next one: exact along arcs.

    Args:
        t_ns: (N,) times that never step back.
        velocity: (N, 2) forward m/s and turn rate rad/s from each time on.
    """
    dt = np.diff(t_ns) / NS_PER_S
    turn = velocity[:-1, 1] * dt
    yaw = np.append(0.0, np.cumsum(turn))
    # An arc's chord: v dt sin(h) / h along the heading in its middle, h half the turn.
    chord = velocity[:-1, 0] * dt * np.sinc(0.5 * turn / np.pi)
    middle = yaw[:-1] + 0.5 * turn
    x, y = (np.append(0.0, np.cumsum(chord * f(middle))) for f in (np.cos, np.sin))
    return np.column_stack([x, y, se2.wrap_angle(yaw)])


def _landmarks(files: _Files) -> dict[int, NDArray[np.float64]]:
    """Surveyed places (2,) in the map by subject."""
    _, values = files.columns(_LANDMARKS, 5, 3)
    told = int(np.isfinite(values[:, 3:]).all(axis=1).sum())
    files.lose("skipped", _LANDMARKS, told, "standard deviations: transforms carry none")
    return {int(row[0]): row[1:3] for row in values}


def _sightings(files: _Files, name: str) -> list[TopicRows]:
    """Landmarks as the camera saw them: where they are is measured, how they are turned is not."""
    t_ns, values = files.timed(name, 4)
    _, pairs = files.columns(_BARCODES, 2, 2)
    subject_of = {int(barcode): int(subject) for subject, barcode in pairs.tolist()}
    subjects = np.array(
        [subject_of.get(int(code), -1) for code in values[:, 0].tolist()], dtype=int
    )
    is_robot = (subjects > 0) & (subjects <= _ROBOTS)
    files.lose("skipped", name, int(is_robot.sum()), "barcodes of other robots")
    files.lose("lost", name, int((subjects < 0).sum()), "barcodes that nobody has")
    behind = (subjects >= 0) & ~is_robot & (values[:, 1] <= 0.0)
    files.lose("lost", name, int(behind.sum()), "range is not positive")
    use = (subjects >= 0) & ~is_robot & ~behind
    steady, moved = in_order(t_ns[use])
    files.lose("repaired", name, int(moved.sum()), "times step back, the order of the lines holds")
    n, (reach, bearing) = int(use.sum()), values[use, 1:].T
    frames = [f"landmark_{number}" for number in subjects[use].tolist()]
    columns = {
        "frame_id": np.full(n, "base_link", dtype=object),
        "child_frame_id": np.array([*frames, ""], dtype=object)[:-1],
        "kind": np.full(n, "fiducial", dtype=object),
        "position_xyz": np.column_stack(
            [reach * np.cos(bearing), reach * np.sin(bearing), np.zeros(n)]
        ),
        "orientation_xyzw": np.full((n, 4), np.nan),
        "covariance": np.full((n, 36), np.nan),
    }
    topic = name.removesuffix(".dat")
    rows = TopicRows(
        topic, "mrclam/Measurement", len(t_ns), "references", columns, t_ns[use], steady
    )
    return [rows] if n else []


def _truth(files: _Files, name: str) -> list[TopicRows]:
    t_ns, xyyaw = files.timed(name, 4)
    steady, moved = in_order(t_ns)
    files.lose("repaired", name, int(moved.sum()), "times step back, the order of the lines holds")
    topic = name.removesuffix(".dat")
    rows = reference_rows(topic, "mrclam/Groundtruth", "motion_capture", xyyaw, t_ns, steady)
    return [rows] if len(rows) else []
