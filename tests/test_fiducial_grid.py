"""Codes in the floor: the filter among them, their lattice, and a drive unit over a whole log."""

from dataclasses import replace

import numpy as np
import pytest
from ekf_world import EXACT, world
from scipy.stats import chi2

from slamreplay.bundle.sightings import Sightings
from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.evidence.nees import nees
from slamreplay.errors import NotApplicableError, UsageError
from slamreplay.estimators.ekf import kernels
from slamreplay.estimators.ekf.filter import filtered, gates_of
from slamreplay.estimators.ekf.observations import base_by
from slamreplay.estimators.fiducial_grid.codes import CodeNoise, codes_of
from slamreplay.estimators.fiducial_grid.estimator import FRAME, FiducialGrid
from slamreplay.estimators.fiducial_grid.lattice import lattice_of
from slamreplay.estimators.start import GLOBAL
from slamreplay.geometry import se2
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest
from slamreplay.replay.metrics import judging_reference
from slamreplay.simulate.pipeline import simulate
from slamreplay.testing.estimators import check_estimator

WIDE, GATES = gates_of(1.0 - 1e-12), gates_of(0.999)
NOISE = CodeNoise(0.012, 0.02)
COLUMNS, ROWS = 16, 14


def floor(spacing=0.7):
    """Places of codes 0, 1, ... along rows, on a floor that lies turned in the map."""
    row, column = np.divmod(np.arange(COLUMNS * ROWS), COLUMNS)
    at = np.column_stack([spacing * column - 4.0, spacing * row - 4.0, np.zeros(len(row))])
    return se2.compose([0.3, -0.2, 0.4], at)


def among_codes(seed, seconds=60.0, hidden=(), wrong=0.0, spacing=0.7, name="tag_{}", begins=0):
    """Evidence of a robot over a floor of codes, its true poses, and what was read."""
    evidence, truth = world(seed, EXACT, seconds)
    rng = np.random.default_rng(seed + 500)
    t_ns, places = evidence.row_ns, floor(spacing)
    near = np.hypot(*(truth[:, None, :2] - places[None, :, :2]).transpose(2, 0, 1))
    code = near.argmin(axis=1)
    seen = near.min(axis=1) < 0.2
    for low, high in hidden:
        seen &= (t_ns < low * 10**9) | (t_ns >= high * 10**9)
    rows = np.flatnonzero(seen)
    away = se2.between(truth[rows], places[code[rows]])
    noise = rng.standard_normal((len(rows), 3)) * [NOISE.code_m, NOISE.code_m, NOISE.code_rad]
    misread = rng.random(len(rows)) < wrong
    other = (code[rows] + rng.integers(1, len(places), len(rows))) % len(places)
    number = np.where(misread, other, code[rows])
    nan = np.full((len(rows), 3, 3), np.nan)
    read = Sightings(
        t_ns[rows], np.full(len(rows), "fiducial", dtype=object),
        np.array([name.format(n + begins) for n in number], dtype=object), away + noise, nan, nan,
        {name.format(n + begins): place for n, place in enumerate(places)},
    )  # fmt: skip
    codes = codes_of(read, read.surveyed, NOISE)
    return replace(evidence, observations=codes), truth, read, misread


def of(e, P):
    e = np.array([*e[:2], se2.wrap_angle(e[2])])
    return e @ np.linalg.solve(P, e)


def test_a_point_below_is_expected_where_it_is_and_its_derivative_is_the_numbers():
    x, place = np.array([0.3, -0.2, 0.7, 0.0]), np.array([0.35, -0.1, 0.2])
    H, expected, unused = np.zeros((3, 4)), np.zeros(3), np.zeros((3, 4))
    kernels.of_near(x, place, 2, H, expected)

    def seen(state):
        out = np.zeros(3)
        kernels.of_near(state, place, 2, unused, out)
        return out[:2]

    np.testing.assert_allclose(expected[:2], se2.between(x[:3], place)[:2], atol=1e-12)
    for i, e in enumerate(1e-6 * np.eye(4)):
        np.testing.assert_allclose(H[:2, i], (seen(x + e) - seen(x - e)) / 2e-6, atol=1e-8)


def test_the_base_by_a_code_and_its_covariance_are_those_of_draws():
    rng = np.random.default_rng(0)
    place, seen = np.array([2.0, 1.0, 0.6]), np.array([0.4, -0.3, 1.1])
    R = np.array([[4e-4, 1e-4, 0.0], [1e-4, 2e-4, 5e-5], [0.0, 5e-5, 1e-4]])
    pose, cov = base_by(seen[None], R[None], place[None])
    draws = seen + rng.multivariate_normal(np.zeros(3), R, 20_000)
    off = se2.compose(place, se2.inverse(draws)) - pose

    np.testing.assert_allclose(se2.compose(pose, seen[None]), place[None], atol=1e-12)
    np.testing.assert_allclose(np.cov(off.T), cov[0], atol=0.03 * np.abs(cov).max())


