"""The page for those who read it with other eyes or hands: axe-core, keyboard, contrast modes."""

import itertools

import numpy as np
import pytest
from browser.made import NAMES
from browser.pages import open_details, pixels

#: The rules of WCAG 2.2, A and AA, and axe's own of good practice.
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]
#: More stops than any page has; a walk that takes so many is caught somewhere.
MANY = 400

_STOP = """() => {
  const e = document.activeElement;
  if (e === document.body || e === document.documentElement) return null;
  const focused = getComputedStyle(e), box = e.getBoundingClientRect();
  const ring = focused.outlineStyle !== 'none' && parseFloat(focused.outlineWidth) >= 1
    || focused.boxShadow !== 'none';
  return {html: e.outerHTML.slice(0, 100), ring, tabindex: e.tabIndex,
          seen: box.width > 0 && box.height > 0 && box.bottom > 0 && box.top < innerHeight
                && box.right > 0 && box.left < innerWidth,
          order: [...document.querySelectorAll('*')].indexOf(e)};
}"""


def violations(page, kind, rules):
    """What axe-core has to say, in one line each."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    open_details(page)
    found = axe.run(page, options={"runOnly": {"type": kind, "values": rules}}).response
    assert found["passes"]  # it did look
    return [
        f"{v['id']}: {v['help']}: {[n['target'] for n in v['nodes'][:3]]}"
        for v in found["violations"]
    ]


@pytest.mark.parametrize("name", NAMES)
def test_axe_finds_nothing(show, name):
    assert violations(show(name, color_scheme="light"), "tag", RULES) == []


@pytest.mark.parametrize("name", NAMES)
def test_axe_finds_nothing_in_the_dark(show, name):
    assert violations(show(name, color_scheme="dark"), "rule", ["color-contrast"]) == []


@pytest.mark.parametrize("name", NAMES)
def test_walk_with_the_tabulator(show, name):
    """Every stop is in view, shows that it has the focus, and says what it is."""
    page = show(name, reduced_motion="reduce")  # what is scrolled to is there at once
    cdp = page.context.new_cdp_session(page)
    stops = []
    for _ in range(MANY):
        page.keyboard.press("Tab")
        stop = page.evaluate(_STOP)
        if stop is None:
            break
        stops.append({**stop, "name": _name(cdp)})

    assert 3 <= len(stops) < MANY
    assert [s["html"] for s in stops if not s["seen"]] == []
    assert [s["html"] for s in stops if not s["ring"]] == []
    assert [s["html"] for s in stops if not s["name"]] == []
    order = [s["order"] for s in stops]
    assert order == sorted(order)


def _name(cdp):
    """What a screen reader says of the focused element."""
    held = cdp.send("Runtime.evaluate", {"expression": "document.activeElement"})
    object_id = held["result"]["objectId"]
    tree = cdp.send(
        "Accessibility.getPartialAXTree", {"objectId": object_id, "fetchRelatives": False}
    )
    return tree["nodes"][0].get("name", {}).get("value", "")


def test_headings_are_an_outline(show):
    page = show("lost")

    levels = page.evaluate("[...document.querySelectorAll('h1,h2,h3,h4')].map(h => +h.tagName[1])")

    assert levels.count(1) == 1
    assert all(b - a <= 1 for a, b in itertools.pairwise(levels))


def test_forced_colours_leave_what_colours_say(show):
    """Windows' high contrast paints backgrounds alike, but a legend's keys are their colour."""
    page = show("changed", forced_colors="active")

    keys = page.locator(".timeline .key").all()
    inks = [tuple(np.median(pixels(key.locator("> *").first), axis=(0, 1))) for key in keys]

    assert len(inks) > 2
    assert len(set(inks)) == len(inks)


def test_nothing_moves_by_itself(show):
    page = show("lost", reduced_motion="reduce")

    page.wait_for_timeout(300)
    moving = page.evaluate("document.getAnimations().map(a => String(a.effect?.target?.outerHTML))")

    assert moving == []
