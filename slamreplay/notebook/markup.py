"""HTML for cells of notebooks: everything escaped, colours inherited, nothing that runs.

Notebooks have light and dark themes of their own, which no media query tells: text and rules take
the colour of what is around them, and pictures bring their own white paper.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape

from slamreplay.evidence.clean import clean

_RULE = "1px solid rgba(128,128,128,.4)"
#: Colours that are read on white and on black.
TONES = {
    "good": "#009E73",
    "bad": "#D55E00",
    "doubt": "#E69F00",
    "plain": "inherit",
    "quiet": "inherit",
}


def text(value: object) -> str:
    """Anything as text that is no markup."""
    return escape(clean(str(value)))


def box(*parts: str) -> str:
    """One cell's content."""
    return f'<div style="max-width:64em;line-height:1.4">{"".join(parts)}</div>'


def heading(words: str, aside: str = "", tone: str = "plain") -> str:
    """The first line: what it is, and beside it what of."""
    bar = (
        f"border-left:.35em solid {TONES[tone]};padding-left:.6em;"
        if TONES[tone] != "inherit"
        else ""
    )
    beside = f' <span style="opacity:.75">{text(aside)}</span>' if aside else ""
    return f'<div style="{bar}font-size:1.15em"><strong>{text(words)}</strong>{beside}</div>'


def paragraph(words: str) -> str:
    """A paragraph."""
    return f'<p style="margin:.5em 0">{text(words)}</p>'


def grid(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table."""
    cell = f"padding:.15em .8em .15em 0;text-align:left;vertical-align:top;border-bottom:{_RULE}"
    top = "".join(f'<th scope="col" style="{cell}">{text(h)}</th>' for h in head)
    body = "".join(
        f"<tr>{''.join(f'<td style={chr(34)}{cell}{chr(34)}>{text(c)}</td>' for c in row)}</tr>"
        for row in rows
    )
    first = f"<thead><tr>{top}</tr></thead>" if head else ""
    return (
        '<table style="border-collapse:collapse;background:none;color:inherit;margin:.5em 0">'
        f"{first}<tbody>{body}</tbody></table>"
    )


def picture(svg: bytes, alt: str) -> str:
    """A picture on its own paper; in an img nothing of an SVG can run."""
    address = base64.b64encode(svg).decode()
    return (
        f'<img alt="{text(alt)}" src="data:image/svg+xml;base64,{address}" '
        'style="max-width:100%;background:#fff;border-radius:4px">'
    )
