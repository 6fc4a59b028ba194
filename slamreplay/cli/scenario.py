"""The evidence that a recipe is asked of: a log, or the scenario that it names."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from slamreplay.errors import OutputError, UsageError

if TYPE_CHECKING:
    from slamreplay.bundle.view import Bundle
    from slamreplay.ingest.options import IngestOptions


@contextmanager
def log_or_scenario(
    logs: Sequence[Path], scenario: tuple[str, int] | None, how: IngestOptions, recipe: Path
) -> Iterator[Bundle]:
    """The bundle behind a recipe; read or simulated once for all commands.

    Args:
        logs: as of `options.evidence`; where there are none the scenario takes their place.
        scenario: name and seed.
        how: to ingest a log.
        recipe: the file, for faults.

    Raises:
        UsageError: neither log nor scenario, or options of a log with a scenario.
    """
    from slamreplay.caches import bundle_folder
    from slamreplay.cli import options
    from slamreplay.ingest.bundle_cache import made_once
    from slamreplay.ingest.options import IngestOptions

    if logs:
        with options.evidence(logs, how, cache=bundle_folder()) as bundle:
            yield bundle
        return
    if scenario is None:
        raise UsageError("there is no LOG to replay", where=recipe,
                         hint="name one, or a scenario in the recipe")  # fmt: skip
    if how != IngestOptions():
        raise UsageError(
            "a simulated log takes no --map, --topics, --robot, --reference, --start or --end",
            where=recipe,
            hint="leave them out, or name a LOG",
        )
    try:
        bundle = made_once(
            bundle_folder(), [f"scenario {scenario}"], lambda target: _simulated(scenario, target)
        )
    except (OSError, OutputError):  # a cache that cannot be written is not used
        with TemporaryDirectory(prefix="slamreplay-") as folder:
            yield _simulated(scenario, Path(folder) / "log.bundle")
        return
    yield bundle


def _simulated(scenario: tuple[str, int], target: Path) -> Bundle:
    """The bundle of a scenario with a seed, written to `target`."""
    from slamreplay.cli.progress import progress_bar
    from slamreplay.ingest.pipeline import ingest
    from slamreplay.simulate.pipeline import simulate

    name, seed = scenario
    with TemporaryDirectory(prefix="slamreplay-") as folder, progress_bar("simulating"):
        log = Path(folder) / f"{name}.mcap"
        simulate(name, log, seed=seed)
        return ingest([log], target)
