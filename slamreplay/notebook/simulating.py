"""Logs whose truth is known: `sr.simulate`."""

from __future__ import annotations

from pathlib import Path


def simulate(scenario: str, output: str | Path, *, seed: int | None = None) -> Path:
    """Play a scenario and write its log; the same scenario and seed give the same bytes.

    Args:
        scenario: one of `sr.list("scenarios")`.
        output: the log; .mcap, .db3, .bag, or no suffix for a rosbag2 folder.
        seed: of every random number; by default the scenario's own.

    Returns:
        The log's path.

    Raises:
        SlamreplayError: what is wrong, where, and what can be done about it, in one line.
    """
    from slamreplay.caches import cache_folder
    from slamreplay.kernel_cache import keep_kernels

    keep_kernels(cache_folder())
    from slamreplay.simulate.pipeline import simulate as play

    play(scenario, Path(output), seed=seed)
    return Path(output)
