"""`slamreplay ingest` as a process beside one that reads with rosbags and writes the same Parquet.

Run with: uv run pytest tests/benchmarks/test_ingest_process.py --benchmark-only
As a table, with peak memory: uv run python tests/benchmarks/test_ingest_process.py [LOG]
"""

import os
import shutil
import statistics
import subprocess
import sys
import time
from pathlib import Path
from tempfile import mkdtemp

sys.path.insert(0, str(Path(__file__).parent))
from test_reading import log_of

PEER = str(Path(__file__).with_name("peer_ingest.py"))
GOAL, LEAST = 2.5, 1.7


def run(command):
    """CPU seconds, wall seconds and peak MB of a process."""
    start = time.perf_counter()
    # As users have it: modules compiled once and kept.
    env = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(command, stdout=quiet, stderr=quiet, env=env)
    _, status, usage = os.wait4(process.pid, 0)
    assert status == 0, command
    wall = time.perf_counter() - start
    return usage.ru_utime + usage.ru_stime, wall, usage.ru_maxrss / 1024


def slamreplay(log, target):
    shutil.rmtree(target, ignore_errors=True)
    return run([sys.executable, "-m", "slamreplay.cli.main", "ingest", str(log), "-o", str(target)])


def rosbags(log, target):
    shutil.rmtree(target, ignore_errors=True)
    return run([sys.executable, PEER, str(log), str(target)])


def compare(log, folder, runs=5):
    """Median ratio of CPU and wall time, and the medians of both; paired A B A B."""
    log.read_bytes()
    slamreplay(log, folder / "own.bundle")
    pairs = [
        (rosbags(log, folder / "peer"), slamreplay(log, folder / "own.bundle")) for _ in range(runs)
    ]
    cpu = statistics.median(peer[0] / own[0] for peer, own in pairs)
    wall = statistics.median(peer[1] / own[1] for peer, own in pairs)
    middle = [tuple(statistics.median(p[k][i] for p in pairs) for i in range(3)) for k in (1, 0)]
    return cpu, wall, *middle


def test_ingest_process(benchmark, tmp_path):
    """`extra_info` holds how many times less CPU and wall time than the peer takes."""
    log = log_of("zstd.mcap", {"compression": "zstd"})
    cpu, wall, own, peer = compare(log, tmp_path, runs=3)
    benchmark.pedantic(slamreplay, (log, tmp_path / "own.bundle"), rounds=1)
    benchmark.extra_info |= {"cpu_ratio": cpu, "wall_ratio": wall, "goal": GOAL}
    benchmark.extra_info |= {"peak_mb": own[2], "peer_peak_mb": peer[2]}
    if log.name.startswith("600_"):  # start-up, half of the work on a short log, is in it
        assert cpu > LEAST


def main():
    log = (
        Path(sys.argv[1])
        if len(sys.argv) > 1
        else log_of("zstd.mcap", {"compression": "zstd"}, 600)
    )
    cpu, wall, own, peer = compare(log, Path(mkdtemp()))
    print(f"goal {GOAL}, fails below {LEAST}: CPU ratio {cpu:.2f}, wall ratio {wall:.2f}")
    for name, (cpu_s, wall_s, mb) in (("slamreplay ingest", own), ("rosbags and Parquet", peer)):
        print(f"{name}: {cpu_s:.2f} s CPU, {wall_s:.2f} s wall, {mb:.0f} MB at its peak")


if __name__ == "__main__":
    main()
