"""Keys of logs: what makes another one, and what does not."""

import os
from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from slamreplay.batch.keys import key_of, task_maker, task_of
from slamreplay.batch.local_files import WHOLE, fingerprint
from slamreplay.batch.named import placed
from slamreplay.batch.sources import sources_of
from slamreplay.batch.task import LogFile, LogSource
from slamreplay.gate.rules import Demands, Limit, Rules
from slamreplay.maps.map_server import read_map

FILE = LogFile("/logs/a.mcap", "a.mcap", 7, "v1")
SOURCE = LogSource("logs/a.mcap", (FILE,), labels={"site": "north"})

texts = st.text(max_size=4)
files = st.builds(
    LogFile, url=texts.map("/logs/{}".format), name=texts, size=st.integers(0, 9), version=texts
)
sources = st.builds(
    LogSource, log=st.just("log"), files=st.tuples(files),
    robot=st.none() | texts,
    folder=texts,
)  # fmt: skip
rules = st.builds(
    Rules, expect=st.tuples(texts), max_severity=st.sampled_from([None, "info", "error"]),
    limits=st.lists(st.builds(Limit, metric=texts, maximum=st.none() | st.floats(0, 1)),
                    max_size=1).map(tuple),
)  # fmt: skip
demands = st.builds(
    Demands, question=st.just("?"), rules=rules, of_logs=st.dictionaries(texts, rules, max_size=2)
)
ways = st.fixed_dictionaries(
    {
        "source": sources,
        "cause": st.booleans(),
        "demands": st.none() | demands,
        "named": st.dictionaries(texts, st.binary(max_size=3), max_size=2),
    }
)


def ordered(way):
    """The demands' patterns count in their order, which == of mappings does not see."""
    of_logs = None if way["demands"] is None else list(way["demands"].of_logs.items())
    return way, of_logs


@given(one=ways, other=ways)
def test_two_ways_to_read_a_log_have_one_key_only_if_they_are_equal(one, other):
    assert (key_of(**one) == key_of(**other)) == (ordered(one) == ordered(other))


@given(way=ways, data=st.data())
def test_one_change_of_an_option_is_another_key(way, data):
    name = data.draw(st.sampled_from(sorted(way)))
    other = {**way, name: data.draw(ways.map(lambda w: w[name]))}
    assert (key_of(**way) == key_of(**other)) == (ordered(way) == ordered(other))


def test_the_order_of_labels_and_files_named_does_not_matter_that_of_patterns_does():
    a, b = {"site": "n", "robot": "1"}, {"robot": "1", "site": "n"}
    assert key_of(replace(SOURCE, labels=a)) == key_of(replace(SOURCE, labels=b))
    strict, loose = Rules(), Rules(max_severity=None)
    one = Demands("?", Rules(), {"*": strict, "a*": loose})
    other = Demands("?", Rules(), {"a*": loose, "*": strict})
    assert key_of(SOURCE, demands=one) != key_of(SOURCE, demands=other)


def test_passwords_and_signatures_are_no_part_of_it():
    def key(url):
        return key_of(replace(SOURCE, files=(replace(FILE, url=url),)))

    assert key("https://me:pw@host/a.mcap?sig=1") == key("https://host/a.mcap?sig=2")
    assert key("https://host/a.mcap") != key("https://host/b.mcap")


def test_a_file_that_was_only_touched_keeps_its_key(tmp_path):
    log = tmp_path / "a.mcap"
    log.write_bytes(b"x" * 3 * WHOLE)
    first = key_of(*sources_of([str(log)]))
    os.utime(log, ns=(1, 1))
    assert key_of(*sources_of([str(log)])) == first
    with log.open("r+b") as stream:
        stream.seek(-1, os.SEEK_END)
        stream.write(b"y")
    assert key_of(*sources_of([str(log)])) != first


def test_a_fingerprint_sees_size_head_tail_and_small_files_whole(tmp_path):
    file = tmp_path / "f"
    seen = set()
    for content in (b"", b"a", b"ab", b"a" * WHOLE, b"a" * (WHOLE + 1), b"b" + b"a" * WHOLE,
                    b"a" * WHOLE + b"b", b"a" * 500_000 + b"b" + b"a" * 500_000):  # fmt: skip
        file.write_bytes(content)
        os.utime(file, ns=(len(seen), len(seen)))
        seen.add(fingerprint(file))
    assert len(seen) == 8


def _map(folder, image, at):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / at).parent.mkdir(parents=True, exist_ok=True)
    (folder / at).write_bytes(b"P5\n2 1\n255\n\x00\xfe")
    (folder / "site.yaml").write_text(f"image: {image}\nresolution: 0.05\norigin: [0, 0, 0]\n")
    return str(folder / "site.yaml")


def test_the_map_and_the_topics_file_travel_with_the_task(tmp_path):
    (tmp_path / "topics.yaml").write_text("scan: /front\n")
    for number, (image, at) in enumerate((
        ("site.pgm", "site.pgm"), ("../images/site.pgm", "../images/site.pgm"),
        ("/another/computer/site.pgm", "site.pgm"), (str(tmp_path / "own.pgm"), "../own.pgm"),
    )):  # fmt: skip
        yaml = _map(tmp_path / f"maps{number}", image, at)
        source = replace(SOURCE, map=yaml, topics=str(tmp_path / "topics.yaml"))
        task = task_of(source)
        away = tmp_path / f"worker{number}"
        map_path, topics = placed(task.named, away)
        assert topics.read_text() == "scan: /front\n"
        remarks = []
        grid = read_map(map_path, warn=remarks.append)
        assert grid.cells.tolist() == [[100, 0]]
        assert remarks == []
        (tmp_path / "topics.yaml").touch()
        assert task_of(source).key == task.key
    changed = replace(source, map=_map(tmp_path / "else", "x.pgm", "x.pgm"))
    assert task_of(changed).key != task.key


def test_logs_of_one_map_share_one_copy_which_is_read_now_and_then(tmp_path):
    topics, clock = tmp_path / "topics.yaml", [0.0]
    topics.write_text("one")
    make = task_maker(keep_s=30.0, now_s=lambda: clock[0])
    first, second = (
        make(replace(SOURCE, log=log, topics=str(topics))) for log in ("a.mcap", "b.mcap")
    )
    assert second.named is first.named

    clock[0] = 30.0
    assert make(first.source).named is first.named  # it is the same
    topics.write_text("other")
    clock[0] = 59.0
    assert make(first.source).key == first.key
    clock[0] = 60.0
    assert make(first.source).key != first.key
