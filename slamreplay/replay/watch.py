"""What a batch of trials is at, told in a file while it runs, for whoever wants to look.

The file lies in the cache under the name of the folder that is being made, which itself is whole or
absent. It is replaced in one step, so that nobody reads half of it, and is gone when the folder is
there. Whether the batch still runs is told by a lock that the system releases when a process ends,
however it ends.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Literal

from slamreplay.bundle.atomic import write_file
from slamreplay.bundle.run import Trial
from slamreplay.errors import OutputError

_FORMAT = 1
#: The file is written anew no more often than this, s.
_SELDOM_S = 0.5
#: How often, and how far apart, the lock is asked for, s.
_ATTEMPTS, _MOMENT_S = 5, 0.02

State = Literal["done", "running", "waiting"]


@dataclass(frozen=True)
class TrialState:
    """Where a trial stands.

    Attributes:
        trial: which.
        state: done, running or waiting.
        seconds: that it took or runs for already; None where it waits or came from the cache.
        run: file that the run is in once it is done, maybe since this was told; None where it is
            not kept.
    """

    trial: Trial
    state: State
    seconds: float | None = None
    run: Path | None = None


@dataclass(frozen=True)
class Watched:
    """A batch as it was told of last.

    Attributes:
        output: the folder that is to be.
        bundle: folder of the evidence.
        is_running: False where it was interrupted: killed, stopped, or ended by a fault.
        left_s: seconds until the trials asked for so far are done; None where nothing is known yet,
            or nothing runs.
        trials: in the order in which they were asked for.
    """

    output: Path
    bundle: Path
    is_running: bool
    left_s: float | None
    trials: tuple[TrialState, ...]


class Watch:
    """Tells of a batch.

    Args:
        file: to write.
        output: the folder that is to be.
    """

    def __init__(self, file: Path, output: Path) -> None:
        self._file, self._output = file, output
        self._states: dict[Trial, TrialState] = {}
        self._told_s = 0.0

    @property
    def is_due(self) -> bool:
        """Whether it is time to tell again."""
        return time.time() - self._told_s >= _SELDOM_S

    def tell(self, bundle: Path, states: Sequence[TrialState], left_s: float | None) -> None:
        """Write down where trials stand; those of earlier rounds stay as they were told of.

        Args:
            bundle: folder of the evidence.
            states: of the trials of this round.
            left_s: until they are done.
        """
        self._states |= {state.trial: state for state in states}
        self._told_s = time.time()
        told = {
            "watch_format": _FORMAT,
            "output": str(self._output),
            "bundle": str(bundle.resolve()),
            "told_s": self._told_s,
            "left_s": left_s,
            "trials": [_record(state) for state in self._states.values()],
        }
        with suppress(OSError, OutputError):  # nobody can look; the work goes on
            write_file(self._file, json.dumps(told).encode())


@contextmanager
def watched(folder: Path, output: Path) -> Iterator[Watch | None]:
    """Something to tell of a batch by; what was told stays where the block fails.

    None where the folder cannot be written, or somebody makes the same output at this moment.

    Args:
        folder: where such files lie.
        output: the folder that is to be.
    """
    file = _file(folder, output)
    for _ in range(_ATTEMPTS):  # whoever looks holds the lock for a moment
        lock = _locked(file)
        if lock is not None:
            break
        time.sleep(_MOMENT_S)
    else:
        yield None
        return
    with lock:
        yield Watch(file, output)
        file.unlink(missing_ok=True)


def look(folder: Path, output: Path) -> Watched | None:
    """What is known of the batch that makes, or was to make, a folder; None where nothing is.

    Args:
        folder: as of `watched`.
        output: the folder that is to be.
    """
    file = _file(folder, output)
    try:
        told = json.loads(file.read_text(encoding="utf-8"))
        if told["watch_format"] != _FORMAT:
            return None
        trials = tuple(_state(entry) for entry in told["trials"])
        bundle, left_s = Path(told["bundle"]), told["left_s"]
        age_s = time.time() - float(told["told_s"])
    except (OSError, ValueError, LookupError, TypeError):
        return None
    lock = _locked(file)
    if lock is not None:
        lock.close()
        left_s = None
    left_s = None if left_s is None else max(float(left_s) - age_s, 0.0)
    return Watched(output, bundle, lock is None, left_s, trials)


def _file(folder: Path, output: Path) -> Path:
    place = os.path.realpath(output)  # unlike Path.resolve it bears a link that leads to itself
    name = hashlib.sha256(os.fsencode(place)).hexdigest()[:32]
    return folder / f"{name}.json"


def _locked(file: Path) -> IO[bytes] | None:
    """The lock beside a file, until it is closed; None where somebody else holds it."""
    try:
        import fcntl

        file.parent.mkdir(parents=True, exist_ok=True)
        lock = file.with_suffix(".lock").open("ab")
    except (ImportError, OSError):  # not on every system
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        lock.close()
        return None
    return lock


def _record(state: TrialState) -> dict[str, Any]:
    run = None if state.run is None else str(state.run)
    return {
        "trial": state.trial.record, "state": state.state, "seconds": state.seconds, "run": run,
    }  # fmt: skip


def _state(entry: Mapping[str, Any]) -> TrialState:
    run = None if entry["run"] is None else Path(entry["run"])
    return TrialState(Trial(**entry["trial"]), entry["state"], entry["seconds"], run)
