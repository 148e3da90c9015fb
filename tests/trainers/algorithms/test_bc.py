"""Imitation of an expert that labels every state."""

import pytest
import torch

from core.errors import ConfigError
from tests.helpers.labelled_fake_env import LABEL, make_labelled
from tests.helpers.training_configs import training
from trainers.algorithms.algorithm import DivergedError, build_algorithm
from trainers.collect.rollouts import Rollouts
from trainers.evaluation.evaluation import evaluate


def build(*overrides, policy="grounded"):
    small = training("bc", policy, overrides=overrides)
    env = make_labelled(8, 0)
    torch.manual_seed(0)
    return small, *build_algorithm(small, env.observation_spec, env.action_unit)


def train(small, bc, updates):
    rollouts, env = Rollouts(make_labelled, bc.behaviour, small.collector, horizon=16, seed=0), make_labelled(8, 5)
    measured = []
    try:
        for i in range(updates):
            rollouts.sync(bc.behaviour)
            bc.add_scenes(env.draw_scenes(32, i))
            measured.append(bc.update(rollouts.next(), i / updates))
    finally:
        rollouts.close()
    return measured


@pytest.fixture
def batch():
    small, _, bc = build()
    rollouts = Rollouts(make_labelled, bc.behaviour, small.collector, horizon=16, seed=0)
    try:
        return rollouts.next().clone()
    finally:
        rollouts.close()


@pytest.mark.slow
@pytest.mark.parametrize("policy", ["grounded", "mlp"])
def test_it_learns_to_do_what_the_expert_does(policy):
    small, learned, bc = build("algo.updates_per_frame=0.5", "algo.grounding_every=1", policy=policy)
    measured = train(small, bc, 18)
    assert measured[-1]["loss/imitation"] < measured[0]["loss/imitation"] / 2
    if policy == "grounded":  # without attention, words take longer
        assert evaluate(make_labelled(8, 3), learned.act, 80, 3).success_at_end > 0.9


@pytest.mark.slow
def test_the_experts_share_falls_to_zero_over_its_part_of_the_run():
    small, _, bc = build("algo.expert_until=0.5")
    shares = [row["expert_share"] for row in train(small, bc, 4)]
    assert shares == [1.0, 1.0, 0.5, 0.0]  # of the batch that was collected with it
    assert float(bc.mixture.expert_share) == 0.0


def test_measured_names_are_declared_and_steps_keep_their_ratio_to_frames(batch):
    _, _, bc = build("algo.updates_per_frame=0.1")
    steps = [bc.update(batch, 0.0)["updates"] for _ in range(5)]
    assert sum(steps) == 5 * 128 // 10
    assert set(bc.update(batch, 0.0)) <= set(bc.metrics)


def test_all_frames_are_kept_with_the_experts_move_whoever_acted(batch):
    _, policy, bc = build()
    bc.update(batch, 0.0)
    bc.update(batch, 0.0)
    assert len(bc.frames) == 2 * batch.numel()
    kept = bc.labelled(batch.reshape(-1))
    torch.testing.assert_close(kept["move"], batch[LABEL].reshape(-1, 3) / policy.action_unit)
    assert set(kept.keys()) == {"robot", "referent", "move"}  # the rows of the labelled slots, no words


@pytest.mark.slow
def test_a_move_that_was_the_largest_for_long_can_still_be_reversed_in_some_states(batch):
    """Like the command of a gripper that opens only at the goal: its mean saturated, and never recovered."""
    _, policy, bc = build("algo.grounding_weight=0")
    frames = batch.reshape(-1)
    first = frames["robot"][:, 0]
    for some, steps in ((first > first.max(), 700), (first > first.quantile(0.8), 600)):
        frames[LABEL] = frames["hold"] + policy.action_unit * (1 - 2 * some[:, None].float())
        labelled = bc.labelled(frames)
        for _ in range(steps):
            bc.step(labelled.clone())
    loc, _ = policy.move_parameters(policy.encode(labelled))
    assert (loc[some] < 0).float().mean() > 0.9
    assert (loc[~some] > 0).float().mean() > 0.9


def test_the_words_are_learned_with_the_move_where_they_are_not_supervised(batch):
    _, policy, bc = build("algo.grounding_weight=0")
    bc.update(batch, 0.0)
    frames = bc.frames.sample(32)
    assert {"instruction", "objects", "objects_mask", "robot", "move"} <= set(frames.keys())
    bc.step(frames)
    assert policy.encoder.query_encoder.word_embedding.weight.grad.abs().sum() > 0


def test_the_noise_is_that_of_the_settings():
    _, policy, _ = build("algo.std=0.05")
    for log_std in policy.log_stds:
        torch.testing.assert_close(log_std.exp(), torch.full_like(log_std, 0.05))


def test_a_label_that_is_not_finite_stops_the_run(batch):
    _, _, bc = build()
    batch[LABEL][0, 0] = float("nan")
    bc.frames.extend(bc.labelled(batch.reshape(-1))[:1].expand(32).clone())
    with pytest.raises(DivergedError, match="the loss became nan"):
        bc.step(bc.frames.sample(32))


def test_a_buffer_that_holds_no_batch_is_refused():
    with pytest.raises(ConfigError, match=r"algo\.buffer=100 must hold a batch of 128 frames"):
        training("bc", overrides=("algo.buffer=100", "algo.horizon=16"))
