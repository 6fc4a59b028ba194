"""Which trials a question needs: every estimator undisturbed, then one perturbation at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from slamreplay.bundle.run import Trial
from slamreplay.bundle.view import Bundle
from slamreplay.errors import UsageError
from slamreplay.estimators import ESTIMATORS, RECORDED
from slamreplay.estimators.recorded import recorded_names
from slamreplay.perturb import PERTURBATIONS
from slamreplay.perturb.variant import check_level


def usual_estimators(bundle: Bundle) -> list[str]:
    """Those that are run where nobody names any: all, and the recorded one where there is one."""
    there = recorded_names(bundle.view())
    return [name for name in ESTIMATORS if name not in RECORDED or name in there]


def design(
    bundle: Bundle,
    estimators: Sequence[str],
    perturbations: Sequence[str],
    seed: int,
    parameters: Mapping[str, str] = MappingProxyType({}),
) -> list[Trial]:
    """The baseline of every estimator, then each perturbation with every estimator.

    Args:
        bundle: the evidence.
        estimators: names in the registry.
        perturbations: texts `NAME[.VARIANT]=LEVEL`; a bare name means its first variant.
        seed: of every trial: what differs between two of them is the perturbation alone.
        parameters: canonical JSON by estimator, for those that do not run with their defaults.

    Raises:
        UsageError: an unknown name, no estimator, or a level that makes no sense.
    """
    if not estimators:
        raise UsageError("no estimator was named", hint=f"there are: {', '.join(ESTIMATORS)}")
    if seed < 0:
        raise UsageError(f"seed {seed} is negative")
    for name in estimators:
        ESTIMATORS.target(name)
    columns: list[tuple[str | None, float | None, str]] = [(None, None, "")]
    for text in perturbations:
        name, variant, level, unit = parse_perturbation(text)
        columns.append((f"{name}.{variant}", level, unit))
    trials = [
        Trial(
            bundle.manifest.bundle_id,
            estimator,
            seed,
            perturbation,
            level,
            unit,
            parameters.get(estimator, ""),
        )
        for perturbation, level, unit in columns
        for estimator in estimators
    ]
    return list(dict.fromkeys(trials))


def parse_perturbation(text: str) -> tuple[str, str, float, str]:
    """Name, variant, level and unit of a text `NAME[.VARIANT]=LEVEL`.

    Raises:
        UsageError: unknown name or variant, or a level that makes no sense.
    """
    left, _, right = text.partition("=")
    name, dot, variant = left.strip().partition(".")
    found = PERTURBATIONS.load(name)
    variant = variant if dot else next(iter(found.variants))
    try:
        level = float(right)
    except ValueError as error:
        raise UsageError(
            f"'{text}' has no number as its level", hint=f"write {name}.{variant}=LEVEL"
        ) from error
    return name, variant, level, check_level(name, found.variants, variant, level).unit
