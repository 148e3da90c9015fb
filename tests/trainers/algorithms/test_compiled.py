"""Compiled losses: the same gradient steps as without compilation, and the choice for a run."""

import copy
import os

import pytest
import torch
from tensordict import TensorDict

from core.errors import ConfigError
from tests.helpers.labelled_fake_env import make_labelled
from tests.helpers.thorough import some
from tests.helpers.training_configs import training
from trainers.algorithms.algorithm import adam_step, build_algorithm, run_parts
from trainers.algorithms.compiled import CACHE, CACHE_VARIABLE, CompiledLosses, LossGradients, choose_cache
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


class TwoLosses(torch.nn.Module):
    """A loss of each of two layers; the first changes a buffer, which the second reads, and both draw numbers."""

    def __init__(self):
        super().__init__()
        self.first, self.second = torch.nn.Linear(3, 2), torch.nn.Linear(3, 2)
        self.register_buffer("mean", torch.zeros(2))

    def forward(self, frames):
        value = self.first(frames["x"]) + torch.randn(len(frames), 2)
        self.mean += 0.5 * value.detach().mean(0)
        other = self.second(frames["x"]) + torch.randn(len(frames), 2) - self.mean
        return {"loss/first": value.square().mean(), "loss/second": other.square().mean(), "mean": self.mean.sum()}


@needs_compiler
def test_losses_without_a_common_product_are_parts_with_the_same_numbers():
    torch.manual_seed(0)
    frames = TensorDict({"x": torch.randn(8, 3)}, [8])
    plain = TwoLosses()
    compiled = copy.deepcopy(plain)
    for _ in range(2):  # the second call finds the buffer as the first has left it
        rows, counts = [], []
        for module, kind in ((plain, LossGradients), (compiled, CompiledLosses)):
            learned, buffers = list(module.parameters()), list(module.buffers())
            gradients = kind(module, learned, buffers) if kind is CompiledLosses else kind(module, learned)
            torch.manual_seed(1)
            parts = gradients.parts(frames)
            counts.append(len(parts))
            rows.append(run_parts(parts))
        assert counts == [1, 2]
        for name, value in rows[0].items():
            torch.testing.assert_close(rows[1][name], value)
        for ours, theirs in zip(compiled.parameters(), plain.parameters(), strict=True):
            torch.testing.assert_close(ours.grad, theirs.grad)
        torch.testing.assert_close(compiled.mean, plain.mean)


def test_a_step_of_each_half_of_the_parameters_is_a_step_of_the_optimizer():
    torch.manual_seed(0)
    ours = [torch.randn(5, 4, requires_grad=True) for _ in range(4)]
    theirs = copy.deepcopy(ours)
    made, plain = (
        torch.optim.Adam([{"params": each[:3], "lr": 0.1}, {"params": each[3:], "lr": 0.01}], fused=True)
        for each in (ours, theirs)
    )
    for _ in range(3):
        for mine, its in zip(ours[:-1], theirs[:-1], strict=True):  # the last one has no gradient
            mine.grad = torch.randn_like(mine)
            its.grad = mine.grad.clone()
        adam_step(made, ours[:2])
        adam_step(made, ours[2:])
        plain.step()
    for mine, its in zip(ours, theirs, strict=True):
        assert torch.equal(mine, its)
    state, expected = (tensors(each.state_dict()["state"]) for each in (made, plain))
    assert state.keys() == expected.keys()
    assert all(torch.equal(state[place], value) for place, value in expected.items())


def test_what_is_compiled_is_kept_where_a_restart_does_not_empty_it(monkeypatch):
    from torch._inductor.runtime.cache_dir_utils import default_cache_dir

    monkeypatch.setenv(CACHE_VARIABLE, default_cache_dir())  # as an import of torch's compiler sets it
    choose_cache()
    assert os.environ[CACHE_VARIABLE] == str(CACHE.expanduser())
    monkeypatch.setenv(CACHE_VARIABLE, "/a/folder/of/the/user")
    choose_cache()
    assert os.environ[CACHE_VARIABLE] == "/a/folder/of/the/user"


@needs_compiler
def test_what_was_compiled_once_is_not_generated_again(monkeypatch, tmp_path):
    from torch._dynamo.utils import counters

    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    kinds = "fxgraph_cache_hit", "fxgraph_cache_miss"
    found = []
    for seed in range(2):  # of weights and frames, which compiled functions do not contain
        torch.manual_seed(seed)
        layer, before = torch.nn.Linear(3, 2), [counters["inductor"][kind] for kind in kinds]
        gradients = CompiledLosses(
            lambda frames, layer=layer: {"loss": layer(frames["x"]).mean()}, [*layer.parameters()]
        )
        gradients.parts(TensorDict({"x": torch.randn(8, 3)}, [8]))
        found.append([counters["inductor"][kind] - count for kind, count in zip(kinds, before, strict=True)])
    assert found == [[0, 1], [1, 0]]


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
