"""The page on paper: a whole report, nothing of it folded away or cut off at the edge."""

import unicodedata

import pytest
from browser.made import NAMES
from browser.pages import summary
from browser.pdf_text import pages_of, pdf_text


def squeezed(text):
    """Without spaces, and with ligatures as letters."""
    return "".join(unicodedata.normalize("NFKC", text).split())


@pytest.mark.parametrize("name", NAMES)
def test_paper_holds_all_of_it(show, reports, screenshots, name):
    page = show(name)

    data = page.pdf(format="A4", path=screenshots / f"{name}.pdf")
    told = squeezed(pdf_text(data))

    assert pages_of(data) > 1
    assert squeezed(summary(reports, name)) in told
    # What is folded on the screen is unfolded, what scrolls there is not cut.
    folded = page.locator(".finding:is(.error, .warning) dd:not(:has(a))")
    texts = folded.evaluate_all("d => d.map(e => e.textContent)")
    cells = page.locator("td, th").evaluate_all("d => d.map(e => e.innerText)")
    assert texts
    assert [text for text in texts if squeezed(text)[:40] not in told] == []
    lines = [line for cell in cells for line in cell.split("\n")]
    assert [line for line in lines if squeezed(line) not in told] == []


def test_ink_is_spared_in_dark(show):
    """A dark screen prints black on white."""
    page = show("lost", color_scheme="dark")

    page.emulate_media(media="print", color_scheme="dark")
    paper, ink = page.evaluate(
        """() => ['backgroundColor', 'color'].map(
             k => getComputedStyle(document.body)[k].match(/\\d+/g).map(Number))"""
    )

    assert paper == [255, 255, 255]
    assert max(ink) < 60
