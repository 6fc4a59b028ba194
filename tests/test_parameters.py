"""Parameter files of both worlds: whose parameters they are, what they mean, and their faults."""

import json
from dataclasses import replace

import numpy as np
import pytest

from slamreplay.bundle.run import Run, Trial, run_bytes
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.store import write_bundle
from slamreplay.bundle.view import Bundle
from slamreplay.errors import UsageError
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.estimators.amcl.estimator import Amcl
from slamreplay.estimators.amcl.parameters import config_from
from slamreplay.replay import runner
from slamreplay.replay.design import design
from slamreplay.replay.folder import read_runs, write_runs
from slamreplay.replay.metrics import baseline_of
from slamreplay.replay.parameters import configured, read_parameters
from slamreplay.testing.synthetic import synthetic_bundle

NAV2 = """
amcl:
  ros__parameters:
    use_sim_time: True
    alpha1: 0.1
    max_particles: 900
    robot_model_type: nav2_amcl::OmniMotionModel
    laser_model_type: likelihood_field_prob
    do_beamskip: yes
    initial_pose: {x: 1.5, y: -2.0, z: 0.0, yaw: 0.5}
    set_initial_pose: true
    tf_broadcast: true
    scan_topic: scan
    qos_overrides: {/scan: {reliability: best_effort}}
controller_server:
  ros__parameters: {controller_frequency: 20.0}
"""
ROS_1 = """
amcl:
  odom_model_type: diff-corrected
  odom_alpha1: 0.3
  kld_err: 0.02
  laser_max_beams: 90
  laser_z_hit: 0.8
  laser_likelihood_max_dist: 1.0
  initial_pose_x: 3
  initial_cov_aa: 0.01
  gui_publish_rate: 10.0
move_base: {controller_frequency: 5.0}
rosdistro: noetic
"""


@pytest.fixture
def file(tmp_path):
    def write(text, name="p.yaml"):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return write


def of(path, *estimators, robot=None):
    given = read_parameters([path], estimators or ("amcl",), robot).of
    return {name: json.loads(text) for name, text in given.items()}


def test_nav2_parameters_make_the_configuration_nav2_amcl_would_have(file):
    given = read_parameters([file(NAV2)], ["amcl", "dead_reckoning", "ekf"])

    assert configured("amcl", given.of["amcl"]).config == AmclConfig(
        alpha1=0.1,
        max_particles=900,
        motion_model="omnidirectional",
        laser_model_type="likelihood_field_prob",
        do_beamskip=True,
        initial_pose_x=1.5,
        initial_pose_y=-2.0,
        initial_pose_yaw=0.5,
        set_initial_pose=True,
    )
    assert list(given.of) == ["amcl"]
    (told,) = given.told
    assert told.startswith("amcl: 9 parameters given, 5 of the live node have no part in a replay")
    assert told.endswith("(use_sim_time, initial_pose.z, tf_broadcast, ...)")


def test_ros_1_parameters_are_renamed_and_the_rest_has_ros_1_defaults(file):
    config = config_from(of(file(ROS_1))["amcl"])

    assert (config.alpha1, config.pf_err, config.max_beams, config.z_hit) == (0.3, 0.02, 90, 0.8)
    assert not config.squared_motion_noise
    assert (config.max_particles, config.resample_interval, config.laser_max_range) == (5000, 2, -1)
    assert config.know_initial_pose
    assert not config.set_initial_pose
    pose, cov = config.initial_pose
    assert pose.tolist() == [3.0, 0.0, 0.0]
    assert np.diag(cov).tolist() == [0.25, 0.25, 0.01]


def test_ros_1_gives_alpha_1_and_4_of_omni_each_others_part_and_squares_the_noise_of_two():
    omni = config_from({"odom_model_type": "omni", "odom_alpha1": 0.1, "odom_alpha4": 0.4})

    assert (omni.motion_model, omni.alpha1, omni.alpha4) == ("omnidirectional", 0.4, 0.1)
    assert omni.squared_motion_noise
    assert config_from({"kld_err": 0.1}).squared_motion_noise  # ROS 1's default is diff
    assert not config_from({"alpha1": 0.1}).squared_motion_noise


@pytest.mark.parametrize(
    "text",
    [
        "amcl: {min_particles: 7}",
        "/amcl: {min_particles: 7}",
        "robot1: {amcl: {min_particles: 7}}",
        "min_particles: 7",
        "/robot1/amcl: {ros__parameters: {min_particles: 7}}",
        "robot1: {amcl: {ros__parameters: {min_particles: 7}}}",
        "/**: {ros__parameters: {min_particles: 7, controller_frequency: 20.0}}",
        "/**/amcl: {ros__parameters: {min_particles: 7}}",
        "ros__parameters: {min_particles: 7}",
    ],
)
def test_a_node_is_found_by_its_name_wherever_it_stands(file, text):
    assert of(file(text)) == {"amcl": {"min_particles": 7}}


