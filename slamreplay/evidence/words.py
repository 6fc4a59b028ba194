"""What states and failure modes are called where people read them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StateWords:
    """A state's short name and what it says."""

    name: str
    meaning: str


STATES = {
    "healthy": StateWords("Healthy", "the robot knew where it was and the map held"),
    "lost": StateWords("Robot lost", "the robot was not where it believed to be"),
    "map_changed": StateWords("Map changed", "the robot was right; the map no longer was"),
    "lost_and_map_changed": StateWords(
        "Lost, and map changed", "the robot was lost and the map no longer held"
    ),
    "unobservable": StateWords(
        "Ambiguous place", "more than one place in the map explains the log equally well"
    ),
    "insufficient_data": StateWords("Cannot be judged", "the log lacks what the question needs"),
}
#: Of states that say something of the belief, where none was recorded.
_WITHOUT_BELIEF = {
    "healthy": "the map held; no belief to judge",
    "map_changed": "the map no longer held; no belief to judge",
}

FAILURE_MODES = {
    "sensing_ambiguity": "sensing ambiguity",
    "association_error": "association error",
    "optimization_drift": "optimization drift",
    "stale_map_use": "stale map in use",
    "timing": "timing",
    "odometry_slip": "odometry slip",
    "wrong_initial_pose": "wrong initial pose",
    "kidnapped": "robot carried away",
    "overconfidence": "overconfidence",
    "wrong_map": "wrong map or map frame",
    "none": "none",
}


def meaning_of(state: str, *, has_belief: bool) -> str:
    """What a state says; without a belief nothing is said of one.

    Args:
        state: a key of STATES.
        has_belief: whether a localizer spoke in the log.
    """
    meaning = STATES[state].meaning
    return meaning if has_belief else _WITHOUT_BELIEF.get(state, meaning)


def confidence_text(confidence: float | None) -> str:
    """A probability in per cent; 100 % would claim more than any evidence gives."""
    return "not known" if confidence is None else f"{min(100.0 * confidence, 99.0):.0f} %"
