"""What the replay shows of the log and what it leaves out, in sentences."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

from slamreplay.evidence.result import Postmortem
from slamreplay.geometry.times import NS_PER_S
from slamreplay.report.replay.beams import PackedScans
from slamreplay.report.replay.ground import Ground
from slamreplay.report.replay.overlays import Overlay


def notes(
    post: Postmortem,
    *,
    scans: Sequence[PackedScans],
    overlays: Sequence[tuple[str, Overlay]],
    ground: Ground | None,
) -> tuple[str, ...]:
    """One sentence for each thing that a reader would otherwise take for the whole."""
    return (
        *_places(post),
        *_scans(post, scans),
        *_left_out(post),
        *_overlays(overlays),
        *_ground(ground),
    )


def lead(tracks: Collection[str], *, has_scans: bool) -> str:
    """What is to be seen, in one sentence, by the paths that are known."""
    if "odometry" in tracks:
        scans = ", and each scan laid where that leads" if has_scans else ""
        return f"The path by odometry alone{scans}."
    if len(tracks) == 2:
        scans = ", with the scan laid at both. A scan that fits the walls is in its place"
        return (
            "Each moment twice: dashed, where the robot believed to be, and solid, where it really "
            f"was{scans if has_scans else ''}."
        )
    if "belief" in tracks:
        return "Each moment as the robot believed it; where it really was is not known."
    if "hindsight" in tracks:
        return "Each moment as it was; what the robot believed was not recorded."
    return "The course of the log; no path through the map is known."


def rows_left_out(every: Mapping[str, int]) -> tuple[str, ...]:
    """Of paths with more rows than travel."""
    return tuple(f"Every {_nth(n)} pose of {name}." for name, n in every.items() if n > 1)


def _places(post: Postmortem) -> Iterator[str]:
    if post.frame_offset is not None and post.belief is not None:
        yield (
            f"The belief's map lies elsewhere than this one by {post.frame_offset.text}: "
            "that constant offset is taken out of all that is drawn."
        )
    if post.drawn_from_ns > post.manifest.start_ns:
        since = (post.drawn_from_ns - post.manifest.start_ns) / NS_PER_S
        yield f"Until {since:.1f} s the log is in another map, and no place is drawn."


def _scans(post: Postmortem, scans: Sequence[PackedScans]) -> Iterator[str]:
    recorded = {role.role: role.messages for role in post.manifest.roles}
    for k, one in enumerate(scans):
        told = one.thinning
        whole = max(recorded.get("scan" if k == 0 else f"scan_{k + 1}", 0), told.of_scans)
        of_which = f" of laser {k + 1}" if len(scans) > 1 else ""
        text = f"{told.scans:,} of {whole:,} scans{of_which}"
        if told.scans == whole:
            text = f"All {whole:,} scans{of_which}"
        if told.every_beam > 1:
            text += f", every {_nth(told.every_beam)} of {told.of_beams:,} beams"
        yield f"{text}; ends rounded to 1 cm."


def _left_out(post: Postmortem) -> Iterator[str]:
    """Lasers that hindsight was not made of."""
    changes = None if post.hindsight is None else post.hindsight.changes
    lasers = 0 if post.scene is None else len(post.scene.scans)
    if changes is not None and changes.met:
        for k in range(len(changes.met), lasers):
            yield (
                f"Laser {k + 1} took no part in hindsight: the map fits what it saw far worse, or "
                "places fewer scans of both. Its beams say nothing of the map."
            )


def _overlays(overlays: Sequence[tuple[str, Overlay]]) -> Iterator[str]:
    for name, one in overlays:
        groups = "clouds" if name == "particles" else "plans"
        points = "particles" if name == "particles" else "points"
        if one.groups < one.of_groups or one.points < one.of_points:
            yield f"{one.groups:,} of {one.of_groups:,} {groups}, {one.points:,} {points}."


def _ground(ground: Ground | None) -> Iterator[str]:
    if ground is not None and ground.block > 1:
        yield f"Map drawn in cells of {100.0 * ground.cell_m:.0f} cm; thin walls stay."


def _nth(n: int) -> str:
    last = "th" if n % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(n % 10, "th")
    return f"{n}{last}"
