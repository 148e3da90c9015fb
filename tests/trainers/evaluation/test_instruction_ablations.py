"""Instruction ablations."""

from __future__ import annotations

import pytest
import torch

from envs.experts import expert
from tests.helpers.env_cases import make
from tests.helpers.fake_env import make_env
from trainers.evaluation.instruction_ablations import AblatedInstructions, run_to_end, success_in_turn


class RecordingPolicy:
    """Records the instructions that it receives, and goes to the goal."""

    in_keys, out_keys = ("instruction",), ("action",)

    def __init__(self, goal=None):
        self.instructions, self.goal = [], goal

    def __call__(self, frames):
        self.instructions.append(frames["instruction"].clone())
        action = torch.zeros(len(frames), 3) if self.goal is None else (self.goal - frames["robot"][:, :3]) * 5
        return frames.set("action", action.clamp(-1, 1))


def test_a_blank_instruction_is_all_padding_and_the_state_stays():
    env, policy = make_env(4, 0), RecordingPolicy()
    state = env.reset()
    before = state.clone()
    AblatedInstructions(policy, "blank")(state.exclude("privileged"))
    assert (policy.instructions[0] == 0).all()
    assert (state["instruction"] == before["instruction"]).all()


def test_a_swapped_instruction_is_that_of_the_next_world_for_the_whole_episode():
    env, policy = make_env(4, 1), RecordingPolicy()
    state = env.reset()
    given = torch.arange(1, 5)[:, None].expand(4, state["instruction"].shape[1]).clone()
    ablated = AblatedInstructions(policy, "swapped")
    ablated(state.clone().set("instruction", given))
    assert policy.instructions[-1][:, 0].tolist() == [2, 3, 4, 1]
    given[1] = 9  # world 1 begins a new episode; world 0 keeps its instruction
    ablated(state.clone().set("instruction", given))
    assert policy.instructions[-1][:, 0].tolist() == [2, 3, 4, 1]
    given[0] = 8
    ablated(state.clone().set("instruction", given))
    assert policy.instructions[-1][:, 0].tolist() == [9, 3, 4, 1]


def test_the_instructions_of_a_single_world_cannot_be_swapped():
    with pytest.raises(ValueError, match="two worlds"):
        AblatedInstructions(RecordingPolicy(), "swapped")(make_env(1, 0).reset())


def test_run_to_end_returns_the_success_of_each_world():
    env = make_env(6, 3)
    state = env.reset()
    reaching = run_to_end(env, RecordingPolicy(state["privileged", "goal"].clone()), state)
    assert reaching.all()
    still = make_env(6, 3)
    assert not run_to_end(still, RecordingPolicy(), still.reset()).all()


@pytest.mark.slow
def test_a_scene_with_more_to_say_than_there_are_worlds_is_evaluated_whole():
    env = make(
        "kuka",
        "step",
        "anything",
        "task.verbs=[reach,grasp]",
        "task.curriculum={near: 0, held: 0, placed: 0}",
        worlds=4,
    )
    result = success_in_turn(env, expert(env), scenes=1, seed=3)
    env.close()
    assert result["episodes"] > 4
    assert result["success_at_end"] == 1