def test_matched_noise_is_consistent_and_half_of_it_is_not():
    runs, last, sure, nis = 40, [], [], []
    for seed in range(runs):
        evidence, truth, *_ = among_codes(seed, 30.0)
        for scale, found in ((1.0, last), (0.25, sure)):
            out = filtered(evidence, EXACT, WIDE, scale, scale)
            found.append(of(out.xyyaw[-1] - truth[-1], out.cov[-1]))
            if scale == 1.0:
                used = out.status == kernels.ACCEPTED
                r, S = out.residual[used], out.S[used]
                nis.append(np.einsum("ni,ni->n", r, np.linalg.solve(S, r[..., None])[..., 0]))
    low, high = chi2.ppf([0.025, 0.975], 3 * runs) / runs
    assert low < np.mean(last) < high < np.mean(sure)
    nis = np.concatenate(nis)
    assert np.mean(nis) == pytest.approx(3.0, abs=4.0 * np.sqrt(6.0 / len(nis)))


def test_after_an_occlusion_one_code_pulls_the_pose_back():
    """Thirty seconds blind: the covariance grows all the while, and ends with the first code."""
    evidence, truth, *_ = among_codes(3, hidden=[(20.0, 50.0)])
    out = filtered(evidence, EXACT, GATES)
    t_s = evidence.row_ns / 1e9
    codes_s = evidence.observations.t_ns / 1e9
    blind = np.flatnonzero((t_s > codes_s[codes_s < 20.0][-1]) & (t_s < codes_s[codes_s > 50.0][0]))
    first = blind[-1] + 1
    volume = np.linalg.det(out.cov)  # the trace alone may shrink on the way back to where it was
    size = np.trace(out.cov[:, :2, :2], axis1=1, axis2=2)

    assert (np.diff(volume[blind]) > 0.0).all()
    assert size[blind[-1]] > 20.0 * size[blind[0]]
    assert of(out.xyyaw[blind[-1]] - truth[blind[-1]], out.cov[blind[-1]]) < chi2.ppf(0.999, 3)
    assert out.updated[first] == 1
    assert size[first] < 0.05 * size[blind[-1]]
    assert np.hypot(*(out.xyyaw - truth)[first, :2]) < 0.06
    assert out.recoveries == 0


def test_misread_codes_are_rejected_and_right_ones_are_not():
    evidence, truth, _, misread = among_codes(1, wrong=0.1)
    out = filtered(evidence, EXACT, GATES)

    assert misread.sum() > 10
    assert (out.status[misread] == kernels.REJECTED).mean() > 0.97
    assert (out.status[~misread] == kernels.ACCEPTED).mean() > 0.99
    far = [of(e, P) for e, P in zip(out.xyyaw - truth, out.cov, strict=True)]
    assert max(far) < chi2.ppf(1.0 - 1e-6, 3)
    assert (out.sighted.moved[out.status == kernels.REJECTED] == 0.0).all()


def placed(places):
    return np.array([places[name] for name in sorted(places)])


def same_up_to_a_motion(found, true, atol):
    """Whether two sets of poses differ by one rigid motion, and by the scale of odometry."""
    T = se2.compose(true[0], se2.inverse(found[0]))
    np.testing.assert_allclose(se2.compose(T, found)[:, :2], true[:, :2], atol=atol)


@pytest.mark.parametrize(
    ("name", "begins"), [("tag_{}", 0), ("tag_{}", 5), ("floor 7, code {} of hall 3", 1)]
)
def test_numbers_along_rows_tell_where_codes_lie(name, begins):
    evidence, _, read, misread = among_codes(2, 200.0, wrong=0.03, name=name, begins=begins)
    found = lattice_of(read, evidence.odometry)
    right = sorted(set(read.name[~misread]))

    assert found.spacing_m == pytest.approx(0.7, abs=0.02)
    assert found.columns == COLUMNS
    assert found.share > 0.7
    true = np.array([read.surveyed[n] for n in right])
    same_up_to_a_motion(np.array([found.places()[n] for n in right]), true, atol=0.15)
    known = lattice_of(read, evidence.odometry, 0.7, COLUMNS)
    same_up_to_a_motion(np.array([known.places()[n] for n in right]), true, atol=1e-9)


def test_two_numbers_in_a_name_tell_it_too():
    evidence, _, read, _ = among_codes(2, 100.0)
    number = np.array([int(name.removeprefix("tag_")) for name in read.name])
    row, column = np.divmod(number, COLUMNS)
    names = np.array([f"y{r} x{c}" for r, c in zip(row, column, strict=True)], dtype=object)
    found = lattice_of(replace(read, name=names), evidence.odometry, 0.7)
    there = {n: read.surveyed[old] for n, old in zip(names, read.name, strict=True)}

    assert found.columns == 0
    same_up_to_a_motion(placed(found.places()), placed({n: there[n] for n in found.names}), 1e-9)


def test_numbers_that_follow_no_lattice_tell_nothing():
    evidence, _, read, _ = among_codes(2, 100.0)
    mixed = {name: f"tag_{n}" for n, name in enumerate(
        np.random.default_rng(0).permutation(sorted(read.surveyed)))}  # fmt: skip
    shuffled = replace(read, name=np.array([mixed[n] for n in read.name], dtype=object))
    assert lattice_of(shuffled, evidence.odometry) is None
    assert lattice_of(replace(read, name=np.full(len(read), "tag", dtype=object)),
                      evidence.odometry) is None  # fmt: skip
    still = PoseTrack.without_covariance(
        "odom", "base_link", evidence.row_ns, np.zeros((len(evidence.row_ns), 3))
    )
    assert lattice_of(read, still) is None


