"""How far it is from the robot's edge to the nearest obstacle, and in which direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from slamreplay.bundle.costmaps import Costmaps, whole_grid
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
#: The path of a robot that stays where it is.
HERE: se2.Array = np.zeros((1, 2))
HERE.flags.writeable = False


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
        self._costmaps = Costmaps.of(view)
        told = None if self._costmaps is None else inscribed_radius_m(self._costmaps.whole)
        self.radius_m = footprint_radius_m if told is None else told
        self._view = view
        self._of_map: tuple[str, cKDTree | None] = ("", None)

    def clearance(self, t_ns: int, path_xy: se2.Array = HERE) -> Clearance | None:
        """At a time on the bundle's clock; None where neither costmap nor map can tell.

        Args:
            t_ns: the time.
            path_xy: (M, 2) places the robot is about to pass, in its base frame at that time.
        """
        found = self._from_costmap(t_ns, path_xy)
        if found is not None:
            return found
        pose = _latest(self._belief, t_ns)
        walls = None if pose is None else self._walls_at(t_ns)
        if pose is None or walls is None:
            return None
        return self._nearest(walls, pose, path_xy, 0.0)

    def _walls_at(self, t_ns: int) -> cKDTree | None:
        """The walls of the map version that held at a time, None without any."""
        course = self._view.map_course
        held = [h for h in course if h.start_ns <= t_ns] or list(course[:1])
        if not held:
            return None
        version = held[-1].version
        if self._of_map[0] != version:
            grid = self._view.grid_of(version)
            walls = np.empty((0, 2)) if grid is None else _centres(grid, grid.occupied)
            self._of_map = version, cKDTree(walls) if len(walls) else None
        return self._of_map[1]

    def _from_costmap(self, t_ns: int, path_xy: se2.Array) -> Clearance | None:
        costmap = None if self._costmaps is None else self._costmaps.at(t_ns)
        if costmap is None or t_ns - costmap.t_ns > FRESH_NS:
            return None
        grid = costmap.grid
        points = _centres(grid, grid.cells >= LETHAL)
        believed = _latest(self._belief, t_ns)
        pose, turn = believed, 0.0
        if self._belief is None or clean_frame(grid.frame_id) != clean_frame(self._belief.frame_id):
            if self._odometry is None or clean_frame(grid.frame_id) != self._odometry.frame_id:
                return None
            pose = _latest(self._odometry, t_ns)
            if pose is not None and believed is not None:
                turn = float(believed[2] - pose[2])  # costmap axes to the map's
        if pose is None or not len(points):
            return None
        return self._nearest(cKDTree(points), pose, path_xy, turn)

    def _nearest(
        self, tree: cKDTree, pose: se2.Array, path_xy: se2.Array, turn: float
    ) -> Clearance:
        """The narrowest place of the path, and the direction of what is nearest there."""
        places = se2.transform_points(pose, path_xy)
        distance, nearest = tree.query(places)
        i = int(np.argmin(distance))
        step = np.asarray(tree.data)[nearest[i]] - places[i]
        cos, sin = np.cos(turn), np.sin(turn)
        direction = (cos * step[0] - sin * step[1], sin * step[0] + cos * step[1])
        return Clearance(
            float(distance[i]) - self.radius_m, (float(direction[0]), float(direction[1]))
        )


def inscribed_radius_m(costmaps: Table) -> float | None:
    """The robot's inscribed radius as the inflation layer drew it; None where it drew nothing."""
    from scipy.ndimage import distance_transform_edt

    radii = []
    for row in np.linspace(0, len(costmaps) - 1, min(5, len(costmaps))).astype(int):
        grid = whole_grid(costmaps, row)
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
