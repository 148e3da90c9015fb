"""Vectorised Gymnasium environments: our worlds in one process, and workers of Gymnasium and of TorchRL."""

import subprocess
import sys

import gymnasium
import numpy as np
import pytest
import torch
from torchrl.envs import GymEnv, GymWrapper, check_env_specs

from core.errors import ConfigError, UseError
from envs import make_env

ID = "Deixis/NLReach-v0"
SHORT = ["task.max_steps=6"]


def made(**settings):
    return gymnasium.make_vec(ID, num_envs=3, overrides=SHORT, **settings)


def still(worlds):
    return np.zeros(worlds.action_space.shape, np.float32)


def test_the_worlds_are_those_of_make_env():
    worlds, env = made(), make_env(["task=nl_reach", *SHORT], num_worlds=3)
    env.set_seed(5)
    observation, _ = worlds.reset(seed=5)
    expected = env.reset()
    for key, value in observation.items():
        np.testing.assert_array_equal(value, expected[key].numpy())
    assert observation in worlds.observation_space
    assert worlds.unwrapped.sentences == tuple(env.sentence(i) for i in range(3))
    action = worlds.action_space.sample()
    observation, reward, *_ = worlds.step(action)
    stepped = env.step(expected.set("action", torch.from_numpy(action)))["next"]
    np.testing.assert_array_equal(observation["robot"], stepped["robot"].numpy())
    np.testing.assert_array_equal(reward, stepped["reward"][:, 0].numpy())
    worlds.close()
    env.close()


def rolled(mode, steps):
    worlds = made(autoreset_mode=mode)
    observation, _ = worlds.reset(seed=1)
    results = [(observation, *worlds.step(still(worlds))) for _ in range(steps)]
    worlds.close()
    return results


@pytest.mark.parametrize(("mode", "ended"), [("NextStep", [5, 12]), ("SameStep", [5, 11])])
def test_the_next_episode_begins_as_the_mode_says(mode, ended):
    results = rolled(mode, 14)
    assert [i for i, (*_, truncated, _) in enumerate(results) if truncated.all()] == ended
    before, (at_end, after) = results[4], results[5:7]
    same = [(step[1]["objects"] == before[1]["objects"]).all() for step in (at_end, after)]
    if mode == "NextStep":
        assert same == [True, False]
        assert (after[2] == 0).all()
        assert not (after[3] | after[4]).any()
    else:
        assert same == [False, False]
        assert (at_end[5]["final_obs"][2]["objects"] == before[1]["objects"][2]).all()
        assert at_end[5]["final_info"]["reward_terms"].shape == at_end[5]["reward_terms"].shape


def test_a_mask_resets_chosen_worlds_only():
    worlds = made(autoreset_mode="Disabled")
    worlds.reset(seed=0)
    for _ in range(6):
        before, _, terminated, truncated, _ = worlds.step(still(worlds))
    assert (terminated | truncated).all()
    with pytest.raises(UseError, match=r"worlds \[0, 1, 2\] are over"):
        worlds.step(still(worlds))
    sentences = worlds.unwrapped.sentences
    after, _ = worlds.reset(options={"reset_mask": np.array([False, True, False])})
    assert (after["objects"][[0, 2]] == before["objects"][[0, 2]]).all()
    assert (after["objects"][1] != before["objects"][1]).any()
    assert worlds.unwrapped.sentences[::2] == sentences[::2]
    with pytest.raises(UseError, match=r"worlds \[0, 2\] are over"):
        worlds.step(still(worlds))
    worlds.close()


def test_what_is_wrong_is_said():
    for key, value in (("autoreset_mode", "never"), ("render_mode", "human"), ("num_envs", 0)):
        with pytest.raises(ConfigError, match=f"{key}="):
            gymnasium.make_vec(ID, **{key: value})
    worlds = made()
    with pytest.raises(UseError, match="before reset"):
        worlds.step(still(worlds))
    with pytest.raises(UseError, match="have not been reset"):
        worlds.reset(options={"reset_mask": np.array([True, False, False])})
    with pytest.raises(UseError, match=r"seed=\[1, 2, 3\]"):
        worlds.reset(seed=[1, 2, 3])
    worlds.reset()
    with pytest.raises(UseError, match="reset_mask"):
        worlds.reset(options={"reset_mask": [True]})
    with pytest.raises(UseError, match=r"must be an array of shape \(3, 3\)"):
        worlds.step(still(worlds)[0])
    worlds.close()
    worlds.close()


def test_each_world_has_an_image():
    small = ["workspace.cameras.film.width=64", "workspace.cameras.film.height=48"]
    worlds = gymnasium.make_vec(ID, num_envs=2, render_mode="rgb_array", overrides=small)
    worlds.reset(seed=0)
    first, second = worlds.render()
    assert first.shape == second.shape == (48, 64, 3)
    assert (first != second).any()
    worlds.close()


@pytest.mark.parametrize("mode", ["Disabled", "SameStep"])
def test_torchrl_wraps_the_worlds(mode):
    env = GymWrapper(made(autoreset_mode=mode))
    check_env_specs(env)
    rollout = env.rollout(14, break_when_any_done=False)
    ended = rollout["next", "done"].squeeze(-1)
    assert ended.sum(1).tolist() == [2, 2, 2]
    if mode == "Disabled":  # in the other mode TorchRL's reader has zeros at the ends, for every Dict of observations
        assert (rollout["next", "objects"][ended].abs().sum((1, 2)) > 0).all()
    env.close()


@pytest.mark.slow
def test_torchrl_makes_the_environment_in_workers():
    env = GymEnv(ID, num_envs=2, overrides=SHORT)  # its processes have not imported envs
    rollout = env.rollout(8, break_when_any_done=False)
    assert rollout.batch_size == (2, 8)
    assert rollout["next", "reward_terms"].shape == (2, 8, 4)
    assert rollout["next", "done"].squeeze(-1).sum(1).tolist() == [1, 1]
    env.close()


@pytest.mark.slow
def test_gymnasium_makes_the_environment_in_workers_of_any_kind():
    code = (
        "import envs, gymnasium\n"
        "for start in ('spawn', 'forkserver', 'fork'):\n"
        f"    kwargs = dict(vectorization_mode='async', vector_kwargs={{'context': start}})\n"
        f"    worlds = gymnasium.make_vec('{ID}', 1, **kwargs)\n"
        "    worlds.reset(seed=0)\n"
        "    worlds.step(worlds.action_space.sample())\n"
        "    print(*worlds.get_attr('sentence'))\n"
        "    worlds.close()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert [line[:10] for line in done.stdout.splitlines()] == ["reach the "] * 3
