"""Laser models: how likely a scan is at each particle, as nav2_amcl has it."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.estimators.amcl.field import ScoreTable, fits
from slamreplay.estimators.amcl.laser import Beams, likelihood_table
from slamreplay.geometry import se2
from slamreplay.maps.grid import FREE, OCCUPIED, OccupancyGrid
from slamreplay.maps.raycast import cast_rays

#: The likelihood of what a model calls impossible; keeps logarithms finite.
LEAST = 1e-9


class LaserModel(Protocol):
    """A way to weigh particles by a scan."""

    def __call__(
        self, particles: se2.Array, beams: Beams, *, is_converged: bool
    ) -> tuple[se2.Array, float]:
        """Likelihood (N,) of a scan at particles (3, N), and the logarithm of a common factor."""
        ...


def laser_model(
    config: AmclConfig, grid: OccupancyGrid, distance_m: NDArray[np.float32]
) -> LaserModel:
    """The model that the configuration asks for.

    Args:
        config: the filter's.
        grid: the map.
        distance_m: (H, W) from its cells to the nearest wall, as the filter cuts it.
    """
    if config.laser_model_type == "beam":
        return BeamModel(config, grid)
    if config.laser_model_type == "likelihood_field_prob":
        return FieldProb(config, grid, distance_m)
    return Field(config, grid, distance_m)


class BeamScores:
    """Scores of beams' ends: a power of a beam's likelihood, or its logarithm.

    The table is made anew when the laser's reach changes, over which the z_rand part is spread.

    Args:
        config: the filter's.
        grid: the map.
        distance_m: (H, W) from its cells to the nearest wall.
        power: which; None stands for the logarithm.
    """

    def __init__(
        self,
        config: AmclConfig,
        grid: OccupancyGrid,
        distance_m: NDArray[np.float32],
        power: int | None,
    ) -> None:
        self._config, self._grid, self._distance_m = config, grid, distance_m
        self._power = power
        self._reach_m = np.nan
        self._table: ScoreTable | None = None

    def of(self, beams: Beams) -> ScoreTable:
        """The table for a scan."""
        if self._table is None or self._reach_m != beams.reach_m:
            likelihood = likelihood_table(self._config, self._distance_m, beams.reach_m)
            if self._power is None:
                scores = np.log(np.maximum(likelihood, LEAST))
            else:
                scores = likelihood**self._power
            self._table = ScoreTable.of(scores, self._grid)
            self._reach_m = beams.reach_m
        return self._table


class Field:
    """`likelihood_field`: 1 plus the cubes of the beams' likelihoods, nav2's ad-hoc scheme."""

    def __init__(
        self, config: AmclConfig, grid: OccupancyGrid, distance_m: NDArray[np.float32]
    ) -> None:
        self._cubes = BeamScores(config, grid, distance_m, 3)

    def __call__(
        self,
        particles: se2.Array,
        beams: Beams,
        *,
        is_converged: bool,  # noqa: ARG002 - of no use to this model
    ) -> tuple[se2.Array, float]:
        """Likelihood (N,) of a scan at particles (3, N), and the log of a common factor."""
        table = self._cubes.of(beams)
        return 1.0 + table.sums(table.local(particles), beams.ends), 0.0


class FieldProb:
    """`likelihood_field_prob`: the product of the beams' likelihoods (Prob. Robotics, table 6.3).

    With `do_beamskip` a converged cloud leaves out beams that end far from walls at most particles,
    unless these are nearly all: then it may have converged on the wrong place.
    """

    def __init__(
        self, config: AmclConfig, grid: OccupancyGrid, distance_m: NDArray[np.float32]
    ) -> None:
        self._config = config
        self._logs = BeamScores(config, grid, distance_m, None)
        self._near: ScoreTable | None = None
        if config.do_beamskip:
            near = np.pad(distance_m < config.beam_skip_distance, 1)
            self._near = ScoreTable.of(near.astype(np.float64), grid)

    def __call__(
        self, particles: se2.Array, beams: Beams, *, is_converged: bool
    ) -> tuple[se2.Array, float]:
        """Likelihood (N,) of a scan at particles (3, N), and the log of a common factor."""
        table = self._logs.of(beams)
        local, ends = table.local(particles), beams.ends
        if self._near is not None and is_converged and len(beams):
            ends = np.ascontiguousarray(ends[:, self._kept(self._near, local, ends)])
        logs = table.sums(local, ends)
        top = float(logs.max())
        return np.exp(logs - top), top

    def _kept(
        self, near: ScoreTable, local: NDArray[np.float32], ends: se2.Array
    ) -> NDArray[np.bool_]:
        """(M,) which beams enough particles explain; all where hardly any are."""
        c = self._config
        count = np.empty(ends.shape[1], dtype=np.int64)
        fits(
            local,
            ends.astype(np.float32),
            near.cells,
            near.shift,
            near.height,
            near.width,
            count,
        )
        kept = count > c.beam_skip_threshold * local.shape[1]
        if (~kept).sum() >= c.beam_skip_error_threshold * len(kept):
            kept[:] = True
        return kept


class BeamModel:
    """`beam`: how far the map lets a beam go (Prob. Robotics, section 6.3), cubed and added up.

    As nav2_amcl has it: the Gaussian without a normaliser; cells that are not known to be free stop
    a beam, and so does the map's edge.
    """

    def __init__(self, config: AmclConfig, grid: OccupancyGrid) -> None:
        self._config = config
        free = np.pad(grid.free, 1)
        size = grid.resolution_m
        origin = se2.compose(grid.origin_xyyaw, np.array([-size, -size, 0.0]))
        self._walls = OccupancyGrid(np.where(free, FREE, OCCUPIED).astype(np.int8), size, origin)

    def __call__(
        self,
        particles: se2.Array,
        beams: Beams,
        *,
        is_converged: bool,  # noqa: ARG002 - of no use to this model
    ) -> tuple[se2.Array, float]:
        """Likelihood (N,) of a scan at particles (3, N), and the log of a common factor."""
        c, walls, reach = self._config, self._walls, beams.reach_m
        lasers = se2.compose(particles.T, np.asarray(beams.xyyaw_base_laser, dtype=np.float64))
        expected = np.minimum(cast_rays(walls, lasers, beams.bearings, reach), reach)
        expected[~walls.inside(walls.cell_of(lasers[:, :2]))] = 0.0
        z = beams.ranges_m - expected
        likelihood = c.z_hit * np.exp(-(z**2) / (2.0 * c.sigma_hit**2))
        short = c.z_short * c.lambda_short * np.exp(-c.lambda_short * beams.ranges_m)
        likelihood += np.where(z < 0.0, short, 0.0)
        likelihood += np.where(beams.ranges_m >= reach, c.z_max, c.z_rand / reach)
        return 1.0 + (likelihood**3).sum(axis=1), 0.0
