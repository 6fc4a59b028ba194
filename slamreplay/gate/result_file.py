"""gate.json: all that a gate said, for programs."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from slamreplay.evidence.clean import clean
from slamreplay.gate.measures import Measure, Measures
from slamreplay.gate.outcome import STATUSES, GatedLog, GateResult, Outcome
from slamreplay.version import __version__

SCHEMA_VERSION = 1


def gate_json(result: GateResult, measures: Mapping[str, Measures]) -> str:
    """The file's text; the same result gives the same bytes, and no NaN is in it.

    Args:
        result: of all logs.
        measures: by log, of those that could be read.
    """
    outcomes = [outcome for log in result.logs for outcome in log.outcomes]
    content = {
        "schema_version": SCHEMA_VERSION,
        "slamreplay": __version__,
        "question": result.question,
        "recipe": result.recipe,
        "exit_code": result.exit_code,
        "checks": counted(outcomes),
        "logs": [_log(log, measures.get(log.log)) for log in result.logs],
    }
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def counted(outcomes: Iterable[Outcome]) -> dict[str, int]:
    """How many ended in which way, the worst first."""
    found = Counter(outcome.status for outcome in outcomes)
    return {status: found[status] for status in STATUSES}


def _log(log: GatedLog, measures: Measures | None) -> dict[str, Any]:
    return {
        "log": clean(log.log),
        "status": log.status,
        "state": log.state,
        "summary": clean(log.summary),
        "start_ns": log.start_ns,
        "report": log.report,
        "checks": counted(log.outcomes),
        "outcomes": [_outcome(outcome) for outcome in log.outcomes],
        "measures": _numbers({} if measures is None else measures.values),
        "missing": {} if measures is None else
        {clean(name): clean(measures.missing[name]) for name in sorted(measures.missing)},
    }  # fmt: skip


def _outcome(outcome: Outcome) -> dict[str, Any]:
    return {
        "check": clean(outcome.check),
        "title": clean(outcome.title),
        "status": outcome.status,
        "severity": outcome.severity,
        "message": clean(outcome.message),
        "start_ns": outcome.start_ns,
        "end_ns": outcome.end_ns,
        "value": _finite(outcome.value),
        "limit": _finite(outcome.limit),
        "unit": outcome.unit,
    }


def _numbers(values: Mapping[str, Measure]) -> dict[str, Any]:
    """By name, sorted; null is infinite: an estimator without a single pose."""
    return {
        name: {
            "value": _finite(one.value),
            "unit": one.unit,
            "low": _finite(one.low),
            "high": _finite(one.high),
            "n_eff": _finite(one.n_eff),
        }
        for name, one in sorted(values.items())
    }


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
