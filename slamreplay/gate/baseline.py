"""Do logs fare as they did? Each against the baseline that was committed, and all together.

A difference counts where it is no noise, after Holm's correction over all tests of the run, and
where it is beyond a margin that matters. A worse one fails; a better one passes and asks for a new
baseline. Tests that cannot say anything (all is identical, or there is too little) do not count
among those that are corrected for: they could accuse nobody (Tarone 1990, Biometrics 46, 515-522).
"""

from __future__ import annotations

from collections.abc import Mapping

from slamreplay.consistency.answers import holm
from slamreplay.gate.baseline_difference import UNITS_MIN
from slamreplay.gate.baseline_file import Baseline, baseline_json, kept_name, read_baseline
from slamreplay.gate.baseline_kept import KeptLog, kept_log
from slamreplay.gate.baseline_pairs import failed_before, match_of, of_all, of_log
from slamreplay.gate.baseline_words import of_comparison, of_logs, of_match, of_state
from slamreplay.gate.outcome import Outcome
from slamreplay.gate.rules import BaselineRules

__all__ = [
    "ALL_LOGS",
    "Baseline",
    "KeptLog",
    "baseline_json",
    "compare",
    "failed_before",
    "kept_log",
    "read_baseline",
]

#: The name under which stands what holds of all logs together.
ALL_LOGS = "all logs"


def compare(
    baseline: Baseline, logs: Mapping[str, KeptLog], rules: BaselineRules
) -> dict[str, tuple[Outcome, ...]]:
    """Outcomes by log, and under `ALL_LOGS` those of all together.

    A log is held against the one of its name, or else of its content. Where the content is the
    same, blocks of the same moments are paired; else the two means are compared, each with its own
    uncertainty. Checks: `baseline/log` whether there was anything to hold it against,
    `baseline/state`, `baseline/METRIC` for means over time and numbers over seeds; of all logs
    together `baseline/logs` and, of `UNITS_MIN` logs or more, `baseline/METRIC`.

    Args:
        baseline: of an earlier run.
        logs: by name, as they are now; those that could not be read are left out.
        rules: from where on a difference counts.
    """
    matches = {
        name: match
        for name, log in logs.items()
        if (match := match_of(baseline, name, log)) is not None
    }
    found = [(name, one) for name, match in matches.items() for one in of_log(match)]
    if len(matches) >= UNITS_MIN:
        found += [(ALL_LOGS, one) for one in of_all([*matches.values()], [one for _, one in found])]
    tested = [p for _, one in found if (p := one.p_value) is not None]
    adjusted = iter(holm(tested).tolist())
    out: dict[str, list[Outcome]] = {}
    for name, log in logs.items():
        match = matches.get(name)
        if match is None:
            out[name] = [of_match(log, None, name, name)]
        else:
            held = of_match(log, match.old, kept_name(name), match.old_name)
            out[name] = [held, of_state(match.old, log)]
    gone = sorted(set(baseline.logs) - {match.old_name for match in matches.values()})
    fresh = [name for name in logs if name not in matches]
    out[ALL_LOGS] = [of_logs(len(matches), gone, fresh)]
    for name, one in found:
        corrected = None if one.p_value is None else next(adjusted)
        out[name].append(of_comparison(one, corrected, len(tested), rules))
    return {name: tuple(outcomes) for name, outcomes in out.items()}
