"""Each perturbation changes what it says, by as much as it says, and nothing else."""

import numpy as np
import pytest

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.tables import Table
from slamreplay.errors import NotApplicableError, UsageError
from slamreplay.geometry import se2
from slamreplay.perturb import PERTURBATIONS
from slamreplay.testing.synthetic import START_NS, synthetic_bundle

BUNDLE = synthetic_bundle(seconds=20.0)


def perturbed(text: str, level: float, view=None, seed: int = 0):
    name, _, variant = text.partition(".")
    rng = np.random.Generator(np.random.PCG64(seed))
    return PERTURBATIONS.load(name)().apply(view or BUNDLE.view(), variant, level, rng)


def test_tf_delay_makes_the_odometry_at_a_scan_as_old_as_its_level():
    at = np.arange(START_NS + 2_000_000_000, START_NS + 9_000_000_000, 100_000_000)

    late = odometry_track(perturbed("tf_delay.odometry", 0.35)).at(at)

    now = odometry_track(BUNDLE.view()).at(at - 350_000_000)
    np.testing.assert_allclose(late.xyyaw, now.xyyaw, atol=1e-9)
    early = odometry_track(perturbed("tf_delay.odometry", 0.35)).at(np.array([START_NS]))
    assert np.isnan(early.xyyaw).all()  # no transform is old enough yet


@pytest.mark.parametrize(("variant", "moved"), [("odometry", 401), ("all", 441)])
def test_tf_delay_leaves_static_and_other_transforms_alone(variant, moved):
    before = BUNDLE.table("transforms")

    after = perturbed(f"tf_delay.{variant}", 0.5).table("transforms")

    shift = after.t_ns - before.t_ns
    assert set(shift.tolist()) == {0, 500_000_000}
    assert np.count_nonzero(shift) == moved
    assert not shift[before["is_static"]].any()


def test_tf_delay_needs_odometry_on_tf():
    view = BUNDLE.view().with_table(Table.empty(BUNDLE.table("transforms").schema))

    with pytest.raises(NotApplicableError, match="tf"):
        perturbed("tf_delay.odometry", 0.2, view)


@pytest.mark.parametrize(("level", "expected"), [(0.5, 100), (0.25, 150), (0.9, 20)])
def test_scan_drop_even_keeps_the_share(level, expected):
    kept = perturbed("scan_drop.even", level).table("scans")

    assert abs(len(kept) - expected) <= 1
    assert np.diff(kept.t_ns).max() <= 100_000_000 * np.ceil(1 / (1 - level) + 1e-9)


def test_scan_drop_random_drops_more_of_the_same_at_a_higher_level():
    some = set(perturbed("scan_drop.random", 0.7).table("scans").t_ns.tolist())
    many = set(perturbed("scan_drop.random", 0.3).table("scans").t_ns.tolist())

    assert some < many
    assert 30 < len(some) < 90
    assert some != set(perturbed("scan_drop.random", 0.7, seed=1).table("scans").t_ns.tolist())


def test_scan_drop_burst_is_one_gap_of_its_length():
    gaps = np.diff(perturbed("scan_drop.burst", 4.0).table("scans").t_ns) / 1e9

    assert np.count_nonzero(gaps > 0.15) == 1
    assert gaps.max() == pytest.approx(4.1, abs=0.11)
    with pytest.raises(NotApplicableError, match="shorter"):
        perturbed("scan_drop.burst", 30.0)


def test_scan_delay_stamps_later():
    late = perturbed("scan_delay.stamp", 0.2).table("scans")

    assert set((late.t_ns - BUNDLE.table("scans").t_ns).tolist()) == {200_000_000}


def test_odometry_scale_stretches_distance_and_turn_on_tf_and_topic():
    def length(view):
        track = odometry_track(view)
        return np.hypot(*np.diff(track.xyyaw[:, :2], axis=0).T).sum()

    def turned(view):
        return se2.wrap_angle(np.diff(odometry_track(view).xyyaw[:, 2])).sum()

    plain, bare = BUNDLE.view(), Table.empty(BUNDLE.table("transforms").schema)
    for view in (plain, plain.with_table(bare)):
        longer = perturbed("odometry_scale.translation", 1.2, view)
        wider = perturbed("odometry_scale.rotation", 0.9, view)

        assert length(longer) == pytest.approx(1.2 * length(view))
        assert turned(longer) == pytest.approx(turned(view))
        assert length(wider) == pytest.approx(length(view))
        assert turned(wider) == pytest.approx(0.9 * turned(view))


@pytest.mark.parametrize(
    ("variant", "level", "settings"),
    [
        ("offset", 1.5, {"initial_pose_offset_m": 1.5}),
        ("rotate", 90.0, {"initial_pose_rotate_rad": np.pi / 2}),
        ("global", 1.0, {"initial_pose_global": 1.0}),
        ("offset", 0.0, {}),
    ],
)
def test_initial_pose_sets_a_setting(variant, level, settings):
    assert dict(perturbed(f"initial_pose.{variant}", level).settings) == settings


@pytest.mark.parametrize("name", list(PERTURBATIONS))
@pytest.mark.parametrize("level", [np.nan, np.inf, -np.inf, 1e9])
def test_nonsense_levels_are_refused_with_unit_and_range(name, level):
    for variant, what in PERTURBATIONS.load(name).variants.items():
        with pytest.raises(UsageError, match=rf"{name}\.{variant}.* {what.unit}$"):
            perturbed(f"{name}.{variant}", level)


@pytest.mark.parametrize(
    ("text", "level"),
    [("scan_drop.random", 1.0), ("tf_delay.all", -0.1), ("initial_pose.global", 0.5)],
)
def test_levels_out_of_range_are_refused(text, level):
    with pytest.raises(UsageError, match="level"):
        perturbed(text, level)


def test_an_unknown_variant_is_refused_with_those_that_exist():
    with pytest.raises(UsageError, match=r"scan_drop\.random, scan_drop\.burst"):
        perturbed("scan_drop.sometimes", 0.1)
