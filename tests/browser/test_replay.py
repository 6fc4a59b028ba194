"""The replay does what its controls say, at the moment that its link says."""

import re

import numpy as np
import pytest
from browser.made import NAMES
from browser.pages import told
from browser.replay import Replay, differing
from browser.watch import Watched
from PIL import Image

from slamreplay.bundle.store import read_grid, read_manifest

#: Reports whose log has a map, so that there is something to see.
SEEN = ("lost", "changed")


@pytest.fixture
def replay(show):
    """Opens the replay of a report by its name."""
    return lambda name="lost", fragment="", **options: Replay(show(name, fragment, **options))


def middle_of(reports, name, state):
    """A moment in the middle of the first stretch of a state, s."""
    report = told(reports, name)
    stretch = next(i for i in report["intervals"] if i["state"] == state)
    start = report["bundle"]["start_ns"]
    return ((stretch["start_ns"] + stretch["end_ns"]) / 2 - start) / 1e9


@pytest.mark.parametrize("name", [*NAMES, "hostile"])
def test_is_ready_once_it_is_seen(replay, name):
    seen = replay(name)

    assert 0.0 <= seen.t <= seen.end()
    assert len(np.unique(seen.picture().reshape(-1, 4), axis=0)) > 5  # not blank
    assert len(np.unique(seen.picture("replay-lanes").reshape(-1, 4), axis=0)) > 5
    assert seen.page.evaluate("window.__pwned") is None


def test_play_goes_on_and_pause_holds(replay):
    seen = replay()
    button = seen.page.locator("#replay-play")
    seen.go(2.0)
    before = seen.page.evaluate("history.length")

    button.click()
    seen.until_t("> 2.5")
    button.click()
    held = seen.t
    seen.page.wait_for_timeout(250)

    assert held == seen.t
    assert held < 6.0  # as fast as the log, however slow the machine
    assert seen.page.evaluate("history.length") == before


def test_speed_is_obeyed(replay):
    seen = replay()
    walked = {}
    for speed in ("1", "10"):
        seen.page.locator("#replay-speed").select_option(speed)
        seen.go(2.0)
        seen.page.locator("#replay-play").click()
        seen.page.wait_for_timeout(700)
        seen.page.locator("#replay-play").click()
        walked[speed] = seen.t - 2.0

    assert 3.0 < walked["10"] / walked["1"] < 30.0


def test_playing_stops_at_the_end(replay):
    seen = replay()
    seen.go(seen.end() - 0.3)

    seen.page.locator("#replay-play").click()
    seen.until_t(">= document.getElementById('replay-time').max")
    seen.settle()

    assert seen.t == pytest.approx(seen.end())
    assert seen.page.locator("#replay-play").get_attribute("aria-label") == "Play"


def test_slider_moves_picture_and_words(replay):
    seen = replay()
    seen.go(3.0)
    early, words = seen.picture(), seen.said

    seen.go(20.0)

    assert seen.t == pytest.approx(20.0, abs=0.06)
    assert differing(early, seen.picture()) > 0.001
    assert seen.said != words
    assert "20.0 s" in seen.said
    assert seen.page.locator("#replay-time").get_attribute("aria-valuetext")


def test_keys(replay):
    seen = replay()
    seen.go(10.0)
    at = []
    for key in ("ArrowRight", "ArrowLeft", "Shift+ArrowRight", "Home", "End", "p", "p", "n"):
        seen.press(key)
        at.append(seen.t)

    assert at[:2] == pytest.approx([11.0, 10.0], abs=0.06)
    assert 0.0 < at[2] - at[1] < 0.5  # a scan
    assert at[3:5] == pytest.approx([0.0, seen.end()])
    assert seen.end() > at[5] > at[6]
    assert at[7] == at[5]
    seen.press(" ")
    seen.until_t(f"> {at[7]} + 0.1")
    seen.press(" ")
    held = seen.t
    seen.page.wait_for_timeout(200)
    assert seen.t == held


def test_keys_are_nobody_elses(replay):
    """What has keys of its own keeps them, and the page keeps those of its own."""
    seen = replay()
    seen.go(10.0)

    seen.page.locator("#replay-speed").focus()
    seen.page.keyboard.press("ArrowDown")
    seen.page.evaluate("document.activeElement.blur()")
    for key in ("ArrowRight", "Home", "m", "n"):
        seen.page.keyboard.press(key)
    seen.settle()

    assert seen.t == pytest.approx(10.0, abs=0.06)
    assert seen.page.locator("#replay-speed").input_value() == "2"
    assert seen.page.locator("#replay-measure").get_attribute("aria-pressed") == "false"


