"""The bundle's tables, column by column: type, unit, frame and meaning.

The texts travel in the Parquet files' own metadata; FORMAT.md is printed from them. Long, because
the tables are: a line for each column, and nothing that computes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import pyarrow as pa

FORMAT_VERSION = 1

#: The eight parts of a minimum replay bundle, in the order they are reported.
PARTS = ("odometry", "imu", "scans", "pose", "covariance", "map", "costmap", "recovery")

Kind = Literal[
    "int64", "int32", "int8", "float64", "bool", "str", "list_f32", "list_f64", "list_i8"
]

_ARROW = {
    "int64": pa.int64(),
    "int32": pa.int32(),
    "int8": pa.int8(),
    "float64": pa.float64(),
    "bool": pa.bool_(),
    "str": pa.string(),
    "list_f32": pa.list_(pa.float32()),
    "list_f64": pa.list_(pa.float64()),
    "list_i8": pa.list_(pa.int8()),
}


@dataclass(frozen=True)
class Column:
    """One column: its kind, its fixed size (0 for a scalar), and what its numbers mean."""

    name: str
    kind: Kind
    size: int = 0
    unit: str = ""
    frame: str = ""
    doc: str = ""

    @property
    def arrow_type(self) -> pa.DataType:
        """The Parquet column's type; vectors and matrices are fixed-size lists."""
        base = _ARROW[self.kind]
        return pa.list_(base, self.size) if self.size else base


@dataclass(frozen=True)
class TableSchema:
    """A table's name and columns."""

    name: str
    doc: str
    columns: tuple[Column, ...]

    def column(self, name: str) -> Column:
        """The column called `name` (KeyError if there is none)."""
        return next(c for c in self.columns if c.name == name)

    @property
    def arrow_schema(self) -> pa.Schema:
        """The Parquet schema; unit, frame and doc of each column are field metadata."""
        fields = [
            pa.field(
                c.name,
                c.arrow_type,
                nullable=c.name == "t_sensor_ns",
                metadata={"unit": c.unit, "frame": c.frame, "doc": c.doc},
            )
            for c in self.columns
        ]
        return pa.schema(fields, metadata={"table": self.name, "doc": self.doc})


_TIMES = (
    Column("t_ns", "int64", unit="ns", doc="time on the bundle's clock: what estimation runs on"),
    Column("t_sensor_ns", "int64", unit="ns", doc="header stamp as recorded; null where none"),
    Column("t_log_ns", "int64", unit="ns", doc="when the recorder wrote the message"),
    Column("topic", "str", doc="topic the row came from"),
)
_FRAME = Column("frame_id", "str", doc="frame of the row's numbers, without leading slash")
_CHILD = Column("child_frame_id", "str", doc="frame that is posed")
_POSE = (
    Column("position_xyz", "float64", 3, "m", "frame_id", "position"),
    Column("orientation_xyzw", "float64", 4, "1", "frame_id", "unit quaternion"),
)


def _covariance(name: str, size: int, frame: str, doc: str) -> Column:
    return Column(name, "float64", size, "m^2, rad^2", frame, f"{doc}; NaN where none was given")


_POSE_COV = _covariance(
    "covariance", 36, "frame_id", "6x6 row-major, x y z rx ry rz about the parent's axes"
)


def _table(name: str, doc: str, *columns: Column) -> TableSchema:
    return TableSchema(name, doc, (*_TIMES, *columns))


