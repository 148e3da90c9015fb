"""Calls that do not fit an environment: each gets one message that says what would be right."""

from __future__ import annotations

from collections.abc import Iterator

import gymnasium
import numpy as np
import pytest
import torch
from tensordict import TensorDict

from core.errors import ConfigError, UseError
from envs import make_env
from envs.gym_env import GymEnv
from envs.workspace_env import WorkspaceEnv

WIDTH = 3  # of an action with control=step


@pytest.fixture(scope="module")
def begun() -> Iterator[WorkspaceEnv]:
    env = make_env(["task=reach"], num_worlds=2)
    env.reset()
    yield env
    env.close()


@pytest.fixture(scope="module")
def gym_env() -> Iterator[GymEnv]:
    env = GymEnv("reach")
    yield env
    env.close()


@pytest.mark.parametrize(
    "action",
    [
        torch.zeros(2, WIDTH + 1),
        torch.zeros(3, WIDTH),
        torch.zeros(WIDTH),
        torch.zeros(2, 1, WIDTH),
        torch.zeros(2, WIDTH, dtype=torch.int64),
        torch.zeros(2, WIDTH, dtype=torch.bool),
        torch.zeros(2, WIDTH, dtype=torch.complex64),
    ],
    ids=lambda action: f"{tuple(action.shape)} {action.dtype}",
)
def test_an_action_of_another_form_is_refused_with_the_right_one(begun, action):
    batch = action.shape[:1] if action.dim() > 1 else []
    with pytest.raises((UseError, RuntimeError), match=r"shape") as caught:
        begun.step(TensorDict({"action": action}, batch))
    assert "\n" not in str(caught.value)
    if batch == [2]:
        assert f"must be a floating-point tensor of shape (2, {WIDTH})" in str(caught.value)


def test_a_step_needs_an_action(begun):
    with pytest.raises(UseError, match="step got no action: its TensorDict needs the key action"):
        begun.step(TensorDict({}, [2]))


def test_a_step_before_reset_and_calls_after_close_are_refused():
    env = make_env(["task=reach"])
    action = TensorDict({"action": torch.zeros(1, WIDTH)}, [1])
    with pytest.raises(UseError, match="step was called before reset"):
        env.step(action)
    env.reset()
    env.close()
    with pytest.raises(UseError, match="step was called after close"):
        env.step(action)
    with pytest.raises(UseError, match="reset was called after close"):
        env.reset()


@pytest.mark.parametrize(
    "action",
    [
        np.zeros(WIDTH + 1, np.float32),
        np.zeros((1, WIDTH), np.float32),
        np.zeros(WIDTH, np.int64),
        np.array([None] * WIDTH),
        [[0.0], [0.0, 0.0]],
        0.0,
        None,
        "x",
        ["a"] * WIDTH,
        {},
    ],
    ids=repr,
)
def test_the_gymnasium_environment_refuses_other_actions(gym_env, action):
    gym_env.reset(seed=0)
    with pytest.raises(UseError, match=rf"step got an action of .*; it must be an array of shape \({WIDTH},\)"):
        gym_env.step(action)


def test_the_gymnasium_environment_takes_lists_and_tensors_and_needs_a_reset():
    env = GymEnv("reach")
    with pytest.raises(UseError, match="step was called before reset"):
        env.step(np.zeros(WIDTH, np.float32))
    env.reset(seed=0)
    for action in ([0.0] * WIDTH, torch.zeros(WIDTH), np.zeros(WIDTH)):
        env.step(action)
    env.close()


@pytest.mark.parametrize("overrides", ["robot=panda", None, 5, {"robot": "panda"}, [["robot=panda"]], ("a=1", 1), b"x"])
def test_overrides_are_a_list_of_words(overrides):
    for build in (make_env, lambda words: gymnasium.make("Deixis/Reach-v0", overrides=words)):
        with pytest.raises(ConfigError, match=r"^overrides=.* must be a list of words, such as \["):
            build(overrides)


@pytest.mark.parametrize(("name", "value"), [("num_worlds", 1.5), ("num_worlds", "2"), ("seed", None), ("seed", "x")])
def test_numbers_of_worlds_and_seeds_are_whole(name, value):
    with pytest.raises(ConfigError, match=f"^{name}={value!r} must be a whole number"):
        make_env(["task=reach"], **{name: value})


def test_the_modes_that_this_machine_can_render_are_declared(monkeypatch, gym_env):
    monkeypatch.delenv("DISPLAY", raising=False)
    env = GymEnv("reach")
    assert env.metadata["render_modes"] == ["rgb_array"]
    env.close()
