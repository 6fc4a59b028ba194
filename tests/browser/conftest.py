"""One browser and a few reports for all tests of this folder; each test has pages of its own."""

import os
from pathlib import Path

import pytest
from browser import find, made
from browser.watch import Watched


@pytest.fixture(scope="session")
def browser():
    """A headless Chromium, or a skip that says why there is none."""
    if os.environ.get(find.VARIABLE) == "none":
        pytest.skip(f"no browser: {find.VARIABLE}=none")
    sync_api = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    with sync_api.sync_playwright() as playwright:
        try:
            found = find.launch(playwright)
        except find.NoBrowserError as reason:
            pytest.skip(f"no browser: {reason}")
        yield found
        found.close()


@pytest.fixture(scope="session")
def reports(browser, tmp_path_factory):
    """The path of a report by its name; each is made when it is first asked for."""
    folder, paths = tmp_path_factory.mktemp("reports"), {}

    def path(name: str) -> Path:
        if name not in paths:
            paths[name] = made.report(name, folder)
        return paths[name]

    return path


@pytest.fixture(scope="session")
def screenshots(tmp_path_factory) -> Path:
    """Where pictures for people go."""
    named = os.environ.get("SLAMREPLAY_SCREENSHOTS")
    folder = Path(named) if named else tmp_path_factory.mktemp("screenshots")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.fixture
def watched(browser, reports):
    """Makes watched pages of a report by its name; at the test's end none may have misbehaved."""
    opened = []

    def make(name, **options):
        page = Watched(browser, reports(name), **options)
        opened.append(page)
        return page

    yield make
    for page in opened:
        page.close()
    assert [note for page in opened for note in page.noted] == []


@pytest.fixture
def show(watched):
    """Opens a report by its name, at a moment where a fragment is given."""

    def open_page(name, fragment="", **options):
        return watched(name, **options).open(fragment)

    return open_page
