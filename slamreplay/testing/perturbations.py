"""check_perturbation: the assertions every perturbation must meet.

from slamreplay.testing.perturbations import check_perturbation
check_perturbation(MyPerturbation())
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.view import Bundle, BundleView
from slamreplay.errors import UsageError
from slamreplay.perturb.variant import Variant
from slamreplay.testing import edits
from slamreplay.testing.conformance import (
    ConformanceError,
    demand,
    demand_frozen_dataclass,
    untouched_global_rng,
)
from slamreplay.testing.synthetic import synthetic_bundle

#: Levels that are tried where nobody names one, by unit; the greatest one is tried after them.
TRIED = {"s": 0.4, "m": 0.5, "deg": 20.0, "ratio": 0.5}


def check_perturbation(
    perturbation: Any,
    *,
    bundle: Bundle | None = None,
    levels: Mapping[str, float] | None = None,
    seed: int = 1,
) -> None:
    """Raise ConformanceError at the first part of the contract that the perturbation breaks.

    Args:
        perturbation: with `name`, `variants`, `touches` and `apply(view, variant, level, rng)`.
        bundle: evidence that it applies to; by default a robot in a small synthetic room.
        levels: a level to try, by variant.
        seed: of the generator it is given.
    """
    bundle = synthetic_bundle(seconds=8.0) if bundle is None else bundle
    demand_frozen_dataclass(perturbation)
    variants = getattr(perturbation, "variants", None)
    demand(
        isinstance(variants, dict) and all(isinstance(v, Variant) for v in variants.values()),
        f"{perturbation.name} has no variants: dict[str, Variant]",
    )
    demand(variants, f"{perturbation.name} has no variant")
    demand(
        isinstance(getattr(perturbation, "touches", None), frozenset),
        f"{perturbation.name} has no touches: frozenset[str]",
    )
    before = edits.fingerprints(bundle)
    for name, variant in perturbation.variants.items():
        full = f"{perturbation.name}.{name}"
        demand(variant.low <= variant.baseline <= variant.high, f"{full}: baseline is out of range")
        plain = _apply(perturbation, bundle, name, variant.baseline, seed)
        demand(
            _state(plain) == _state(bundle.view()), f"{full}: its baseline level changes something"
        )
        _refuses_nonsense(perturbation, bundle, name, seed)
        level = (levels or {}).get(name)
        level = _some_level(perturbation, bundle, name, seed) if level is None else level
        changed = _apply(perturbation, bundle, name, level, seed)
        again = _apply(perturbation, bundle, name, level, seed)
        demand(_state(changed) == _state(again), f"{full}: the same seed gives other bits")
        _touches_what_it_says(perturbation, full, bundle, changed)
        _keeps_the_order_of_rows(full, bundle, changed)
        misled = _apply(perturbation, edits.poisoned(bundle), name, level, seed)
        demand(
            {k: v for k, v in _state(misled).items() if k != "references"}
            == {k: v for k, v in _state(changed).items() if k != "references"},
            f"{full} reads references that only judge",
        )
    demand(edits.fingerprints(bundle) == before, f"{perturbation.name} writes into its source")


def _apply(perturbation: Any, bundle: Bundle, variant: str, level: float, seed: int) -> BundleView:
    rng = np.random.Generator(np.random.PCG64(seed))
    with untouched_global_rng(perturbation.name):
        view = perturbation.apply(bundle.view(), variant, level, rng)
    demand(isinstance(view, BundleView), f"{perturbation.name} gives no BundleView")
    return view


def _state(view: BundleView) -> dict[str, object]:
    """Everything an estimator could see of a view."""
    return {**edits.fingerprints(view), **{f"setting {k}": v for k, v in view.settings.items()}}


def _some_level(perturbation: Any, bundle: Bundle, name: str, seed: int) -> float:
    variant = perturbation.variants[name]
    usual = min(max(TRIED[variant.unit], variant.low), variant.high)
    for level in (usual, variant.high):
        try:
            _apply(perturbation, bundle, name, level, seed)
        except UsageError:
            continue
        return float(level)
    raise ConformanceError(f"{perturbation.name}.{name}: name a level to try with `levels`")


def _refuses_nonsense(perturbation: Any, bundle: Bundle, name: str, seed: int) -> None:
    for level in (float("nan"), float("inf"), float("-inf")):
        try:
            _apply(perturbation, bundle, name, level, seed)
        except UsageError:
            continue
        raise ConformanceError(f"{perturbation.name}.{name} takes {level} for a level")


def _touches_what_it_says(
    perturbation: Any, full: str, bundle: Bundle, changed: BundleView
) -> None:
    before, after = edits.fingerprints(bundle.view()), edits.fingerprints(changed)
    differing = {name for name in before if before[name] != after[name]} | set(changed.settings)
    demand("references" not in {*differing, *changed.tables}, f"{full} touches references")
    demand(
        differing <= perturbation.touches,
        f"{full} touches {', '.join(sorted(differing - perturbation.touches))} undeclared",
    )
    demand(differing, f"{full} changes nothing")


def _keeps_the_order_of_rows(full: str, bundle: Bundle, changed: BundleView) -> None:
    """Rows may vanish or change; those that stay keep their order, by when they were recorded."""
    for name in TABLES:
        if name not in changed.tables:
            continue
        before, after = bundle.table(name), changed.table(name)
        old = iter(zip(before["t_log_ns"].tolist(), before["topic"].tolist(), strict=True))
        new = zip(after["t_log_ns"].tolist(), after["topic"].tolist(), strict=True)
        demand(all(row in old for row in new), f"{full} changes the order of rows in '{name}'")
