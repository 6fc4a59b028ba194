"""What many tests need: where the real logs are."""

import os
import shutil
from pathlib import Path

import pytest
from hypothesis import settings

# A worker of pytest-xdist exports a width, to which every command would fold its output.
os.environ.pop("COLUMNS", None)

# The same examples on every run: a change is judged by what it changed. Others are tried with
# `pytest --hypothesis-profile default`.
settings.register_profile("steady", derandomize=True)
settings.load_profile("steady")

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def real_logs() -> Path:
    """Folder of real logs, or a skip that says where they were looked for."""
    named = os.environ.get("SLAMREPLAY_REAL_LOGS")
    folder = Path(named) if named else ROOT.parent / "shared" / "logs"
    if not folder.is_dir():
        pytest.skip(f"no real logs at {folder} (set SLAMREPLAY_REAL_LOGS)")
    return folder


class LogWriter:
    """Writes small logs of any format with rosbags' own writers."""

    def __init__(self, folder: Path, stores) -> None:
        self.folder = folder
        self.stores = dict(stores)

    def make(self, kind: str, ros: int = 2, **values):
        """A message of zeros, with fields set by dotted names ("pose__position__x" for dots)."""
        message = self._zero(kind, self.stores[ros])
        for path, value in values.items():
            *parents, last = path.split("__")
            target = message
            for name in parents:
                target = getattr(target, name)
            setattr(target, last, value)
        return message

    def write(self, name: str, messages, ros: int = 2) -> Path:
        """A log of (topic, type, message, log time in ns); the format follows the name."""
        from rosbags.rosbag1 import Writer as Bag
        from rosbags.rosbag2 import StoragePlugin
        from rosbags.rosbag2 import Writer as Folder

        store, path = self.stores[ros], self.folder / name
        if path.suffix == ".bag":
            writer = Bag(path)
        else:
            plugin = StoragePlugin.SQLITE3 if "db3" in name else StoragePlugin.MCAP
            is_folder = path.suffix not in (".mcap", ".db3")
            folder = path if is_folder else path.with_name(f"{path.name}.folder")
            writer = Folder(folder, version=9, storage_plugin=plugin)
        with writer:
            connections = {}
            for topic, kind, message, t_ns in messages:
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=store)
                serialise = store.serialize_ros1 if path.suffix == ".bag" else store.serialize_cdr
                writer.write(connections[topic], t_ns, serialise(message, kind))
        if path.suffix in (".mcap", ".db3"):  # one storage file without its folder
            (file,) = folder.glob(f"*{path.suffix}")
            file.rename(path)
            shutil.rmtree(folder)
        return path

    def _zero(self, kind, store):
        import numpy as np
        from rosbags.interfaces import Nodetype

        def value(node):
            form, args = node
            if form == Nodetype.NAME:
                return self._zero(args, store)
            if form == Nodetype.BASE:
                return "" if args[0] == "string" else args[0] == "never" if args[0] == "bool" else 0
            inner, size = args
            size = size if form == Nodetype.ARRAY else 0  # of a sequence it is the bound
            if inner[0] == Nodetype.BASE and inner[1][0] != "string":
                return np.zeros(size or 0, dtype=np.dtype(inner[1][0].replace("byte", "uint8")))
            return [value(inner) for _ in range(size or 0)]

        fields = {name: value(node) for name, node in store.fielddefs[kind][1]}
        return store.types[kind](**fields)


@pytest.fixture(scope="session")
def type_stores():
    """rosbags' type stores of ROS 1 and ROS 2, with the types that they lack."""
    from type_store import type_store

    return {ros: type_store(ros) for ros in (1, 2)}


@pytest.fixture(scope="session")
def logs_in(type_stores):
    """Gives a writer of logs for any folder, for fixtures that outlive one test."""
    return lambda folder: LogWriter(folder, type_stores)


@pytest.fixture
def logs(tmp_path, type_stores) -> LogWriter:
    """Makes messages and writes them as a log of any format."""
    return LogWriter(tmp_path, type_stores)
