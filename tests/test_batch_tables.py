"""Patterns with named places, the table of maps, and manifests: what fits, and what is refused."""

import re
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slamreplay.batch.maps_table import read_maps_table
from slamreplay.batch.patterns import filled, pattern_of
from slamreplay.batch.sources import sources_of
from slamreplay.batch.task import LogFile, LogSource
from slamreplay.errors import SlamreplayError, UsageError


@pytest.mark.parametrize(
    ("pattern", "address", "expected"),
    [
        ("logs/{site}/{robot}/*.mcap", "/data/logs/north/amr-07/x.mcap",
         {"site": "north", "robot": "amr-07"}),
        ("logs/{site}/{robot}/*.mcap", "s3://b/logs/n/1/x.mcap", {"site": "n", "robot": "1"}),
        ("logs/{site}/*.mcap", "/data/logs/n/1/x.mcap", None),
        ("logs/**/{robot}.bag", "/logs/a/b/c.bag", {"robot": "c"}),
        ("/logs/*.bag", "/data/logs/a.bag", None),
        ("s3://b/{day}/*", "s3://b/2026-01-02/x", {"day": "2026-01-02"}),
        ("s3://b/*", "s3://c/x", None),
        ("{site}_{robot}_*.bag", "/a/n_1_2_3.bag", {"site": "n", "robot": "1"}),
        ("{a}{b}.bag", "/xyz.bag", {"a": "x", "b": "yz"}),
        ("**", "/a/b", {}),
        ("*.[bm]ag", "/x/a.bag", {}),
        ("*.[!bm]ag", "/x/a.bag", None),
        ("a?c", "/abc", {}),
        ("a.c", "/abc", None),
        ("[]]x", "/]x", {}),
        ("./a.bag", "/x/a.bag", {}),
        ("run_{n}/", "/x/run_3", {"n": "3"}),
    ],
)  # fmt: skip
def test_what_a_pattern_fits(pattern, address, expected):
    assert pattern_of(pattern, anywhere=True).match(address) == expected


@pytest.mark.parametrize(
    "pattern",
    ["", "x" * 1001, "{}", "{Site}", "{a b}", "{a}/{a}", "a{", "a}", "{a", "a/**/b/**/c/**/d/**/e",
     "[z-a]", "{" + "a" * 41 + "}"],
)  # fmt: skip
def test_what_is_no_pattern(pattern):
    with pytest.raises(UsageError) as caught:
        pattern_of(pattern, anywhere=True)
    assert "\n" not in str(caught.value)


names = st.from_regex(r"[a-z][a-z0-9_]{0,5}", fullmatch=True)
values = st.text("abz019.-_ü ", min_size=1, max_size=6)


@given(st.dictionaries(names, values, min_size=1, max_size=4), st.booleans())
def test_a_pattern_of_parts_gives_back_what_was_put_into_it(labels, is_deep):
    parts = "/".join(f"{{{name}}}" for name in labels)
    address = "/".join(labels.values())
    pattern = pattern_of(f"logs/{parts}.mcap", anywhere=True)
    before = "s3://bucket/x/" if is_deep else "/"
    assert pattern.match(f"{before}logs/{address}.mcap") == labels
    assert filled(f"logs/{parts}.mcap", labels) == f"logs/{address}.mcap"


_TOKENS = st.sampled_from(["*", "?", "a", "b", "{x}", "{y}", "[ab]"])


@given(st.lists(_TOKENS, min_size=1, max_size=6).filter(lambda t: len({*t} & {"{x}", "{y}"}) <= 2),
       st.text("ab", max_size=7))  # fmt: skip
def test_a_part_fits_what_a_plain_regular_expression_fits(tokens, text):
    """The oracle tries everything; ours keeps what it found, and must find as much."""
    if tokens.count("{x}") > 1 or tokens.count("{y}") > 1:
        return
    plain = {"*": ".*?", "?": ".", "{x}": "(?P<x>.+?)", "{y}": "(?P<y>.+?)"}
    fits = re.fullmatch("".join(plain.get(t, t) for t in tokens), text)
    found = pattern_of("".join(tokens)).match(text) if "**" not in "".join(tokens) else None
    if "**" not in "".join(tokens):
        assert found == (None if fits is None else fits.groupdict())


