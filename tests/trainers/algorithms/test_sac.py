import pytest
import torch
from torchrl.modules import TanhNormal

from tests.helpers.fake_env import make_env
from tests.helpers.plans import plan
from trainers.algorithms.build import build_algorithm
from trainers.algorithms.sac import frozen, sample_tanh_normal
from trainers.rollout.collection import Rollouts


@pytest.fixture
def learned():
    env, small = make_env(8, 0), plan("sac")
    torch.manual_seed(0)
    policy, sac = build_algorithm(small, env.observation_spec, env.action_unit)
    rollouts = Rollouts(make_env, policy, small.collector, 16, 0)
    try:
        return policy, sac, rollouts.next().clone()
    finally:
        rollouts.close()


def test_the_log_probability_is_that_of_tanhnormal():
    loc, scale = torch.randn(64, 3), torch.rand(64, 3) + 0.1
    action, log_prob = sample_tanh_normal(loc, scale)
    torch.testing.assert_close(log_prob.squeeze(-1), TanhNormal(loc, scale).log_prob(action), atol=1e-2, rtol=1e-3)


def test_gradients_flow_through_frozen_parameters():
    weight, x = torch.ones(2, requires_grad=True), torch.ones(2, requires_grad=True)
    with frozen([weight]):
        y = (weight * x).sum()
    y.backward()
    assert weight.grad is None
    assert x.grad is not None
    assert weight.requires_grad


def test_gradient_steps_begin_after_learning_starts_and_keep_their_ratio_to_frames(learned):
    _, sac, batch = learned
    batch = batch.reshape(1, -1)
    assert sac.update(batch[:, :32], 0.0) == {"updates": 0.0}  # 64 frames are wanted first
    taken = sum(sac.update(batch[:, i : i + 3], 0.0)["updates"] for i in range(32, 62, 3))
    assert taken == 0
    measured = sac.update(batch[:, 62:], 0.0)
    assert measured["updates"] == 66 * 0.25 // 1
    assert sac.pending_steps == 0.5
    assert set(measured) <= set(sac.metrics)


def test_each_loss_has_gradients_for_its_own_parameters_only(learned):
    policy, sac, batch = learned
    sac.replay.extend(batch)
    losses = sac.losses(sac.replay.sample(32))
    losses["loss/critic"].backward(retain_graph=True)
    assert all(p.grad is None for p in policy.parameters())
    sac.optimizer.zero_grad()
    losses["loss/actor"].backward()
    assert all(p.grad is None for p in sac.critic_parameters)
    assert policy.encoder.query_encoder.word_embedding.weight.grad is None  # scenes alone train it
    assert policy.actor.net[0].weight.grad is not None
    assert sac.log_alpha.grad is None


def test_unsupervised_words_are_trained_by_the_actor_loss():
    env = make_env(8, 0)
    policy, sac = build_algorithm(
        plan("sac", overrides=("algo.grounding_weight=0.0",)), env.observation_spec, env.action_unit
    )
    with torch.no_grad():
        sac.replay.extend(env.rollout(5, policy.act))
    sac.losses(sac.replay.sample(32))["loss/actor"].backward()
    assert policy.encoder.query_encoder.word_embedding.weight.grad is not None


def test_each_episode_adds_one_scene(learned):
    _, sac, batch = learned
    sac.add_batch_scenes(batch[:, :8], [])
    sac.add_batch_scenes(batch[:, 8:], [])
    assert len(sac.grounding.scenes) == 8 + int(batch["next", "done"][:, :-1].sum())


def test_a_truncated_frame_bootstraps_and_a_terminated_one_does_not(learned):
    _, sac, batch = learned
    sac.replay.extend(batch)
    frames = sac.replay.sample(64)
    with torch.no_grad():
        for p in sac.target.parameters():
            p.zero_()
        sac.target.heads[0][-1].bias.fill_(100.0)
        sac.target.heads[1][-1].bias.fill_(100.0)
        sac.critic.load_state_dict(sac.target.state_dict())
        for head in sac.critic.heads:
            head[-1].bias.zero_()
    frames["next", "reward"].zero_()
    frames["next", "terminated"].fill_(True)
    assert sac.losses(frames)["loss/critic"] < 1.0
    frames["next", "terminated"].fill_(False)
    assert sac.losses(frames)["loss/critic"] > 1000.0


def test_state_dict_restores_the_temperature(learned):
    _, sac, batch = learned
    sac.update(batch, 0.0)
    state = {k: v.copy() if isinstance(v, dict) else v.clone() for k, v in sac.state_dict().items()}
    sac.load_state_dict(state)
    torch.testing.assert_close(sac.log_alpha.detach(), state["log_alpha"])
