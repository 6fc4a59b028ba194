"""baseline.json: read with suspicion, written the same way every time."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from slamreplay.errors import UsageError
from slamreplay.evidence.clean import clean
from slamreplay.gate.baseline_kept import KeptLog
from slamreplay.gate.baseline_metrics import metric_named
from slamreplay.version import __version__

SCHEMA_VERSION = 1
#: A log takes a few kilobytes; more than this is another file.
MAX_BYTES = 50_000_000
_HINT = "slamreplay gate ... -o DIR writes DIR/baseline.json"
#: Half of a pair is how Python spells a byte of a path that is no UTF-8.
_NO_NAME = re.compile("[\x00-\x1f\x7f\ud800-\udfff]")


@dataclass(frozen=True, eq=False)
class Baseline:
    """What an earlier run of the gate kept.

    Attributes:
        logs: by name, as the command line had them.
    """

    logs: Mapping[str, KeptLog]


def baseline_json(logs: Mapping[str, KeptLog]) -> str:
    """A baseline as text: same logs, same bytes; a line for each series, so that diffs are short.

    Args:
        logs: by name, as the command line has them; what of a name no reader takes is spelt out.
    """
    content = {
        "schema_version": SCHEMA_VERSION,
        "slamreplay": __version__,
        "units": _units(logs.values()),
        "logs": {kept_name(name): _told(logs[name]) for name in sorted(logs)},
    }
    return _text(content, 0) + "\n"


def read_baseline(path: Path) -> Baseline:
    """The baseline in a file.

    Raises:
        UsageError: it cannot be read, is no JSON, of another schema or of other units, or holds
            what no gate wrote.
    """
    given = _json(path)
    if not isinstance(given, dict) or "schema_version" not in given:
        raise UsageError("not a baseline: it has no 'schema_version'", where=path, hint=_HINT)
    version = given["schema_version"]
    if type(version) is not int or version != SCHEMA_VERSION:
        raise UsageError(
            f"baseline of schema {repr(version)[:40]}, this program reads {SCHEMA_VERSION}",
            where=path, hint=f"make it anew: {_HINT}",
        )  # fmt: skip
    try:
        file = _File.model_validate(given)
    except ValidationError as error:
        raise UsageError(_fault(error), where=path, hint=_HINT) from error
    for name, unit in file.units.items():
        metric = metric_named(name)
        if metric is not None and metric.unit != unit:
            said, here = (repr(u) if u else "no unit" for u in (unit[:40], metric.unit))
            raise UsageError(f"{name} is in {said} there and in {here} here", where=path,
                             hint=f"make it anew: {_HINT}")  # fmt: skip
    return Baseline({name: log.kept() for name, log in file.logs.items()})


def kept_name(name: str) -> str:
    """The name of a log as a baseline has it: a path may hold what is no text, or no line of it."""
    return _NO_NAME.sub(lambda found: f"[U+{ord(found[0]):04X}]", name)


# A NEES may be huge. Beyond this Welch's degrees of freedom, of fourth powers, are no numbers.
_Number = Annotated[float, Field(ge=-1e60, le=1e60)]
_Ns = Annotated[int, Field(ge=-(2**62), le=2**62)]
_Name = Annotated[str, Field(min_length=1, max_length=4096, pattern=r"^[^\x00-\x1f\x7f]+$")]
_Word = Annotated[str, Field(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$")]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class _Log(_Strict):
    identity: Annotated[str, Field(pattern=r"^[0-9a-f]{32}$")]
    start_ns: _Ns
    end_ns: _Ns
    state: _Word
    failed: Annotated[list[_Word], Field(max_length=10_000)]
    block_s: Annotated[int, Field(ge=1, le=10**9)]
    over_time: dict[_Word, Annotated[list[_Number | None], Field(max_length=1000)]]
    values: dict[_Word, _Number | Literal["inf"]]
    seeds: dict[_Word, Annotated[list[_Number | Literal["inf"]], Field(max_length=10_000)]]

    def kept(self) -> KeptLog:
        blocks = {name: np.array(values, dtype=np.float64)  # None is NaN
                  for name, values in self.over_time.items()}  # fmt: skip
        return KeptLog(
            identity=self.identity,
            start_ns=self.start_ns,
            end_ns=self.end_ns,
            state=self.state,
            block_s=self.block_s,
            over_time=blocks,
            values={name: float(value) for name, value in self.values.items()},
            seeds={name: tuple(map(float, values)) for name, values in self.seeds.items()},
            failed=tuple(self.failed),
        )


class _File(_Strict):
    schema_version: int
    slamreplay: _Word
    units: dict[_Word, _Word]
    logs: dict[_Name, _Log]

    @model_validator(mode="after")
    def _has_units(self) -> _File:
        for log in self.logs.values():
            for name in (*log.over_time, *log.values, *log.seeds):
                if name not in self.units:
                    raise ValueError(f"{name[:80]!r} has no unit")
        return self


def _json(path: Path) -> Any:
    try:
        if path.exists() and not path.is_file():  # a pipe would wait for ever
            raise UsageError("not a file", where=path, hint="name the baseline.json itself")
        with path.open("rb") as stream:
            content = stream.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        why = getattr(error, "strerror", None) or error
        raise UsageError(f"cannot read the baseline: {why}", where=path, hint=_HINT) from error
    if len(content) > MAX_BYTES:
        raise UsageError(f"larger than {MAX_BYTES} bytes, so not a baseline", where=path)
    try:
        text = content.decode("utf-8-sig")
        return json.loads(text, parse_constant=_refused, object_pairs_hook=_each_once)
    except RecursionError as error:
        raise UsageError("not a baseline: nested too deep", where=path, hint=_HINT) from error
    except ValueError as error:  # of JSON, of UTF-8, of whole numbers with thousands of digits
        why = str(error).splitlines()[0][:120]
        raise UsageError(f"not JSON: {why}", where=path, hint=_HINT) from error


def _refused(constant: str) -> float:
    raise ValueError(f"{constant} is no number of JSON")


def _each_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """What a merge of two branches may leave behind twice is refused, not chosen from."""
    out: dict[str, Any] = {}
    for key, value in pairs:
        if key in out:
            raise ValueError(f"the key {key[:80]!r} is given twice")
        out[key] = value
    return out


def _fault(error: ValidationError) -> str:
    faults = error.errors(include_url=False)
    first = faults[0]
    # Of a union each member complains; the key is what the reader needs.
    where = ".".join(str(part)[:80] for part in first["loc"]) or "the file"
    message = first["msg"].removeprefix("Value error, ").removeprefix("Input ")
    more = f", and {len(faults) - 1} more" if len(faults) > 1 else ""
    return f"not a baseline: '{clean(where)}' {message}{more}"


def _units(logs: Iterable[KeptLog]) -> dict[str, str]:
    names = {name for log in logs for name in (*log.over_time, *log.values, *log.seeds)}
    found = {name: metric_named(name) for name in names}
    return {name: metric.unit if (metric := found[name]) else "" for name in sorted(names)}


def _told(log: KeptLog) -> dict[str, Any]:
    return {
        "identity": log.identity,
        "start_ns": log.start_ns,
        "end_ns": log.end_ns,
        "state": log.state,
        "failed": sorted(log.failed),
        "block_s": log.block_s,
        "over_time": {name: [_number(v) for v in log.over_time[name].tolist()]
                      for name in sorted(log.over_time)},
        "values": {name: _number(log.values[name]) for name in sorted(log.values)},
        "seeds": {name: [_number(v) for v in log.seeds[name]] for name in sorted(log.seeds)},
    }  # fmt: skip


def _number(value: float) -> float | int | str | None:
    """Whole numbers without their point, nothing for NaN: the file stays small."""
    if math.isnan(value):
        return None
    if math.isinf(value):
        return "inf"
    return int(value) if value == int(value) and abs(value) < 1e12 else value


def _text(value: Any, depth: int) -> str:
    """JSON with keys on lines of their own and lists in one line."""
    if not isinstance(value, dict) or not value:
        return json.dumps(value, allow_nan=False)
    inner = " " * (depth + 1)
    lines = [f"{inner}{json.dumps(key)}: {_text(item, depth + 1)}"
             for key, item in value.items()]  # fmt: skip
    return "{\n" + ",\n".join(lines) + "\n" + " " * depth + "}"
