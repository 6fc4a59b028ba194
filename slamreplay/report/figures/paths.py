"""Paths of an SVG in fewer letters."""

from __future__ import annotations

import re

_TOKEN = re.compile(r"[MLCQz]|-?[\d.]+(?:e-?\d+)?")
#: Points from which on a path is a curve of data: a tenth of a point is 0.04 mm on paper.
_LONG = 40


def short_path(d: str) -> str:
    """Relative steps of hundredths of a point, of tenths in a long path; same way, same corners.

    Args:
        d: absolute M, L, Q, C and z, as matplotlib writes them.
    """
    tokens = _TOKEN.findall(d)
    scale = 10 if len(tokens) > 3 * _LONG else 100
    out: list[str] = []
    x = y = start_x = start_y = 0
    last, command, k = "", "", 0
    while k < len(tokens):
        if tokens[k].isalpha():
            command = tokens[k]
            k += 1
            if command == "z":
                out.append("z")
                x, y, last = start_x, start_y, "z"
                continue
        count = {"M": 2, "L": 2, "Q": 4, "C": 6}[command]
        ends = [round(float(token) * scale) for token in tokens[k : k + count]]
        k += count
        steps = [end - (x, y)[n % 2] for n, end in enumerate(ends)]
        if command == "L" and last == "l" and not any(steps):
            continue  # as near as can be seen
        x, y = ends[-2:]
        if command == "M":
            start_x, start_y = x, y
            out.append("M" + _joined(ends, scale))
            last = "M"
            continue
        numbers = _joined(steps, scale)
        letter = command.lower()
        between = "" if letter != last or numbers[0] == "-" else " "
        out.append((letter if letter != last else between) + numbers)
        last = letter
    return "".join(out)


def _joined(values: list[int], scale: int) -> str:
    """Numbers with a space only where no sign divides them."""
    words = [_number(value, scale) for value in values]
    return "".join(word if not n or word[0] == "-" else f" {word}" for n, word in enumerate(words))


def _number(value: int, scale: int) -> str:
    whole, part = divmod(abs(value), scale)
    digits = f"{part:0{len(str(scale)) - 1}d}".rstrip("0")
    text = (str(whole) if whole or not digits else "") + (f".{digits}" if digits else "")
    return f"-{text}" if value < 0 and text != "0" else text
