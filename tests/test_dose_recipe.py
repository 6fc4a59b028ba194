"""The file of a design on a log: what it may say, and one clear line for everything else."""

import pytest

from slamreplay.doses.plan import LADDER, of_levels, of_search
from slamreplay.errors import UsageError
from slamreplay.recipes import DoseRecipe, read_recipe

TEXT = """\
version: 1
question: Which of three classic disturbances breaks this localizer first?
seed: 1
seeds: 5
scenario: {name: healthy, seed: 3}
estimators: [amcl, pose_graph]
limits:
  lost_s: 5
  error_max_m: 0.5
perturbations:
  - {name: tf_delay, levels_s: [0.4, 0.05, 0.1, 0.2]}
  - {name: scan_drop.random, search_ratio: {from: 0.0, to: 0.99, tolerance: 0.02}}
  - {name: initial_pose.offset, search_m: {from: 0.1, to: 20.0, tolerance: 0.1}}
  - {name: odometry_scale.rotation, levels_ratio: [0.5, 0.9]}
  - {name: odometry_scale.rotation, levels_ratio: [1.5, 1.1]}
positive_control: {name: initial_pose.offset, level_m: 20.0}
"""


def read(path, text):
    (path / "recipe.yaml").write_text(text, encoding="utf-8")
    return read_recipe(path / "recipe.yaml")


def test_a_design_is_read(tmp_path):
    recipe = read(tmp_path, TEXT)

    assert isinstance(recipe, DoseRecipe)
    assert recipe.scenario == ("healthy", 3)
    plan = recipe.plan
    assert plan.seeds == (1, 2, 3, 4, 5)
    assert plan.estimators == ("amcl", "pose_graph")
    assert [limit.title for limit in plan.limits] == [
        "lost for more than 5 s", "greatest error above 0.5 m",
    ]  # fmt: skip
    assert [axis.levels for axis in plan.axes] == [
        (0.05, 0.1, 0.2, 0.4),
        (0.198, 0.396, 0.594, 0.792, 0.99),
        (0.1, 0.376, 1.41, 5.32, 20.0),
        (0.9, 0.5),
        (1.1, 1.5),
    ]
    assert plan.axes[0].perturbation == "tf_delay.odometry"
    assert [axis.tolerance for axis in plan.axes] == [None, 0.02, 0.1, None, None]
    assert plan.positive_control.level == 20.0


def test_scenario_and_control_may_be_left_out(tmp_path):
    lines = [line for line in TEXT.splitlines() if line.split(":")[0] not in
             ("scenario", "positive_control")]  # fmt: skip

    recipe = read(tmp_path, "\n".join(lines))

    assert recipe.scenario is None
    assert recipe.plan.positive_control is None


def test_a_search_goes_by_factors_only_over_a_decade():
    near, far = of_search("tf_delay", 0.1, 0.5, 0.01), of_search("tf_delay", 0.05, 0.5, 0.01)

    assert (near.by_factor, far.by_factor) == (False, True)
    assert near.levels == (0.1, 0.2, 0.3, 0.4, 0.5)
    assert [a.levels[-1] for a in (near, far)] == [0.5, 0.5]
    assert len(far.levels) == LADDER


def test_a_search_below_the_baseline_goes_down():
    axis = of_search("odometry_scale.translation", 1.0, 0.5, 0.05)

    assert axis.levels == (0.9, 0.8, 0.7, 0.6, 0.5)
    assert axis.side == -1
    assert axis.most_halvings == 1


