"""A particle filter's mean and covariance: do they come from the same particles?"""

import numpy as np
import pytest
from beliefs_in_a_room import ar1, context, poses, seconds, told

from slamreplay.bundle.manifest import Role
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Ragged, Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.consistency.asking import ask
from slamreplay.consistency.belief.amcl_limits import amcl_limits, is_amcl
from slamreplay.consistency.belief.credibility import nees_of_belief
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence.cloud_parts import mixed_up
from slamreplay.consistency.evidence.nees import nees
from slamreplay.consistency.evidence.parts import HEADING, POSITION
from slamreplay.estimators.amcl.cloud import cluster_of, moments
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.estimators.amcl.filter import AmclFilter
from slamreplay.estimators.amcl.heaps import published as published_by_amcl
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import ANY_ANGLE, ros_from_planar
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.testing.edits import rebuilt
from slamreplay.testing.synthetic import START_NS, true_path

T = np.arange(0.0, 60.0, 0.5)
TIGHT = np.array([0.1, 0.1, 0.05])


def heaps(rng, at, other=None, share=0.4, n=400):
    """Particles (n, 3) about a pose, a share of them about another one."""
    cloud = at + rng.standard_normal((n, 3)) * TIGHT
    if other is not None:
        few = int(share * n)
        cloud[:few] = other + rng.standard_normal((few, 3)) * TIGHT
    return cloud


def published(cloud):
    """What nav2_amcl makes of it: the mean of the heaviest cluster, the covariance of all."""
    label = cluster_of(cloud)
    rows = label == np.argmax(np.bincount(label))
    ones = np.ones(len(cloud))
    return moments(cloud[rows], ones[rows]).mean_xyyaw, moments(cloud, ones).cov


def clouds_table(t_s, clouds, weights=None, frame="map"):
    t_ns = START_NS + np.rint(np.asarray(t_s) * 1e9).astype(np.int64)
    n = len(t_ns)
    weights = [[] for _ in clouds] if weights is None else weights
    return Table(
        TABLES["particles"],
        {
            **dict.fromkeys(("t_ns", "t_sensor_ns", "t_log_ns"), t_ns),
            "topic": ["/particle_cloud"] * n,
            "frame_id": [frame] * n,
            "xyyaw": Ragged.of([c.ravel() for c in clouds], np.float64),
            "weights": Ragged.of(weights, np.float64),
        },
    )


def log(clouds, said, weights=None, frame="map", late_s=0.05, reference=True):
    """A localizer that publishes `said` (mean, covariance) and its clouds a little later."""
    means = np.array([mean for mean, _ in said])
    table = poses(T, se2.between(np.zeros(3), means) - true_path(T), np.ones((len(T), 3)))
    table = table.replace(covariance=ros_from_planar(np.array([cov for _, cov in said])))
    base = context(
        T, np.zeros((len(T), 3)), np.ones((len(T), 3)), None if not reference else "survey"
    )
    exchanged = {"poses": table, "particles": clouds_table(T + late_s, clouds, weights, frame)}
    bundle = base.view.bundle
    role = Role(role="particles", topic="/particle_cloud", type="t", messages=1, reason="r")
    manifest = bundle.manifest.model_copy(update={"roles": [*bundle.manifest.roles, role]})
    whole = {name: exchanged.get(name, bundle.table(name)) for name in TABLES}
    return CheckContext(None, base.references, Bundle(manifest, whole, bundle.grids()).view())


def drives(two_from=20.0, two_to=32.0, share=0.4, away=(3.0, 1.0, 0.0)):
    """Clouds about the truth that have a second heap for a while, what is said, and when so."""
    rng = np.random.default_rng(3)
    two = (two_from <= T) & (two_to > T)
    at = true_path(T)
    clouds = [
        heaps(rng, pose + TIGHT * e, pose + np.array(away) if both else None, share)
        for pose, both, e in zip(at, two, ar1(rng, len(T), 0.3), strict=True)
    ]
    return clouds, [published(cloud) for cloud in clouds], two


def test_two_heaps_are_found_left_out_and_said():
    clouds, said, two = drives()
    whole = log(clouds, said)
    found = {f.id: f for f in ask([whole], ["belonging", "nees", "collapse"])}

    np.testing.assert_array_equal(whole.belonging.parted, two)
    assert whole.belonging.seen.all()
    assert found["SR-CON-011"].severity == "warning"
    assert seconds(found["SR-CON-011"]) == (20.0, 31.5)
    assert "24 of 120 updates, from 20.0 to 31.5 s" in found["SR-CON-011"].message
    assert "carried 60 % and 40 % of the weight" in found["SR-CON-011"].message
    assert nees_of_belief(whole).invalid == {"mean and covariance of different particles": 24}
    assert "SR-CON-001" not in found  # what is left is sound


