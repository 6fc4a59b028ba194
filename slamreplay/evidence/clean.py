"""Text of a log made fit for any file: a log may hold what XML and UTF-8 have no place for."""

from __future__ import annotations

import re

# XML 1.0 section 2.2: no control characters but tab and line ends, no surrogates, escaped or not.
_UNFIT = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_MARKS = re.compile(r"[\\`*_\[\]<>|#~&$]")


def clean(text: str) -> str:
    """The text with unfit characters replaced by U+FFFD."""
    return _UNFIT.sub("\N{REPLACEMENT CHARACTER}", text)


# Unicode Standard Annex 9: embeddings, overrides and isolates turn the order of what follows.
_TURNS = re.compile("[\u202a-\u202e\u2066-\u2069]")


def straight(text: str) -> str:
    """The text with marks that turn its direction spelt out, as "[U+202E]": a name cannot hide."""
    return _TURNS.sub(lambda found: f"[U+{ord(found[0]):04X}]", text)


def as_markdown(text: str) -> str:
    """Markdown that shows the text as it is: what a log wrote is no markup."""
    return _MARKS.sub(r"\\\g<0>", text)


def one_line(text: str, most: int) -> str:
    """The text, clean and straight, on one line of at most `most` letters.

    Every kind of line end becomes a space: no part of a log's text begins a line of its own.
    """
    # Far more than is shown is not looked at: a log may hold a megabyte in one text.
    line = " ".join(straight(clean(text[: 4 * most])).split())
    if len(line) <= most and len(text) <= 4 * most:
        return line
    left_out = f"... ({len(text)} letters in all)"
    return line[: most - len(left_out)] + left_out
