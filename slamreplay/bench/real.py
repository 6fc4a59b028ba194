"""What the verdict says of a recorded log with faults put into it, as a table.

Run it with `python -m slamreplay.bench.real LOG --map MAP.yaml`.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from slamreplay.bench.real_rows import Row, recorded, table
from slamreplay.errors import SlamreplayError

HEADINGS = (
    "injected", "lost s true/found", "changed s true/found", "lost F1", "changed F1", "at place",
    "delay s", "verdict", "mode",
)  # fmt: skip


def as_texts(row: Row) -> tuple[str, ...]:
    """A row's cells as they are printed under `HEADINGS`."""

    def number(value: float | None, digits: int = 3) -> str:
        return "-" if value is None else f"{value:.{digits}f}"

    place = "-" if row.region is None else "yes" if row.region else "no"
    return (
        row.what,
        f"{row.lost_s[0]:.1f}/{row.lost_s[1]:.1f}",
        f"{row.changed_s[0]:.1f}/{row.changed_s[1]:.1f}",
        number(row.lost.f1),
        number(row.changed.f1),
        place,
        number(row.delay_s, 1),
        row.state,
        row.mode,
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """The table of one log on stdout, as Markdown."""
    from slamreplay.ingest.options import IngestOptions
    from slamreplay.ingest.pipeline import ingest

    parser = argparse.ArgumentParser(prog="python -m slamreplay.bench.real", description=__doc__)
    parser.add_argument("log", type=Path, nargs="+")
    parser.add_argument("--map", type=Path)
    parser.add_argument("--start", type=float)
    parser.add_argument("--end", type=float)
    parser.add_argument("--seeds", type=int, default=1, help="sets of faults to put in")
    given = parser.parse_args(arguments)
    options = IngestOptions(map=given.map, start_s=given.start, end_s=given.end)
    try:
        with tempfile.TemporaryDirectory() as folder:
            bundle = ingest(given.log, Path(folder) / "log.bundle", options)
            log = recorded(bundle.view())
            sys.stdout.write("| " + " | ".join(HEADINGS) + " |\n")
            sys.stdout.write("|" + "---|" * len(HEADINGS) + "\n")
            for found in table(log, range(given.seeds), lambda text: sys.stderr.write(f"{text}\n")):
                sys.stdout.write("| " + " | ".join(as_texts(found)) + " |\n")
                sys.stdout.flush()
    except SlamreplayError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
