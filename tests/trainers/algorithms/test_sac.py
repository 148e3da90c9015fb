import copy

import pytest
import torch
from torchrl.modules import TanhNormal

from tests.helpers.fake_env import make_env
from tests.helpers.training_configs import training
from trainers.algorithms.algorithm import build_algorithm
from trainers.algorithms.sac import sample_tanh_normal
from trainers.collect.rollouts import Rollouts


@pytest.fixture
def learned():
    env, small = make_env(8, 0), training("sac")
    torch.manual_seed(0)
    policy, sac = build_algorithm(small, env.observation_spec, env.action_unit)
    rollouts = Rollouts(make_env, policy, small.collector, horizon=16, seed=0)
    try:
        return policy, sac, rollouts.next().clone()
    finally:
        rollouts.close()


def test_the_log_probability_is_that_of_tanhnormal():
    loc, scale = torch.randn(64, 3), torch.rand(64, 3) + 0.1
    action, log_prob = sample_tanh_normal(loc, scale, torch.randn(64, 3))
    torch.testing.assert_close(log_prob.squeeze(-1), TanhNormal(loc, scale).log_prob(action), atol=1e-2, rtol=1e-3)


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


def take_step(sac, frames, scenes, threads):
    """What a gradient step measures and its gradients, where torch may use so many threads."""
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        torch.manual_seed(1)
        measured = sac.step(frames.clone(), scenes.clone())
        assert torch.get_num_threads() == threads
    finally:
        torch.set_num_threads(before)
    return measured, [None if p.grad is None else p.grad.clone() for p in sac.learned]


def test_each_loss_trains_its_own_parameters_only(learned, monkeypatch):
    policy, sac, batch = learned
    sac.replay.extend(batch)
    sac.add_batch_scenes(batch, [])
    frames, (scenes,) = sac.replay.sample(32), sac.grounding.sample()
    monkeypatch.setattr("trainers.algorithms.algorithm.nn.utils.clip_grad_norm_", lambda *_: None)
    torch.manual_seed(1)
    losses = sac.losses(frames.clone()) | sac.grounding.measure(scenes.clone())
    words, actor = list(policy.encoder.parameters()), list(policy.actor.parameters())
    own = {
        "loss/critic": sac.critic_parameters,
        "loss/actor": actor,
        "loss/alpha": [sac.log_alpha],
        "loss/grounding": words,
    }
    expected = {}
    for name, parameters in own.items():
        weight = sac.config.grounding_weight if name == "loss/grounding" else 1.0
        grads = torch.autograd.grad(weight * losses[name], parameters, retain_graph=True, allow_unused=True)
        expected |= dict(zip(parameters, grads, strict=True))
    _, gradients = take_step(sac, frames, scenes, threads=1)
    for parameter, gradient in zip(sac.learned, gradients, strict=True):
        torch.testing.assert_close(gradient, expected[parameter])
    assert sum(gradient is not None for gradient in gradients) > len(sac.critic_parameters) + len(actor)


def test_parts_of_a_step_that_run_at_the_same_time_give_the_same_bits(learned):
    _, sac, batch = learned
    sac.replay.extend(batch)
    sac.add_batch_scenes(batch, [])
    frames, (scenes,) = sac.replay.sample(32), sac.grounding.sample()
    (alone, of_one), (together, of_two) = (take_step(copy.deepcopy(sac), frames, scenes, n) for n in (1, 2))
    assert alone == together
    for one, two in zip(of_one, of_two, strict=True):
        assert one is two or torch.equal(one, two)


def test_unsupervised_words_are_trained_by_the_actor_loss():
    env = make_env(8, 0)
    policy, sac = build_algorithm(
        training("sac", overrides=("algo.grounding_weight=0.0",)), env.observation_spec, env.action_unit
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
