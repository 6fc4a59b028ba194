"""A post-mortem with something of everything in it, for the tests of exports to viewers."""

from dataclasses import replace

import numpy as np

from slamreplay.bundle.findings import Finding
from slamreplay.bundle.products import ChangedRegion, Changes, Hindsight
from slamreplay.bundle.run import Estimate, Run, Trial
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.scene import Lane, Mark, Met, Scene, SceneClouds, ScenePlans, SceneScans
from slamreplay.testing.synthetic import START_NS, room_grid, synthetic_bundle, true_path
from slamreplay.verdict.judgement import FailureMode, Interval, Judgement, Stop
from slamreplay.verdict.limits import Limits

S = 1_000_000_000
N, BEAMS = 60, 7
#: Rows of the belief before the first correction, and rows that hindsight does not know.
SILENT, UNKNOWN = slice(0, 5), slice(30, 34)
#: From this row on the belief is 1.5 m off.
LOST_FROM = 40


def exported() -> tuple[Bundle, Postmortem, tuple[Run, ...]]:
    """Six seconds at 10 Hz: lost from 4 s on, an aisle that changed, two lasers, two runs."""
    bundle = synthetic_bundle(seconds=6.0)
    t_ns = START_NS + np.arange(N, dtype=np.int64) * (S // 10)
    end_ns = int(bundle.manifest.end_ns)
    truth = true_path((t_ns - START_NS) / S)
    belief_xyyaw, where_xyyaw = truth.copy(), truth.copy()
    belief_xyyaw[LOST_FROM:] += [1.5, 0.0, 0.1]
    belief_xyyaw[SILENT], where_xyyaw[UNKNOWN] = np.nan, np.nan
    cov = np.zeros((N, 3, 3)) + np.array([[0.04, 0.01, 0], [0.01, 0.02, 0], [0, 0, 0.01]])
    cov *= np.linspace(1.0, 2.0, N)[:, None, None]
    belief_cov = cov.copy()
    belief_cov[10:12] = np.nan
    belief = PoseTrack("map", "base_link", t_ns, belief_xyyaw, belief_cov)
    where = PoseTrack("map", "base_link", t_ns, where_xyyaw, 0.01 * cov)
    post = Postmortem(
        manifest=bundle.manifest,
        grid=room_grid(),
        belief=belief,
        hindsight=Hindsight(where, 0.02, 0.95, np.full(N, 0.8), 0.13, _changes(t_ns)),
        reference=None,
        reference_kind=None,
        judgement=Judgement(
            "lost",
            0.98,
            "The robot was lost for 2 s.",
            (
                Interval("healthy", START_NS, int(t_ns[LOST_FROM]), 0.97, 0.0, 0.0),
                Interval("lost", int(t_ns[LOST_FROM]), end_ns, 0.98, 1.5, 0.1, ("SR-LOC-001",)),
            ),
            FailureMode("kidnapped", 0.9, ("it jumped",)),
            (
                Stop(int(t_ns[20]), None, None, "healthy", "nobody knows where"),
                Stop(int(t_ns[50]), 1.0, 2.0, "lost", "it was \x00 lost"),
            ),
            (),
            (),
        ),
        findings=(
            Finding("SR-LOC-001", "error", "off by 1.5 m", int(t_ns[LOST_FROM]), end_ns),
            Finding("SR-DAT-002", "warning", "of the whole log"),
        ),
        limits=Limits(),
        scene=_scene(t_ns),
    )
    odom = replace(where, frame_id="odom")
    runs = (
        Run(Trial("b", "amcl", 0), Estimate(belief)),
        Run(Trial("b", "dead_reckoning", 0), Estimate(odom)),
        Run(Trial("b", "ekf", 0), None, "has none"),
    )
    return bundle, post, runs


def _changes(t_ns) -> Changes:
    grid = room_grid()
    appeared, removed = (np.zeros(grid.cells.shape, dtype=bool) for _ in range(2))
    appeared[60:66, 170:180] = True
    removed[160:163, 150:155] = True
    regions = tuple(
        ChangedRegion(kind, _box(mask), 0.5, int(t_ns[first]), int(t_ns[-1]), 9, 0.97)
        for kind, mask, first in (("appeared", appeared, 45), ("removed", removed, 35))
    )
    share = np.where(np.arange(N) >= 35, 0.2, np.nan)
    return Changes(appeared, removed, regions, t_ns, share, 0.7 * share, 0.3 * share)


def _box(mask) -> tuple[float, float, float, float]:
    centres = room_grid().centre_of(np.argwhere(mask))
    return (*centres.min(axis=0).tolist(), *centres.max(axis=0).tolist())


def _scene(t_ns) -> Scene:
    rng = np.random.default_rng(1)
    ends = rng.uniform(-4.0, 4.0, (2, N, BEAMS, 2)).astype(np.float32)
    met = np.tile(np.array([*Met, Met.MAPPED], dtype=np.uint8), (N, 1))
    hit = met != Met.INVALID
    lasers = (
        SceneScans(t_ns, ends[0], hit, met, np.array([0.15, 0.02])),
        SceneScans(t_ns[::2], ends[1][::2], hit[::2], met[::2], np.zeros(2)),
    )
    first = np.array([0, 4, 4, 10])
    clouds = SceneClouds(t_ns[[8, 20, 50]], first, rng.normal(size=(10, 3)).astype(np.float32))
    plans = ScenePlans(
        t_ns[[8, 50]], np.array([0, 3, 10]), rng.normal(size=(10, 2)).astype(np.float32)
    )
    marks = (
        Mark("jump", int(t_ns[LOST_FROM]), None, "jumped by 1.5 m", "warning"),
        Mark("stop", int(t_ns[50]), None, "it was lost", "error"),
    )
    error = np.where(np.arange(N) < 5, np.nan, 0.1)
    lanes = (
        Lane("error_m", "Position error", "m", t_ns, error, 0.5),
        Lane("nees", "NEES", "", t_ns[::3], np.full(N // 3, 3.0), None),
    )
    foot = np.array([[0.3, 0.2], [0.3, -0.2], [-0.3, -0.2], [-0.3, 0.2]])
    return Scene(lasers, clouds, plans, foot, marks, lanes)
