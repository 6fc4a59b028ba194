"""A damaged .db3 gives what its pages still hold; a sound one, with its -wal, what SQLite reads."""

import os
import sqlite3
from collections import defaultdict
from contextlib import closing
from itertools import cycle

import apsw
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sqlite_files import (
    DEFINITIONS,
    SCHEMAS,
    TOPICS,
    add_messages,
    places,
    rows,
    some_messages,
    write_db3,
)

from slamreplay.ingest.readers.sqlite.overflow import Chains
from slamreplay.ingest.readers.sqlite.salvage import salvage

MIXED = [
    0,
    1,
    20,
    90,
    300,
    470,
    480,
    490,
    500,
    900,
    1500,
    4050,
    4055,
    4060,
    4065,
    4080,
    9000,
    30000,
]
PAGE_SIZES = [512, 1024, 2048, 4096, 8192, 16384, 32768, 65536]
#: The same examples every time, unless a number of random ones is asked for.
EXAMPLES = int(os.environ.get("SLAMREPLAY_FUZZ", "0"))
slow = settings(
    deadline=None,
    max_examples=EXAMPLES or 60,
    derandomize=not EXAMPLES,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("db3")


class Sound:
    """A sound file, its messages and the pages each of them needs."""

    def __init__(self, path, messages):
        self.path, self.messages = path, messages
        self.content = path.read_bytes()
        self.needs, self.page_size = places(path)

    def __repr__(self):
        return self.path.name


@pytest.fixture(scope="module", params=[(4, 4096), (2, 512)], ids=["v4-4096", "v2-512"])
def sound(request, folder):
    version, page_size = request.param
    rng = np.random.default_rng(3)
    weights = np.array([3] * 5 + [1] * (len(MIXED) - 5), dtype=float)
    sizes = rng.choice(
        MIXED, size=220 if page_size > 512 else 120, p=weights / weights.sum()
    ).tolist()
    messages = some_messages(sizes, seed=page_size)
    path = write_db3(folder / f"{version}_{page_size}.db3", messages, version, page_size)
    return Sound(path, messages)


def damaged(path, content):
    copy = path.with_name("damaged.db3")
    copy.write_bytes(content)
    return copy


def everything(salvaged):
    assert salvaged.lost == 0
    assert salvaged.unread_bytes == 0
    assert salvaged.untopiced == 0
    messages = list(salvaged.messages())
    assert sum(salvaged.counts.values()) == len(messages)
    assert salvaged.last_good_ns == (messages[-1][1] if messages else None)
    return messages


@pytest.mark.parametrize("version", [1, 2, 3, 4])
def test_reads_every_version_of_the_schema(tmp_path, version):
    messages = some_messages(MIXED * 8)
    salvaged = salvage(write_db3(tmp_path / "a.db3", messages, version))

    assert everything(salvaged) == messages
    assert salvaged.topics == TOPICS
    assert salvaged.definitions == (DEFINITIONS if version == 4 else {})


@pytest.mark.parametrize("page_size", PAGE_SIZES)
def test_reads_every_page_size_and_guesses_it_where_the_first_page_is_gone(tmp_path, page_size):
    edges = [page_size - 35 - 14 + step for step in range(-4, 5)]  # where overflow begins
    messages = some_messages([*MIXED, *edges, 3 * page_size] * 6)
    path = write_db3(tmp_path / "a.db3", messages, page_size=page_size)
    assert everything(salvage(path)) == messages == rows(path)

    content = path.read_bytes()
    salvaged = salvage(damaged(path, bytes(page_size) + content[page_size:]))

    assert list(salvaged.messages()) == messages
    assert salvaged.topics == TOPICS
    assert salvaged.definitions == DEFINITIONS
    assert salvaged.lost == 0
    assert page_size <= salvaged.unread_bytes < 20 * page_size


@pytest.mark.parametrize("reserved", [8, 255])
def test_reserved_bytes_are_left_alone(tmp_path, reserved):
    def connect(path):
        connection = apsw.Connection(str(path))
        connection.reserve_bytes(reserve=reserved)
        return connection

    messages = some_messages(MIXED * 8)
    path = tmp_path / "a.db3"
    database = connect(path)
    for statement in SCHEMAS[2]:
        database.execute(statement)
    for topic in TOPICS:
        database.execute("INSERT INTO topics VALUES (?, ?, ?, ?, '')", topic)
    database.executemany("INSERT INTO messages VALUES (NULL, ?, ?, ?)", messages)
    database.close()
    content = path.read_bytes()
    assert content[20] == reserved

    assert everything(salvage(path)) == messages
    gone = salvage(damaged(path, bytes(4096) + content[4096:]))
    assert list(gone.messages()) == messages


def test_a_file_of_rosbags_own_writer(logs):
    text = "std_msgs/msg/String"
    path = logs.write(
        "a.db3",
        [(f"/t{i % 3}", text, logs.make(text, data="x" * (i * 37 % 9000)), i) for i in range(300)],
    )
    salvaged = salvage(path)

    assert everything(salvaged) == rows(path)
    assert [topic[1:] for topic in salvaged.topics] == [(f"/t{i}", text, "cdr") for i in range(3)]
    assert salvaged.definitions[text][0] == "ros2msg"


def test_other_tables_of_the_file_are_no_damage(tmp_path):
    path = write_db3(tmp_path / "a.db3", some_messages([100, 9000] * 100))
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE notes (note TEXT)")
        database.executemany("INSERT INTO notes VALUES (?)", [["note" * 2000]] * 50)
        database.execute("ANALYZE")
        database.commit()

    assert everything(salvage(path)) == rows(path)


def test_columns_are_found_by_their_names(tmp_path):
    with closing(sqlite3.connect(tmp_path / "a.db3")) as database:
        database.execute(
            'CREATE TABLE "messages" (data BLOB, "timestamp" INTEGER, size NUMERIC(3, 2) DEFAULT 1,'
            " id INTEGER, topic_id INTEGER, PRIMARY KEY (id))"
        )
        database.execute(
            "CREATE TABLE topics (id INTEGER PRIMARY KEY, type TEXT, serialization_format TEXT,"
            " name TEXT)"
        )
        database.execute("INSERT INTO topics VALUES (3, 'a/msg/B', 'cdr', '/c')")
        database.executemany(
            "INSERT INTO messages VALUES (?, ?, ?, NULL, 3)",
            [(bytes([i]) * 99, i, i) for i in range(200)],
        )
        database.commit()

    salvaged = salvage(tmp_path / "a.db3")

    assert salvaged.topics == [(3, "/c", "a/msg/B", "cdr")]
    assert list(salvaged.messages()) == [(3, i, bytes([i]) * 99) for i in range(200)]


changes = st.lists(
    st.one_of(
        st.tuples(st.just("add"), st.integers(1, 60), st.sampled_from(MIXED)),
        st.tuples(st.just("at"), st.integers(-50, 1 << 40), st.sampled_from(MIXED)),
        st.tuples(st.just("delete"), st.integers(0, 9), st.integers(0, 9)),
    ),
    max_size=12,
)


@slow
@given(changes=changes, page_size=st.sampled_from([512, 4096]))
def test_reads_what_sqlite_reads_however_it_was_written(tmp_path, changes, page_size):
    path = tmp_path / "a.db3"
    path.unlink(missing_ok=True)
    write_db3(path, some_messages([100] * 30), 2, page_size)
    rng = np.random.default_rng(1)
    with closing(sqlite3.connect(path)) as database:
        for change, a, b in changes:
            if change == "add":
                add_messages(database, [(1, a, rng.bytes(b))] * a)
            elif change == "at":
                database.execute(
                    "INSERT OR REPLACE INTO messages VALUES (?, 2, ?, ?)", [a, b, rng.bytes(b)]
                )
            else:
                database.execute("DELETE FROM messages WHERE id % 10 BETWEEN ? AND ?", [a, b])
        database.commit()

    assert everything(salvage(path)) == rows(path)


def check_cut(sound, cut):
    messages, needs, page_size = sound.messages, sound.needs, sound.page_size
    salvaged = salvage(damaged(sound.path, sound.content[:cut]))
    found = list(salvaged.messages())

    present = {m for m, pages in needs.items() if max(pages) * page_size <= cut}
    assert present <= set(found) <= set(messages)
    assert found == sorted(set(found), key=messages.index)
    assert len(found) + salvaged.lost <= len(messages)
    missing = len(sound.content) - cut  # as the header says, if it is there
    assert (
        cut < 100
        or len(found) == len(messages)
        or salvaged.unread_bytes >= missing // page_size * page_size
    )
    return salvaged


def test_a_file_cut_between_any_two_pages_gives_all_messages_before_the_cut(sound):
    recovered = [
        sum(check_cut(sound, cut).counts.values())
        for cut in range(0, len(sound.content), sound.page_size)
    ]
    assert recovered == sorted(recovered)
    assert recovered[-1] >= len(sound.messages) - 20


@slow
@given(share=st.floats(0, 1))
def test_a_file_cut_anywhere_gives_all_messages_before_the_cut(sound, share):
    check_cut(sound, int(len(sound.content) * share))


@settings(slow, max_examples=EXAMPLES or 200)
@given(data=st.data(), flip=st.integers(1, 255))
def test_a_damaged_byte_costs_no_more_than_its_page_and_makes_nothing_up(sound, data, flip):
    messages, needs, page_size = sound.messages, sound.needs, sound.page_size
    content = bytearray(sound.content)
    page = data.draw(st.integers(1, len(content) // page_size))
    within = data.draw(st.one_of(st.integers(0, 30), st.integers(0, page_size - 1)))
    content[(page - 1) * page_size + within] ^= flip
    salvaged = salvage(damaged(sound.path, content))
    found = list(salvaged.messages())

    assert_nothing_made_up(found, messages, flip)
    untouched = {message[2] for message, pages in needs.items() if page not in pages}
    # A link of one chain of overflow pages into another leaves two that claim the same pages.
    assert len(untouched - {payload for *_, payload in found}) <= 1
    assert len(found) <= len(messages)
    assert len(found) + salvaged.lost >= len(messages) or salvaged.unread_bytes
    assert salvaged.lost <= len(messages) - len(found) + 1


def assert_nothing_made_up(found, messages, flip):
    """Every payload is one of the messages', but for one flipped byte of its own."""
    by_size = defaultdict(list)
    for message in messages:
        by_size[len(message[2])].append(message[2])
    originals = {message[2] for message in messages}
    for _, _, payload in found:
        assert payload in originals or any(
            differing(payload, original) == {flip} for original in by_size[len(payload)]
        )


def differing(one, other):
    """What the bytes that are not the same differ by; more than one of them is more than one."""
    changes = np.frombuffer(one, np.uint8) ^ np.frombuffer(other, np.uint8)
    changes = changes[changes > 0].tolist()
    return set(changes) if len(changes) == 1 else {0, *changes}


def test_a_damaged_byte_above_the_leaves_costs_nothing(sound):
    messages, page_size = sound.messages, sound.page_size
    start = root_of_messages(sound)
    used = [at for at in range(start, start + page_size) if sound.content[at]]
    assert sound.content[start] == 5
    for at, flip in zip(used[1:] * 2, cycle([1, 0x80, 3, 0x10, 0x40]), strict=False):
        content = bytearray(sound.content)
        content[at] ^= flip
        salvaged = salvage(damaged(sound.path, content))
        assert list(salvaged.messages()) == messages, (at - start, flip)
        assert salvaged.lost == 0


def root_of_messages(sound):
    """Where in a file the root page of messages starts: an interior page."""
    with closing(sqlite3.connect(sound.path)) as database:
        statement = "SELECT rootpage FROM sqlite_master WHERE name = 'messages'"
        (root,) = database.execute(statement).fetchone()
    return (root - 1) * sound.page_size


def test_children_named_twice_hide_no_others(sound):
    start = root_of_messages(sound)
    count = int.from_bytes(sound.content[start + 3 : start + 5])
    slots = range(start + 12, start + 12 + 2 * count, 2)
    for slot, other in zip(slots, [*slots[1:], *slots[:1]], strict=True):
        for whole_cell in (True, False):
            content = bytearray(sound.content)
            if whole_cell:
                content[slot : slot + 2] = content[other : other + 2]
            else:
                at, its = (
                    start + int.from_bytes(content[place : place + 2]) for place in (slot, other)
                )
                content[at : at + 4] = content[its : its + 4]
            salvaged = salvage(damaged(sound.path, content))
            assert list(salvaged.messages()) == sound.messages
            assert salvaged.lost == 0


@pytest.mark.parametrize("sizes", [(30000, 30000), (9000, 30000), (30000, 9000)])
def test_chains_that_meet_are_both_lost(sound, sizes):
    one = next(m for m in sound.messages if len(m[2]) == sizes[0])
    two = next(m for m in sound.messages if len(m[2]) == sizes[1] and m != one)
    content = bytearray(sound.content)
    at = (sound.needs[one][-2] - 1) * sound.page_size  # the last but one of its chain
    assert content[at : at + 4] == sound.needs[one][-1].to_bytes(4)
    content[at : at + 4] = sound.needs[two][-1].to_bytes(4)

    salvaged = salvage(damaged(sound.path, content))

    assert list(salvaged.messages()) == [m for m in sound.messages if m not in (one, two)]
    assert salvaged.lost == 2


@pytest.mark.parametrize("kind", [0, 2, 5, 10, 14])
def test_the_last_page_is_missed_whatever_it_turns_into(sound, kind):
    last = sound.needs[sound.messages[-1]][0]
    content = bytearray(sound.content)
    content[(last - 1) * sound.page_size] = kind

    salvaged = salvage(damaged(sound.path, content))

    assert list(salvaged.messages()) == [m for m in sound.messages if last not in sound.needs[m]]
    assert salvaged.unread_bytes >= sound.page_size


def test_a_chain_keeps_its_pages_from_one_claimed_later():
    #         page: 0  1  2  3  4  5
    links = np.array([0, 2, 3, 0, 2, 0])
    chains = Chains(links, np.full(6, fill_value=True))

    assert chains.claim(np.array([1]), np.array([3])).tolist() == [True]
    assert chains.claim(np.array([5, 4]), np.array([1, 3])).tolist() == [True, False]
    assert chains.pages(np.array([1, 5]), np.array([3, 1])).tolist() == [1, 2, 3, 5]


def test_cells_that_never_were_are_not_lost(sound):
    last = sound.needs[sound.messages[-1]][0]
    content = bytearray(sound.content)
    content[(last - 1) * sound.page_size + 4] = 0xFF  # so many cells there are not

    salvaged = salvage(damaged(sound.path, content))

    assert list(salvaged.messages()) == sound.messages
    assert salvaged.lost <= 1  # more cannot be said of a damaged page at the end


def test_a_damaged_byte_before_a_message_costs_that_message(sound):
    messages, page_size = sound.messages, sound.page_size
    page = max(leaf for leaf, *chain in sound.needs.values() if not chain)
    start = (page - 1) * page_size
    count = int.from_bytes(sound.content[start + 3 : start + 5])
    for slot in range(start + 8, start + 8 + 2 * count, 2):
        cell = start + int.from_bytes(sound.content[slot : slot + 2])
        for at, flip in zip(range(cell, cell + 10), cycle([1, 2, 0x80]), strict=False):
            content = bytearray(sound.content)
            content[at] ^= flip
            found = list(salvage(damaged(sound.path, content)).messages())
            assert_nothing_made_up(found, messages, flip)
            assert len(found) >= len(messages) - 1


@slow
@given(seed=st.integers(0, 1 << 30), flips=st.integers(2, 200))
def test_many_damaged_bytes_never_give_a_traceback(sound, seed, flips):
    page_size = sound.page_size
    rng = np.random.default_rng(seed)
    content = np.frombuffer(sound.content, np.uint8).copy()
    pages = rng.integers(len(content) // page_size, size=flips)
    content[pages * page_size + rng.integers(0, rng.choice([20, page_size]), size=flips)] = (
        rng.integers(256, size=flips)
    )
    salvaged = salvage(damaged(sound.path, content.tobytes()))

    found = list(salvaged.messages())
    assert sum(salvaged.counts.values()) == len(found)


@slow
@given(content=st.binary(max_size=3000), header=st.booleans(), pages=st.integers(0, 3))
def test_noise_never_gives_a_traceback(tmp_path, content, header, pages):
    head = b"SQLite format 3\0\x02\0\x01\x01\0\x40\x20\x20" if header else b""
    leaf = (b"\x0d" + content).ljust(512, b"\xff")[:512]
    (tmp_path / "a.db3").write_bytes(head + content + leaf * pages)

    assert list(salvage(tmp_path / "a.db3").messages()) == []


def with_deleted(path, page_size=1024):
    """A file in which whole pages of messages were deleted; what is left, and what was there."""
    messages = some_messages([60, 90, 300, 1500] * 150)
    write_db3(path, messages, page_size=page_size)
    with closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA secure_delete = OFF")
        database.execute("DELETE FROM messages WHERE id BETWEEN 100 AND 300")
        database.execute("DELETE FROM messages WHERE id > 500")
        database.commit()
        assert database.execute("PRAGMA freelist_count").fetchone()[0] > 20
    return rows(path), set(messages)


def test_free_pages_do_not_bring_deleted_messages_back(tmp_path):
    path = tmp_path / "a.db3"
    kept, before = with_deleted(path)
    assert list(salvage(path).messages()) == kept
    content = path.read_bytes()
    gone = (set(kept) ^ before) - set(kept)
    assert any(data in content for _, _, data in gone)  # they are still in the file

    for page in range(1, len(content) // 1024 + 1):
        if content[(page - 1) * 1024] not in (5, 13) and page > 1:
            continue
        broken = bytearray(content)
        broken[(page - 1) * 1024 : page * 1024] = bytes(1024)
        found = list(salvage(damaged(path, broken)).messages())
        assert set(found) <= set(kept), page
        assert len(set(found)) == len(found)
        assert len(found) >= len(kept) - 20, page


def test_numbers_given_twice_count_once(tmp_path):
    path = tmp_path / "a.db3"
    with_deleted(path)
    with closing(sqlite3.connect(path)) as database:
        add_messages(database, some_messages([77] * 20, seed=9))
    kept = rows(path)
    content = path.read_bytes()

    assert list(salvage(path).messages()) == kept
    assert list(salvage(damaged(path, bytes(1024) + content[1024:])).messages()) == kept


def test_numbers_given_twice_count_once_even_where_nobody_knows_the_free_pages(tmp_path):
    path = tmp_path / "a.db3"
    with_deleted(path)
    again = some_messages([77] * 20, seed=9)
    with closing(sqlite3.connect(path)) as database:
        add_messages(database, again)
        statement = "SELECT rootpage FROM sqlite_master WHERE name = 'messages'"
        (root,) = database.execute(statement).fetchone()
    kept = rows(path)
    content = bytearray(path.read_bytes())
    content[:1024] = bytes(1024)
    content[(root - 1) * 1024 + 7] ^= 1  # the root is damaged: pages are looked for everywhere

    found = list(salvage(damaged(path, content)).messages())

    assert set(kept) < set(found)  # and some that were deleted
    assert found[found.index(again[0]) : found.index(again[-1]) + 1] == again


def test_a_lost_overflow_page_costs_its_message_only(sound):
    messages, needs, page_size = sound.messages, sound.needs, sound.page_size
    victim = max(needs, key=lambda message: len(message[2]))
    chain_page = needs[victim][5]
    content = bytearray(sound.content)
    content[(chain_page - 1) * page_size : chain_page * page_size] = bytes(page_size)

    salvaged = salvage(damaged(sound.path, content))

    assert list(salvaged.messages()) == [m for m in messages if m != victim]
    assert salvaged.lost == 1
    assert salvaged.unread_bytes > 0


def test_messages_without_a_topic_are_counted(tmp_path):
    messages = some_messages([100] * 300)
    path = write_db3(tmp_path / "a.db3", messages)
    content = path.read_bytes()
    page = content.index(TOPICS[0][1].encode()) // 4096
    salvaged = salvage(
        damaged(path, content[: page * 4096] + bytes(4096) + content[page * 4096 + 4096 :])
    )

    assert salvaged.topics == []
    assert salvaged.untopiced == len(messages) == len(list(salvaged.messages()))
    reasons = [loss.reason for loss in salvaged.losses("a.db3") if loss.what == "a.db3: messages"]
    assert reasons == ["the row that names their topic is gone"]


def test_only_messages_after_a_number(tmp_path):
    messages = some_messages([100, 9000] * 50)
    path = write_db3(tmp_path / "a.db3", messages)

    assert list(salvage(path).messages(after=70)) == messages[70:]
    assert list(salvage(path).messages(after=1000)) == []


def test_a_database_inside_a_message_is_not_read(tmp_path):
    inner = write_db3(tmp_path / "inner.db3", some_messages([100] * 200, seed=4)).read_bytes()
    messages = [*some_messages([100] * 50), (2, 5, inner), (2, 6, inner[20:]), (2, 7, inner[500:])]
    path = write_db3(tmp_path / "a.db3", messages)
    content = path.read_bytes()

    assert everything(salvage(path)) == messages
    gone = salvage(damaged(path, bytes(4096) + content[4096:]))
    assert list(gone.messages()) == messages


def test_the_file_and_its_folder_stay_as_they_are(sound):
    copy = damaged(sound.path, sound.content[:-5000])
    os.utime(copy, ns=(1, 1))
    before = {p.name: (p.read_bytes(), p.stat().st_mtime_ns) for p in copy.parent.iterdir()}

    list(salvage(copy).messages())

    assert {p.name: (p.read_bytes(), p.stat().st_mtime_ns) for p in copy.parent.iterdir()} == before


def test_real_files_are_read_as_sqlite_reads_them_and_cut_at_60_percent(real_logs, tmp_path):
    files = sorted(real_logs.rglob("*.db3"))
    assert files
    for path in files:
        expected = rows(path)
        assert everything(salvage(path)) == expected
        content = path.read_bytes()
        (tmp_path / "cut.db3").write_bytes(content[: len(content) * 6 // 10])
        salvaged = salvage(tmp_path / "cut.db3")
        found = list(salvaged.messages())
        print(f"{path.name} cut at 60 %: {len(found)} of {len(expected)} messages")
        assert set(found) <= set(expected)
        if path.stat().st_size > 1 << 20:
            assert 0.55 * len(expected) < len(found) < 0.65 * len(expected)
