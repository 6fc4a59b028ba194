"""The watch itself: each thing that a report must never do is noticed when a page does it."""

import pytest
from browser.watch import Watched

DEEDS = {
    "console warning": ("", "console.warn('hm')"),
    "console error": ("", "console.error('no')"),
    "error: ": ("", "setTimeout(() => { throw new Error('thrown') })"),
    "request of https://example.org/x.png": ("", "new Image().src = 'https://example.org/x.png'"),
    "request of https://example.org/data": ("", "fetch('https://example.org/data').catch(() => 0)"),
    "request of file:///": ("<img src='beside.png'>", ""),
    "dialog: ": ("", "alert('pwned')"),
    "console error: policy violated: img-src": (
        "<meta http-equiv='Content-Security-Policy' content=\"img-src 'none'\">",
        "new Image().src = 'data:image/gif;base64,R0lGODlhAQABAAAAACw='",
    ),
}


@pytest.mark.parametrize("told", DEEDS)
def test_misdeeds_are_noted(browser, tmp_path, told):
    markup, script = DEEDS[told]
    path = tmp_path / "page.html"
    path.write_text(f"<!doctype html>{markup}<script>{script}</script>")
    watched = Watched(browser, path)

    watched.open().wait_for_timeout(50)
    watched.close()

    assert [note for note in watched.noted if note.startswith(told)], watched.noted


def test_a_quiet_page_is_quiet(browser, tmp_path):
    path = tmp_path / "page.html"
    path.write_text("<!doctype html><img src='data:image/gif;base64,R0lGODlhAQABAAAAACw='>")
    watched = Watched(browser, path)

    watched.open("#t=3")
    watched.close()

    assert watched.noted == []
