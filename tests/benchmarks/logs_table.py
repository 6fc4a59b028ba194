"""What ingest makes of every log in a folder, as a Markdown table.

Usage: uv run python tests/benchmarks/logs_table.py FOLDER
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from slamreplay.errors import SlamreplayError
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest
from slamreplay.ingest.readers.open_log import open_log
from slamreplay.ingest.text_logs import text_log

SUFFIXES = {".bag", ".mcap", ".db3", ".clf", ".bz2", ".gz"}


def logs(folder: Path):
    """Logs in a folder: rosbag2 folders, MRCLAM folders, files."""
    inside = [p.parent for p in folder.rglob("metadata.yaml")]
    inside += [p.parent for p in folder.rglob("Barcodes.dat")]
    files = [p for p in folder.rglob("*") if p.suffix in SUFFIXES and p.is_file()]
    return sorted([*inside, *(f for f in files if f.parent not in inside)])


def in_file(path: Path) -> int | None:
    """Messages that the containers say they hold; None of text."""
    if text_log(path) is not None:
        return None
    with open_log([path]) as (readers, _):
        return sum(c.count for reader in readers for c in reader.connections)


def theirs(path: Path) -> str:
    """Messages that rosbags counts."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            return str(sum(1 for _ in reader.messages()))
    except Exception as error:
        return f"refused: {(str(error) or type(error).__name__).splitlines()[0][:60]}"


def line(path: Path, root: Path, scratch: Path) -> str:
    robot = "3" if path.is_dir() and (path / "Barcodes.dat").exists() else None
    name = str(path.relative_to(root))
    try:
        held, peer = in_file(path), theirs(path)
    except SlamreplayError as error:
        return f"| {name} | - | - | - | {str(error).replace(str(root), '')} | | | |"
    try:
        manifest = ingest([path], scratch / "b.bundle", IngestOptions(robot=robot)).manifest
    except SlamreplayError as error:
        return f"| {name} | - | {held} | {peer} | {str(error).replace(str(root), '')} | | | |"
    by_kind = {
        kind: "; ".join(
            f"{x.what}: {x.count} {x.reason}" for x in manifest.losses if x.kind == kind
        )
        for kind in ("skipped", "lost")
    }
    skipped = sum(x.count for x in manifest.losses if x.kind == "skipped" and x.what.endswith(")"))
    read = "" if held is None else str(held - skipped)
    roles = ", ".join(f"{r.role} {r.topic}" for r in manifest.roles)
    formats = "+".join(sorted({s.format for s in manifest.sources}))
    cells = [name, formats, f"{read} of {held}", peer, by_kind["skipped"], by_kind["lost"], roles,
             f"{manifest.clock.name}: {manifest.clock.reason}"]  # fmt: skip
    return "| " + " | ".join(str(c).replace("|", "/") for c in cells) + " |"


def main(root: Path) -> None:
    print("| log | format | read of in file | rosbags | skipped | lost | roles | clock |")
    print("|---|---|---|---|---|---|---|---|")
    with TemporaryDirectory() as scratch:
        for number, path in enumerate(logs(root)):
            print(line(path, root, Path(scratch) / str(number)), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
