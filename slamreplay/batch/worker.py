"""One log of many, from its files to what is kept of it: what runs in the workers."""

from __future__ import annotations

import hashlib
import shutil
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from slamreplay.batch.fetch import fetch, fetched, local_log
from slamreplay.batch.folder import report_folder
from slamreplay.batch.task import LogResult, LogTask
from slamreplay.errors import SlamreplayError, UsageError

if TYPE_CHECKING:
    import pyarrow as pa

    from slamreplay.bundle.run import Run
    from slamreplay.bundle.view import Bundle
    from slamreplay.evidence.result import Postmortem

#: Folders within the scratch one.
_NAMED, _LOG = "named", "log"
_MB = 1e6


@dataclass(frozen=True)
class Cost:
    """What a log took so far.

    Attributes:
        cpu_s: of this process.
        wall_s: by the clock.
    """

    cpu_s: float
    wall_s: float


def look_back(task: LogTask, scratch: Path | None = None) -> LogResult:
    """What is kept of one log; whatever goes wrong with it becomes its line.

    Nothing is left behind: the files that were fetched are removed with the scratch folder.

    Args:
        task: the log.
        scratch: folder that takes a folder for the time of the work; that of the dask worker by
            default, and the system's temporary one outside of one.

    Returns:
        The same bytes for the same task, but for the table `costs`.
    """
    spent = _stopwatch()
    scratch = scratch or _worker_folder()
    try:
        folder = Path(tempfile.mkdtemp(prefix="slamreplay-", dir=scratch))
    except OSError as error:
        line = f"cannot write: {error.strerror or error}, to the folder of its worker"
        return failed(task, line, spent())
    try:
        with _one_thread():
            return _judged(task, folder, spent)
    except Exception as error:  # one log never stops the others
        return failed(task, _told(task, folder, error), spent())
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def failed(task: LogTask, line: str, cost: Cost | None = None) -> LogResult:
    """The result of a log that could not be looked back on, with the line that says why."""
    from slamreplay.batch.labels import labels_of
    from slamreplay.fleet.rows import failed_rows

    # A client does not open what its workers died of.
    labels = labels_of(task.source, None if cost is None else local_log(task.source))
    tables = dict(
        failed_rows(line, key=task.key, log=task.source.log, bytes=_bytes_of(task), labels=labels)
    )
    if cost is not None:
        tables |= _costs(task.key, cost)
    return LogResult(task.key, line, {}, {}, tables)


def line_of(error: BaseException) -> str:
    """One line that says what went wrong; of a fault of ours also where."""
    if isinstance(error, SlamreplayError):
        return str(error)
    if isinstance(error, MemoryError):
        return "not enough memory for it (hint: fewer workers leave more for each)"
    frames = traceback.extract_tb(error.__traceback__)
    where = f" at {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
    text = " ".join(str(error).split())[:200]
    return f"a fault of ours: {type(error).__name__}: {text}{where}"


def _judged(task: LogTask, folder: Path, spent: Callable[[], Cost]) -> LogResult:
    from slamreplay.batch.labels import labels_of
    from slamreplay.fleet.rows import rows_of
    from slamreplay.postmortem import postmortem
    from slamreplay.report.build import build
    from slamreplay.report.writer import write_report

    bundle = _evidence(task, folder)
    post = postmortem(bundle, _runs(task, bundle), cause=task.cause)
    write_report(post, folder / "report")
    gate = _gate(task, post, folder / "report")
    tables = dict(
        rows_of(
            post,
            build(post),
            key=task.key,
            log=task.source.log,
            content=_content(post),
            bytes=_bytes_of(task),
            labels=labels_of(task.source, fetched(task.source, folder / _LOG)),
            gate=gate,
            report_folder=report_folder(task),
        )
    )
    tables |= _costs(task.key, spent())
    return LogResult(task.key, None, _read(folder / "report"), _map_files(post), tables)


