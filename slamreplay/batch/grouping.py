"""Which of many files are one log: told by names alone, so that nothing need be fetched."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from slamreplay.batch.patterns import Pattern

#: rosbag2 packs whole files with zstd, people pack text with the others.
_LOG = re.compile(r"\.(bag|mcap|db3|clf)(\.(zstd|zst))?\Z|\.clf\.(gz|bz2)\Z")
_STORAGE = re.compile(r"\.(db3|mcap)(\.(zstd|zst))?\Z")
_MRCLAM = re.compile(r"Robot\d+_Odometry\.dat\Z")
METADATA, WAL = "metadata.yaml", "-wal"


@dataclass(frozen=True)
class Group:
    """The files of one log.

    Attributes:
        path: of the file or the folder.
        folder: name of the folder where the log is one, else empty.
        members: paths of its files; of a database with its write-ahead log the database first.
    """

    path: str
    folder: str
    members: tuple[str, ...]

    def name_of(self, member: str) -> str:
        """Of one of its files: the path within the folder, or the file's own name."""
        return member[len(self.path) + 1 :] if self.folder else member.rpartition("/")[2]

    def fits(self, pattern: Pattern, root: str) -> bool:
        """Whether a pattern below `root` names it: itself, a folder it is in, or one of its files.

        Args:
            pattern: of what comes after the root.
            root: the folder, with a slash at its end.
        """
        members = (member[len(root) :] for member in self.members)
        parts = self.path[len(root) :].split("/")
        above = ("/".join(parts[:n]) for n in range(1, len(parts) + 1))
        return any(pattern.match(path) is not None for path in (*members, *above))


def is_log_name(name: str) -> bool:
    """Whether a file of this name holds a log, as far as names tell."""
    return _LOG.search(name) is not None and not name.startswith(".")


def is_storage_name(name: str) -> bool:
    """Whether a file of this name may be one of several that rosbag2 split a log into."""
    return _STORAGE.search(name) is not None


def logs_among(paths: Iterable[str]) -> list[Group]:
    """The logs that some files are, in the order of their paths.

    A folder of rosbag2 (metadata.yaml beside storage files, or storage files that have the folder's
    own name and a number, as a recorder that was killed leaves them), a folder of MRCLAM and a
    replay bundle are one log each; else each container and each CARMEN file is one.
    """
    by_folder: dict[str, list[str]] = defaultdict(list)
    for path in paths:
        by_folder[path.rpartition("/")[0]].append(path)
    bundles = {f for f in by_folder if _is_bundle(f, by_folder)}
    found: list[Group] = []
    for folder, members in by_folder.items():
        inside = next((a for a in _above(folder) if a in bundles), None)
        if inside is None:
            found += _in_folder(folder, sorted(members))
    for bundle in bundles:
        if not any(above in bundles for above in _above(bundle.rpartition("/")[0])):
            members = [p for f, ps in by_folder.items() if bundle in _above(f) for p in ps]
            found.append(_folder_log(bundle, members))
    return sorted(found, key=lambda group: group.path)


def _above(folder: str) -> list[str]:
    """The folder and all above it."""
    parts = folder.split("/")
    return ["/".join(parts[:n]) for n in range(len(parts), 0, -1)]


def _is_bundle(folder: str, by_folder: dict[str, list[str]]) -> bool:
    has_tables = any(p.endswith(".parquet") for p in by_folder.get(f"{folder}/tables", ()))
    return has_tables and f"{folder}/manifest.json" in by_folder[folder]


def _folder_log(folder: str, members: Iterable[str]) -> Group:
    return Group(folder, folder.rpartition("/")[2], tuple(sorted(members)))


def _in_folder(folder: str, members: list[str]) -> list[Group]:
    names = {path.rpartition("/")[2]: path for path in members}
    if any(_MRCLAM.match(name) for name in names):
        return [_folder_log(folder, (p for n, p in names.items() if n.endswith(".dat")))]
    logs = [name for name in names if is_log_name(name)]
    storage = [n for n in logs if is_storage_name(n)]
    own = re.compile(re.escape(folder.rpartition("/")[2]) + r"_\d+" + _STORAGE.pattern)
    if storage and (METADATA in names or all(own.match(name) for name in storage)):
        parts = [n for n in (METADATA, *storage, *(s + WAL for s in storage)) if n in names]
        found = [_folder_log(folder, (names[n] for n in parts))]
        return found + [Group(names[n], "", (names[n],)) for n in logs if n not in storage]
    return [Group(names[n], "", tuple(names[m] for m in (n, n + WAL) if m in names)) for n in logs]