def test_later_sections_and_files_hold_and_wildcards_reach_below_their_namespace(file):
    one = file(
        "/**: {ros__parameters: {min_particles: 1, max_beams: 9}}\n"
        "/robot1/**: {ros__parameters: {max_beams: 10}}\n"
        "/robot2/*: {ros__parameters: {max_beams: 11}}\n"
        "/robot1/amcl: {ros__parameters: {min_particles: 2}}\n"
    )
    two = file("amcl: {ros__parameters: {min_particles: 3}}", "two.yaml")

    assert of(one) == {"amcl": {"min_particles": 2, "max_beams": 10}}
    given = read_parameters([one, two], ["amcl"]).of["amcl"]
    assert json.loads(given) == {"min_particles": 3, "max_beams": 10}


def test_of_two_robots_one_is_to_be_named(file):
    path = file(
        "robot1: {amcl: {ros__parameters: {max_beams: 10}}}\n"
        "robot2: {amcl: {ros__parameters: {max_beams: 20}}}\n"
    )

    with pytest.raises(UsageError, match=r"several robots: robot1/amcl, robot2/amcl.*--robot"):
        of(path)
    assert of(path, robot="/robot2") == {"amcl": {"max_beams": 20}}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("amcl: {max_particels: 3}", "no parameter 'max_particels'.*'max_particles'"),
        ("amcl: {kld_er: 3}", "'kld_err'"),
        ("amcl: {max_beams: many}", "'max_beams' is 'many': it should be a whole number"),
        ("amcl: {max_beams: 1.5}", "whole number"),
        ("amcl: {alpha1: true}", "'alpha1' is True: it should be a number"),
        ("amcl: {alpha1: -0.1}", "alpha1 is -0.1.*not negative"),
        ("amcl: {alpha1: .nan}", "'alpha1' is nan: it should be finite"),
        ("amcl: {do_beamskip: 2}", "true or false"),
        ("amcl: {laser_model_type: likelihood}", "one of likelihood_field"),
        ("amcl: {robot_model_type: tracked}", "one of differential"),
        ("amcl: {odom_model_type: [diff]}", "one of diff"),
        ("amcl: {max_particles: 10, min_particles: 20}", "below min_particles"),
        ("amcl: {alpha1: 0.1, odom_alpha1: 0.1}", "'alpha1' is given twice"),
        ("move_base: {a: 1}", "no parameters of amcl.*move_base"),
        ("amcl: &a {alpha1: 0.1}\nb: *a", "aliases"),
        ("amcl: !!python/object:os.system {}", "tags"),
        ("amcl: {alpha1: 0.1, alpha1: 0.2}", "twice"),
        ("- 1", "NODE"),
    ],
)
def test_faults_are_one_line_that_names_the_file(file, text, says):
    path = file(text)
    with pytest.raises(UsageError, match=says) as fault:
        of(path)

    assert path.name in str(fault.value)
    assert "\n" not in str(fault.value)


def test_bare_parameters_of_several_estimators_and_estimators_without_any_are_refused(
    file, monkeypatch
):
    monkeypatch.setattr(
        "slamreplay.estimators.ekf.estimator.Ekf.from_parameters",
        classmethod(lambda cls, given: cls()),
        raising=False,
    )
    with pytest.raises(UsageError, match="whose parameters these are: amcl, ekf"):
        of(file("min_particles: 7"), "amcl", "ekf")
    with pytest.raises(UsageError, match="no parameters can be given to dead_reckoning"):
        of(file("min_particles: 7"), "dead_reckoning")


def test_parameters_are_part_of_a_trial_of_its_cache_and_of_its_folder(tmp_path):
    made = synthetic_bundle(seconds=2.0)
    tables = {name: made.table(name) for name in TABLES}
    write_bundle(tmp_path / "b", made.manifest, tables, {"room": made.grid()})
    log = Bundle.open(tmp_path / "b")
    few = '{"max_particles":50,"min_particles":20}'
    plain = design(log, ["amcl"], [], 0)
    with_few = design(log, ["amcl"], ["scan_drop=0.5"], 0, {"amcl": few})
    runs = runner.replay(log, [*plain, *with_few], cache=tmp_path / "c")
    write_runs(tmp_path / "R", log, runs)

    kept = json.loads((tmp_path / "R" / "runs.json").read_text())["trials"]
    assert ["parameters" in trial for trial in kept] == [False, True, True]
    assert runs[1].estimate.diagnostics["particles"].max() <= 50
    assert len({run.trial.id for run in runs}) == len(list((tmp_path / "c").iterdir())) == 3
    assert [run_bytes(r) for r in read_runs(tmp_path / "R")[1]] == [run_bytes(r) for r in runs]
    assert baseline_of(runs[2], runs) is runs[1]
    assert runs[2].trial.given == {"max_particles": 50, "min_particles": 20}


def test_a_trial_without_parameters_has_the_name_it_always_had():
    trial = Trial("b", "amcl", 0)

    assert "parameters" not in trial.record
    assert trial.given is None
    assert trial.id != replace(trial, parameters="{}").id
    assert b'"parameters"' not in run_bytes(Run(trial, None, "why"))


def test_from_parameters_of_nothing_is_the_default():
    assert Amcl.from_parameters({}) == Amcl()
