"""Hindsight beside a localizer on the same log, in the same run: a ratio, whatever the machine.

Run with: uv run pytest tests/benchmarks --benchmark-only
"""

import time
from pathlib import Path

import pytest

from slamreplay.estimators import ESTIMATORS
from slamreplay.hindsight.pipeline import hindsight
from slamreplay.ingest.pipeline import ingest

LOG = Path(__file__).parents[2] / "sample_logs" / "lost_robot.mcap"


@pytest.fixture(scope="module")
def view(tmp_path_factory):
    return ingest([LOG], tmp_path_factory.mktemp("cost") / "b.bundle").view()


def cpu_s(work) -> float:
    before = time.process_time()
    work()
    return time.process_time() - before


def test_hindsight_beside_amcl(benchmark, view):
    """`extra_info` holds hindsight's CPU time as a multiple of AMCL's."""
    amcl = ESTIMATORS.load("amcl")(judge_scans=False)  # what the robot itself has to do
    hindsight(view)  # compiles, and so does the next line
    amcl.run(view, seed=1)

    peer_s = min(cpu_s(lambda: amcl.run(view, seed=1)) for _ in range(2))
    own_s = min(cpu_s(lambda: hindsight(view)) for _ in range(2))
    benchmark.pedantic(hindsight, (view,), rounds=1)

    benchmark.extra_info["times_amcl"] = own_s / peer_s
