"""The grounding loss on unsimulated scenes trains the attention."""

import pytest
import torch

from tests.helpers.fake_env import make_env
from tests.helpers.plans import plan
from trainers.algorithms.build import build_algorithm


@pytest.mark.slow
def test_unsimulated_scenes_train_the_attention():
    env = make_env(8, 0)
    torch.manual_seed(0)
    policy, learner = build_algorithm(plan(), env.observation_spec, env.action_unit)
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
