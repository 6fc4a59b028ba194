"""The fleet's page: its numbers are the answers', its links lead on, hostile labels are text."""

import base64
import hashlib
import re
from dataclasses import replace
from datetime import timedelta
from itertools import pairwise

import numpy as np
import pytest
from documents import Document
from fleet_rows import log_row, tables
from fleet_tables import AGED_AISLE, AISLE_M, BOX_ROWS, FIRST_DAY, NEW_SOFTWARE, fleet
from hypothesis import given
from hypothesis import strategies as st

from slamreplay.fleet.answering import answers as answers_of
from slamreplay.fleet.answers import Copies, Failure, Share
from slamreplay.fleet.layout import map_folder
from slamreplay.fleet.page import headline, lines, logs, remap, words
from slamreplay.fleet.page.bars import columns, pieces
from slamreplay.fleet.page.frame import around, frame_of, nice, ticks
from slamreplay.fleet.page.groups import step_table
from slamreplay.fleet.page.heat import blocks_of, heat
from slamreplay.fleet.page.html import fleet_html
from slamreplay.fleet.page.links import Reports
from slamreplay.fleet.page.map_image import map_image
from slamreplay.fleet.page.site_maps import MOST_MAPS, by_trouble, site_maps
from slamreplay.fleet.page.view import view_of
from slamreplay.fleet.page.writer import write_fleet_page
from slamreplay.fleet.queries import queries, views
from slamreplay.fleet.store import commit
from slamreplay.maps.grid import OccupancyGrid

EVIL = '"><script>alert(1)</script><img src=x onerror=alert(2)>\u202egnp.\u2066 {{ 7*191 }} '


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A batch's folder with a synthetic fleet and its page."""
    made = fleet().write(tmp_path_factory.mktemp("fleet"))
    write_fleet_page(made)
    return made


@pytest.fixture(scope="module")
def answers(folder):
    return answers_of(folder)


@pytest.fixture(scope="module")
def page(folder):
    return Document((folder / "fleet.html").read_text(encoding="utf-8"))


def rows_of(page, noun):
    """Cells of the table of verdicts by something, by the first of each row."""
    body = re.search(rf"<caption[^>]*>Verdicts by {noun}</caption>.*?</table>", page.text, re.S)[0]
    rows = re.findall(r'<tr><th scope="row">(.*?)</th>(.*?)</tr>', body)
    cell = r'<td class="short" data-by="([^"]*)">(.*?)</td>'
    return {
        name: [(by, re.sub(r"<[^>]+>|\s|\N{NO-BREAK SPACE}", " ", text))
               for by, text in re.findall(cell, rest)]
        for name, rest in rows
    }  # fmt: skip


# The document.


def test_every_address_is_there_once_and_every_tag_is_closed(page):
    ids = page.ids()
    inner = [a["href"][1:] for a in page.all("a", "use") if a["href"].startswith("#")]

    assert not page.unclosed
    assert not page.open
    assert len(ids) == len(set(ids))
    sections = {"remap", "look", "where", "causes", "software", "robots", "sites", "versions"}
    assert sections | {"verdict", "days", "gate", "unread", "data"} <= set(ids)
    assert set(inner) <= set(ids)
    assert set(re.findall(r"url\(#([\w-]+)\)", page.text)) <= set(ids)


def test_headings_pictures_and_tables_say_what_they_are(page):
    levels = [int(tag[1]) for tag, _, _ in page.tags if re.fullmatch(r"h[1-6]", tag)]

    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(below <= above + 1 for above, below in pairwise(levels))
    assert all(a.get("aria-label") or a.get("aria-hidden") for a in page.all("svg"))
    assert len(page.all("caption")) == len(page.all("table"))
    assert all(a.get("scope") for a in page.all("th"))
    scrolled = [a for a in page.all("div", "pre") if "scroll" in a.get("class", "")]
    assert scrolled
    assert all(a["tabindex"] == "0" and a["aria-label"] for a in scrolled)


