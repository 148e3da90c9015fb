import numpy as np
import pytest
import torch
from PIL import ImageFont
from tensordict.nn import TensorDictModule

from tests.helpers.fake_env import FakeEnv, make_env
from trainers.rollout.evaluation import Interrupted, evaluate, quotas, wilson
from trainers.rollout.video import caption, record


class Expert(torch.nn.Module):
    """Goes where the colour that was named is. Reads nothing privileged."""

    def forward(self, robot, objects, instruction):
        wanted = instruction[:, 2] - 3
        slot = objects[:, :, 3:6].argmax(-1).eq(wanted.unsqueeze(-1)).float().argmax(-1)
        places = objects[torch.arange(len(slot)), slot, :3]
        return ((places - robot[:, :3]) / 0.2).clamp(-1, 1)


EXPERT = TensorDictModule(Expert(), in_keys=["robot", "objects", "instruction"], out_keys=["action"])


@pytest.mark.parametrize(
    ("k", "n", "low", "high"),
    [(0, 10, 0.0, 0.2775), (5, 10, 0.2366, 0.7634), (485, 500, 0.9512, 0.9817), (500, 500, 0.9924, 1.0)],
)
def test_wilson_against_known_values(k, n, low, high):
    assert wilson(k, n) == pytest.approx((low, high), abs=2e-4)


def test_wilson_of_nothing_says_nothing():
    assert wilson(0, 0) == (0.0, 1.0)


def test_quotas_are_fixed_beforehand():
    assert quotas(10, 4) == [3, 3, 2, 2]
    assert quotas(2, 4) == [1, 1, 0, 0]


@pytest.mark.parametrize("episodes", [3, 8, 21])
def test_exactly_so_many_episodes(episodes):
    result = evaluate(make_env(8, 0), EXPERT, episodes, seed=3)
    assert result.episodes == episodes == sum(kind.episodes for kind in result.by_kind.values())
    assert set(result.by_kind) <= {"odd", "even"}


def test_an_expert_succeeds_and_the_same_seed_says_the_same():
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


def test_short_episodes_count_no_more_than_long_ones():
    assert evaluate(Uneven(4, 0), EXPERT, 20).success_at_end == 0.75


def test_the_policy_is_shown_nothing_privileged():
    seen = []
    spy = TensorDictModule(lambda robot: robot[:, :3] * 0, in_keys=["robot"], out_keys=["action"])
    spy.register_forward_pre_hook(lambda module, args: seen.append("privileged" in args[0].keys()))
    evaluate(make_env(4, 0), spy, 4)
    assert seen
    assert not any(seen)


def test_it_can_be_interrupted():
    with pytest.raises(Interrupted):
        evaluate(make_env(4, 0), EXPERT, 4, stop=lambda: True)


def test_a_film_with_words_on_it(tmp_path):
    outcomes = record(make_env(1, 0), EXPERT, tmp_path / "film.mp4", episodes=2)
    assert len(outcomes) == 2
    assert (tmp_path / "film.mp4").stat().st_size > 1000
    frame = make_env(1, 0).render()
    written, blank = caption(frame, "touch the red"), caption(frame, " ")
    assert (written != blank).any()
    assert not any(side % 2 for side in written.shape[:2])


def test_a_long_sentence_is_written_in_two_lines(tmp_path):
    frame = make_env(1, 0).render()
    words = "put it there " * (frame.shape[1] // 60)
    assert ImageFont.load_default(size=14).getlength(words) > frame.shape[1]
    height = frame.shape[0]
    lines = np.split(caption(frame, words)[height : height + 60], 3)
    assert [bool(line.any()) for line in lines] == [True, True, False]
