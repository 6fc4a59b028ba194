"""A committed baseline: what is kept, what is read, and which differences count."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.signal import lfilter

from slamreplay.bundle.manifest import Source
from slamreplay.consistency.answers import holm
from slamreplay.errors import UsageError
from slamreplay.gate.baseline import (
    ALL_LOGS,
    KeptLog,
    baseline_json,
    compare,
    failed_before,
    kept_log,
    read_baseline,
)
from slamreplay.gate.baseline_difference import (
    mean_over_time,
    over_logs,
    over_units,
    paired,
    samples_of_mean,
    unpaired,
)
from slamreplay.gate.baseline_kept import BLOCKS_MAX, block_width, blocks_of, identity_of
from slamreplay.gate.baseline_metrics import expected_nees, is_worse, margin_of
from slamreplay.gate.measures import Measure, Measures, Series
from slamreplay.gate.outcome import Outcome
from slamreplay.gate.rules import BaselineRules
from slamreplay.recipes.recipe import read_recipe

S = 1_000_000_000
RULES = BaselineRules()


def source(content="ab", name="run.mcap"):
    return Source(name=name, format="mcap", bytes=7, sha256=content * 32)


def remembering(rng, n, rho):
    noise = rng.standard_normal(n)
    noise[1:] *= np.sqrt(1.0 - rho**2)
    return lfilter([1.0], [1.0, -rho], noise)


def log(content="ab", blocks=None, *, state="healthy", values=None, seeds=None, failed=(), **more):
    over_time = {"error_m": np.asarray([0.1] * 60 if blocks is None else blocks), **more}
    return KeptLog(content * 16, 5, 60 * S, state, 1, over_time, values or {}, seeds or {}, failed)


def stored(tmp_path, logs):
    path = tmp_path / "baseline.json"
    path.write_text(baseline_json(logs), encoding="utf-8")
    return read_baseline(path)


def outcome(found, name, check):
    return next(o for o in found[name] if o.check == f"baseline/{check}")


# What is kept


def test_blocks_lie_on_a_grid_from_the_logs_start():
    t = np.array([10, 11, 12, 13, 16]) * S
    series = Series(t, np.array([1.0, 3.0, np.nan, 5.0, 7.0]), "m")
    blocks = blocks_of(series, start_ns=10 * S, width_s=2)
    np.testing.assert_array_equal(blocks, [2.0, 5.0, np.nan, 7.0])


@given(st.integers(1, 10**15))
def test_a_log_has_no_more_blocks_than_fit_into_a_baseline(duration):
    width = block_width(duration)
    assert duration <= width * BLOCKS_MAX * S
    assert width == 1 or duration > 0.3 * width * BLOCKS_MAX * S


def test_a_log_is_known_by_its_content_alone():
    measures = Measures(0, 60 * S, {})
    one = kept_log(measures, [source("ab", "a.db3"), source("cd", "b.db3")], "healthy")
    renamed = kept_log(measures, [source("cd", "x.db3"), source("ab", "y.db3")], "lost")
    other = kept_log(measures, [source("ab", "a.db3")], "healthy")
    assert one.identity == renamed.identity != other.identity


def test_what_is_kept_of_measures_is_small_and_comes_back_equal(tmp_path):
    rng = np.random.default_rng(0)
    t = np.arange(0, 600 * S, S // 10)
    names = ("error_m", "error_deg", "sigma_m", "nees", "changed_share", "match")
    units = {"error_m": "m", "error_deg": "deg", "sigma_m": "m"}
    series = {n: Series(t, rng.random(len(t)), units.get(n, "")) for n in names}
    series["nees"].values[: len(t) // 2] = np.nan
    values = {
        "error_max_m": Measure(1.0 / 3.0, "m"),
        "stops": Measure(3.0, ""),
        "amcl.error_max_m": Measure(np.inf, "m", of_seeds=(0.1, np.inf)),
    }
    failed = Outcome("limit/error_max_m", "", "failed", "error", "")
    old_one = Outcome("baseline/state", "", "failed", "error", "")
    kept = kept_log(Measures(0, 600 * S, values, series), [source()], "lost", [failed, old_one])
    text = baseline_json({"a.mcap": kept})
    assert text == baseline_json({"a.mcap": kept})
    assert len(text) < 6500  # all six numbers over time, at most blocks
    baseline = stored(tmp_path, {"a.mcap": kept})
    back = baseline.logs["a.mcap"]
    assert back.values == kept.values
    assert back.seeds == {"amcl.error_max_m": (0.1, np.inf)}
    for name in names:
        np.testing.assert_array_equal(back.over_time[name], kept.over_time[name])
    assert baseline_json(baseline.logs) == text
    assert failed_before(baseline, "a.mcap", [source()]) == {"limit/error_max_m"}


@pytest.mark.parametrize("name", ["a\nb.mcap", "half\udcff.mcap", "\x7f\x1b[31m", "\u2028 \u202e"])
def test_whatever_a_log_is_called_its_baseline_can_be_read(tmp_path, name):
    base = stored(tmp_path, {name: log(), "b": log("cd")})
    found = compare(base, {name: log("ef"), "b": log("cd")}, RULES)
    assert "another log" in outcome(found, name, "log").message
    assert "there it is" not in outcome(found, name, "log").message
    assert failed_before(base, name, [source("ef")]) == frozenset()


def test_numbers_however_large_are_read_and_compared(tmp_path):
    """A NEES of metres against a sigma of micrometres."""
    base = stored(tmp_path, {"a": log(nees=3e14 * (1.0 + noise(1)), values={"nees_mean": 3e14})})
    assert base.logs["a"].values == {"nees_mean": 3e14}
    most = 1e59 * (1.0 + noise(2))
    assert np.isfinite(unpaired(most, -most[::-1]).p_value)


# What is read


def written(tmp_path, change):
    content = json.loads(baseline_json({"a.mcap": log(values={"error_max_m": 0.2})}))
    change(content)
    path = tmp_path / "b.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def set_at(*keys, to):
    def change(content):
        for key in keys[:-1]:
            content = content[key]
        content[keys[-1]] = to

    return change


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (set_at("schema_version", to=2), "schema 2, this program reads 1"),
        (set_at("schema_version", to="1"), "schema '1'"),
        (lambda c: c.pop("schema_version"), "no 'schema_version'"),
        (set_at("units", "error_m", to="mm"), "error_m is in 'mm' there and in 'm' here"),
        (lambda c: c["units"].pop("error_m"), "'error_m' has no unit"),
        (set_at("logs", "a.mcap", "over_time", "error_m", to=[np.nan]), "NaN is no number"),
        (set_at("logs", "a.mcap", "over_time", "error_m", to=[1e300]), "logs.a.mcap.over_time"),
        (set_at("logs", "a.mcap", "over_time", "error_m", to=[0] * 2000), "at most 1000"),
        (set_at("logs", "a.mcap", "values", "error_max_m", to=True), "values.error_max_m"),
        (set_at("logs", "a.mcap", "identity", to="../etc"), "identity"),
        (set_at("logs", "a.mcap", "more", to=1), "a.mcap.more"),
        (set_at("logs", to=[]), "'logs'"),
        (set_at("logs", "\x1b[31m", to={}), "logs"),
    ],
)
def test_what_no_gate_wrote_is_refused_in_one_line(tmp_path, change, said):
    path = written(tmp_path, change)
    with pytest.raises(UsageError) as caught:
        read_baseline(path)
    line = str(caught.value)
    assert said in line
    assert str(path) in line
    assert "hint" in line
    assert "\x1b" not in line


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "not JSON"),
        ("[" * 100_000, "nested too deep"),
        ("9" * 10_000, "not JSON"),
        ("<<<<<<< HEAD\n{}", "not JSON"),
        ('{"schema_version": 1, "logs": {"a": 1, "a": 2}}', "given twice"),
        ("[1]", "not a baseline"),
        ('"schema_version"', "not a baseline"),
    ],
)
def test_text_that_is_no_baseline_is_refused(tmp_path, text, said):
    path = tmp_path / "b.json"
    path.write_text(text)
    with pytest.raises(UsageError, match=said):
        read_baseline(path)


def test_a_baseline_that_is_not_there_or_not_a_file_is_refused(tmp_path):
    with pytest.raises(UsageError, match="cannot read the baseline"):
        read_baseline(tmp_path / "none.json")
    with pytest.raises(UsageError, match="not a file"):
        read_baseline(tmp_path)


# The tests


def test_of_independent_differences_the_interval_and_p_are_nearly_those_of_students_test():
    rng = np.random.default_rng(11)
    old = rng.standard_normal(120)
    new = old + 0.3 + rng.standard_normal(120)
    ours, theirs = paired(old, new), stats.ttest_rel(new, old)
    interval = theirs.confidence_interval(0.95)
    assert ours.mean == pytest.approx(np.mean(new - old))
    assert ours.n_eff > 60
    assert np.log10(ours.p_value) == pytest.approx(np.log10(theirs.pvalue), abs=1.0)
    assert ours.high - ours.low == pytest.approx(interval.high - interval.low, rel=0.3)


def test_over_units_is_students_test_and_near_the_permutation_of_signs_and_wilcoxon():
    rng = np.random.default_rng(5)
    old = rng.random(12)
    new = old + 0.05 + 0.1 * rng.standard_normal(12)
    ours = over_units(old, new)
    assert ours.p_value == pytest.approx(stats.ttest_rel(new, old).pvalue)
    flipped = stats.permutation_test(
        (new - old,), np.mean, permutation_type="samples", n_resamples=np.inf
    )
    assert ours.p_value == pytest.approx(flipped.pvalue, rel=0.35)
    assert ours.p_value == pytest.approx(stats.wilcoxon(new - old).pvalue, rel=1.0)


def test_numbers_that_scatter_in_proportion_are_tested_by_their_ratios():
    rng = np.random.default_rng(6)
    old = 0.1 * np.exp(0.2 * rng.standard_normal(8))
    new = 3.0 * old * np.exp(0.3 * rng.standard_normal(8))
    new[2] *= 20.0  # one run went far astray
    ours = over_units(old, new, by_ratio=True)
    assert ours.p_value == pytest.approx(stats.ttest_rel(np.log(new), np.log(old)).pvalue)
    assert ours.p_value < over_units(old, new).p_value / 20
    assert ours.mean == pytest.approx(np.mean(new - old))
    zero = np.append(old[:-1], 0.0)
    assert over_units(zero, new, by_ratio=True) == over_units(zero, new)


def test_ratios_that_contradict_the_means_are_not_taken():
    """Five runs went a little worse and one, which is all of the mean, much better."""
    old, new = [1.0, 1.1, 0.9, 1.0, 1.05, 90.0], [1.3, 1.5, 1.2, 1.4, 1.3, 60.0]
    assert np.mean(np.log(new) - np.log(old)) > 0.0
    assert over_units(old, new, by_ratio=True) == over_units(old, new)


def test_logs_that_differ_by_more_than_their_errors_count_as_so_many():
    rng = np.random.default_rng(3)
    means = 0.5 + rng.standard_normal(8)
    each = [paired(np.zeros(60), m + 0.001 * remembering(rng, 60, 0.0)) for m in means]
    ours, units = over_logs(each), over_units(np.zeros(8), [d.new for d in each])
    assert ours.p_value == pytest.approx(units.p_value, rel=0.01)
    assert ours.p_value > 0.01


def test_unpaired_independent_blocks_are_nearly_welchs_test():
    rng = np.random.default_rng(7)
    old, new = rng.normal(0.0, 1.0, 100), rng.normal(0.6, 2.0, 120)
    ours, theirs = unpaired(old, new), stats.ttest_ind(new, old, equal_var=False)
    assert np.log10(ours.p_value) == pytest.approx(np.log10(theirs.pvalue), abs=1.0)


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_independent_samples_are_those_of_the_formula(rho):
    rng = np.random.default_rng(1)
    n = 400
    found = np.median([samples_of_mean(remembering(rng, n, rho)) for _ in range(60)])
    assert found == pytest.approx(n * (1.0 - rho) / (1.0 + rho), rel=0.35)


def samples(make):
    rng = np.random.default_rng(1)
    return float(np.median([samples_of_mean(make(rng)) for _ in range(40)]))


def test_a_short_series_underrates_its_own_correlation():
    k = np.arange(1, 40)
    true = 40.0 / (1.0 + 2.0 * np.sum((1.0 - k / 40.0) * 0.8**k))
    assert 0.7 * true < samples(lambda rng: remembering(rng, 40, 0.8)) <= true


def test_a_slow_part_under_white_noise_is_seen():
    """Neighbours say 277 of 400; a variance of 0.25 with 66 samples to one independent says 29."""
    found = samples(lambda rng: rng.standard_normal(400) + 0.5 * remembering(rng, 400, 0.97))
    assert 20.0 < found < 45.0


def test_bursts_do_not_hide_how_long_a_series_hangs_together():
    """Without them 11; sizes alone say 49."""

    def made(rng):
        return remembering(rng, 200, 0.9) * np.where(rng.random(200) < 0.1, 20.0, 1.0)

    assert samples(made) < 25.0


def test_a_cosine_takes_three_independent_samples():
    found = mean_over_time(remembering(np.random.default_rng(1), 200, 0.3))
    assert found.dof == int(found.n_eff / 3.0)


def test_the_level_is_kept_where_the_textbook_cries_wolf():
    """1000 logs without a difference; at 5 % the textbook accuses 63 % of slow ones."""
    rng = np.random.default_rng(2)
    ours = textbook = decided = 0
    for _ in range(1000):
        rho = rng.choice([0.0, 0.5, 0.8, 0.95])
        d = remembering(rng, 60, rho)
        found = paired(np.zeros(60), d)
        ours += found.p_value is not None and found.p_value < 0.05
        decided += found.enough
        textbook += stats.ttest_1samp(d, 0.0).pvalue < 0.05
    assert ours <= 45  # of 1000
    assert textbook > 300
    assert 250 < decided < 450


def test_a_difference_that_is_the_same_everywhere_is_no_accident():
    found = paired(np.full(30, 0.1), np.full(30, 0.15))
    assert found.p_value == 0.0
    assert found.mean == pytest.approx(0.05)
    assert mean_over_time([1.0, np.nan, 1.0]).error == 0.0


def test_nothing_is_said_of_too_few_samples():
    assert paired(np.zeros(10), np.random.default_rng(0).random(10)).p_value is None
    assert over_units([1.0] * 4, [2.0, 3.0, 2.0, 4.0]).p_value is None
    for empty in (paired([], []), unpaired([], []), over_units([], [])):
        assert (empty.n, empty.p_value, empty.enough) == (0, None, False)


# The comparison


def noise(seed, n=60, sigma=0.01, rho=0.3):
    return sigma * remembering(np.random.default_rng(seed), n, rho)


def test_the_same_run_twice_shows_no_difference(tmp_path):
    now = log(blocks=0.1 + noise(1), values={"stops": 2.0}, seeds={"amcl.error_max_m": (1.0,) * 6})
    logs = {f"{k}.mcap": now for k in range(3)}
    found = compare(stored(tmp_path, logs), logs, RULES)
    assert {o.status for outcomes in found.values() for o in outcomes} <= {"passed", "skipped"}
    assert outcome(found, "0.mcap", "error_mean_m").message.startswith("no difference: the same")
    assert outcome(found, "0.mcap", "amcl.error_max_m").status == "passed"
    assert outcome(found, "0.mcap", "log").message == "the same log: compared moment by moment"
    assert outcome(found, ALL_LOGS, "logs").status == "passed"


@pytest.mark.parametrize(("step", "status"), [(0.05, "failed"), (-0.05, "passed")])
def test_a_sure_difference_beyond_the_margin_fails_where_it_is_worse(tmp_path, step, status):
    old = log(blocks=0.1 + noise(1))
    new = log(blocks=0.1 + step + noise(2))
    found = outcome(compare(stored(tmp_path, {"a": old}), {"a": new}, RULES), "a", "error_mean_m")
    assert found.status == status
    assert ("worse" if status == "failed" else "better: commit") in found.message
    assert found.value == pytest.approx(step, abs=0.01)
    assert (found.limit, found.unit) == (0.02, "m")
    if status == "failed":
        assert 5 <= found.start_ns < found.end_ns <= 5 + 60 * S


def test_more_of_what_is_better_is_better(tmp_path):
    match = 0.7 + noise(1), 0.6 + noise(2)
    base = stored(tmp_path, {"a": log(match=match[0])})
    found = compare(base, {"a": log(match=match[1])}, RULES)
    assert outcome(found, "a", "match_mean").status == "failed"
    assert outcome(found, "a", "error_mean_m").status == "passed"


def test_a_difference_within_the_margin_passes_unless_the_recipe_says_otherwise(tmp_path):
    base = stored(tmp_path, {"a": log(blocks=0.1 + noise(1, sigma=0.001))})
    now = {"a": log(blocks=0.11 + noise(2, sigma=0.001))}
    found = outcome(compare(base, now, RULES), "a", "error_mean_m")
    assert (found.status, "within the margin" in found.message) == ("passed", True)
    strict = BaselineRules(margins={"error_mean_m": 0.005})
    assert outcome(compare(base, now, strict), "a", "error_mean_m").status == "failed"


def test_noise_passes(tmp_path):
    base = stored(tmp_path, {"a": log(blocks=0.1 + noise(1, sigma=0.1))})
    found = compare(base, {"a": log(blocks=0.1 + noise(2, sigma=0.1))}, RULES)
    assert "no difference that is sure" in outcome(found, "a", "error_mean_m").message


@pytest.mark.parametrize(
    ("size", "gross", "status"),
    [
        (0.3, 10.0, "skipped"),
        (1.0, 10.0, "failed"),
        (1.0, None, "skipped"),
        (-1.0, 10.0, "skipped"),
    ],
)
def test_what_happened_once_proves_nothing_unless_it_is_gross(tmp_path, size, gross, status):
    base = stored(tmp_path, {"a": log(blocks=0.1 + noise(1, sigma=0.001))})
    once = 0.1 + noise(1, sigma=0.001) + np.where(np.arange(60) > 30, size, 0.0)
    rules = BaselineRules(gross=gross)
    found = outcome(compare(base, {"a": log(blocks=once)}, rules), "a", "error_mean_m")
    assert found.status == status
    assert "60 blocks are worth" in found.message
    assert ("a fact of this log" in found.message) == (status == "failed")
    # Of another log it is no fact.
    found = outcome(compare(base, {"a": log("cd", blocks=once)}, rules), "a", "error_mean_m")
    assert found.status == "skipped"


def test_a_small_worsening_of_all_logs_is_found_that_none_shows_alone(tmp_path):
    old = {f"{k}": log(blocks=0.2 + noise(k, sigma=0.15)) for k in range(10)}
    worse = {f"{k}": log(blocks=0.26 + noise(50 + k, sigma=0.15)) for k in range(10)}
    found = compare(stored(tmp_path, old), worse, BaselineRules(gross=None))
    assert all(outcome(found, f"{k}", "error_mean_m").status != "failed" for k in range(10))
    assert outcome(found, ALL_LOGS, "error_mean_m").status == "failed"
    few = {name: worse[name] for name in "012"}
    found = compare(stored(tmp_path, {name: old[name] for name in few}), few, RULES)
    assert [o.check for o in found[ALL_LOGS]] == ["baseline/logs"]
    assert "5 are needed to judge them together" in found[ALL_LOGS][0].message


def test_over_logs_holds_its_level_and_finds_more_than_the_logs_alone():
    rng = np.random.default_rng(8)
    false = found = alone = 0
    for _ in range(300):
        rho = rng.choice([0.0, 0.5, 0.9])
        steps = [remembering(rng, 60, rho) for _ in range(6)]
        false += over_logs([paired(np.zeros(60), d) for d in steps]).p_value < 0.05
        moved = [paired(np.zeros(60), d + 0.5) for d in steps] if rho == 0.0 else []
        found += bool(moved) and over_logs(moved).p_value < 1e-4
        alone += bool(moved) and over_units([0.0] * 6, [m.mean for m in moved]).p_value < 1e-4
    assert false <= 20  # of 300
    assert alone < 0.6 * found


def test_a_change_of_the_verdict_counts_by_itself_on_the_same_log(tmp_path):
    base = stored(tmp_path, {"a": log()})
    assert outcome(compare(base, {"a": log(state="lost")}, RULES), "a", "state").status == "failed"
    base = stored(tmp_path, {"a": log(state="lost")})
    back = outcome(compare(base, {"a": log()}, RULES), "a", "state")
    assert (back.status, "better" in back.message) == ("passed", True)
    other = outcome(compare(base, {"a": log("cd")}, RULES), "a", "state")
    assert "of another log" in other.message


def test_logs_pair_by_content_when_renamed_and_not_at_all_when_recorded_anew(tmp_path):
    base = stored(tmp_path, {"old.mcap": log("ab"), "gone.mcap": log("ef")})
    found = compare(base, {"new.mcap": log("ab"), "fresh.mcap": log("cd")}, RULES)
    assert "there it is old.mcap" in outcome(found, "new.mcap", "log").message
    assert outcome(found, "fresh.mcap", "log").status == "skipped"
    everything = outcome(found, ALL_LOGS, "logs")
    assert everything.status == "skipped"
    assert "1 of the baseline not judged now: gone.mcap" in everything.message
    assert "1 not in the baseline: fresh.mcap" in everything.message
    anew = compare(base, {"old.mcap": log("cd", blocks=0.2 + noise(3))}, RULES)
    assert "another log" in outcome(anew, "old.mcap", "log").message
    assert outcome(anew, "old.mcap", "error_mean_m").status == "failed"


def test_what_failed_before_is_of_the_log_that_it_is_held_against(tmp_path):
    """A log that was renamed must clear its limit as well, and not that of its old name."""
    old = {"old.mcap": ("ab", "limit/a"), "new.mcap": ("ef", "limit/b")}
    logs = {
        name: replace(log(), identity=identity_of([source(content)]), failed=(check,))
        for name, (content, check) in old.items()
    }
    base = stored(tmp_path, logs)
    assert failed_before(base, "new.mcap", [source("ab")]) == {"limit/a"}
    assert failed_before(base, "new.mcap", [source("cd")]) == {"limit/b"}
    assert failed_before(base, "third.mcap", [source("cd")]) == frozenset()


def test_a_failure_is_shown_at_the_block_that_changed_most(tmp_path):
    base = stored(tmp_path, {"a": log(blocks=0.1 + noise(1))})
    worse = 0.2 + noise(2)
    worse[41] += 0.3
    worse[5] -= 0.5  # the other way
    found = outcome(compare(base, {"a": log(blocks=worse)}, RULES), "a", "error_mean_m")
    assert (found.status, found.start_ns, found.end_ns) == ("failed", 5 + 41 * S, 5 + 42 * S)


def test_blocks_that_one_side_has_alone_are_told(tmp_path):
    base = stored(tmp_path, {"a": log(blocks=0.1 + noise(1))})
    some = 0.1 + noise(2)
    some[:3] = np.nan
    found = outcome(compare(base, {"a": log(blocks=some[:55])}, RULES), "a", "error_mean_m")
    assert found.message.endswith("; 8 blocks have it on one side only")


def test_a_log_that_was_cut_otherwise_is_not_paired(tmp_path):
    base = stored(tmp_path, {"a": log(blocks=0.1 + noise(1))})
    cut = replace(log(blocks=0.1 + noise(1)), start_ns=5 + S)
    found = compare(base, {"a": cut}, RULES)
    assert "cut otherwise" in outcome(found, "a", "log").message
    assert not outcome(found, "a", "error_mean_m").message.startswith("no difference: the same")


def test_the_degrees_of_freedom_of_a_nees_are_told_by_its_factor():
    assert expected_nees({"nees_mean": 9.0, "nees_factor": 3.0**0.5}) == 3.0
    assert expected_nees({"nees_mean": 9.0, "nees_factor": 4.5**0.5}) == 2.0
    assert expected_nees({"nees_mean": 9.0}) is None


def test_seeds_pair_and_a_run_that_lost_all_poses_is_worse(tmp_path):
    drawn = tuple(0.3 + 0.02 * np.arange(8))
    base = stored(tmp_path, {"a": log(seeds={"amcl.error_max_m": drawn})})
    worse = tuple(d + 0.3 + 0.001 * k for k, d in enumerate(drawn))
    found = compare(base, {"a": log(seeds={"amcl.error_max_m": worse})}, RULES)
    assert outcome(found, "a", "amcl.error_max_m").status == "failed"
    lost = (np.inf, *drawn[1:])
    found = outcome(
        compare(base, {"a": log(seeds={"amcl.error_max_m": lost})}, RULES), "a", "amcl.error_max_m"
    )
    assert "without a single pose: 0 in the baseline, 1 now" in found.message
    assert found.status == "failed"


def test_a_number_that_is_no_longer_measured_is_told(tmp_path):
    base = stored(tmp_path, {"a": log(match=np.full(60, 0.5))})
    found = outcome(compare(base, {"a": log()}, RULES), "a", "match_mean")
    assert (found.status, "not measured now" in found.message) == ("skipped", True)


def test_p_values_are_corrected_over_all_tests_of_the_run(tmp_path):
    rng = np.random.default_rng(4)
    old = {f"{k:02}": log(blocks=rng.random(60)) for k in range(20)}
    new = {name: log(blocks=rng.random(60)) for name in old}
    new["07"] = log(blocks=old["07"].over_time["error_m"] + 0.3 + 0.5 * rng.random(60))
    found = compare(stored(tmp_path, old), new, RULES)
    p = [paired(old[n].over_time["error_m"], new[n].over_time["error_m"]).p_value for n in old]
    alone, corrected = p[7], holm(p)[7]
    message = outcome(found, "07", "error_mean_m").message
    assert f"p = {alone:.1g}" in message
    whole = over_logs([paired(old[n].over_time["error_m"], new[n].over_time["error_m"])
                       for n in old])  # fmt: skip
    assert f" {holm([*p, whole.p_value])[7]:.1g} after Holm over 21 tests" in message
    assert corrected > 10 * alone


def test_nees_is_worse_the_farther_it_is_from_its_degrees_of_freedom():
    assert is_worse("nees_mean", 3.0, 9.0, 3.0)
    assert is_worse("nees_mean", 3.0, 0.5, 3.0)
    assert not is_worse("nees_mean", 30.0, 3.0, 3.0)
    assert is_worse("match_mean", 0.8, 0.7)
    assert margin_of("nees_mean", 30.0, RULES) == pytest.approx(6.0)
    assert margin_of("amcl.error_max_m", 1.0, BaselineRules(margins={"amcl.error_max_m": 1})) == 1


@pytest.mark.parametrize(
    ("text", "gross"), [("{}", 10.0), ("{gross: 2}", 2.0), ("{gross: null}", None)]
)
def test_a_recipe_says_what_is_gross(tmp_path, text, gross):
    path = tmp_path / "gate.yaml"
    path.write_text(f"version: 1\nquestion: as before?\nlimits: {{jumps: 1}}\nbaseline: {text}\n")
    assert read_recipe(path).demands.baseline.gross == gross


@given(st.lists(st.floats(-1e6, 1e6), max_size=40), st.lists(st.floats(-1e6, 1e6), max_size=40))
def test_any_numbers_make_a_difference_without_a_warning(old, new):
    size = min(len(old), len(new))
    for found in (paired(old[:size], new[:size]), unpaired(old, new)):
        assert found.p_value is None or 0.0 <= found.p_value <= 1.0
        if size:
            assert np.isfinite(found.mean)
