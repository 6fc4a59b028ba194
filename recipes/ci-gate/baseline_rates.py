"""Make the tables of baseline.md anew: python baseline_rates.py [--logs N] [--runs N] [--seed S].

How often two runs of a log are told apart where there is no difference, and how often where there
is one: by the gate, by the textbook's paired t-test, and by eye (a mean that is 10 % worse).
"""

from __future__ import annotations

import argparse
from collections import Counter

import numpy as np
from scipy import stats
from scipy.signal import lfilter

from slamreplay.gate.baseline import ALL_LOGS, Baseline, KeptLog, compare
from slamreplay.gate.baseline_difference import paired, unpaired
from slamreplay.gate.baseline_metrics import MEAN_OF
from slamreplay.gate.rules import BaselineRules

BLOCKS = 100
RHO = (0.0, 0.5, 0.8, 0.9, 0.95, 0.99)
LEVELS = (0.05, 0.001)
#: Eight numbers of each log: six over time, two of an estimator over eight seeds.
#: Of those over time the scale beside errors in m: noise of each is two of its margins.
SERIES = {"error_m": 1.0, "error_deg": 25.0, "sigma_m": 1.0, "nees": 25.0, "changed_share": 0.5,
          "match": 1.0}  # fmt: skip
SEEDED = ("amcl.error_max_m", "amcl.error_rmse_m")
SEEDS, LOGS = 8, 10


def remembering(rng: np.random.Generator, rho: float, shape: tuple[int, ...]) -> np.ndarray:
    """AR(1) series of unit variance along the last axis."""
    noise = rng.standard_normal(shape)
    noise[..., 1:] *= np.sqrt(1.0 - rho**2)
    return np.asarray(lfilter([1.0], [1.0, -rho], noise))


def bursts(rng: np.random.Generator, rho: float, shape: tuple[int, ...]) -> np.ndarray:
    """The same, but the robot is far more wrong in some stretches than in others."""
    return remembering(rng, rho, shape) * np.abs(remembering(rng, 0.95, shape)) ** 1.5


def slow_under_white(rng: np.random.Generator, rho: float, shape: tuple[int, ...]) -> np.ndarray:
    """Of the variance 30 % remembers, 70 % does not."""
    slow, white = remembering(rng, rho, shape), rng.standard_normal(shape)
    return np.asarray(np.sqrt(0.3) * slow + np.sqrt(0.7) * white)


KINDS = {"AR(1)": remembering, "bursts": bursts, "30 % AR(1) under white noise": slow_under_white}