def test_left_in_they_would_have_made_a_sound_filter_look_timid():
    clouds, said, _ = drives(two_from=0.0, two_to=59.0)
    blind = log(clouds, said, frame="elsewhere")  # clouds of another frame say nothing

    assert blind.belonging is None
    (finding,) = (f for f in ask([blind], ["nees"]) if "position" in f.message)
    assert "too large" in finding.message


def test_most_of_them_refuse_nees_altogether():
    clouds, said, _ = drives(two_from=0.0, two_to=45.0)
    whole = log(clouds, said)
    (undecided,) = ask([whole], ["nees"])

    assert (undecided.id, "NEES refused" in undecided.message) == ("SR-CON-003", True)
    assert "in 90 of 120 updates mean and covariance are of different particles" in (
        undecided.message
    )
    assert not np.isfinite(whole.evidence[0].cov).any()
    assert "all updates are left out" in ask([whole], ["belonging"])[0].message


@pytest.mark.parametrize(
    ("mean_of", "cov_of", "parted"),
    [("own", "whole", True), ("whole", "own", True), ("own", "own", False),
     ("whole", "whole", False)],
)  # fmt: skip
def test_only_a_mean_and_a_covariance_of_different_particles_part(mean_of, cov_of, parted):
    clouds, _, two = drives()
    said = []
    for cloud in clouds:
        label, ones = cluster_of(cloud), np.ones(len(cloud))
        rows = label == np.argmax(np.bincount(label))
        of = {"own": moments(cloud[rows], ones[rows]), "whole": moments(cloud, ones)}
        said.append((of[mean_of].mean_xyyaw, of[cov_of].cov))

    np.testing.assert_array_equal(log(clouds, said).belonging.parted, two & parted)


@pytest.mark.parametrize(
    ("share", "away"), [(0.05, (3.0, 1.0, 0.0)), (0.4, (0.3, 0.0, 0.0)), (0.0, (3.0, 1.0, 0.0))]
)
def test_a_few_strays_and_heaps_that_touch_are_one_cluster(share, away):
    clouds, said, _ = drives(share=share, away=away)

    assert not log(clouds, said).belonging.parted.any()


def test_heaps_that_only_look_another_way_part_too():
    clouds, said, two = drives(away=(0.0, 0.0, 2.0))

    np.testing.assert_array_equal(log(clouds, said).belonging.parted, two)


def test_weights_count_where_the_message_has_them():
    clouds, _, _ = drives()
    light = [np.where(np.arange(len(c)) < 0.4 * len(c), 1e-3, 1.0) for c in clouds]
    said = []
    for cloud, weight in zip(clouds, light, strict=True):
        whole = moments(cloud, weight)
        said.append((whole.mean_xyyaw, whole.cov))

    assert not log(clouds, said, light).belonging.parted.any()


def test_a_cloud_that_is_everywhere_has_no_cluster_that_could_be_its_mean():
    rng = np.random.default_rng(5)
    clouds = [rng.uniform([-20, -20, -3.1], [20, 20, 3.1], (800, 3)) for _ in T]
    said = [published(cloud) for cloud in clouds]

    assert log(clouds, said).belonging.parted.mean() > 0.8


def test_clouds_too_far_away_in_time_or_place_say_nothing():
    clouds, said, two = drives()
    assert not log(clouds, said, late_s=100.0).belonging.seen.any()
    elsewhere = [(mean - np.array([1.6, 0.5, 0.0]), cov) for mean, cov in said]
    judged = log(clouds, elsewhere).belonging
    assert not judged.parted.any()
    np.testing.assert_array_equal(judged.seen, ~two)


def test_sound_clouds_are_left_alone():
    parted = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        for wide in rng.uniform(0.3, 12.0, 10):  # as narrow and as wide as they come
            cloud = rng.standard_normal((300, 3)) * TIGHT * wide
            judged = mixed_up(*published(cloud), cloud, np.empty(0))
            parted.append(judged is not None and judged[0] > 0.0)

    assert np.mean(parted) < 0.01