def _evidence(task: LogTask, folder: Path) -> Bundle:
    from slamreplay.batch.named import placed
    from slamreplay.bundle.store import is_bundle
    from slamreplay.bundle.view import Bundle
    from slamreplay.ingest.options import IngestOptions
    from slamreplay.ingest.pipeline import ingest

    for name in (_NAMED, _LOG):
        (folder / name).mkdir()
    map_yaml, topics = placed(task.named, folder / _NAMED)
    options = IngestOptions(map=map_yaml, topics=topics, robot=task.source.robot)
    logs = fetch(task.source, task.storage, folder / _LOG)
    if len(logs) > 1 or not is_bundle(logs[0]):
        return ingest(logs, folder / "log.bundle", options)
    if options != IngestOptions():
        raise UsageError("a bundle takes no map, topics or robot: it was ingested already")
    return Bundle.open(logs[0])


def _runs(task: LogTask, bundle: Bundle) -> list[Run]:
    """Those that the gate's limits are about."""
    if task.demands is None:
        return []
    from slamreplay.gate.gated import runs_of

    return runs_of(task.demands, bundle, workers=1)


def _gate(task: LogTask, post: Postmortem, report: Path) -> str | None:
    """What the gate says, in a word; the file beside the report says it all."""
    if task.demands is None:
        return None
    from slamreplay.gate.gated import gated
    from slamreplay.gate.measuring import measures_of
    from slamreplay.gate.outcome import GateResult
    from slamreplay.gate.result_file import gate_json

    log, measures = task.source.log, measures_of(post)
    found = gated(post, task.demands, log, measures=measures, cause=task.cause)
    result = GateResult(task.demands.question, "", (found,))
    (report / "gate.json").write_bytes(gate_json(result, {log: measures}).encode())
    return found.status


def _content(post: Postmortem) -> str:
    """One hash over those of its files."""
    files = sorted(source.sha256 for source in post.manifest.sources)
    return hashlib.sha256(" ".join(files).encode()).hexdigest()


def _read(folder: Path) -> dict[str, bytes]:
    """Every file of a folder, in the order of their names."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def _map_files(post: Postmortem) -> Mapping[str, bytes]:
    from slamreplay.maps.map_server import map_files

    return {} if post.grid is None else map_files(post.grid, "map")


def _bytes_of(task: LogTask) -> int | None:
    sizes = [file.size for file in task.source.files]
    return None if None in sizes else sum(size or 0 for size in sizes)


def _told(task: LogTask, folder: Path, error: Exception) -> str:
    """The line of a failed log without the log's own path, which is shown beside it anyway."""
    line = _without(folder, line_of(error))
    own = [task.source.log]
    for file in task.source.files:
        own += [file.url, file.url.removesuffix(file.name).rstrip("/")]
    return next((line.removeprefix(f"{one}: ") for one in own if line.startswith(f"{one}: ")), line)


def _without(folder: Path, line: str) -> str:
    """The line without the scratch folder, which is another one every time."""
    for inner in (f"{_NAMED}/", f"{_LOG}/", ""):
        line = line.replace(f"{folder.as_posix()}/{inner}", "")
    return line


def _worker_folder() -> Path | None:
    """The folder of this dask worker: dask clears those of workers that were killed."""
    if "distributed" not in sys.modules:
        return None
    from distributed import get_worker

    try:
        return Path(get_worker().local_directory)
    except ValueError:
        return None


@contextmanager
def _one_thread() -> Iterator[None]:
    """A worker has one core to itself: threads within it would only stand in each other's way."""
    import numba

    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        yield
    finally:
        numba.set_num_threads(before)


def _stopwatch() -> Callable[[], Cost]:
    cpu, wall = time.process_time(), time.perf_counter()
    return lambda: Cost(time.process_time() - cpu, time.perf_counter() - wall)


def _costs(key: str, cost: Cost) -> dict[str, pa.Table]:
    from slamreplay.fleet.rows import costs_row

    return costs_row(key=key, cpu_s=cost.cpu_s, wall_s=cost.wall_s, peak_mb=peak_mb(), attempts=1)


def peak_mb() -> float | None:
    """Greatest resident memory of this process so far, MB; None where nobody tells."""
    try:  # the figure of getrusage starts at that of the process that started this one
        status = Path("/proc/self/status").read_text(encoding="utf-8")
        return int(status.split("VmHWM:")[1].split()[0]) * 1024 / _MB
    except (OSError, IndexError):
        pass
    try:
        import resource
    except ImportError:  # Windows
        return None
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / _MB
