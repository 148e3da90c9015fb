"""The adapter trains with TorchRL's off-policy loss modules: replay, targets, grounding and checkpoints."""

import copy
from dataclasses import replace

import pytest
import torch
from torchrl import objectives

from core.errors import ConfigError
from tests.helpers.fake_env import make_env
from tests.helpers.training_configs import training
from trainers.algorithms.algorithm import DivergedError, build_algorithm

ALGOS = ("crossq", "redq", "td3", "tqc")
SMALL = ("algo.batch=16", "algo.learning_starts=16", "algo.updates_per_frame=0.1", "policy.critic_hidden=[16,16]")


def learner(algo, *overrides, policy="grounded"):
    env = make_env(8, 0)
    torch.manual_seed(0)
    made, algorithm = build_algorithm(
        training(algo, policy, (*SMALL, *overrides)), env.observation_spec, env.action_unit, relabel=env.hindsight
    )
    with torch.no_grad():
        batch = env.rollout(5, made.act, break_when_any_done=False)
    return made, algorithm, batch


def snapshot(module):
    return {name: value.detach().clone() for name, value in module.state_dict().items()}


@pytest.mark.slow
@pytest.mark.parametrize("algo", ALGOS)
@pytest.mark.parametrize("policy", ["grounded", "mlp"])
@pytest.mark.parametrize("weight", [0.0, 1.0])
def test_an_update_trains_actor_critics_and_words(algo, policy, weight):
    made, algorithm, batch = learner(algo, f"algo.grounding_weight={weight}", policy=policy)
    before, critics = snapshot(made), snapshot(algorithm.loss.qvalue_network_params)
    measured = algorithm.update(batch, 0.0)
    assert measured["updates"] == 4
    assert set(measured) <= set(algorithm.metrics)
    assert all(torch.isfinite(torch.tensor(value)) for value in measured.values())
    after = snapshot(made)
    changed = {name for name in after if not torch.equal(before[name], after[name])}
    assert any(name.startswith("actor.net") for name in changed)
    assert any(name.startswith("encoder.") for name in changed)
    assert ("loss/grounding" in measured) == (policy == "grounded" and weight > 0)
    learned = snapshot(algorithm.loss.qvalue_network_params)
    assert any(not torch.equal(critics[name], learned[name]) for name in critics)


@pytest.mark.parametrize("algo", ALGOS)
def test_a_critic_without_the_goal_reads_the_context(algo):
    made, algorithm, batch = learner(algo, "policy.privileged_critic=false")
    assert algorithm.critic_keys == ("robot", made.context_key)
    assert algorithm.update(batch, 0.0)["updates"] == 4


@pytest.mark.slow
@pytest.mark.parametrize("algo", ALGOS)
def test_state_dict_restores_networks_targets_and_optimizer(algo):
    _, algorithm, batch = learner(algo)
    algorithm.update(batch, 0.0)
    state = copy.deepcopy(algorithm.state_dict())
    _, other, _ = learner(algo)
    other.load_state_dict(state)
    for name, value in algorithm.loss.state_dict().items():
        if isinstance(value, torch.Tensor):
            assert torch.equal(value, other.loss.state_dict()[name]), name
    assert other.steps_taken == algorithm.steps_taken == 4


@pytest.mark.parametrize(("target", "moved"), [("soft", True), ("hard", False)])
def test_the_target_updater_is_chosen_by_config(target, moved):
    _, algorithm, batch = learner("tqc", f"algo.target={target}", "algo.target_interval=100")
    before = snapshot(algorithm.loss.target_qvalue_network_params)
    algorithm.update(batch, 0.0)
    after = snapshot(algorithm.loss.target_qvalue_network_params)
    assert any(not torch.equal(before[name], after[name]) for name in before) == moved


def test_the_actor_is_trained_on_every_second_step_only():
    _, algorithm, batch = learner("td3", "algo.actor_every=2", "algo.grounding_weight=0.0")
    algorithm.replay.extend(batch)
    measured = [algorithm.step(algorithm.replay.sample(16)) for _ in range(2)]
    assert ["loss/actor" in each for each in measured] == [True, False]


def test_a_deterministic_policy_explores_within_bounds_and_its_noise_declines():
    made, algorithm, batch = learner("td3", "policy.initial_std=1.0", "algo.final_std=0.1")
    assert batch["move"].abs().max() == 1.0
    assert batch["move"].std() > 0.5
    algorithm.update(batch, 1.0)
    assert made.log_stds[0].detach().exp().max() == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("algo.loss=TD3Los", "algo.loss=TD3Los is not known; did you mean 'TD3Loss'"),
        ("algo.loss=nowhere.Loss", "algo.loss=nowhere.Loss is not known"),
        ("+algo.options.polcy_noise=1", "algo.options.polcy_noise is not a parameter of TD3Loss; did you mean"),
        ("algo.loss=PPOLoss", "algo.options.loss_function is not a parameter of PPOLoss"),
        ("algo.final_std=null", "final_std=None must be a number with deterministic=True"),
        ("policy.state_dependent_std=true", "policy.state_dependent_std=true needs an algorithm that learns the noise"),
    ],
)
def test_a_wrong_setting_is_named(override, message):
    with pytest.raises(ConfigError, match=message.replace("(", r"\(")):
        learner("td3", override.removeprefix("+"))


@pytest.mark.slow
@pytest.mark.parametrize("adapter", ["a2c", "td3"])
@pytest.mark.parametrize("loss", [name for name in objectives.__all__ if name.endswith("Loss")])
def test_a_loss_of_torchrl_learns_or_is_refused_in_one_sentence(adapter, loss):
    words = ("algo.minibatch=40",) if adapter == "a2c" else SMALL
    config = training(adapter, "mlp", words)
    config = replace(config, algo=replace(config.algo, loss=loss, options={}))
    env = make_env(8, 0)
    try:
        made, algorithm = build_algorithm(config, env.observation_spec, env.action_unit, relabel=env.hindsight)
        with torch.no_grad():
            batch = env.rollout(5, made.act, break_when_any_done=False)
        measured = algorithm.update(batch, 0.0)
    except DivergedError:
        pass  # of losses for several agents
    except ConfigError as error:
        refused = str(error)
        assert "\n" not in refused
    else:
        assert loss in ("A2CLoss", "ClipPPOLoss", "PPOLoss", "DDPGLoss", "TD3Loss", "TD3BCLoss")
        assert measured
