"""The page as it stands: it says its verdict, keeps to itself, and fits where it is read."""

import re

import pytest
from browser.made import NAMES
from browser.pages import open_details, summary, words

PHONE = {
    "viewport": {"width": 360, "height": 740},
    "device_scale_factor": 3,
    "is_mobile": True,
    "has_touch": True,
}
#: WCAG 2.2, 1.4.10: a window of 1280 px holds so many at 400 %, and at 200 %.
NARROW = (320, 640)

# What reaches beyond the window's edge though nothing around it scrolls.
_OUTSIDE = """width => [...document.querySelectorAll('body *')].filter(e => {
  const box = e.getBoundingClientRect(), style = getComputedStyle(e);
  if (!box.width || !box.height || style.visibility === 'hidden') return false;
  for (let p = e; p; p = p.parentElement) {
    if (['auto', 'scroll', 'hidden', 'clip'].includes(getComputedStyle(p).overflowX)) return false;
    if (getComputedStyle(p).clipPath !== 'none') return false;
  }
  return box.right > width + 1 || (box.left < -1 && box.right > 0);
}).map(e => e.outerHTML.slice(0, 90))"""

# WCAG 2.2, 2.5.8: a target has 24 px each way, or a circle of 24 px about its middle meets no
# other target; links in a sentence are exempt. A label and its box are one target.
_SMALL = """() => {
  const inLine = e => e.matches('a') && getComputedStyle(e).display === 'inline'
    && e.parentElement.textContent.trim() !== e.textContent.trim();
  const found = [...document.querySelectorAll(
    'a[href], button, input, select, summary, [role=slider], [role=button]')];
  const boxes = found.filter(e => e.checkVisibility()).map(e => {
    const label = e.labels && e.labels[0] && e.labels[0].contains(e) ? e.labels[0] : e;
    const b = label.getBoundingClientRect();
    return {e, x: b.left, y: b.top, w: b.width, h: b.height};
  }).filter(b => b.w && b.h);
  const far = (b, cx, cy) => Math.hypot(
    Math.max(b.x - cx, 0, cx - b.x - b.w), Math.max(b.y - cy, 0, cy - b.y - b.h));
  return boxes.filter(a => (a.w < 24 || a.h < 24) && !inLine(a.e) && boxes.some(b => b !== a
      && (b.w >= 24 && b.h >= 24 || inLine(b.e) ? far(b, a.x + a.w / 2, a.y + a.h / 2) < 12
        : Math.hypot(a.x + a.w/2 - b.x - b.w/2, a.y + a.h/2 - b.y - b.h/2) < 24)))
    .map(a => `${a.e.outerHTML.slice(0, 90)} ${a.w.toFixed(0)} x ${a.h.toFixed(0)}`);
}"""


@pytest.mark.parametrize("name", NAMES)
def test_first_screen_holds_verdict_map_and_three_facts(show, reports, name):
    page = show(name, viewport={"width": 1280, "height": 720})

    heading = page.get_by_role("heading", level=1)
    assert words(heading.inner_text()) == words(summary(reports, name))
    picture, facts = page.locator("section.verdict figure img").first, page.locator(".facts li")
    assert facts.count() == 3
    for part in (heading, picture, *facts.all()):
        box = part.bounding_box()
        assert box["y"] + box["height"] <= 720


@pytest.mark.parametrize("name", [*NAMES, "hostile"])
def test_all_of_it_is_read_in_quiet(show, name):
    page = show(name)

    open_details(page)
    page.evaluate("scrollTo(0, document.body.scrollHeight)")
    broken = page.evaluate(
        "[...document.images].filter(i => !i.complete || !i.naturalWidth).map(i => i.alt)"
    )

    assert broken == []


def test_text_of_a_log_is_text(show):
    page = show("hostile")

    open_details(page)
    page.mouse.move(300, 300)
    page.locator("footer").hover()

    assert page.evaluate("window.__pwned") is None
    assert page.locator("body").inner_text().count("window.__pwned=1</script>") > 10
    assert page.locator("img[src=x], [onmouseover], [onload], [onerror]").count() == 0
    assert page.locator("footer").is_visible()  # nothing was left open that swallows the rest


@pytest.mark.parametrize("phone", [False, True], ids=["window", "phone"])
@pytest.mark.parametrize("name", [*NAMES, "hostile"])
def test_nothing_scrolls_sideways(show, name, phone):
    page = show(name, **(PHONE if phone else {}))
    open_details(page)
    # A phone widens the page for what juts out, so the window's width is told and not asked for.
    for width in (PHONE["viewport"]["width"],) if phone else NARROW:
        if not phone:
            page.set_viewport_size({"width": width, "height": 640})

        assert page.evaluate(_OUTSIDE, width) == []
        assert page.evaluate("document.documentElement.scrollWidth") <= width


@pytest.mark.parametrize("name", NAMES)
def test_targets_fit_a_finger(show, name):
    assert show(name, **PHONE).evaluate(_SMALL) == []


@pytest.mark.parametrize("name", NAMES)
def test_without_scripts_all_but_the_replay_is_there(show, reports, name):
    page = show(name, java_script_enabled=False)

    assert words(page.locator("h1").inner_text()) == words(summary(reports, name))
    assert page.get_by_role("heading", name="Findings").is_visible()
    assert page.get_by_role("table").first.is_visible()
    if name != "bare":
        assert page.locator("main img").first.is_visible()


@pytest.mark.parametrize("name", NAMES)
def test_screenshots(show, screenshots, name):
    page = show(name, color_scheme="dark")
    papers = []
    for scheme in ("dark", "light"):
        page.emulate_media(color_scheme=scheme)
        page.screenshot(path=screenshots / f"{name}_{scheme}.png")
        paper = page.evaluate("getComputedStyle(document.body).backgroundColor")
        papers.append(int(re.search(r"\d+", paper)[0]))
    page.screenshot(path=screenshots / f"{name}_whole.png", full_page=True)

    assert papers[0] < 80
    assert papers[1] > 200


@pytest.mark.parametrize("name", NAMES)
def test_screenshots_of_a_phone(show, screenshots, name):
    show(name, **PHONE).screenshot(path=screenshots / f"{name}_phone.png")
