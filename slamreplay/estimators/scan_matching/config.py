"""What may be set of scan matching."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal


@dataclass(frozen=True)
class MatchConfig:
    """Hyper-parameters of local scan matching, one set for all logs.

    What odometry misses is told per root of a metre or a radian, for its variance grows with the
    way; how much of it there is on a log is learned from the matches on the go.

    Attributes:
        icp: what lays a scan onto the lines after it was found: `native`, point to line with the
            prior in it, or `open3d`, with the prior after it, to compare with.
        node_m: a scan becomes a node after so much motion, m.
        node_rad: or after so much turning, rad.
        memory: lines that none of so many nodes have seen are forgotten.
        sigma_m: a point's standard deviation about its line, m.
        points_per_fact: so many points tell as much as one whose error is its own.
        position_per_metre: what odometry misses of the position, m after 1 m.
        position_per_turn: m after turning by 1 rad.
        heading_per_metre: and of the heading, rad after 1 m.
        heading_per_turn: rad after turning by 1 rad.
        late_part: a scan's stamp is off by this share of the time between two scans.
        doubted: a match that scores less than this share of what matches do is looked for again.
        poor: one that scores less than this share is none.
        lost_scans: after so many scans that match nothing a new map is begun.
    """

    icp: Literal["native", "open3d"] = "native"
    node_m: float = 0.2
    node_rad: float = 0.2
    memory: int = 60
    sigma_m: float = 0.02
    points_per_fact: float = 2.0
    position_per_metre: float = 0.025
    position_per_turn: float = 0.025
    heading_per_metre: float = 0.08
    heading_per_turn: float = 0.12
    late_part: float = 0.05
    doubted: float = 0.9
    poor: float = 0.45
    lost_scans: int = 5

    def scaled(self, process: float, measurement: float) -> MatchConfig:
        """The same with variances of odometry and of matches so many times as large."""
        if process == measurement == 1.0:
            return self
        root = math.sqrt(process)
        return replace(
            self,
            position_per_metre=root * self.position_per_metre,
            position_per_turn=root * self.position_per_turn,
            heading_per_metre=root * self.heading_per_metre,
            heading_per_turn=root * self.heading_per_turn,
            points_per_fact=measurement * self.points_per_fact,
        )
