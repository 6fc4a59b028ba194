"""A log at an address, with a map and labels from a table: fetched, judged, and no secret told."""

import pytest
from batch_site import served

from slamreplay.batch.keys import task_of
from slamreplay.batch.maps_table import read_maps_table
from slamreplay.batch.sources import sources_of
from slamreplay.batch.worker import look_back

SECRET = "very-secret-value"


@pytest.fixture
def task(tmp_path):
    from test_log_labels import SAMPLES

    site = tmp_path / "site" / "north" / "r1"
    site.mkdir(parents=True)
    (site / "a.bag").write_bytes((SAMPLES / "healthy_short.bag").read_bytes())
    (tmp_path / "maps.csv").write_text("pattern,software\n{site}/{robot}/*.bag,2.3.1\n")
    table = read_maps_table(str(tmp_path / "maps.csv"), {})
    with served(tmp_path / "site") as address:
        place = address.replace("//", f"//me:{SECRET}@") + f"/north/r1/a.bag?sig={SECRET}"
        (source,) = sources_of([place], table)
        yield task_of(source, cause=False)


def test_a_log_behind_an_address_is_judged_and_labelled(task, tmp_path):
    (tmp_path / "scratch").mkdir()
    result = look_back(task, tmp_path / "scratch")
    assert result.error is None
    (row,) = result.tables["logs"].to_pylist()
    assert (row["site"], row["robot"], row["software"]) == ("north", "r1", "2.3.1")
    assert row["log"] == task.source.log
    assert row["log"].endswith("/north/r1/a.bag")
    told = [*result.files.values(), *(str(t.to_pylist()).encode() for t in result.tables.values())]
    assert not any(SECRET.encode() in text for text in told)
    assert list((tmp_path / "scratch").iterdir()) == []
