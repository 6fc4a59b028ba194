"""Feedback of Nav2's actions: a behaviour that runs, a recovery counted, a docking tried again."""

from __future__ import annotations

import numpy as np

from slamreplay.geometry.times import NO_STAMP, Times
from slamreplay.ingest.action_names import action_of
from slamreplay.ingest.decoders.checks import kept
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages
from slamreplay.ingest.decoders.recovery_rows import first_of_each, hexadecimal, recovery_columns


def _behaviour(messages: Messages) -> Decoded:
    """A behaviour says how far it is several times a second: its first word is its start."""
    goal = hexadecimal(messages.fixed("goal_id.uuid", 16))
    action = action_of(messages.topic)
    columns = recovery_columns(action, "executing", goal, "action", len(messages))
    unstamped = np.full(len(messages), NO_STAMP)
    return kept(first_of_each(goal), columns, messages.every, unstamped, ())


def _navigation(messages: Messages) -> Decoded:
    """`number_of_recoveries` counts on with each recovery; which one it was is not said."""
    stamps = messages.stamps("feedback.current_pose.header.stamp")
    return _counted(messages, "number_of_recoveries", "recovery", "navigation_feedback", stamps)


def _docking(messages: Messages) -> Decoded:
    """A retry is docking's own recovery: back to the staging pose, and on to the dock again."""
    unstamped = np.full(len(messages), NO_STAMP)
    return _counted(messages, "num_retries", "docking retry", "action", unstamped)


def _counted(messages: Messages, field: str, name: str, source: str, stamps: Times) -> Decoded:
    """One row for each count that a goal comes to have; `changes` leaves those that have grown."""
    goal = hexadecimal(messages.fixed("goal_id.uuid", 16))
    names = np.empty(len(messages), dtype=object)
    names[:] = [f"{name} {count}" for count in messages.column(f"feedback.{field}", np.int64)]
    columns = recovery_columns(names, "running", goal, source, len(messages))
    return kept(first_of_each(goal + "\n" + names), columns, messages.every, stamps, ())


BEHAVIOUR = Decoder("recoveries", _behaviour)
NAVIGATION = Decoder("recoveries", _navigation)
DOCKING = Decoder("recoveries", _docking)
