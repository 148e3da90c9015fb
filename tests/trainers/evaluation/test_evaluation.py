"""Evaluation: confidence intervals, and which episodes are counted."""

from __future__ import annotations

import pytest
import torch
from tensordict.nn import TensorDictModule

from core.errors import Interrupted
from tests.helpers.fake_env import FakeEnv, make_env
from tests.helpers.fake_expert import EXPERT
from trainers.evaluation.evaluation import evaluate, quotas, wilson


@pytest.mark.parametrize(
    ("k", "n", "low", "high"),
    [(0, 10, 0.0, 0.2775), (5, 10, 0.2366, 0.7634), (485, 500, 0.9512, 0.9817), (500, 500, 0.9924, 1.0)],
)
def test_wilson_against_known_values(k, n, low, high):
    assert wilson(k, n) == pytest.approx((low, high), abs=2e-4)


def test_wilson_of_no_trials_is_the_unit_interval():
    assert wilson(0, 0) == (0.0, 1.0)


def test_quotas_share_the_episodes_among_the_worlds():
    assert quotas(10, 4) == [3, 3, 2, 2]
    assert quotas(2, 4) == [1, 1, 0, 0]


@pytest.mark.parametrize("episodes", [3, 8, 21])
def test_exactly_the_requested_number_of_episodes_is_counted(episodes):
    result = evaluate(make_env(8, 0), EXPERT, episodes, seed=3)
    assert result.episodes == episodes == sum(kind.episodes for kind in result.by_kind.values())
    assert set(result.by_kind) <= {"odd", "even"}


def test_an_expert_succeeds_and_the_same_seed_gives_the_same_result():
    first, second = (evaluate(make_env(8, i), EXPERT, 40, seed=3) for i in range(2))
    assert first == second
    assert first.success_at_end > 0.9
    assert first.success_once >= first.success_at_end


class Uneven(FakeEnv):
    """World 0 fails after one step, the others succeed after five: a count of the first to end would be biased."""

    def _step(self, tensordict):
        out = super()._step(tensordict)
        first = torch.arange(self.batch_size[0]).unsqueeze(-1) == 0
        fifth = (self.world["step"] % 5 == 0).unsqueeze(-1)
        ended = first | fifth
        return out.update({"done": ended, "terminated": ended, "truncated": first & ~ended, "success": fifth & ~first})


def test_short_episodes_have_no_more_weight_than_long_ones():
    assert evaluate(Uneven(4, 0), EXPERT, 20).success_at_end == 0.75


def test_the_policy_receives_no_privileged_keys():
    seen = []
    spy = TensorDictModule(lambda robot: robot[:, :3] * 0, in_keys=["robot"], out_keys=["action"])
    spy.register_forward_pre_hook(lambda module, args: seen.append("privileged" in args[0].keys()))
    evaluate(make_env(4, 0), spy, 4)
    assert seen
    assert not any(seen)


def test_an_evaluation_can_be_interrupted():
    with pytest.raises(Interrupted):
        evaluate(make_env(4, 0), EXPERT, 4, stop=lambda: True)
