"""What a step of GitHub Actions prints to annotate a run.

Workflow commands are lines of the output that begin with "::". The runner takes the first ten of a
kind from a step and cuts a message at 4096 letters (actions/toolkit, docs/problem-matchers.md;
actions/runner, ExecutionContext.cs). So checks that fail on many logs share one annotation, and
the last one tells what was left out.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from secrets import token_hex

from slamreplay.bundle.findings import Severity
from slamreplay.evidence.clean import clean, one_line, straight
from slamreplay.gate.failures import Failure, failures, grouped, logs_of, relative
from slamreplay.gate.outcome import GateResult

_COMMAND: dict[Severity, str] = {"error": "error", "warning": "warning", "info": "notice"}
#: Annotations of one kind that the runner takes from a step.
PER_KIND = 10
#: Letters of a message that it keeps, less a margin for letters it counts twice.
_MESSAGE_LETTERS = 2_000
_TITLE_LETTERS = 120
#: Logs that an annotation quotes.
_QUOTED = 5
_LINE_LETTERS = _MESSAGE_LETTERS // (_QUOTED + 1)


def annotations(result: GateResult) -> str:
    """Lines for the step's output, one command each; nothing where nothing failed.

    One annotation for each check and severity, over all logs on which it failed: worst first, and
    of the same severity the one that fails on most logs. It is put on the log, or on the recipe
    where there are several. The same result gives the same text.
    """
    groups = grouped(failures(result))
    lines: list[str] = []
    left_out: list[list[Failure]] = []
    for command in ("error", "warning", "notice"):
        of_kind = [group for group in groups if _COMMAND[group[0].severity] == command]
        # The last notice tells what was left out, so that one more would be too many.
        most = PER_KIND - (command == "notice" and (bool(left_out) or len(of_kind) > PER_KIND))
        lines += [_line(command, group, result) for group in of_kind[:most]]
        left_out += of_kind[most:]
    if left_out:
        logs = logs_of(failure for group in left_out for failure in group)
        told = (
            f"{len(left_out)} more failures of a check, on {_logs(logs)}, are not annotated: "
            f"GitHub takes {PER_KIND} of a kind from a step. junit.xml has them all."
        )
        lines.append(_command("notice", {"title": "slamreplay gate"}, told))
    return "".join(f"{line}\n" for line in lines)


def artifacts_of(environment: Mapping[str, str]) -> str | None:
    """Address of the page with a run's artifacts, for `step_summary`; None outside of a run.

    A summary is shown beside the artifacts, not among them: a link to a report by its path would
    lead nowhere.
    """
    names = ("GITHUB_SERVER_URL", "GITHUB_REPOSITORY", "GITHUB_RUN_ID")
    server, repository, run = (environment.get(name) for name in names)
    if not (server and repository and run):
        return None
    return f"{server}/{repository}/actions/runs/{run}#artifacts"


@contextmanager
def commands_stopped(write: Callable[[str], object]) -> Iterator[None]:
    """While this holds the runner takes no command from the output, whatever a log wrote.

    Other output of the program may quote a log, too, and a terminal's width may fold such a text
    so that "::" begins a line.

    Args:
        write: to the output; called with whole lines.
    """
    token = token_hex(16)  # nobody who writes a log can know it
    write(f"::stop-commands::{token}\n")
    try:
        yield
    finally:
        write(f"::{token}::\n")


def _line(command: str, group: list[Failure], result: GateResult) -> str:
    first = group[0]
    alone = len({failure.log.log for failure in group}) == 1
    title = one_line(f"{first.outcome.check}: {first.outcome.title}", _TITLE_LETTERS)
    if not alone:
        title += f" ({_logs(logs_of(group))} of {len(result.single)})"
    file = first.log.log if alone else result.recipe
    properties = {"file": straight(clean(relative(file))), "title": title}
    return _command(command, properties, "\n".join(_quoted(group, alone)))


def _quoted(group: list[Failure], alone: bool) -> Iterator[str]:
    for failure in group[:_QUOTED]:
        where = "" if alone else f"{failure.log.log}: "
        yield one_line(f"{where}{failure.outcome.message}", _LINE_LETTERS)
    if len(group) > _QUOTED:
        yield f"and {len(group) - _QUOTED} more"


def _logs(count: int) -> str:
    return "1 log" if count == 1 else f"{count} logs"


def _command(name: str, properties: dict[str, str], message: str) -> str:
    """One workflow command; what a log wrote cannot end it or begin another one."""
    given = ",".join(f"{key}={_property(value)}" for key, value in properties.items() if value)
    return f"::{name} {given}::{_data(message)}"


def _data(text: str) -> str:
    """A message as actions/toolkit escapes it (packages/core/src/command.ts)."""
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    """The value of a property as it does."""
    return _data(text).replace(":", "%3A").replace(",", "%2C")
