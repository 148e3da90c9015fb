"""Scenarios: their composition, and the precedence of overrides."""

import pytest
from omegaconf import OmegaConf

from core.composition import quoted
from core.errors import ConfigError
from core.overrides import apply, check, compose
from envs import read_env
from trainers.config import read_training

SCENARIOS = {
    1: ("kuka", "absolute", "ppo"),
    2: ("kuka", "step", "ppo"),
    3: ("kuka", "joints", "ppo"),
    4: ("panda", "step", "ppo"),
    5: ("jaco", "step", "sac"),
}
# What a scenario of PPO sets by itself: the first value is its own, the second that of the others.
OWN = {
    4: {"curriculum.radius": (0.0, 0.04)},
}


@pytest.mark.slow
@pytest.mark.parametrize("number", SCENARIOS)
def test_a_scenario_sets_robot_control_algorithm_and_task(number):
    config = compose([f"scenario={number}"])
    environment, training = read_env(config), read_training(config)
    assert (environment.robot.name, environment.control.name, training.algo.name) == SCENARIOS[number]
    task = environment.task
    assert (task.name, task.num_objects, task.num_targets) == ("nl_pick_and_place", 2, 2)
    assert environment.gripper.of(environment.robot) == ("fingers" if number == 4 else "magnet")
    assert training.run.total_frames <= 1_000_000
    assert config.scenario == number


@pytest.mark.slow
def test_scenarios_of_one_algorithm_share_their_hyperparameters():
    """One set of hyperparameters for each algorithm, whatever the robot and the control, but for what OWN lists."""
    same = ("algo", "policy", "task", "collector")
    first = compose(["scenario=1"])
    for number in (2, 3, 4):
        own = OWN.get(number, {})
        task = compose([f"scenario={number}"]).task
        assert {key: OmegaConf.select(task, key) for key in own} == {key: value for key, (value, _) in own.items()}
        other = compose([f"scenario={number}", *[f"task.{key}={usual}" for key, (_, usual) in own.items()]])
        assert [other[key] for key in same] == [first[key] for key in same]


@pytest.mark.parametrize("algo", ["ppo", "sac", "bc"])
def test_another_algorithm_replaces_all_of_a_scenarios_own(algo):
    assert compose(["scenario=3", f"algo={algo}"]).algo == compose([f"algo={algo}"]).algo
    assert read_training(compose(["scenario=3", f"algo={algo}"])).algo.name == algo


def test_scenario_none_changes_nothing():
    assert compose(["scenario=none"]) == compose()
    assert "scenario" not in compose()


def test_overrides_take_precedence_over_the_scenario():
    typed = ["scenario=2", "robot=panda", "algo=sac", "total_frames=1000", "task.num_objects=3"]
    for words in (typed, typed[::-1]):
        config = compose(words)
        assert (config.robot.name, config.algo.name, config.control.name) == ("panda", "sac", "step")
        assert (config.total_frames, config.task.num_objects, config.task.num_targets) == (1000, 3, 2)


@pytest.mark.parametrize(
    "words",
    [
        ["-m", "scenario=1,2,3,4,5", "seed=0,1,2"],
        ["-m", "robot=kuka,panda,jaco", "control=joints,absolute,step", "algo=ppo,sac"],
        ["-m", "scenario=none,2", "sweep.jobs=1"],
        ["-m", "scenario='1','2'"],
    ],
)
def test_sweeps_over_scenarios_and_groups_are_accepted(words):
    check(words)


def test_numeric_options_are_quoted_and_other_numbers_are_not():
    words = ["scenario=1,2", "scenario=none,3", "seed=1,2", "robot=kuka", "scenario='4'"]
    assert quoted(words) == ["scenario='1','2'", "scenario=none,'3'", "seed=1,2", "robot=kuka", "scenario='4'"]


@pytest.mark.parametrize("word", ["scenario=6", "scenario=1,7"])
def test_an_unknown_scenario_is_refused(word):
    with pytest.raises(ConfigError, match=r"^scenario=[67] is not known; choose from 1, 2, 3, 4, 5, none$"):
        check([word])


def test_a_checkpoint_keeps_its_scenario():
    with pytest.raises(ConfigError, match="scenario=2: a checkpoint keeps the scenario"):
        apply({"seed": 0}, ["scenario=2"])
