"""What a fresh machine compiles for its first report, in CPU seconds of each kernel.

Run with: uv run pytest tests/benchmarks/test_compile_cost.py --benchmark-only
As a table: uv run python tests/benchmarks/test_compile_cost.py
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

LOG = Path(__file__).parents[2] / "sample_logs" / "lost_robot.mcap"
GOAL_S = 10.0


def measured(log: Path, target: Path) -> list[tuple[float, str]]:
    """Seconds and name of each compilation in a process of its own with an empty cache."""
    with tempfile.TemporaryDirectory() as empty:
        done = subprocess.run(
            [sys.executable, __file__, "--one", str(log), str(target)],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "NUMBA_CACHE_DIR": empty},
        )
    return [tuple(row) for row in json.loads(done.stdout.splitlines()[-1])]


def one(log: str, target: str) -> None:
    """Report on the log and print what was compiled; what a kernel calls is not counted to it."""
    import time

    from numba.core import event

    open_ones, rows = [], []

    class Listener(event.Listener):
        def on_start(self, event):
            open_ones.append([time.process_time(), 0.0])

        def on_end(self, event):
            begun, within = open_ones.pop()
            spent = time.process_time() - begun
            if open_ones:
                open_ones[-1][1] += spent
            function = event.data["dispatcher"].py_func
            rows.append((spent - within, f"{function.__module__}.{function.__qualname__}"))

    event.register("numba:compile", Listener())
    from slamreplay.cli.main import run

    sys.argv = ["slamreplay", "report", log, "-o", target]
    run()
    print("\n" + json.dumps(sorted(rows, reverse=True)))


def test_compile(benchmark, tmp_path):
    """`extra_info` holds the CPU seconds of all kernels together, and of the dearest."""
    rows = benchmark.pedantic(measured, (LOG, tmp_path / "report"), rounds=1)
    total_s = sum(spent for spent, _ in rows)
    benchmark.extra_info |= {"cpu_s": total_s, "goal_s": GOAL_S, "dearest": rows[:5]}
    assert total_s < GOAL_S


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        rows = measured(LOG, Path(folder) / "report")
    print("| kernel | CPU s |\n|---|---|")
    for spent, name in rows:
        print(f"| {name} | {spent:.2f} |")
    print(f"| all {len(rows)}, goal {GOAL_S} | {sum(spent for spent, _ in rows):.2f} |")


if __name__ == "__main__":
    one(*sys.argv[2:]) if sys.argv[1:2] == ["--one"] else main()
