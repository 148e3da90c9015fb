"""Compiled losses: the same gradient steps as without compilation, and the choice for a run."""

import pytest
import torch

from core.errors import ConfigError
from tests.helpers.labelled_fake_env import make_labelled
from tests.helpers.thorough import some
from tests.helpers.training_configs import training
from trainers.algorithms.algorithm import build_algorithm
from trainers.algorithms.settings import find_compiler

ALGOS = "sac", "bc", "crossq", "td3", "tqc", "redq"
STEPS = 200
SMALL = ("algo.batch=16", "policy.critic_hidden=[16,16]", "policy.hidden=[16,16]")

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler is installed")


def steps_of(algo, compile, policy="grounded", overrides=()):
    """What STEPS gradient steps measure, and the state after them."""
    env = make_labelled(8, 0)
    torch.manual_seed(0)
    config = training(algo, policy, (*SMALL, *overrides, f"algo.compile='{compile}'"))
    made, algorithm = build_algorithm(config, env.observation_spec, env.action_unit)
    with torch.no_grad():
        batch = env.rollout(20, made.act, break_when_any_done=False)
    algorithm.grounding.add(batch.reshape(-1).select(*algorithm.grounding.keys))
    if algo == "bc":
        algorithm.frames.extend(algorithm.labelled(batch.reshape(-1)))
    else:
        algorithm.replay.extend(batch)
    torch.manual_seed(1)
    measured = algorithm.learn(STEPS)
    return measured, algorithm.state_dict()


def tensors(state):
    """The tensors of nested dicts and lists, by their place."""
    if isinstance(state, torch.Tensor):
        return {"": state}
    items = state.items() if isinstance(state, dict) else enumerate(state) if isinstance(state, list) else ()
    return {f"{key}/{place}": value for key, each in items for place, value in tensors(each).items()}


def assert_same_steps(algo, policy, *overrides):
    plain, plain_state = steps_of(algo, "off", policy, overrides)
    compiled, compiled_state = steps_of(algo, "on", policy, overrides)
    assert len(plain) == len(compiled) == STEPS
    for ours, theirs in zip(compiled, plain, strict=True):
        assert ours.keys() == theirs.keys()
        for name in ours:
            torch.testing.assert_close(ours[name], theirs[name], rtol=1e-3, atol=1e-4, msg=name)
    plain_tensors, compiled_tensors = tensors(plain_state), tensors(compiled_state)
    assert plain_tensors.keys() == compiled_tensors.keys()
    for place, value in plain_tensors.items():
        torch.testing.assert_close(compiled_tensors[place], value, rtol=1e-3, atol=1e-4, msg=place)


@pytest.mark.slow
@pytest.mark.sampled
@needs_compiler
@pytest.mark.parametrize("policy", ["grounded", "mlp"])
@pytest.mark.parametrize("algo", some(ALGOS, 3))
def test_compiled_steps_of_every_algorithm_are_those_without_compilation(algo, policy):
    assert_same_steps(algo, policy, "algo.grounding_weight=0" if policy == "mlp" else "algo.grounding_weight=1")


def test_training_goes_on_where_nothing_can_be_compiled(monkeypatch, capsys):
    def fails(*_, **__):
        raise RuntimeError("no Python.h")

    monkeypatch.setattr(torch._inductor, "compile", fails)
    assert_same_steps("sac", "mlp")
    assert "warning: gradient steps are not compiled, and training goes on: no Python.h" in capsys.readouterr().err


def choice(compile, frames, device="cpu"):
    return training("sac", overrides=(f"algo.compile='{compile}'",)).algo.choose_compilation(frames, device)


@needs_compiler
def test_long_runs_on_a_cpu_are_compiled():
    assert choice("auto", 20_000) == "on"  # a gradient step for each fourth frame
    assert choice("auto", 19_996) == "off"
    assert choice("auto", 20_000, "cuda") == "off"
    assert choice("on", 4) == "on"
    assert choice("off", 10**6) == "off"


def test_nothing_is_compiled_without_a_compiler(monkeypatch):
    monkeypatch.setenv("CXX", "no-such-compiler")
    assert choice("auto", 10**6) == "off"
    with pytest.raises(ConfigError, match=r"algo\.compile=on requires a C\+\+ compiler"):
        choice("on", 10**6)


def test_compilation_on_another_device_is_refused():
    with pytest.raises(ConfigError, match=r"algo\.compile=on requires device=cpu, not cuda"):
        choice("on", 10**6, "cuda")
