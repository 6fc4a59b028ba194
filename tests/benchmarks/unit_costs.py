"""What a fleet's post-mortems cost: per minute of log, and for so many robots and hours.

Run with: NUMBA_NUM_THREADS=1 uv run python tests/benchmarks/unit_costs.py FOLDER [--robots 10000]

Logs stay in FOLDER and are used again; making them takes some minutes. Each log is judged in a
process of its own that judged a short one before, as a worker that goes on and on; CPU is that of
the process, so a busy machine changes it little, and says nothing of how long one waits. With
--measured the arithmetic is done again from FOLDER/unit_costs.json alone.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pyarrow as pa

#: Minutes of a tour through a hall of 40 x 40 m in which racks are gone and boxes stand about.
MINUTES = (1, 10, 30)
#: Kinds of incident of `slamreplay bench`, a minute or two each: what one looks at around a stop.
KINDS = ("wrong_start", "wheel_slip", "kidnapped", "racks_moved", "healthy", "people")
SEEDS = (901, 902)
STAGES = ("ingest", "look_back", "cause", "report")


def logs_of(folder: Path) -> list[tuple[str, Path]]:
    """Every log that is measured, made where it is not there: what it is called, and its file."""
    from long_logs import long_log

    found = []
    for minutes in MINUTES:
        log = folder / f"tour_{minutes}.mcap"
        if not log.exists():
            long_log(log, 40.0, 60.0 * minutes, 31)
        found.append((f"tour of {minutes} min", log))
    for kind in KINDS:
        for seed in SEEDS:
            log = folder / f"{kind}_{seed}.mcap"
            if not log.exists():
                _write_incident(kind, seed, log)
            found.append((kind, log))
    return found


def _write_incident(kind: str, seed: int, log: Path) -> None:
    from slamreplay.bench.incidents import incident
    from slamreplay.simulate.topics import records
    from slamreplay.simulate.writer import write_log

    recording = incident(kind, seed).recording
    write_log(log, lambda messages: records(recording, messages))


def measured(log: Path, warm: Path, folder: Path) -> dict[str, float | str]:
    """CPU seconds by stage, bytes and peak memory of this process, which judges one log.

    Args:
        log: what is measured.
        warm: judged before: what a process loads for its first log counts as its start.
        folder: of a batch, whose tables get the rows.
    """
    from slamreplay.batch.worker import peak_mb
    from slamreplay.fleet.store import commit

    judged(warm)
    start_s = time.process_time()
    found, rows = judged(log)
    commit(folder, rows)
    return {**found, "start": start_s, "log_b": log.stat().st_size, "peak_mb": peak_mb() or 0.0}


def judged(log: Path) -> tuple[dict[str, float | str], dict[str, pa.Table]]:
    """CPU seconds by stage, bytes, and the rows."""
    from slamreplay.fleet.rows import rows_of
    from slamreplay.ingest.pipeline import ingest
    from slamreplay.postmortem import postmortem
    from slamreplay.report.build import build
    from slamreplay.report.writer import write_report

    spent: dict[str, float | str] = {}
    begun_s = time.process_time()

    def lap(stage: str) -> None:
        nonlocal begun_s
        now = time.process_time()
        spent[stage], begun_s = now - begun_s, now

    with tempfile.TemporaryDirectory() as scratch:
        work = Path(scratch)
        bundle = ingest([log], work / "bundle")
        lap("ingest")
        postmortem(bundle, cause=False)
        lap("look_back")
        post = postmortem(bundle)
        lap("with_cause")
        write_report(post, work / "report")
        lap("report")
        rows = rows_of(
            post, build(post), key=log.name, log=str(log), content=None, bytes=None, labels={},
            gate=None, report_folder=None,
        )  # fmt: skip
        spent["bundle_b"], spent["report_b"] = _bytes(work / "bundle"), _bytes(work / "report")
    spent["cause"] = max(float(spent["with_cause"]) - float(spent["look_back"]), 0.0)
    spent["minutes"] = (bundle.manifest.end_ns - bundle.manifest.start_ns) / 60e9
    return {**spent, "state": post.judgement.state}, rows


def _bytes(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


def measure(folder: Path) -> list[dict[str, float | str]]:
    """All logs, each in a process of its own, whose kernels were compiled before."""
    from slamreplay.fleet.store import compact

    subprocess.run([sys.executable, __file__, folder, "--prepare"], check=True)
    rows = []
    shutil.rmtree(folder / "batch", ignore_errors=True)
    logs = json.loads((folder / "logs.json").read_text(encoding="utf-8"))
    for compiled, (name, log) in enumerate([logs[0], *logs]):
        command = [sys.executable, __file__, folder, "--one", log, logs[0][1]]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        if compiled:
            rows.append({"name": name, **json.loads(done.stdout)})
            print(json.dumps(rows[-1]), file=sys.stderr, flush=True)
    compact(folder / "batch")
    rows_b = _bytes(folder / "batch" / "tables") / len(logs)
    return [{**row, "rows_b": rows_b} for row in rows]


@dataclass(frozen=True)
class Fleet:
    """What is asked of the arithmetic.

    Attributes:
        robots: how many.
        hours: that each of them drives a day.
        stops: unplanned ones of a robot in an hour of driving.
        days: that reports are kept.
    """

    robots: int = 10_000
    hours: float = 10.0
    stops: float = 0.5
    days: int = 90


def table(rows: list[dict[str, float | str]]) -> str:
    """What was measured, the mean of each kind of log."""
    head = ("log", "min", *STAGES, "CPU per min", "peak", "log per min", "bundle per min", "report")
    lines = [_line(*head), _line(*["---"] * len(head))]
    for name in dict.fromkeys(str(row["name"]) for row in rows):
        of = _named(rows, name)
        n, minutes = len(of), _sum(of, "minutes")
        lines.append(
            _line(
                name,
                f"{minutes / n:.1f}",
                *(f"{_sum(of, stage) / n:.1f} s" for stage in STAGES),
                f"{_cpu_s(of) / minutes:.1f} s",
                f"{max(float(row['peak_mb']) for row in of):.0f} MB",
                f"{_sum(of, 'log_b') / 1e6 / minutes:.2f} MB",
                f"{_sum(of, 'bundle_b') / 1e6 / minutes:.2f} MB",
                f"{_sum(of, 'report_b') / 1e6 / n:.2f} MB",
            )
        )
    start = _sum(rows, "start") / len(rows)
    rows_kb = float(rows[0]["rows_b"]) / 1e3
    told = f"A process takes {start:.0f} s of CPU until its second log; the rows of a log take "
    return "\n".join([*lines, "", f"{told}{rows_kb:.1f} kB when laid together."])


def answer(rows: list[dict[str, float | str]], fleet: Fleet) -> str:
    """The arithmetic, a line for each way to choose what is looked at."""
    driven = fleet.robots * fleet.hours
    half_hours = f"tour of {MINUTES[-1]} min"
    head = ("what is looked at", "logs", "CPU", "cores", "memory of one", "read", "written", "kept")
    asked = (
        f"{fleet.robots:,} robots that drive {fleet.hours:g} h a day and stop {fleet.stops:g} "
        f"times an hour unplanned; reports are kept for {fleet.days} days:\n"
    )
    lines = [asked, _line(*head), _line(*["---"] * len(head))]
    for what, of, logs in (
        ("what is around stops", [r for r in rows if r["name"] in KINDS], driven * fleet.stops),
        ("everything", _named(rows, half_hours), driven * 2.0),
    ):
        cpu_h = logs * _cpu_s(of) / len(of) / 3600.0
        read_tb = logs * _sum(of, "log_b") / len(of) / 1e12
        written_tb = logs * (_sum(of, "report_b") / len(of) + float(of[0]["rows_b"])) / 1e12
        minutes = _sum(of, "minutes") / len(of)
        lines.append(
            _line(
                f"{what}, logs of {minutes:.1f} min",
                f"{logs:,.0f} a day",
                f"{cpu_h:,.0f} h a day",
                f"{cpu_h / 24.0:,.0f}",
                f"{max(float(row['peak_mb']) for row in of) / 1e3:.1f} GB",
                f"{read_tb:.2f} TB a day",
                f"{written_tb:.2f} TB a day",
                f"{written_tb * fleet.days:.0f} TB",
            )
        )
    return "\n".join(lines)


def _named(rows: list[dict[str, float | str]], name: str) -> list[dict[str, float | str]]:
    return [row for row in rows if row["name"] == name]


def _sum(rows: list[dict[str, float | str]], key: str) -> float:
    return sum(float(row[key]) for row in rows)


def _cpu_s(rows: list[dict[str, float | str]]) -> float:
    return sum(_sum(rows, stage) for stage in STAGES)


def _line(*cells: object) -> str:
    return f"| {' | '.join(map(str, cells))} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--measured", action="store_true")
    parser.add_argument("--prepare", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--one", type=Path, nargs=2, help=argparse.SUPPRESS)
    for name, kind in Fleet.__dataclass_fields__.items():
        parser.add_argument(f"--{name}", type=type(kind.default), default=kind.default)
    asked = parser.parse_args()
    if asked.one is not None:
        print(json.dumps(measured(*asked.one, asked.folder / "batch")))
        return
    if asked.prepare:
        asked.folder.mkdir(parents=True, exist_ok=True)
        told = [(name, str(log)) for name, log in logs_of(asked.folder)]
        (asked.folder / "logs.json").write_text(json.dumps(told))
        return
    kept = asked.folder / "unit_costs.json"
    if not asked.measured:
        rows = measure(asked.folder)
        kept.write_text(json.dumps(rows, indent=1))
    rows = json.loads(kept.read_text())
    fleet = Fleet(**{name: getattr(asked, name) for name in Fleet.__dataclass_fields__})
    print(table(rows), answer(rows, fleet), sep="\n\n")


if __name__ == "__main__":
    main()
