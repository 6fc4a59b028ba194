"""The pose graph on logs with verified relations between poses; skipped where the logs are not."""

import numpy as np
import pytest

from slamreplay.estimators.pose_graph.estimator import PoseGraph
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.ingest.pipeline import ingest


def relations(path):
    """Pairs of times (N, 2) and the second pose seen from the first (N, 3).

    The metric is that of Kummerle et al., On measuring the accuracy of SLAM algorithms, 2009.
    """
    rows = [line.split() for line in path.read_text().splitlines() if line and line[0] != "#"]

    def ns(text):
        whole, _, part = text.partition(".")
        return int(whole) * NS_PER_S + int(part.ljust(9, "0")[:9])

    times = np.array([[ns(r[0]), ns(r[1])] for r in rows])
    return times, np.array([[float(r[2]), float(r[3]), float(r[7])] for r in rows])


def rows_at(stamps, times):
    order = np.argsort(stamps, kind="stable")
    k = np.clip(np.searchsorted(stamps[order], times), 1, len(stamps) - 1)
    before = np.abs(stamps[order][k - 1] - times) < np.abs(stamps[order][k] - times)
    return order[k - before]


@pytest.mark.parametrize(
    ("name", "mean_m", "mean_deg"), [("aces", 0.0371, 0.562), ("intel", 0.0220, 0.333)]
)
def test_the_error_is_below_what_cartographer_reaches_tuned_for_each_log(
    name, mean_m, mean_deg, real_logs, tmp_path
):
    folder = real_logs / "radish"
    bundle = ingest([folder / f"{name}.clf.bz2"], tmp_path / "b")
    stamps = bundle.table("scans").sorted_by_time()["t_sensor_ns"]
    times, seen = relations(folder / f"{name}.relations")

    poses = PoseGraph().run(bundle.view(), seed=0).track.xyyaw

    ends = rows_at(stamps, times)
    assert (np.abs(stamps[ends] - times) < NS_PER_S // 1000).all()
    off = se2.between(seen, se2.between(poses[ends[:, 0]], poses[ends[:, 1]]))
    assert np.hypot(off[:, 0], off[:, 1]).mean() < mean_m
    assert np.degrees(np.abs(off[:, 2])).mean() < mean_deg
