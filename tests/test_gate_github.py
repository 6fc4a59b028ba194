"""Annotations and step summary, read as GitHub's runner and a Markdown parser read them."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import gated
import pytest
from ci_rules import commands
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from slamreplay.gate.github import annotations, artifacts_of, commands_stopped
from slamreplay.gate.sarif import sarif_text
from slamreplay.gate.step_summary import MOST_BYTES, step_summary


def test_one_annotation_for_each_check_worst_first():
    taken = commands(annotations(gated.mixed()))

    assert [(kind, given["file"], message) for kind, given, message in taken] == [
        ("error", "logs/e.bag", "not a log: it ends after 12 bytes"),
        ("error", "logs/b c.mcap", "The robot was lost for 12.0 s."),
        ("warning", "logs/b c.mcap", "0.61 m, for 3.0 s"),
    ]
    assert taken[1][1]["title"] == "forbid/SR-LOC-001: what forbid/SR-LOC-001 demands"
    assert annotations(gated.result(gated.log("a", gated.outcome(status="passed")))) == ""


def test_logs_that_fail_alike_share_one_on_the_recipe():
    logs = [gated.log(f"l/{k}", gated.outcome(message=f"found {k}")) for k in range(7)]

    ((kind, given, message),) = commands(annotations(gated.result(*logs)))

    assert (kind, given["file"]) == ("error", "ci/gate.yaml")
    assert given["title"].endswith("(7 logs of 7)")
    assert message.split("\n") == [*(f"l/{k}: found {k}" for k in range(5)), "and 2 more"]


def test_checks_that_fail_on_most_logs_come_first_among_equals():
    a, b, c = (gated.outcome(f"limit/{name}") for name in "abc")
    grave = [a, b, gated.outcome("limit/d", severity="warning")]
    made = gated.result(
        gated.log("l/0", *grave), gated.log("l/1", *grave[1:]), gated.log("l/2", *grave[2:], c),
        gated.log("l/3", gated.outcome("read", "error")),
    )  # fmt: skip

    taken = [given["title"].split(":")[0] for _, given, _ in commands(annotations(made))]
    rows = [row.split("what")[0].strip() for row in rendered(step_summary(made))["tr"][1:6]]

    assert taken == rows == ["read", "limit/b", "limit/a", "limit/c", "limit/d"]


@pytest.mark.parametrize(("severity", "kind"), [("error", "error"), ("info", "notice")])
def test_a_last_one_counts_what_was_left_out(severity, kind):
    made = gated.result(*(
        gated.log(f"l/{k}", *(gated.outcome(f"limit/{j}", severity=severity) for j in range(12)))
        for k in range(3)
    ))  # fmt: skip

    taken = commands(annotations(made))

    kept = 10 if kind == "error" else 9
    assert [x[0] for x in taken] == [kind] * kept + ["notice"]
    assert taken[-1][2].startswith(f"{12 - kept} more failures of a check, on 3 logs, are not")


def test_texts_of_a_log_make_no_other_command():
    taken = commands(annotations(gated.hostile()))

    assert {kind for kind, _, _ in taken} == {"error"}
    alone = gated.result(gated.log("a,b:c%0A::d", gated.outcome(message=gated.HOSTILE[10])))
    ((_, given, message),) = commands(annotations(alone))
    assert given["file"] == "a,b:c%0A::d"
    assert message == gated.HOSTILE[10]


@given(st.text(st.characters(exclude_categories=()), max_size=30))
def test_any_text_is_one_command_and_one_row(text):
    made = gated.result(gated.log(text, gated.outcome(message=text, title=text), summary=text))

    assert len(commands(annotations(made))) == 1
    told = rendered(step_summary(made))
    assert len(told["tr"]) == 4  # two heads, a check and a log


def test_commands_are_stopped_while_other_output_is_written():
    lines = []
    with commands_stopped(lines.append):
        lines.append("::error::of a log")

    token = re.fullmatch(r"::stop-commands::(\w{32})\n", lines[0])[1]
    assert lines[1:] == ["::error::of a log", f"::{token}::\n"]


class _Told(HTMLParser):
    def __init__(self):
        super().__init__()
        self.tags: dict[str, list[str]] = {"tr": []}
        self.links: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.tags.setdefault(tag, []).append("")
        self.links += [value for key, value in attrs if key in ("href", "src")]

    def handle_data(self, data):
        if self.tags["tr"]:
            self.tags["tr"][-1] += data


def rendered(text):
    """Tags of the Markdown's HTML; only those that the summary makes itself may be there."""
    parser = MarkdownIt("gfm-like", {"linkify": False, "html": True})
    told = _Told()
    told.feed(parser.render(text))
    ours = {
        "h2",
        "h3",
        "p",
        "table",
        "thead",
        "tbody",
        "tr",
        "th",
        "td",
        "br",
        "a",
        "details",
        "summary",
    }
    assert set(told.tags) <= ours
    for link in told.links:
        assert re.fullmatch(r"[\w/.%~-]*/report\.html", link), link
    return told.tags


