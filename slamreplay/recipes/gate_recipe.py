"""The kind of recipe that a gate is: what must be found in a log, what must not, and limits.

Told from the others by `expect`, `forbid`, `max_severity`, `limits` or `logs` where none of their
own keys is there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import Field

from slamreplay.bundle.findings import Severity
from slamreplay.errors import UsageError
from slamreplay.estimators import RECORDED
from slamreplay.gate.asked import check_asked
from slamreplay.gate.baseline_metrics import compared
from slamreplay.gate.metrics import metric_of
from slamreplay.gate.rules import BaselineRules, Demands, Limit, Rules
from slamreplay.labs.lab import Strict
from slamreplay.recipes.dose_recipe import check_estimators
from slamreplay.recipes.validation import one_line, validated
from slamreplay.registry import nearest

#: Keys of which one makes a recipe a gate.
KEYS = ("expect", "forbid", "max_severity", "limits", "logs")

_Name = Annotated[str, Field(min_length=1, max_length=80)]
_Names = Annotated[list[_Name], Field(max_length=200)]
_Question = Annotated[str, Field(min_length=1, max_length=300)]

T = TypeVar("T")


class LimitPart(Strict):
    """How far one number may go."""

    max: float | None = None
    min: float | None = None
    clear: float | None = None
    for_s: Annotated[float, Field(ge=0.0, le=86_400.0)] | None = None


class RulesPart(Strict):
    """The keys that stand at the top of the file, and again under a pattern in `logs`."""

    expect: _Names | None = None
    forbid: _Names | None = None
    max_severity: str | None = None
    limits: Any = None  # a list or a mapping: each entry is validated by itself
    require_assessable: bool | None = None


class BaselinePart(Strict):
    """When a difference from a committed baseline counts."""

    alpha: Annotated[float, Field(gt=0.0, le=0.1)] = BaselineRules.alpha
    margins: dict[str, Annotated[float, Field(ge=0.0)]] = Field(default_factory=dict)
    gross: Annotated[float, Field(ge=1.0, le=1e6)] | None = BaselineRules.gross


class GateFile(RulesPart):
    """The keys of the file."""

    version: Literal[1]
    question: _Question
    estimators: Annotated[list[_Name], Field(max_length=50)] = Field(default_factory=list)
    seeds: Annotated[int, Field(ge=1, le=200)] = 1
    baseline: BaselinePart = Field(default_factory=BaselinePart)
    logs: dict[str, RulesPart] = Field(default_factory=dict)


@dataclass(frozen=True)
class GateRecipe:
    """A gate that a file describes."""

    demands: Demands

    @property
    def question(self) -> str:
        """One sentence."""
        return self.demands.question


def gate_recipe(given: Mapping[str, Any], path: Path) -> GateRecipe:
    """The recipe in what its file says.

    Under a pattern in `logs`, `expect`, `forbid`, `max_severity` and `require_assessable` take the
    place of those at the top. Limits add up: one of a metric takes the place of all of that metric,
    and `METRIC: null` takes them away.

    Raises:
        UsageError: a key, finding, state or metric that there is not, or a value that makes no
            sense: one line with the file, the key and a hint.
    """
    if isinstance(given.get("logs"), dict):  # first, for they are part of what is said of others
        for pattern in given["logs"]:
            _at("logs", path, _check_pattern, pattern)
    file = validated(GateFile, given, path)
    one_line("question", file.question, path)
    _at("estimators", path, check_estimators, file.estimators)
    heard = [name for name in file.estimators if name in RECORDED]
    if heard:
        raise UsageError(
            f"{heard[0]} is the log's own localizer, which is judged without being run again",
            where=f"{path}: 'estimators'",
            hint="leave it out: error_max_m and the like are its numbers",
        )
    estimators = tuple(file.estimators)
    top = _rules(file, Rules(), estimators, "", path)
    of_logs = {}
    for pattern, part in file.logs.items():
        of_logs[pattern] = _rules(part, top, estimators, f"logs.{pattern}.", path)
    if not any(_demands(rules) for rules in (top, *of_logs.values())):
        raise UsageError(
            "it demands nothing", where=path, hint=f"write one of {', '.join(KEYS[:-1])}"
        )
    for name in file.baseline.margins:
        _at("baseline.margins", path, _check_compared, name, estimators)
    baseline = BaselineRules(file.baseline.alpha, file.baseline.margins, file.baseline.gross)
    demands = Demands(file.question, top, of_logs, estimators, file.seeds, baseline)
    return GateRecipe(demands)


def _rules(
    part: RulesPart, base: Rules, estimators: tuple[str, ...], under: str, path: Path
) -> Rules:
    """The rules of a part of the file, laid over those it does not name."""
    expect = base.expect if part.expect is None else tuple(part.expect)
    forbid = base.forbid if part.forbid is None else tuple(part.forbid)
    for key, texts in (("expect", expect), ("forbid", forbid)):
        _at(f"{under}{key}", path, _check_asked, texts)
    both = [text for text in forbid if text in expect]
    if both:
        raise UsageError(f"{both[0]} is expected and forbidden", where=f"{path}: '{under}forbid'")
    states = [text for text in expect if text.startswith("state=")]
    if len(states) > 1:
        raise UsageError(
            f"a log has one state, not {states[0]} and {states[1]}",
            where=f"{path}: '{under}expect'",
            hint="a pattern names several: state=lost*",
        )
    most = base.max_severity
    if part.max_severity is not None:
        most = _at(f"{under}max_severity", path, _severity, part.max_severity)
    limits = base.limits
    if part.limits is not None:
        limits = _limits(part.limits, base.limits, estimators, f"{under}limits", path)
    assessable = part.require_assessable
    return Rules(
        expect,
        forbid,
        most,
        limits,
        base.require_assessable if assessable is None else assessable,
    )


def _demands(rules: Rules) -> bool:
    return bool(rules.expect or rules.forbid or rules.limits or rules.max_severity is not None)


def _check_compared(name: str, estimators: tuple[str, ...]) -> None:
    names = compared(estimators)
    if name not in names:
        hint = nearest(name, names)
        if len(hint) > 300:  # of every estimator there are a dozen
            hint = "it is what follows baseline/ in the checks of a run with --baseline"
        raise UsageError(f"{name[:80]!r} is not compared with a baseline", hint=hint)


def _check_asked(texts: tuple[str, ...]) -> None:
    for text in texts:
        check_asked(text)
    if len(set(texts)) != len(texts):
        twice = next(text for k, text in enumerate(texts) if text in texts[:k])
        raise UsageError(f"{twice} stands there twice")


def _severity(text: str) -> Severity | None:
    """The worst severity allowed; None allows all, as `error` does: there is nothing worse."""
    allowed: dict[str, Severity | None] = {"info": "info", "warning": "warning", "error": None}
    if text in allowed:
        return allowed[text]
    hint = "one of info, warning, error (which allows all)"
    if text == "none":
        hint = "to allow no finding at all: forbid: ['SR-*']; to allow all: max_severity: error"
    raise UsageError(f"{text[:40]!r} is no severity", hint=hint)


def _limits(
    given: Any, base: tuple[Limit, ...], estimators: tuple[str, ...], key: str, path: Path
) -> tuple[Limit, ...]:
    """Those of the base, less those of a metric that is given here, and those given."""
    told: list[Limit] = []
    for metric, where, values in _entries(given, key, path):
        _at(key, path, metric_of, metric, estimators)
        if values is None and all(one.metric != metric for one in base):
            raise UsageError(f"{metric} has no value", where=f"{path}: '{key}'",
                             hint=f"write {metric}: {{max: 1.0}}")  # fmt: skip
        if values is not None:
            part = validated(LimitPart, values, path, under=where)
            told.append(_at(where, path, _limit, metric, part, estimators))
    named = {metric for metric, _, _ in _entries(given, key, path)}
    return *(one for one in base if one.metric not in named), *told


def _entries(
    given: Any, key: str, path: Path
) -> Iterator[tuple[str, str, Mapping[str, Any] | None]]:
    """Metric, key and values of each entry; a number alone is what it may be at most."""
    if isinstance(given, dict):
        for metric, values in given.items():
            values = values if isinstance(values, dict) or values is None else {"max": values}
            yield metric, f"{key}.{metric}", values
        return
    if not isinstance(given, list):
        raise UsageError(f"'{key}' is no list and no lines of METRIC: NUMBER", where=path)
    for k, values in enumerate(given):
        if not isinstance(values, dict) or not isinstance(values.get("metric"), str):
            raise UsageError("it has no metric", where=f"{path}: '{key}.{k}'",
                             hint="write metric: error_max_m")  # fmt: skip
        rest = {name: value for name, value in values.items() if name != "metric"}
        yield values["metric"], f"{key}.{k}", rest


def _limit(metric: str, part: LimitPart, estimators: tuple[str, ...]) -> Limit:
    about = metric_of(metric, estimators)
    if part.max is None and part.min is None:
        raise UsageError(f"{metric} has neither max nor min", hint=f"write {metric}: {{max: 1.0}}")
    if part.max is not None and part.min is not None and part.min > part.max:
        raise UsageError(f"{metric}: min {part.min:g} is above max {part.max:g}")
    if part.for_s is not None and not about.over_time:
        raise UsageError(
            f"{metric} is one number for the log: there is nothing for for_s to count",
            hint="numbers over time are error_m, error_deg, sigma_m, nees, changed_share, match",
        )
    if part.clear is not None:
        _check_clear(metric, part.clear, part)
    return Limit(metric, part.max, part.min, part.clear, part.for_s or 0.0)


def _check_clear(metric: str, clear: float, part: LimitPart) -> None:
    """Hysteresis has one side, and there the limit is worse than what clears it."""
    if part.max is not None and part.min is not None:
        raise UsageError(
            f"{metric}: clear is of max or of min, not of both", hint="write two limits in a list"
        )
    if part.max is not None and clear > part.max:
        raise UsageError(f"{metric}: clear {clear:g} is above max {part.max:g}: it never clears",
                         hint=f"write one of at most {part.max:g}")  # fmt: skip
    if part.min is not None and clear < part.min:
        raise UsageError(f"{metric}: clear {clear:g} is below min {part.min:g}: it never clears",
                         hint=f"write one of at least {part.min:g}")  # fmt: skip


def _check_pattern(pattern: str) -> None:
    """A glob of a log's name that could fit one."""
    if not pattern or len(pattern) > 200 or not pattern.isprintable():
        raise UsageError(f"{pattern[:40]!r} is no pattern of a log's name")
    if "\\" in pattern:
        raise UsageError(f"{pattern[:40]!r}: names are compared with forward slashes")
    if not Path(pattern).name:
        raise UsageError(f"{pattern[:40]!r} names no log")


def _at(key: str, path: Path, make: Callable[..., T], *values: Any) -> T:
    """What `make` makes of the values under a key; its fault names file and key."""
    try:
        return make(*values)
    except UsageError as error:
        raise UsageError(error.what, where=f"{path}: '{key[:120]}'", hint=error.hint) from error
