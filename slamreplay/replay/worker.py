"""The program that does trials: `python -m slamreplay.replay.worker BUNDLE FOLDER`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from slamreplay.bundle.run import Trial
from slamreplay.bundle.view import Bundle
from slamreplay.replay.runner import into_cache, run_file


def main() -> None:
    """A trial a line on stdin; a line with the path of its run on stdout for each."""
    bundle, folder = Bundle.open(Path(sys.argv[1])), Path(sys.argv[2])
    for line in sys.stdin:
        trial = Trial(**json.loads(line))
        into_cache(bundle, trial, folder)
        print(run_file(trial, folder), flush=True)  # noqa: T201 - it is what the parent reads


if __name__ == "__main__":
    main()
