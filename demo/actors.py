"""Actors, which drive the robot during a subtask: the policy, or a scripted expert."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase

from demo.planning import Subtask
from demo.view_state import Intent
from envs.experts import expert
from envs.experts.board import Move, MoveRunner
from envs.interactive.interactive_env import InteractiveEnv
from trainers.evaluation.video import outcome_of

Actor = Callable[[TensorDictBase], TensorDictBase]


class MoveActor:
    """Gives the actions of one move of the scripted expert, as a policy does.

    outcome: how it ended; None until then.
    """

    def __init__(self, env: InteractiveEnv, move: Move) -> None:
        self._env, self._runner = env, MoveRunner(env, [move])
        self.outcome: str | None = None

    def __call__(self, state: TensorDictBase) -> TensorDictBase:
        """The state with an action."""
        action = self._runner()
        if action is None:
            self.outcome = "success" if all(self._runner.done) else "out of time"
        return state.set("action", self._env.hold_action() if action is None else action)


def is_move_of_expert(subtask: Subtask, driver: str) -> bool:
    """Whether the expert carries out a move: policies have not learned to keep a held object, nor to go without a goal.

    On a table a move has no target: it is none of what the task's own verb does.
    """
    move = subtask.move
    return move is not None and (driver == "expert" or not move.release or subtask.target is None)


def actor_of(subtask: Subtask, env: InteractiveEnv, driver: str, policy: Actor | None) -> Actor | None:
    """The actor of a subtask that has just begun."""
    if subtask.move is not None and is_move_of_expert(subtask, driver):
        return MoveActor(env, subtask.move)
    return expert(env) if driver == "expert" else policy


def other_of(actor: Actor | None, env: InteractiveEnv, policy: Actor | None) -> Actor | None:
    """With whom an actor is compared: the policy with the expert, and the expert with the policy; None: with nobody."""
    if policy is None or actor is None or isinstance(actor, MoveActor):
        return None
    return expert(env) if actor is policy else policy


def intent_of(action: torch.Tensor, env: InteractiveEnv) -> Intent:
    """What an action (1, A) asks for in the present state."""
    return Intent(action[0].numpy().astype(np.float64), env.leads_to(action) - env.commanded_gripper[0])


def attention_of(output: TensorDictBase) -> NDArray[np.float64] | None:
    """(K,) in [0, 1], the policy's attention over the K objects; None if it has none. output: what it returned."""
    if "attention_logits" not in output.keys():
        return None
    shares = output["attention_logits"][0].softmax(-1)[output["objects_mask"][0]]
    return shares.numpy().astype(np.float64)


def ending_of(actor: Actor | None, after: TensorDictBase) -> str | None:
    """How a subtask ended, one of `view_state.OUTCOMES`; None while it lasts. after: its last control step."""
    if isinstance(actor, MoveActor):
        return actor.outcome
    return outcome_of(after) if (after["terminated"] | after["truncated"])[0] else None
