"""What several tests ask of a page."""

import io
import json

import numpy as np
from PIL import Image


def words(text):
    """Text as it reads, whatever binds its spaces."""
    return " ".join(text.replace("\N{NO-BREAK SPACE}", " ").split())


def told(reports, name):
    """The report.json that lies beside a page."""
    return json.loads(reports(name).with_name("report.json").read_text(encoding="utf-8"))


def summary(reports, name):
    """The verdict in one sentence, as report.json has it."""
    return told(reports, name)["verdict"]["summary"]


def open_details(page):
    """Unfold all that is folded."""
    page.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true })")


def pixels(element):
    """(H, W, 3) what an element looks like."""
    return np.asarray(Image.open(io.BytesIO(element.screenshot())).convert("RGB"))
