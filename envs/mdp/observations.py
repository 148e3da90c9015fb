"""What is seen now: the arrays of all worlds as the tensors of `envs/mdp/observation_spec.py`."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from tensordict import TensorDict

from envs.mdp.gestures import Gestures
from envs.mdp.grip_controller import GripController
from envs.mdp.observation_spec import NEAR, Bounds, clipped, offsets
from envs.mdp.world_state import WorldState
from envs.sim.kinematics import Array
from envs.tasks import State, Task


def observe(
    arrays: WorldState, grips: GripController, gestures: Gestures, task: Task, bounds: Bounds
) -> dict[str, Any]:
    """Fresh tensors, never views of what the next step overwrites; all but "hold"."""
    state = arrays.state
    rows = np.where(state.shown[..., None], _rows(arrays, task), 0.0)
    told = asked(task, state, bounds)
    privileged = told.pop("privileged") | {
        "kind": torch.from_numpy(arrays.kind.copy()),
        "sentence": torch.from_numpy(arrays.sentence.copy()),
    }
    if task.moves:
        privileged["held"] = torch.from_numpy(state.held.copy())
        privileged["movable"] = torch.from_numpy(state.movable.copy())
        told["objects_near"] = torch.from_numpy(_near(state).astype(np.float32))
    seen = told | {
        "robot": clipped(_robot(arrays, grips), bounds.robot),
        "objects": clipped(rows, bounds.objects),
        "objects_mask": torch.from_numpy(state.shown.copy()),
        "instruction": torch.from_numpy(arrays.instruction.copy()),
    }
    if gestures.points:
        seen["gesture"] = clipped(gestures.rays, bounds.gesture)
        measures = gestures.measures(state.objects, state.shown, state.referent)
        privileged["pointing"] = clipped(measures, bounds.pointing)
    return seen | {"privileged": TensorDict(privileged, [len(rows)])}


def asked(task: Task, state: State, bounds: Bounds) -> dict[str, Any]:
    """What is seen of N episodes that depends on what is meant in them, and "stage"."""
    privileged = {
        "referent": torch.from_numpy(state.referent.copy()),
        "goal": clipped(_goal(task, state), bounds.goal),
    }
    if task.places:
        privileged["target"] = torch.from_numpy(state.target.copy())
    seen = {"stage": torch.from_numpy(task.stage(state))} if task.stages > 1 else {}
    return seen | {"privileged": privileged}


def _robot(arrays: WorldState, grips: GripController) -> Array:
    pose, count = arrays.pose, arrays.angles.shape[1]
    speeds, turned = arrays.joints[:, :count, 1], pose.rotation
    held = grips.observation(arrays.joints[..., 0])
    return np.concatenate((arrays.angles, speeds, pose.position, turned[:, :, 0], turned[:, :, 1], held), axis=1)


def _rows(arrays: WorldState, task: Task) -> Array:
    """(N, K, D)"""
    if not task.moves:
        return arrays.rows
    offset = offsets(arrays.rows[..., :3], arrays.pose.position[:, None])
    return np.concatenate((arrays.rows, offset, task.seen(arrays.state)), axis=2)


def _goal(task: Task, state: State) -> Array:
    """(N, G)"""
    each = np.arange(len(state.referent))
    referent = state.objects[each, state.referent]
    if not task.moves:
        return referent
    target = state.objects[each, state.target]
    near = _near(state)
    near[each, state.referent] = 0.0
    other = near.argmax(1)
    way = offsets(state.objects[each, other], state.gripper), near.max(1, keepdims=True)
    ways = offsets(referent, state.gripper), offsets(target, referent)
    return np.concatenate((referent, target, *ways, *way, task.memory), axis=1)


def _near(state: State) -> Array:
    """(N, K) how near objects are that could be knocked against: 1 at the gripper, 0 from `NEAR` on."""
    offset = state.objects - state.gripper[:, None]
    return state.movable * np.maximum(1.0 - np.sqrt((offset * offset).sum(-1)) / NEAR, 0.0)
