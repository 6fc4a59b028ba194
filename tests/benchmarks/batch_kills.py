"""Kill workers, clients and schedulers of a batch at random moments, again and again, and count.

Run with: uv run python tests/benchmarks/batch_kills.py [--kills 20] [--logs 40] [--seed 0]
      or: the same with --own, for workers of the client and real post-mortems of small logs

After every kill of a client the folder is looked at as it lies: no log twice, no report of a
committed log that is not whole. At the end every log must be there once.
"""

import argparse
import random
import sys
import time
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from batch_cluster import Cluster
from batch_folders import (
    check_whole,
    committed,
    finished,
    kill,
    lives,
    start,
    workers_of,
    write_tiny_log,
)
from conftest import LogWriter
from type_store import type_store

from slamreplay.fleet.store import read


def look(target):
    """Committed logs; a report that is not whole or a log that is there twice ends the campaign."""
    rows = read(target, "logs").to_pylist() if (target / "tables").exists() else []
    keys = [row["key"] for row in rows]
    assert len(set(keys)) == len(keys), "a log is there twice"
    for row in rows:
        if row["report"]:
            text = (target / row["report"] / "report.html").read_text()
            assert text.rstrip().endswith("</html>"), f"{row['report']} is not whole"
    return len(rows)


def of_a_cluster(folder, target, logs, kills, chance):
    """Random kills of client, worker and scheduler; a supervisor starts anew what died."""
    for k in range(logs):
        (folder / f"{k}.mcap").write_bytes(str(k).encode())
    cluster, killed, runs = Cluster(target.parent), Counter(), 0
    command = ("batch", folder, "-o", target, "--scheduler", cluster.address)
    client = None
    try:
        while True:
            cluster.begin(workers=2)
            if client is None:
                client, runs = start(*command), runs + 1
            end = time.monotonic() + chance.uniform(0.2, 5.0)
            is_last = sum(killed.values()) >= kills
            while client.poll() is None and (is_last or time.monotonic() < end):
                time.sleep(0.02)
                if is_last:  # workers end by themselves some time after their scheduler
                    cluster.begin(workers=2)
            if client.poll() is not None:
                code, _, err = finished(client, timeout=3600)
                assert (code, err) == (0, ""), err
                return killed, runs
            victim = chance.choice(["client", "worker", "scheduler"])
            if victim == "client":
                kill(client.pid)
                client.communicate()
                client = None
                print(f"client killed, {look(target)} logs are there", flush=True)
            else:
                of = cluster.scheduler if victim == "scheduler" else chance.choice(cluster.workers)
                cluster.kill(of)
                print(f"{victim} killed", flush=True)
            killed[victim] += 1
    finally:
        cluster.end()
        if client is not None and client.poll() is None:
            kill(client.pid)


def of_its_own(folder, target, logs, kills, chance):
    """Random kills of client and worker, with real post-mortems."""
    writer = LogWriter(folder, {2: type_store(2)})
    for k in range(logs):
        write_tiny_log(writer, f"{k}.mcap", k)
    command = ("batch", folder, "-o", target, "--workers", 2, "--no-cause")
    killed, runs, client = Counter(), 0, None
    while True:
        if client is None:
            client, runs = start(*command), runs + 1
        before, starts = committed(target), chance.random() < 0.3
        end = time.monotonic() + chance.uniform(0.0, 4.0)
        while client.poll() is None and (time.monotonic() < end or not starts):
            if committed(target) > before and not starts:  # else most would die before any work
                starts, end = True, time.monotonic() + chance.uniform(0.0, 4.0)
            time.sleep(0.02)
        if client.poll() is not None or sum(killed.values()) >= kills:
            code, _, err = finished(client, timeout=3600)
            assert (code, err) == (0, ""), err
            return killed, runs
        workers = workers_of(client)
        if workers and chance.random() < 0.5:
            kill(chance.choice(workers))
            killed["worker"] += 1
            print("worker killed", flush=True)
            continue
        kill(client.pid)
        client.communicate()
        client = None
        killed["client"] += 1
        time.sleep(0.5)
        assert not any(map(lives, workers)), "a worker outlived its client"
        print(f"client killed, {look(target)} logs are there", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--logs", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--own", action="store_true")
    asked = parser.parse_args()
    with TemporaryDirectory() as name:
        folder, target = Path(name) / "logs", Path(name) / "batch"
        folder.mkdir()
        campaign = of_its_own if asked.own else of_a_cluster
        killed, runs = campaign(folder, target, asked.logs, asked.kills, random.Random(asked.seed))
        check_whole(target, done=asked.logs, failed=0)
        told = ", ".join(f"{count} of a {who}" for who, count in sorted(killed.items()))
        print(f"kills: {told}; runs: {runs}")
        print(f"{asked.logs} logs: {look(target)} rows, every one once, every report whole")
