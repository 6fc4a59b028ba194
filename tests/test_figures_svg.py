"""SVG of figures: smaller than matplotlib writes it, the same to see, also on dark pages."""

import base64
import io
import re
from xml.etree import ElementTree as ET

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from slamreplay.report.figures.canvas import (
    BLUE,
    FAINT,
    INK,
    VERMILLION,
    dress,
    new_figure,
    plain_style,
    svg_bytes,
    svg_text,
)
from slamreplay.report.figures.neutral import DARK_INK, DARK_PAPER, dark_of
from slamreplay.report.figures.paths import short_path

SVG = "{http://www.w3.org/2000/svg}"
HOSTILE = "x in <script>\"&' [m]"
COORDINATE = st.floats(-900.0, 900.0).map(lambda x: round(x, 6))


def corners(d: str) -> list[tuple[str, float, float]]:
    """Where each command of a path ends, absolute, by a parser that knows M, l, q, c and z."""
    x = y = start_x = start_y = 0.0
    out = []
    for letter, body in re.findall(r"([A-Za-z])([^A-Za-z]*)", d):
        values = [float(v) for v in re.findall(r"-?(?:\d*\.\d+|\d+)", body)]
        size = {"M": 2, "l": 2, "q": 4, "c": 6, "z": 1}[letter]
        if letter == "z":
            x, y = start_x, start_y
            out.append(("Z", x, y))
        for k in range(0, len(values), size):
            dx, dy = values[k + size - 2 : k + size]
            x, y = (dx, dy) if letter == "M" else (x + dx, y + dy)
            start_x, start_y = (x, y) if letter == "M" else (start_x, start_y)
            out.append((letter.upper(), x, y))
    return out


@given(st.lists(st.tuples(COORDINATE, COORDINATE), min_size=2, max_size=90), st.booleans())
def test_a_shorter_path_passes_through_the_same_corners(points, closed):
    d = "M " + "\nL ".join(f"{x:f} {y:f}" for x, y in points) + (" z" if closed else "")
    near = 0.0501 if len(points) > 40 else 0.00501

    told = [(x, y) for letter, x, y in corners(short_path(d)) if letter != "Z"]
    for x, y in points:  # those that cannot be told apart from the last one are left out
        if told and np.abs(np.subtract(told[0], (x, y))).max() <= near:
            last = told.pop(0)
        assert np.abs(np.subtract(last, (x, y))).max() <= near
    assert not told
    assert len(short_path(d)) <= len(d)


def test_curves_and_closed_parts_stay():
    d = "M 1 2\nC 1.5 2.5 3 4 5 6\nQ 0 0 -1.25 3\nz\nM 7 8\nL 7 8\nL 9 8"

    assert short_path(d) == "M1 2c.5 .5 2 2 4 4q-5-6-6.25-3zM7 8l0 0 2 0"


def drawn():
    figure = new_figure(4.0, 3.0)
    axes = figure.add_subplot()
    image = np.zeros((20, 30, 3))
    image[5:, :] = (1.0, 1.0, 1.0)
    image[10, 10:20] = (213 / 255, 94 / 255, 0.0)
    axes.imshow(image, interpolation="nearest", extent=(0.0, 3.0, 0.0, 2.0))
    axes.plot([0.0, 1.0, 3.0], [0.1, 1.9, 0.0], color=BLUE, label="path")
    axes.plot([0.0, 3.0], [0.5, 1.5], color=VERMILLION)
    dress(axes, HOSTILE, "y in " + 200 * "long" + " [m]", 9.0)
    axes.tick_params(colors=FAINT)
    return figure


def pictures(root):
    found = []
    for image in root.iter(f"{SVG}image"):
        href = image.get("{http://www.w3.org/1999/xlink}href")
        data = base64.b64decode(href.partition(",")[2])
        found.append((image.get("class"), np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))))
    return found


def test_a_picture_has_neutral_colours_for_dark_paper_and_keeps_the_others():
    with plain_style():
        root = ET.fromstring(svg_text(drawn(), dark=True))
    rule = root.find(f"{SVG}style").text

    assert rule.startswith("@media screen and (prefers-color-scheme:dark)")
    for colour in ("#ffffff", INK, FAINT):
        assert f'="{colour}"]' in rule
    assert VERMILLION.lower() not in rule
    assert f'[stroke="{BLUE.lower()}"]' in rule
    (light, day), (dark, night) = pictures(root)
    assert (light, dark) == ("l", "d")
    meant = (day == (213, 94, 0)).all(axis=2)
    assert meant.any()
    np.testing.assert_array_equal(night[meant], day[meant])
    np.testing.assert_array_equal(night[(day == 255).all(axis=2)][0], DARK_PAPER)
    np.testing.assert_array_equal(night[(day == 0).all(axis=2)][0], DARK_INK)


def test_a_file_for_a_paper_has_one_set_of_colours_and_no_style_that_a_policy_could_refuse():
    with plain_style():
        data = svg_bytes(drawn())
    root = ET.fromstring(data)

    assert data.startswith(b"<?xml")
    assert root.find(f".//{SVG}style") is None
    assert len(pictures(root)) == 1
    assert not any("style" in element.attrib for element in root.iter())
    texts = [element.text for element in root.iter(f"{SVG}text")]
    assert HOSTILE in texts
    (long,) = (text for text in texts if text.startswith("y in longlong"))
    assert long.endswith("...ng [m]")
    assert len(long) == 40


def test_dark_greys_keep_their_order_and_their_distance_from_the_paper():
    greys = [dark_of(f"#{v:02x}{v:02x}{v:02x}") for v in (255, 200, 120, 40)]

    assert greys == sorted(greys)
    assert dark_of("#ffffff") == "#" + "".join(f"{int(v):02x}" for v in DARK_PAPER)
    assert dark_of("none") == "none"
    assert dark_of(VERMILLION) == VERMILLION
