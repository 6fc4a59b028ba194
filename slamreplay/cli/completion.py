"""What the shell completes: names that are known without loading what they name."""

from __future__ import annotations

from pathlib import Path

#: Kinds of sightings that `--hold-out` takes.
HELD_OUT = ("dock", "fiducial", "gnss")


def estimators() -> list[str]:
    """Names for `-e`, those of other packages among them."""
    from slamreplay.estimators import ESTIMATORS

    return list(ESTIMATORS)


def perturbations() -> list[str]:
    """`NAME.VARIANT=`, to be followed by a level; of other packages the name alone."""
    from slamreplay.perturb import PERTURBATIONS, VARIANTS

    return [
        f"{name}.{variant}=" if variant else f"{name}."
        for name in PERTURBATIONS
        for variant in VARIANTS.get(name, ("",))
    ]


def findings() -> list[tuple[str, str]]:
    """Ids for `explain`, with their titles."""
    from slamreplay.bundle.findings import FINDINGS

    return [(name, what.title) for name, what in FINDINGS.items()]


def kinds() -> list[str]:
    """Kinds for `list`."""
    from slamreplay.catalogue import KINDS

    return list(KINDS)


def scenarios() -> list[tuple[str, str]]:
    """Scenarios for `simulate`, with what happens in them."""
    from slamreplay.simulate import SCENARIOS

    return list(SCENARIOS.items())


def severities() -> list[str]:
    """Severities for `--fail-on`."""
    from slamreplay.bundle.findings import SEVERITIES

    return list(SEVERITIES)


def held_out() -> list[str]:
    """Kinds for `--hold-out`."""
    return list(HELD_OUT)


def recipes() -> list[str]:
    """Recipes below the current folder; where none fits the shell goes on with file names."""
    return sorted(path.as_posix() for path in Path("recipes").glob("*/recipe.yaml"))


def gates() -> list[str]:
    """Gates below the current folder, as `recipes`."""
    return sorted(path.as_posix() for path in Path("recipes").glob("*/gate.yaml"))