def two_runs(
    rng: np.random.Generator, kind: str, rho: float, logs: int, step: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Errors (logs, BLOCKS) in m of two runs of the same logs: the scene is shared, paths differ.

    A mean of 0.2 m, 0.08 m that both share, 0.04 m of their own.
    """
    shared = 0.2 + 0.08 * remembering(rng, 0.9, (logs, BLOCKS))
    old, new = (0.04 * KINDS[kind](rng, rho, (logs, BLOCKS)) for _ in range(2))
    return shared + old, shared + new + step


def false_alarms(logs: int, seed: int) -> None:
    """One number of one log, without a difference: alarms in percent of all logs."""
    print(f"False alarms of one number of one log, {BLOCKS} blocks, {logs} logs per row, percent\n")
    print("| noise | rho | n_eff | judged | 5 % | 0.1 % | textbook 5 % | textbook 0.1 % |"
          " by eye, 10 % |\n|---|---|---|---|---|---|---|---|---|")  # fmt: skip
    for kind in KINDS:
        for rho in RHO:
            rng = np.random.default_rng([seed, int(1000 * rho), len(kind)])
            old, new = two_runs(rng, kind, rho, logs)
            found = [paired(a, b) for a, b in zip(old, new, strict=True)]
            ours = np.array([np.nan if d.p_value is None else d.p_value for d in found])
            naive = stats.ttest_rel(new, old, axis=1).pvalue
            eye = (new.mean(axis=1) > 1.1 * old.mean(axis=1)).mean()
            cells = [np.median([d.n_eff for d in found]), 100 * np.isfinite(ours).mean()]
            told = [(ours < level).mean() for level in LEVELS]
            told += [(naive < level).mean() for level in LEVELS] + [eye]
            print(f"| {kind} | {rho:g} | {cells[0]:.0f} | {cells[1]:.0f} | "
                  + " | ".join(f"{100 * share:.2f}" for share in told) + " |")  # fmt: skip


def other_logs(logs: int, seed: int) -> None:
    """The same of two logs that share nothing: Welch's."""
    print("\nTwo different logs, compared by their means\n")
    print("| rho | judged | 5 % | 0.1 % | textbook 5 % |\n|---|---|---|---|---|")
    for rho in RHO:
        rng = np.random.default_rng([seed, 5, int(1000 * rho)])
        old, new = (0.2 + 0.08 * remembering(rng, rho, (logs, BLOCKS)) for _ in range(2))
        found = [unpaired(a, b).p_value for a, b in zip(old, new, strict=True)]
        ours = np.array([np.nan if p is None else p for p in found])
        naive = stats.ttest_ind(new, old, axis=1, equal_var=False).pvalue
        told = [np.isfinite(ours).mean(), *((ours < level).mean() for level in LEVELS)]
        told.append((naive < LEVELS[0]).mean())
        print(f"| {rho:g} | " + " | ".join(f"{100 * share:.2f}" for share in told) + " |")


def gate_run(rng: np.random.Generator, rho: float, step: float) -> tuple[dict, dict]:
    """Two runs of a gate over `LOGS` logs and eight numbers; `step` is added to the error in m."""
    olds, news, runs = {}, {}, {}
    for name in SERIES:
        runs[name] = two_runs(rng, "AR(1)", rho, LOGS, step if name == "error_m" else 0.0)
    for k in range(LOGS):
        sides = []
        for side in range(2):
            over_time = {name: scale * runs[name][side][k] for name, scale in SERIES.items()}
            seeds = {name: tuple(0.3 + 0.05 * rng.standard_normal(SEEDS)) for name in SEEDED}
            sides.append(KeptLog(f"{k:032x}", 0, BLOCKS * 10**9, "healthy", 1, over_time, {},
                                 seeds))  # fmt: skip
        olds[f"log {k}"], news[f"log {k}"] = sides
    return olds, news


def whole_runs(runs: int, seed: int) -> None:
    """A run of the gate over ten logs and eight numbers: how often anything fails."""
    margins = dict.fromkeys((*MEAN_OF.values(), *SEEDED), 0.0)
    print(f"\nRuns of a gate, {LOGS} logs by {len(SERIES) + len(SEEDED)} numbers, {runs} runs per"
          " row: runs with an alarm, % (margins 0, gross none; failed by default)\n")  # fmt: skip
    print("| rho | alpha 5 % | alpha 0.1 % | failed by default | textbook 5 % | textbook 0.1 %"
          " | by eye, 10 % |\n|---|---|---|---|---|---|---|")  # fmt: skip
    for rho in RHO:
        rng = np.random.default_rng([seed, 7, int(1000 * rho)])
        alarms: Counter[str] = Counter()
        for _ in range(runs):
            olds, news = gate_run(rng, rho, 0.0)
            for alpha in LEVELS:
                found = compare(Baseline("", olds), news, BaselineRules(alpha, margins, gross=None))
                told = [o for outcomes in found.values() for o in outcomes]
                # Better is as false as worse here.
                alarms[f"{alpha}"] += any("(margin" in o.message for o in told)
            found = compare(Baseline("", olds), news, BaselineRules())
            alarms["defaults"] += any(o.status == "failed" for told in found.values() for o in told)
            before, after = (
                np.array([[log.over_time[name] for name in SERIES] for log in logs.values()])
                for logs in (olds, news)
            )
            naive = stats.ttest_rel(after, before, axis=2).pvalue
            for alpha in LEVELS:
                alarms[f"naive {alpha}"] += bool(naive.min() < alpha)
            alarms["eye"] += bool((after.mean(axis=2) > 1.1 * before.mean(axis=2)).any())
        keys = [*(f"{a}" for a in LEVELS), "defaults", *(f"naive {a}" for a in LEVELS), "eye"]
        print(f"| {rho:g} | " + " | ".join(f"{100 * alarms[k] / runs:.1f}" for k in keys) + " |")


def power(runs: int, seed: int) -> None:
    """The same runs where every log's error is worse by a step: what is found at alpha 0.1 %."""
    print(f"\nThe error of all {LOGS} logs worse by a step, {runs} runs per row, alpha 0.1 %,"
          " margin 0.02 m, mean error 0.2 m: found, percent\n")  # fmt: skip
    print("| step | rho | in a log, gross or sure | over all logs | by eye, 10 %, in a log |"
          "\n|---|---|---|---|---|")  # fmt: skip
    for step in (0.01, 0.03, 0.05, 0.1):
        for rho in (0.0, 0.5, 0.8, 0.95):
            rng = np.random.default_rng([seed, 11, int(1000 * rho), int(1000 * step)])
            single = everywhere = eye = 0
            for _ in range(runs):
                olds, news = gate_run(rng, rho, step)
                found = compare(Baseline("", olds), news, BaselineRules())
                failed = Counter(
                    name
                    for name, outcomes in found.items()
                    for o in outcomes
                    if o.check == "baseline/error_mean_m" and o.status == "failed"
                )
                everywhere += failed.pop(ALL_LOGS, 0)
                single += sum(failed.values())
                eye += sum(
                    news[n].over_time["error_m"].mean() > 1.1 * olds[n].over_time["error_m"].mean()
                    for n in olds
                )
            cells = [single / LOGS, everywhere, eye / LOGS]
            print(f"| {step:g} m | {rho:g} | "
                  + " | ".join(f"{100 * c / runs:.0f}" for c in cells) + " |")  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--logs", type=int, default=5000)
    parser.add_argument("--runs", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    false_alarms(asked.logs, asked.seed)
    other_logs(asked.logs // 2, asked.seed)
    whole_runs(asked.runs, asked.seed)
    power(max(1, asked.runs // 5), asked.seed)
