"""Services and actions as the messages their hidden topics carry.

rosidl makes messages of a `.srv` and an `.action` that no `.msg` file defines: the feedback of an
action, and the events of a service under introspection. Recorders leave their definition empty or
write down the text of the `.srv` or `.action` itself; here it becomes the message's definition.

Sources: design.ros2.org/articles/actions.html and interface_definition.html, REP 2012.
"""

from __future__ import annotations

import re

SEPARATOR = "=" * 80 + "\n"

_DERIVED = re.compile(
    r"(?P<base>\w+/(?P<kind>srv|action)/\w+?)_"
    r"(?P<part>FeedbackMessage|SendGoal_Event|GetResult_Event|Event)"
)
_HEADLINE = re.compile(r"\A\s*={80}\n(?:SRV|ACTION): .*\n")
_FIELD = re.compile(r"^([ \t]*)([A-Za-z]\w*)(?=(?:<=\d+)?(?:\[[^\]]*\])?[ \t]+\w)", re.MULTILINE)
_BUILTIN = frozenset(
    ["bool", "byte", "char", "float32", "float64", "string", "wstring", "time", "duration"]
    + [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
)
#: What rosidl puts into a structure without fields, for C and IDL know none.
_EMPTY = "uint8 structure_needs_at_least_one_member"
_CONSTANT = re.compile(r"\S+\s+\w+\s*=")


def as_message(type_name: str) -> str:
    """The name by which parsers of definitions know a part of a service or action: pkg/msg/T."""
    return type_name.replace("/srv/", "/msg/").replace("/action/", "/msg/")


def base_interface(type_name: str) -> str:
    """The service or action a message type belongs to ("pkg/action/Spin"), "" for a plain one."""
    match = _DERIVED.fullmatch(type_name)
    return match["base"] if match else ""


def message_definition(type_name: str, text: str) -> str:
    """The definition of a message type from the text of its `.srv` or `.action`.

    Args:
        type_name: "pkg/srv/X_Event", "pkg/action/X_FeedbackMessage", "pkg/action/X_SendGoal_Event"
            or "pkg/action/X_GetResult_Event".
        text: the file's parts between lines of `---`, with or without the definitions of its
            fields' types after them, as recorders append them.

    Returns:
        A definition in the form of MCAP and ROS 1 bags, the types it needs appended. Text of any
        other type, and text that is a message's definition already, comes back as it is; "" where
        a plain message (an action's status) has the text of an action, which does not define it.
    """
    match = _DERIVED.fullmatch(type_name)
    if match is None:
        return "" if _HEADLINE.match(text) else text
    body, *rest = re.split(rf"^{SEPARATOR}", _HEADLINE.sub("", text), flags=re.MULTILINE)
    parts = [_qualified(p, type_name) for p in re.split(r"^---[ \t]*$", body, flags=re.MULTILINE)]
    if len(parts) != (2 if match["kind"] == "srv" else 3):
        return text
    own = _of_service if match["kind"] == "srv" else _of_action
    sections = own(as_message(match["base"]), match["part"], parts)
    return "".join([sections[0], *(f"{SEPARATOR}{s}" for s in [*sections[1:], *rest])])


def _of_service(base: str, _part: str, parts: list[str]) -> list[str]:
    return [_event(base), *_call(base, *parts)]


def _of_action(base: str, part: str, parts: list[str]) -> list[str]:
    goal, result, feedback = parts
    uuid = "unique_identifier_msgs/UUID goal_id\n"
    if part == "FeedbackMessage":
        own = f"{uuid}{base}_Feedback feedback\n"
        return [own, _section(f"{base}_Feedback", feedback)]
    if part == "SendGoal_Event":
        call = f"{base}_SendGoal"
        request = f"{uuid}{base}_Goal goal\n"
        response = "bool accepted\nbuiltin_interfaces/Time stamp\n"
        inner = _section(f"{base}_Goal", goal)
    else:
        call = f"{base}_GetResult"
        request = uuid
        response = f"int8 status\n{base}_Result result\n"
        inner = _section(f"{base}_Result", result)
    return [_event(call), *_call(call, request, response), inner]


def _event(call: str) -> str:
    return (
        "service_msgs/ServiceEventInfo info\n"
        f"{call}_Request[<=1] request\n"
        f"{call}_Response[<=1] response\n"
    )


def _call(call: str, request: str, response: str) -> tuple[str, str]:
    return _section(f"{call}_Request", request), _section(f"{call}_Response", response)


def _section(name: str, fields: str) -> str:
    lines = [line for raw in fields.splitlines() if (line := raw.partition("#")[0].strip())]
    if all(_CONSTANT.match(line) for line in lines):
        lines.append(_EMPTY)
    return "\n".join([f"MSG: {name}", *lines, ""])


def _qualified(fields: str, type_name: str) -> str:
    """Fields whose types without a package are messages of this one."""
    package = type_name.partition("/")[0]

    def name(match: re.Match[str]) -> str:
        indent, kind = match.groups()
        return match[0] if kind in _BUILTIN else f"{indent}{package}/{kind}"

    return _FIELD.sub(name, fields)
