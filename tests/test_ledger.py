"""The residual ledger: what each measurement said, kept whole and judged where it may be."""

from dataclasses import replace

import numpy as np
import pytest
from linear_filter import filters
from scipy.spatial.distance import mahalanobis

from slamreplay.bundle.run import Estimate, Innovations, Run, Trial, read_run, run_bytes
from slamreplay.bundle.track import PoseTrack


def ledger(n=4, m=2, **fields):
    rng = np.random.default_rng(n)
    A = rng.normal(size=(n, m, m))
    return Innovations(
        "closures",
        np.arange(n),
        rng.normal(size=(n, m)),
        A @ np.swapaxes(A, 1, 2) + np.eye(m),
        np.arange(n) % 2 == 0,
        **fields,
    )


def read_back(tmp_path, *innovations):
    track = PoseTrack.without_covariance("map", "base", np.arange(4), np.ones((4, 3)))
    run = Run(Trial("id", "amcl", 7), Estimate(track, innovations))
    (tmp_path / "r.npz").write_bytes(run_bytes(run))
    back = read_run(tmp_path / "r.npz")
    assert run_bytes(back) == run_bytes(run)
    return back.estimate.innovations


def test_every_column_of_a_ledger_reads_back(tmp_path):
    full = ledger(
        axes=("x m", "y m"),
        frame_id="base_link",
        moved=np.arange(12.0).reshape(4, 3),
        about=np.array(["a", "node 3 -> node 17", "", "d"]),
        score=np.array([0.5, np.nan, 0.25, 1.0]),
        is_predicted=False,
    )
    plain = ledger()

    one, two = read_back(tmp_path, full, plain)

    assert (one.frame_id, one.is_predicted, one.axes) == ("base_link", False, ("x m", "y m"))
    assert one.moved.tolist() == full.moved.tolist()
    assert one.about.tolist() == full.about.tolist()
    np.testing.assert_array_equal(one.score, full.score)
    np.testing.assert_array_equal(one.S, full.S)
    assert (two.frame_id, two.is_predicted) == ("", True)
    assert np.isnan(two.moved).all()
    assert two.moved.shape == (4, 3)
    assert np.isnan(two.score).all()
    assert two.about.tolist() == [""] * 4


def test_an_empty_ledger_reads_back(tmp_path):
    (back,) = read_back(tmp_path, ledger(0))

    assert back.moved.shape == (0, 3)
    assert back.nis.shape == (0,)


@pytest.mark.parametrize("m", [1, 2, 3])
def test_nis_is_the_squared_mahalanobis_distance(m):
    one = ledger(20, m)
    theirs = [
        mahalanobis(r, np.zeros(m), np.linalg.inv(S)) ** 2
        for r, S in zip(one.residual, one.S, strict=True)
    ]

    np.testing.assert_allclose(one.nis, theirs, rtol=1e-9)


def test_nis_of_what_is_no_covariance_is_not_known():
    one = ledger(6)
    S, residual = one.S.copy(), one.residual.copy()
    S[0], S[1], S[2, 0, 1], S[3] = np.nan, -np.eye(2), 9.0, 0.0
    residual[4, 1] = np.nan

    nis = replace(one, S=S, residual=residual).nis

    assert np.isnan(nis).tolist() == [True] * 5 + [False]
    assert nis[5] == one.nis[5]


def test_checks_of_innovations_leave_alone_what_no_filter_predicted():
    from slamreplay.consistency.innovations.innovation_sets import innovation_sets

    seen = filters(1, told_R=0.1)[0][1]
    made = replace(seen, is_predicted=False)

    assert len(innovation_sets((seen, made))) == 1
    assert innovation_sets((made,)) == ()
