"""The environments satisfy the protocol that trainers state."""

import pytest
import torch

from envs import make_env
from tests.helpers import fake_env
from trainers.environment import TrainingEnv


@pytest.mark.parametrize("make", [lambda: make_env(["task=nl_reach"], num_worlds=4), lambda: fake_env.make_env(4, 0)])
def test_an_environment_satisfies_the_protocol(make):
    env = make()
    try:
        assert isinstance(env, TrainingEnv)
        state = env.reset()
        keys = {"robot", "objects", "objects_mask", "instruction", "hold", "success", "wrong_object", "at_goal"}
        assert keys | {"reward_terms", "privileged"} <= set(state.keys())
        assert {"referent", "goal", "kind"} <= set(state["privileged"].keys())
        assert len(env.action_unit) == env.action_spec.shape[-1]
        assert state["reward_terms"].shape == (4, len(env.reward_names))
        assert int(state["privileged", "kind"].max()) < len(env.kind_names)
        assert int(state["instruction"].max()) < len(env.tokenizer.vocabulary)
        scenes = env.draw_scenes(3, 1)
        assert {"objects", "objects_mask", "instruction", "privileged"} <= set(scenes.keys())
        assert scenes.batch_size == torch.Size([3])
        assert list(env.hindsight([], 0)) == []
    finally:
        env.close()
