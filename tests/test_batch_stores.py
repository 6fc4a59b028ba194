"""Logs in buckets and behind web servers: listed, fetched, and every refusal in one line."""

import os
import socket
from contextlib import closing

import pytest
from batch_site import Site, served

from slamreplay.batch import stores
from slamreplay.batch.addresses import shown, without_secrets
from slamreplay.batch.fetch import fetch
from slamreplay.batch.keys import key_of, task_of
from slamreplay.batch.sources import sources_of
from slamreplay.batch.stores import storage_options
from slamreplay.errors import LogError, SlamreplayError, UsageError

SECRET = "very-secret-value"
FILES = {
    "2026-01/robot1/a.mcap": b"a" * 70_000,
    "2026-01/robot1/notes.txt": b"none",
    "2026-02/robot2/b c.bag": b"b" * 10,
    "2026-02/robot2/run/metadata.yaml": b"m",
    "2026-02/robot2/run/run_0.mcap": b"0",
    "2026-02/robot2/run/run_1.mcap": b"1" * 3,
    "old/x.mcap": b"x",
    "old/.y.mcap.part": b"y",
    "old/.tmp/z.mcap": b"z",
    "site.yaml": b"image: site.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n",
    "site.pgm": b"P5\n1 1\n255\n\x00",
}


