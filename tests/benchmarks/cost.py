"""What a post-mortem costs by length of the log and size of the map, as a table.

Run with: NUMBA_NUM_THREADS=1 uv run python tests/benchmarks/cost.py FOLDER

Logs and bundles stay in FOLDER and are used again; making them takes longer than judging them.
CPU seconds are those of one thread; on a busy machine they come out up to a quarter higher.
"""

import json
import resource
import subprocess
import sys
import time
from pathlib import Path

# Loaded before the clock starts: they cost the same for every log.
import gtsam  # noqa: F401
import pandas as pd  # noqa: F401
import pyarrow.parquet as pq  # noqa: F401
import scipy.spatial  # noqa: F401
from long_logs import long_bundle, long_log

from slamreplay.bundle.view import Bundle
from slamreplay.postmortem import postmortem

#: Edge of the hall in m, seconds of log.
CASES = (*((40, s) for s in (150, 300, 600, 1200)), *((e, 300) for e in (20, 70, 100)))
SEED = 31


def prepared(folder: Path, edge_m: int, seconds: int) -> Path:
    """The bundle of a case."""
    bundle = folder / f"h{edge_m}_{seconds}.bundle"
    if not bundle.exists():
        log = folder / f"h{edge_m}_{seconds}.mcap"
        long_bundle(long_log(log, edge_m, seconds, SEED), bundle, seconds)
    return bundle


def cost_of(bundle: Path) -> dict[str, float]:
    """CPU seconds and peak memory of this process, once it has judged the bundle."""
    log = Bundle.open(bundle)
    before = time.process_time()
    postmortem(log)
    cpu_s = time.process_time() - before
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return {"cpu_s": cpu_s, "peak_mb": peak_mb}


def said(*arguments: object) -> str:
    """What another process of this file prints."""
    command = [sys.executable, __file__, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, check=True, text=True).stdout.strip()


def main(folder: Path) -> None:
    """Measure each case in a process of its own, whose kernels were compiled before."""
    folder.mkdir(parents=True, exist_ok=True)
    print("| map | log | CPU | peak memory |\n|---|---|---|---|")
    # A process begins with its parent's peak memory: this one must stay small.
    for warm, (edge_m, seconds) in enumerate((CASES[0], *CASES)):
        bundle = said("--prepare", folder, edge_m, seconds)
        cost = json.loads(said("--one", bundle))
        if warm:
            size = f"{edge_m} x {edge_m} m"
            print(f"| {size} | {seconds} s | {cost['cpu_s']:.1f} s | {cost['peak_mb']:.0f} MB |")


if __name__ == "__main__":
    if sys.argv[1] == "--one":
        print(json.dumps(cost_of(Path(sys.argv[2]))))
    elif sys.argv[1] == "--prepare":
        print(prepared(Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])))
    else:
        main(Path(sys.argv[1]))
