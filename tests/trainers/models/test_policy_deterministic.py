"""The deterministic action of a grounded policy."""

import torch
from torchrl.envs.utils import ExplorationType, set_exploration_type

from tests.helpers.fake_env import make_env
from tests.helpers.training_configs import training
from trainers.models.policy import build_policy


def test_the_deterministic_policy_attends_to_a_single_object():
    env = make_env(8, 0)
    policy = build_policy(training().policy, env.observation_spec, env.action_unit)
    state = env.reset()
    with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
        out = policy.act(state)
    rows = policy.encoder.normalise(state["objects"])
    chosen = rows[torch.arange(8), out["attention_logits"].argmax(-1)]
    torch.testing.assert_close(out["referent"], chosen)
