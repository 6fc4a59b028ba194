"""`slamreplay list`: what there is of each kind."""

from __future__ import annotations

import json
from math import isfinite
from typing import TYPE_CHECKING, Annotated

import typer

from slamreplay.cli.options import Json
from slamreplay.errors import UsageError

if TYPE_CHECKING:
    from slamreplay.registry import Registry

KINDS = ("estimators", "perturbations", "checks", "decoders", "scenarios", "findings", "labs")


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(name="list", help=f"List what there is: {', '.join(KINDS)}.")(_list)


def _list(
    kind: Annotated[str, typer.Argument(metavar="KIND", help=f"One of {', '.join(KINDS)}.")],
    as_json: Json = False,
) -> None:
    if kind not in KINDS:
        raise UsageError(f"there is no list of '{kind}'", hint=f"there are: {', '.join(KINDS)}")
    rows = _rows(kind)
    if as_json:
        typer.echo(json.dumps(rows, indent=1))
        return
    if kind == "perturbations":
        typer.echo(_grouped(rows))
        return
    columns = [key for key in rows[0] if key != "doc"] if rows else []
    widths = {key: max(len(str(row[key])) for row in rows) for key in columns}
    for row in rows:
        cells = [f"{row[key]!s:<{widths[key]}}" for key in columns]
        typer.echo("  ".join([*cells, str(row["doc"])]).rstrip())


def _rows(kind: str) -> list[dict[str, object]]:
    """One row per thing, with its name and one line about it."""
    if kind == "scenarios":
        from slamreplay.simulate import SCENARIOS

        return [{"name": name, "doc": doc} for name, doc in SCENARIOS.items()]
    if kind == "findings":
        from slamreplay.bundle.findings import FINDINGS

        return [{"name": name, "doc": what.title} for name, what in FINDINGS.items()]
    if kind == "perturbations":
        return _perturbations()
    registry = _registry(kind)
    rows: list[dict[str, object]] = []
    for name in registry:
        thing = registry.load(name)
        if kind == "decoders":
            rows.append({"name": name, "doc": f"to table {thing.table}"})
        elif kind == "estimators":
            needs = ", ".join(sorted(thing.needs))
            rows.append({"name": name, "needs": needs, "doc": _first_line(thing)})
        else:
            rows.append({"name": name, "doc": _first_line(thing)})
    return rows


def _perturbations() -> list[dict[str, object]]:
    """A row per variant, with the unit and the baseline its level is given in."""
    from slamreplay.perturb import PERTURBATIONS

    rows: list[dict[str, object]] = []
    for name in PERTURBATIONS:
        perturbation = PERTURBATIONS.load(name)
        for variant, about in perturbation.variants.items():
            rows.append(
                {
                    "name": f"{name}.{variant}",
                    "unit": about.unit,
                    "baseline": about.baseline,
                    "low": about.low,
                    "high": about.high if isfinite(about.high) else None,
                    "is_switch": about.is_switch,
                    "touches": sorted(perturbation.touches),
                    "about": _first_line(perturbation),
                    "doc": about.doc,
                }
            )
    return rows


def _grouped(rows: list[dict[str, object]]) -> str:
    """Each perturbation with what it touches, and below it what its levels mean."""
    from slamreplay.bundle.schema import TABLES

    lines = ["NAME.VARIANT=LEVEL; of the level: unit, what changes nothing, least to greatest"]
    cells = [[str(row["name"]), _level(row), str(row["doc"])] for row in rows]
    widths = [max(len(cell[k]) for cell in cells) for k in (0, 1)]
    before = ""
    for row, (name, level, doc) in zip(rows, cells, strict=True):
        group = name.partition(".")[0]
        if group != before:
            touches = row["touches"]
            assert isinstance(touches, list)
            settings = [t for t in touches if t not in TABLES and t != "map"]
            evidence = [t for t in touches if t not in settings]
            about = f"{', '.join(evidence)}{'settings ' * bool(settings)}{', '.join(settings)}"
            lines += ["", f"{group}: {row['about']}", f"  changes {about}"]
        lines.append(f"  {name:<{widths[0]}}  {level:<{widths[1]}}  {doc}")
        before = group
    return "\n".join(lines)


def _level(row: dict[str, object]) -> str:
    """Unit, baseline and range of a variant's level: "m, 0 (-10 to 10)"."""
    if row["is_switch"]:
        return "0 or 1"
    to = f"{row['low']:g} up" if row["high"] is None else f"{row['low']:g} to {row['high']:g}"
    return f"{row['unit']}, {row['baseline']:g} ({to})"


def _registry(kind: str) -> Registry:
    if kind == "estimators":
        from slamreplay.estimators import ESTIMATORS

        return ESTIMATORS
    if kind == "checks":
        from slamreplay.consistency import CHECKS

        return CHECKS
    if kind == "labs":
        from slamreplay.labs import LABS

        return LABS
    from slamreplay.ingest import DECODERS

    return DECODERS


def _first_line(thing: object) -> str:
    text = (thing.__doc__ or "").strip()
    return text.splitlines()[0] if text else ""