def test_nothing_runs_loads_or_is_styled_but_what_the_policy_names(page):
    policy = page.all("meta")[1]["content"]
    styles = re.findall(r"<style>(.*?)</style>", page.text, re.S)
    scripts = re.findall(r'<script type="module">(.*?)</script>', page.text, re.S)

    assert len(styles) == 3
    assert len(scripts) == len(page.all("script")) == 1
    for kind, texts in (("style-src", styles), ("script-src", scripts)):
        hashes = [base64.b64encode(hashlib.sha256(t.encode()).digest()).decode() for t in texts]
        assert " ".join([kind, *(f"'sha256-{one}'" for one in hashes)]) in policy
    assert "default-src 'none'" in policy
    assert not [a for _, a, _ in page.tags if any(k == "style" or k.startswith("on") for k in a)]
    assert all(a["href"].startswith(("data:", "#")) for a in page.all("image", "use"))
    assert not page.all("link", "iframe", "object")


def test_numbers_keep_their_units_and_paper_says_what_it_is(page):
    assert re.search("\\d\N{NO-BREAK SPACE}m²", page.text)
    assert '@top-left{content:"slamreplay fleet"' in page.text


def test_the_same_tables_give_the_same_bytes(folder, page):
    write_fleet_page(folder)

    assert (folder / "fleet.html").read_text(encoding="utf-8") == page.text
    assert not [path for path in folder.iterdir() if path.name.startswith(".fleet")]


# What it says.


def test_the_sentence_counts_logs_robots_days_and_the_aisle(answers, page):
    total = answers.total
    (told,) = page.texts("h1")

    assert told == headline.sentence(answers)
    assert f"Of {total.logs} logs of {total.robots} robots in 10 days" in told
    assert f" {total.lost.count} were lost" in told
    (area,) = remap.needed(answers.areas)
    assert f"; {area.lost_near} of them in one aisle of site north whose map has aged" in told
    assert told.endswith(f"; software {NEW_SOFTWARE} got worse.")


def test_the_sentence_begins_with_what_explains_most_of_the_lost_logs(answers):
    (area,) = remap.needed(answers.areas)
    elsewhere = replace(answers, areas=(replace(area, lost_near=0),) * 2)
    step = next(one for one in answers.steps if one.measure == "lost")

    assert headline.sentence(elsewhere).endswith(
        f" were lost; {step.now.count} of them with software {NEW_SOFTWARE}; 2 places have to be "
        "mapped again, the first at site north."
    )
    assert headline.sentence(replace(elsewhere, steps=())).endswith(
        " were lost; 2 places have to be mapped again, the first at site north."
    )
    few = (replace(area, lost_near=1),)
    assert headline.sentence(replace(elsewhere, areas=few, steps=())).endswith(
        " were lost; one place has to be mapped again, at site north."
    )
    all_of_them = replace(area, lost_near=answers.total.lost.count)
    assert "; all of them in one aisle of " in headline.sentence(
        replace(answers, areas=(all_of_them,))
    )


def test_a_sentence_of_logs_that_say_little_says_so(answers):
    total = replace(answers.total, logs=50, robots=0, lost=Share(2, 21, 0.0, 0.3))

    told = headline.sentence(replace(answers, total=total))

    assert told.startswith("Of 50 logs in ")
    assert " 2 were lost (29 could not be judged)" in told
    calm = headline.sentence(replace(answers, total=total, areas=(), steps=()))
    assert calm.endswith(" 2 were lost (29 could not be judged).")
    assert "judged" not in headline.sentence(answers)


def test_sentences_of_fleets_without_trouble_and_without_logs(answers):
    total = replace(answers.total, lost=replace(answers.total.lost, count=0))
    calm = headline.sentence(replace(answers, total=total, areas=()))
    one = replace(
        answers, total=replace(total, lost=replace(total.lost, count=1)), areas=(), steps=()
    )
    empty = replace(answers, total=replace(total, logs=0))

    assert calm.startswith("None of ")
    assert calm.endswith(" was lost, and no map has to be made again.")
    assert " 1 was lost; no map has to be made again." in headline.sentence(one)
    assert headline.sentence(empty) == "There is no log to tell of yet."


def test_the_aisle_that_has_aged_is_the_one_to_be_mapped_again(answers, page):
    (area,) = remap.needed(answers.areas)
    title = f"north, {words.place(area.box_m)}: "

    assert area.box_m[0] >= AGED_AISLE * AISLE_M
    assert area.box_m[2] <= (AGED_AISLE + 1) * AISLE_M
    assert BOX_ROWS[0] - 1 <= area.box_m[1] < area.box_m[3] <= BOX_ROWS[1] + 1
    assert [text for text in page.texts("h3") if text.startswith(title)]
    cards = [text for text in page.texts("li") if "latest log" in text]
    assert f"since{area.first_day}, last seen {area.last_day}" in cards[0]
    assert f"{area.logs} logs of {area.robots} robots" in cards[0]


