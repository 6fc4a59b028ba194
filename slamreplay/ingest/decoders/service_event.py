"""Events of services under introspection: recoveries called, and goals sent to actions.

A call is seen up to four times: sent and received by either side. The first that is in the log
counts, once for the request and once for the answer. Requests and answers are sequences of one
element, or of none where only metadata is recorded. Source: REP 2012.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.recoveries import NAVIGATIONS
from slamreplay.ingest.action_names import action_of, is_recovery, service_of
from slamreplay.ingest.decoders.checks import kept
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark
from slamreplay.ingest.decoders.recovery_rows import (
    Texts,
    first_of_each,
    hexadecimal,
    recovery_columns,
)

#: service_msgs/ServiceEventInfo: 0 request sent, 1 request received, 2 and 3 the response.
_RESPONSE_SENT = 2


def _recovery(messages: Messages) -> Decoded:
    """One row for the request and one for the answer, which tells success since Lyrical."""
    call, is_answer = _calls(messages)
    status = np.where(is_answer, "success", "running").astype(object)
    answers, rows = messages.children("response")
    if answers.has("success"):
        failed = ~answers.column("success", bool)
        status[rows[failed & is_answer[rows]]] = "failure"
    keep = first_of_each(call + np.where(is_answer, " answer", "").astype(object))
    service = service_of(messages.topic)
    columns = recovery_columns(service, status, call, "service", len(messages))
    return kept(keep, columns, messages.every, messages.stamps("info.stamp"), ())


def _empty(messages: Messages) -> Decoded:
    """The same of std_srvs/Empty, for services whose name is a recovery's."""
    wanted = is_recovery(service_of(messages.topic))
    decoded = _recovery(messages.take(np.full(len(messages), wanted)))
    unused = 0 if wanted else len(messages)
    remarks = (Remark("skipped", unused, "calls of a service that is no recovery"),)
    return replace(decoded, remarks=remarks)


def _goal_sent(messages: Messages) -> Decoded:
    """One row for each goal that was sent, and one where the server would not have it."""
    action = action_of(messages.topic)
    wanted = is_recovery(action) or action in NAVIGATIONS
    call, is_answer = _calls(messages)
    requests, asked = messages.children("request")
    goal = np.array(call, dtype=object)
    goal[asked] = hexadecimal(requests.fixed("goal_id.uuid", 16))
    named = dict(zip(call[asked], goal[asked], strict=True))
    goal[:] = [named.get(c, g) for c, g in zip(call, goal, strict=True)]
    answers, rows = messages.children("response")
    refused = np.zeros(len(messages), dtype=bool)
    refused[rows] = ~answers.column("accepted", bool)
    status = np.where(is_answer, "rejected", "pending").astype(object)
    keep = first_of_each(goal + np.where(is_answer, " answer", "").astype(object))
    keep &= wanted & (refused | ~is_answer)
    columns = recovery_columns(action, status, goal, "action", len(messages))
    unused = 0 if wanted else len(messages)
    remarks = (Remark("skipped", unused, "goals of an action that is no recovery or navigation"),)
    return kept(keep, columns, messages.every, messages.stamps("info.stamp"), remarks)


def _calls(messages: Messages) -> tuple[Texts, NDArray[np.bool_]]:
    """(N,) which call each event is of, as client and number, and whether it is an answer."""
    client = hexadecimal(messages.fixed("info.client_gid", 16))
    number = messages.column("info.sequence_number", np.int64)
    call = np.empty(len(messages), dtype=object)
    call[:] = [f"{c}:{n}" for c, n in zip(client, number, strict=True)]
    return call, messages.column("info.event_type", np.int64) >= _RESPONSE_SENT


CLEARING = Decoder("recoveries", _recovery)
EMPTY = Decoder("recoveries", _empty)
GOAL_SENT = Decoder("recoveries", _goal_sent)
