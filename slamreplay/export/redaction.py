"""A log without the names that identify a robot, its place or its maker.

The names are replaced before anything is worked out, in the bundle itself: what is found and
written afterwards never saw them. A name keeps the words that say what it is ("/acme_7/base_scan"
becomes "/robot_1/topic_1_scan"), for roles are told by them; a word is kept only if it stands in
`slamreplay.export.standard_words`. Everything else of it becomes a pseudonym, the same one wherever
the name occurs. Texts of logs and diagnostics are dropped, not searched: of a recovery, a state of
a battery and a safety stop the meaning stays.

What it does not touch: numbers. The shape of the map, poses and times say where and when.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import PurePath

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.batteries import STATES
from slamreplay.bundle.manifest import Frames, Loss, Manifest, MapVersion, Role, Source
from slamreplay.bundle.run import Estimate, Run
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.export.pseudonyms import Pseudonyms
from slamreplay.export.said_again import said_again
from slamreplay.ingest import DECODERS
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.verdict.motion import word_of_protection

#: An id of a goal as ROS 2 makes them: random bytes, no name.
_RANDOM_ID = re.compile(r"[0-9a-f]{32}|[0-9a-f]{0}")
#: Columns of tables that hold names, and what they are names of.
_COLUMNS = {
    "topic": "topic", "grid_topic": "topic", "frame_id": "frame", "child_frame_id": "frame",
    "parent_frame": "frame", "child_frame": "frame",
}  # fmt: skip


class Redactor:
    """Pseudonyms for the names of one log.

    Args:
        bundle: the log; its topics' namespaces are numbered in the order of their names.
    """

    def __init__(self, bundle: Bundle) -> None:
        self._names = Pseudonyms()
        self._bundle = bundle
        for name in sorted(_topics_of(bundle)):
            self._names.topic(name)

    def bundle(self) -> Bundle:
        """The log with other names, in memory."""
        grids = {v: self._grid(g) for v, g in self._bundle.grids().items()}
        versions = {old: grid.version for old, grid in grids.items()}
        tables = {name: self._table(name, versions) for name in TABLES}
        manifest = self._manifest(versions)
        return Bundle(manifest, tables, {g.version: g for g in grids.values()})

    def run(self, run: Run) -> Run:
        """A run with other names in its path and its ledger."""
        if run.estimate is None:
            return replace(run, not_applicable="")
        estimate, names = run.estimate, self._names
        told = tuple(
            replace(
                one,
                frame_id=names.frame(one.frame_id),
                about=np.array([names.text(str(a)) for a in one.about], dtype=np.str_),
            )
            for one in estimate.innovations
        )
        track = _in_frames(estimate.track, names.frame)
        trial = replace(run.trial, parameters=names.text(run.trial.parameters))
        return Run(trial, Estimate(track, told, estimate.diagnostics, estimate.scalars))

    def _grid(self, grid: OccupancyGrid) -> OccupancyGrid:
        frame = self._names.frame(grid.frame_id)
        return OccupancyGrid(grid.cells, grid.resolution_m, grid.origin_xyyaw, frame)

    def _table(self, name: str, versions: dict[str, str]) -> Table:
        table, names = self._bundle.table(name), self._names
        new = {"topic": names.topic, "frame": names.frame}
        columns = {
            c.name: _mapped(table[c.name], new[_COLUMNS[c.name]])
            for c in table.schema.columns
            if c.name in _COLUMNS
        }
        if name == "map_updates":
            columns["map_version"] = _mapped(
                table["map_version"], lambda v: versions.get(v, hashed(v))
            )
        elif name in ("joints", "signals"):
            columns["name"] = _mapped(table["name"], lambda n: names.part(n, "joint"))
        elif name == "recoveries":
            columns["name"] = _mapped(table["name"], lambda n: names.phrase(n, "action"))
            columns["goal"] = _mapped(table["goal"], self._goal)
        elif name == "closures":
            for end in ("from_id", "to_id"):
                columns[end] = _mapped(table[end], lambda n: names.phrase(n, "node"))
        elif name == "health":
            columns |= self._health(table)
        return table.replace(**columns) if columns else table

    def _health(self, table: Table) -> dict[str, NDArray[np.object_]]:
        names = self._names
        nodes = [names.phrase(str(n), "node") for n in table["name"]]
        said = np.empty(len(table), dtype=object)
        pairs = zip(table["name"], table["message"], nodes, strict=True)
        said[:] = [self._said(str(node), str(text), new) for node, text, new in pairs]
        return {"name": _texts(nodes), "message": said}

    def _said(self, node: str, text: str, new_node: str) -> str:
        """What stays of a text: the meaning of those that anything is made of."""
        if text in STATES or not text:
            return text
        again = said_again(node, text, new_node, lambda n: self._names.phrase(n, "action"))
        if again is not None:
            return again
        number = self._names.number("text", text)
        return f"text_{number} {word_of_protection(text)}".strip()

    def _goal(self, goal: str) -> str:
        return goal if _RANDOM_ID.fullmatch(goal) else f"goal_{self._names.number('goal', goal)}"

    def _manifest(self, versions: dict[str, str]) -> Manifest:
        old, names = self._bundle.manifest, self._names
        maps = [
            m.model_copy(update={"version": versions[m.version], "source": f"map {k}"})
            for k, m in enumerate(old.maps, start=1)
            if m.version in versions
        ]
        manifest = old.model_copy(
            update={
                "sources": [_source(s, k) for k, s in enumerate(old.sources, start=1)],
                "options": {},
                "clock": old.clock.model_copy(update={"reason": "header stamps or log times"}),
                "frames": _frames(old.frames, names.frame),
                "roles": [_role(r, names) for r in old.roles],
                "missing": [m.model_copy(update={"reason": "not recorded"}) for m in old.missing],
                "maps": [_folder(m) for m in maps],
                "losses": [_loss(x, names.topic) for x in old.losses],
                "tables": {},
            }
        )
        text = manifest.model_copy(update={"bundle_id": ""}).model_dump_json()
        return manifest.model_copy(update={"bundle_id": hashed(text)[7:23]})


def hashed(text: str) -> str:
    """`sha256:` and a hash, as map versions look."""
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()}"


def _topics_of(bundle: Bundle) -> set[str]:
    found = {role.topic for role in bundle.manifest.roles}
    for name in TABLES:
        found |= set(bundle.table(name)["topic"].tolist())
    return found


def _mapped(column: NDArray[np.object_], new: Callable[[str], str]) -> NDArray[np.object_]:
    """Texts (N,) as others, each different one looked up once."""
    names = {text: new(str(text)) for text in sorted(set(column.tolist()))}
    return _texts([names[text] for text in column.tolist()])


def _texts(texts: Sequence[str]) -> NDArray[np.object_]:
    out = np.empty(len(texts), dtype=object)
    out[:] = list(texts)
    return out


def _in_frames(track: PoseTrack, frame: Callable[[str], str]) -> PoseTrack:
    return replace(
        track, frame_id=frame(track.frame_id), child_frame_id=frame(track.child_frame_id)
    )


def _source(source: Source, number: int) -> Source:
    suffixes = "".join(s for s in PurePath(source.name).suffixes[-2:] if s in _SUFFIXES)
    return source.model_copy(update={"name": f"log_{number}{suffixes}", "sha256": ""})


_SUFFIXES = frozenset({".bag", ".mcap", ".db3", ".clf", ".gz", ".bz2", ".yaml", ".pgm", ".png"})


def _role(role: Role, names: Pseudonyms) -> Role:
    # A type that somebody's own decoder reads names its maker.
    is_common = DECODERS.is_ours(role.type) or role.type.split("/")[0] in _TEXT_LOGS
    kind = role.type if is_common else f"other/Type{names.number('type', role.type)}"
    new = {"topic": names.topic(role.topic), "type": kind, "reason": "as the log has it"}
    return role.model_copy(update=new)


_TEXT_LOGS = frozenset({"carmen", "mrclam"})


def _folder(entry: MapVersion) -> MapVersion:
    return entry.model_copy(update={"folder": entry.version.removeprefix("sha256:")[:16]})


def _loss(loss: Loss, topic: Callable[[str], str]) -> Loss:
    what = topic(loss.what.split()[0]) if loss.what.startswith("/") else "part of the log"
    return loss.model_copy(update={"what": what, "reason": "told in the report of the log itself"})


def _frames(frames: Frames, new: Callable[[str], str]) -> Frames:
    def renamed(entries: Iterable) -> list:
        return [
            e.model_copy(update={"parent": new(e.parent), "child": new(e.child)}) for e in entries
        ]

    left_out = [e.model_copy(update={"reason": e.fault}) for e in renamed(frames.left_out)]
    own = {k: None if v is None else new(v) for k, v in
           (("map", frames.map), ("odom", frames.odom), ("base", frames.base))}  # fmt: skip
    return frames.model_copy(update={**own, "tree": renamed(frames.tree), "left_out": left_out})
