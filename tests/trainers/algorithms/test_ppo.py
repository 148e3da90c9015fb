import pytest
import torch
from tensordict import TensorDict

from tests.helpers.fake_env import make_env
from tests.helpers.training_configs import training
from trainers.algorithms.algorithm import DivergedError, build_algorithm
from trainers.algorithms.on_policy import OnPolicyAlgorithm, advantages
from trainers.algorithms.ppo import MAX_WEIGHT
from trainers.collect.rollouts import Rollouts

GAMMA, LMBDA = 0.9, 0.8


def after(reward, terminated, truncated):
    flags = {"terminated": torch.tensor(terminated), "truncated": torch.tensor(truncated)}
    flags["done"] = flags["terminated"] | flags["truncated"]
    flags["reward"] = torch.tensor(reward)
    return TensorDict({k: v.reshape(1, 3, 1) for k, v in flags.items()}, [1, 3])


@pytest.mark.parametrize("truncated", [True, False])
def test_advantages_equal_those_computed_by_hand(truncated):
    """Three steps, the second of which ends an episode. Values 1, 2, 3; next values 2, 10 (the end), 4."""
    value, next_value = torch.tensor([1.0, 2, 3]).reshape(1, 3, 1), torch.tensor([2.0, 10, 4]).reshape(1, 3, 1)
    ends, none = [False, True, False], [False] * 3
    step = after([0.5, 1.0, 0.0], none if truncated else ends, ends if truncated else none)
    advantage, target = advantages(step, value, next_value, GAMMA, LMBDA)
    last = 0.0 + GAMMA * 4 - 3
    ended = 1.0 + (GAMMA * 10 if truncated else 0.0) - 2  # truncation bootstraps
    first = 0.5 + GAMMA * 2 - 1 + GAMMA * LMBDA * ended
    torch.testing.assert_close(advantage.flatten(), torch.tensor([first, ended, last]))
    torch.testing.assert_close(target, advantage + value)


def learner(*overrides):
    env = make_env(8, 0)
    torch.manual_seed(0)
    return build_algorithm(training(overrides=overrides), env.observation_spec, env.action_unit)


def batch_of(policy):
    rollouts = Rollouts(make_env, policy, training().collector, horizon=16, seed=0)
    try:
        return rollouts.next().clone()
    finally:
        rollouts.close()


@pytest.mark.slow
@pytest.mark.parametrize("weight", [0.0, 1.0])
def test_the_grounding_loss_is_computed_only_with_a_weight(weight):
    policy, ppo = learner(f"algo.grounding_weight={weight}", "algo.epochs=30", "algo.anneal_lr=false")
    measured = ppo.update(batch_of(policy), 0.0)
    assert ("grounding/accuracy" in measured) == bool(weight)
    assert set(measured) <= set(ppo.metrics)


def test_without_the_grounding_loss_the_actor_trains_the_words():
    policy, ppo = learner("algo.grounding_weight=0.0")
    before = policy.encoder.query_encoder.word_embedding.weight.clone()
    ppo.update(batch_of(policy), 0.0)
    assert not torch.equal(before, policy.encoder.query_encoder.word_embedding.weight)


@pytest.mark.parametrize("weight", [0.0, 1.0])
def test_clipping_bounds_the_update_alone_where_an_older_policy_has_acted(weight):
    policy, ppo = learner(f"algo.grounding_weight={weight}")
    batch = batch_of(policy)
    plain = OnPolicyAlgorithm.compute_advantages(ppo, batch)[0]["advantage"]
    torch.testing.assert_close(ppo.compute_advantages(batch)[0]["advantage"], plain)  # this policy has acted
    before = batch["move_log_prob"].reshape(-1).clone()
    batch["move"] += 0.3  # as if another policy had drawn them
    frames, _ = ppo.compute_advantages(batch)
    likelier = (frames["move_log_prob"] - before).exp()
    assert (likelier > MAX_WEIGHT).any()
    assert (likelier < 0.5).any()
    torch.testing.assert_close(frames["advantage"], plain * likelier.clamp_max(MAX_WEIGHT)[:, None])
    measured = ppo.compute_losses(frames if weight else policy.encode(frames))
    assert abs(measured["kl"]) < 1e-5
    assert measured["clip_fraction"] == 0


def test_the_learning_rate_is_annealed():
    policy, ppo = learner()
    assert ppo.update(batch_of(policy), 0.75)["lr"] == pytest.approx(0.25 * ppo.config.lr)


@pytest.mark.parametrize(("final", "expected"), [("0.98", 0.96), ("null", 0.9)])
def test_the_discount_factor_goes_to_its_final_value(final, expected):
    policy, ppo = learner("algo.gamma=0.9", f"algo.final_gamma={final}")
    batch = batch_of(policy)
    ppo.update(batch, 0.75)
    value, next_value = ppo.value(batch), ppo.value(batch["next"])
    _, target = advantages(batch["next"], value, next_value, expected, ppo.config.lmbda)
    measured = ppo.compute_advantages(batch)[0]["value_target"].reshape(target.shape)
    torch.testing.assert_close(measured, target)


@pytest.mark.parametrize("key", [("next", "reward"), "robot", ("next", "objects")])
def test_a_value_that_is_not_finite_stops_an_update_before_it_changes_parameters(key):
    policy, ppo = learner()
    batch, before = batch_of(policy), [p.clone() for p in ppo.parameters]
    batch[key].view(-1)[5] = float("inf")
    with pytest.raises(DivergedError, match="not finite"):
        ppo.update(batch, 0.0)
    assert all(torch.equal(a, b) for a, b in zip(before, ppo.parameters, strict=True))