def test_a_hostile_pattern_takes_no_time():
    began = time.process_time()
    assert pattern_of("*a" * 4 + "*b").match("a" * 250) is None
    assert pattern_of("*a" * 400 + "*b").match("a" * 2000) is None
    assert pattern_of("**/*a/**/*a/**/b").match("/".join(["aa"] * 60)) is None
    assert time.process_time() - began < 1.0


def source(path, **given):
    name = path.rpartition("/")[2]
    return LogSource(path, (LogFile(path, name, 1, "v"),), **given)


@pytest.fixture
def table(tmp_path):
    def write(text, name="maps.csv"):
        content = text if isinstance(text, bytes) else text.encode()
        (tmp_path / name).write_bytes(content)
        return read_maps_table(str(tmp_path / name), {})

    return write


def test_the_first_row_that_fits_counts_and_places_become_labels(table, tmp_path):
    maps = table(
        "\ufeff# of the fleet\nPattern,map,topics,robot_ns,software,owner\n"
        "north/{robot}/*,maps/north.yaml,,/{robot},2.1,\n"
        '"{site}/**",maps/{site}.yaml,topics.yaml,,,"Doe, J."\n'
    )
    logs = [source("/logs/north/r1/a.mcap"), source("/logs/south/r1/a.mcap")]
    (north, south), remarks = maps.applied(logs)
    assert remarks == []
    assert north.labels == {"robot": "r1", "software": "2.1"}
    assert (north.map, north.topics, north.robot) == (f"{tmp_path}/maps/north.yaml", None, "/r1")
    assert south.labels == {"site": "logs", "owner": "Doe, J."}
    assert (south.map, south.topics) == (f"{tmp_path}/maps/logs.yaml", f"{tmp_path}/topics.yaml")


def test_rows_and_logs_left_over_are_told(table, tmp_path):
    maps = table("pattern,site\na.bag,n\nb.bag,s\nc.bag,s\n")
    _, remarks = maps.applied([source("/x/a.bag"), source("/x/d.bag")])
    assert remarks == [
        f"{tmp_path}/maps.csv: 2 of 3 rows fit no log: row 3, 'b.bag' and others",
        f"{tmp_path}/maps.csv: 1 of 2 logs fit no row: /x/d.bag",
    ]


def test_a_folder_is_known_by_its_own_path(table):
    maps = table("pattern,site\nlogs/{robot}/run_*,n\n")
    files = (LogFile("/logs/r1/run_3/metadata.yaml", "metadata.yaml", 1, "v"),)
    (found,), _ = maps.applied([LogSource("run_3", files, folder="run_3")])
    assert found.labels == {"robot": "r1", "site": "n"}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "an empty table"),
        ("pattern,map\n", "a table without rows"),
        ("pattren,map\na,b\n", "row 1: there is no column 'pattern' .*did you mean"),
        ("pattern;map\na;b\n", "row 1: .*separate columns by commas"),
        ("pattern,pattern\na,b\n", "row 1: two columns are called 'pattern'"),
        ("pattern,Map Version\na,b\n", "row 1: a column cannot be called 'map version'"),
        ("pattern,maps\na,b\n", "row 1: there is no column 'maps' .*did you mean 'map'"),
        ("pattern,map\na,b,c\n", "row 2: more cells than the header has columns"),
        ("pattern,map\n,b\n", "row 2, column pattern: it is empty"),
        ("pattern,map\n\n*.bag,b\n{X},b\n", "row 4, column pattern: .*'{X}'"),
        ("pattern,map\n*.bag,{site}.yaml\n", "row 2, column map: '{site}.yaml' names {site}"),
        ("pattern,site\n{site}/*,north\n", r"row 2, column site: the pattern has {site} as well"),
        ('pattern,site\n"a,b\n', "row 3: unexpected end of data"),
        ("pattern,site\na,\x07\n", "row 2, column site: '.' cannot be printed"),
        ("pattern,site\na," + "x" * 501 + "\n", "row 2, column site: 'x{40}' is too long"),
        (b"pattern\n\xff\n", "not a text in UTF-8"),
        (b"pattern\na\0b\n", "row 2"),
        ("pattern," + ",".join(f"l{i}" for i in range(50)) + "\na\n", "more than 40 columns"),
    ],
)
def test_a_table_that_makes_no_sense_is_one_line(table, tmp_path, text, expected):
    with pytest.raises(UsageError, match=expected) as caught:
        table(text)
    assert str(caught.value).startswith(f"{tmp_path}/maps.csv: ")
    assert "\n" not in str(caught.value)


