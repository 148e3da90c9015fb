"""Domain randomisation: what it draws, and that it changes nothing where it is off."""

from __future__ import annotations

import numpy as np
import pybullet as bullet
import pytest
import torch

from core.errors import ConfigError
from core.overrides import compose
from envs import read_env
from envs.experts import expert
from envs.tasks import RandomizeConfig
from envs.workspace_env import WorkspaceEnv
from tests.helpers.env_cases import act
from trainers.evaluation.evaluation import evaluate


def world(*randomize: str, worlds: int = 2) -> WorkspaceEnv:
    words = ["task=nl_reach", *(f"task.randomize.{word}" for word in randomize)]
    return WorkspaceEnv(read_env(compose(words)), worlds, 5)


def driven(env: WorkspaceEnv, actions: np.ndarray) -> torch.Tensor:
    """(steps, R) what world 0 observes of its arm under actions (steps, 3); closes the environment."""
    td, seen = env.reset(), []
    for action in actions:
        td = act(env, td, np.tile(action, (env.batch_size[0], 1)))
        seen.append(td["robot"][0])
    env.close()
    return torch.stack(seen)


ACTIONS = np.random.default_rng(0).uniform(-1, 1, (12, 3))


@pytest.mark.parametrize("config", [RandomizeConfig(), RandomizeConfig(mass=[0.5, 2.0], delay=[0, 3])])
def test_scenes_do_not_depend_on_what_is_drawn(config):
    rng, same = np.random.default_rng(3), np.random.default_rng(3)
    drawn = [config.draw(rng)]
    assert rng.random() == same.random()
    drawn.append(config.draw(rng))
    assert drawn == [None, None] if not config.is_on else drawn[0] != drawn[1]


def test_late_actions_move_the_arm_as_if_they_had_been_sent_later():
    late = driven(world("delay=[2,2]"), ACTIONS)
    prompt = driven(world(), np.concatenate((np.zeros((2, 3)), ACTIONS[:-2])))
    assert torch.equal(late, prompt)


def test_the_noise_of_a_world_does_not_depend_on_the_others_and_differs_between_episodes():
    noises = "action_noise=0.3", "observation_noise=0.01"
    one, three = (driven(world(*noises, worlds=count), ACTIONS) for count in (1, 3))
    assert torch.equal(one, three)
    still = driven(world(), ACTIONS)
    assert (one - still).abs().max() > 0.01


def test_masses_and_friction_are_those_drawn():
    env = world("mass=[3.0,3.0]", "friction=[0.5,0.5]")
    env.reset()
    pool = env._worlds[0].pool
    for body in pool.shown:
        mass, friction = bullet.getDynamicsInfo(body, -1, env._worlds[0].client)[:2]
        assert (mass, friction) == pytest.approx((0.3, 0.4))
    env.close()


def test_objects_are_seen_with_noise_and_judged_without_it():
    env = world("observation_noise=0.01", worlds=8)
    td = env.reset()
    shown = td["objects_mask"]
    seen, true = td["objects"][..., :3][shown], td["privileged", "places"][shown]
    assert 0.005 < (seen - true).std() < 0.015
    np.testing.assert_allclose(true, env.state.objects[env.state.shown], atol=1e-6)
    result = evaluate(env, expert(env), 16, seed=1)
    assert (result.success_at_end, result.disturbed) == (1.0, 0.0)
    env.close()


def test_an_arm_begins_further_from_its_rest_pose():
    env = world("start=0.3", worlds=8)
    env.reset()
    apart = np.abs(env._arrays.angles - env.kinematics.rest).max()
    assert 0.15 < apart <= 0.3 + 1e-6
    env.close()


def test_evaluations_draw_nothing():
    config = read_env(compose(["task.randomize.start=0.3", "task.randomize.delay=[0,3]"])).without_curriculum()
    assert config.task.randomize == RandomizeConfig()


def test_a_range_has_its_lower_end_first():
    with pytest.raises(ConfigError, match=r"task.randomize.mass=\[2.0, 1.0\] must be a range: the lower end first"):
        read_env(compose(["task.randomize.mass=[2.0,1.0]"]))