def test_summary_tells_what_failed_then_every_log_worst_first():
    text = step_summary(gated.mixed())

    assert text == step_summary(gated.mixed())
    rows = [re.sub(r"\s+", " ", row).strip() for row in rendered(text)["tr"]]
    assert text.startswith("## Gate: could not read every log\n")
    assert "Of 4 logs: 1 could not be read, 1 failed, 1 not assessable, 1 passed." in text
    assert rows[1].startswith("readwhat read demands error 1 of 4 not a log")
    assert rows[5].startswith(
        "logs/e.bag could not be read what read demands: not a log: it ends after 12 bytes"
    )
    assert rows[6].startswith("./logs/b c.mcap failed")
    assert [row.split()[0] for row in rows[8:]] == ["logs/d", "logs/a.mcap"]
    assert rows[8].endswith("not assessable: what forbid/SR-LOC-001 demands: no map")
    assert "(reports/b%20c/report.html)" in text


def test_reports_that_cannot_be_reached_are_not_linked():
    run = {"GITHUB_SERVER_URL": "https://h", "GITHUB_REPOSITORY": "o/r", "GITHUB_RUN_ID": "1"}

    text = step_summary(gated.mixed(), artifacts=artifacts_of(run))

    assert "report.html" not in text
    assert "(https://h/o/r/actions/runs/1#artifacts)" in text
    assert artifacts_of({**run, "GITHUB_RUN_ID": ""}) is None


def test_texts_of_a_log_are_no_markup():
    text = step_summary(gated.hostile())

    rendered(text)
    assert "\u202e" not in text
    assert len(text.encode()) <= MOST_BYTES
    address = gated.outcome(message="see https://a.example or www.a.example")
    text = step_summary(gated.result(gated.log("a", address)))
    assert "https\\://a.example or www\\.a.example" in text  # GitHub makes links of the rest


def test_what_does_not_fit_is_counted():
    made = gated.result(*(
        gated.log(f"logs/{k:05d}", *(gated.outcome(message="é" * 200) for _ in range(3)))
        for k in range(10_000)
    ))  # fmt: skip

    text = step_summary(made)

    assert len(text.encode()) <= MOST_BYTES < 1 << 20
    left_out = int(re.search(r"^(\d+) more logs are left out here", text, re.MULTILINE)[1])
    assert text.count("logs/0") + left_out == 10_000
    assert annotations(gated.many()).count("\n") == 3


def test_many_checks_leave_room_for_logs():
    made = gated.result(gated.log("logs/0", *(
        gated.outcome(f"limit/{k}", message="x" * 250) for k in range(5_000)
    )))  # fmt: skip

    text = step_summary(made)

    assert len(text.encode()) <= MOST_BYTES
    assert "more checks are left out here" in text
    assert "| logs/0 | failed |" in text


def test_logs_that_are_well_are_folded():
    made = gated.result(*(gated.log(f"l/{k}", gated.outcome(status="passed")) for k in range(25)))

    assert "\n### Logs\n\n<details><summary>25 logs</summary>" in step_summary(made)
    assert step_summary(made).startswith("## Gate: passed\n")


def test_all_logs_together_are_none_of_the_logs():
    check = "baseline/error_mean_m"
    logs = [gated.log(name, gated.outcome(check)) for name in ("a.mcap", "b.mcap")]
    whole = gated.log("baseline.json", gated.outcome(check), state=None, start_ns=None)
    found = gated.result(*logs, whole)
    assert "(2 logs of 2)" in annotations(found)
    shown = step_summary(found)
    assert "Of 2 logs: 2 failed." in shown
    assert "| 2 of 2 |" in shown
    assert "| all together |" in step_summary(gated.result(gated.log("a.mcap"), whole))
    skipped = gated.outcome("baseline/logs", "skipped", "1 not judged now")
    left = replace(whole, outcomes=(skipped,))
    (run,) = json.loads(sarif_text(gated.result(*logs, left)))["runs"]
    assert run["properties"]["logs"] == {"failed": 2}
    notes = [n["message"]["text"] for n in run["invocations"][0]["toolExecutionNotifications"]]
    assert notes == ["Not assessable: 1 not judged now"]
