"""The fleet's page where it is read: by eyes of all kinds, hands of all kinds, and on paper."""

import pytest
from browser.pages import open_details, words
from browser.pdf_text import pdf_text
from browser.test_page import _OUTSIDE, _SMALL, PHONE
from browser.test_reading import RULES, violations


def test_first_screen_has_the_sentence_the_aisles_the_days_and_three_facts(show):
    page = show("fleet", viewport={"width": 1280, "height": 800})

    for part in (page.locator("h1"), page.locator(".ranked li"), page.locator(".trend")):
        box = part.first.bounding_box()
        assert box["y"] + box["height"] <= 800
    assert page.locator(".facts li").count() == 3
    assert "in one aisle of site north" in words(page.locator("h1").inner_text())


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing(show, scheme):
    page = show("fleet", color_scheme=scheme)
    rules = ("tag", RULES) if scheme == "light" else ("rule", ["color-contrast"])

    assert violations(page, *rules) == []


def test_a_phone_shows_all_of_it_and_fingers_find_its_targets(show, screenshots):
    page = show("fleet", **PHONE)
    open_details(page)

    assert page.evaluate(_OUTSIDE, PHONE["viewport"]["width"]) == []
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["viewport"]["width"]
    assert page.evaluate(_SMALL) == []
    page.screenshot(path=screenshots / "fleet_phone.png")


def test_tables_sort_by_keyboard_and_say_how(show):
    page = show("fleet")
    table = page.locator("#robots table")
    logs = table.locator("td.short:nth-child(3)")
    head = table.get_by_role("columnheader", name="logs")

    def shown():
        return [int(text.split()[0]) for text in logs.all_inner_texts()]

    worst_first = shown()
    head.get_by_role("button").focus()
    page.keyboard.press("Enter")
    assert head.get_attribute("aria-sort") == "descending"
    assert shown() == sorted(worst_first, reverse=True)
    page.keyboard.press("Enter")
    assert head.get_attribute("aria-sort") == "ascending"
    assert shown() == sorted(worst_first)
    names = table.locator("tbody th")
    table.get_by_role("columnheader", name="robot").get_by_role("button").click()
    assert names.all_inner_texts() == sorted(names.all_inner_texts())
    assert head.get_attribute("aria-sort") is None


def test_without_scripts_all_of_it_is_there(show):
    page = show("fleet", java_script_enabled=False)

    assert page.locator("#robots tbody tr").count() == 13
    assert page.locator("th button").count() == 0
    assert page.locator("#remap .crop").first.is_visible()


def test_the_map_lies_under_its_places(show):
    """The walls of an aisle stand left and right of where robots drove in it."""
    page = show("fleet", viewport={"width": 1280, "height": 800})
    panel = page.locator(".panels svg").first
    panel.scroll_into_view_if_needed()
    colours = page.evaluate(
        """async svg => {
          const image = document.querySelector(svg.querySelector('use').getAttribute('href'));
          const box = e => e.getBoundingClientRect();
          const ground = box(svg.querySelector('.ground')), used = box(svg.querySelector('use'));
          const heat = box(svg.querySelector('.heat'));
          return [ground, used, heat].map(b => [b.left, b.top, b.right, b.bottom]);
        }""",
        panel.element_handle(),
    )
    ground, walls, heat = colours

    assert all(abs(a - b) < 1.0 for a, b in zip(ground, walls, strict=True))
    assert ground[0] < heat[0] < heat[2] < ground[2]
    assert ground[1] < heat[1] < heat[3] < ground[3]


def test_paper_holds_the_answers_and_no_queries(show, screenshots):
    page = show("fleet")
    text = pdf_text(page.pdf(prefer_css_page_size=True))

    assert "Whichaislesneedre-mapping" in text
    assert "Byrobot" in text
    assert "slamreplayfleet" in text
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        page.screenshot(path=screenshots / f"fleet_{scheme}.png")
