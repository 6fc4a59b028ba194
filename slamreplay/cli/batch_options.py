"""Options that `batch` and `watch` share: what goes where, by whom, and for how long."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from slamreplay.cli import completion

#: Exit codes, as shells tell of what a signal ended.
INTERRUPTED, TERMINATED = 130, 143

Output = Annotated[
    Path,
    typer.Option("-o", "--output", metavar="DIR", help="Where reports, tables and the page go."),
]
Maps = Annotated[
    str | None,
    typer.Option("--maps", metavar="CSV", help="Which logs were driven on which map, with labels."),
]
Recipe = Annotated[
    Path | None,
    typer.Option(
        "--recipe",
        metavar="YAML",
        help="Hold each log against this gate.",
        autocompletion=completion.gates,
    ),
]
Storage = Annotated[
    list[str] | None,
    typer.Option("--storage", metavar="KEY=VALUE", help="Option of fsspec for addresses."),
]
Scheduler = Annotated[
    str | None,
    typer.Option("--scheduler", metavar="ADDRESS", help="A dask cluster, as tcp://HOST:8786."),
]
Count = Annotated[
    int | None,
    typer.Option("--workers", metavar="N", help="Processes here; one per core by default."),
]
MemoryLimit = Annotated[
    str | None,
    typer.Option(
        "--memory-limit", metavar="SIZE", help="A worker beyond it is started anew, as 4GiB."
    ),
]
LogTimeout = Annotated[
    float,
    typer.Option(
        "--log-timeout", metavar="S", help="A log that takes longer fails, in s, fetching included."
    ),
]
