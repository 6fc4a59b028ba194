"""What may be set of the pose graph, one set for all logs."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class GraphConfig:
    """Hyper-parameters of loop closing and of what comes after it.

    Attributes:
        min_score: a place must explain this much of a submap, as in Cartographer (Hess et al.,
            Real-time loop closure in 2D lidar SLAM, ICRA 2016, section V-C).
        submap_m: length of a submap along the way, m.
        apart_m: what was seen less than this ago along the way closes no loop, m.
        reach_m: two submaps may show the same things from this far apart, m.
        window_m: the farthest to either side that a place is searched; where the graph is not sure
            to within it the whole map is searched, m.
        least_window_m: and the least to either side; 0 trusts the graph's own covariance, where
            Cartographer searches 7 m whatever it knows (`linear_search_window` of pose_graph.lua).
        sure_m: where the graph knows a place to this (standard deviation) a closure is taken as it
            is; elsewhere it must be confirmed, m.
        confirmations: by so many others that it agrees with. The same lets in what speaks against
            the motions: they are then trusted less.
        gate: chi-square of 3 degrees of freedom that a closure may be off: 99.9 %.
        phi: chi-square beyond which a closure is switched off gradually.
        trust: information of a match over the curvature of its score. The score is broader than
            the errors of points, but neighbouring points err alike.
        closure_m: and what is left of a closure's error at the least, m.
        closure_rad: rad.
        rounds: of laying nodes onto nodes of other passes.
        pass_m: they are laid onto nodes this near, m,
        passes: onto so many at the most.
        sigma_m: a point's standard deviation about the line it is laid on, m.
        points_per_fact: so many points tell as much as one whose error is its own.
    """

    min_score: float = 0.55
    submap_m: float = 2.5
    apart_m: float = 10.0
    reach_m: float = 6.0
    window_m: float = 8.0
    least_window_m: float = 0.0
    sure_m: float = 0.4
    confirmations: int = 2
    gate: float = 16.27
    phi: float = 5.0
    trust: float = 1.0
    closure_m: float = 0.01
    closure_rad: float = 0.003
    rounds: int = 3
    pass_m: float = 2.0
    passes: int = 4
    sigma_m: float = 0.02
    points_per_fact: float = 2.0
