"""check_noise: does an estimator's covariance fit where its noise does, and not where it does not?

from slamreplay.testing.matched import check_noise
check_noise(MyEstimator())
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import Bundle
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import is_positive_definite
from slamreplay.replay.metrics import judging_reference
from slamreplay.testing.conformance import demand
from slamreplay.testing.synthetic import (
    MOUNT_XYYAW,
    odometry_rows,
    pose_rows,
    room_grid,
    scan_rows,
    sighting_rows,
    survey_rows,
    synthetic_manifest,
    true_path,
)
from slamreplay.testing.synthetic_rows import tf_rows

#: Settings by which an estimator is told other covariances than it takes by itself.
SCALES = frozenset({"process_noise_scale", "measurement_noise_scale"})
#: Of consistent estimators so many miss the interval, both sides together.
MISSED = 1e-3
#: Sigma as it is told, over what the world has, where the estimator is to be caught.
HALF = 0.5


@dataclass(frozen=True)
class WorldNoise:
    """How sensors scatter in a synthetic world; the defaults are what the estimators take.

    Attributes:
        position_per_metre: of position along each axis after 1 m, m, by the root of the distance.
        heading_per_metre: of the heading after 1 m, rad.
        heading_per_turn: of the heading after turning by 1 rad, rad.
        range_m: of a range to a tag, m; `range_per_m` for each metre of it besides.
        range_per_m: see above.
        bearing_rad: of a bearing, rad.
        heading_rad: of the heading of a tag, rad.
        start_m: of the pose that is given at the start, m; half of it in rad.
    """

    position_per_metre: float = 0.03
    heading_per_metre: float = 0.02
    heading_per_turn: float = 0.05
    range_m: float = 0.03
    range_per_m: float = 0.04
    bearing_rad: float = 0.02
    heading_rad: float = 0.1
    start_m: float = 0.01

    def of_steps(self, steps: se2.Array) -> se2.Array:
        """(N, 3) sigma of increments (N, 3)."""
        length, turn = np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])
        along = self.position_per_metre * np.sqrt(length)
        heading = np.sqrt(self.heading_per_metre**2 * length + self.heading_per_turn**2 * turn)
        return np.column_stack([along, along, heading])

    def of_sightings(self, reach: NDArray[np.float64]) -> se2.Array:
        """(M, 3) sigma of range, bearing and heading by range (M,)."""
        far = np.hypot(self.range_m, self.range_per_m * reach)
        return np.column_stack(
            [far, np.full_like(far, self.bearing_rad), np.full_like(far, self.heading_rad)]
        )


def noisy_bundle(seed: int, noise: WorldNoise | None = None, seconds: float = 6.0) -> Bundle:
    """A room whose every sensor scatters by known sigmas: odometry, tags, and the given start.

    Odometry says that the robot drove the ideal path; where it really went scatters about that, so
    that what odometry says of distance and turn is not itself inflated by noise.
    """
    noise = WorldNoise() if noise is None else noise
    rng = np.random.Generator(np.random.PCG64([seed, 2]))
    t_s = np.arange(0.0, seconds + 0.05, 0.05)
    told = true_path(t_s)
    steps = se2.between(told[:-1], told[1:])
    made = steps + rng.standard_normal(steps.shape) * noise.of_steps(steps)
    truth = told.copy()
    for k, step in enumerate(made):
        truth[k + 1] = se2.compose(truth[k], step)
    start = truth[:1] + rng.standard_normal((1, 3)) * noise.start_m * np.array([1.0, 1.0, 0.5])
    T_odom_base = se2.compose(se2.inverse(told[0]), told)
    tags = sighting_rows(t_s[::5], truth[::5], noise.of_sightings, rng)
    judging = pose_rows("references", "/truth", t_s, truth, 1e-12)
    tables = {
        "scans": scan_rows(t_s[::2], truth[::2], room_grid(), rng),
        "odometry": odometry_rows(t_s, T_odom_base),
        "references": Table.concat(TABLES["references"], [judging, tags]),
        "initial_poses": pose_rows(
            "initial_poses", "/initialpose", np.zeros(1), start, noise.start_m**2
        ),
        "transforms": Table.concat(
            TABLES["transforms"],
            [
                tf_rows("odom", "base_link", t_s, T_odom_base),
                tf_rows("base_link", "laser", np.zeros(1), MOUNT_XYYAW[None], is_static=True),
                *survey_rows(),
            ],
        ),
    }
    identity = repr(("noisy", seed, noise, seconds))
    manifest = synthetic_manifest(tables, identity, seconds, with_map=True, with_belief=False)
    frames = manifest.frames.model_copy(update={"map": "map"})
    manifest = manifest.model_copy(update={"frames": frames})
    return Bundle(manifest, tables, {room_grid().version: room_grid()})


def check_noise(
    estimator: Any, *, worlds: Callable[[int], Bundle] = noisy_bundle, seeds: int = 20
) -> None:
    """Raise ConformanceError unless NEES fits where the noise does, and misses where it does not.

    The last pose of each of `seeds` worlds is held against the truth: independent runs, so that
    the sum of their NEES is chi-square of 3 `seeds` degrees of freedom for a consistent estimator
    (Bar-Shalom, Li, Kirubarajan 2001, section 5.4.2). Told half of the noise, it must be larger.

    Args:
        estimator: one with the settings `SCALES`, or with `told(scale)`, which gives the same one
            told sigmas of `scale` times its own. One of whose noise no world can be made says why
            in `without_noise: str`, and is asked nothing.
        worlds: bundles by seed with exactly the noise that the estimator takes by default.
        seeds: how many.
    """
    name = estimator.name
    reason = getattr(estimator, "without_noise", "")
    can_be_told = estimator.settings >= SCALES or hasattr(estimator, "told")
    demand(
        can_be_told or reason,
        f"{name} must take the settings {', '.join(sorted(SCALES))}, offer told(scale), or say in "
        "without_noise why no world has the noise that it takes",
    )
    if reason:
        return
    bundles = [worlds(seed) for seed in range(seeds)]
    low, high = (float(chdtri(3 * seeds, p)) / seeds for p in (1.0 - MISSED / 2.0, MISSED / 2.0))
    matched = _mean_nees(estimator, bundles, 1.0)
    demand(
        low <= matched <= high,
        f"{name}: mean NEES is {matched:.3g} where its noise is that of the world, consistent ones "
        f"lie within {low:.3g} to {high:.3g}",
    )
    halved = _mean_nees(estimator, bundles, HALF)
    demand(
        halved > high,
        f"{name}: told half of the noise its mean NEES is {halved:.3g}, which {high:.3g} allows: "
        "its covariance does not follow what it is told",
    )


def _mean_nees(estimator: Any, bundles: list[Bundle], scale: float) -> float:
    total = 0.0
    for seed, bundle in enumerate(bundles):
        view, asked = bundle.view(), estimator
        if estimator.settings >= SCALES:
            for setting in sorted(SCALES) if scale != 1.0 else ():
                view = view.with_setting(setting, scale**2)
        else:
            asked = estimator.told(scale)
        track = asked.run(view, seed=seed).track
        truth = judging_reference(bundle)
        assert truth is not None  # every world has one
        row = np.flatnonzero(track.has_pose)[-1:]
        demand(len(row), f"{estimator.name} has no pose in a world whose noise it knows")
        error = track.xyyaw[row] - truth.at(track.t_ns[row]).xyyaw
        error[:, 2] = se2.wrap_angle(error[:, 2])
        P = track.cov[row]
        demand(is_positive_definite(P).all(), f"{estimator.name}: its last covariance is none")
        total += float(np.sum(np.linalg.solve(np.linalg.cholesky(P), error[..., None]) ** 2))
    return total / len(bundles)
