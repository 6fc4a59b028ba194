"""Rounds of trials share their workers, and a worker that dies costs a trial's time, no more."""

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest

from slamreplay.bundle.run import Trial, run_bytes
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.store import write_bundle
from slamreplay.bundle.view import Bundle
from slamreplay.cli.progress import time_left
from slamreplay.replay.design import design
from slamreplay.replay.forecast import Forecast
from slamreplay.replay.runner import Replayer, replay
from slamreplay.testing.synthetic import synthetic_bundle


@pytest.fixture(scope="module")
def bundle(tmp_path_factory) -> Bundle:
    made, path = synthetic_bundle(seconds=4.0), tmp_path_factory.mktemp("log") / "b"
    write_bundle(path, made.manifest, {n: made.table(n) for n in TABLES}, {"room": made.grid()})
    return Bundle.open(path)


def trials_of(bundle, *texts):
    return design(bundle, ["dead_reckoning"], texts, 3)


def test_rounds_use_the_same_workers_and_give_the_same_bits(bundle, tmp_path):
    rounds = [trials_of(bundle, "tf_delay=0.1"), trials_of(bundle, "tf_delay=0.2", "scan_drop=0.5")]
    pids = []

    with Replayer(bundle, cache=tmp_path, workers=2) as replayer:
        found = []
        for trials in rounds:
            found.append(replayer.replay(trials))
            pids.append(replayer._workers.pids)

    for trials, runs in zip(rounds, found, strict=True):
        assert [run_bytes(r) for r in runs] == [run_bytes(r) for r in replay(bundle, trials)]
    assert pids[0] == pids[1]
    assert len(pids[0]) == 2
    assert not any(_is_there(pid) for pid in pids[0])


def test_a_killed_worker_is_replaced_and_its_trial_done(bundle, monkeypatch):
    trials = trials_of(bundle, "tf_delay=0.1", "tf_delay=0.2", "scan_drop=0.5")
    victims = []

    with Replayer(bundle, workers=2) as replayer:

        def kill_one(words, share):
            if not victims:
                victims.append(replayer._workers.pids[0])
                os.kill(victims[0], signal.SIGKILL)

        replayer._progress = kill_one
        runs = replayer.replay(trials)

    assert [r.trial for r in runs] == trials
    assert [run_bytes(r) for r in runs] == [run_bytes(r) for r in replay(bundle, trials)]


def test_a_trial_whose_workers_are_killed_again_is_told_in_one_line(bundle, tmp_path):
    trials = trials_of(bundle, "tf_delay=0.1")
    deadly = trials[1]

    with Replayer(bundle, cache=tmp_path, workers=1 + 1) as replayer:

        def kill(words, share):
            for worker in list(replayer._workers._workers):
                if worker.trial == deadly:
                    worker.process.kill()

        replayer._progress = kill
        baseline, lost = replayer.replay(trials)

    assert baseline.estimate is not None
    assert lost.estimate is None
    assert "killed 2 times (signal 9)" in str(lost.not_applicable)
    assert len(list(tmp_path.glob("*.npz"))) == 1  # it may end well the next time


def test_workers_end_when_their_parent_is_killed_and_what_is_done_stays(bundle, tmp_path):
    script = (
        "import sys, json; from pathlib import Path\n"
        "from slamreplay.bundle.view import Bundle\n"
        "from slamreplay.replay.design import design\n"
        "from slamreplay.replay.runner import Replayer\n"
        "bundle = Bundle.open(Path(sys.argv[1]))\n"
        "texts = [f'tf_delay={k / 1000}' for k in range(1, 400)]\n"
        "trials = design(bundle, ['dead_reckoning'], texts, 3)\n"
        "r = Replayer(bundle, cache=Path(sys.argv[2]), workers=2)\n"
        "r._progress = lambda words, share: print(json.dumps(r._workers.pids), flush=True)\n"
        "r.replay(trials)\n"
    )
    command = [sys.executable, "-c", script, str(bundle.path), str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as parent:
        pids = []
        for line in parent.stdout:
            pids = json.loads(line)
            if len(pids) == 2 and len(list(tmp_path.glob("*.npz"))) > 2:
                break
        parent.kill()
    end = time.monotonic() + 20.0
    while any(_is_there(pid) for pid in pids) and time.monotonic() < end:
        time.sleep(0.05)
    assert not any(_is_there(pid) for pid in pids)

    there = {file.name: file.stat().st_mtime_ns for file in tmp_path.glob("*.npz")}
    texts = [f"tf_delay={k / 1000}" for k in range(1, 400)]
    assert 2 < len(there) < len(texts)
    some = trials_of(bundle, *texts[:8])
    with Replayer(bundle, cache=tmp_path) as replayer:
        computed = []
        replayer._progress = lambda words, share: computed.append(words)
        runs = replayer.replay(some)
    assert all(r.estimate is not None for r in runs)
    after = {file.name: file.stat().st_mtime_ns for file in tmp_path.glob("*.npz")}
    assert {name: after[name] for name in there} == there  # nothing was done twice


def test_the_longest_go_first_and_what_was_never_seen_before_them():
    forecast = Forecast({"slow": 10.0, "fast": 1.0})
    trials = [Trial("b", name, k) for k in range(2) for name in ("fast", "new", "slow")]

    order = [(t.estimator, t.seed) for t in forecast.longest_first(trials)]

    assert order[0] == ("new", 0)
    assert order[1:] == [("slow", 0), ("slow", 1), ("new", 1), ("fast", 0), ("fast", 1)]


def test_the_forecast_weighs_trials_by_their_estimator():
    forecast = Forecast()
    new, other = Trial("b", "new", 0), Trial("b", "other", 0)
    assert forecast.left_s([new], {other: 4.0}, 2) is None
    assert forecast.share([], [new], {other: 4.0}) == 0.0
    for seconds in (9.0, 30.0, 10.0):
        forecast.learn(Trial("b", "slow", 0), seconds)
    forecast.learn(Trial("b", "fast", 0), 1.0)
    slow, fast = Trial("b", "slow", 1), Trial("b", "fast", 1)

    assert forecast.known == {"slow": 10.0, "fast": 1.0}
    assert forecast.left_s([slow, fast], {slow: 4.0}, 2) == pytest.approx(10.0)
    assert forecast.left_s([slow, slow, fast], {slow: 4.0}, 2) == pytest.approx(13.5)
    assert forecast.share([slow], [fast], {slow: 4.0}) == pytest.approx(14.0 / 21.0)
    assert forecast.share([slow], [], {slow: 99.0}) == pytest.approx(19.5 / 20.0)
    assert Counter(map(forecast.seconds, [slow, fast])) == {10.0: 1, 1.0: 1}


@pytest.mark.parametrize(
    ("elapsed_s", "share", "says"),
    [(5.0, 0.0, "-:--:--"), (10.0, 0.25, "0:00:30 left"), (9.0, 1.0, "0:00:00 left"),
     (900.0, 0.1, "2:15:00 left")],
)  # fmt: skip
def test_the_time_left_is_told_by_the_share_of_the_work(elapsed_s, share, says):
    assert time_left(elapsed_s, share) == says


def _is_there(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    stat = Path(f"/proc/{pid}/stat")  # a child may have ended that nobody asked after yet
    return not stat.exists() or stat.read_text().rsplit(")", 1)[1].split()[0] != "Z"
