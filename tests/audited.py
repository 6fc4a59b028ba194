"""Small logs with one fault each, for tests of the audit."""

import numpy as np

from slamreplay.bundle.manifest import Clock
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.consistency import AUDITS, CHECKS
from slamreplay.consistency.context import CheckContext
from slamreplay.geometry import se3
from slamreplay.geometry.covariance import ros_from_planar
from slamreplay.geometry.times import NS_PER_S
from slamreplay.testing.edits import rebuilt
from slamreplay.testing.synthetic import START_NS, synthetic_bundle


def healthy(seconds=40.0, seed=0):
    """The synthetic robot, its odometry less sure with the way, and delays as a network has."""
    bundle = synthetic_bundle(seconds=seconds, seed=seed)
    rng = np.random.default_rng(seed)
    tables = {}
    for name in TABLES:
        table = bundle.table(name)
        late = rng.exponential(5e-4 * NS_PER_S, len(table)).astype(np.int64)
        if name == "transforms":  # the localizer takes a moment to answer a scan
            late += np.where(table["parent_frame"] == "map", 12_000_000, 0)
        tables[name] = table.replace(t_log_ns=table["t_log_ns"] + late)
    odometry = tables["odometry"]
    scale = np.linspace(1.0, 9.0, len(odometry))[:, None, None]
    cov = ros_from_planar(np.diag([1e-4, 1e-4, 1e-5]) * scale)
    tables["odometry"] = odometry.replace(pose_covariance=cov, twist_covariance=cov)
    bundle = rebuilt(bundle, tables)
    knots = [(START_NS + k * NS_PER_S + 6_000_000, START_NS + k * NS_PER_S) for k in range(40)]
    return with_manifest(bundle, clock=Clock(name="sensor", reason="test", knots=knots))


def with_manifest(bundle, **parts):
    bundle = rebuilt(bundle, {})
    bundle.manifest = bundle.manifest.model_copy(update=parts)
    return bundle


def findings(bundle, *names):
    """What the checks that `inspect` asks say, as (id, severity, message)."""
    context = CheckContext(None, (), bundle.view())
    return [(f.id, f.severity, f.message) for name in (names or AUDITS)
            for f in CHECKS.load(name)(context)]  # fmt: skip


def edited(bundle, name, rows, **changes):
    """A table in which some rows of some columns are what a function makes of them."""
    table = bundle.table(name)
    columns = {}
    for column, change in changes.items():
        values = table[column].copy()
        values[rows] = change(values[rows])
        columns[column] = values
    return rebuilt(bundle, {name: table.replace(**columns)})


def restamped(bundle, name, rows, change):
    """Other stamps for some rows, which the bundle's clock takes over."""
    return edited(bundle, name, rows, t_sensor_ns=change, t_ns=change)


def on_edge(bundle, parent, child):
    """Rows of one edge of tf."""
    table = bundle.table("transforms")
    return np.flatnonzero((table["parent_frame"] == parent) & (table["child_frame"] == child))


def with_edge(
    bundle, parent, child, t_ns, xyyaw, *, topic="/tf", is_static=False, late_ns=5_000_000
):
    """A bundle with more rows of tf."""
    t = np.asarray(t_ns, dtype=np.int64)
    n = len(t)
    xyyaw = np.broadcast_to(np.asarray(xyyaw, dtype=float), (n, 3))
    more = Table(TABLES["transforms"], {
        "t_ns": t, "t_sensor_ns": t, "t_log_ns": t + 5_000_000, "topic": [topic] * n,
        "parent_frame": [parent] * n, "child_frame": [child] * n, "is_static": [is_static] * n,
        "translation_xyz": np.column_stack([xyyaw[:, :2], np.zeros(n)]),
        "rotation_xyzw": se3.quaternion_from_yaw(xyyaw[:, 2]),
    })  # fmt: skip
    both = Table.concat(TABLES["transforms"], [bundle.table("transforms"), more])
    return rebuilt(bundle, {"transforms": both.sorted_by_time()})
