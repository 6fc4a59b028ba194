"""Consistency: statistics against scipy, invariances, and checks that accuse only with cause."""

import numpy as np
import pytest
from scipy.signal import lfilter

from slamreplay.bundle.findings import FINDINGS, Finding
from slamreplay.bundle.manifest import Clock, Frames, Loss, Manifest, Missing, Role
from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.consistency import CHECKS
from slamreplay.consistency.answers import Suspicion, holm, raised
from slamreplay.consistency.asking import ask
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence.nees import nees
from slamreplay.consistency.evidence.parts import HEADING, POSE, POSITION, judged_parts
from slamreplay.consistency.evidence.published import fresh_rows, published_belief
from slamreplay.consistency.evidence.references import references_of, unused_references
from slamreplay.consistency.evidence.source import Reference
from slamreplay.consistency.statistics.effective_samples import (
    autocorrelation_time,
    effective_samples,
)
from slamreplay.geometry import se2, se3
from slamreplay.geometry.covariance import ros_from_planar, turned

P = np.array([[0.04, 0.01, 0.004], [0.01, 0.09, -0.006], [0.004, -0.006, 0.01]])
SECOND = 1_000_000_000


def ar1(rng, n, rho, dof):
    """A stationary series (n, dof) of unit variance: errors of one log follow each other."""
    noise = rng.standard_normal((n, dof)) * np.sqrt(1 - rho**2)
    noise[0] = rng.standard_normal(dof)
    return lfilter([1.0], [1.0, -rho], noise, axis=0)


