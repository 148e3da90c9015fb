"""Evaluations in another process: the same results as in this one, whatever happens to that process."""

from __future__ import annotations

import os
import signal
import time
from functools import partial

import pytest
import torch

from core.errors import Interrupted
from tests.helpers.fake_env import WORDS, FakeEnv, make_env
from tests.helpers.training_configs import training
from trainers.algorithms.algorithm import build_algorithm
from trainers.collect.rollouts import CollectionError
from trainers.run.evaluator import EpisodesTask, Evaluator, VideoTask
from trainers.utils.files import WriteError

pytestmark = pytest.mark.slow

NEVER = bool


def slow_env(worlds, seed):
    return FakeEnv(worlds, seed, nap=0.05)


def blind_env(worlds, seed):
    return FakeEnv(worlds, seed, poison=3, poisoned="robot")


@pytest.fixture
def policy():
    torch.manual_seed(0)
    env = make_env(1, 0)
    return build_algorithm(training(), env.observation_spec, env.action_unit, WORDS, env.hindsight)[0]


@pytest.fixture
def evaluator(policy):
    """Builds an evaluator beside this process; all are closed at the end."""
    built = []

    def build(make=make_env):
        built.append(Evaluator(make, policy, worlds=4, seed=7, beside=True))
        return built[-1]

    yield build
    for each in built:
        each.close()


@pytest.fixture
def expected(policy):
    here = Evaluator(make_env, policy, worlds=4, seed=7, beside=False)
    yield here.evaluate(policy, 12, 1, NEVER)
    here.close()


def test_the_result_is_that_of_this_process_and_of_the_weights_that_were_given(policy, evaluator, expected):
    beside, weights = evaluator(), {name: value.clone() for name, value in policy.state_dict().items()}
    beside.request(weights, 12, 1)
    for value in weights.values():
        value.zero_()
    assert beside.result(True, NEVER) == expected
    assert beside.env is None


def test_it_goes_on_while_this_process_does_something_else(policy, evaluator, expected):
    beside = evaluator(slow_env)
    beside.request(policy.state_dict(), 12, 1)
    assert beside.result(False, NEVER) is None
    with pytest.raises(Interrupted):
        beside.result(True, lambda: True)
    assert beside.result(True, NEVER) == expected


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_this_process_does_the_work_of_one_that_was_lost(
    policy, evaluator, expected, monkeypatch, capsys, tmp_path, number
):
    monkeypatch.setattr(EpisodesTask, "silence", 0.5)
    beside = evaluator(slow_env)
    beside.request(policy.state_dict(), 12, 1)
    os.kill(beside.process.process.pid, number)
    beside.make_worlds = partial(make_env, *beside.make_worlds.args)
    assert beside.result(True, NEVER) == expected
    assert "warning: the evaluation process" in capsys.readouterr().err
    beside.request(policy.state_dict(), 12, 1)
    assert beside.result(False, NEVER) == expected


def test_what_the_environment_raises_is_raised_here_with_its_frame(policy, evaluator):
    beside = evaluator(blind_env)
    beside.request(policy.state_dict(), 12, 1)
    with pytest.raises(CollectionError, match="an evaluation raised NotFiniteError: the observation robot") as raised:
        beside.result(True, NEVER)
    assert raised.value.__cause__.frame["robot"].isnan().any()


def test_a_video_is_recorded_beside_this_process_or_here(policy, evaluator, tmp_path):
    beside = evaluator()
    for name in ("beside.mp4", "here.mp4"):
        beside.request_video(policy.state_dict(), VideoTask(partial(make_env, 1, 9), tmp_path / name, 1))
        if name == "here.mp4":
            beside.process.process.kill()
        beside.finish_video()
    assert beside.process is None
    assert min((tmp_path / name).stat().st_size for name in ("beside.mp4", "here.mp4")) > 1000


def test_the_error_of_a_video_is_raised_as_it_is(policy, evaluator, tmp_path):
    beside = evaluator()
    beside.request_video(policy.state_dict(), VideoTask(partial(make_env, 1, 9), tmp_path / "absent" / "a.mp4", 1))
    with pytest.raises(WriteError, match="absent"):
        beside.finish_video()


def test_the_process_ends_with_the_evaluator(policy):
    beside = Evaluator(slow_env, policy, worlds=4, seed=7, beside=True)
    beside.request(policy.state_dict(), 12, 1)
    process = beside.process.process
    beside.close()
    deadline = time.monotonic() + 10
    while process.is_alive() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not process.is_alive()
