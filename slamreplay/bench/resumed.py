"""The cases of a benchmark played into a folder, going on where an earlier run was stopped."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

from slamreplay.bench.measure import Measured
from slamreplay.bench.pool import played
from slamreplay.bench.schedule import Case
from slamreplay.bench.store import read_measured, write_measured
from slamreplay.bundle.atomic import check_target, write_file
from slamreplay.errors import OutputError

RESULTS, LOGS = "results.json", "logs"


def played_into(
    target: Path,
    cases: Sequence[Case],
    code: str,
    jobs: int,
    play: Callable[[Case], Measured],
    progress: Callable[[str, float], None] | None = None,
) -> list[Measured]:
    """What was measured of each case, in their order; kept ones are not played again.

    Args:
        target: folder of the benchmark.
        cases: to be played.
        code: what a kept one must have been made by.
        jobs: processes.
        play: as of `pool.played`.
        progress: told which case ended, and the share done.

    Raises:
        OutputError: the folder is somebody else's or cannot be written.
    """
    check_target(target, RESULTS)
    folder = target / LOGS
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write: {error.strerror or error}", where=target) from error
    # Written first: it marks the folder as ours, should the run be stopped.
    write_file(target / RESULTS, json.dumps({"complete": False}).encode())
    done = {c: m for c in cases if (m := read_measured(folder, c, code)) is not None}
    todo = [c for c in cases if c not in done]
    say = progress or (lambda _what, _share: None)
    say(f"{len(done)} logs kept", len(done) / max(len(cases), 1))
    for one in played(todo, jobs, play):
        done[one.case] = one
        write_measured(folder, one, code)
        say(one.case.name, len(done) / len(cases))
    return [done[c] for c in cases]
