"""A particle filter that recorded its particles and no covariance."""

import numpy as np
import pytest

from slamreplay.bundle.manifest import Role
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.consistency.asking import ask
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence.cloud_belief import cloud_belief
from slamreplay.consistency.evidence.source import Reference
from slamreplay.testing import believed
from slamreplay.testing.edits import rebuilt
from slamreplay.testing.synthetic import synthetic_bundle

N, M = 300, 400


def clouds(told=1.0, frame="map", particles=M, weighted=False, seed=0):
    """A log with clouds whose means err by their own spread, told `told` times it; its truth."""
    sound = believed(5 * seed)  # of no memory
    track, rng = sound.belief.take(np.arange(N)), np.random.default_rng(seed)
    bundle = synthetic_bundle(seconds=1.0, with_belief=False)
    drawn, weights = [], []
    for pose, cov in zip(track.xyyaw, track.cov, strict=True):
        spread = np.diag(np.sqrt(np.diag(cov))) * told
        off = rng.standard_normal((particles, 3))
        off = (off - off.mean(axis=0)) / off.std(axis=0)
        drawn.append((pose + off @ spread).ravel())
        weights.append(np.full(particles, 2.0) if weighted else np.empty(0))
    rows = {
        **dict.fromkeys(("t_ns", "t_sensor_ns", "t_log_ns"), track.t_ns),
        "topic": ["/cloud"] * N,
        "frame_id": [frame] * N,
        "xyyaw": drawn,
        "weights": weights,
    }
    bundle = rebuilt(bundle, {"particles": Table(TABLES["particles"], rows)})
    role = Role(role="particles", topic="/cloud", type="t", messages=N, reason="the only one")
    frames = bundle.manifest.frames.model_copy(update={"map": "map", "base": "base"})
    bundle.manifest = bundle.manifest.model_copy(
        update={"roles": [*bundle.manifest.roles, role], "frames": frames}
    )
    truth = sound.references[0].track
    return bundle.view(), Reference("survey", "/truth", truth), track


@pytest.mark.parametrize("weighted", [False, True])
def test_moments_of_each_cloud_are_the_belief(weighted):
    view, _, track = clouds(weighted=weighted)
    found = cloud_belief(view)

    np.testing.assert_array_equal(found.t_ns, track.t_ns)
    np.testing.assert_allclose(found.xyyaw[:, :2], track.xyyaw[:, :2], atol=1e-9)
    np.testing.assert_allclose(found.cov[:, 0, 0], track.cov[:, 0, 0], rtol=1e-9)
    np.testing.assert_allclose(found.cov[:, 2, 2], track.cov[:, 2, 2], rtol=0.1)  # circular


def accused(told, seed):
    view, reference, _ = clouds(told=told, seed=seed)
    return [f for f in ask([CheckContext(None, (reference,), view)], ["nees"])
            if f.id == "SR-CON-001"]  # fmt: skip


def test_a_sound_cloud_is_left_alone_and_a_tight_one_found():
    assert [accused(1.0, seed) for seed in range(5)] == [[]] * 5
    found = accused(0.3, 0)
    assert len(found) == 2  # position and heading are not coupled
    assert all("mean and covariance of its particles" in f.message for f in found)
    assert all(f.severity == "error" for f in found)


def test_clouds_of_another_frame_and_of_few_particles_say_nothing():
    assert cloud_belief(clouds(frame="odom")[0]) is None
    assert cloud_belief(clouds(particles=5)[0]) is None
    assert cloud_belief(synthetic_bundle(seconds=1.0).view()) is None


def test_a_cloud_said_again_is_one_update():
    view, _, _ = clouds()
    table = view.table("particles")
    again = table.take(np.repeat(np.arange(N), 2))
    again = again.replace(t_ns=np.arange(2 * N) * 100_000_000)
    twice = rebuilt(view.bundle, {"particles": again}).view()

    assert len(cloud_belief(twice)) == N