_SCHEMAS = (
    _table(
        "odometry",
        "dead reckoning as the robot computed it",
        _FRAME,
        _CHILD,
        *_POSE,
        _covariance("pose_covariance", 36, "frame_id", "6x6 row-major, x y z rx ry rz"),
        Column("linear_velocity_xyz", "float64", 3, "m/s", "child_frame_id", "velocity"),
        Column("angular_velocity_xyz", "float64", 3, "rad/s", "child_frame_id", "turn rate"),
        _covariance("twist_covariance", 36, "child_frame_id", "6x6 row-major"),
    ),
    _table(
        "imu",
        "inertial measurements",
        _FRAME,
        Column("orientation_xyzw", "float64", 4, "1", "world", "NaN where not provided"),
        _covariance("orientation_covariance", 9, "frame_id", "3x3 row-major"),
        Column("angular_velocity_xyz", "float64", 3, "rad/s", "frame_id", "turn rate"),
        _covariance("angular_velocity_covariance", 9, "frame_id", "3x3 row-major"),
        Column("linear_acceleration_xyz", "float64", 3, "m/s^2", "frame_id", "specific force"),
        _covariance("linear_acceleration_covariance", 9, "frame_id", "3x3 row-major"),
    ),
    _table(
        "magnetic_fields",
        "magnetic field as it was measured",
        _FRAME,
        Column("magnetic_field_xyz", "float64", 3, "T", "frame_id", "NaN on axes without a sensor"),
        Column(
            "magnetic_field_covariance",
            "float64",
            9,
            "T^2",
            "frame_id",
            "3x3 row-major; NaN where none was given",
        ),
    ),
    _table(
        "scans",
        "planar lidar scans; of a log without any, point clouds flattened at their sensor",
        _FRAME,
        Column("angle_min_rad", "float64", unit="rad", doc="bearing of the first beam"),
        Column("angle_increment_rad", "float64", unit="rad", doc="between beams, signed"),
        Column("time_increment_s", "float64", unit="s", doc="between beams, for deskewing"),
        Column("scan_time_s", "float64", unit="s", doc="between scans, 0 where unknown"),
        Column("range_min_m", "float64", unit="m", doc="nearer returns are invalid"),
        Column("range_max_m", "float64", unit="m", doc="farther returns are invalid"),
        Column("ranges_m", "list_f32", unit="m", doc="as recorded: +inf is free space (REP-117)"),
    ),
    _table(
        "points",
        "point clouds the topics file asks for: the first point in each cube of 0.1 m",
        _FRAME,
        Column("points_xyz", "list_f32", unit="m", frame="frame_id", doc="x y z interleaved"),
    ),
    _table(
        "poses",
        "every belief about the robot's pose in a map",
        _FRAME,
        _CHILD,
        Column("source", "str", doc="topic, or tf where composed of the localizer's transforms"),
        *_POSE,
        _POSE_COV,
    ),
    _table(
        "initial_poses",
        "poses a person or a program gave to the localizer",
        _FRAME,
        *_POSE,
        _POSE_COV,
    ),
    _table(
        "particles",
        "particle clouds",
        _FRAME,
        Column("xyyaw", "list_f64", unit="m, m, rad", frame="frame_id", doc="x y yaw interleaved"),
        Column("weights", "list_f64", unit="1", doc="empty where the message has none"),
    ),
    _table(
        "transforms",
        "tf, static and dynamic",
        Column("parent_frame", "str", doc="without leading slash"),
        Column("child_frame", "str", doc="without leading slash"),
        Column("is_static", "bool", doc="holds at all times"),
        Column("translation_xyz", "float64", 3, "m", "parent_frame", "the child's origin"),
        Column("rotation_xyzw", "float64", 4, "1", "parent_frame", "unit quaternion"),
    ),
    _table(
        "costmaps",
        "cost grids of the planners",
        _FRAME,
        Column("resolution_m", "float64", unit="m", doc="edge of a cell"),
        Column("width", "int32", unit="cells", doc="columns"),
        Column("height", "int32", unit="cells", doc="rows"),
        Column("origin_xyyaw", "float64", 3, "m, m, rad", "frame_id", "lower left corner"),
        Column("cells", "list_i8", doc="row-major from the lower left: 0 to 100, -1 unknown"),
    ),
    _table(
        "costmap_updates",
        "windows of cost grids that changed; rows of `costmaps` are whole grids",
        _FRAME,
        Column("grid_topic", "str", doc="topic of the grid it changes: of its last whole one"),
        Column("x", "int32", unit="cells", doc="that grid's column of the window's lower left"),
        Column("y", "int32", unit="cells", doc="that grid's row of the window's lower left"),
        Column("width", "int32", unit="cells", doc="columns"),
        Column("height", "int32", unit="cells", doc="rows"),
        Column("cells", "list_i8", doc="row-major from the lower left: 0 to 100, -1 unknown"),
    ),
    _table(
        "plans",
        "paths that were planned",
        _FRAME,
        Column("xyyaw", "list_f64", unit="m, m, rad", frame="frame_id", doc="x y yaw interleaved"),
    ),
    _table(
        "commands",
        "velocity commands",
        Column("linear_velocity_xyz", "float64", 3, "m/s", "base", "commanded"),
        Column(
            "angular_velocity_xyz",
            "float64",
            3,
            "rad/s",
            "base",
            "commanded; NaN where it is not told (a steering angle)",
        ),
    ),
    _table(
        "velocities",
        "measured velocities that come without a pose",
        _FRAME,
        Column("linear_velocity_xyz", "float64", 3, "m/s", "frame_id", "velocity"),
        Column("angular_velocity_xyz", "float64", 3, "rad/s", "frame_id", "turn rate"),
        _covariance("twist_covariance", 36, "frame_id", "6x6 row-major"),
    ),
    _table(
        "joints",
        "joints and wheels, one row each; NaN where a message does not tell",
        Column("name", "str", doc="of the joint"),
        Column("position", "float64", unit="rad or m", doc="rad if it turns, m if it slides"),
        Column("velocity", "float64", unit="rad/s or m/s", doc="rate of the position"),
        Column("effort", "float64", unit="N m or N", doc="torque if it turns, else force"),
    ),
    _table(
        "recoveries",
        "recovery actions, and the navigation goals around them",
        Column("name", "str", doc="behaviour, action or service as the log names it"),
        Column("status", "str", doc="as the source names it, in lower case"),
        Column("goal", "str", doc="id of the goal or call, where the source tells it; else empty"),
        Column(
            "source",
            "str",
            doc="behavior_tree, action, navigation_feedback, service, recovery_status, log, or "
            "inferred (from motion or costmaps: nobody said so)",
        ),
    ),
    _table(
        "references",
        "independent ideas of the truth; those that only judge are hidden from estimators",
        _FRAME,
        _CHILD,
        Column("kind", "str", doc="simulation, motion_capture, survey, gnss, fiducial or dock"),
        _POSE[0],
        Column(
            "orientation_xyzw",
            "float64",
            4,
            "1",
            "frame_id",
            "unit quaternion; NaN where the sensor tells where and not how turned",
        ),
        _POSE_COV,
    ),
    _table(
        "relations",
        "motions between two scans as somebody measured them: they only judge, no estimator "
        "sees them",
        _CHILD,
        Column("t2_sensor_ns", "int64", unit="ns", doc="header stamp of the second scan"),
        Column(
            "position_xyz",
            "float64",
            3,
            "m",
            "child_frame_id",
            "at the second stamp, from the robot's place at the first",
        ),
        Column("orientation_xyzw", "float64", 4, "1", "child_frame_id", "unit quaternion"),
    ),
    _table(
        "signals",
        "numbers a localizer says of itself, one row each",
        Column("name", "str", doc="of the number: alpha, reliability, transform_probability"),
        Column("value", "float64", doc="as recorded; its scale is the localizer's own"),
    ),
    _table(
        "closures",
        "closures of a SLAM system's graph, each when it was first told",
        _FRAME,
        Column(
            "kind",
            "str",
            doc="loop_closure, proximity, landmark (rtabmap); inter_submap, "
            "inter_trajectory (Cartographer); link of scans that do not follow each other, near "
            "ones included (slam_toolbox)",
        ),
        Column("from_id", "str", doc="node, as the system counts; empty where it is not told"),
        Column("to_id", "str", doc="node or landmark; empty where it is not told"),
        Column("number", "int32", doc="place in the list of its kind that told it, from 0"),
        Column("from_xyz", "float64", 3, "m", "frame_id", "NaN where it is not told"),
        Column("to_xyz", "float64", 3, "m", "frame_id", "NaN where it is not told"),
        Column("score", "float64", doc="value of the accepted hypothesis; NaN where none is told"),
    ),
    _table(
        "health",
        "diagnostics, log lines, parameters, states of nodes and batteries, what safety devices "
        "did",
        Column("level", "int32", doc="as the message type counts; 20, info, where it has none"),
        Column("name", "str", doc="who says it"),
        Column("message", "str", doc="what was said"),
    ),
    _table(
        "clock",
        "simulated or replayed time, as it was told to every node",
        Column("clock_ns", "int64", unit="ns", doc="the time that was told"),
    ),
    _table(
        "map_updates",
        "from when on which map version held",
        Column(
            "map_version",
            "str",
            doc="hash of content and metadata; folder under maps/, where that version was kept",
        ),
        _FRAME,
    ),
)

TABLES: dict[str, TableSchema] = {schema.name: schema for schema in _SCHEMAS}

#: References of these kinds only judge: no estimator, hindsight, perturbation or verdict sees them.
JUDGING_KINDS = frozenset({"simulation", "motion_capture", "survey"})
#: References of these kinds the robot sensed itself: they join hindsight unless they are held out.
SENSED_KINDS = frozenset({"gnss", "fiducial", "dock"})
#: The table of motions that somebody measured: it only judges as well.
RELATIONS = "relations"
