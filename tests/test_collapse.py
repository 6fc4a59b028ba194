"""The covariance collapsed: one finding with the right onset and duration; sound beliefs silent."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from beliefs_in_a_room import (
    ROOM,
    SIGMA,
    ar1,
    breathing,
    context,
    poses,
    seconds,
    times,
    told,
)

from slamreplay.bundle.run import Innovations
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.answers import raised
from slamreplay.consistency.asking import ask
from slamreplay.consistency.belief.amcl_limits import is_amcl
from slamreplay.consistency.belief.collapse.check import check
from slamreplay.consistency.belief.collapse.episodes import scan
from slamreplay.consistency.belief.collapse.floor import sensor_floor
from slamreplay.consistency.belief.collapse.size import mean_sigma, position_sigma
from slamreplay.consistency.belief.collapse.stretch import Stretch, merged
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence.references import references_of
from slamreplay.consistency.evidence.source import Reference
from slamreplay.consistency.statistics.sign_correlation import sign_correlation, squares_time
from slamreplay.geometry import se2
from slamreplay.ingest.pipeline import ingest
from slamreplay.testing.edits import rebuilt
from slamreplay.testing.synthetic import START_NS, true_path

ROOT = Path(__file__).resolve().parents[1]
SECOND = 1_000_000_000


# --- how long errors hang together --------------------------------------------------------------


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_correlation_is_read_off_the_signs_whatever_the_sizes(rho):
    rng = np.random.default_rng(1)
    white = ar1(rng, 100_000, rho)
    sized = white * rng.uniform(0.1, 30.0, (len(white), 1))

    np.testing.assert_allclose(sign_correlation(white)[:4], rho ** np.arange(4), atol=0.03)
    np.testing.assert_array_equal(sign_correlation(sized), sign_correlation(white))
    assert squares_time(white) == pytest.approx((1 + rho**2) / (1 - rho**2), rel=0.15)


def test_degenerate_series_are_worth_what_they_are():
    assert squares_time(np.empty((0, 2))) == 1.0
    assert squares_time(np.ones((1, 2))) >= 1.0
    assert squares_time(np.ones((100, 2))) > 50.0  # a constant never says anything new


# --- episodes -----------------------------------------------------------------------------------


@pytest.mark.parametrize("m", [1, 2, 3])
@pytest.mark.parametrize("rho", [0.0, 0.9, 0.99])
def test_the_p_value_of_a_scan_is_one(m, rho):
    p = [scan(ar1(np.random.default_rng(s), 200, rho, m)).p_value for s in range(200)]

    assert np.mean(np.array(p) < 0.05) <= 0.05
    assert min(p) > 1e-3


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9, 0.97])
def test_an_episode_begins_and_ends_where_sigma_was_too_small(rho):
    at = []
    for seed in range(20):
        white = ar1(np.random.default_rng(seed), 400, rho, 2)
        white[200:262] *= 8.0
        (episode,) = scan(white).episodes
        at.append((episode.first, episode.last, episode.factor))
    first, last, factor = np.median(at, axis=0)

    assert abs(first - 200) <= 2
    assert abs(last - 261) <= 2
    assert factor == pytest.approx(8.0, rel=0.35)


def test_two_episodes_are_two_and_a_single_row_is_none():
    white = ar1(np.random.default_rng(3), 600, 0.3, 2)
    white[100:140] *= 7.0
    white[400:450] *= 7.0
    one, two = scan(white).episodes

    assert (abs(one.first - 100) <= 2, abs(two.last - 449) <= 2) == (True, True)
    lone = ar1(np.random.default_rng(3), 600, 0.3, 2)
    lone[300] = 40.0
    assert scan(lone).episodes == ()


@pytest.mark.parametrize("n", [0, 1, 3, 4, 5, 7, 9])
def test_short_series_have_an_answer(n):
    looked = scan(np.full((n, 2), 9.0))

    assert len(looked.episodes) == (1 if n >= 4 else 0)
    assert 0.0 <= looked.p_value <= 1.0


# --- the check: errors --------------------------------------------------------------------------


def slide(rho=0.5, seed=0, start=41.0, lasts=12.5, speed=0.25):
    """A cloud that stays tight while the robot slides away from the belief."""
    t = times()
    error = ar1(np.random.default_rng(seed), len(t), rho) * breathing(len(t))
    away = np.clip(t - start, 0.0, None) * speed
    error[:, 0] += np.where(t < start + lasts, away, 0.0)
    return context(t, error, breathing(len(t)))


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_a_tight_cloud_during_a_slide_is_one_finding_with_onset_and_duration(rho):
    (finding,) = told(ask([slide(rho)], ["collapse"]))
    start, end = seconds(finding)

    assert (finding.id, finding.severity) == ("SR-CON-010", "error")
    assert 41.0 <= start <= 42.4  # after a second the error is three to five sigma
    assert end == pytest.approx(53.4, abs=0.7)
    assert finding.value > 3.0
    assert f"from {start:.1f} s for {end - start:.1f} s sigma of the position stayed at" in (
        finding.message
    )
    assert "while the error against motion capture /truth grew from" in finding.message
    assert finding.p_adjusted < 1e-3


def test_a_sigma_that_shrinks_while_errors_stay_is_said_to_have_shrunk():
    t = times()
    sigma = breathing(len(t))
    error = ar1(np.random.default_rng(4), len(t), 0.6) * sigma
    inside = (t >= 30.0) & (t < 42.0)
    sigma = np.where(inside[:, None], sigma / 10.0, sigma)
    (finding,) = told(ask([context(t, error, sigma)], ["collapse"]))
    start, end = seconds(finding)

    assert start == pytest.approx(30.0, abs=0.6)
    assert end == pytest.approx(41.8, abs=0.6)
    assert "sigma of the position shrank from" in finding.message
    assert "sigma of the heading shrank from" in finding.message  # both parts, one finding
    assert finding.value == pytest.approx(10.0, rel=0.35)


def test_a_wrong_start_is_told_from_the_first_update_on():
    t = times()
    error = (
        np.tile([3.0, 0.0, 0.0], (len(t), 1)) + ar1(np.random.default_rng(2), len(t), 0.9) * SIGMA
    )
    (finding,) = told(ask([context(t, error, breathing(len(t)))], ["collapse", "nees"]))

    assert finding.id == "SR-CON-010"
    assert seconds(finding)[0] < 0.5
    assert "was up to 3." in finding.message


def test_a_belief_that_is_too_sure_all_the_time_has_not_collapsed():
    t = times()
    for seed in range(5):
        error = ar1(np.random.default_rng(seed), len(t), 0.3) * breathing(len(t))
        found = told(ask([context(t, error, breathing(len(t)) / 3.0)], ["collapse", "nees"]))
        assert {f.id for f in found} == {"SR-CON-001"}


def test_one_slide_of_a_belief_that_is_too_sure_anyway_is_still_found():
    t = times()
    error = ar1(np.random.default_rng(1), len(t), 0.3) * breathing(len(t))
    error[(t >= 50.0) & (t < 60.0)] *= 8.0
    (finding,) = told(ask([context(t, error, breathing(len(t)) / 2.0)], ["collapse"]))

    assert seconds(finding)[0] == pytest.approx(50.0, abs=0.7)
    assert finding.value == pytest.approx(16.0, rel=0.3)


def test_hindsight_alone_warns_and_says_what_it_is_worth():
    whole = slide()
    shared = replace(whole, references=(replace(whole.references[0], kind="hindsight"),))
    both = replace(whole, references=(*whole.references, *shared.references))
    (finding,) = told(ask([shared], ["collapse"]))

    assert finding.severity == "warning"
    assert "proves nothing where it is silent" in finding.message
    assert "hindsight" not in told(ask([both], ["collapse"]))[0].message


def test_what_shares_evidence_accuses_nobody_whom_an_independent_source_clears():
    t = times()
    sigma = breathing(len(t))
    sound = context(t, ar1(np.random.default_rng(1), len(t), 0.5) * sigma, sigma)
    truth = sound.references[0].track
    astray = truth.xyyaw + np.where((truth.t_ns - START_NS > 50 * SECOND)[:, None], [2, 0, 0], 0)
    jumped = PoseTrack.without_covariance("map", "base_link", truth.t_ns, astray)
    wrong = Reference("hindsight", "hindsight", jumped)

    assert told(ask([replace(sound, references=(wrong,))], ["collapse"]))
    assert told(ask([replace(sound, references=(*sound.references, wrong))], ["collapse"])) == []


def test_without_a_reference_nothing_is_tested():
    t = times()
    assert check(context(t, np.zeros((len(t), 3)), breathing(len(t)), kind=None)) == ()


# --- the check: facts ---------------------------------------------------------------------------


def silent_between(low_s, high_s):
    """The scans, none of them between two times."""
    scans = ROOM.table("scans")
    t = (scans.t_ns - START_NS) / 1e9
    return scans.take((t < low_s) | (t >= high_s))


def shrinking(t, low, high):
    """Sigma falls to a quarter between two times, and is back afterwards."""
    return np.interp(t, [low, high, high + 0.1], [1.0, 0.25, 1.0])[:, None] * breathing(1)


def test_sigma_that_shrinks_without_a_scan_is_a_fact():
    t = times()
    zero, sigma = np.zeros((len(t), 3)), shrinking(t, 20.0, 27.8)
    silent = context(t, zero, sigma, kind=None, tables=[silent_between(18.0, 28.0)])
    (finding,) = check(silent)
    start, end = seconds(finding)

    assert (finding.id, finding.severity) == ("SR-CON-010", "warning")
    assert (start, end) == (pytest.approx(20.0, abs=0.3), pytest.approx(27.8, abs=0.3))
    assert "although no scan, sighting or fix is in the log" in finding.message
    assert finding.value == pytest.approx(4.0, rel=0.05)
    assert check(context(t, zero, sigma, kind=None)) == ()  # with scans it may learn


def test_an_initial_pose_is_information():
    t = times()
    told_again = poses(np.array([23.9]), np.zeros((1, 3)), SIGMA[None])
    start = Table(
        TABLES["initial_poses"],
        {name: told_again[name] for name in TABLES["initial_poses"].arrow_schema.names},
    )
    sigma = np.where((t < 24.0)[:, None], 1.0, 0.25) * breathing(1)
    tables = [silent_between(18.0, 28.0), start]

    assert check(context(t, np.zeros((len(t), 3)), sigma, kind=None, tables=tables)) == ()
    assert check(context(t, np.zeros((len(t), 3)), sigma, kind=None, tables=tables[:1]))


def of_run(sigma, updated=None, accepted=None):
    t = times()
    t_ns = START_NS + np.rint(t * 1e9).astype(np.int64)
    cov = np.zeros((len(t), 3, 3))
    cov[:, range(3), range(3)] = sigma**2
    track = PoseTrack("map", "base_link", t_ns, true_path(t), cov)
    diagnostics = {} if updated is None else {"updated": updated.astype(float)}
    innovations = ()
    if accepted is not None:
        S = np.tile(np.eye(2), (len(t), 1, 1))
        innovations = (Innovations("scans", t_ns, np.zeros((len(t), 2)), S, accepted),)
    view = rebuilt(ROOM, {}).view()
    return CheckContext(track, (), view, "filter", innovations, diagnostics)


@pytest.mark.parametrize("by", ["updated", "accepted"])
def test_a_run_that_shrinks_although_it_took_nothing_in(by):
    t = times()
    sigma, informed = shrinking(t, 40.0, 45.0), (t < 39.0) | (t >= 45.1)
    (finding,) = told(ask([of_run(sigma, **{by: informed})], ["collapse"]))

    assert finding.message.startswith("filter: from 40")
    assert "although no measurement was taken in" in finding.message
    assert told(ask([of_run(sigma, **{by: informed | True})], ["collapse"])) == []


def test_sigma_below_what_a_scan_can_tell():
    t = times()
    sigma = np.where(((t >= 50.0) & (t < 60.0))[:, None], 2e-4, 1.0) * breathing(len(t)) / SIGMA
    sigma = np.where(sigma < 0.01, sigma, sigma * SIGMA)
    log = context(t, np.zeros((len(t), 3)), sigma, kind=None)
    (finding,) = check(log)

    floor = sensor_floor(log.view)
    # 181 beams at most, walls known to a cell of 5 cm.
    assert floor.position_m == pytest.approx(0.05 / np.sqrt(12 * 181), rel=0.05)
    assert seconds(finding) == (pytest.approx(50.0, abs=0.3), pytest.approx(59.8, abs=0.3))
    assert "what 181 beams can tell at best in a map of 0.05 m cells" in finding.message
    without = context(t, np.zeros((len(t), 3)), sigma, kind=None, grid=None)
    assert sensor_floor(without.view) is None


def sighted(n, sigma_m):
    """Sightings of a tag, each with its noise."""
    t_ns = START_NS + np.arange(n) * SECOND // 10
    cov = (
        np.full((n, 36), np.nan) if sigma_m is None else np.tile(np.eye(6) * sigma_m**2, (n, 1, 1))
    )
    return Table(
        TABLES["references"],
        {
            **dict.fromkeys(("t_ns", "t_sensor_ns", "t_log_ns"), t_ns),
            "topic": ["/tags"] * n,
            "frame_id": ["camera"] * n,
            "child_frame_id": ["tag_1"] * n,
            "kind": ["fiducial"] * n,
            "position_xyz": np.ones((n, 3)),
            "orientation_xyzw": np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)),
            "covariance": cov.reshape(n, 36),
        },
    )


def test_sightings_lower_the_floor_and_take_it_away_where_their_noise_is_unknown():
    t = times()
    zero, sigma = np.zeros((len(t), 3)), breathing(len(t))

    def floor(*tables, grid="same"):
        return sensor_floor(context(t, zero, sigma, kind=None, tables=tables, grid=grid).view)

    alone, both = floor(sighted(100, 0.02), grid=None), floor(sighted(100, 0.02))
    assert alone.position_m == pytest.approx(0.02 / 10)
    assert both.position_m**-2 == pytest.approx(alone.position_m**-2 + floor().position_m ** -2)
    assert both.heading_rad == 0.0
    assert floor(sighted(3, None)) is None


def test_a_map_that_is_being_made_begins_with_a_pose_that_is_known():
    t = times()
    grows = np.interp(t, [0.0, 60.0], [2e-4, 0.02])[:, None] * np.array([1.0, 1.0, 0.5])
    zero = np.zeros((len(t), 3))

    assert check(context(t, zero, grows, kind=None)) == ()
    (finding,) = check(context(t, zero, grows[::-1], kind=None))
    assert "sigma of the position fell to" in finding.message


def test_facts_and_errors_of_one_collapse_are_one_finding():
    t = times()
    sigma = breathing(len(t))
    error = ar1(np.random.default_rng(7), len(t), 0.5) * sigma
    inside = (t >= 50.0) & (t < 60.0)
    sigma = np.where(inside[:, None], sigma / 200.0, sigma)
    (finding,) = told(ask([context(t, error, sigma)], ["collapse"]))

    assert finding.severity == "error"
    assert finding.value > 50.0
    assert "while the error against motion capture" in finding.message
    assert "below the" in finding.message


def test_a_covariance_that_was_not_given_has_no_size():
    cov = np.stack([np.diag([0.04, 0.09, 0.01]), np.full((3, 3), np.nan), -np.eye(3)])

    np.testing.assert_allclose(position_sigma(cov), [np.sqrt(0.06), np.nan, 1.0])
    np.testing.assert_allclose(mean_sigma(cov[:1]), [(0.04 * 0.09 * 0.01) ** (1 / 6)])
    assert np.isnan(mean_sigma(cov)[1])


def test_stretches_that_nearly_touch_are_one():
    one = Stretch(0, 5 * SECOND, {"position": "a"}, 5, 3.0, 1e-5, independent=True)
    near = Stretch(6 * SECOND, 9 * SECOND, {"position": "b"}, 3, 9.0, 1e-4)
    far = Stretch(20 * SECOND, 21 * SECOND, {"heading": "c"}, 2, 2.0, None)

    joined, alone = merged([far, near, one])
    # The independent source speaks, though the other is the more striking.
    assert (joined.start_ns, joined.end_ns, joined.factor) == (0, 9 * SECOND, 3.0)
    assert (joined.reasons, joined.p_value, joined.independent) == ({"position": "a"}, 1e-5, True)
    assert alone == far


# --- sound beliefs ------------------------------------------------------------------------------


def driven(seed):
    """A filter as they are: it stands still now and then, is set anew, and looks all the time."""
    rng = np.random.default_rng(seed)
    t = times(60.0, 5.0)
    rho = (0.0, 0.5, 0.9, 0.97, 0.99)[seed % 5]
    sigma = breathing(len(t))
    stand = slice(60, 60 + 40 * (seed % 2))
    sigma[stand] = sigma[60]  # frozen while it stands
    anew = 150 + rng.integers(0, 50)
    sigma[anew:] *= np.maximum(1.0, 20.0 * 0.7 ** np.arange(len(t) - anew))[:, None]
    if seed % 3 == 0:  # global localization: anywhere at first
        sigma *= np.maximum(1.0, 100.0 * 0.6 ** np.arange(len(t)))[:, None]
    white = ar1(rng, len(t), rho)
    white[stand] = white[60]  # an error that nothing changes
    white[anew:] = ar1(rng, len(t) - anew, rho)
    return context(t, white * sigma, sigma)


def kalman(seed):
    """A Kalman filter of a robot on a plane, tuned as the world is: update at every fifth row."""
    rng = np.random.default_rng(seed)
    t = times(60.0, 5.0)
    q, r = np.array([0.02, 0.02, 0.005]), np.array([0.1, 0.1, 0.03])
    error, variance = rng.standard_normal(3) * 0.5, np.full(3, 0.25)
    errors, sigmas = np.empty((len(t), 3)), np.empty((len(t), 3))
    for row in range(len(t)):
        if not (seed % 2 and 100 <= row < 160):  # it stands
            error, variance = error + rng.standard_normal(3) * q, variance + q**2
        if row % 5 == 0:
            gain = variance / (variance + r**2)
            error = error - gain * (error + rng.standard_normal(3) * r)
            variance = (1.0 - gain) * variance
        errors[row], sigmas[row] = error, np.sqrt(variance)
    errors[:, 2] = se2.wrap_angle(errors[:, 2])
    return context(t, errors, sigmas)


@pytest.mark.parametrize("sound", [driven, kalman])
def test_sound_beliefs_are_left_alone(sound):
    accused = [f for seed in range(200) for f in told(raised(check(sound(seed))))]

    assert len(accused) <= 2, [f.message for f in accused]


# --- logs ---------------------------------------------------------------------------------------


def asked(path, folder):
    bundle = ingest([path], folder)
    known = references_of(bundle, None)
    return told(ask([CheckContext(None, known, bundle.view())], ["collapse"])), bundle


@pytest.mark.parametrize(
    ("name", "onset_s"), [("healthy", None), ("changed_aisle", None), ("lost_robot", 0.1)]
)
def test_sample_logs(name, onset_s, tmp_path):
    found, bundle = asked(ROOT / "sample_logs" / f"{name}.mcap", tmp_path / "b")
    onsets = [(f.start_ns - bundle.manifest.start_ns) / 1e9 for f in found]

    assert onsets == ([] if onset_s is None else [pytest.approx(onset_s, abs=0.1)])


@pytest.mark.parametrize("name", ["evo_nav2/nav2_turtlebot.mcap"])
def test_a_recorded_amcl_is_known_as_one_and_has_not_collapsed(name, real_logs, tmp_path):
    found, bundle = asked(real_logs / name, tmp_path / "b")

    assert found == []
    assert is_amcl(CheckContext(None, (), bundle.view()))
