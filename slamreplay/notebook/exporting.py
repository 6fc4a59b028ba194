"""Files for other tools: `sr.export`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from slamreplay.errors import UsageError
from slamreplay.notebook.evidence import Evidence, found
from slamreplay.notebook.progress import Progress, shown

if TYPE_CHECKING:
    from slamreplay.export.formats import Format


def export(
    evidence: Evidence,
    to: str,
    output: str | Path,
    *,
    start: float | None = None,
    end: float | None = None,
    only: Literal["recorded", "analysis"] | None = None,
    covariance: bool = False,
    redact: bool = False,
    progress: Progress | bool | None = None,
) -> list[Path]:
    """Write what was recorded, replayed and found, as `slamreplay export --to` does.

    Args:
        evidence: what `sr.ingest`, `sr.perturb` or `sr.open` gave, or the path of a log, of a
            bundle or of runs.
        to: the format, as "tum" or "mcap".
        output: folder to write.
        start: write nothing earlier, s from the log's start.
        end: write nothing later.
        only: of a format that has both, the recorded evidence or what was found in it.
        covariance: beside each trajectory one with covariances.
        redact: replace names of robots, topics, frames and files, and drop texts of logs.
        progress: told how far it is; True draws a line, False nothing.

    Returns:
        The files.

    Raises:
        SlamreplayError: what is wrong, where, and what can be done about it, in one line.
    """
    from slamreplay.bundle.atomic import check_target
    from slamreplay.export.formats import MARKER, Only, needs
    from slamreplay.export.writers import Request, redacted, window_of, write_export
    from slamreplay.postmortem import postmortem
    from slamreplay.report.build import build

    form = _format(to)
    halves = needs(form, None if only is None else Only(only), covariance=covariance)
    check_target(Path(output), MARKER, "output=")
    of = found(evidence, {}, progress)
    bundle, runs = of.log.bundle, list(of.runs)
    window = window_of(bundle, start, end)
    if redact:
        bundle, runs = redacted(bundle, runs)
    with shown(progress) as tell:
        post = postmortem(bundle, runs, progress=tell) if halves.analysis else None
        request = Request(
            bundle,
            runs=runs,
            window=window,
            post=post,
            report_json=None if post is None else build(post).json_text(),
            recorded=halves.recorded,
            covariance=covariance,
            redacted=redact,
            progress=tell,
        )
        written = write_export(request, form, Path(output))
    return [Path(output) / name for name in written.files]


def _format(name: str) -> Format:
    from slamreplay.export.formats import Format

    known = [str(form) for form in Format]
    if name not in known:
        raise UsageError(f"there is no format '{name}'", hint=f"there are: {', '.join(known)}")
    return Format(name)
