"""Iterative closest point in the plane, point to line.

Each point of a cloud is paired with the nearest of a target, and the pose moves to where the points
lie on their partners' lines (Chen and Medioni, Object modelling by registration of multiple range
images, 1992; in the plane Censi, An ICP variant using a point-to-line metric, ICRA 2008). Pairs
are weighed by Welsch's loss with a width that shrinks as the fit improves.

What no line holds is not moved: along a corridor the guess stays, and the result says so, as
Zhang, Kaess and Singh propose (On degeneracy of optimization-based state estimation problems,
ICRA 2016). Noise turns the normals a little, which feigns information along the corridor; it is
summed beside the information itself, and a direction counts as observed where there is much more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from slamreplay.geometry import se2
from slamreplay.matching import icp_kernels
from slamreplay.matching.line_target import LineTarget


@dataclass(frozen=True)
class IcpSettings:
    """How points are registered.

    Attributes:
        reach_m: points farther than this from all of the target have no partner.
        noise_m: standard deviation across a line below which fits are not told apart.
        most_steps: of Gauss and Newton.
        stride: the first steps, down to a few millimetres, take one point of so many.
        least_share: a direction that a smaller share of the points holds is unobserved.
    """

    reach_m: float = 0.5
    noise_m: float = 0.005
    most_steps: int = 40
    stride: int = 4
    least_share: float = 1e-3


@dataclass(frozen=True, eq=False)
class Registration:
    """Where a cloud lies.

    Attributes:
        xyyaw: (3,) pose of the cloud's frame in the target's frame, m and rad.
        information: (3, 3) of x, y, yaw about the target's axes, with the residuals' own variance
            and that of the target's lines; none along directions that are not observed.
        directions: (3, 3) one in each row, unit vectors of x, y and yaw times `lever_m`, from the
            least observed on.
        shares: (3,) of the points' weight that holds each direction, 0 to 1.
        observed: (3,) which of the directions the points hold.
        lever_m: root mean square distance of the points from their frame's origin.
        inliers: share of all points that end near a line, by more than half of a pair's weight.
        rms_m: of the inliers' distances from their lines.
        steps: taken; `converged` where the last was too small to matter.
        converged: whether the steps came to rest.
    """

    xyyaw: se2.Array
    information: se2.Array
    directions: se2.Array
    shares: se2.Array
    observed: NDArray[np.bool_]
    lever_m: float
    inliers: float
    rms_m: float
    steps: int
    converged: bool

    @property
    def covariance(self) -> se2.Array | None:
        """(3, 3) of x, y, yaw about the target's axes; None where a direction is unobserved."""
        if not self.observed.all():
            return None
        return np.asarray(cho_solve(cho_factor(self.information), np.eye(3)))


def icp(
    target: LineTarget,
    points: se2.Array,
    guess: se2.Array,
    settings: IcpSettings | None = None,
) -> Registration:
    """Register points (N, 2), m, with a target, from a guess (3,) of their frame's pose in its own.

    With no points, or none near the target, the guess comes back with nothing observed.
    """
    settings = settings or IcpSettings()
    points = np.ascontiguousarray(points, dtype=np.float64)
    pose = np.array(guess, dtype=np.float64)
    lever = float(np.sqrt((points**2).sum() / max(len(points), 1))) or 1.0
    limits = np.array(
        [
            settings.reach_m,
            settings.noise_m,
            settings.most_steps,
            settings.stride,
            settings.least_share,
            lever,
        ]
    )
    # Rows: information, what noise feigns of it, directions; gradient, shares, observed.
    out = np.zeros((4, 3, 3))
    tally = np.zeros(5)
    partner = np.full(len(points), -1, dtype=np.int64)
    trust = np.ones(len(target.points))
    room = np.zeros((3, 3))
    icp_kernels.register(
        (target.points, target.normals, target.off, target.variance, target.index, trust),
        target.count,
        (target.cell_m, target.corner_xy[0], target.corner_xy[1]),
        points,
        pose,
        limits,
        partner,
        out,
        room,
        tally,
    )
    return Registration(
        np.append(pose[:2], se2.wrap_angle(pose[2])),
        out[0],
        out[2],
        out[3, 1],
        out[3, 2] > 0.0,
        lever,
        float(tally[0]),
        float(tally[1]),
        int(tally[2]),
        bool(tally[3]),
    )
