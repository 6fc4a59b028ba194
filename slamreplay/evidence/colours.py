"""Colours that mean the same wherever something is drawn.

Okabe and Ito's, told apart with every common kind of colour blindness (Color Universal Design,
2008). A colour is a hexadecimal `#rrggbb`.
"""

from __future__ import annotations

from slamreplay.evidence.scene import Met
from slamreplay.verdict.judgement import State

BLUE, SKY, GREEN, YELLOW = "#0072B2", "#56B4E9", "#009E73", "#F0E442"
ORANGE, VERMILLION, PURPLE, GREY = "#E69F00", "#D55E00", "#CC79A7", "#9AA0A6"

#: Where the robot believed to be and where hindsight says it was, on a dark ground.
BELIEF, HINDSIGHT = VERMILLION, SKY
#: Replayed estimators, one after the other.
RUNS = (PURPLE, GREEN, YELLOW, BLUE, GREY)

#: A map on a dark ground, where yellow and blue can both be seen.
GROUND, FREE, WALL = "#16191d", "#2d333a", "#c3cad1"

STATES: dict[State, str] = {
    "healthy": GREEN,
    "lost": VERMILLION,
    "map_changed": ORANGE,
    "lost_and_map_changed": PURPLE,
    "unobservable": SKY,
    "insufficient_data": GREY,
}

BEAMS: dict[Met, str] = {
    Met.INVALID: GREY,
    Met.MAPPED: GREEN,
    Met.APPEARED: ORANGE,
    Met.REMOVED: YELLOW,
    Met.MOVING: PURPLE,
    Met.OTHER: GREY,
}


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue, 0 to 255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
