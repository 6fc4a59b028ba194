"""What estimators cost on a log of ten minutes, each alone and all of them in one `perturb`.

Run with: uv run python tests/benchmarks/ten_minutes.py FOLDER

The log (6000 scans of 360 beams at 10 Hz, a hall of 40 x 40 m) stays in FOLDER and is used again;
making it takes some minutes. Every process starts with an empty cache of runs, kernels are compiled
before; times are those of whole processes, start and writing of the runs included.
"""

import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from long_logs import long_bundle, long_log
from test_ingest_process import run

TOGETHER = ("dead_reckoning", "ekf", "amcl", "pose_graph")
ALONE = (*TOGETHER, "scan_matching", "pose_graph_online")
GOAL_S = 20.0


def perturb(bundle: Path, estimators, folder: Path):
    """CPU seconds, wall seconds and peak MB of one command with nothing in its cache of runs."""
    shutil.rmtree(folder, ignore_errors=True)
    named = [word for name in estimators for word in ("-e", name)]
    program = [sys.executable, "-m", "slamreplay.cli.main", "perturb", str(bundle)]
    with tempfile.TemporaryDirectory() as cache:
        command = ["env", f"XDG_CACHE_HOME={cache}", *program, *named, "-o", str(folder / "R")]
        return run(command)


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    bundle = folder / "ten.bundle"
    if not bundle.exists():
        log = folder / "ten.mcap"
        long_bundle(log if log.exists() else long_log(log, 40.0, 600.0, 21), bundle, 600.0)
    program = [sys.executable, "-m", "slamreplay.cli.main", "perturb", str(bundle)]
    named = [word for name in ALONE for word in ("-e", name)]
    subprocess.run([*program, *named, "-o", str(folder / "W")], check=True, capture_output=True)
    print("| estimator | CPU | wall | peak |\n|---|---|---|---|")
    for names in (*((name,) for name in ALONE), TOGETHER):
        runs = [perturb(bundle, names, folder / "T") for _ in range(3)]
        cpu, wall, peak = (statistics.median(column) for column in zip(*runs, strict=True))
        print(f"| {', '.join(names)} | {cpu:.1f} s | {wall:.1f} s | {peak:.0f} MB |", flush=True)
        time.sleep(1.0)
    print(f"\nGoal: the last line in under {GOAL_S:.0f} s of wall time on two cores.")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
