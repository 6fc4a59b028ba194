"""Post-mortems made by hand, for the tests of what is made of them."""

import math

import numpy as np

from slamreplay.bundle.findings import Finding
from slamreplay.bundle.manifest import Source
from slamreplay.bundle.products import ChangedRegion, Changes, Hindsight
from slamreplay.bundle.run import Estimate, Run, Trial
from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.evidence.nees import nees
from slamreplay.evidence.result import Postmortem, TrialResult
from slamreplay.testing.synthetic import START_NS, room_grid, synthetic_bundle, true_path
from slamreplay.verdict.judgement import Action, FailureMode, Interval, Judgement, Stop
from slamreplay.verdict.limits import Limits

S = 1_000_000_000
HOSTILE = '<script>alert(1)</script> & "quoted" \x00\x1b[31m \ud800'


def lost_post() -> Postmortem:
    """A log of 20 s: lost from 10 s on, an aisle that changed, two trials."""
    bundle = synthetic_bundle(seconds=20.0)
    t = START_NS + np.arange(200, dtype=np.int64) * (S // 10)
    truth = true_path((t - START_NS) / S)
    cov = np.broadcast_to(np.diag([4e-4, 4e-4, 1e-4]), (200, 3, 3)).copy()
    off = np.where((np.arange(200) >= 100)[:, None], [1.5, 0.0, 0.1], 0.0)
    belief = PoseTrack("map", "base_link", t, truth + off, cov)
    where = PoseTrack("map", "base_link", t, truth.copy(), cov.copy())
    grid = room_grid()
    appeared, removed = (np.zeros(grid.cells.shape, dtype=bool) for _ in range(2))
    appeared[60:75, 170:200] = True
    removed[160:170, 150:190] = True
    share = np.where(np.arange(200) >= 150, 0.2, np.nan)
    regions = (
        ChangedRegion("appeared", (4.6, 4.6, 6.0, 5.6), 1.1, int(t[150]), int(t[199]), 84, 0.97),
        ChangedRegion(
            "moved", (1, 2, 3, 4), 0.8, int(t[150]), int(t[199]), 40, 0.9, (5.0, 6.0, 7.0, 8.0)
        ),
    )
    changes = Changes(appeared, removed, regions, t, share, 0.7 * share, 0.3 * share)
    found = Hindsight(where, 0.02, 1.0, np.full(200, 0.8), 0.13, changes)
    end = int(bundle.manifest.end_ns)
    findings = (
        Finding("SR-LOC-001", "error", "off by 1.5 m", START_NS + 10 * S, end, 1.5, 0.0, 0.5, "m"),
        Finding("SR-DAT-002", "warning", HOSTILE),
        Finding("OTHER-7", "info", "of somebody else's check", value=math.nan),
    )
    judgement = Judgement(
        "lost",
        0.98,
        "The robot was lost for 10 s.",
        (
            Interval("healthy", START_NS, START_NS + 10 * S, 0.97, 0.0, 0.0),
            Interval("lost", START_NS + 10 * S, end, 0.98, 1.5, 0.1, ("SR-LOC-001",)),
        ),
        FailureMode("kidnapped", 0.9, ("it jumped",)),
        (Stop(START_NS + 12 * S, 1.0, 2.0, "lost", "it was lost"),),
        (Action(START_NS + 13 * S, "recovery", "Spin", 0.2, 0.3, 2.0, allowed=False),),
        findings,
    )
    runs = (
        Run(Trial("b", "amcl", 0), Estimate(where)),
        Run(Trial("b", "amcl", 0, "tf_delay.all", 0.2, "s"), Estimate(belief)),
        Run(Trial("b", "dead_reckoning", 0, "particles.n", 0.5, "ratio"), None, "has none"),
    )
    source = Source(name="run <1> & 2.mcap", format="mcap", bytes=7, sha256="ab" * 32)
    return Postmortem(
        manifest=bundle.manifest.model_copy(update={"sources": [source]}),
        grid=grid,
        belief=belief,
        hindsight=found,
        reference=where,
        reference_kind="hindsight",
        judgement=judgement,
        findings=findings,
        limits=Limits(),
        nees=nees(belief, where),
        trials=tuple(TrialResult(run, {"nees_mean": 3.0 + k}) for k, run in enumerate(runs)),
    )


def bare_post(post: Postmortem) -> Postmortem:
    """The same log without map, belief, reference and trials."""
    judgement = Judgement(
        "insufficient_data",
        None,
        "It cannot be told.",
        (Interval("insufficient_data", post.manifest.start_ns, post.manifest.end_ns),),
        FailureMode("none", None, ()),
        (Stop(START_NS, None, None, "insufficient_data", "unknown"),),
        (Action(START_NS, "motion", "plan", None, None, None, None),),
        (),
    )
    return Postmortem(
        manifest=post.manifest,
        grid=None,
        belief=None,
        hindsight=None,
        reference=None,
        reference_kind=None,
        judgement=judgement,
        findings=(),
        limits=Limits(),
    )
