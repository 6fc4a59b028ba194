"""One world: what the robot knew on board, what its log tells afterwards, and what is true."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.view import BundleView
from slamreplay.evidence.result import Postmortem
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.maps.raycast import cast_rays
from slamreplay.postmortem import postmortem
from slamreplay.simulate import truth
from slamreplay.simulate.bundled import bundle_of
from slamreplay.simulate.recording import Recording, record
from slamreplay.simulate.scenarios import Scenario
from slamreplay.simulate.sensors import XYYAW_BASE_LASER
from slamreplay.simulate.topics import START_NS

#: A beam that ends farther than this from where the map has it, seen from the belief, is off.
OFF_M = 0.2
#: What is exceeded for so long in all decides a log: the verdict's own rule.
FOR_S = 5.0
#: The robot's two measures, then hindsight's two; see `Trial`.
ON_BOARD, AFTERWARDS = ("sigma_m", "beams_off"), ("error_m", "changed_share")


@dataclass(frozen=True, eq=False)
class Trial:
    """One log; rows are its scans.

    Attributes:
        what: what differs from the healthy drive, empty where nothing does.
        level: how much.
        log: number of the drive; those of one number share all noise.
        state: the verdict.
        true_state: what the truth says by the same definitions.
        measures: (N,) by name. `sigma_m`: the belief's own standard deviation along its widest
            axis; `beams_off`: share of beams that do not fit the map where the robot believed to
            be; `error_m`: belief against hindsight; `changed_share`: of the beams, cast from
            hindsight.
        lost: (N,) moments that are lost in truth, and
        changed: (N,) in which the map was contradicted.
        lost_s: for how long the verdict calls the robot lost, and
        changed_s: the map contradicted.
    """

    what: str
    level: float
    log: int
    state: str
    true_state: str
    measures: dict[str, se2.Array]
    lost: NDArray[np.bool_]
    changed: NDArray[np.bool_]
    lost_s: float
    changed_s: float

    @property
    def is_right(self) -> bool:
        """Whether the verdict is the true one."""
        return self.state == self.true_state

    def held(self, name: str) -> float:
        """What a measure exceeded for `FOR_S` in all; the least of all in a shorter log."""
        values = self.measures[name]
        values = np.sort(values[np.isfinite(values)])[::-1]
        rows = round(FOR_S * _RATE_HZ)
        return float(values[min(rows, len(values)) - 1]) if len(values) else np.nan


_RATE_HZ = 10.0


def trial(story: Scenario, what: str, level: float, log: int) -> Trial:
    """Drive, record, read the log, and hold a post-mortem on it."""
    recording = record(story, log)
    bundle = bundle_of(recording)
    found = postmortem(bundle, scene=False)
    t_ns = START_NS + np.array([round(float(t) * NS_PER_S) for t in recording.scans.t_s])
    measures = {**_on_board(bundle.view(), t_ns), **_afterwards(found, t_ns)}
    state, lost, changed = _truth(recording, bundle.view(), t_ns)
    intervals = found.judgement.intervals
    return Trial(
        what,
        level,
        log,
        found.judgement.state,
        state,
        measures,
        lost,
        changed,
        sum(i.duration_ns for i in intervals if i.is_lost) / NS_PER_S,
        sum(i.duration_ns for i in intervals if i.is_changed) / NS_PER_S,
    )


def _on_board(view: BundleView, t_ns: NDArray[np.int64]) -> dict[str, se2.Array]:
    """What the robot has without the future: its covariance, and how its scan fits its map."""
    belief, scans, grid = recorded_belief(view, t_ns), scan_set(view), view.grid
    assert belief is not None
    assert scans is not None
    assert grid is not None
    sigma = np.sqrt(np.linalg.eigvalsh(belief.cov[:, :2, :2])[:, -1])
    reach = float(scans.range_max_m[0])
    lasers = se2.compose(belief.xyyaw, scans.xyyaw_base_laser)
    expected = np.minimum(cast_rays(grid, lasers, scans.bearings(0), reach), reach)
    said = scans.hits | scans.misses
    measured = np.where(scans.hits, scans.ranges_m.astype(np.float64), reach)
    off = said & (np.abs(measured - expected) > OFF_M)
    share = off.sum(axis=1) / np.maximum(said.sum(axis=1), 1)
    return {"sigma_m": sigma, "beams_off": np.where(belief.has_pose, share, np.nan)}


def _afterwards(found: Postmortem, t_ns: NDArray[np.int64]) -> dict[str, se2.Array]:
    """What the log tells with its future: where the robot was, and beams cast from there."""
    error, hindsight = found.error, found.hindsight
    assert error is not None
    assert hindsight is not None
    changes = hindsight.changes
    assert changes is not None
    return {
        "error_m": _at(error.t_ns, error.distance_m, t_ns),
        "changed_share": _at(changes.t_ns, changes.changed_share, t_ns),
    }


def _at(t_ns: NDArray[np.int64], values: se2.Array, at_ns: NDArray[np.int64]) -> se2.Array:
    """(M,) values (N,) at the same stamps, NaN where there is none."""
    row = np.clip(np.searchsorted(t_ns, at_ns), 0, len(t_ns) - 1)
    return np.where(t_ns[row] == at_ns, values[row], np.nan)


def _truth(
    r: Recording, view: BundleView, t_ns: NDArray[np.int64]
) -> tuple[str, NDArray[np.bool_], NDArray[np.bool_]]:
    """State of the log, and its moments that are lost and that are changed."""
    belief = recorded_belief(view, t_ns)
    assert belief is not None
    t_s, lidar = r.scans.t_s, r.scenario.lidar
    with np.errstate(invalid="ignore"):
        far = truth.is_far(belief.xyyaw, r.motion.poses_at(t_s))
    beam_t = (t_s[:, None] + np.arange(lidar.beams) * lidar.time_increment_s).ravel()
    rays = se2.compose(r.motion.poses_at(beam_t), XYYAW_BASE_LASER)
    rays[:, 2] += np.tile(lidar.bearings, len(t_s))
    ranges = r.scans.ranges.astype(np.float64).ravel()
    beams = truth.changed_beams(r.map, r.standing, rays, ranges, lidar.range_max_m)
    valid = (ranges > 0.0).reshape(len(t_s), -1).sum(axis=1)
    share = beams.reshape(len(t_s), -1).sum(axis=1) / np.maximum(valid, 1)
    lost = truth.in_stretches(t_s, far, truth.LOST_FOR_S, truth.GAP_S)
    beyond = share > truth.CHANGED_SHARE
    changed = truth.in_stretches(t_s, beyond, truth.CHANGED_FOR_S, truth.GAP_S)
    return truth.verdict(t_s, far, t_s, share), lost, changed
