"""How far it is from the robot's edge to the nearest obstacle, and in which direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.transforms import clean_frame
from slamreplay.maps.grid import OccupancyGrid

#: A costmap older than this says nothing about the moment.
FRESH_NS = 5_000_000_000
#: nav2 publishes lethal cells as 100 and those within the inscribed radius of one as 99.
LETHAL, INSCRIBED = 100, 99


@dataclass(frozen=True)
class Clearance:
    """From the footprint's edge to the nearest obstacle: metres, and the direction in the map."""

    metres: float
    direction_xy: tuple[float, float]


class Obstacles:
    """Nearest obstacles over a log: from the local costmap where it is fresh, else from the map.

    Args:
        view: the log.
        belief: base in map; the map is entered where the robot believed to be, as its planner did.
        footprint_radius_m: used where no costmap tells the inscribed radius.
    """

    def __init__(
        self, view: BundleView, belief: PoseTrack | None, footprint_radius_m: float
    ) -> None:
        self._belief = belief
        self._odometry = odometry_track(view)
        costmaps = view.role("costmap")
        self._costmaps = (
            None if costmaps is None or not len(costmaps) else costmaps.sorted_by_time()
        )
        told = None if self._costmaps is None else inscribed_radius_m(self._costmaps)
        self.radius_m = footprint_radius_m if told is None else told
        self._walls = None if view.grid is None else _centres(view.grid, view.grid.occupied)

    def clearance(self, t_ns: int) -> Clearance | None:
        """At a time on the bundle's clock; None where neither costmap nor map can tell."""
        found = self._from_costmap(t_ns)
        if found is not None or self._walls is None or not len(self._walls):
            return found
        pose = _latest(self._belief, t_ns)
        return None if pose is None else self._nearest(self._walls, pose, 0.0)

    def _from_costmap(self, t_ns: int) -> Clearance | None:
        if self._costmaps is None:
            return None
        row = int(np.searchsorted(self._costmaps.t_ns, t_ns, side="right")) - 1
        if row < 0 or t_ns - self._costmaps.t_ns[row] > FRESH_NS:
            return None
        grid = costmap_grid(self._costmaps, row)
        points = _centres(grid, grid.cells >= LETHAL)
        believed = _latest(self._belief, t_ns)
        pose, turn = believed, 0.0
        if self._belief is None or clean_frame(grid.frame_id) != clean_frame(self._belief.frame_id):
            if self._odometry is None or clean_frame(grid.frame_id) != self._odometry.frame_id:
                return None
            pose = _latest(self._odometry, t_ns)
            if pose is not None and believed is not None:
                turn = float(believed[2] - pose[2])  # costmap axes to the map's
        return None if pose is None or not len(points) else self._nearest(points, pose, turn)

    def _nearest(self, points: se2.Array, pose: se2.Array, turn: float) -> Clearance:
        step = points - pose[:2]
        distance = np.hypot(step[:, 0], step[:, 1])
        i = int(np.argmin(distance))
        cos, sin = np.cos(turn), np.sin(turn)
        direction = (cos * step[i, 0] - sin * step[i, 1], sin * step[i, 0] + cos * step[i, 1])
        return Clearance(
            float(distance[i]) - self.radius_m, (float(direction[0]), float(direction[1]))
        )


def costmap_grid(costmaps: Table, row: int) -> OccupancyGrid:
    """One costmap as a grid."""
    height, width = int(costmaps["height"][row]), int(costmaps["width"][row])
    return OccupancyGrid(
        costmaps["cells"][row].reshape(height, width).copy(),
        float(costmaps["resolution_m"][row]),
        np.array(costmaps["origin_xyyaw"][row]),
        str(costmaps["frame_id"][row]),
    )


def inscribed_radius_m(costmaps: Table) -> float | None:
    """The robot's inscribed radius as the inflation layer drew it; None where it drew nothing."""
    from scipy.ndimage import distance_transform_edt

    radii = []
    for row in np.linspace(0, len(costmaps) - 1, min(5, len(costmaps))).astype(int):
        grid = costmap_grid(costmaps, row)
        lethal = grid.cells >= LETHAL
        ring = grid.cells == INSCRIBED
        if lethal.any() and ring.any():
            # Cells at the border may be inflated from obstacles outside of the window.
            reach = distance_transform_edt(~lethal, sampling=grid.resolution_m)
            radii.append(float(np.quantile(reach[ring], 0.95)))
    return float(np.median(radii)) if radii else None


def _centres(grid: OccupancyGrid, mask: NDArray[np.bool_]) -> se2.Array:
    cells = np.argwhere(mask)
    return grid.centre_of(cells) if len(cells) else np.empty((0, 2))


def _latest(track: PoseTrack | None, t_ns: int) -> se2.Array | None:
    """The last pose up to a time, None where there is none within a second."""
    if track is None or not len(track):
        return None
    rows = np.flatnonzero(track.has_pose & (track.t_ns <= t_ns))
    if not len(rows) or t_ns - track.t_ns[rows].max() > 1_000_000_000:
        return None
    return np.asarray(track.xyyaw[rows[np.argmax(track.t_ns[rows])]])
