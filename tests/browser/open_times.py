"""What a report weighs and how long a browser takes to open it, as a Markdown table.

Run with: uv run python tests/browser/open_times.py FOLDER [LOG [--map MAP]]...

Reports of the sample logs and of every LOG named (a log, a bundle, or a report.html) stay in FOLDER
and are used again. Each is opened from disk five times in a fresh context, the browser's own start
not counted; times are medians, in ms since the navigation began. The replay is scrolled to as soon
as the page has loaded; "answers" is how long it takes from a press of a key until the picture
follows.
"""

import gzip
import json
import statistics
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from browser import find
from playwright.sync_api import sync_playwright

SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"
SUFFIXES = (".mcap", ".bag", ".db3")
OPENINGS = 5
#: The goal for a log of ten minutes.
GOAL_MB = 5.0

# The moment is noted in the page: asking for it from outside would add the way there and back.
_NOTE = """new MutationObserver(() => {
  const replay = document.getElementById('replay');
  if (replay?.dataset.state === 'ready') window.__ready ??= performance.now();
}).observe(document, {subtree: true, childList: true, attributes: true,
                      attributeFilter: ['data-state']});"""
_TIMES = """() => ({
  load: performance.getEntriesByType('navigation')[0].loadEventEnd,
  paint: performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? NaN,
  ready: window.__ready ?? NaN,
})"""
_ANSWER = """() => new Promise(done => {
  const replay = document.getElementById('replay'), start = performance.now();
  new MutationObserver((_, self) => {
    self.disconnect();
    requestAnimationFrame(() => setTimeout(() => done(performance.now() - start)));
  }).observe(replay, {attributes: true, attributeFilter: ['data-t']});
  replay.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight', bubbles: true}));
})"""


def report(folder: Path, log: Path, options) -> Path:
    """report.html of a log, made unless it is there."""
    if log.suffix == ".html":
        return log
    target = folder / log.name
    if not (target / "report.html").exists():
        program = [sys.executable, "-m", "slamreplay.cli.main", "report"]
        command = [*program, str(log), *options, "-o", str(target)]
        subprocess.run(command, check=True, capture_output=True)
    return target / "report.html"


def opened(browser, path: Path) -> dict[str, float]:
    """Times of one opening."""
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    context.add_init_script(_NOTE)
    page = context.new_page()
    page.goto(path.resolve().as_uri(), wait_until="load")
    answer = float("nan")
    if page.locator("#replay").count():
        page.evaluate("document.getElementById('replay').scrollIntoView()")
        page.wait_for_selector("#replay[data-state=ready]", timeout=60_000)
        page.locator("#replay-map").focus()
        answer = page.evaluate(_ANSWER)
    while not page.evaluate("performance.getEntriesByName('first-contentful-paint').length"):
        page.wait_for_timeout(20)
    times = {**page.evaluate(_TIMES), "answer": answer}
    context.close()
    return times


def line(browser, path: Path) -> str:
    """One row of the table."""
    data = path.read_bytes()
    told = json.loads(path.with_name("report.json").read_text(encoding="utf-8"))
    seconds = (told["bundle"]["end_ns"] - told["bundle"]["start_ns"]) / 1e9
    runs = [opened(browser, path) for _ in range(OPENINGS)]
    load, paint, ready, answer = (
        statistics.median(run[key] for run in runs) for key in ("load", "paint", "ready", "answer")
    )
    return (
        f"| {path.parent.name} | {seconds:.0f} s | {len(data) / 1e6:.2f} MB "
        f"| {len(gzip.compress(data)) / 1e6:.2f} MB "
        f"| {paint:.0f} | {load:.0f} | {ready:.0f} | {answer:.0f} |"
    )


def main(folder: Path, words: list[str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    wanted = [(log, []) for log in sorted(SAMPLES.iterdir()) if log.suffix in SUFFIXES]
    while words:
        log, options = Path(words.pop(0)), []
        while words and words[0].startswith("--"):
            options += [words.pop(0), words.pop(0)]
        wanted.append((log, options))
    with sync_playwright() as playwright:
        browser = find.launch(playwright)
        print(f"Chromium {browser.version}; goal: under {GOAL_MB:.0f} MB for ten minutes\n")
        print("| report | log | page | zipped | first paint | loaded | replay ready | answers |")
        print("|---|---|---|---|---|---|---|---|")
        for log, options in wanted:
            print(line(browser, report(folder, log, options)), flush=True)
        browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