def test_a_card_frames_its_area_and_shades_its_piece_of_the_map_alone(answers):
    needed = remap.needed(answers.areas)
    (area,), (map_,) = needed, [one for one in answers.maps if one.site == needed[0].site]
    far = replace(map_, against=map_.looks)  # all of the map is contradicted
    (card,) = remap.cards([area], [far], {}, Reports(answers))
    x0, y0, x1, y1 = area.box_m
    starts = [float(x) for shade in card.shades for x in re.findall(r"M([-\d.]+) ", shade.path)]
    piece_m = card.frame.clip[2] / card.frame.metre

    assert card.box == (x0, y0, x1 - x0, y1 - y0)
    assert starts
    assert max(starts) - min(starts) <= piece_m < np.ptp(map_.col)


@pytest.mark.parametrize(
    ("what", "noun"),
    [("robot", "robot"), ("site", "site"), ("software", "software version"), ("day", "day")],
)
def test_tables_have_the_numbers_of_the_answers(answers, page, what, noun):
    rows = rows_of(page, noun)
    groups = {group.name or words.UNTOLD: group for group in answers.by[what]}

    assert rows.keys() == groups.keys()
    for name, cells in rows.items():
        group = groups[name]
        by = [cell[0] for cell in cells]
        assert by[0] == str(group.logs)
        assert by[5] == str(group.stops)
        assert by[1] == ("" if not group.lost.n else f"{group.lost.count / group.lost.n:.6g}")
        assert f"{group.lost.count} of {group.lost.n}" in cells[1][1]
        assert f"{group.changed.count} of {group.changed.n}" in cells[4][1]
        if group.lost_per_km.value is not None:
            assert float(by[2]) == pytest.approx(group.lost_per_km.value, rel=1e-5)


def test_the_newest_days_and_versions_and_the_worst_robots_are_first(answers, page):
    days = [day for day in rows_of(page, "day") if day != words.UNTOLD]
    robots = list(rows_of(page, "robot"))
    lows = {group.name or words.UNTOLD: group.lost.low or 0.0 for group in answers.by["robot"]}

    assert days == sorted(days, reverse=True)
    assert next(iter(rows_of(page, "software version"))) == NEW_SOFTWARE
    assert [lows[name] for name in robots] == sorted(lows.values(), reverse=True)


def test_logs_worth_looking_at_lead_to_the_moment_of_their_trouble(answers, page):
    hrefs = [a["href"] for a in page.all("a") if "/report.html" in a["href"]]
    pick = next(one for one in answers.picks if one.key in answers.troubles_s)
    at_s = answers.troubles_s[pick.key]

    assert f"{pick.report}/report.html#t={at_s:.2f}".rstrip("0").rstrip(".") in hrefs
    assert all(re.fullmatch(r"logs/[\w%.-]+/report\.html(#t=[\d.]+)?", href) for href in hrefs)


def test_logs_of_one_kind_at_one_site_do_not_fill_the_list(answers):
    pick = answers.picks[0]
    many = [replace(pick, site=site, key=f"{site}{k}") for k in range(9) for site in "ab"]
    shown = logs.picks(many, Reports(answers))

    assert [row.where[0] for row in shown] == ["a", "b"] * logs.MOST_ALIKE


def test_what_got_worse_stands_first(answers):
    verdicts = [row[5].text for row in step_table(answers.steps[::-1]).rows]

    assert "worse" in verdicts
    assert verdicts == sorted(verdicts, key=["worse", "better", "not told apart"].index)


def test_a_moment_at_a_place_says_nothing_of_how_often_robots_are_lost_there(answers):
    one = answers.maps[0]
    brief = replace(one, here_s=np.full(len(one.col), 4.0), lost_s=np.full(len(one.col), 4.0))
    (drawn,) = site_maps([brief], {})
    panels = {panel.kind: panel.heat.spots for panel in drawn.panels}

    assert panels["here"]
    assert not panels["lost"]


def test_maps_out_of_use_come_after_those_in_use(answers):
    one = answers.maps[0]
    worse = replace(one, in_use=False, lost_s=one.lost_s + 100.0)

    assert by_trouble([worse, one]) == (one, worse)