def test_zoom_and_pan_and_all_of_it_again(replay):
    seen = replay()
    whole, scale = seen.picture(), seen.px_per_m

    seen.press("+", "+")
    near, near_scale = seen.picture(), seen.px_per_m
    x, y = seen.middle()
    seen.page.mouse.move(x, y)
    seen.page.mouse.down()
    seen.page.mouse.move(x + 80, y + 30, steps=4)
    seen.page.mouse.up()
    seen.page.mouse.move(1, 1)
    seen.settle()
    dragged, dragged_scale = seen.picture(), seen.px_per_m
    seen.press("-")

    assert near_scale > 1.5 * scale
    assert differing(whole, near) > 0.02
    assert dragged_scale == near_scale
    assert differing(near, dragged) > 0.02
    assert scale < seen.px_per_m < near_scale
    seen.press("0")
    assert seen.px_per_m == pytest.approx(scale)
    assert differing(whole, seen.picture()) == 0.0


def test_wheel_zooms_where_it_was_asked_to(replay):
    """Over a map nobody has touched the wheel scrolls the page on."""
    seen = replay()
    scale, top = seen.px_per_m, seen.page.evaluate("scrollY")
    x, y = seen.middle()
    seen.page.mouse.move(x, y)

    seen.page.mouse.wheel(0, 40)
    seen.until(f"scrollY > {top}")
    assert seen.px_per_m == scale
    seen.map.scroll_into_view_if_needed()
    seen.map.focus()
    seen.page.mouse.move(*seen.middle())
    seen.page.mouse.wheel(0, -200)
    seen.settle()

    assert seen.px_per_m > 1.1 * scale


@pytest.mark.parametrize("name", SEEN)
def test_each_layer_can_be_hidden(replay, reports, name):
    seen = replay(name)
    seen.go(middle_of(reports, name, {"lost": "lost", "changed": "map_changed"}[name]))
    names = seen.layers()
    needed = {"belief", "hindsight", "scan-belief", "scan-hindsight", "uncertainty", "map"}

    assert needed <= set(names)
    seen.show(*names)
    shown, changed = seen.picture(), set()
    for layer in names:
        seen.switch(layer, on=False)
        if differing(shown, seen.picture()) > 0.0:
            changed.add(layer)
        seen.switch(layer, on=True)
        assert differing(shown, seen.picture()) == 0.0
    assert needed <= changed
    assert ("changes" in changed) == (name == "changed")


def test_scan_lies_elsewhere_at_the_believed_pose(replay, reports, screenshots):
    """In the midst of being lost the two layers of one scan do not cover each other."""
    seen = replay("lost")
    seen.go(middle_of(reports, "lost", "lost"))
    met = [layer for layer in seen.layers() if layer.startswith("met-")]
    pictures = {}
    for layer in ("nothing", "scan-belief", "scan-hindsight"):
        seen.show(layer, *met)
        pictures[layer] = seen.picture()
        Image.fromarray(pictures[layer]).save(screenshots / f"lost_{layer}.png")
    nothing, believed, really = pictures.values()
    drawn = [(picture != nothing).any(axis=-1) for picture in (believed, really)]

    assert min(np.count_nonzero(d) for d in drawn) > 200
    both = np.count_nonzero(drawn[0] & drawn[1])
    assert both < 0.5 * min(np.count_nonzero(d) for d in drawn)


def test_measure_is_in_metres(replay):
    seen = replay()
    seen.press("+")
    x, y = seen.middle()

    seen.press("m")
    assert seen.page.locator("#replay-measure").get_attribute("aria-pressed") == "true"
    seen.page.mouse.click(x - 90, y - 40)
    seen.page.mouse.click(x + 90, y + 40)
    seen.settle()

    metres = float(re.search(r"([\d.]+) m\b", seen.said)[1])
    assert metres == pytest.approx(np.hypot(180, 80) / seen.px_per_m, rel=0.01)


