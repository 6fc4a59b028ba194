"""The answer in ten lines says what the report says, whatever the log had and lacked."""

from dataclasses import replace
from pathlib import Path

import pytest

from slamreplay.bundle.findings import Finding
from slamreplay.bundle.products import ChangedRegion
from slamreplay.cli.summary import show_summary
from slamreplay.postmortem import postmortem
from slamreplay.report.facts import deciding_facts
from slamreplay.report.summary import summary_lines, summary_text
from slamreplay.rootcause.result import Candidate, RootCause
from slamreplay.testing.synthetic import START_NS, synthetic_bundle
from slamreplay.verdict.judgement import STATES, FailureMode, Interval, Stop

S = 1_000_000_000


@pytest.fixture(scope="module")
def post():
    bundle = synthetic_bundle(seconds=6.0, belief_offset_xyyaw=(1.5, 0.5, 0.1))
    return postmortem(bundle, [], cause=False)


@pytest.fixture
def lines(post):
    def of(**changed):
        return {line.label: line for line in summary_lines(replace(post, **changed))}

    return of


def test_ten_lines_the_verdict_first(post):
    first, second, *rest = summary_lines(post)

    assert (first.label, first.tone) == ("lost", "bad")
    assert "confidence" in first.text
    assert second.text == post.judgement.summary
    assert len(rest) == 8
    assert summary_text(post).splitlines()[0] == f"lost: {first.text}"
    assert len(summary_text(post).splitlines()) == 10


@pytest.mark.parametrize("columns", ["", "30"])
def test_the_terminal_ends_with_the_path_alone_however_narrow(post, columns, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", columns)
    page = Path("a folder with a long name, and another one in it") / "report.html"

    show_summary(post, page)
    lines = capsys.readouterr().out.splitlines()

    assert lines[0].startswith("lost (")
    assert lines[-1] == str(page)
    assert any(line.startswith("! belief ") for line in lines)
    if columns:
        assert max(map(len, lines[:-1])) <= 30
    else:
        assert len([line for line in lines if not line.startswith("  jumps")]) == 10 + 1


def test_the_three_facts_are_the_pages(post, lines):
    for label, fact in zip(("belief", "beams", "hindsight"), deciding_facts(post), strict=True):
        line = lines()[label]
        assert line.text.startswith(f"{fact.number} {fact.label}")
        assert (line.tone == "bad") == fact.alarming


def test_facts_without_a_number_are_told_by_what_is_lacking(post, lines):
    bare = lines(belief=None, hindsight=None)
    nowhere = lines(hindsight=replace(post.hindsight, coverage=0.0, sigma_m=float("nan")))

    assert bare["belief"].text.startswith("no belief: no localizer spoke")
    assert bare["hindsight"].text.startswith("none: it needs ")
    assert nowhere["hindsight"].text == "unknown: 0 % of the scans have a place in the map"


def test_without_a_belief_no_state_says_that_it_was_right(post, lines):
    for state in STATES:
        judgement = replace(post.judgement, state=state)
        told = lines(judgement=judgement, belief=None)[state].text

        assert "knew where" not in told
        assert "was right" not in told


@pytest.mark.parametrize("state", STATES)
def test_every_state_has_its_words(post, lines, state):
    first = next(iter(lines(judgement=replace(post.judgement, state=state)).values()))

    assert first.label == state
    assert first.text


def test_when_names_stretches_stops_and_the_length(post, lines):
    at = [START_NS + k * S for k in range(7)]
    judgement = replace(
        post.judgement,
        intervals=(
            Interval("healthy", at[0], at[1]),
            Interval("lost", at[1], at[2]),
            Interval("map_changed", at[2], at[3]),
            Interval("lost", at[3], at[4]),
        ),
        stops=tuple(Stop(t, None, None, "lost", "it was lost") for t in at[1:6]),
    )

    text = lines(judgement=judgement, jumps=())["when"].text

    assert text.startswith("robot lost 1.0 to 2.0 s, 3.0 to 4.0 s; map changed 2.0 to 3.0 s; ")
    assert "stopped at 1.0 s, 2.0 s, 3.0 s and 2 more (of " in text


def test_root_cause_says_what_reproduces_it_and_where_it_differs_from_the_mode(post, lines):
    found = Candidate("odometry_slip", "odometry_slip.window", 1.0, "m", None, -1.0, 0.9, "slipped")
    cause = RootCause(START_NS, START_NS + S, "odometry_slip", 0.9, (found,), 12)
    slip = replace(post.judgement, failure_mode=FailureMode("odometry_slip", 0.9, ()))
    carried = replace(post.judgement, failure_mode=FailureMode("kidnapped", 0.9, ()))

    same = lines(judgement=slip, root_cause=cause)["cause"].text
    other = lines(judgement=carried, root_cause=cause)["cause"].text

    assert same == "odometry slip, 90 %, by 12 replays: slipped"
    assert other == f"began as robot carried away; root cause {same}"
    untried = replace(cause, trials=0, candidates=())
    assert lines(judgement=slip, root_cause=untried)["cause"].text == "odometry slip, 90 %"


def test_map_says_where_the_largest_region_is(post, lines):
    regions = tuple(
        ChangedRegion("appeared", (x, 1.0, x + 1.0, 2.0), area, START_NS, START_NS + S, 9, 0.9)
        for x, area in ((1.0, 0.4), (5.0, 1.2))
    )
    changes = replace(post.hindsight.changes, regions=regions)

    text = lines(hindsight=replace(post.hindsight, changes=changes))["map"].text

    assert text.startswith("2 regions, 1.6 m² in all; the largest, 1.2 m², appeared at x 5.5 m")
    assert lines(hindsight=None)["map"].text.startswith("not compared")
    assert lines(grid=None)["map"].text == "none to hold it against"


def test_findings_are_counted_and_the_worst_named_once_by_id(lines):
    worry = Finding("SR-LOC-001", "error", "off")
    hint = Finding("OTHER-7", "warning", "of somebody else's check")

    line = lines(findings=(Finding("SR-CLK-007", "info", "x"), hint, worry, worry))["findings"]

    assert (
        line.text == "2 errors, 1 warning, 1 info: SR-LOC-001 The robot was lost; OTHER-7 OTHER-7"
    )
    assert line.tone == "bad"


def test_missing_parts_and_what_they_leave_open(post, lines):
    bare = synthetic_bundle(seconds=6.0, with_map=False)
    judgement = replace(post.judgement, lacking=("no wheels: slips cannot be told",))

    text = lines(manifest=bare.manifest, judgement=judgement)["missing"].text

    assert text.startswith(", ".join(bare.manifest.missing_parts()))
    assert text.endswith("no wheels: slips cannot be told")