def test_how_much_alike_logs_are_is_told_where_it_matters(answers):
    told = [
        " ".join(Document(fleet_html(view_of(replace(answers, alike=alike), {}))).texts("p"))
        for alike in (1.0, 2.34)
    ]

    assert "are alike" not in told[0]
    assert "Logs of one robot are alike: 2.3 of them are worth one." in told[1]


def test_failed_logs_stand_with_their_lines_and_copies_with_their_names(answers, page):
    cells = page.texts("td")

    assert len(answers.failures) == 2
    assert answers.total.failed == 2
    for failure in answers.failures:
        assert failure.error in cells
    (copies,) = answers.copies
    assert ", ".join(copies.logs) in cells


def test_maps_are_drawn_once_and_used_wherever_they_are_shown(answers, page):
    images = page.all("image")
    used = [a["href"] for a in page.all("use")]

    assert len(images) == len(answers.maps)
    assert len(used) >= 3 * len(answers.maps)


def test_each_answer_has_its_query(folder, page):
    told = page.texts("pre")
    asked = (folder / "queries.sql").read_text(encoding="utf-8")

    assert len(queries()) > 10
    for query in queries():
        assert " ".join(query.sql.split()) in told
        assert query.sql in asked
    assert " ".join(views().split()) in told


# Text that nobody can trust.


def test_hostile_labels_are_text(answers):
    (area,) = remap.needed(answers.areas)
    pick = answers.picks[0]
    hostile = replace(
        answers,
        by={what: (replace(one[0], name=EVIL), *one[1:]) for what, one in answers.by.items()},
        areas=(replace(area, site=EVIL, map_version=EVIL, why=EVIL),),
        picks=(replace(pick, log=EVIL, site=EVIL, robot=EVIL, reason=EVIL, report=f"logs/{EVIL}"),),
        failures=(Failure("k", EVIL, EVIL, EVIL, EVIL),),
        copies=(Copies("c", "k", (EVIL, EVIL)),),
        steps=tuple(replace(step, before=EVIL, after=EVIL) for step in answers.steps),
        causes=tuple(replace(cause, kind=EVIL) for cause in answers.causes),
        maps=tuple(replace(one, site=EVIL, map_version=EVIL) for one in answers.maps),
        remarks=(EVIL,),
    )  # fmt: skip
    page = Document(fleet_html(view_of(hostile, {})))

    assert not page.unclosed
    assert len(page.all("script")) == 1
    assert not page.all("img")
    assert not [a for _, a, _ in page.tags if any(k.startswith("on") for k in a)]
    assert not re.search("[\u202a-\u202e\u2066-\u2069]", page.text)
    assert page.text.count("[U+202E]") > 10
    assert "1337" not in page.text
    assert any("<script>alert(1)</script>" in text for text in page.texts("td"))
    hrefs = [a["href"] for a in page.all("a") if "report.html" in a["href"]]
    assert all(href.startswith("logs/") for href in hrefs)


# Large fleets, and such as have next to nothing.


def test_a_large_fleet_is_cut_and_says_so(answers):
    name = "robot"
    robots = tuple(
        replace(answers.by[name][k % 12], name=f"r{k:04d}") for k in range(1000)
    )  # fmt: skip
    site = answers.maps[0]
    maps = tuple(replace(site, site=f"s{k}", map_version=f"{k:064x}") for k in range(30))
    (area,) = remap.needed(answers.areas)
    days = tuple(
        replace(answers.by["day"][0], name=(FIRST_DAY + timedelta(k)).isoformat())
        for k in range(365)
    )
    large = replace(
        answers,
        by={**answers.by, name: robots, "day": days},
        maps=maps,
        areas=(area,) * 300,
        failures=answers.failures * 500,
        copies=answers.copies * 500,
        picks=answers.picks * 50,
    )
    text = fleet_html(view_of(large, {}))
    page = Document(text)

    assert len(text) < 1_500_000
    said = " ".join(page.texts("p"))
    assert "975 robots more, less troubled than these." in said
    assert "323 days more, older than these." in said
    assert "290 more below, as rows." in said
    assert f"{30 - MOST_MAPS} more maps" in said
    assert " more in the query's answer." in said
    assert "323 older days not shown." in " ".join(page.texts("figcaption"))