def test_scale_is_the_maps(replay, reports):
    """The outer walls are as far apart on the screen as in the map."""
    seen = replay("changed")
    ink = seen.section.evaluate("e => getComputedStyle(e).getPropertyValue('--r-wall')")
    rgb = [int(ink.strip()[k : k + 2], 16) for k in (1, 3, 5)]
    folder = reports("changed").parents[1] / "changed.bundle"
    grid = read_grid(folder, read_manifest(folder).maps[-1])
    walls = [np.ptp(k) * grid.resolution_m for k in np.nonzero(grid.occupied)]

    seen.show("map")
    drawn = (np.abs(seen.picture()[..., :3].astype(int) - rgb) < 8).all(axis=-1)
    height = seen.map.evaluate("e => e.clientHeight")
    drawn[int(0.9 * height) :, :200] = False  # the scale bar has the same ink
    spans = [np.ptp(k) / seen.px_per_m for k in np.nonzero(drawn)]

    assert spans == pytest.approx(walls, abs=0.2)


@pytest.mark.parametrize("t", ["7.5", "42.3"])
def test_link_opens_at_its_moment(replay, t):
    seen = replay("lost", f"#t={t}")

    assert seen.t == pytest.approx(float(t), abs=0.06)
    assert seen.map.evaluate(
        "e => { const b = e.getBoundingClientRect(); return b.top < innerHeight && b.bottom > 0 }"
    )


@pytest.mark.parametrize("fragment", ["#t=-5", "#t=99999", "#t=abc", "#t=", "#t=1e3&<b>", "#%"])
def test_a_broken_link_is_no_trouble(replay, fragment):
    seen = replay("lost", fragment)

    assert 0.0 <= seen.t <= seen.end()


def test_the_address_moves_the_moment(replay):
    seen = replay("lost", "#t=5")
    seen.page.evaluate("location.hash = '#t=21.5'")
    seen.until_t("> 20")

    assert seen.t == pytest.approx(21.5, abs=0.06)
    seen.page.go_back()
    seen.until_t("< 20")
    assert seen.t == pytest.approx(5.0, abs=0.06)


@pytest.mark.parametrize("name", SEEN)
def test_links_of_the_tables_go_there(show, name):
    page = show(name)
    links = page.locator("main a[href^='#t=']")
    assert links.count() >= 2
    for link in (links.first, links.last):
        href = link.get_attribute("href")
        link.scroll_into_view_if_needed()
        link.click()
        seen = Replay(page)
        seen.until(
            "innerHeight > document.getElementById('replay-map').getBoundingClientRect().top"
        )

        assert seen.t == pytest.approx(float(href.removeprefix("#t=").split("&")[0]), abs=0.06)


def test_a_copied_link_comes_back_here(replay, browser, reports):
    seen = replay(permissions=["clipboard-read", "clipboard-write"])
    seen.go(12.4)

    seen.page.locator("#replay-link").click()
    seen.page.wait_for_timeout(100)
    link = seen.page.evaluate("navigator.clipboard.readText()")

    assert link.startswith(reports("lost").resolve().as_uri())
    assert "#t=12.4" in link


def test_words_are_not_poured_out_while_it_plays(replay):
    """A screen reader reads each change of the live line; several a second are noise."""
    seen = replay()
    seen.page.evaluate(
        """() => { window.__changes = 0; new MutationObserver(() => { window.__changes++ })
             .observe(document.getElementById('replay-say'),
                      {childList: true, characterData: true, subtree: true}) }"""
    )
    seen.page.locator("#replay-play").click()
    seen.page.wait_for_timeout(1000)

    live = seen.page.locator("#replay-say").get_attribute("aria-live")
    assert live == "off" or seen.page.evaluate("window.__changes") <= 2


def test_picture_follows_window_and_scheme(replay):
    seen = replay(color_scheme="light")
    light = seen.picture()

    seen.page.emulate_media(color_scheme="dark")
    seen.settle()
    dark = seen.picture()
    seen.page.set_viewport_size({"width": 800, "height": 700})
    seen.page.wait_for_timeout(100)
    seen.settle()

    assert light[..., :3].mean() - dark[..., :3].mean() > 60
    assert seen.picture().shape[1] == seen.map.evaluate("e => e.clientWidth")


def test_picture_is_sharp_on_a_fine_screen(replay):
    seen = replay(viewport={"width": 640, "height": 400}, device_scale_factor=2)

    assert seen.picture().shape[1] == 2 * seen.map.evaluate("e => e.clientWidth")


def test_thumbs_can_use_it(replay, screenshots):
    seen = replay(
        viewport={"width": 360, "height": 740}, device_scale_factor=2, is_mobile=True,
        has_touch=True,
    )  # fmt: skip
    seen.go(2.0)

    seen.page.locator("#replay-play").tap()
    seen.until_t("> 2.3")
    seen.page.locator("#replay-play").tap()
    seen.page.screenshot(path=screenshots / "lost_replay_phone.png")

    # A finger that scrolls the page must find room beside the map.
    assert seen.map.bounding_box()["height"] < 0.8 * 740


