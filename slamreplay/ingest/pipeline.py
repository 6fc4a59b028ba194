"""One log in, one bundle out."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from slamreplay.bundle.atomic import check_target
from slamreplay.bundle.manifest import Frames, Loss, Manifest, Role, Source
from slamreplay.bundle.map_course import map_course
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.store import MANIFEST, write_bundle
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import Bundle
from slamreplay.errors import UsageError
from slamreplay.geometry.times import Times
from slamreplay.ingest.assembly import Assembly
from slamreplay.ingest.cast import Cast, settle_cast
from slamreplay.ingest.clock import choose_clock
from slamreplay.ingest.clouds.second_pass import with_clouds
from slamreplay.ingest.clouds.topics import cloud_topics
from slamreplay.ingest.inferred import with_inferred
from slamreplay.ingest.lasers import no_returns
from slamreplay.ingest.layers import lay_out
from slamreplay.ingest.log_lines import is_told_in_log
from slamreplay.ingest.meaning import without_meaning
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.overrides import check_topics, read_overrides
from slamreplay.ingest.parts import missing_parts
from slamreplay.ingest.placed_reference import placed_reference
from slamreplay.ingest.readers.open_log import open_log
from slamreplay.ingest.reading import read_rows
from slamreplay.ingest.reference_file import read_reference
from slamreplay.ingest.relations_file import SUFFIX as RELATIONS_SUFFIX
from slamreplay.ingest.relations_file import read_relations
from slamreplay.ingest.repeats import REPEATS, without_repeats
from slamreplay.ingest.robots import in_its_frames, refuse_mixture, topic_filter
from slamreplay.ingest.roles import Choice
from slamreplay.ingest.row_times import row_times
from slamreplay.ingest.rows import TopicRows
from slamreplay.ingest.span import clock_between, cut, evidence_span
from slamreplay.ingest.tables import build
from slamreplay.ingest.text_logs import read_text_log
from slamreplay.maps.grid import OccupancyGrid


def ingest(
    logs: Sequence[Path],
    target: Path,
    options: IngestOptions = IngestOptions(),  # noqa: B008 - frozen
    *,
    progress: Callable[[str, float], None] | None = None,
) -> Bundle:
    """Read a log (one container or several files of one log) into the bundle at `target`.

    Args:
        logs: .bag, .mcap, .db3 files or folders of rosbag2, several being one log; or one CARMEN
            file or MRCLAM folder.
        target: the bundle's folder; the same content there already is kept as it is.
        options: what the user says about the log.
        progress: told a few words and the share done, 0 to 1.

    Raises:
        LogError: a file is no log, or there is nothing to work with in it.
        MapError: the map cannot be read.
        UsageError: options that do not fit the log.
        OutputError: the target is somebody else's, or cannot be written.
    """
    _check_names([*logs, options.map, options.topics, options.reference])
    check_target(target, MANIFEST)
    # Beside the target, for /tmp may be memory and what waits there is too large for it.
    beside = next(folder for folder in target.absolute().parents if folder.exists())
    with TemporaryDirectory(prefix=f".{target.name}.", dir=beside) as scratch:
        return _ingest(logs, target, options, progress, Path(scratch))


def _check_names(paths: Iterable[Path | None]) -> None:
    """Names stand in the manifest, which is UTF-8; a file system takes any bytes for one."""
    for path in paths:
        try:
            str(path).encode()
        except UnicodeEncodeError as error:
            raise UsageError(
                "a name that is no UTF-8", where=str(path), hint="give the file another name"
            ) from error


def _ingest(
    logs: Sequence[Path],
    target: Path,
    options: IngestOptions,
    progress: Callable[[str, float], None] | None,
    scratch: Path,
) -> Bundle:
    overrides = read_overrides(options.topics)
    sources, cast, losses = _cast(logs, options, overrides, progress, scratch)
    layers = lay_out(cast, options.map)
    losses = [*losses, *cast.losses, *layers.losses, *no_returns(cast.topics)]
    sources += layers.sources

    clock = choose_clock(cast.topics)
    timed = []
    for rows in layers.topics:
        topic, placed = placed_reference(rows, overrides, cast.frames.map or "map")
        t_ns, remarks = row_times(topic, clock)
        losses += placed
        timed.append((topic, t_ns))
        losses += [] if is_told_in_log(topic) else remarks  # its lines are told of already
    if options.reference is not None:
        survey, at_ns, remarks = _survey(options.reference, cast.frames, layers.choices, timed)
        timed.append((survey, at_ns))
        losses += remarks
        sources.append(_source(options.reference))
        if survey.table == "references":
            layers.choices["reference"] = Choice(survey, "given with --reference")

    tables = build(timed)
    span = evidence_span(tables, cast.frames, logs[0], losses)
    tables, span = cut(tables, span, options.start_s, options.end_s)
    if progress is not None:
        progress("writing", 1.0)
    manifest = Manifest(
        bundle_id="",
        sources=sources,
        options=_texts(options),
        start_ns=span[0],
        end_ns=span[1],
        clock=clock_between(clock, tables),
        frames=cast.frames,
        roles=_roles(layers.choices),
        missing=missing_parts(_present(layers.choices, tables, cast.frames)),
        maps=[],
        losses=_sorted(losses),
        tables={},
    )
    grids = _held(layers.grids, tables, span)
    write_bundle(target, manifest, with_inferred(manifest, tables), grids)
    return Bundle.open(target)


def _cast(
    logs: Sequence[Path],
    options: IngestOptions,
    overrides: Mapping[str, str],
    progress: Callable[[str, float], None] | None,
    scratch: Path,
) -> tuple[list[Source], Cast, list[Loss]]:
    """Files, settled topics and losses of a log of any format; of the robot that is looked at."""
    text = read_text_log(logs, options.robot)
    if text is not None:
        topics, losses = _of_robot(list(text.topics), options.robot)
        check_topics(overrides, sorted({t.topic for t in topics}), options.topics)
        return list(text.sources), settle_cast(topics, overrides), [*text.losses, *losses]
    with open_log(logs) as (readers, damaged):
        sources = [s for reader in readers for s in reader.sources]
        connections = [c for reader in readers for c in reader.connections]
        if options.robot is None and not overrides:
            refuse_mixture(connections)
        of_robot = topic_filter(connections, options.robot)
        of_use = without_meaning(connections, overrides.values())
        clouds = cloud_topics(connections, overrides, of_robot)
        topics, lost = read_rows(
            readers,
            lambda topic: of_robot(topic) or of_use(topic),
            progress,
            scratch,
            later=clouds.later,
        )
        topics, losses = _of_robot(topics, options.robot)
        roles = {r: n for r, n in overrides.items() if r != "scan" or n != clouds.forced}
        check_topics(roles, sorted({t.topic for t in topics}), options.topics)
        cast, left = with_clouds(
            readers, settle_cast(topics, roles), clouds, overrides,
            robot=(options.robot or "").strip("/"), progress=progress,
        )  # fmt: skip
    return sources, cast, [*damaged, *lost, *losses, *left]


def _of_robot(topics: Sequence[TopicRows], robot: str | None) -> tuple[list[TopicRows], list[Loss]]:
    """Topics in the frames of the robot that is looked at, repetitions left out."""
    found = list(topics)
    losses: list[Loss] = []
    if robot is not None:
        found, losses = in_its_frames(found, robot)
    for place, topic in enumerate(found):  # again, for a topic is decoded in parts
        found[place], count = without_repeats(topic)
        if count:
            losses.append(Loss(kind="skipped", what=topic.topic, count=count, reason=REPEATS))
    return found, losses


def _survey(
    path: Path,
    frames: Frames,
    choices: Mapping[str, Choice],
    timed: Sequence[tuple[TopicRows, Times]],
) -> tuple[TopicRows, Times, list[Loss]]:
    base = frames.base or "base_link"
    if path.suffix != RELATIONS_SUFFIX:
        rows, losses = read_reference(path, frames.map or "map", base)
        return rows, rows.t_sensor_ns, losses
    scans = choices.get("scan")
    if scans is None:
        raise UsageError("relations are between scans, and the log has none", where=path)
    topic, t_ns = next((rows, t) for rows, t in timed if rows.topic == scans.rows.topic)
    return read_relations(path, base, topic.t_sensor_ns, t_ns)


def _source(path: Path) -> Source:
    content = path.read_bytes()
    digest = hashlib.sha256(content).hexdigest()
    return Source(name=path.name, format="reference", bytes=len(content), sha256=digest)


def _held(
    grids: Mapping[str, OccupancyGrid], tables: Mapping[str, Assembly], span: tuple[int, int]
) -> dict[str, OccupancyGrid]:
    """The maps that held in the span, in the order in which they did so last."""
    if len(grids) < 2:
        return dict(grids)
    source = {grid.version: name for name, grid in grids.items()}
    updates = Table.concat(TABLES["map_updates"], tables["map_updates"].groups())
    course = map_course(updates, list(source), *span)
    last = dict.fromkeys(h.version for h in reversed(course))
    return {source[version]: grids[source[version]] for version in reversed(last)}


def _texts(options: IngestOptions) -> dict[str, str]:
    """Options as the manifest keeps them: names without folders."""
    given = {name: getattr(options, name) for name in sorted(options.__dataclass_fields__)}
    return {
        name: value.name if isinstance(value, Path) else f"{value:g}" if name.endswith("_s")
        else str(value) for name, value in given.items() if value is not None
    }  # fmt: skip


def _roles(choices: Mapping[str, Choice]) -> list[Role]:
    return [
        Role(
            role=role,
            topic=choice.rows.topic,
            type=choice.rows.type,
            messages=choice.rows.messages,
            reason=choice.reason,
        )
        for role, choice in sorted(choices.items())
    ]


def _present(
    choices: Mapping[str, Choice], tables: Mapping[str, Assembly], frames: Frames
) -> set[str]:
    """The parts of a replay bundle that are there."""
    named = {"scan": "scans"}
    present = {named.get(role, role) for role in choices}
    transforms = tables.get("transforms")
    if transforms is not None:
        carried = (transforms["parent_frame"] == frames.odom) & (
            transforms["child_frame"] == frames.base
        )
        if carried.any():
            present.add("odometry")
    return present


def _sorted(losses: Sequence[Loss]) -> list[Loss]:
    """Losses of one kind and reason added up, in a fixed order."""
    found: dict[tuple[str, str, str], Loss] = {}
    for loss in losses:
        key = (loss.kind, loss.what, loss.reason)
        before = found.get(key)
        if before is not None:
            loss = loss.model_copy(update={"count": before.count + loss.count})
        found[key] = loss
    return [found[key] for key in sorted(found)]
