"""The words of a PDF that Chromium printed: enough of ISO 32000-1 to read what Skia writes."""

import re
import zlib

_OBJECT = re.compile(rb"(\d+) 0 obj(.*?)endobj", re.S)
_STREAM = re.compile(rb"stream\r?\n(.*)\r?\nendstream", re.S)
#: In a page's content: a font is chosen, or glyphs of it are shown (9.4.3).
_SHOWN = re.compile(rb"/F(\d+) [-\d.]+ Tf|<([0-9A-F]+)> ?Tj|\[([^\]]*)\] ?TJ")
_RANGE = re.compile(rb"<([0-9A-F]{4})> <([0-9A-F]{4})> <([0-9A-F]{4,})>")
_ONE = re.compile(rb"^<([0-9A-F]{4})> <([0-9A-F]{4,})>$", re.M)


def pdf_text(data: bytes) -> str:
    """All glyphs in the order they are drawn, without the spaces between them."""
    objects = {int(number): body for number, body in _OBJECT.findall(data)}
    letters, shown = {}, []
    for number, body in objects.items():
        if named := re.search(rb"/ToUnicode (\d+) 0 R", body):
            letters[number] = _letters(_content(objects[int(named[1])]))
    for body in objects.values():
        content = _content(body)
        if b" Tf" not in content:
            continue
        font = {}
        for chosen, run, runs in _SHOWN.findall(content):
            if chosen:
                font = letters.get(int(chosen), {})
            for glyphs in [run, *re.findall(rb"<([0-9A-F]+)>", runs)]:
                codes = (int(glyphs[i : i + 4], 16) for i in range(0, len(glyphs), 4))
                shown.extend(font.get(code, "") for code in codes)
    return "".join("".join(shown).split())


def pages_of(data: bytes) -> int:
    """How many pages it has."""
    return len(re.findall(rb"/Type /Page\b", data))


def _content(body):
    found = _STREAM.search(body)
    if found is None:
        return b""
    return zlib.decompress(found[1]) if b"FlateDecode" in body else found[1]


def _letters(cmap):
    found = {}
    for first, last, text in _RANGE.findall(cmap):
        start = int(text, 16)
        for k, code in enumerate(range(int(first, 16), int(last, 16) + 1)):
            found[code] = chr(start + k)
    for code, text in _ONE.findall(cmap):
        found[int(code, 16)] = bytes.fromhex(text.decode()).decode("utf-16-be")
    return found
