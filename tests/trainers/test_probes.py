import pytest
import torch
from torchrl.envs.utils import ExplorationType, set_exploration_type

from tests.helpers.fake_env import make_env
from tests.helpers.plans import plan
from trainers.models.policy import build_policy
from trainers.rollout.instruction_ablations import AblatedInstructions, run_to_end


class Seer:
    """Notes the words it is given, and does what the goal asks for."""

    in_keys, out_keys = ("instruction",), ("action",)

    def __init__(self, goal=None):
        self.heard, self.goal = [], goal

    def __call__(self, frames):
        self.heard.append(frames["instruction"].clone())
        action = torch.zeros(len(frames), 3) if self.goal is None else (self.goal - frames["robot"][:, :3]) * 5
        return frames.set("action", action.clamp(-1, 1))


def test_blanked_words_are_no_words_and_the_rest_stays():
    env, seer = make_env(4, 0), Seer()
    state = env.reset()
    before = state.clone()
    AblatedInstructions(seer, "blank")(state.exclude("privileged"))
    assert (seer.heard[0] == 0).all()
    assert (state["instruction"] == before["instruction"]).all()


def test_swapped_words_are_the_next_worlds_and_stay_for_the_episode():
    env, seer = make_env(4, 1), Seer()
    state = env.reset()
    said = torch.arange(1, 5)[:, None].expand(4, state["instruction"].shape[1]).clone()
    listener = AblatedInstructions(seer, "swapped")
    listener(state.clone().set("instruction", said))
    assert seer.heard[-1][:, 0].tolist() == [2, 3, 4, 1]
    said[1] = 9  # world 1 begins a new episode: world 0, whose episode goes on, keeps what it heard
    listener(state.clone().set("instruction", said))
    assert seer.heard[-1][:, 0].tolist() == [2, 3, 4, 1]
    said[0] = 8
    listener(state.clone().set("instruction", said))
    assert seer.heard[-1][:, 0].tolist() == [9, 3, 4, 1]


def test_words_of_one_world_cannot_be_swapped():
    with pytest.raises(ValueError, match="two worlds"):
        AblatedInstructions(Seer(), "swapped")(make_env(1, 0).reset())


def test_an_episode_is_run_to_its_end_and_no_further():
    env = make_env(6, 3)
    state = env.reset()
    reaching = run_to_end(env, Seer(state["privileged", "goal"].clone()), state)
    assert reaching.all()
    still = make_env(6, 3)
    assert not run_to_end(still, Seer(), still.reset()).all()


def test_the_deterministic_policy_goes_for_one_object_not_for_the_mean_of_several():
    env = make_env(8, 0)
    policy = build_policy(plan().policy, env.observation_spec, env.action_unit)
    state = env.reset()
    with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
        out = policy.act(state)
    rows = policy.encoder.normalise(state["objects"])
    chosen = rows[torch.arange(8), out["attention_logits"].argmax(-1)]
    torch.testing.assert_close(out["referent"], chosen)
