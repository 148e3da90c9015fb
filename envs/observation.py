"""What the environment observes.

The observation, each with a leading N:

| key | shape | what it holds |
|---|---|---|
| robot | (R,) float32 | joint angles (rad) and speeds (rad/s), gripper centre (m), the first two columns of its
|   | | rotation matrix (Zhou et al. 2019: continuous, where quaternions jump), gripper state (0 closed or idle, 1) |
| objects | (K, D) float32 | a row a slot: position (m), quaternion (x, y, z, w), RGBA (A of a target: 0.5), shape
|   | | one-hot, size (m), role (1: target) |
| objects_mask | (K,) bool | which slots show an object |
| hold | (A,) float32 | the action that keeps the arm where it is |
| instruction | (L,) int64 | the sentence's tokens, 0 = pad |
| success, wrong_object | (1,) bool | whether the episode ended so at this step |
| at_goal | (1,) bool | whether the gripper is at the referent |
| reward_terms | (T,) float32 | weighted terms by `reward_names`; their sum is the reward |
| privileged | | for losses and tests alone: referent (slot), goal (m), kind (of sentence), sentence (UTF-8 bytes) |
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torchrl.data import Binary, Bounded, Categorical, Composite

from envs.kinematics import Kinematics
from envs.robot import RobotConfig
from envs.workspace import WorkspaceConfig
from language import COLORS, NOUNS, SEE_THROUGH, Scene, Tokenizer, color_name, color_table

SENTENCE_BYTES = 160
OBJECT_WIDTH = 3 + 4 + 4 + len(NOUNS) + 1 + 1
ATTRIBUTES = slice(7, OBJECT_WIDTH)  # what an object keeps all along: colour, shape, size, role


class Bounds:
    """Least and greatest values, (2, width) float32 each, of what varies: position (m), robot and objects rows."""

    def __init__(self, workspace: WorkspaceConfig, robot: RobotConfig, chain: Kinematics) -> None:
        low, high = np.reshape(workspace.bounds, (3, 2)).T
        speed, ones = 2 * np.array(robot.max_speed), np.ones(6)  # a joint that is struck can exceed its own speed
        rest = OBJECT_WIDTH - 7 - 2
        self.position = _pair([low], [high])
        self.robot = _pair(
            [chain.low - 0.1, -speed, low, -ones, [0.0]],
            [chain.high + 0.1, speed, high, ones, [1.0]],
        )
        self.objects = _pair(
            [low, -np.ones(4), np.zeros(rest), [0.0, 0.0]],
            [high, np.ones(4), np.ones(rest), [0.2, 1.0]],
        )


def observation_spec(
    bounds: Bounds, worlds: int, slots: int, tokenizer: Tokenizer, actions: int, kinds: tuple[str, ...]
) -> Composite:
    """The spec of the table above, for `worlds` worlds of `slots` slots, without what a step comes to."""
    words = len(tokenizer.vocabulary)
    return Composite(
        robot=_bounded(bounds.robot, worlds),
        objects=_bounded(bounds.objects, worlds, slots),
        objects_mask=Binary(slots, shape=(worlds, slots), dtype=torch.bool),
        hold=Bounded(-1, 1, shape=(worlds, actions), dtype=torch.float32),
        instruction=Categorical(words, shape=(worlds, tokenizer.length), dtype=torch.int64),
        privileged=Composite(
            referent=Categorical(slots, shape=(worlds,), dtype=torch.int64),
            goal=_bounded(bounds.position, worlds),
            kind=Categorical(len(kinds), shape=(worlds,), dtype=torch.int64),
            sentence=Bounded(0, 255, shape=(worlds, SENTENCE_BYTES), dtype=torch.uint8),
            shape=(worlds,),
        ),
        shape=(worlds,),
    )


def attributes(scene: Scene) -> NDArray[np.float64]:
    """(K, OBJECT_WIDTH - 7) the lasting part of each object's row."""
    shape = np.eye(len(NOUNS))[scene.nouns]
    colors = color_table()[scene.colors]
    colors[scene.targets, 3] = SEE_THROUGH
    return np.concatenate((colors, shape, scene.sizes[:, None], scene.targets[:, None]), axis=1)


def seen_scene(objects: NDArray, viewpoint: str = "robot") -> Scene:
    """The scene of observed object rows (K, D), as words see it: the inverse of what `attributes` writes."""
    colors, shapes = objects[:, 7:11], objects[:, 11 : 11 + len(NOUNS)]
    return Scene.from_arrays(
        nouns=shapes.argmax(1),
        colors=[list(COLORS).index(color_name(color)) for color in colors],
        positions=objects[:, :3],
        size=objects[:, -2],
        targets=objects[:, -1] > 0.5,
        viewpoint=viewpoint,
    )


def clipped(values: NDArray[np.float64], bounds: NDArray[np.float32]) -> Tensor:
    """float32 within bounds (2, width); what is not a number stays so, to be seen."""
    return torch.from_numpy(np.clip(values.astype(np.float32), bounds[0], bounds[1]))


def _pair(lows: list, highs: list) -> NDArray[np.float32]:
    return np.stack((np.concatenate(lows), np.concatenate(highs))).astype(np.float32)


def _bounded(bounds: NDArray[np.float32], *batch: int) -> Bounded:
    shape = (*batch, bounds.shape[1])
    low, high = (torch.tensor(bound).expand(shape) for bound in bounds)
    return Bounded(low, high, shape, dtype=torch.float32)
