"""Results of gates made by hand, and texts that a log may hold to break a CI's files."""

from slamreplay.gate.outcome import GatedLog, GateResult, Outcome

#: One of each kind that has broken some file or terminal.
HOSTILE = (
    "first\n::set-output name=x::y",
    "::error::forged",
    "##[add-mask]x",
    "a\r::add-mask::b\x85::stop-commands::c\u2028::d",
    "]]><!-- &amp; <b>\"'</b> -->",
    "\x00\x01\x1b[31mred\x7f\ufffe\uffff",
    "half of a pair \ud83d and \udcff",
    "whole pairs \U0001f916\U0010ffff",
    "turned \u202egnp.exe\u2066",
    "| a cell | <script>alert(1)</script> | [x](javascript:y) ![i](http://h/i.png) `c` ~~s~~",
    "{0} {name} [here](1) 100%25 %0A, a:b",
    "x" * 1_000_000,
    "\n" * 5_000,
    "",
)


def outcome(check="limit/error_max_m", status="failed", message="0.61 m", **values) -> Outcome:
    given = {"title": f"what {check} demands", "severity": "error", **values}
    return Outcome(check=check, status=status, message=message, **given)


def log(name, *outcomes, **values) -> GatedLog:
    given = {"state": "lost", "summary": "The robot was lost.", "start_ns": 10**18, **values}
    return GatedLog(log=name, outcomes=tuple(outcomes), **given)


def result(*logs) -> GateResult:
    return GateResult("Does every log fare as it must?", "ci/gate.yaml", tuple(logs))


def mixed() -> GateResult:
    """A log of each kind: passed, failed in two ways, not assessable, not readable."""
    return result(
        log(
            "logs/a.mcap",
            outcome("limit/error_max_m", "passed", "0.21 m", value=0.21, limit=0.5, unit="m"),
            outcome("forbid/SR-LOC-001", "passed", "not found"),
            state="tracked", summary="The robot knew where it was.", report="reports/a",
        ),
        log(
            "./logs/b c.mcap",
            outcome("limit/error_max_m", "failed", "0.61 m, for 3.0 s", severity="warning",
                    start_ns=10**18 + 12_000_000_000, end_ns=10**18 + 15_500_000_000,
                    value=0.61, limit=0.5, unit="m"),
            outcome("forbid/SR-LOC-001", "failed", "The robot was lost for 12.0 s."),
            outcome("baseline/error_mean_m", "skipped", "no baseline of this log"),
            report="reports/b c",
        ),
        log("logs/d", outcome("forbid/SR-LOC-001", "skipped", "no map"), state="insufficient_data"),
        log("logs/e.bag", outcome("read", "error", "not a log: it ends after 12 bytes"),
            state=None, summary="it ends after 12 bytes", start_ns=None),
    )  # fmt: skip


def many(count=30_000, checks=3) -> GateResult:
    """A log for every `checks` failures, the severities in turn."""
    severities = ("info", "warning", "error")
    return result(
        *(
            log(
                f"logs/{number:05d}.mcap",
                *(
                    outcome(f"limit/metric_{k}", severity=severities[k % 3], value=1.5, limit=1.0)
                    for k in range(checks)
                ),
            )
            for number in range(count // checks)
        )
    )


def hostile() -> GateResult:
    """Every text that a log can reach is one of these."""
    return result(
        *(
            log(
                f"logs/{text[:300]}",
                outcome(
                    "limit/a", message=text, title=text[:300], unit=text[:9], value=1.0, limit=0.5
                ),
                outcome("limit/a", message=text, title=text[:300]),
                outcome("forbid/SR-*", "skipped", text),
                outcome("severity", "passed", text),
                summary=text,
                state=text[:99],
                report=f"reports/{text[:99]}",
            )
            for text in HOSTILE
        ),
        log("logs/x", outcome("read", "error", HOSTILE[0]), summary=HOSTILE[0], start_ns=None),
    )