JSONL = """{"log": "a.mcap", "site": "north", "map": "m.yaml", "topics": null}
{"log": "more/*"}
{"log": "b.bag", "build": 7}
{"log": "none.bag"}
"""


@pytest.fixture
def logs(tmp_path):
    for name in ("a.mcap", "b.bag", "more/c.mcap", "more/d.mcap"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(name.encode())
    return tmp_path


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("list.txt", "# ours\n\na.mcap\r\nmore\n./b.bag\nnone.bag\n"),
        ("list.csv", "log,site,map\na.mcap,north,m.yaml\nmore,,\nb.bag,,\nnone.bag,,\n"),
        ("list.jsonl", JSONL),
    ],
)
def test_a_manifest_lists_places_beside_it(logs, name, text):
    (logs / name).write_text(text, newline="")
    told = []
    found = sources_of([str(logs / name)], tell=told.append)
    assert [s.log for s in found] == [
        f"{logs}/{n}" for n in ("a.mcap", "b.bag", "more/c.mcap", "more/d.mcap")
    ]
    if name != "list.txt":
        assert (found[0].labels, found[0].map) == ({"site": "north"}, f"{logs}/m.yaml")
    if name == "list.jsonl":
        assert found[1].labels == {"build": "7"}
    (remark,) = told
    assert remark.startswith(f"{logs}/{name}: 1 of 4 lines name no log: row ")
    assert remark.endswith("none.bag: cannot read: No such file or directory")


def test_what_a_manifest_says_of_a_log_holds_against_the_table(logs, table):
    (logs / "list.csv").write_text("log,site,map\na.mcap,north,own.yaml\n")
    maps = table("pattern,site,software,map\n*.mcap,south,2.1,m.yaml\n")
    (found,) = sources_of([str(logs / "list.csv")], maps)
    assert found.labels == {"site": "north", "software": "2.1"}
    assert found.map == f"{logs}/own.yaml"


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("list.txt", "\n# none\n", "a manifest without a log"),
        ("list.txt", "none.bag\nnone2.bag\n", "2 of 2 lines name no log: row 1"),
        ("list.txt", "other.txt\n", "row 1: a manifest in a manifest"),
        ("list.txt", "a\0b\n", "row 1: no name of a log"),
        ("list.jsonl", "{}\n", "row 1: it has no 'log'"),
        ("list.jsonl", '{"log": "a.mcap"}\nnot\n', "row 2: not JSON"),
        ("list.jsonl", "[" * 9999 + "\n", "row 1: not JSON"),
        ("list.jsonl", '{"log": "a.mcap", "Site": 1}\n', "row 1: 'Site' is no label"),
        ("list.jsonl", '{"log": "a.mcap", "site": ["a"]}\n', "row 1: 'site' is no label"),
        ("list.jsonl", '{"log": "a.mcap", "site": "a\\nb"}\n', "row 1: the value of 'site'"),
        ("list.csv", "path\na.mcap\n", "there is no column 'log'"),
    ],
)
def test_a_manifest_that_makes_no_sense_is_one_line(logs, name, text, expected):
    (logs / name).write_text(text)
    with pytest.raises(SlamreplayError, match=expected) as caught:
        sources_of([str(logs / name)])
    assert "\n" not in str(caught.value)
