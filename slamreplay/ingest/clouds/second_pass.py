"""The pass over a log's clouds, once frames, clock and odometry are settled from all the rest."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from slamreplay.bundle.manifest import Clock, FrameEdge, Loss, Manifest, Role
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import Bundle, BundleView
from slamreplay.geometry.times import NO_STAMP
from slamreplay.ingest.cast import Cast
from slamreplay.ingest.clock import choose_clock
from slamreplay.ingest.clouds.band import given_band
from slamreplay.ingest.clouds.fields import Clouds
from slamreplay.ingest.clouds.flattener import Flattener
from slamreplay.ingest.clouds.reading import cloud_batches, first_clouds
from slamreplay.ingest.clouds.topics import CloudTopics, best_cloud
from slamreplay.ingest.readers.reader import Reader
from slamreplay.ingest.roles import Choice
from slamreplay.ingest.row_times import row_times
from slamreplay.ingest.rows import TopicRows
from slamreplay.ingest.tables import build


def with_clouds(
    readers: Sequence[Reader],
    cast: Cast,
    topics: CloudTopics,
    overrides: Mapping[str, str],
    *,
    robot: str = "",
    progress: Callable[[str, float], None] | None = None,
) -> tuple[Cast, list[Loss]]:
    """The cast with scans made of a cloud where no laser plays `scan`, and what was left out.

    Args:
        readers: the log's containers, read once already.
        cast: who plays what, without clouds.
        topics: the log's cloud topics.
        overrides: what the user says.
        robot: namespace to strip off frames.
        progress: told the share of clouds read.
    """
    counts: dict[str, tuple[str, int]] = {}
    for connection in (c for reader in readers for c in reader.connections):
        if connection.topic in topics.names and connection.count:
            before = counts.get(connection.topic, ("", 0))[1]
            counts[connection.topic] = (connection.type, before + connection.count)
    if not counts:
        return cast, []
    laser = cast.choices.get("scan")
    if laser is not None and topics.forced is None:
        unread = {t: c for t, c in counts.items() if t in topics.later}
        return cast, _skipped(unread, f"the laser {laser.rows.topic} is used: clouds are not read")
    known = {(loss.what, loss.reason) for reader in readers for loss in reader.losses}
    clock = choose_clock(cast.topics)
    view = _view(cast, clock)
    candidates = [topics.forced] if topics.forced else sorted(counts)
    found = {t: _named(c, robot) for t, c in first_clouds(readers, candidates).items()}
    best = (topics.forced, "given with --topics") if topics.forced else best_cloud(found, view)
    if best is None:
        return cast, _skipped(counts, "no cloud that a scan can be made of")
    topic, reason = best
    total, read = counts[topic][1], 0

    def tick(count: int) -> None:
        nonlocal read
        read += count
        if progress is not None:
            progress("reading clouds", min(read / max(total, 1), 1.0))

    losses = _skipped({t: c for t, c in counts.items() if t != topic}, f"{topic} is used instead")
    flattener = Flattener(topic, counts[topic][0], view, clock, given_band(overrides))
    for clouds in cloud_batches(readers, topic, losses, tick):
        flattener.add(_named(clouds, robot))
    losses += [
        loss
        for reader in readers
        for loss in reader.losses
        if (loss.what, loss.reason) not in known
    ]
    rows, lost = flattener.finish()
    losses += lost
    if rows is None:
        return cast, losses
    return _with_scans(cast, rows, flattener, f"{reason}; {flattener.told}"), losses


def _skipped(counts: Mapping[str, tuple[str, int]], reason: str) -> list[Loss]:
    return [
        Loss(kind="skipped", what=f"{topic} ({kind})", count=count, reason=reason)
        for topic, (kind, count) in sorted(counts.items())
    ]


def _named(clouds: Clouds, robot: str) -> Clouds:
    """Clouds with frames as the cast has them: without a robot's namespace."""
    if not robot:
        return clouds
    names = np.empty(len(clouds), dtype=object)
    names[:] = [name.removeprefix(f"{robot}/") for name in clouds.frame_id]
    return replace(clouds, frame_id=names)


def _view(cast: Cast, clock: Clock) -> BundleView:
    """Transforms, odometry and frames of the log, as later stages will see them."""
    odometry = cast.choices.get("odometry")
    wanted = [
        t for t in cast.topics
        if t.table == "transforms" or (odometry is not None and t is odometry.rows)
    ]  # fmt: skip
    roles = []
    if odometry is not None:
        rows = odometry.rows
        roles = [Role(role="odometry", topic=rows.topic, type=rows.type, messages=rows.messages,
                      reason=odometry.reason)]  # fmt: skip
    manifest = Manifest(
        bundle_id="", sources=[], options={}, start_ns=0, end_ns=0, clock=clock,
        frames=cast.frames, roles=roles, missing=[], maps=[], losses=[], tables={},
    )  # fmt: skip
    assembled = build([(topic, row_times(topic, clock)[0]) for topic in wanted])
    tables = {name: Table.concat(TABLES[name], a.groups()) for name, a in assembled.items()}
    return Bundle(manifest, tables, {}).view()


def _with_scans(cast: Cast, rows: TopicRows, flattener: Flattener, reason: str) -> Cast:
    """The cast with the flattened cloud as its laser, on tf at the sensor's place."""
    assert flattener.setting is not None
    place = flattener.setting.place
    choices = {role: c for role, c in cast.choices.items() if role != "scan_2"}
    choices["scan"] = Choice(rows, reason)
    if place.level_frame == place.frame or place.base is None or not len(rows):
        return replace(cast, topics=[*cast.topics, rows], choices=choices)
    columns = {
        "parent_frame": np.array([place.base], dtype=object),
        "child_frame": np.array([place.level_frame], dtype=object),
        "is_static": np.ones(1, dtype=bool),
        "translation_xyz": place.T_base_sensor[None, :3, 3],
        "rotation_xyzw": np.array([[0.0, 0.0, 0.0, 1.0]]),
    }
    stamped = rows.t_sensor_ns[rows.t_sensor_ns != NO_STAMP]
    stamp = stamped[:1] if len(stamped) else np.array([NO_STAMP])
    level = TopicRows(rows.topic, rows.type, 1, "transforms", columns, stamp, rows.t_log_ns[:1])
    edge = FrameEdge(parent=place.base, child=place.level_frame, is_static=True, samples=1)
    tree = sorted([*cast.frames.tree, edge], key=lambda e: (e.parent, e.child))
    frames = cast.frames.model_copy(update={"tree": tree})
    return replace(cast, topics=[*cast.topics, rows, level], choices=choices, frames=frames)
