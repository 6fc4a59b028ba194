"""The work of `slamreplay gate`: each log by itself, then the baseline, then the files."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from slamreplay.bundle.atomic import atomic_folder
from slamreplay.caches import bundle_folder, run_folder
from slamreplay.cli import options
from slamreplay.cli.progress import progress_bar
from slamreplay.cli.terminal import complain
from slamreplay.errors import OutputError, SlamreplayError
from slamreplay.evidence.clean import one_line
from slamreplay.gate.baseline import (
    ALL_LOGS,
    Baseline,
    KeptLog,
    baseline_json,
    compare,
    failed_before,
    kept_log,
)
from slamreplay.gate.gated import gated, runs_of, unread
from slamreplay.gate.gitlab import code_quality_json
from slamreplay.gate.junit import junit_xml
from slamreplay.gate.measures import Measures
from slamreplay.gate.measuring import measures_of
from slamreplay.gate.outcome import GatedLog, GateResult
from slamreplay.gate.result_file import gate_json
from slamreplay.gate.sarif import sarif_text
from slamreplay.gate.step_summary import step_summary
from slamreplay.postmortem import postmortem

if TYPE_CHECKING:
    from slamreplay.gate.rules import Demands
    from slamreplay.ingest.options import IngestOptions

MARKER = "gate.json"
#: Folder of the reports.
_LOGS = "logs"
WRITERS: dict[str, Callable[[GateResult], str]] = {
    "junit": junit_xml,
    "sarif": sarif_text,
    "gitlab": code_quality_json,
}
_FILES = {
    "junit.xml": junit_xml,
    "gate.sarif": sarif_text,
    "gl-code-quality.json": code_quality_json,
    "summary.md": step_summary,
}


@dataclass(frozen=True)
class Gating:
    """What all logs are held against.

    Attributes:
        demands: of the recipe.
        recipe: its path as given.
        how: to ingest.
        cause: whether root causes are looked for.
        baseline: of an earlier run; None without one.
        baseline_path: its path as given; empty without one.
    """

    demands: Demands
    recipe: str
    how: IngestOptions
    cause: bool
    baseline: Baseline | None
    baseline_path: str


@dataclass(frozen=True, eq=False)
class Done:
    """What came of it.

    Attributes:
        result: of all logs.
        json: text of gate.json.
        fault: the first fault of ours; None if there was none. All else is done before it is told.
    """

    result: GateResult
    json: str
    fault: Exception | None


def judged(logs: Sequence[Path], gating: Gating, output: Path | None) -> Done:
    """Every log held against the demands, and the folder written where one is asked for.

    Args:
        logs: each a log or a bundle.
        gating: the demands.
        output: folder of reports and files; None writes none.

    Raises:
        OutputError: the folder cannot be written.
    """
    with _folder(output) as work:
        found: list[GatedLog] = []
        measures: dict[str, Measures] = {}
        kept: dict[str, KeptLog] = {}
        fault: Exception | None = None
        names = _report_names(logs)
        for number, (log, name) in enumerate(zip(logs, names, strict=True), 1):
            told = f"{number} of {len(logs)}: {log}"
            try:
                one, of_log, keep = _looked_at(log, gating, work, name)
            except OutputError:
                raise
            except SlamreplayError as error:
                found.append(unread(log.as_posix(), str(error)))
            except Exception as error:
                # The other logs are judged all the same; the fault is told at the end.
                fault = fault or error
                text = one_line(f"a fault of ours: {type(error).__name__}: {error}", 300)
                found.append(unread(log.as_posix(), text))
            else:
                found.append(one)
                # Numbers over time are judged by now; those of a thousand logs would fill memory.
                measures[one.log] = replace(of_log, series={})
                kept[one.log] = keep
            complain(f"{told}: {found[-1].status}")
        found = _compared(found, kept, gating)
        result = GateResult(gating.demands.question, gating.recipe, tuple(found))
        text = gate_json(result, measures)
        if work is not None:
            files = {name: write(result) for name, write in _FILES.items()}
            files |= {MARKER: text, "baseline.json": baseline_json(kept)}
            for file, content in files.items():
                (work / file).write_bytes(content.encode())
    return Done(result, text, fault)


def _looked_at(
    log: Path, gating: Gating, work: Path | None, name: str
) -> tuple[GatedLog, Measures, KeptLog]:
    """One log: its post-mortem, its report where a folder is written, and what the gate says."""
    shown = log.as_posix()
    with (
        options.evidence([log], gating.how, cache=bundle_folder()) as bundle,
        progress_bar(f"looking back on {log.name}") as progress,
    ):
        runs = runs_of(gating.demands, bundle, progress=progress, cache=run_folder())
        post = postmortem(
            bundle, runs, cause=gating.cause, scene=work is not None, progress=progress
        )
        if work is not None:
            from slamreplay.report.writer import write_report

            write_report(post, work / _LOGS / name)
        measures, sources = measures_of(post), post.manifest.sources
        before = gating.baseline
        found = gated(
            post,
            gating.demands,
            shown,
            measures=measures,
            cause=gating.cause,
            failed_before=() if before is None else failed_before(before, shown, sources),
            report=None if work is None else f"{_LOGS}/{name}",
        )
        keep = kept_log(measures, sources, post.judgement.state, found.outcomes)
    return found, measures, keep


def _compared(found: list[GatedLog], kept: dict[str, KeptLog], gating: Gating) -> list[GatedLog]:
    """The logs with what differs from the baseline; last, under its path, all logs together."""
    if gating.baseline is None:
        return found
    outcomes = compare(gating.baseline, kept, gating.demands.baseline)
    logs = [replace(log, outcomes=(*log.outcomes, *outcomes.get(log.log, ()))) for log in found]
    together = outcomes.get(ALL_LOGS, ())
    if together:
        text = f"{ALL_LOGS} against {gating.baseline_path}"
        logs.append(GatedLog(gating.baseline_path, None, text, None, together))
    return logs


@contextmanager
def _folder(output: Path | None) -> Iterator[Path | None]:
    if output is None:
        yield None
        return
    with atomic_folder(output, marker=MARKER) as work:
        yield work


def _report_names(logs: Sequence[Path]) -> list[str]:
    """A folder's name for each log: its own without its ending, numbered where it occurs again."""
    names: list[str] = []
    for log in logs:
        stem = re.sub(r"[^\w.-]+", "_", log.absolute().stem).strip(".") or "log"
        name, number = stem, 1
        while name in names:
            number += 1
            name = f"{stem}-{number}"
        names.append(name)
    return names
