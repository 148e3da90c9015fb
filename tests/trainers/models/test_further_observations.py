"""Networks read the observations that the environment declares a reader for."""

import pytest
import torch
from torchrl.data import Binary, Bounded, Unbounded
from torchrl.envs.utils import ExplorationType, set_exploration_type

from core.errors import ConfigError
from tests.helpers.fake_env import SLOTS, FakeEnv
from tests.helpers.training_configs import training
from trainers.algorithms.algorithm import build_algorithm
from trainers.environment import DEFAULT_READERS, keys_read, readers_of
from trainers.models.policy import LABEL

WORLDS = 4
SPECS = {
    "clock": Bounded(torch.zeros(WORLDS, 1), torch.ones(WORLDS, 1)),
    "flags": Binary(2, (WORLDS, 2), dtype=torch.bool),
    "temperature": Bounded(torch.zeros(WORLDS, SLOTS, 2), torch.ones(WORLDS, SLOTS, 2)),
}


class Instrumented(FakeEnv):
    """The fake environment with one observation more, and its reader."""

    def __init__(self, key, reader):
        super().__init__(WORLDS, 0)
        self.key, self.readers = key, DEFAULT_READERS | {key: reader}
        spec = self.observation_spec.clone()
        spec[key] = SPECS[key].clone()
        self.observation_spec = spec

    def _observe(self, *args):
        observed = super()._observe(*args)
        spec = SPECS[self.key]
        value = torch.rand(spec.shape)
        return observed.set(self.key, value > 0.5 if spec.dtype == torch.bool else value)


def built(env, algo="ppo", policy="grounded", readers=None, overrides=()):
    torch.manual_seed(0)
    small = training(algo, policy, overrides)
    unit, relabel = env.action_unit, env.hindsight
    return build_algorithm(small, env.observation_spec, unit, (), relabel, readers or readers_of(env))


def test_an_environment_without_readers_has_the_default_ones():
    env = FakeEnv(1, 0)
    assert readers_of(env) == DEFAULT_READERS
    assert keys_read(readers_of(env), "scene", env.observation_spec) == ["objects", "objects_mask", "instruction"]
    assert keys_read(readers_of(env), "critic", env.observation_spec) == [("privileged", "goal")]


@pytest.mark.parametrize("policy", ["grounded", "mlp"])
@pytest.mark.parametrize(("key", "reader"), [(key, reader) for key in SPECS for reader in ("actor", "scene")])
def test_the_action_depends_on_what_the_policy_reads(key, reader, policy):
    env = Instrumented(key, reader)
    made, _ = built(env, policy=policy)
    assert key in made.act.in_keys
    frames = env.reset()
    other = frames.clone()
    other[key] = ~other[key] if key == "flags" else 1 - other[key]
    with set_exploration_type(ExplorationType.DETERMINISTIC), torch.no_grad():
        torch.nn.init.normal_(made.actor.net[-1].weight)  # the first mean is nearly 0 whatever is read
        first, second = made.act(frames.clone())["action"], made.act(other)["action"]
    assert not torch.equal(first, second)


@pytest.mark.slow
@pytest.mark.parametrize("reader", ["actor", "scene", "critic"])
@pytest.mark.parametrize("algo", ["ppo", "sac"])
def test_an_update_trains_the_weights_of_a_further_observation(reader, algo):
    env = Instrumented("clock", reader)
    _, algorithm = built(env, algo)
    _, plain = built(env, algo, readers=DEFAULT_READERS)
    layer, column = first_layer(algorithm, reader)
    assert layer.in_features == first_layer(plain, reader)[0].in_features + 1
    before = layer.weight[:, column].clone()
    update(env, algorithm)
    assert (layer.weight[:, column] != before).any()


@pytest.mark.slow
@pytest.mark.parametrize("reader", ["actor", "scene", "critic"])
@pytest.mark.parametrize("algo", ["a2c", "bc", "td3"])
def test_other_algorithms_learn_with_a_further_observation(reader, algo):
    env = Instrumented("clock", reader)
    _, algorithm = built(env, algo)
    assert update(env, algorithm)


def update(env, algorithm):
    """The values that the last of three updates measures."""
    for index in range(3):
        algorithm.add_scenes(env.draw_scenes(32, index).set("clock", torch.rand(32, 1)))
        with torch.no_grad():
            batch = env.rollout(32, algorithm.policy.act, break_when_any_done=False)
        measured = algorithm.update(batch.set(LABEL, batch["action"]), 0.0)
    return {name: value for name, value in measured.items() if name.startswith("loss/")}


def first_layer(algorithm, reader):
    """The linear layer that meets the clock first, and the clock's place among its inputs."""
    if reader == "actor":
        return algorithm.policy.actor.net[0], -1
    if reader == "scene":
        return algorithm.policy.encoder.slot_linear, -1
    critic = getattr(algorithm.critic, "module", algorithm.critic)
    return critic.heads[0][0], sum(each.shape.numel() for each in critic.inputs[:2])  # after robot and goal


def test_a_privileged_observation_is_read_by_critics_that_are_given_the_goal_alone():
    key = ("privileged", "force")
    env = FakeEnv(WORLDS, 0)
    spec = env.observation_spec.clone()
    spec[key] = SPECS["clock"].clone()
    env.observation_spec = spec
    readers = DEFAULT_READERS | {key: "critic"}
    for given in (True, False):
        _, algorithm = built(env, readers=readers, overrides=(f"policy.privileged_critic={given}".lower(),))
        assert (key in algorithm.critic.in_keys) == given


@pytest.mark.parametrize(
    ("spec", "reader", "message"),
    [
        (
            Unbounded((WORLDS, 1)),
            "actor",
            "clock cannot have reader=actor: an observation without",
        ),
        (
            Bounded(0, 1, (WORLDS, SLOTS + 1, 2)),
            "scene",
            r"clock of shape \(4, 2\) cannot have reader=scene: it",
        ),
    ],
)
def test_an_observation_that_no_network_can_read_is_named(spec, reader, message):
    env = FakeEnv(WORLDS, 0)
    whole = env.observation_spec.clone()
    whole["clock"] = spec
    env.observation_spec = whole
    with pytest.raises(ConfigError, match=message):
        built(env, readers=DEFAULT_READERS | {"clock": reader})
