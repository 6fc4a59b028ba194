"""Workers, clients and schedulers that are killed: nothing is lost, and nothing is there twice."""

import json

import pytest
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


@pytest.fixture(scope="module")
def place(tmp_path_factory, logs_in):
    """Six logs, and one that is none."""
    folder = tmp_path_factory.mktemp("logs")
    for robot in range(6):
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
    wait_until(lambda: not any(map(lives, workers)), timeout=10)
    kept = committed(target)

    code, out, err = finished(start(*command))

    assert (code, err) == (0, "")
    told = json.loads(out)
    assert (told["logs"], told["kept"]) == (7, kept)
    assert told["states"] == {"insufficient_data": 6}
    assert [one["log"].rpartition("/")[2] for one in told["failed"]] == ["torn.mcap"]
    check_whole(target, done=6, failed=1)