def test_a_fleet_that_could_not_be_judged_is_not_told_to_be_well(tmp_path):
    rows = [log_row(key, state="unobservable") for key in ("a", "b")]
    commit(tmp_path, tables(logs=rows))
    found = answers_of(tmp_path)
    said = headline.sentence(found)

    assert said == "None of 2 logs of 1 robot in 1 day was lost (2 could not be judged)."
    assert headline.tone(found) == "insufficient_data"
    assert headline.facts(found)[0].number == "unknown"
    assert not any("No aisle" in line for line in lines.fleet_lines(found))
    told = Document(fleet_html(view_of(found, {}))).texts("p")
    assert told.count("Not known: no log could be judged.") == 2
    assert not any(text.startswith("None: ") for text in told)


def test_a_worse_version_is_told_with_how_often_chance_looks_like_it(answers):
    told = headline.facts(answers)[2]

    assert told.alarming
    assert (
        "By chance at most one change of version in forty looks worse; 1 was compared."
        in told.detail
    )


def test_a_folder_without_logs_has_a_page(tmp_path):
    write_fleet_page(tmp_path)
    page = Document((tmp_path / "fleet.html").read_text(encoding="utf-8"))

    assert page.texts("h1") == ["There is no log to tell of yet."]
    assert not page.unclosed


def test_a_map_that_cannot_be_read_is_told_and_left_out(folder, answers, tmp_path):
    version = answers.maps[0].map_version
    place = tmp_path / map_folder(version)
    place.mkdir(parents=True)
    (place / "map.yaml").write_text("image: gone.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n")
    told = []
    write_fleet_page(tmp_path, answers, warn=told.append)
    page = Document((tmp_path / "fleet.html").read_text(encoding="utf-8"))

    assert len(told) == 1
    assert "gone.pgm" in told[0]
    assert not page.all("image")
    assert any("The map itself is not in the folder." in text for text in page.texts("p"))


def test_the_terminal_is_told_the_same(answers):
    told = lines.fleet_lines(answers)

    assert 3 <= len(told) <= 6
    assert told[0] == headline.sentence(answers)
    assert any(f"Software {NEW_SOFTWARE} is worse" in line for line in told)
    assert told[-1] == "2 logs could not be read or judged."


# Drawing.


def test_a_turned_map_lies_where_its_frame_says():
    cells = np.full((40, 60), -1, dtype=np.int8)
    cells[5:30, 10:50] = 0
    cells[12, 33] = 100
    grid = OccupancyGrid(cells, 0.25, np.array([-3.0, 2.0, 0.7]))
    image = map_image(grid)
    step = _matrix(image.transform)
    pixel = np.array([33 - 10 + 0.5, image.height - (12 - 5 + 0.5), 1.0])

    np.testing.assert_allclose((step @ pixel)[:2], grid.centre_of([12, 33]), atol=1e-5)
    corners = step @ np.array([[0, image.width, 0, image.width],
                               [0, 0, image.height, image.height], [1, 1, 1, 1]])  # fmt: skip
    low, high = corners[:2].min(axis=1), corners[:2].max(axis=1)
    np.testing.assert_allclose(image.box_m, [*low, *high], atol=1e-4)


def _matrix(transform):
    whole = np.eye(3)
    for name, numbers in re.findall(r"(\w+)\(([^)]*)\)", transform):
        a, *b = (float(number) for number in numbers.split())
        if name == "translate":
            step = np.array([[1.0, 0.0, a], [0.0, 1.0, b[0]], [0.0, 0.0, 1.0]])
        elif name == "rotate":
            c, s = np.cos(np.radians(a)), np.sin(np.radians(a))
            step = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        else:
            step = np.diag([a, b[0], 1.0])
        whole = whole @ step
    return whole


def test_nothing_is_drawn_of_a_map_that_knows_nothing():
    assert map_image(OccupancyGrid(np.full((4, 4), -1, np.int8), 0.1, np.zeros(3))) is None