def tracks(n=400, scale=1.0, rho=0.0, seed=1, cov=P):
    """A belief whose error has covariance `P`, publishing `cov * scale`, and its reference."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * SECOND // 10
    truth = np.column_stack([t / 1e9, np.sin(t / 3e9), se2.wrap_angle(t / 2e9)])
    error = ar1(rng, n, rho, 3) @ np.linalg.cholesky(P).T
    belief = truth + error
    belief[:, 2] = se2.wrap_angle(belief[:, 2])
    return (
        PoseTrack("map", "base", t, belief, np.tile(cov * scale, (n, 1, 1))),
        PoseTrack.without_covariance("map", "base", t, truth),
    )


# --- effective samples and intervals ---------------------------------------------------------


def test_white_noise_is_worth_nearly_its_length():
    series = np.random.default_rng(0).standard_normal(5000)

    assert effective_samples(series) > 4000


def test_autocorrelation_time_of_ar1_is_the_known_one():
    series = ar1(np.random.default_rng(0), 200_000, 0.9, 1)[:, 0]
    tau, error = autocorrelation_time(series)

    assert tau == pytest.approx((1 + 0.9) / (1 - 0.9), abs=3 * error)
    assert error < 1.5


@pytest.mark.parametrize(
    ("series", "low", "high"),
    [([], 0, 0), ([3.0], 1, 1), ([2.0] * 50, 1, 1), ([1.0, -1.0] * 50, 30, 100)],
)
def test_degenerate_series(series, low, high):
    # A constant is one sample said often; one that alternates is never worth more than its length.
    assert low <= effective_samples(series) <= high


@pytest.mark.parametrize("p", [[], [0.01], [0.01, 0.04, 0.03, 0.005], [0.5, 0.5, 1.0, 1e-9, 0.02]])
def test_holm_is_the_step_down_procedure(p):
    # By its definition: reject in order of size while p_(k) stays below level / (N - k + 1).
    adjusted = holm(p)
    for level in (1e-3, 0.02, 0.05, 0.2, 0.9):
        rejected, alive = set(), True
        for k, at in enumerate(np.argsort(p, kind="stable")):
            alive = alive and p[at] * (len(p) - k) <= level
            rejected |= {int(at)} if alive else set()
        assert rejected == set(np.flatnonzero(adjusted <= level))


def test_a_suspicion_must_survive_the_number_of_questions():
    one = Suspicion(Finding("SR-CON-001", "warning", "too small"), 2e-4)
    others = [Suspicion(Finding("SR-CON-001", "warning", "fine"), 0.5)] * 9
    fact = Finding("SR-CON-003", "info", "no reference")

    assert [f.message for f in raised([one, fact])] == [
        "too small (p = 0.0002, 0.0002 after Holm over 1 tests of this log)",
        "no reference",
    ]
    assert raised([one, *others]) == ()  # 10 x 2e-4


# --- NEES ------------------------------------------------------------------------------------


def test_nees_is_scipys_mahalanobis():
    from scipy.spatial.distance import mahalanobis

    belief, truth = tracks(n=30)
    result = nees(belief, truth)
    inverse = np.linalg.inv(P)
    expected = [mahalanobis(e, np.zeros(3), inverse) ** 2 for e in result.error]

    np.testing.assert_allclose(result.joint, expected, rtol=1e-9)
    np.testing.assert_allclose(
        result.squared(HEADING), result.error[:, 2] ** 2 / P[2, 2], rtol=1e-12
    )
    assert result.invalid == {}


def test_a_consistent_belief_is_consistent_and_a_bold_one_is_told_its_factor():
    honest = nees(*tracks()).summary()
    bold = nees(*tracks(scale=1 / 9)).summary()
    timid = nees(*tracks(scale=9.0)).summary()

    assert honest.credibility == "consistent"
    assert (bold.credibility, timid.credibility) == ("overconfident", "underconfident")
    assert bold.test.ratio == pytest.approx(3 * honest.test.ratio)
    assert "too small by a factor of 3" in bold.sentence
    assert "too large by a factor of 3" in timid.sentence


def test_nees_does_not_change_when_the_world_is_moved():
    belief, truth = tracks(n=50)
    move = np.array([12.0, -7.0, 1.234])
    cov = turned(belief.cov, np.full(50, move[2]))
    moved = PoseTrack("map", "base", belief.t_ns, se2.compose(move, belief.xyyaw), cov)
    elsewhere = PoseTrack.without_covariance(
        "map", "base", truth.t_ns, se2.compose(move, truth.xyyaw)
    )

    np.testing.assert_allclose(nees(moved, elsewhere).joint, nees(belief, truth).joint, rtol=1e-7)


def test_reference_covariance_is_added():
    belief, truth = tracks(n=20)
    vague = PoseTrack("map", "base", truth.t_ns, truth.xyyaw, np.tile(3 * P, (20, 1, 1)))

    np.testing.assert_allclose(nees(belief, vague).joint, nees(belief, truth).joint / 4)


def test_yaw_error_is_wrapped():
    t = np.arange(2)
    one = PoseTrack("map", "b", t, np.array([[0, 0, 3.1], [0, 0, -3.1]]), np.tile(P, (2, 1, 1)))
    two = PoseTrack.without_covariance("map", "b", t, np.array([[0, 0, -3.1], [0, 0, 3.1]]))

    np.testing.assert_allclose(np.abs(nees(one, two).error[:, 2]), 2 * np.pi - 6.2)


def test_invalid_rows_are_counted_by_reason():
    belief, truth = tracks(n=10)
    xyyaw, cov = belief.xyyaw.copy(), belief.cov.copy()
    xyyaw[0] = np.nan
    cov[1] = np.nan
    cov[2] = -cov[2]
    cov[3, 2, 2] = 0.0  # no joint value, but the position can still be judged
    belief = PoseTrack("map", "base", belief.t_ns, xyyaw, cov)
    result = nees(belief, truth.take(np.arange(9)))

    assert result.invalid == {
        "no belief": 1,
        "no reference": 1,
        "no covariance": 1,
        "covariance not positive definite": 2,
    }
    assert np.isfinite(result.joint).sum() == 5
    assert np.isfinite(result.squared(POSITION)).sum() == 6


def test_reference_is_never_extrapolated_and_not_carried_over_gaps():
    belief, truth = tracks(n=40)
    known = np.r_[5:10, 25:30]
    result = nees(belief, truth.take(known))

    assert np.flatnonzero(np.isfinite(result.joint)).tolist() == known.tolist()


def test_reference_without_heading_judges_the_position():
    belief, truth = tracks(n=200)
    xyyaw = truth.xyyaw.copy()
    xyyaw[:, 2] = np.nan
    result = nees(belief, PoseTrack.without_covariance("map", "base", truth.t_ns, xyyaw))

    assert result.summary(POSITION).credibility == "consistent"
    assert result.summary(HEADING).test.n == 0
    assert result.invalid == {"no reference heading": 200}


def test_frames_that_differ_are_refused_not_aligned():
    belief, truth = tracks(n=30)
    lab = PoseTrack.without_covariance("mocap", "base", truth.t_ns, truth.xyyaw)
    result = nees(belief, lab)

    assert "mocap" in result.refusal
    assert result.invalid == {"frames differ": 30}
    assert result.summary().credibility == "insufficient"


# --- references and checks -------------------------------------------------------------------


def rows(name, t, **columns):
    stamps = {"t_ns": t, "t_sensor_ns": t, "t_log_ns": t}
    return Table(TABLES[name], {**stamps, **columns})


def posed(name, track, topic, *, changes=True, **columns):
    n = len(track)
    cov = ros_from_planar(np.nan_to_num(track.cov))
    if changes:  # one that never does is taken for a placeholder
        cov[:1] *= 1 + 1e-6
    if name == "poses":
        columns["source"] = [topic] * n
    return rows(
        name,
        track.t_ns,
        topic=[topic] * n,
        frame_id=[track.frame_id] * n,
        child_frame_id=[track.child_frame_id] * n,
        position_xyz=np.column_stack([track.xyyaw[:, :2], np.zeros(n)]),
        orientation_xyzw=se3.quaternion_from_yaw(track.xyyaw[:, 2]),
        covariance=np.where(np.isnan(track.cov[:, :1, 0]), np.nan, cov),
        **columns,
    )


def static(parent, child, xyyaw):
    return rows(
        "transforms",
        [0],
        topic=["/tf_static"],
        parent_frame=[parent],
        child_frame=[child],
        is_static=[True],
        translation_xyz=[[xyyaw[0], xyyaw[1], 0.0]],
        rotation_xyzw=se3.quaternion_from_yaw(np.array([xyyaw[2]])),
    )


def bundle(tables=(), **manifest):
    everything = {
        "bundle_id": "test",
        "sources": [],
        "options": {},
        "start_ns": 0,
        "end_ns": 40 * SECOND,
        "clock": Clock(name="sensor", reason="test", knots=[(0, 0), (40 * SECOND, 40 * SECOND)]),
        "frames": Frames(map="map", odom=None, base="base", tree=[]),
        "roles": [Role(role="pose", topic="/pose", type="t", messages=1, reason="r")],
        "missing": [],
        "maps": [],
        "losses": [],
        "tables": {},
    }
    everything |= manifest
    return Bundle(Manifest(**everything), {t.schema.name: t for t in tables}, {})


def references(track, kind, topic="/truth"):
    return posed("references", track, topic, kind=[kind] * len(track))


def run(name, log, reference, kind="simulation"):
    view = log.view()
    known = () if reference is None else (Reference(kind, "/truth", reference),)
    return tuple(ask([CheckContext(published_belief(view), known, view)], [name]))


def test_best_reference_is_taken_by_kind_and_hindsight_last():
    _, truth = tracks(n=5)
    both = Table.concat(
        TABLES["references"],
        [references(truth, "fiducial", "/tag"), references(truth, "simulation", "/truth")],
    )
    hindsight = Hindsight(truth, 0.03, 1.0, np.ones(5), None, None)

    assert [r.kind for r in references_of(bundle([both]), hindsight)][::2] == [
        "simulation",
        "hindsight",
    ]
    assert [r.kind for r in references_of(bundle([]), hindsight)] == ["hindsight"]
    assert references_of(bundle([]), None) == ()


def test_reference_in_its_own_frame_is_used_only_by_a_static_transform():
    _, truth = tracks(n=5)
    offset = np.array([3.0, -1.0, 0.7])
    lab = PoseTrack.without_covariance(
        "lab", "base", truth.t_ns, se2.compose(se2.inverse(offset), truth.xyyaw)
    )
    alone = bundle([references(lab, "motion_capture")])
    tied = bundle([references(lab, "motion_capture"), static("map", "lab", offset)])

    assert references_of(alone, None) == ()
    assert "lab" in unused_references(alone)[0].message
    np.testing.assert_allclose(references_of(tied, None)[0].track.xyyaw, truth.xyyaw, atol=1e-9)


def test_reference_of_another_frame_of_the_robot_is_carried_to_the_base():
    _, truth = tracks(n=5)
    mount = np.array([0.3, 0.1, 0.5])
    marker = PoseTrack.without_covariance(
        "map", "marker", truth.t_ns, se2.compose(truth.xyyaw, mount)
    )
    log = bundle([references(marker, "motion_capture"), static("base", "marker", mount)])

    np.testing.assert_allclose(references_of(log, None)[0].track.xyyaw, truth.xyyaw, atol=1e-9)
    assert references_of(bundle([references(marker, "motion_capture")]), None) == ()


def test_nees_check_accuses_the_bold_and_leaves_the_honest_alone():
    honest, truth = tracks(rho=0.3)
    bold, _ = tracks(rho=0.3, scale=1 / 16)

    assert run("nees", bundle([posed("poses", honest, "/pose")]), truth) == ()
    (finding,) = run("nees", bundle([posed("poses", bold, "/pose")]), truth)
    assert (finding.id, finding.severity) == ("SR-CON-001", "error")
    assert "too small by a factor of 4" in finding.message
    assert finding.value > finding.high
    assert finding.n_eff < finding.n == 400


def test_hindsight_never_proves_consistency_and_never_calls_a_belief_timid():
    honest, truth = tracks()
    timid, _ = tracks(scale=25.0)

    for belief in (honest, timid):
        (finding,) = run("nees", bundle([posed("poses", belief, "/pose")]), truth, "hindsight")
        assert (finding.id, finding.severity) == ("SR-CON-003", "info")
        assert "cannot prove consistency" in finding.message


def test_few_effective_samples_accuse_nobody():
    bold, truth = tracks(n=15, scale=1 / 100)
    (finding,) = run("nees", bundle([posed("poses", bold, "/pose")]), truth)

    assert finding.id == "SR-CON-003"
    assert "too few" in finding.message


def test_of_what_cannot_be_decided_the_oddest_is_told():
    for axis, name in ((2, "heading"), (0, "position")):
        split = P.copy()
        split[:2, 2] = split[2, :2] = 0.0
        split[axis, axis] /= 100.0  # sigma of this part is ten times too small
        if axis == 0:
            split[0, 1] = split[1, 0] = 0.0
        belief, truth = tracks(n=15, cov=split)
        (finding,) = run("nees", bundle([posed("poses", belief, "/pose")]), truth)

        assert finding.id == "SR-CON-003"
        assert f"sigma of the {name} is too small" in finding.message


def test_without_coupling_position_and_heading_are_judged_apart():
    split = P.copy()
    split[:2, 2] = split[2, :2] = 0.0
    split[2, 2] /= 100.0  # a heading that is far too sure, a position that is not
    belief, truth = tracks(cov=split)
    log = bundle([posed("poses", belief, "/pose")])
    (finding,) = run("nees", log, truth)

    assert "heading" in finding.message
    context = CheckContext(None, (Reference("survey", "/truth", truth),), log.view())
    assert judged_parts(context.evidence[0], context.updates) == (POSITION, HEADING)
    coupled = CheckContext(tracks()[0], context.references, bundle([]).view())
    assert judged_parts(coupled.evidence[0], coupled.updates) == (POSE,)


def test_held_covariances_are_one_update():
    belief, _ = tracks(n=10)
    cov = np.repeat(belief.cov[:5] * np.arange(1, 6)[:, None, None], 2, axis=0)
    held = PoseTrack("map", "base", belief.t_ns, belief.xyyaw, cov)

    assert fresh_rows(held).t_ns.tolist() == belief.t_ns[::2].tolist()


def test_covariances_that_are_none_are_counted():
    belief, _ = tracks(n=100)
    cov = belief.cov.copy()
    cov[:10] = 0.0
    cov[10:13, 0, 0] = -1.0
    cov[20:22, 0, 1] += 0.01
    log = bundle(
        [posed("poses", PoseTrack("map", "base", belief.t_ns, belief.xyyaw, cov), "/pose")]
    )
    found = {f.message: f.severity for f in run("covariance", log, None)}

    assert found == {
        "10 of 100 published covariances are all zero": "warning",
        "3 of 100 published covariances are not positive definite": "warning",
        "2 of 100 published covariances are not symmetric": "warning",
    }
    never = bundle([posed("poses", belief, "/pose", changes=False)])
    (placeholder,) = run("covariance", never, None)
    assert "placeholder" in placeholder.message


@pytest.mark.parametrize(
    ("knots", "severity", "words"),
    [
        ([(0, 0), (9, 9)], None, ""),
        ([(0, 0), (50 * SECOND, 49 * SECOND)], "warning", "speeds"),
        ([(600_000 * SECOND, 0)], "info", "epoch"),
        ([(7 * SECOND, 976_052_857 * SECOND)], "info", "when the recorder was started"),
        (None, "warning", "stamps are zero"),
    ],
)
def test_clock(knots, severity, words):
    name = "sensor" if knots else "log"
    clock = Clock(name=name, reason="stamps are zero", knots=knots or [])
    found = run("clock", bundle(clock=clock), None)

    assert [f.severity for f in found] == ([severity] if severity else [])
    assert all(words in f.message for f in found)


def test_missing_parts_and_losses_are_said():
    log = bundle(
        missing=[
            Missing(part="map", reason="no topic", consequence="nothing to compare"),
            Missing(part="imu", reason="no topic", consequence="little"),
        ],
        losses=[
            Loss(kind="lost", what="bytes", count=7, reason="file ends early"),
            Loss(kind="skipped", what="images", count=900, reason="no use"),
        ],
    )

    assert [f.severity for f in run("missing", log, None)] == ["warning", "info"]
    (loss,) = run("losses", log, None)
    assert loss.value == 7
    assert "file ends early" in loss.message


def test_every_check_answers_an_empty_log_with_catalogued_findings():
    for name in CHECKS:
        for finding in run(name, bundle(), None, None):
            assert finding.id in FINDINGS
