"""Parameter files of ROS 1 and ROS 2, read for the estimators they speak of.

ROS 2: `NODE: {ros__parameters: {...}}`, nested below a namespace or with it in the name
(`/robot1/amcl`), and wildcards `/**`, whose parameters are for every node. ROS 1: what `rosparam
dump` writes, `amcl: {...}` below any namespace, or the bare parameters of one node. Of several
files, and of several sections in one, the later holds.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from fnmatch import fnmatchcase
from math import isfinite
from pathlib import Path
from typing import Any

from slamreplay.errors import UsageError
from slamreplay.estimators import ESTIMATORS
from slamreplay.plain_yaml import read_plain_yaml

#: A dump of a whole parameter server holds the robot's description, too.
MAX_BYTES = 4_000_000
#: What any ROS 2 node may be given, of no use to a replay.
_OF_ANY_NODE = (
    "use_sim_time",
    "start_type_description_service",
    "qos_overrides.*",
    "allow_parameter_qos_overrides",
    "bond_*",
    "autostart_node",
    "*introspection_mode",
)
_ROS_2 = "ros__parameters"
_WILDCARDS = ("*", "**")
_NAMED = 3  # parameters named in a line


@dataclass(frozen=True)
class _Section:
    """Parameters of one node, or of those that a wildcard means.

    Attributes:
        namespace: `robot1` or empty, without slashes about it.
        node: last part of the name; empty where the file is of one node and does not name it.
        parameters: values by dotted name.
    """

    namespace: str
    node: str
    parameters: dict[str, object]


@dataclass(frozen=True)
class Configuration:
    """Parameters of estimators.

    Attributes:
        of: canonical JSON by estimator; only those that were given any.
        told: a line for each of them that says how many were taken and which were not.
    """

    of: Mapping[str, str]
    told: tuple[str, ...]


def read_parameters(
    paths: Sequence[Path], estimators: Sequence[str], robot: str | None = None
) -> Configuration:
    """What parameter files say of estimators.

    An estimator takes those of the nodes in its `parameter_nodes` (its name, where it has none)
    through `from_parameters`. Its `live_parameters` (patterns) are of the live node alone: they
    are counted, and have no part in the replay.

    Args:
        paths: YAML files.
        estimators: names in the registry.
        robot: namespace whose sections count, where a file has several.

    Raises:
        UsageError: a file that is none, one that speaks of none of the estimators, two robots and
            none chosen, a parameter that there is not, or a value that makes no sense.
    """
    taking = [e for e in estimators if hasattr(ESTIMATORS.load(e), "from_parameters")]
    if not taking:
        raise UsageError(f"no parameters can be given to {', '.join(estimators)}")
    given: dict[str, dict[str, object]] = {}
    for path in paths:
        found = _of_file(path, taking, robot)
        for name, parameters in found.items():
            given.setdefault(name, {}).update(parameters)
    of, told = {}, []
    for name, parameters in given.items():
        estimator = ESTIMATORS.load(name)
        patterns = (*_OF_ANY_NODE, *getattr(estimator, "live_parameters", ()))
        live = [key for key in parameters if any(fnmatchcase(key, p) for p in patterns)]
        used = {key: value for key, value in parameters.items() if key not in live}
        files = ", ".join(path.name for path in paths)
        _built(name, used, f"{name} in {files}")
        of[name] = canonical(used)
        told.append(_line(name, used, live))
    return Configuration(of, tuple(told))


def canonical(parameters: Mapping[str, object]) -> str:
    """Parameters as JSON whose bytes depend on nothing but them; empty where there are none."""
    if not parameters:
        return ""
    return json.dumps(dict(parameters), sort_keys=True, separators=(",", ":"), allow_nan=False)


def configured(estimator: str, parameters: str) -> Any:
    """The estimator with parameters in canonical JSON; with its defaults where it is empty.

    Raises:
        UsageError: it takes no parameters, or not these.
    """
    made = ESTIMATORS.load(estimator)
    if not parameters:
        return made()
    if not hasattr(made, "from_parameters"):
        raise UsageError("no parameters can be given to it", where=estimator)
    return made.from_parameters(json.loads(parameters))


def _built(name: str, parameters: Mapping[str, object], where: str) -> None:
    """Find out now, not after the log was read, whether the estimator takes them."""
    for key, value in parameters.items():
        if isinstance(value, float) and not isfinite(value):
            raise UsageError(f"'{key}' is {value}: it should be finite", where=where)
    try:
        ESTIMATORS.load(name).from_parameters(parameters)
    except UsageError as error:
        raise UsageError(error.what, where=where, hint=error.hint) from error


def _line(name: str, used: Mapping[str, object], live: Sequence[str]) -> str:
    line = f"{name}: {len(used)} parameter{'s' * (len(used) != 1)} given"
    if live:
        some = ", ".join(live[:_NAMED]) + (", ..." if len(live) > _NAMED else "")
        have = "has" if len(live) == 1 else "have"
        line += f", {len(live)} of the live node {have} no part in a replay ({some})"
    return line


def _of_file(
    path: Path, estimators: Sequence[str], robot: str | None
) -> dict[str, dict[str, object]]:
    """Parameters by estimator, of those that the file speaks of."""
    content = read_plain_yaml(
        path, kind="parameter file", hint="begin with NODE: and its parameters", max_bytes=MAX_BYTES
    )
    nodes = {e: _nodes(ESTIMATORS.load(e)) for e in estimators}
    wanted = {node for names in nodes.values() for node in names}
    sections = list(_ros_2(content, "")) or list(_ros_1(content, "", wanted))
    if any(not section.node for section in sections):
        if len(estimators) > 1:
            raise UsageError(
                f"it does not say whose parameters these are: {', '.join(estimators)}?",
                where=path,
                hint="name one with --estimator",
            )
        return {estimators[0]: sections[0].parameters}
    found = {}
    for estimator in estimators:
        made = ESTIMATORS.load(estimator)
        merged: dict[str, object] = {}
        for section in _chosen(sections, nodes[estimator], robot, path):
            if section.node in _WILDCARDS:  # for every node: what is not of this one is of others
                known = _names(made)
                merged |= {k: v for k, v in section.parameters.items() if k in known}
            else:
                merged |= section.parameters
        if merged:
            found[estimator] = merged
    if not found:
        there = ", ".join(dict.fromkeys(s.node for s in sections)) or ", ".join(content)
        raise UsageError(
            f"it has no parameters of {', '.join(sorted(wanted))}",
            where=path,
            hint=f"it has those of {there[:200]}" if there else None,
        )
    return found


def _nodes(estimator: Any) -> tuple[str, ...]:
    return tuple(getattr(estimator, "parameter_nodes", (estimator.name,)))


def _names(estimator: Any) -> frozenset[str]:
    """Names of the parameters an estimator knows, as far as it tells them."""
    told = getattr(estimator, "parameter_names", None)
    return frozenset(told if told is not None else (f.name for f in fields(estimator)))


def _chosen(
    sections: Sequence[_Section], nodes: Sequence[str], robot: str | None, path: Path
) -> list[_Section]:
    """Those that reach one robot's node, wildcards included, in the file's order."""
    exact = [s for s in sections if s.node in nodes and "*" not in s.namespace]
    spaces = dict.fromkeys(s.namespace for s in exact)
    wanted = (robot or "").strip("/")
    if wanted not in spaces and any(s.parameters != exact[0].parameters for s in exact):
        names = ", ".join("/".join(filter(None, (space, nodes[0]))) for space in spaces)
        raise UsageError(
            f"it has parameters of several robots: {names}",
            where=path,
            hint="name one with --robot, or leave the others out of the file",
        )
    space = wanted if wanted in spaces else next(iter(spaces), wanted)
    return [s for s in sections if _reaches(s, nodes, space)]


def _reaches(section: _Section, nodes: Sequence[str], namespace: str) -> bool:
    """Whether a section is for the node in a namespace, as ROS 2 reads `*` and `**`."""
    above = section.namespace
    if section.node == "**":
        return not above or namespace == above or namespace.startswith(f"{above}/")
    if section.node != "*" and section.node not in nodes:
        return False
    return namespace == above or ("*" in above and fnmatchcase(namespace, above))


def _ros_2(content: Mapping[str, Any], above: str) -> Iterator[_Section]:
    """Every mapping under `ros__parameters`, with the name of the node above it."""
    for key, value in content.items():
        if not isinstance(value, dict):
            continue
        if key == _ROS_2:
            yield _section(above, value)
        else:
            yield from _ros_2(value, f"{above}/{key}")


def _ros_1(content: Mapping[str, Any], above: str, nodes: set[str]) -> Iterator[_Section]:
    """Every mapping under the name of a node, else the file itself as those of one."""
    found = False
    for key, value in content.items():
        if not isinstance(value, dict):
            continue
        if key.strip("/").rpartition("/")[2] in nodes:
            found = True
            yield _section(f"{above}/{key}", value)
        else:
            for section in _ros_1(value, f"{above}/{key}", nodes):
                found = True
                yield section
    if not found and not above and not all(isinstance(v, dict) for v in content.values()):
        yield _section("", content)


def _section(name: str, parameters: Mapping[str, Any]) -> _Section:
    parts = [part for part in name.split("/") if part]
    node = parts[-1] if parts else ""
    return _Section("/".join(parts[:-1]), node, dict(_flat(parameters, "")))


def _flat(parameters: Mapping[str, Any], above: str) -> Iterator[tuple[str, object]]:
    for key, value in parameters.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{above}{key}.")
        else:
            yield above + key, value