@given(st.lists(st.tuples(st.integers(-9, 9), st.integers(-9, 9), st.integers(0, 9)), max_size=40))
def test_outlines_cover_each_place_once_in_its_class(found):
    places = {(col, row): value for col, row, value in found}
    col, row = (np.array([k[i] for k in places], dtype=np.int32) for i in (0, 1))
    value = np.array(list(places.values()), dtype=float)
    blocks = blocks_of(col, row)
    texts = [""] * len(places)
    drawn = heat(blocks, blocks.sum(value), bounds=(2, 4, 6, 8), classes="abcde", texts=texts)
    covered = {}
    for shade in drawn.shades:
        for x, y, wide, high, back in re.findall(
            r"M([-\d.]+) ([-\d.]+)h([\d.]+)v([\d.]+)h(-[\d.]+)z", shade.path
        ):
            assert (float(high), float(back)) == (1.0, -float(wide))
            for k in range(int(wide)):
                cell = (int(x) + k, int(y))
                assert cell not in covered
                covered[cell] = shade.level
    expected = {cell: int(np.searchsorted([2, 4, 6, 8], v)) for cell, v in places.items() if v > 0}
    assert covered == expected


def test_the_highest_places_alone_are_told_one_by_one():
    blocks = blocks_of(np.arange(100), np.zeros(100))
    value = np.arange(1.0, 101.0)
    drawn = heat(blocks, value, bounds=(9, 19, 29, 39), classes="abcde", texts=[""] * 100)

    assert [spot.x for spot in drawn.spots] == list(range(99, 39, -1))


def test_too_many_places_are_drawn_in_blocks_that_keep_sums_and_greatest():
    col, row = (axis.ravel() for axis in np.meshgrid(np.arange(-50, 50), np.arange(80)))
    blocks = blocks_of(col, row)
    value = np.arange(len(col), dtype=float)

    assert blocks.size == 2
    assert len(blocks.col) == 50 * 40
    assert blocks.sum(value).sum() == value.sum()
    assert blocks.greatest(value).max() == value.max()


@given(st.floats(-500, 500), st.floats(0.1, 500))
def test_ticks_are_few_round_and_inside(low, wide):
    found = ticks(low, low + wide)
    assert len(found) <= 7
    assert all(low - 1e-6 * wide <= t <= low + wide * (1 + 1e-6) for t in found)
    assert all(np.diff(found) > 0)
    assert 1.0 <= nice(wide) / wide < 2.5 + 1e-6


@given(st.floats(-50, 50), st.floats(0.5, 80), st.floats(0.5, 80))
def test_a_drawing_holds_its_box_and_scales_both_axes_alike(x, wide, high):
    box = (x, 2.0, x + wide, 2.0 + high)
    frame = frame_of(box)
    step = _matrix(frame.transform)
    (left, low), (right, top) = (
        (step @ np.array([px, py, 1.0]))[:2] for px, py in (box[:2], box[2:])
    )

    assert right - left == pytest.approx(wide * frame.metre, rel=1e-3)
    assert low - top == pytest.approx(high * frame.metre, rel=1e-3)
    assert -0.01 <= left <= right <= frame.width + 0.01
    assert -0.01 <= top <= low <= frame.height
    piece = around(box, margin_m=3.0, aspect=4 / 3, least_m=12.0)
    assert piece[2] - piece[0] == pytest.approx(4 / 3 * (piece[3] - piece[1]))
    assert piece[0] <= box[0] - 2.99
    assert piece[3] >= box[3] + 2.99


def test_bars_fill_their_length_and_columns_are_as_high_as_their_logs():
    counts = {"healthy": 6, "lost": 3, "insufficient_data": 1}
    bar = pieces(counts)

    assert [piece.state for piece in bar] == ["lost", "healthy", "insufficient_data"]
    assert sum(piece.size for piece in bar) == pytest.approx(100.0)
    high, low = columns([("a", counts), ("b", {"healthy": 5})])
    assert sum(piece.size for piece in high.pieces) == pytest.approx(100.0)
    assert sum(piece.size for piece in low.pieces) == pytest.approx(50.0)
    assert high.x + high.width < low.x


@pytest.mark.parametrize(
    ("value", "text"), [(0.0, "0"), (0.0123, "0.012"), (0.899, "0.90"), (3.04, "3.0"), (41.6, "42")]
)
def test_numbers_have_two_digits(value, text):
    assert words.two_digits(value) == text


def test_times_and_shares_as_people_say_them():
    times = [words.hours(h) for h in (0.01, 0.5, 0.9999, 2.0, 1234.0)]

    assert times == ["36 s", "30 min", "60 min", "2.0 h", "1,234 h"]
    assert [words.percent(s) for s in (None, 0.0, 0.004, 0.5)] == ["-", "0 %", "0.4 %", "50 %"]
