"""What the tests of batches share: small logs, the program as its users start it, and a count."""

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

from slamreplay.fleet.store import read

ODOMETRY = "nav_msgs/msg/Odometry"
START_NS, STEP_NS = 1_700_000_000 * 10**9, 10**8


def write_tiny_log(writer, name, robot=0):
    """Odometry of 4 s: enough for a report, which says that it cannot be told."""
    messages = []
    for step in range(40):
        t = START_NS + step * STEP_NS
        odometry = writer.make(
            ODOMETRY, header__frame_id="odom", child_frame_id="base_link",
            header__stamp__sec=t // 10**9, header__stamp__nanosec=t % 10**9,
            pose__pose__position__x=0.1 * step, pose__pose__position__y=1.0 * robot,
            pose__pose__orientation__w=1.0,
        )  # fmt: skip
        messages.append(("/odom", ODOMETRY, odometry, t))
    return writer.write(name, messages)


def start(*arguments, **how):
    """The program, in a process group of its own as from a shell."""
    command = [sys.executable, "-m", "slamreplay.cli.main", *map(str, arguments)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    env = os.environ | {"PYTHONFAULTHANDLER": "1"}
    return subprocess.Popen(command, start_new_session=True, env=env, **{**pipes, **how})


def finished(program, timeout=180):
    """Exit code, stdout and stderr; one that does not end tells what it is at."""
    try:
        out, err = program.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        program.send_signal(signal.SIGABRT)
        _, err = program.communicate()
        raise AssertionError(f"it did not end within {timeout} s:\n{err[-6000:]}") from None
    return program.returncode, out, err


def wait_until(true, timeout=120):
    """Look until it is so."""
    end = time.monotonic() + timeout
    while not true():
        assert time.monotonic() < end, "it never came to that"
        time.sleep(0.05)


def committed(target):
    """How many logs the folder has so far."""
    return len(read(target, "logs")) if (target / "tables").exists() else 0


def workers_of(program):
    """Process ids of the workers that a client started."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            stat = (entry / "stat").read_text() if entry.name.isdigit() else ""
            words = (entry / "cmdline").read_text() if stat else ""
        except OSError:
            continue
        if stat and int(stat.rpartition(")")[2].split()[1]) == program.pid:
            found += [int(entry.name)] * ("spawn_main" in words)
    return found


def kill(pid):
    os.kill(pid, signal.SIGKILL)


def lives(pid):
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False


def check_whole(target, *, done, failed):
    """Every log once, as many as there are; every report whole, and none that no log has."""
    logs = read(target, "logs").to_pylist()
    raw = [row for part in sorted((target / "tables").iterdir()) for row in _rows(part)]
    assert Counter(row["key"] for row in logs).most_common(1)[0][1] == 1
    assert Counter(row["key"] for row in raw) == Counter(row["key"] for row in logs)
    assert len({row["log"] for row in logs}) == len(logs)
    assert Counter(row["status"] for row in logs) == Counter(done=done, failed=failed)
    reports = {row["report"] for row in logs if row["status"] == "done"}
    assert {f"logs/{folder.name}" for folder in (target / "logs").iterdir()} == reports
    for report in reports:
        told = json.loads((target / report / "report.json").read_text())
        assert told["schema_version"] == 1
        assert (target / report / "report.html").read_text().rstrip().endswith("</html>")
    assert not (target / ".scratch").exists()


def _rows(part):
    import pyarrow.parquet as pq

    return pq.ParquetFile(part / "logs.parquet").read().to_pylist()
