"""The kit can fail: each plug-in here breaks one part of the contract and is caught for it."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
import pytest

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.run import Estimate, Innovations
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.errors import UsageError
from slamreplay.estimators.dead_reckoning import DeadReckoning
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages
from slamreplay.ingest.decoders.twist import TWIST
from slamreplay.perturb.variant import Variant, check_level
from slamreplay.testing.conformance import ConformanceError
from slamreplay.testing.decoders import check_decoder
from slamreplay.testing.estimators import check_estimator
from slamreplay.testing.matched import SCALES, check_noise
from slamreplay.testing.perturbations import check_perturbation


@dataclass(frozen=True)
class Broken:
    """Dead reckoning with one thing done to it."""

    spoil: Callable[[Estimate, BundleView, int], Estimate]
    needs: frozenset[str] = frozenset({"odometry"})
    settings: frozenset[str] = frozenset()
    name: ClassVar[str] = "broken"

    def run(self, view: BundleView, *, seed: int) -> Estimate:
        return self.spoil(DeadReckoning().run(view, seed=seed), view, seed)


def with_track(estimate: Estimate, xyyaw=None, cov=None) -> Estimate:
    t = estimate.track
    xyyaw = t.xyyaw if xyyaw is None else xyyaw
    cov = t.cov if cov is None else cov
    return replace(estimate, track=PoseTrack(t.frame_id, t.child_frame_id, t.t_ns, xyyaw, cov))


def sound(estimate, view, seed):
    return estimate


def peeks(estimate, view, seed):
    truth = view.bundle.table("references")["position_xyz"][:1, :2]
    xyyaw = estimate.track.xyyaw.copy()
    xyyaw[:, :2] += 1e-9 * truth
    return with_track(estimate, xyyaw)


def knows_the_end(estimate, view, seed):
    return with_track(estimate, estimate.track.xyyaw + 1e-3 * odometry_track(view).xyyaw[-1])


def draws_from_everybody(estimate, view, seed):
    return with_track(estimate, estimate.track.xyyaw + np.random.normal(size=3))  # noqa: NPY002


def seeds_everybody(estimate, view, seed):
    np.random.seed(seed)  # noqa: NPY002
    return estimate


CALLS: list[int] = []


def remembers(estimate, view, seed):
    CALLS.append(1)
    return with_track(estimate, estimate.track.xyyaw + len(CALLS))


def stays_where_the_map_was(estimate, view, seed):
    xyyaw = estimate.track.xyyaw - np.append(view.grid.origin_xyyaw[:2], 0.0) if view.grid else None
    return with_track(estimate, xyyaw)


def forgets_covariance(estimate, view, seed):
    return with_track(estimate, cov=np.full_like(estimate.track.cov, np.nan))


def is_lopsided(estimate, view, seed):
    cov = estimate.track.cov.copy()
    cov[:, 0, 1] += 0.1
    return with_track(estimate, cov=cov)


def is_negative(estimate, view, seed):
    return with_track(estimate, cov=estimate.track.cov - np.eye(3))


def skips_rows(estimate, view, seed):
    return replace(estimate, track=estimate.track.take(np.arange(0, len(estimate.track), 2)))


def writes(estimate, view, seed):
    column = view.table("scans")["range_max_m"]
    column.setflags(write=True)
    column[0] += 1.0
    return estimate


def crashes_on_scanless_logs(estimate, view, seed):
    if view.role("scan") is None or not len(view.role("scan")):
        raise UsageError("where are the scans?")
    return estimate


def half_a_pose(estimate, view, seed):
    xyyaw = estimate.track.xyyaw.copy()
    xyyaw[3, 2] = np.nan
    return with_track(estimate, xyyaw)


def covariance_stays_where_the_map_was(estimate, view, seed):
    sigma = np.sqrt(np.trace(estimate.track.cov, axis1=1, axis2=2))
    return with_track(estimate, cov=sigma[:, None, None] ** 2 * np.diag([1.0, 0.01, 0.1]))


def ledger(estimate, view, seed, **fields):
    """One row per scan that has a pose, each moving the belief a little."""
    t = estimate.track.t_ns[estimate.track.has_pose]
    n = len(t)
    whole = {
        "source": "tags",
        "t_ns": t,
        "residual": np.zeros((n, 2)),
        "S": np.tile(np.eye(2), (n, 1, 1)),
        "accepted": np.ones(n, dtype=bool),
        "axes": ("x m", "y m"),
        "frame_id": "base_link",
        "moved": np.full((n, 3), 1e-3),
        "score": np.full(n, 0.5),
    }
    return replace(estimate, innovations=(Innovations(**{**whole, **fields}),))


def with_ledger(**change):
    """Dead reckoning with a ledger in which each named column is changed by a function."""

    def spoil(estimate, view, seed):
        (plain,) = ledger(estimate, view, seed).innovations
        fields = {name: made(getattr(plain, name)) for name, made in change.items()}
        return ledger(estimate, view, seed, **fields)

    return spoil


def ledger_knows_the_end(estimate, view, seed):
    end = odometry_track(view).xyyaw[-1, 0]
    return with_ledger(score=lambda score: np.full_like(score, abs(end) % 1.0))(
        estimate, view, seed
    )


def two_of_a_name(estimate, view, seed):
    (one,) = ledger(estimate, view, seed).innovations
    return replace(estimate, innovations=(one, one))


def unsure(column):
    column = column.copy()
    column[3] = np.nan
    return column


def test_the_kit_passes_what_is_sound():
    check_estimator(Broken(sound))
    check_estimator(Broken(ledger))
    check_estimator(Broken(with_ledger(S=lambda S: S * np.nan, is_predicted=lambda _: False)))


@pytest.mark.parametrize(
    ("spoil", "caught"),
    [
        (peeks, "references"),
        (knows_the_end, "causal"),
        (draws_from_everybody, "global random"),
        (seeds_everybody, "global random"),
        (remembers, "same seed"),
        (stays_where_the_map_was, "map frame"),
        (forgets_covariance, "finite covariance"),
        (is_lopsided, "symmetric"),
        (is_negative, "positive"),
        (skips_rows, "one row per scan"),
        (writes, "writes into"),
        (crashes_on_scanless_logs, "undeclared"),
        (half_a_pose, "partly NaN"),
        (covariance_stays_where_the_map_was, "does not turn with it"),
        (ledger_knows_the_end, "ledger of the past"),
        (lambda e, view, seed: replace(e, innovations=()), "keeps no ledger"),
        (two_of_a_name, "two sets of one source"),
        (with_ledger(source=lambda _: ""), "without a source"),
        (with_ledger(residual=lambda r: r[:, :1]), "S is of shape"),
        (with_ledger(S=lambda S: S[:, 0]), "S is of shape"),
        (with_ledger(accepted=lambda a: a[1:]), "accepted is of shape"),
        (with_ledger(moved=lambda m: m[:, :2]), "moved is of shape"),
        (with_ledger(about=lambda a: a[1:]), "about is of shape"),
        (with_ledger(axes=lambda _: ("x m",)), "1 axes are named, 2"),
        (with_ledger(t_ns=lambda t: t + 60 * 10**9), "outside of the log"),
        (with_ledger(S=lambda S: -S), "no covariance"),
        (with_ledger(S=unsure), "no covariance"),
        (with_ledger(residual=unsure), "residual not finite"),
        (with_ledger(score=lambda s: s + 2.0), "score is not from 0 to 1"),
        (with_ledger(moved=unsure), "does not say how far it moved"),
    ],
)
def test_a_broken_estimator_is_caught(spoil, caught):
    with pytest.raises(ConformanceError, match=caught):
        check_estimator(Broken(spoil))


@dataclass(frozen=True)
class Told:
    """Dead reckoning that hears what it is told through a function of the scale."""

    hears: Callable[[float], float]
    claims: float = 1.0
    needs: ClassVar[frozenset[str]] = frozenset({"odometry"})
    settings: ClassVar[frozenset[str]] = frozenset()
    name: ClassVar[str] = "told"

    def told(self, scale: float) -> Any:
        return DeadReckoning().told(self.hears(scale) * self.claims)


@dataclass(frozen=True)
class Deaf:
    """One that takes the settings and does not honour them."""

    needs: ClassVar[frozenset[str]] = frozenset({"odometry"})
    settings: ClassVar[frozenset[str]] = SCALES
    name: ClassVar[str] = "deaf"

    def run(self, view: BundleView, *, seed: int) -> Estimate:
        return DeadReckoning().run(replace(view, settings={}), seed=seed)


def test_a_covariance_must_follow_the_noise():
    check_noise(DeadReckoning())
    check_noise(Told(lambda scale: scale))
    for estimator, caught in (
        (Told(lambda scale: 1.0), "does not follow what it is told"),
        (Deaf(), "does not follow what it is told"),
        (Told(lambda scale: scale, claims=0.6), "noise is that of the world"),
        (Told(lambda scale: scale, claims=2.0), "noise is that of the world"),
        (Broken(sound), "without_noise"),
    ):
        with pytest.raises(ConformanceError, match=caught):
            check_noise(estimator)


def test_one_without_a_model_of_noise_says_so_and_is_left_alone():
    class Frank(Broken):
        without_noise = "it was recorded"

    check_noise(Frank(sound))


def test_settings_and_needs_must_be_true():
    with pytest.raises(ConformanceError, match="honour"):
        check_estimator(Broken(sound, settings=frozenset({"colour"})))
    with pytest.raises(ConformanceError, match="says it needs 'map'"):
        check_estimator(Broken(sound, needs=frozenset({"odometry", "map"})))


@dataclass
class Thawed:
    name: ClassVar[str] = "thawed"


def test_an_estimator_that_can_change_is_caught():
    with pytest.raises(ConformanceError, match="frozen"):
        check_estimator(Thawed())


@dataclass(frozen=True)
class Shaken:
    """A perturbation made of a function of view, level and generator."""

    act: Callable[[BundleView, float, np.random.Generator], BundleView]
    touches: frozenset[str] = frozenset({"scans"})
    at_baseline: bool = False
    check: bool = True
    variants: dict[str, Variant] = field(
        default_factory=lambda: {"all": Variant("s", 0.0, "test", 0, 10)}
    )
    name: ClassVar[str] = "shaken"

    def apply(self, view: BundleView, variant: str, level: float, rng: Any) -> BundleView:
        if self.check:
            check_level(self.name, self.variants, variant, level)
        return view if level == 0.0 and not self.at_baseline else self.act(view, level, rng)


def shifted(view, level, rng):
    scans = view.table("scans")
    return view.with_table(scans.replace(t_ns=scans.t_ns + 1000))


def at_random(view, level, rng):
    scans = view.table("scans")
    return view.with_table(scans.take(np.random.default_rng().random(len(scans)) > 0.5))


def backwards(view, level, rng):
    return view.with_table(view.table("scans").take(np.arange(len(view.table("scans")))[::-1]))


def with_references(view, level, rng):
    table = view.bundle.table("references")
    return shifted(view, level, rng).with_table(table.replace(t_ns=table.t_ns + 1))


def guided_by_references(view, level, rng):
    scans, truth = view.table("scans"), view.bundle.table("references")["position_xyz"]
    return view.with_table(scans.replace(t_ns=scans.t_ns + int(truth[0, 0] * 1e6)))


def in_place(view, level, rng):
    column = view.bundle.table("scans")["angle_min_rad"]
    column.setflags(write=True)
    column += 0.1
    return shifted(view, level, rng)


def test_the_kit_passes_a_sound_perturbation():
    check_perturbation(Shaken(shifted))


@pytest.mark.parametrize(
    ("broken", "caught"),
    [
        (Shaken(shifted, at_baseline=True), "baseline level changes"),
        (Shaken(shifted, touches=frozenset({"odometry"})), "undeclared"),
        (Shaken(lambda view, level, rng: view), "changes nothing"),
        (Shaken(at_random), "other bits"),
        (Shaken(backwards), "order of rows"),
        (Shaken(with_references, touches=frozenset({"scans", "references"})), "references"),
        (Shaken(guided_by_references), "references that only judge"),
        (Shaken(in_place), "writes into|other bits"),
        (Shaken(shifted, check=False), "takes nan"),
        (Shaken(lambda v, x, rng: v.with_setting("colour", x)), "colour undeclared"),
        (Shaken(shifted, variants={}), "no variant"),
        (Shaken(shifted, variants={"all": Variant("s", -1.0, "", 0, 1)}), "out of range"),
    ],
)
def test_a_broken_perturbation_is_caught(broken, caught):
    with pytest.raises(ConformanceError, match=caught):
        check_perturbation(broken)


TWIST_MESSAGE = {
    "linear": {"x": 1.0, "y": 2.0, "z": 3.0},
    "angular": {"x": 4.0, "y": 5.0, "z": 6.0},
}
ROW = {"linear_velocity_xyz": [1, 2, 3]}


def spoiled(change: Callable[[Decoded, Messages], Decoded], table: str = "commands") -> Decoder:
    return Decoder(table, lambda messages: change(TWIST.decode(messages), messages))


def drop_silently(decoded, messages):
    return replace(decoded, remarks=())


def lose_a_column(decoded, messages):
    return replace(decoded, columns={"linear_velocity_xyz": decoded.columns["linear_velocity_xyz"]})


def mix_up_rows(decoded, messages):
    return replace(decoded, rows=decoded.rows[::-1])


def stumble(decoded, messages):
    if np.isnan(messages.columns("linear", "xyz")).any():
        raise ZeroDivisionError
    return decoded


def scribble(decoded, messages):
    for message in messages._items:
        message.linear.x = 7.0
    return decoded


def test_the_kit_passes_a_sound_decoder():
    check_decoder(TWIST, TWIST_MESSAGE, ROW)


@pytest.mark.parametrize(
    ("broken", "caught"),
    [
        (spoiled(drop_silently), "in silence"),
        (spoiled(lose_a_column), "lacks or invents"),
        (spoiled(mix_up_rows), "one after the other"),
        (spoiled(stumble), "breaks down where linear.x"),
        (spoiled(lambda d, m: d, table="odours"), "no table"),
        (spoiled(lambda d, m: replace(d, t_sensor_ns=d.t_sensor_ns + 1)), "stamp is"),
        (spoiled(scribble), "writes into the message"),
    ],
)
def test_a_broken_decoder_is_caught(broken, caught):
    with pytest.raises(ConformanceError, match=caught):
        check_decoder(broken, TWIST_MESSAGE, ROW)


def test_a_wrong_value_is_caught():
    with pytest.raises(ConformanceError, match="linear_velocity_xyz"):
        check_decoder(TWIST, TWIST_MESSAGE, {"linear_velocity_xyz": [1, 2, 4]})
