"""The grounding loss on unsimulated scenes trains the attention."""

import itertools

import pytest
import torch

from tests.helpers.env_cases import make
from tests.helpers.fake_env import make_env
from tests.helpers.training_configs import training
from trainers.algorithms.algorithm import build_algorithm


def learner(*overrides):
    env = make_env(8, 0)
    torch.manual_seed(0)
    return build_algorithm(training(overrides=overrides), env.observation_spec, env.action_unit)[1]


@pytest.mark.slow
def test_unsimulated_scenes_train_the_attention():
    env = make_env(8, 0)
    torch.manual_seed(0)
    policy, learner = build_algorithm(training(), env.observation_spec, env.action_unit)
    learner.add_scenes(env.draw_scenes(500, 1))
    held_out = env.draw_scenes(200, 2)
    optimizer = torch.optim.Adam(policy.parameters(), lr=3e-3)
    before = float(learner.grounding.measure(held_out.clone())["grounding/accuracy"])
    for _ in range(150):
        scenes = policy.encode(learner.grounding.scenes.sample(64))
        loss = torch.nn.functional.cross_entropy(scenes["attention_logits"], scenes["privileged", "referent"])
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert learner.grounding.measure(held_out.clone())["grounding/accuracy"] > max(0.9, before)


@pytest.mark.parametrize(
    ("error", "gain", "share"), [(1.0, 20.0, 1.0), (0.02, 20.0, 0.4), (0.0, 20.0, 0.125), (0.0, None, 1.0)]
)
def test_words_are_learned_in_proportion_to_what_is_read_wrong(error, gain, share):
    grounding, parts = learner(f"algo.grounding_gain={'null' if gain is None else gain}").grounding, range(80)
    grounding.add(make_env(8, 0).draw_scenes(40, 0))
    grounding.error = error
    paired = list(grounding.paired(parts, len(parts), grounding.share))
    chosen = [i for i, scenes in paired if scenes is not None]
    assert [i for i, _ in paired] == list(parts)
    assert len(chosen) == share * len(parts)
    assert all(len(scenes) == grounding.config.grounding_batch for _, scenes in paired if scenes is not None)
    gaps = {later - i for i, later in itertools.pairwise(chosen)}
    assert max(gaps) - min(gaps) <= 1
    assert grounding.scenes_per_update == -(-grounding.config.grounding_scenes * share // 1)


def test_the_error_follows_the_scenes_that_were_not_learned_from():
    algorithm, env = learner(), make_env(8, 0)
    assert algorithm.grounding.error == 1.0
    accuracy = algorithm.grounding.measure_fresh(env.draw_scenes(40, 0))
    assert algorithm.grounding.error == pytest.approx(1 - 0.5 * accuracy)
    other = learner()
    other.load_running_state(algorithm.running_state())
    assert other.grounding.error == algorithm.grounding.error


def test_simulated_scenes_are_kept_beside_drawn_ones_with_more_slots_and_read_alike():
    env = make("kuka", "step", "nl_reach", worlds=4)
    torch.manual_seed(0)
    policy, learner = build_algorithm(training(), env.observation_spec, env.action_unit)
    grounding = learner.grounding
    grounding.add(env.draw_scenes(8, 0).select(*grounding.keys))
    simulated = env.reset().select(*grounding.keys)
    grounding.add(simulated)
    env.close()
    kept = grounding.scenes[8:]
    assert kept["objects"].shape[1] == 5 > simulated["objects"].shape[1]
    logits = [policy.encode(scenes.clone())["attention_logits"] for scenes in (simulated, kept)]
    torch.testing.assert_close(logits[1][:, : logits[0].shape[1]], logits[0])
    assert (logits[1].argmax(-1) < logits[0].shape[1]).all()
