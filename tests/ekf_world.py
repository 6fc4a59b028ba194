"""A robot with exactly the noise that it is told of, as evidence for the filter."""

import numpy as np

from slamreplay.bundle.track import PoseTrack
from slamreplay.estimators.ekf.noise import Noise
from slamreplay.estimators.ekf.observations import Observations
from slamreplay.estimators.ekf.passing import Evidence
from slamreplay.estimators.start import Start
from slamreplay.geometry import se2

HZ, SECOND = 20, 10**9
#: The sensor sits exactly in the base.
EXACT = Noise(mount_m=0.0, mount_rad=0.0)
PLACES = np.array(
    [[4.0, 1.0, 0.0], [-3.0, 4.0, 0.0], [0.5, -5.0, 0.0], [6.0, 6.0, 0.0], [-5.0, -3.0, 0.0],
     [2.0, 3.5, 0.0]]
)  # fmt: skip
START_COV = np.array([[0.02, 0.005, 0.001], [0.005, 0.01, 0.002], [0.001, 0.002, 0.01]])


def world(seed, noise=EXACT, seconds=60.0, every=10, wrong=0.0):
    """Evidence, and the true poses (N, 3) at its rows, which are the odometry's.

    Args:
        seed: of all noise.
        noise: how odometry and sightings scatter, and their constant errors.
        seconds: length; `every` that many odometry samples each thing within 8 m is seen.
        wrong: share of the sightings that carry another thing's name.
    """
    rng = np.random.default_rng(seed)
    n = int(seconds * HZ)
    t_ns = np.arange(n, dtype=np.int64) * SECOND // HZ
    turn = (0.1 + 0.4 * np.sign(np.sin(np.arange(1, n) / HZ * 0.9 + 1.0))) / HZ  # as robots do
    steps = np.column_stack([np.full(n - 1, 0.3 / HZ), np.zeros(n - 1), turn])
    length = steps[:, 0]
    heading = np.sqrt(
        noise.heading_per_metre**2 * length + noise.heading_per_turn**2 * np.abs(turn)
    )
    sigma = np.column_stack([*[noise.position_per_metre * np.sqrt(length)] * 2, heading])
    ratio = np.array([noise.distance_ratio, noise.distance_ratio, noise.turn_ratio])
    moved = steps * ratio + sigma * rng.standard_normal(steps.shape)
    told, truth = np.zeros((n, 3)), np.zeros((n, 3))
    truth[0] = rng.multivariate_normal(np.zeros(3), START_COV)
    for k in range(n - 1):
        told[k + 1] = se2.compose(told[k], steps[k])
        truth[k + 1] = se2.compose(truth[k], moved[k])
    odometry = PoseTrack.without_covariance("odom", "base_link", t_ns, told)
    seen = _sightings(rng, noise, t_ns[::every], truth[::every], wrong)
    return Evidence(odometry, seen, t_ns, [Start(0, np.zeros(3), START_COV)]), truth


def _sightings(rng, noise, t_ns, truth, wrong):
    off = PLACES[None, :, :2] - truth[:, None, :2]
    reach = np.hypot(off[..., 0], off[..., 1])
    bearing = np.arctan2(off[..., 1], off[..., 0]) - truth[:, None, 2]
    shape = (len(truth), len(PLACES), 2)
    keep = np.exp(-np.diff(t_ns, prepend=t_ns[:1]) / SECOND / noise.lasting_s)
    lasting = np.zeros(shape)
    fresh = rng.standard_normal(shape)
    for k in range(len(truth)):
        before = lasting[k - 1] if k else fresh[0]
        lasting[k] = keep[k] * before + np.sqrt(1.0 - keep[k] ** 2) * fresh[k]
    share = noise.lasting_range_per_m * lasting[..., 0]
    white = rng.standard_normal(shape)
    sigma = np.hypot(noise.range_m, noise.range_per_m * reach)
    told_reach = noise.range_ratio * reach * (1.0 + share) + noise.range_offset_m
    told_reach = told_reach + sigma * white[..., 0]
    told_bearing = bearing + noise.lasting_bearing_rad * lasting[..., 1] + noise.bearing_offset_rad
    told_bearing = told_bearing + noise.bearing_rad * white[..., 1]
    row, thing = np.nonzero((reach < 8.0) & (reach > 0.5))
    polar = np.column_stack(
        [told_reach[row, thing], se2.wrap_angle(told_bearing[row, thing]), np.zeros(len(row))]
    )
    misread = rng.random(len(row)) < wrong
    other = (thing + rng.integers(1, len(PLACES), len(row))) % len(PLACES)
    M = len(row)
    return Observations(
        t_ns[row], np.full(M, "fiducial", dtype=object), np.where(misread, other, thing),
        PLACES, polar, np.full(M, 2), np.full((M, 3, 3), np.nan), 0,
        np.array([f"tag {k}" for k in range(len(PLACES))]),
    )  # fmt: skip