def test_what_the_replayed_filter_publishes_is_judged_as_it_judges_itself():
    cells = np.zeros((100, 100), dtype=np.int8)
    amcl = AmclFilter(AmclConfig(), OccupancyGrid(cells, 0.1, np.zeros(3)), 1)
    amcl.initialise([3.0, 3.0, 0.0], np.diag(TIGHT**2))
    parted = amcl.particles.copy()
    parted[::3, 0] += 3.0
    for particles, clusters in ((amcl.particles, 1), (parted, 2)):
        told = published_by_amcl(np.ascontiguousarray(particles.T), amcl.weights)
        found = log(
            [np.array(particles)] * len(T), [(told.mean_xyyaw, told.cov)] * len(T)
        ).belonging
        assert told.clusters == clusters
        assert found.parted.all() == (clusters == 2)


def test_a_run_is_judged_by_its_own_count_of_clusters():
    t_ns = START_NS + np.rint(T * 1e9).astype(np.int64)
    cov = (
        np.tile(np.diag(TIGHT**2), (len(T), 1, 1)) * (1.0 + np.arange(len(T)) / 1e3)[:, None, None]
    )
    track = PoseTrack("map", "base_link", t_ns, true_path(T), cov)
    counts = np.where((T >= 10.0) & (T < 12.0), 2.0, 1.0)
    base = context(T, np.zeros((len(T), 3)), np.ones((len(T), 3)), "survey")
    updated = (np.arange(len(T)) % 2 == 0).astype(float)
    run = CheckContext(
        track, base.references, base.view, "amcl", (), {"updated": updated, "clusters": counts}
    )
    (finding,) = ask([run], ["belonging"])

    assert finding.message.startswith("amcl: 2 of 60 updates, from 10.0 to 11.0 s")
    assert nees_of_belief(run).invalid == {"mean and covariance of different particles": 2}
    assert CheckContext(track, base.references, base.view, "ekf").belonging is None


def test_amcl_is_known_by_what_its_covariances_have():
    full = np.zeros((len(T), 36))
    full[:, [0, 1, 6, 7, 35]] = [0.04, 0.01, 0.01, 0.05, 0.02]
    whole = context(T, np.zeros((len(T), 3)), np.ones((len(T), 3)))

    def named(topic, cov):
        table = whole.view.table("poses").replace(covariance=cov, topic=[topic] * len(T))
        bundle = rebuilt(whole.view.bundle, {"poses": table})
        roles = [
            r.model_copy(update={"topic": topic}) if r.role in ("pose", "covariance") else r
            for r in bundle.manifest.roles
        ]
        manifest = bundle.manifest.model_copy(update={"roles": roles})
        tables = {name: bundle.table(name) for name in TABLES}
        return CheckContext(None, (), Bundle(manifest, tables, bundle.grids()).view())

    coupled = full.copy()
    coupled[:, [5, 30]] = 0.001
    assert is_amcl(named("/where", full))
    assert is_amcl(named("/robot/amcl_pose", coupled))
    assert not is_amcl(named("/where", coupled))
    assert "clusters go unseen" in amcl_limits(named("/where", full))
    clouds, said, _ = drives()
    assert "clusters" not in amcl_limits(log(clouds, said))


def test_a_heading_that_may_be_any_has_no_nees():
    t_ns = START_NS + np.rint(T * 1e9).astype(np.int64)
    cov = np.tile(np.diag([0.01, 0.01, 0.01]), (len(T), 1, 1))
    cov[:30, 2, 2] = ANY_ANGLE + 0.1
    truth = PoseTrack.without_covariance("map", "base_link", t_ns, true_path(T))
    result = nees(PoseTrack("map", "base_link", t_ns, true_path(T), cov), truth)

    assert result.invalid == {"no heading known (any would do)": 30}
    assert np.isfinite(result.error).all()
    assert np.isfinite(result.squared(POSITION)).all()
    assert np.flatnonzero(np.isnan(result.squared(HEADING))).tolist() == list(range(30))


def test_a_sigma_that_is_wrong_is_said_with_what_it_does():
    clouds, said, _ = drives(two_to=20.0)
    large = [(mean, cov * 36.0) for mean, cov in said]
    small = [(mean, cov / 36.0) for mean, cov in said]

    timid = told(ask([log(clouds, large)], ["nees"]))
    bold = told(ask([log(clouds, small)], ["nees"]))
    assert "sigma 0.6 m (median) for an error of 0.1" in timid[0].message
    assert "gates stay open for wrong matches" in timid[0].message
    assert "sigma 0.017 m" in bold[0].message
    assert "actions pass that there is no room for" in bold[0].message
