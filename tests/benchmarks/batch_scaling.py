"""How fast batches are on 1 and 2 workers, and whether a worker's memory grows.

Run with: uv run python tests/benchmarks/batch_scaling.py FOLDER [--rounds 3] [--cause]
      or: uv run python tests/benchmarks/batch_scaling.py FOLDER --memory 60

Both clusters stand side by side and take turns on the same logs, round by round, so that what else
the machine does hits both alike. The first log of each worker (imports, kernels) is not counted.
"""

import argparse
import os
import statistics
import time
from dataclasses import replace
from itertools import cycle, islice
from pathlib import Path
from tempfile import TemporaryDirectory

from slamreplay.batch.cluster import Workers, connected
from slamreplay.batch.keys import task_of
from slamreplay.batch.loop import served
from slamreplay.batch.sources import sources_of
from slamreplay.batch.work import Work


def resident_mb():
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def told_apart(tasks, count):
    """So many tasks from a few: a key is done once."""
    picked = islice(cycle(tasks), count)
    return [replace(task, key=f"{k:032x}") for k, task in enumerate(picked)]


def done_in(client, workers, tasks):
    """Seconds that the tasks take, and the CPU seconds within their logs."""
    begun = time.perf_counter()
    results = list(served(client, Work(tasks), workers))
    wall_s = time.perf_counter() - begun
    lines = [result.error for result in results if result.error]
    if lines:
        raise SystemExit(lines[0])
    cpu_s = sum(result.tables["costs"].column("cpu_s")[0].as_py() for result in results)
    return wall_s, cpu_s


def scaling(tasks, rounds, scratch):
    one, two = Workers(count=1), Workers(count=2)
    with connected(one, scratch / "1") as of_one, connected(two, scratch / "2") as of_two:
        done_in(of_one, one, told_apart(tasks, 1))
        done_in(of_two, two, told_apart(tasks, 4))
        print("| round | logs | 1 worker (s) | 2 workers (s) | ratio | CPU 1 (s) | CPU 2 (s) |")
        print("|---|---|---|---|---|---|---|")
        walls = []
        for k in range(rounds):
            turns = [(of_one, one), (of_two, two)]
            spent = {}
            for client, workers in turns if k % 2 == 0 else turns[::-1]:
                spent[workers.count] = done_in(client, workers, told_apart(tasks, len(tasks)))
            (wall_1, cpu_1), (wall_2, cpu_2) = spent[1], spent[2]
            walls.append((wall_1, wall_2))
            print(
                f"| {k + 1} | {len(tasks)} | {wall_1:.1f} | {wall_2:.1f} | {wall_1 / wall_2:.2f} "
                f"| {cpu_1:.1f} | {cpu_2:.1f} |",
                flush=True,
            )
    all_1, all_2 = (sum(wall) for wall in zip(*walls, strict=True))
    count = len(tasks) * rounds
    print(f"| all | {count} | {all_1:.1f} | {all_2:.1f} | {all_1 / all_2:.2f} | | |")
    print(f"logs an hour: {3600 * count / all_1:.0f} on 1, {3600 * count / all_2:.0f} on 2 workers")
    print(f"median ratio: {statistics.median(a / b for a, b in walls):.2f}")


def memory(tasks, count, scratch):
    workers = Workers(count=1)
    grown = []
    with connected(workers, scratch) as client:
        for k, _ in enumerate(served(client, Work(told_apart(tasks, count)), workers), start=1):
            (now,) = client.run(resident_mb).values()
            grown.append(now)
            if k % 10 == 0 or k == 1:
                print(f"{k} logs: {now:.0f} MB", flush=True)
    # By Theil and Sen: a peak within one log must not tilt the line.
    late = list(enumerate(grown))[len(grown) // 3 :]
    slopes = [(b - a) / (j - i) for i, a in late for j, b in late if j > i]
    print(f"slope over the last two thirds: {1000 * statistics.median(slopes):.0f} kB a log")
    print(f"greatest: {max(grown):.0f} MB")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("places", nargs="+")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--memory", type=int, metavar="LOGS")
    parser.add_argument("--cause", action="store_true")
    asked = parser.parse_args()
    found = [task_of(source, cause=asked.cause) for source in sources_of(asked.places)]
    with TemporaryDirectory() as name:
        if asked.memory:
            memory(found, asked.memory, Path(name))
        else:
            scaling(found, asked.rounds, Path(name))
