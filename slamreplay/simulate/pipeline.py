"""From the name of a scenario to a log, and all sample logs at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

from slamreplay.bundle.atomic import write_file
from slamreplay.errors import OutputError
from slamreplay.simulate.recording import record
from slamreplay.simulate.samples import SAMPLES, readme
from slamreplay.simulate.scenarios import scenario as scenario_of
from slamreplay.simulate.topics import records
from slamreplay.simulate.writer import check_labels, write_log


def simulate(
    scenario: str,
    target: Path,
    *,
    seed: int | None = None,
    labels: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Play a scenario and write its log; the same scenario and seed give the same bytes.

    Args:
        scenario: a key of `slamreplay.simulate.SCENARIOS`.
        target: the log; `.mcap`, `.db3`, `.bag`, or no suffix for a rosbag2 folder.
        seed: of every random number; by default the scenario's own.
        labels: site, robot, software and the like, kept in the log.

    Raises:
        UsageError: there is no such scenario.
        OutputError: `target` cannot be written, has another suffix or holds no labels.
    """
    check_labels(target, labels)
    recording = record(scenario_of(scenario), seed)
    write_log(target, lambda messages: records(recording, messages), labels=labels)


def write_samples(folder: Path, *, progress: Callable[[str, float], None] | None = None) -> None:
    """Make every sample log anew, and the README that tells where they come from.

    Raises:
        OutputError: the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write: {error.strerror or error}", where=folder) from error
    for i, (file_name, scenario) in enumerate(SAMPLES.items()):
        if progress:
            progress(file_name, i / len(SAMPLES))
        simulate(scenario, folder / file_name)
    write_file(folder / "README.md", readme().encode())
