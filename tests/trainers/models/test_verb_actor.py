"""An actor of one network for each verb (policy.by_verb)."""

import pytest
import torch
from torchrl.data import Bounded, Categorical
from torchrl.envs.utils import ExplorationType, set_exploration_type

from core.errors import ConfigError
from tests.helpers.fake_env import make_env
from tests.helpers.training_configs import training
from trainers.models.grounding import VERB, VERB_LOGITS
from trainers.models.networks import GaussianActor, Normalise, VerbActor
from trainers.models.policy import build_policy

VERBS, ROWS = 3, 5  # verbs, and the other numbers of the context


@pytest.fixture(scope="module")
def env():
    return make_env(8, 0)


@pytest.fixture
def actor():
    torch.manual_seed(0)
    robot = Normalise(Bounded(-torch.ones(1, 4), torch.ones(1, 4)))
    actors = [
        GaussianActor(
            robot,
            context=ROWS + VERBS,
            hidden=[8],
            actions=2,
            activation="elu",
            std=0.1 * (1 + i),
            state_dependent_std=False,
        )
        for i in range(VERBS)
    ]
    for each in actors:
        torch.nn.init.normal_(each.net[-1].weight)
    return VerbActor(actors)


def context_of(probabilities):
    return torch.cat([torch.ones(1, ROWS), torch.tensor([probabilities])], -1)


@pytest.mark.parametrize("verb", range(VERBS))
def test_a_verb_that_is_certain_acts_alone(actor, verb):
    robot, context = torch.rand(1, 4), context_of(torch.eye(VERBS)[verb].tolist())
    for mixed, alone in zip(actor(robot, context), actor.stages[verb](robot, context), strict=True):
        torch.testing.assert_close(mixed, alone)


def test_verbs_are_weighed_by_their_probabilities(actor):
    robot, context = torch.rand(1, 4), context_of([0.25, 0.0, 0.75])
    first, _, last = (each(robot, context)[0] for each in actor.stages)
    torch.testing.assert_close(actor(robot, context)[0], 0.25 * first + 0.75 * last)


def test_a_policy_has_one_network_for_each_verb_and_acts_with_that_of_the_likeliest(env):
    spec = env.observation_spec.clone()
    spec[VERB] = Categorical(VERBS, shape=(8,), dtype=torch.int64)
    policy = build_policy(training(overrides=("policy.by_verb=true",)).policy, spec, env.action_unit)
    assert len(policy.log_stds) == VERBS
    with set_exploration_type(ExplorationType.DETERMINISTIC), torch.no_grad():
        frames = policy.act(env.reset())
    verbs = frames[VERB_LOGITS].argmax(-1)
    alone = [policy.actor.stages[int(verb)](*row)[0] for verb, *row in rows_of(frames, verbs)]
    torch.testing.assert_close(frames["move"], torch.cat(alone))


def rows_of(frames, verbs):
    return zip(verbs, frames["robot"].split(1), frames["referent"].split(1), strict=True)


def test_a_task_with_one_verb_is_refused(env):
    with pytest.raises(ConfigError, match=r"policy\.by_verb=true needs a task that has several verbs"):
        build_policy(training(overrides=("policy.by_verb=true",)).policy, env.observation_spec, env.action_unit)


def test_networks_for_stages_and_for_verbs_are_refused():
    with pytest.raises(ConfigError, match=r"policy\.by_verb=true needs networks=1"):
        training(overrides=("policy.by_verb=true", "policy.networks=2"))
