"""Workers, clients and schedulers that are killed: nothing is lost, and nothing is there twice."""

import json
import signal
import sys
import time
from contextlib import ExitStack

import pytest
from batch_cluster import Cluster
from batch_folders import (
    check_whole,
    committed,
    finished,
    kill,
    lives,
    start,
    wait_until,
    workers_of,
    write_tiny_log,
)

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="finds a client's workers in /proc"
)


@pytest.fixture(scope="module")
def place(tmp_path_factory, logs_in):
    """Four logs, and one that is none."""
    folder = tmp_path_factory.mktemp("logs")
    for robot in range(4):
        write_tiny_log(logs_in(folder), f"robot_{robot}.mcap", robot)
    (folder / "torn.mcap").write_bytes(b"not a log")
    return folder


def test_a_killed_worker_and_a_killed_client_lose_nothing(place, tmp_path):
    target = tmp_path / "batch"
    command = ("batch", place, "-o", target, "--workers", 1, "--no-cause", "--json")

    first = start(*command)
    wait_until(lambda: committed(target) >= 1)
    kill(workers_of(first)[0])
    wait_until(lambda: committed(target) >= 3)
    workers = workers_of(first)
    kill(first.pid)
    first.communicate()
    wait_until(lambda: not any(map(lives, workers)))
    kept = committed(target)

    code, out, err = finished(start(*command))

    assert (code, err) == (0, "")
    told = json.loads(out)
    assert (told["logs"], told["kept"]) == (5, kept)
    assert told["states"] == {"insufficient_data": 4}
    assert [one["log"].rpartition("/")[2] for one in told["failed"]] == ["torn.mcap"]
    check_whole(target, done=4, failed=1)


@pytest.fixture
def cluster(tmp_path):
    folder = tmp_path / "cluster"
    folder.mkdir()
    with ExitStack() as ends:
        cluster = Cluster(folder)
        ends.callback(cluster.end)
        yield cluster


def test_a_stopped_client_a_killed_scheduler_and_logs_that_cost_their_workers_lose_nothing(
    cluster, tmp_path
):
    logs, target = tmp_path / "logs", tmp_path / "batch"
    logs.mkdir()
    for name in ["a", "b", "c", "d", "e_poison", "f", "g", "h_endless"]:
        (logs / f"{name}.mcap").write_bytes(name.encode())
    command = ("batch", logs, "-o", target, "--scheduler", cluster.address, "--json")
    (logs / "hold").touch()
    cluster.begin()
    stopped = start(*command)
    wait_until(lambda: committed(target) >= 1)
    stopped.send_signal(signal.SIGTERM)
    code, out, err = finished(stopped)
    assert (code, out) == (143, "")
    assert (target / ".lock").read_text() == ""  # who goes on may do so on another machine
    assert err == f"stopped; what is done is kept in {target}: the same command again goes on\n"
    (logs / "hold").unlink()
    cluster.begin()
    program = start(*command, "--log-timeout", 8)
    wait_until(lambda: committed(target) >= 3)
    cluster.kill(cluster.scheduler)
    cluster.end()
    until = time.monotonic() + 240

    while program.poll() is None and time.monotonic() < until:  # who dies is started anew
        cluster.begin(workers=2)
        time.sleep(0.1)

    code, out, err = finished(program)
    assert (code, err) == (0, "")
    told = json.loads(out)
    assert told["states"] == {"healthy": 6}
    poison, endless = told["failed"]
    assert poison["log"].endswith("e_poison.mcap")
    assert poison["error"].startswith("its worker died 3 times (hint: it may need more memory")
    assert endless["log"].endswith("h_endless.mcap")
    assert endless["error"] == "not done after 8 s (hint: see --log-timeout)"
    check_whole(target, done=6, failed=2)
