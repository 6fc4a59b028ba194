"""A pose graph that grows while the robot drives: iSAM2."""

from __future__ import annotations

import gtsam
import numpy as np

from slamreplay.geometry import se2
from slamreplay.geometry.covariance import planar_from_gtsam
from slamreplay.graph.relations import Relations, factors_of, prior, relative_covariance

#: Metres, metres, radians by which a pose moves before it is linearised again.
RELINEARISE = 0.01
#: A closure may move the whole loop: so many steps at the most, until no pose moves farther.
STEPS, STILL_M = 8, 1e-3


class OnlineGraph:
    """Poses 0, 1, ... in the order in which they come (Kaess et al., iSAM2, IJRR 2012).

    Args:
        xyyaw: (3,) the first pose.
        cov: (3, 3) of it, about the parent's axes.
    """

    def __init__(self, xyyaw: se2.Array, cov: se2.Array) -> None:
        rules = gtsam.ISAM2Params()
        rules.setRelinearizeThreshold(RELINEARISE)
        rules.relinearizeSkip = 1
        # Certain and doubtful motions beside each other are too much for normal equations.
        rules.setFactorization("QR")
        self._isam = gtsam.ISAM2(rules)
        self._count = 0
        self._motions: list[tuple[int, Relations]] = []
        self._add([prior(xyyaw, cov)], xyyaw)

    def __len__(self) -> int:
        return self._count

    @property
    def poses(self) -> se2.Array:
        """(N, 3) as they are now."""
        poses = gtsam.utilities.extractPose2(self._isam.calculateEstimate()).reshape(-1, 3)
        poses[:, 2] = se2.wrap_angle(poses[:, 2])
        return np.asarray(poses)

    def extend(self, motion: se2.Array, cov: se2.Array) -> None:
        """Add a pose: the last one moved by `motion` (3,) with covariance (3, 3), its axes."""
        last = self._count - 1
        here = self._isam.calculateEstimatePose2(last)
        step = Relations(np.array([[last, last + 1]]), motion[None], cov[None])
        there = se2.compose(np.array([here.x(), here.y(), here.theta()]), motion)
        numbers = self._add(factors_of(step), there)
        self._motions.append((numbers[0], step))

    def loosen(self, first: int, last: int, ratio: float) -> None:
        """Multiply the covariances of the motions from pose `first` to `last`."""
        old = [number for number, _ in self._motions[first:last]]
        steps = [
            Relations(step.pairs, step.xyyaw, step.cov * ratio)
            for _, step in self._motions[first:last]
        ]
        numbers = self._add([f for step in steps for f in factors_of(step)], without=old)
        self._motions[first:last] = list(zip(numbers, steps, strict=True))

    def close(self, relations: Relations) -> list[int]:
        """Add relations between poses that are there; their numbers, to take them out again."""
        return self._add(factors_of(relations))

    def undo(self, numbers: list[int]) -> None:
        """Take relations out again."""
        self._add([], without=numbers)

    def marginal(self, k: int) -> se2.Array:
        """(3, 3) covariance of pose k about the parent's axes."""
        yaw = self._isam.calculateEstimatePose2(k).theta()
        cov = planar_from_gtsam(self._isam.marginalCovariance(k), yaw)
        return np.asarray((cov + cov.T) / 2.0)

    def relative(self, poses: se2.Array, i: int, j: int) -> se2.Array:
        """(3, 3) covariance of pose j seen from pose i, about axes of i, at poses (N, 3)."""
        joint = self._isam.jointMarginalCovariance(gtsam.KeyVector([i, j]))
        return relative_covariance(
            poses[i], poses[j], joint.at(i, i), joint.at(j, j), joint.at(i, j)
        )

    def _add(
        self,
        factors: list[gtsam.NonlinearFactor],
        pose: se2.Array | None = None,
        without: list[int] | None = None,
    ) -> list[int]:
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        for factor in factors:
            graph.add(factor)
        if pose is not None:
            values.insert(self._count, gtsam.Pose2(*pose.tolist()))
            self._count += 1
        result = self._isam.update(graph, values, without or [])
        if pose is None:
            self._settle()
        return [int(k) for k in result.getNewFactorsIndices()]

    def _settle(self) -> None:
        before = self.poses
        for _ in range(STEPS):
            self._isam.update()
            after = self.poses
            if np.abs(after[:, :2] - before[:, :2]).max() < STILL_M:
                break
            before = after