@pytest.fixture(scope="module")
def bucket():
    """Options for a bucket `logs` of an S3 that listens on this machine."""
    from moto.server import ThreadedMotoServer

    before = {k: os.environ.get(k) for k in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY")}
    os.environ.update(AWS_ACCESS_KEY_ID="testing", AWS_SECRET_ACCESS_KEY=SECRET)
    server = ThreadedMotoServer(port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    storage = storage_options([f"endpoint_url=http://{host}:{port}",
                               "config_kwargs.retries.total_max_attempts=2"])  # fmt: skip
    store = stores.file_system("s3://logs", storage)
    store.mkdir("logs")
    for name, content in FILES.items():
        store.pipe_file(f"logs/{name}", content)
    yield storage
    server.stop()
    for name, value in before.items():
        os.environ.pop(name) if value is None else os.environ.update({name: value})


def names(places, storage, **kwargs):
    return [source.log for source in sources_of(places, storage=storage, **kwargs)]


def test_a_bucket_is_all_logs_in_it(bucket):
    expected = ["2026-01/robot1/a.mcap", "2026-02/robot2/b c.bag", "2026-02/robot2/run",
                "old/x.mcap"]  # fmt: skip
    assert names(["s3://logs"], bucket) == [f"s3://logs/{name}" for name in expected]
    assert names(["s3://logs/2026-02/robot2/run/"], bucket) == ["s3://logs/2026-02/robot2/run"]
    assert names(["s3://logs/2026-*/robot?/**/*.mcap"], bucket) == [
        "s3://logs/2026-01/robot1/a.mcap", "s3://logs/2026-02/robot2/run",
    ]  # fmt: skip
    assert names(["s3://logs/old/x.mcap"], bucket) == ["s3://logs/old/x.mcap"]


def test_a_pattern_asks_the_store_only_for_what_begins_like_it(bucket, monkeypatch):
    import s3fs

    asked = []
    find = s3fs.S3FileSystem.find
    monkeypatch.setattr(
        s3fs.S3FileSystem, "find",
        lambda self, *a, **k: asked.append(find(self, *a, **k)) or asked[-1],
    )  # fmt: skip
    names(["s3://logs/2026-0[1]/*/*"], bucket)
    assert all("2026-0" in name for name in asked[0])


def test_the_parts_of_a_log_are_fetched_with_their_structure(bucket, tmp_path):
    found = {s.log: s for s in sources_of(["s3://logs"], storage=bucket)}
    run = found["s3://logs/2026-02/robot2/run"]
    assert [(f.name, f.size) for f in run.files] == [
        ("metadata.yaml", 1), ("run_0.mcap", 1), ("run_1.mcap", 3),
    ]  # fmt: skip
    assert all(f.version for f in run.files)
    assert fetch(run, bucket, tmp_path) == [tmp_path / "run"]
    assert (tmp_path / "run/run_1.mcap").read_bytes() == b"111"
    (path,) = fetch(found["s3://logs/2026-02/robot2/b c.bag"], bucket, tmp_path)
    assert path.read_bytes() == FILES["2026-02/robot2/b c.bag"]


def test_a_large_object_is_not_held_in_memory_in_many_blocks(bucket, tmp_path, monkeypatch):
    import s3fs

    def refuse(*_args, **_kwargs):
        raise AssertionError

    monkeypatch.setattr(s3fs.S3FileSystem, "_download_file_part_concurrent", refuse)
    storage = {**bucket, "default_block_size": 10_000}
    (source,) = sources_of(["s3://logs/2026-01/robot1/a.mcap"], storage=storage)
    (path,) = fetch(source, storage, tmp_path, wait=lambda _s: None)
    assert path.stat().st_size == 70_000


def test_a_map_in_the_bucket_travels_with_the_task(bucket):
    from dataclasses import replace

    (source,) = sources_of(["s3://logs/old/x.mcap"], storage=bucket)
    task = task_of(replace(source, map="s3://logs/site.yaml"), storage=bucket)
    assert task.named == {"map/site.yaml": FILES["site.yaml"], "map/site.pgm": FILES["site.pgm"]}
    with pytest.raises(SlamreplayError, match=r"^s3://logs/none.yaml: the map: no such file"):
        task_of(replace(source, map="s3://logs/none.yaml"), storage=bucket)


def test_an_object_that_was_written_since_is_told_and_has_another_key(bucket, tmp_path):
    store = stores.file_system("s3://logs", bucket)
    store.pipe_file("logs/new/y.mcap", b"one")
    (source,) = sources_of(["s3://logs/new"], storage=bucket)
    store.pipe_file("logs/new/y.mcap", b"two")
    with pytest.raises(LogError, match=r"y.mcap: changed since the batch listed it"):
        fetch(source, bucket, tmp_path)
    (later,) = sources_of(["s3://logs/new"], storage=bucket)
    assert key_of(later) != key_of(source)
    store.rm_file("logs/new/y.mcap")
    with pytest.raises(LogError, match="no such file"):
        fetch(later, bucket, tmp_path)


def test_a_bucket_that_does_not_exist_is_one_line(bucket):
    for place in ("s3://nobody", "s3://nobody/a.mcap", "s3://nobody/*.mcap"):
        with pytest.raises(LogError, match=r"^s3://nobody.*: no such file, folder or bucket$"):
            sources_of([place], storage=bucket)
    with pytest.raises(LogError, match="no log there"):
        sources_of(["s3://logs/nothing/*.mcap"], storage=bucket)
    with pytest.raises(UsageError, match="host or bucket"):
        sources_of(["s3://lo*/a.mcap"], storage=bucket)


def test_a_store_that_does_not_answer_is_one_line_without_secrets(monkeypatch):
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "testing")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", SECRET)
    with closing(socket.socket()) as taken:
        taken.bind(("127.0.0.1", 0))  # bound, not listening: refused at once
        port = taken.getsockname()[1]
        with pytest.raises(LogError, match="does not answer") as caught:
            sources_of(["s3://logs"], storage={"endpoint_url": f"http://127.0.0.1:{port}"})
        with pytest.raises(LogError, match="does not answer") as other:
            sources_of([f"http://me:{SECRET}@127.0.0.1:{port}/a.mcap?sig={SECRET}"])
    assert SECRET not in str(caught.value) + str(other.value)


def test_no_credentials_is_one_line_with_a_hint(bucket, monkeypatch):
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    monkeypatch.setenv("AWS_CONFIG_FILE", "/nonexistent")
    monkeypatch.setenv("AWS_SHARED_CREDENTIALS_FILE", "/nonexistent")
    import fsspec

    storage = {**bucket, "skip_instance_cache": True}
    fsspec.filesystem("s3").clear_instance_cache()
    with pytest.raises(LogError, match=r"no credentials for it \(hint: .*--storage"):
        sources_of(["s3://logs"], storage=storage)


def test_a_missing_package_is_one_line_with_the_extra(monkeypatch):
    import fsspec

    def absent(*_args, **_kwargs):
        raise ImportError("Install s3fs to access S3")

    monkeypatch.setattr(fsspec, "filesystem", absent)
    with pytest.raises(LogError, match=r"pip install 'slamreplay\[s3\]'"):
        sources_of(["s3://logs"])
    with pytest.raises(LogError, match=r"pip install gcsfs"):
        sources_of(["gs://logs"])
    with pytest.raises(UsageError, match="no kind of address 'nope'"):
        sources_of(["nope://logs"])


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    for name, content in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    (folder / "list.jsonl").write_text('{"log": "old/x.mcap", "site": "n"}\n{"log": "gone.bag"}\n')
    with served(folder) as address:
        yield address, folder


def test_an_index_page_is_all_logs_below_it(site, tmp_path):
    address, _ = site
    found = sources_of([f"{address}/2026-02/"])
    assert [s.log for s in found] == [
        f"{address}/2026-02/robot2/b%20c.bag", f"{address}/2026-02/robot2/run",
    ]  # fmt: skip
    assert [f.size for f in found[1].files] == [1, 1, 3]
    assert fetch(found[0], {}, tmp_path) == [tmp_path / "b c.bag"]
    assert fetch(found[1], {}, tmp_path) == [tmp_path / "run"]
    assert (tmp_path / "run/run_1.mcap").read_bytes() == b"111"
    assert names([f"{address}/2026-*/robot*/**/*.mcap"], {}) == [
        f"{address}/2026-01/robot1/a.mcap", f"{address}/2026-02/robot2/run",
    ]  # fmt: skip


def test_a_single_address_hides_its_password_and_signature(site, tmp_path):
    address, _ = site
    with_user = address.replace("http://", f"http://me:{SECRET}@")
    (source,) = sources_of([f"{with_user}/2026-01/robot1/a.mcap?sig={SECRET}"])
    assert source.log == f"{address}/2026-01/robot1/a.mcap"
    assert key_of(source) == key_of(*sources_of([source.log]))
    (path,) = fetch(source, {}, tmp_path)
    assert path == tmp_path / "a.mcap"
    assert path.read_bytes() == FILES["2026-01/robot1/a.mcap"]


def test_a_passing_failure_is_tried_again_a_lasting_one_is_not(site, tmp_path, monkeypatch):
    address, _ = site
    (source,) = sources_of([f"{address}/old/x.mcap"])
    waits = []
    monkeypatch.setitem(Site.answers, "/old/x.mcap", [503, 502])
    (path,) = fetch(source, {}, tmp_path, wait=waits.append)
    assert path.read_bytes() == b"x"
    assert waits == [0.5, 1.0]
    monkeypatch.setitem(Site.answers, "/old/x.mcap", [500] * 9)
    with pytest.raises(LogError, match=r"^http://.*/old/x.mcap: the server answers 500$"):
        fetch(source, {}, tmp_path, wait=waits.append)
    assert waits == [0.5, 1.0, 0.5, 1.0, 2.0]
    monkeypatch.setitem(Site.answers, "/old/x.mcap", [403])
    with pytest.raises(LogError, match="access denied"):
        fetch(source, {}, tmp_path, wait=waits.append)
    assert len(waits) == 5


def test_a_manifest_on_a_server_names_logs_beside_it(site):
    address, _ = site
    told = []
    (source,) = sources_of([f"{address}/list.jsonl"], tell=told.append)
    assert (source.log, source.labels) == (f"{address}/old/x.mcap", {"site": "n"})
    (remark,) = told
    assert remark.startswith(f"{address}/list.jsonl: 1 of 2 lines name no log: row 2: {address}/go")
    assert remark.endswith("gone.bag: no such file, folder or bucket")


def test_no_room_is_told_before_the_copy(site, tmp_path, monkeypatch):
    import shutil
    from types import SimpleNamespace

    address, _ = site
    (source,) = sources_of([f"{address}/2026-01/robot1/a.mcap"])
    monkeypatch.setattr(shutil, "disk_usage", lambda _path: SimpleNamespace(free=10))
    with pytest.raises(LogError, match="no room for its 0 MB, 0 MB are free"):
        fetch(source, {}, tmp_path)


@pytest.mark.parametrize(
    ("place", "expected"),
    [
        ("https://me:pw@host:1/a/b.mcap?X-Amz-Signature=1#f", "https://host:1/a/b.mcap"),
        ("s3://key:secret@bucket/a?b/c#1.mcap", "s3://bucket/a?b/c#1.mcap"),
        ("s3://bucket/a.mcap?versionId=1", "s3://bucket/a.mcap"),
        ("abfs://container@account.dfs.core.windows.net/a", None),
        ("logs/a?b=c.mcap", None),
        ("C:/a", None),
    ],
)
def test_shown(place, expected):
    assert shown(place) == (expected or place)


def test_what_a_library_says_is_shown_without_secrets():
    text = f"cannot GET\n'http://me:{SECRET}@h/a?sig={SECRET}' with key {SECRET}"
    assert without_secrets(text, [SECRET]) == "cannot GET 'http://h/a' with key ***"


def test_storage_options_are_plain_values():
    given = ["anon=true", "s3:endpoint_url=http://h:9000", "client_kwargs.region_name=eu",
             "client_kwargs.verify=False", "max=12", "key="]  # fmt: skip
    found = storage_options(given)
    assert found == {
        "anon": True, "s3:endpoint_url": "http://h:9000", "max": 12, "key": "",
        "client_kwargs": {"region_name": "eu", "verify": False},
    }  # fmt: skip
    assert stores.options_of("s3", found)["endpoint_url"] == "http://h:9000"
    assert "endpoint_url" not in stores.options_of("https", found)
    for wrong in ("anon", "=1", "a..b=1"):
        with pytest.raises(UsageError, match="KEY=VALUE"):
            storage_options([wrong])
    with pytest.raises(UsageError, match="as a value and as more"):
        storage_options(["a=1", "a.b=2"])
