"""The answer of a design as a file beside its runs: `doses.json`."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from slamreplay.errors import BundleError
from slamreplay.replay.dose import DoseCurve, DoseResults

DOSES, DOSES_FORMAT = "doses.json", 1


def doses_json(results: DoseResults) -> str:
    """The answer as text: same answer, same bytes."""
    content = {"doses_format": DOSES_FORMAT, **asdict(results)}
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def read_doses(path: Path) -> DoseResults | None:
    """The answer in a RUNS folder; None where its runs are of no design.

    Raises:
        BundleError: it cannot be read, or is of another version.
    """
    file = path / DOSES
    if not file.is_file():
        return None
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        version = content.pop("doses_format")
        if version != DOSES_FORMAT:
            raise BundleError(
                f"doses format {version}, this program reads {DOSES_FORMAT}",
                where=file,
                hint="run perturb again",
            )
        results = TypeAdapter(DoseResults).validate_json(json.dumps(content), strict=True)
    except (OSError, ValueError, LookupError, AttributeError, TypeError, ValidationError) as error:
        raise BundleError("not a readable answer of a design", where=file,
                          hint="run perturb again") from error  # fmt: skip
    if not results.limits or not all(_is_whole(curve, results) for curve in results.curves):
        raise BundleError("not a readable answer of a design: a part of it is missing", where=file,
                          hint="run perturb again")  # fmt: skip
    return results


def _is_whole(curve: DoseCurve, results: DoseResults) -> bool:
    """Whether a curve has a baseline, a level and what became of every limit, or a reason."""
    if curve.reason:
        return True
    metrics = [critical.metric for critical in curve.critical]
    return len(curve.responses) > 1 and metrics == [limit.metric for limit in results.limits]
