"""A browser to open reports with: the one that is named, the machine's own, or Playwright's.

Run as a program it says in one line which it is, or why there is none (exit code 1).
"""

import os
import shutil
import sys

#: Names a path, or is "none" for a run without a browser.
VARIABLE = "SLAMREPLAY_BROWSER"
ON_PATH = ("chromium", "chromium-browser", "google-chrome")
#: A browser whose libraries are missing ends at once; one that says nothing for so long is broken.
START_MS = 30_000


class NoBrowserError(Exception):
    """No browser could be had, and why."""


def launch(playwright):
    """A headless browser that runs; to have a file is not enough, its libraries may be missing.

    Raises:
        NoBrowserError: in one line what was looked for and what came of it.
    """
    named = os.environ.get(VARIABLE, "")
    if named == "none":
        raise NoBrowserError(f"{VARIABLE}=none")
    if named:
        return _start(playwright, named, f"{VARIABLE}={named}")
    own = next((path for path in map(shutil.which, ON_PATH) if path), None)
    tried = [f"none of {', '.join(ON_PATH)} on PATH"]
    if own:
        try:
            return _start(playwright, own, own)
        except NoBrowserError as error:
            tried = [str(error)]
    try:
        return _start(playwright, None, "Playwright's own")
    except NoBrowserError as error:
        raise NoBrowserError("; ".join([*tried, str(error)])) from None


def _start(playwright, path, name):
    from playwright.sync_api import Error

    try:
        return playwright.chromium.launch(executable_path=path, timeout=START_MS)
    except Error as error:
        raise NoBrowserError(f"{name}: {_reason(str(error))}") from None


def _reason(text):
    """The line that tells it: Playwright's messages are pages long."""
    lines = [line.strip(" ║╔╗╚╝═") for line in text.splitlines()]
    telling = ("shared librar", "doesn't exist", "Failed to launch", "ENOENT")
    return next((x for word in telling for x in lines if word in x), lines[0])


def main() -> int:
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        print("Playwright is not installed")
        return 1
    with sync_playwright() as playwright:
        try:
            browser = launch(playwright)
        except NoBrowserError as error:
            print(error)
            return 1
        print(f"Chromium {browser.version}")
        browser.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
