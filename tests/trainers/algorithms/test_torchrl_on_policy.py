"""The adapter trains with TorchRL's on-policy loss modules."""

import pytest
import torch

from tests.helpers.fake_env import make_env
from tests.helpers.training_configs import training
from trainers.algorithms.algorithm import build_algorithm


@pytest.mark.parametrize("policy", ["grounded", "mlp"])
@pytest.mark.parametrize("loss", ["A2CLoss", "ClipPPOLoss", "PPOLoss"])
def test_an_update_trains_actor_and_critic(policy, loss):
    env = make_env(8, 0)
    torch.manual_seed(0)
    overrides = (f"algo.loss={loss}", "algo.minibatch=40")
    made, algorithm = build_algorithm(training("a2c", policy, overrides), env.observation_spec, env.action_unit)
    with torch.no_grad():
        batch = env.rollout(5, made.act, break_when_any_done=False)
    before = [p.clone() for p in (*made.actor.parameters(), *algorithm.critic.parameters())]
    measured = algorithm.update(batch, 0.0)
    assert set(measured) <= set(algorithm.metrics)
    after = [*made.actor.parameters(), *algorithm.critic.parameters()]
    assert any(not torch.equal(a, b) for a, b in zip(before, after, strict=True))
    assert ("loss/grounding" in measured) == (policy == "grounded")
