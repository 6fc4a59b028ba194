"""Matplotlib's SVG made small, and fit for dark paper as well.

Text stays text in the reader's own fonts: half the size of outlines, and sharp at any zoom. The
layout was measured with DejaVu Sans, which is wider than what browsers take instead.
"""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Iterator
from xml.etree import ElementTree as ET

import numpy as np
from PIL import Image

from slamreplay.report.figures.neutral import dark_of, dark_palette
from slamreplay.report.figures.paths import short_path

_SVG, _XLINK = "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"
_G, _DEFS = f"{{{_SVG}}}g", f"{{{_SVG}}}defs"
_INHERITED = ("fill", "stroke", "stroke-width", "stroke-linejoin", "stroke-linecap")
_HREF = f"{{{_XLINK}}}href"
_FONTS = "system-ui,-apple-system,Segoe UI,Roboto,Helvetica Neue,Arial,DejaVu Sans,sans-serif"
_NUMBER = re.compile(r"-?\d+\.\d{3,}")
#: Screens only: paper is white.
_DARK = "@media screen and (prefers-color-scheme:dark)"


def small_svg(text: str, *, dark: bool) -> str:
    """The same picture: attributes for styles, no names nobody refers to, shorter numbers.

    Args:
        text: as matplotlib writes it.
        dark: with a second set of neutral colours for readers who have asked for dark pages.
    """
    ET.register_namespace("", _SVG)
    ET.register_namespace("xlink", _XLINK)
    root = ET.fromstring(text)  # noqa: S314 matplotlib's, and what came from a log is escaped in it
    for parent in list(root.iter()):
        for child in [c for c in parent if c.tag in (f"{{{_SVG}}}style", f"{{{_SVG}}}metadata")]:
            parent.remove(child)
    root.attrib |= {"stroke-linejoin": "round", "stroke-linecap": "butt", "font-family": _FONTS}
    referred = set(re.findall(r"#([\w-]+)", " ".join(_values(root))))
    for element in root.iter():
        _plain(element, referred)
    _unwrap(root)
    for image in list(root.iter(f"{{{_SVG}}}image")):
        _repaint(root, image, dark=dark)
    if dark:
        style = ET.Element(f"{{{_SVG}}}style")
        style.text = _dark_rules(root)
        root.insert(0, style)
    return re.sub(r">\s+<", "><", ET.tostring(root, encoding="unicode")).replace(" />", "/>")


def _values(root: ET.Element) -> Iterator[str]:
    for element in root.iter():
        yield from (v for k, v in element.attrib.items() if k in (_HREF, "clip-path", "style"))
        yield from (v for k, v in element.attrib.items() if k in ("fill", "mask", "filter"))


def _plain(element: ET.Element, referred: set[str]) -> None:
    """Presentation attributes for the style: rules of a dark page are stronger than those."""
    had = element.attrib
    for name, _, value in (part.partition(":") for part in had.pop("style", "").split(";")):
        if value and name.strip() != "font-family":
            had[name.strip()] = value.strip()
    if had.get("id") not in referred:
        had.pop("id", None)
    if had.get("transform", "").startswith("rotate(-0 "):
        del had["transform"]
    for name, value in had.items():
        if name == "d":
            had[name] = short_path(value)
        elif name == "transform":
            had[name] = _NUMBER.sub(lambda found: f"{float(found[0]):.6g}", value)
        elif name not in (_HREF, "viewBox"):
            had[name] = _NUMBER.sub(lambda found: f"{float(found[0]):.2f}", value)


def _unwrap(parent: ET.Element) -> None:
    """Groups that say nothing give way to what is in them."""
    children: list[ET.Element] = []
    for child in parent:
        _unwrap(child)
        if child.tag in (_G, _DEFS) and not len(child):
            continue
        children += list(child) if child.tag == _G and not child.attrib else [child]
    parent[:] = children
    if parent.tag == _G and len(parent) > 1:
        _hoist(parent)


def _hoist(group: ET.Element) -> None:
    """What all of a group's children have in common is said once."""
    shared = set(group[0].attrib.items()).intersection(*(c.attrib.items() for c in group))
    for name, value in sorted(shared):
        if name in _INHERITED and name not in group.attrib:
            group.attrib[name] = value
            for child in group:
                del child.attrib[name]


def _repaint(root: ET.Element, image: ET.Element, *, dark: bool) -> None:
    """A picture with a palette, a fifth of the size, and its twin on dark paper."""
    pixels = Image.open(io.BytesIO(base64.b64decode(image.attrib[_HREF].partition(",")[2])))
    packed = np.ascontiguousarray(np.asarray(pixels.convert("RGBA"))).view(np.uint32)
    found, index = np.unique(packed, return_inverse=True)
    if len(found) > 256:
        return
    colours = found.view(np.uint8).reshape(-1, 4)
    shape = index.reshape(pixels.height, pixels.width).astype(np.uint8)
    image.attrib[_HREF] = _png(shape, colours)
    if not dark:
        return
    twin = ET.Element(image.tag, {**image.attrib, "class": "d", "display": "none"})
    twin.attrib.pop("id", None)
    twin.attrib[_HREF] = _png(shape, dark_palette(colours))
    image.attrib["class"] = "l"
    parent = next(p for p in root.iter() if image in list(p))
    parent.insert(list(parent).index(image) + 1, twin)


def _png(index: np.ndarray, colours: np.ndarray) -> str:
    picture, sink = Image.fromarray(index, "P"), io.BytesIO()
    picture.putpalette(colours[:, :3].astype(np.uint8).tobytes())
    clear = bytes(colours[:, 3].astype(np.uint8))
    extra = {} if min(clear) == 255 else {"transparency": clear}
    bits = next(b for b in (1, 2, 4, 8) if len(colours) <= 2**b)
    picture.save(sink, "png", optimize=True, bits=bits, **extra)
    return f"data:image/png;base64,{base64.b64encode(sink.getvalue()).decode()}"


def _dark_rules(root: ET.Element) -> str:
    """A rule for each colour of the picture that is another one on dark paper."""
    found = sorted({
        (name, element.attrib[name])
        for element in root.iter()
        for name in ("fill", "stroke")
        if name in element.attrib
    })  # fmt: skip
    turned = [(name, value, dark_of(value)) for name, value in found]
    rules = [f'[{name}="{was}"]{{{name}:{now}}}' for name, was, now in turned if was != now]
    rules += [f"text:not([fill]){{fill:{dark_of('#000000')}}}", ".l{display:none}"]
    return f"{_DARK}{{{''.join(rules)}.d{{display:inline}}}}"