HOSTILE = {
    "another unit": ("levels_s", "levels_m", "is in s (hint: write levels_s)"),
    "unit missing": ("levels_s", "levels", "did you mean 'levels_s'?"),
    "another unit of a search": ("search_ratio", "search_deg", "write search_ratio"),
    "both": ("levels_s: [", "search_s: {from: 0, to: 1, tolerance: 1}, levels_s: [", "has both"),
    "neither": (", levels_s: [0.4, 0.05, 0.1, 0.2]", "", "write levels_s or search_s"),
    "no levels": ("[0.4, 0.05, 0.1, 0.2]", "[]", "at least 1 item"),
    "many levels": ("[0.4,", f"[{'0.3, ' * 200}", "at most 100 items"),
    "nan": ("[0.4,", "[.nan,", "'perturbations.0.levels_s.0' is nan"),
    "infinite": ("[0.4,", "[.inf,", "finite"),
    "huge": ("[0.4,", "[1e300,", "is not in 0 to 60 s"),
    "truth": ("[0.4,", "[true,", "is True"),
    "out of range": ("to: 0.99", "to: 1.5", "is not in 0 to 0.999 ratio"),
    "baseline": ("[0.4,", "[0.0,", "level 0 of tf_delay.odometry is its baseline"),
    "twice": ("[0.4,", "[0.2,", "a level of tf_delay.odometry is given twice"),
    "both sides": ("[0.5, 0.9]", "[0.5, 1.2]", "give it twice, once for each side"),
    "perturbation twice": ("scan_drop.random, search_ratio", "tf_delay, search_s",
                           "names tf_delay.odometry twice"),
    "search to nowhere": ("{from: 0.0,", "{from: 0.99,", "does not lead away from its baseline"),
    "search across": ("levels_ratio: [0.5, 0.9]",
                      "search_ratio: {from: 0.5, to: 1.5, tolerance: 0.1}", "does not lead away"),
    "search key": ("tolerance: 0.02", "tolerence: 0.02", "did you mean 'tolerance'?"),
    "search alias": ("{from: 0.0,", "{form: 0.0,", "did you mean 'from'?"),
    "search python name": ("{from: 0.0,", "{first: 0.0,", "search_ratio.first'"),
    "fine": ("tolerance: 0.02", "tolerance: 1e-9", "is the least"),
    "finest": ("tolerance: 0.02", "tolerance: 5e-324", "is the least"),
    "no tolerance": ("tolerance: 0.02", "tolerance: 0", "greater than 0"),
    "perturbation": ("tf_delay,", "tf_dely,", "did you mean 'tf_delay'?"),
    "variant": ("scan_drop.random", "scan_drop.randm", "did you mean 'scan_drop.random'?"),
    "module": ("tf_delay,", "os:system,", "there is no perturbation 'os:system'"),
    "estimator": ("[amcl,", "[acml,", "did you mean 'amcl'?"),
    "estimator twice": ("[amcl, pose_graph]", "[amcl, amcl]", "an estimator is named twice"),
    "recorded": ("[amcl,", "[recorded,", "cannot be run again"),
    "no estimator": ("[amcl, pose_graph]", "[]", "at least 1 item"),
    "metric": ("error_max_m:", "eror_max_m:", "did you mean 'error_max_m'?"),
    "metric without unit": ("error_max_m:", "error_max:", "did you mean 'error_max_m'?"),
    "no limit": ("lost_s: 5\n  error_max_m: 0.5", "{}", "at least 1 item"),
    "limit": ("lost_s: 5", "lost_s: -5", "greater than or equal to 0"),
    "limit nan": ("lost_s: 5", "lost_s: .nan", "'limits.lost_s' is nan"),
    "limit text": ("lost_s: 5", "lost_s: long", "'limits.lost_s' is 'long'"),
    "seeds": ("seeds: 5", "seeds: 1000000000", "less than or equal to 200"),
    "no seeds": ("seeds: 5", "seeds: 0", "greater than or equal to 1"),
    "seed": ("seed: 1\n", "seed: -1\n", "'seed' is -1"),
    "seed wide": ("seed: 1\n", "seed: 9223372036854775807\n", "valid integer"),
    "scenario": ("name: healthy", "name: helthy", "did you mean 'healthy'?"),
    "control unit": ("level_m: 20.0", "level_s: 20.0", "write level_m"),
    "control baseline": ("level_m: 20.0", "level_m: 0.0", "which breaks nothing"),
    "control without level": (", level_m: 20.0", "", "initial_pose.offset has no level"),
    "key": ("positive_control", "positiv_control", "did you mean 'positive_control'?"),
    "perturbations misspelt": ("perturbations:", "perturbation:", "mean 'perturbations'?"),
    "two kinds": ("seeds: 5", "lab: wheel_slip", "both 'lab' and 'perturbations'"),
    "alias": ("[0.4,", "[*a,", "aliases"),
    "question": ("Which of", '"a\\nb" #', "not one line"),
    "version": ("version: 1", "version: 3", "version 3, this program reads 1"),
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_what_is_no_design_gets_one_clear_line(name, tmp_path):
    old, new, said = HOSTILE[name]
    assert old in TEXT

    with pytest.raises(UsageError) as caught:
        read(tmp_path, TEXT.replace(old, new, 1))

    line = str(caught.value)
    assert str(tmp_path) in line
    assert said in line
    assert line.isprintable()
    assert len(line) < len(str(tmp_path)) + 400


def test_too_many_trials_in_all_are_counted_before_any_is_run(tmp_path):
    many = "\n".join(
        f"  - {{name: scan_drop.{variant}, levels_ratio: [{', '.join(map(str, levels))}]}}"
        for variant in ("random", "even")
        for levels in [[k / 1000 for k in range(1, 100)]]
    )
    text = TEXT.replace("seeds: 5", "seeds: 200").replace(
        TEXT[TEXT.index("  - {name: tf_delay") : TEXT.index("positive_control")], many + "\n"
    )

    with pytest.raises(UsageError, match="up to 79606 trials, more than 20000"):
        read(tmp_path, text)


def test_levels_are_put_in_order_of_their_distance_from_the_baseline():
    assert of_levels("odometry_scale.translation", [0.5, 0.9]).levels == (0.9, 0.5)
