"""`slamreplay list`: what there is of each kind."""

from __future__ import annotations

import json
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
        for variant, about in PERTURBATIONS.load(name).variants.items():
            rows.append(
                {
                    "name": f"{name}.{variant}",
                    "unit": about.unit,
                    "baseline": about.baseline,
                    "doc": about.doc,
                }
            )
    return rows


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
