"""Beliefs published in a log with scans, a map and a known truth; their errors are the test's."""

import numpy as np
from scipy.signal import lfilter

from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence.source import Reference
from slamreplay.geometry import se2, se3
from slamreplay.geometry.covariance import ros_from_planar
from slamreplay.testing.edits import rebuilt
from slamreplay.testing.synthetic import START_NS, synthetic_bundle, true_path

ROOM = synthetic_bundle(seconds=80.0)
SIGMA = np.array([0.05, 0.05, 0.01])


def ar1(rng, n, rho, m=3):
    noise = rng.standard_normal((n, m)) * np.sqrt(1 - rho**2)
    noise[0] = rng.standard_normal(m)
    return lfilter([1.0], [1.0, -rho], noise, axis=0)


def times(seconds=80.0, hz=5.0):
    return np.arange(0.0, seconds, 1.0 / hz)


def poses(t_s, error, sigma):
    """A table of published poses: the truth plus an error (N, 3), sigma (N, 3) claimed."""
    t_ns = START_NS + np.rint(np.asarray(t_s) * 1e9).astype(np.int64)
    xyyaw = true_path(t_s) + error
    cov = np.zeros((len(t_ns), 3, 3))
    cov[:, range(3), range(3)] = sigma**2
    n = len(t_ns)
    return Table(
        TABLES["poses"],
        {
            **dict.fromkeys(("t_ns", "t_sensor_ns", "t_log_ns"), t_ns),
            "topic": ["/amcl_pose"] * n,
            "source": ["/amcl_pose"] * n,
            "frame_id": ["map"] * n,
            "child_frame_id": ["base_link"] * n,
            "position_xyz": np.column_stack([xyyaw[:, :2], np.zeros(n)]),
            "orientation_xyzw": se3.quaternion_from_yaw(se2.wrap_angle(xyyaw[:, 2])),
            "covariance": ros_from_planar(cov),
        },
    )


def context(t_s, error, sigma, kind="motion_capture", tables=(), grid="same"):
    """The robot's belief in a log with scans and map, and the truth as a reference."""
    exchanged = {"poses": poses(t_s, error, sigma), **{t.schema.name: t for t in tables}}
    view = rebuilt(ROOM, exchanged, grid).view()
    at = START_NS + np.rint(times(80.0, 50.0) * 1e9).astype(np.int64)
    truth = PoseTrack.without_covariance("map", "base_link", at, true_path(times(80.0, 50.0)))
    known = () if kind is None else (Reference(kind, "/truth", truth),)
    return CheckContext(None, known, view)


def breathing(n):
    """A sigma that grows while driving and shrinks with each look."""
    return SIGMA * (1.0 + 0.6 * (np.arange(n) % 8)[:, None] / 8.0)


def told(found):
    return [f for f in found if f.severity != "info"]


def seconds(finding):
    return (finding.start_ns - START_NS) / 1e9, (finding.end_ns - START_NS) / 1e9
