"""The last lines of `slamreplay report`: the answer, what moved the belief, and where it all is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from slamreplay.cli.terminal import say, say_labelled, say_path, say_table

if TYPE_CHECKING:
    from slamreplay.evidence.result import Postmortem


def show_summary(post: Postmortem, page: Path) -> None:
    """Print the answer in ten lines; the page's path comes last, alone, for scripts."""
    from slamreplay.report.summary import summary_lines
    from slamreplay.report.trace_text import jump_lines

    verdict, in_short, *lines = summary_lines(post)
    say((verdict.label, verdict.tone), f" ({verdict.text})", indent=2)
    say((in_short.text, "head"))
    column = max(len(line.label) for line in lines) + 2
    for line in lines:
        say_labelled(line.label, line.text, line.tone, column=column)
    for text in jump_lines(post):
        say_labelled("jumps", text, column=column)
    _show_traces(post)
    say_path(page)


def _show_traces(post: Postmortem) -> None:
    from slamreplay.report.trace_tables import trace_note, traces

    if post.trace_ns is None:
        return
    say()
    say(trace_note(post))
    for name, table in traces(post):
        say()
        say((name, "head"))
        say_table([table.head, *([cell.text for cell in row] for row in table.rows)], indent=2)
        if table.more:
            say((f"  {table.more} more in {table.more_in}", "quiet"))
    say()