def test_without_scripts_it_says_so(show):
    page = show("lost", java_script_enabled=False)

    assert page.locator("#replay noscript").inner_text().strip()
    assert page.locator("#replay noscript").is_visible()
    for control in ("#replay-play", "#replay-time", "#replay-map"):
        assert not page.locator(control).is_visible()


def test_paper_shows_no_controls(show):
    seen = Replay(show("lost"))
    page = seen.page

    page.emulate_media(media="print")
    seen.settle()
    page.set_viewport_size({"width": 700, "height": 900})
    seen.settle()

    for control in ("#replay-play", "#replay-time", "#replay-speed", "input[name=layer]"):
        assert not page.locator(control).first.is_visible()


def test_a_replay_that_cannot_be_read_says_so(browser, reports, tmp_path):
    text = reports("lost").read_text(encoding="utf-8")
    broken = re.sub(r'(id="replay-data">)[^<]{200}', r"\1", text, count=1)
    assert broken != text
    path = tmp_path / "broken.html"
    path.write_text(broken, encoding="utf-8")
    watched = Watched(browser, path)
    page = watched.open()

    page.locator("#replay").scroll_into_view_if_needed()
    page.wait_for_selector("#replay[data-state=failed]", timeout=5000)

    assert page.get_by_role("alert").inner_text().strip()
    watched.close()
    assert watched.noted == []


@pytest.mark.parametrize("name", [*NAMES, "hostile"])
def test_screenshots_of_the_replay(replay, screenshots, name):
    seen = replay(name)
    seen.go(0.5 * seen.end())
    for scheme in ("light", "dark"):
        seen.page.emulate_media(color_scheme=scheme)
        seen.settle()
        seen.section.screenshot(path=screenshots / f"{name}_replay_{scheme}.png")


def test_timeline_goes_where_it_is_clicked(replay):
    seen = replay()
    box = seen.page.locator("#replay-lanes").bounding_box()
    lanes, at = seen.page.locator("#replay-lanes"), []
    for share in (0.3, 0.5, 0.7):
        lanes.click(position={"x": share * box["width"], "y": box["height"] - 30})
        at.append(seen.t)

    assert 0.0 < at[0] < at[1] < at[2] < seen.end()
    assert at[2] - at[1] == pytest.approx(at[1] - at[0], rel=0.02)


def test_a_link_keeps_the_view(replay):
    seen = replay(permissions=["clipboard-read", "clipboard-write"])
    seen.go(9.0)
    seen.press("+", "+", "a", "w")

    seen.press("l")
    seen.page.wait_for_timeout(100)
    link = seen.page.evaluate("navigator.clipboard.readText()")
    other = replay("lost", link[link.index("#") :])

    assert other.px_per_m == pytest.approx(seen.px_per_m, rel=0.01)
    assert differing(seen.picture(), other.picture()) < 0.02


def test_following_keeps_the_robot_in_the_middle(replay, reports):
    """What is around the middle stays the robot, and the map moves under it."""
    seen = replay()
    seen.show("map")
    seen.go(5.0)
    seen.press("f")
    early = seen.picture()

    seen.go(12.0)

    assert seen.page.locator("#replay-follow").get_attribute("aria-pressed") == "true"
    assert differing(early, seen.picture()) > 0.02
    seen.press("f")
    late = seen.picture()
    seen.go(20.0)
    assert differing(late, seen.picture()) == 0.0


def test_measure_without_a_pointer(replay):
    seen = replay()

    seen.press("+", "m", "Enter", "a", "a", "Enter")

    metres = float(re.search(r"([\d.]+) m\b", seen.said)[1])
    assert metres == pytest.approx(120 / seen.px_per_m, rel=0.01)


def test_less_motion_plays_stills(replay):
    seen = replay(reduced_motion="reduce")
    seen.go(2.0)
    seen.page.evaluate(
        """() => { window.__moments = 0; new MutationObserver(() => { window.__moments++ })
             .observe(document.getElementById('replay'), {attributeFilter: ['data-t']}) }"""
    )

    seen.page.locator("#replay-play").click()
    seen.until_t("> 3.4")
    seen.page.locator("#replay-play").click()

    assert seen.page.evaluate("window.__moments") <= 6
