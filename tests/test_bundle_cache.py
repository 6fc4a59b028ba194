"""A log is read once for all commands that may keep its bundle, and anew when anything changed."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from slamreplay.errors import LogError
from slamreplay.ingest import bundle_cache, pipeline
from slamreplay.ingest.bundle_cache import ingest_once
from slamreplay.ingest.options import IngestOptions
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.map_server import map_files

SAMPLES = Path(__file__).parents[1] / "sample_logs"


@pytest.fixture
def log(tmp_path):
    return Path(shutil.copy(next(SAMPLES.glob("*.mcap")), tmp_path / "log.mcap"))


@pytest.fixture
def read(monkeypatch):
    """Targets of every reading of a log."""
    done, real = [], pipeline.ingest

    def counted(logs, target, *args, **kwargs):
        done.append(target)
        return real(logs, target, *args, **kwargs)

    monkeypatch.setattr(pipeline, "ingest", counted)
    return done


def write_map(folder, cells):
    grid = OccupancyGrid(np.array(cells, dtype=np.int8), 0.5, np.zeros(3))
    for name, content in map_files(grid, "m").items():
        (folder / name).write_bytes(content)
    return folder / "m.yaml"


def test_a_log_is_read_once_and_its_bundle_is_the_one_that_ingest_makes(log, tmp_path, read):
    first = ingest_once([log], tmp_path / "c")
    again = ingest_once([log], tmp_path / "c")
    moved = Path(shutil.move(log, tmp_path / "sub.mcap")).rename(tmp_path / "log.mcap")

    assert ingest_once([moved], tmp_path / "c").path == again.path == first.path
    assert len(read) == 1
    made = pipeline.ingest([log], tmp_path / "b")
    assert made.manifest == first.manifest


def test_another_option_a_changed_map_and_a_write_ahead_log_are_read_anew(log, tmp_path, read):
    def count(options=None):
        ingest_once([log], tmp_path / "c", options or IngestOptions())
        return len(read)

    with_map = IngestOptions(map=write_map(tmp_path, [[0, 100], [0, 0]]))
    assert [count(), count(IngestOptions(end_s=5.0)), count(with_map), count(with_map)] == [
        1, 2, 3, 3,
    ]  # fmt: skip
    write_map(tmp_path, [[0, 100], [100, 0]])  # the yaml stays as it was, the image does not
    assert count(with_map) == 4
    (tmp_path / "log.mcap-wal").write_bytes(b"newer pages")
    assert count() == 5


def test_a_damaged_bundle_is_replaced_and_what_is_no_log_is_refused(log, tmp_path, read):
    found = ingest_once([log], tmp_path / "c")
    (found.path / "manifest.json").write_text("{")

    assert ingest_once([log], tmp_path / "c").manifest == found.manifest
    assert len(read) == 2
    with pytest.raises(LogError):
        ingest_once([tmp_path / "none.mcap"], tmp_path / "c")


def test_the_least_recently_used_go_but_for_those_of_the_last_hour(log, tmp_path, monkeypatch):
    cache = tmp_path / "c"
    kept = [ingest_once([log], cache, IngestOptions(end_s=5.0 + k)) for k in range(3)]
    for k in (0, 1):
        os.utime(kept[k].path / "manifest.json", (1e9 + k, 1e9 + k))
    monkeypatch.setattr(bundle_cache, "MOST_BYTES", 1)

    ingest_once([log], cache, IngestOptions(end_s=9.0))

    assert [bundle.path.exists() for bundle in kept] == [False, False, True]
