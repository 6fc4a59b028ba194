"""The program that does trials: `python -m slamreplay.replay.worker BUNDLE FOLDER...`."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from queue import SimpleQueue
from threading import Lock, Thread

from slamreplay.bundle.run import Trial
from slamreplay.bundle.view import Bundle
from slamreplay.replay.one_trial import run_trial
from slamreplay.replay.run_cache import keep_run, run_file

_writing = Lock()


def main() -> None:
    """A trial a line on stdin; for each a line on stdout with the path of its run.

    A run goes to the first of the folders that can be written to. The line is empty where the trial
    failed: whoever asked will see the fault by doing it itself. The program ends when stdin does,
    whatever it is at: whoever asked is gone.
    """
    bundle, folders = Bundle.open(Path(sys.argv[1])), [Path(name) for name in sys.argv[2:]]
    lines: SimpleQueue[str] = SimpleQueue()
    Thread(target=_listen, args=(lines,), daemon=True).start()
    while True:
        print(_done(bundle, Trial(**json.loads(lines.get())), folders), flush=True)  # noqa: T201


def _done(bundle: Bundle, trial: Trial, folders: list[Path]) -> str:
    try:
        run = run_trial(bundle, trial)
    except Exception:  # it is raised where somebody can see it
        return ""
    with _writing:
        kept = next((folder for folder in folders if keep_run(run, folder)), None)
    return "" if kept is None else str(run_file(trial, kept))


def _listen(lines: SimpleQueue[str]) -> None:
    for line in sys.stdin:
        lines.put(line)
    with _writing:  # a file that was begun is ended
        os._exit(0)


if __name__ == "__main__":
    main()
