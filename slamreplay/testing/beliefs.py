"""Beliefs whose errors are known: consistent ones, and ones with a fault that is named."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from slamreplay.bundle.manifest import Clock, Frames, Manifest, Role
from slamreplay.bundle.run import Innovations
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence.source import Reference
from slamreplay.geometry import se2, se3
from slamreplay.geometry.covariance import ros_from_planar
from slamreplay.geometry.times import NS_PER_S

#: How strongly one update's error hangs on the one before, by seed.
MEMORIES = (0.0, 0.5, 0.8, 0.95, 0.99)
_COV = np.array([[0.04, 0.01, 0.004], [0.01, 0.09, -0.006], [0.004, -0.006, 0.01]])
_S = np.array([[0.01, 0.002], [0.002, 0.0025]])


def believed(
    seed: int,
    *,
    rows: int = 600,
    told: float = 1.0,
    wild: float = 0.0,
    bias: float = 0.0,
    collapsed: float = 1.0,
) -> CheckContext:
    """A belief published at 5 Hz, its reference, and the innovations of one sensor.

    With the defaults the covariance is what the errors have, at every row: it breathes, position
    and heading are coupled, and errors follow each other (AR(1), of one of `MEMORIES`);
    innovations are white, and as large as predicted.

    Args:
        seed: of the noise; the memory goes by it, too.
        rows: updates.
        told: sigma as it is claimed over what it is: 0.5 claims half.
        wild: share of rows (and of innovations) whose error is five times as large; the others are
            smaller by so much that the covariance is right on average.
        bias: of the innovations, in their sigmas.
        collapsed: sigma as it is claimed over `told`, in the third quarter of the rows.
    """
    rng = np.random.Generator(np.random.PCG64(seed))
    t_ns = np.arange(rows) * (NS_PER_S // 5)
    truth = np.column_stack([t_ns / 2e9, np.sin(t_ns / 7e9), se2.wrap_angle(t_ns / 11e9)])
    breath = 1.0 + 0.6 * (np.arange(rows) % 8) / 8.0  # grows while driving, shrinks when it looks
    cov = _COV * breath[:, None, None] ** 2
    white = _remembering(rng, rows, MEMORIES[seed % len(MEMORIES)]) * _heights(rng, rows, wild)
    belief = truth + np.einsum("nij,nj->ni", np.linalg.cholesky(cov), white)
    belief[:, 2] = se2.wrap_angle(belief[:, 2])
    claimed = np.full(rows, told)
    claimed[rows // 2 : rows * 3 // 4] *= collapsed
    track = PoseTrack("map", "base", t_ns, belief, cov * claimed[:, None, None] ** 2)
    reference = PoseTrack.without_covariance("map", "base", t_ns, truth)
    bundle = _bundle(track)
    seen = rng.standard_normal((rows, 2)) * _heights(rng, rows, wild) + bias
    residual = seen @ np.linalg.cholesky(_S).T
    S = np.broadcast_to(_S * told**2, (rows, 2, 2)).copy()
    innovations = (Innovations("tags", t_ns, residual, S, np.ones(rows, dtype=bool)),)
    known = (Reference("simulation", "/truth", reference),)
    return CheckContext(track, known, bundle.view(), innovations=innovations)


def _remembering(rng: np.random.Generator, rows: int, rho: float) -> se2.Array:
    noise = rng.standard_normal((rows, 3))
    noise[1:] *= np.sqrt(1.0 - rho**2)
    return np.asarray(lfilter([1.0], [1.0, -rho], noise, axis=0))


def _heights(rng: np.random.Generator, rows: int, wild: float) -> se2.Array:
    """(rows, 1) of variance 1 over all rows."""
    high = rng.random((rows, 1)) < wild
    return np.asarray(np.where(high, 5.0, np.sqrt(max(1.0 - 25.0 * wild, 0.0) / (1.0 - wild))))


def _bundle(track: PoseTrack) -> Bundle:
    n = len(track)
    poses = Table(
        TABLES["poses"],
        {
            **dict.fromkeys(("t_ns", "t_sensor_ns", "t_log_ns"), track.t_ns),
            "topic": ["/pose"] * n,
            "source": ["/pose"] * n,
            "frame_id": ["map"] * n,
            "child_frame_id": ["base"] * n,
            "position_xyz": np.column_stack([track.xyyaw[:, :2], np.zeros(n)]),
            "orientation_xyzw": se3.quaternion_from_yaw(track.xyyaw[:, 2]),
            "covariance": ros_from_planar(track.cov),
        },
    )
    end_ns = int(track.t_ns[-1])
    manifest = Manifest(
        bundle_id="believed",
        sources=[],
        options={},
        start_ns=0,
        end_ns=end_ns,
        clock=Clock(name="sensor", reason="synthetic", knots=[(0, 0), (end_ns, end_ns)]),
        frames=Frames(map="map", odom=None, base="base", tree=[]),
        roles=[
            Role(role=role, topic="/pose", type="synthetic", messages=n, reason="the only one")
            for role in ("pose", "covariance")
        ],
        missing=[],
        maps=[],
        losses=[],
        tables={},
    )
    return Bundle(manifest, {"poses": poses}, {})
