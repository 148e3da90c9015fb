"""Whether the policy or the expert acts while the expert is imitated."""

import pytest
import torch

from tests.helpers.labelled_fake_env import LABEL, make_labelled
from tests.helpers.training_configs import training
from trainers.algorithms.algorithm import build_algorithm
from trainers.collect.rollouts import Rollouts
from trainers.models.policy import ExpertMixture


@pytest.fixture
def policy_and_state():
    env = make_labelled(256, 0)
    torch.manual_seed(0)
    policy, _ = build_algorithm(training("bc"), env.observation_spec, env.action_unit)
    return policy, env.reset()


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_the_expert_acts_in_its_share_of_the_steps(policy_and_state, share):
    policy, state = policy_and_state
    acted = ExpertMixture(policy, share).act(state.clone())
    follows = (acted["action"] == state[LABEL]).all(-1).float().mean()
    assert float(follows) == pytest.approx(share, abs=0.1 if 0 < share < 1 else 0.0)


def test_what_the_policy_wrote_is_kept_where_the_expert_acts(policy_and_state):
    policy, state = policy_and_state
    acted = ExpertMixture(policy, 1.0).act(state.clone())
    assert {"move", "referent", "attention_logits"} <= set(acted.keys())


@pytest.mark.slow
def test_worker_processes_are_told_the_share():
    env, small = make_labelled(8, 0), training("bc", overrides=("collector.workers=2",))
    _, bc = build_algorithm(small, env.observation_spec, env.action_unit)
    rollouts = Rollouts(make_labelled, bc.behaviour, small.collector, horizon=4, seed=0)
    try:
        for share in (1.0, 0.0):
            bc.mixture.expert_share.fill_(share)
            rollouts.sync(bc.behaviour)
            batch = rollouts.next()
            follows = (batch["action"] == batch[LABEL]).all(-1)
            assert bool(follows.all()) == bool(follows.any()) == (share == 1.0)
    finally:
        rollouts.close()
