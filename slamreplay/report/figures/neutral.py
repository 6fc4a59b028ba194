"""Paper, ink and the greys between them, as they are on dark paper."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

#: White and the ink of light pages, and what stands for them on dark ones: the page's own colours.
_WHITE, _INK = np.array([255.0, 255.0, 255.0]), np.array([34.0, 39.0, 43.0])
DARK_PAPER, DARK_INK = np.array([29.0, 33.0, 37.0]), np.array([236.0, 234.0, 228.0])
#: The one data colour that is too dim for dark paper, lifted in its own hue.
_LIFTED = {"#0072b2": "#2f93d6"}
#: Channels this near to each other make a grey.
_GREY = 20
_HEX = re.compile(r"#[0-9a-f]{6}")


def dark_of(colour: str) -> str:
    """What stands for "#rrggbb" on dark paper: a grey as far from the paper as it was from white.

    Colours that mean something stay, and so does what is no colour.
    """
    if not _HEX.fullmatch(colour.lower()):
        return colour
    if int(np.ptp(_rgb(colour))) > _GREY:
        return _LIFTED.get(colour.lower(), colour)
    return "#" + "".join(f"{value:02x}" for value in _turned(_rgb(colour)[None])[0])


def dark_palette(colours: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Colours (N, 4) on dark paper: neutral ones turned, others as they are."""
    out = colours.copy()
    grey = np.ptp(colours[:, :3].astype(np.int64), axis=1) <= _GREY
    out[grey, :3] = _turned(colours[grey, :3].astype(np.float64))
    return out


def _rgb(colour: str) -> NDArray[np.float64]:
    return np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)], dtype=np.float64)


def _turned(rgb: NDArray[np.float64]) -> NDArray[np.uint8]:
    share = np.clip((_WHITE - rgb).mean(axis=1) / (_WHITE - _INK).mean(), 0.0, 1.0)[:, None]
    return np.rint(DARK_PAPER + share * (DARK_INK - DARK_PAPER)).astype(np.uint8)
