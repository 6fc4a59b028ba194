"""What was written before, opened again: `sr.open`."""

from __future__ import annotations

from pathlib import Path

from slamreplay.errors import BundleError, UsageError
from slamreplay.notebook.log_bundle import LogBundle
from slamreplay.notebook.report_value import Report
from slamreplay.notebook.runs_value import Runs


def open_(path: str | Path) -> LogBundle | Runs | Report:
    """A bundle, a folder of runs, or a report, from where it was written.

    Args:
        path: folder of a bundle, of runs or of a report, or report.json itself. Such a report has
            its tables; its figures come with `sr.report` of its log.

    Raises:
        UsageError: it is none of these.
        BundleError: it is not whole.
    """
    from slamreplay.bundle.store import is_bundle
    from slamreplay.caches import cache_folder
    from slamreplay.kernel_cache import keep_kernels
    from slamreplay.notebook.reading import options_of, read
    from slamreplay.replay.folder import is_runs

    keep_kernels(cache_folder())
    place = Path(path)
    if is_bundle(place):
        return read([place], options_of(None, None, None, None, None, None))
    if is_runs(place):
        return opened_runs(place)
    file = place / "report.json" if place.is_dir() else place
    if file.suffix == ".json" and file.is_file():
        return _report(file)
    raise UsageError(
        "neither a bundle, nor runs, nor a report",
        where=place,
        hint="sr.ingest reads a log, sr.report judges it",
    )


def opened_runs(path: Path) -> Runs:
    """A folder of runs.

    Raises:
        BundleError: it is not whole.
    """
    from slamreplay.replay.dose_file import read_doses
    from slamreplay.replay.folder import read_runs

    bundle, runs = read_runs(path)
    return Runs(LogBundle(bundle), tuple(runs), read_doses(path))


def _report(file: Path) -> Report:
    from pydantic import ValidationError

    from slamreplay.report.model import Report as Content

    try:
        return Report(Content.model_validate_json(file.read_bytes()))
    except (OSError, ValidationError) as error:
        raise BundleError(
            "not a report that this version reads", where=file, hint="make it again with sr.report"
        ) from error