def test_codes_without_a_survey_lie_where_those_with_one_say():
    evidence, _, read, _ = among_codes(2, 100.0)
    lattice = lattice_of(read, evidence.odometry, 0.7, COLUMNS)
    few = {name: read.surveyed[name] for name in list(lattice.names)[::6]}
    all_ = lattice.placed(few)
    np.testing.assert_allclose(placed(all_), placed({n: read.surveyed[n] for n in all_}), atol=1e-9)
    liars = {name: se2.compose([0.5 * k, 0.0, 0.0], few[name]) for k, name in enumerate(few)}
    assert lattice.placed(liars) is None
    assert lattice.placed({}) is None


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("floor")
    simulate("barcode_floor", folder / "floor.mcap")
    assert (folder / "floor.mcap").stat().st_size < 2_000_000
    return ingest([folder / "floor.mcap"], folder / "floor.bundle", IngestOptions())


def test_a_drive_unit_without_a_laser_is_followed_to_a_centimetre(drive):
    estimate = FiducialGrid().run(drive.view(), seed=0)
    track, reference = estimate.track, judging_reference(drive)
    held = nees(track, reference)
    error = held.error[np.isfinite(held.error).all(axis=1)]

    assert len(drive.table("scans")) == 0
    assert np.array_equal(track.t_ns, np.unique(track.t_ns))
    assert track.has_pose.mean() > 0.99
    assert (track.frame_id, len(track) > 2000) == ("map", True)
    assert np.sqrt(np.mean(np.sum(error[:, :2] ** 2, axis=1))) < 0.03
    assert held.summary().test.mean < 6.0
    assert estimate.scalars["codes_rejected"] >= 2
    assert estimate.scalars["longest_without_code_s"] > 14.0
    codes = next(i for i in estimate.innovations if i.source == "fiducial with heading")
    assert codes.axes == ("x m", "y m", "heading rad")
    assert {name.rsplit("_", 1)[0] for name in codes.about} == {"fiducial tag"}
    assert np.isfinite(codes.moved).all()


def test_without_a_survey_the_lattice_is_found_and_the_pose_is_in_it(drive):
    transforms = drive.table("transforms")
    surveys = np.char.startswith(transforms["child_frame"].astype(str), "tag_")
    view = drive.view().with_table(transforms.take(~surveys))
    estimate = FiducialGrid().run(view, seed=0)

    assert estimate.track.frame_id == FRAME
    assert estimate.scalars["lattice_columns"] == 12
    assert estimate.scalars["lattice_spacing_m"] == pytest.approx(1.0, abs=0.02)
    own, true = estimate.track, judging_reference(drive).at(estimate.track.t_ns)
    known = FiducialGrid(spacing_m=1.0, columns=12).run(view, seed=0).track
    for track, limit in ((own, 0.15), (known, 0.05)):
        both = np.flatnonzero(track.has_pose & true.has_pose)
        T = se2.compose(true.xyyaw[both[0]], se2.inverse(track.xyyaw[both[0]]))
        off = se2.compose(T, track.xyyaw[both]) - true.xyyaw[both]
        assert np.sqrt(np.mean(np.sum(off[:, :2] ** 2, axis=1))) < limit
    read = drive.table("references")
    soon = read.t_ns < read.t_ns[0] + 5 * 10**9
    early = view.with_table(read.take(soon))
    with pytest.raises(NotApplicableError, match="follow no lattice"):
        FiducialGrid().run(early, seed=0)


def test_it_finds_itself_by_the_codes_alone(drive):
    estimate = FiducialGrid().run(drive.view().with_setting(GLOBAL, 1.0), seed=0)
    track, true = estimate.track, judging_reference(drive).at(estimate.track.t_ns)
    both = track.has_pose & true.has_pose

    assert estimate.scalars["located_by_codes"] == 1
    assert both.mean() > 0.9
    off = (track.xyyaw - true.xyyaw)[both]
    assert np.median(np.hypot(*off[:, :2].T)) < 0.02


def test_a_floor_with_a_survey_is_causal_and_parameters_are_checked():
    check_estimator(Surveyed())
    made = FiducialGrid.from_parameters({"spacing_m": 1, "columns": 12, "heading_per_turn": 0.1})
    assert (made.spacing_m, made.columns, made.noise.heading_per_turn) == (1.0, 12, 0.1)
    for given, message in (
        ({"spacing": 1.0}, "spacing_m"),
        ({"columns": -1}, "columns"),
        ({"code_m": 0.0}, "code_m"),
        ({"code_rad": "small"}, "number"),
    ):
        with pytest.raises(UsageError, match=message):
            FiducialGrid.from_parameters(given)


class Surveyed(FiducialGrid):
    """It says that it looks ahead, for the lattice; where all codes are surveyed it must not."""

    causal = True
