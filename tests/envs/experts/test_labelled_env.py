"""Environments that observe what the expert would do."""

import pytest
import torch
from torchrl.envs.utils import check_env_specs

from core.overrides import compose
from envs import read_env
from envs.experts import expert
from envs.experts.labelled_env import LABEL, LabelledEnv
from envs.workspace_env import WorkspaceEnv
from tests.helpers.env_cases import act, differences, partial_reset


def make_pair(task, worlds=3):
    config = read_env(compose([f"task={task}"]))
    return LabelledEnv(config, worlds, 4), WorkspaceEnv(config, worlds, 4)


@pytest.mark.slow
@pytest.mark.parametrize("task", ["nl_reach", "nl_pick_and_place"])
def test_the_label_is_the_experts_action_and_nothing_else_differs(task):
    labelled, plain = make_pair(task)
    actor, one, other = expert(plain), labelled.reset(), plain.reset()
    for step in range(12):
        label = one[LABEL]
        assert not differences(one.exclude(LABEL), other)
        torch.testing.assert_close(label, actor(other.clone())["action"].clamp(-1, 1))
        one, other = act(labelled, one, label), act(plain, other, label)
        if step == 5:
            one, other = partial_reset(labelled, one, [1]), partial_reset(plain, other, [1])
            actor(other.clone())  # experts may count the times that they are asked
    labelled.close()
    plain.close()


@pytest.mark.slow
def test_the_label_is_declared_and_within_the_bounds_of_actions():
    env, plain = make_pair("rearrange", worlds=2)
    check_env_specs(env)
    state = env.reset()
    assert state[LABEL].shape == env.action_spec.shape
    assert env.action_spec.is_in(state[LABEL])
    assert LABEL not in plain.reset().keys(include_nested=True)
    env.close()
    plain.close()
