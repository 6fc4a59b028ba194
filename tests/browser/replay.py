"""The replay of an open page, as a user has it: what it shows, and what can be done to it."""

import base64
import io

import numpy as np
from PIL import Image

# Two frames: the first may still be on its way with the picture before.
_SETTLE = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"


class Replay:
    """The replay of a page, come into view and ready.

    Attributes:
        page: Playwright's.
        section: all of the replay.
        map: its canvas.
    """

    def __init__(self, page):
        self.page = page
        self.section = page.locator("#replay")
        self.map = page.locator("#replay-map")
        self.map.scroll_into_view_if_needed()
        page.wait_for_selector("#replay[data-state=ready]", timeout=10_000)

    @property
    def t(self):
        """The moment shown, s since the log's start."""
        return float(self.section.get_attribute("data-t"))

    @property
    def px_per_m(self):
        """CSS pixels that a metre takes now."""
        return float(self.map.get_attribute("data-px-per-m"))

    @property
    def said(self):
        """What is told in words of the moment."""
        return " ".join(self.page.locator("#replay-say").inner_text().split())

    def end(self):
        """Where the slider ends, s."""
        return float(self.page.locator("#replay-time").get_attribute("max"))

    def settle(self):
        """Wait until what was asked for is drawn."""
        self.page.evaluate(_SETTLE)

    def until(self, holds, seconds=5.0):
        """Wait until an expression holds; Playwright's own waiting is eval, and forbidden here."""
        for _ in range(int(seconds / 0.03)):
            if self.page.evaluate(holds):
                return
            self.page.wait_for_timeout(30)
        raise AssertionError(f"never came true: {holds}")

    def until_t(self, condition, seconds=5.0):
        """Wait until the moment shown is as asked, such as "> 3"."""
        self.until(f"+document.getElementById('replay').dataset.t {condition}", seconds)

    def press(self, *keys):
        """Keys while the map has the focus."""
        self.map.focus()
        for key in keys:
            self.page.keyboard.press(key)
        self.settle()

    def go(self, t):
        """Move the slider to a moment."""
        self.page.locator("#replay-time").fill(f"{t}")
        self.settle()

    def picture(self, canvas="replay-map"):
        """(H, W, 4) uint8 what the canvas holds, in its own pixels."""
        uri = self.page.evaluate(f"document.getElementById('{canvas}').toDataURL()")
        raw = base64.b64decode(uri.partition(",")[2])
        return np.asarray(Image.open(io.BytesIO(raw)).convert("RGBA"))

    def layers(self):
        """The names of the layers that can be switched."""
        boxes = self.page.locator("input[name=layer]")
        return boxes.evaluate_all(
            "all => all.filter(b => b.checkVisibility() && !b.disabled).map(b => b.value)"
        )

    def show(self, *layers):
        """Show these layers and no others."""
        for layer in self.layers():
            self.switch(layer, on=layer in layers)
        self.settle()

    def switch(self, layer, *, on):
        """Show or hide a layer."""
        self.page.locator(f"input[name=layer][value='{layer}']").set_checked(on)
        self.settle()

    def middle(self):
        """(x, y) of the map's middle in the window, CSS px."""
        box = self.map.bounding_box()
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def differing(one, other):
    """Share of pixels that are not the same in two pictures."""
    assert one.shape == other.shape
    return float((one != other).any(axis=-1).mean())
