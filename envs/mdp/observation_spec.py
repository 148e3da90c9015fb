"""What the environment observes.

The observation, each with a leading N:

| key | shape | what it holds |
|---|---|---|
| robot | (R,) float32 | joint angles (rad) and speeds (rad/s), gripper centre (m), the first two columns of its
|   | | rotation matrix (Zhou et al. 2019: continuous, where quaternions jump), how far the fingers are open in [0, 1];
|   | | then, where the task grips, how far it is told to be shut and whether anything is held |
| objects | (K, D) float32 | a row a slot: position (m), quaternion (x, y, z, w), RGBA (A of a target: 0.5), shape
|   | | one-hot (where the task operates devices: of DEVICES, and of where their handles are), size (m), role (1:
|   | | target); then, where the task moves objects, the offset from the gripper, within `NEAR` (m), and again within
|   | | `CLOSE`: grasping and letting go are matters of a centimetre; then the task's own `columns`. Where it pushes
|   | | objects, how far each has slid in the last step (x, y, within 3 cm), and whether it lies at a target, in [0, 1];
|   | | of devices, the unit vector to where each faces (x, y), and the share of its way that it has gone, in [-1, 1] |
| objects_mask | (K,) bool | which slots show an object |
| objects_near | (K,) float32 | only where objects are moved: how near each one is that could be knocked against: 1 at
|   | | the gripper, 0 from `NEAR` on, and for what cannot be |
| hold | (A,) float32 | the action that keeps the arm where it is |
| instruction | (L,) int64 | the sentence's tokens, 0 = pad |
| gesture | (7,) float32 | only where a person points: the fingertip (m), the unit direction of its ray, and 1 where a
|   | | gesture is shown; all 0 where none is |
| stage | () int64 | only where objects are moved: 0 going, 1 holding something (or near it, where nothing is gripped),
|   | | 2 beside a target with it |
| success, wrong_object, wrong_target | (1,) bool | whether the episode ended so at this step |
| at_goal | (1,) bool | whether the gripper is at the referent, or the referent where it is to go |
| reward_terms | (T,) float32 | weighted terms by `reward_names`; their sum is the reward |
| privileged | | for losses and tests alone: referent (slot), target (slot, where there are any), goal (m), kind (of
|   | | sentence), sentence (UTF-8 bytes), and pointing (3,) where a person points, as `Gestures.measures` has it.
|   | | goal is the referent's place; where objects are moved, also the target's, and the offsets, likewise, from
|   | | gripper to referent and from there to the target (without one: the referent's place, and 0), the
|   | | same offset to the nearest other object that could be knocked against and how near it is (as `objects_near`
|   | | has it), and what the task remembers, in [0, 1]. There, also held (the slot of what is held, -1 for nothing)
|   | | and movable (K,) |
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torchrl.data import Binary, Bounded, Categorical, Composite, Unbounded

from envs.mdp.goals import SENTENCE_BYTES
from envs.sim.kinematics import Kinematics
from envs.sim.robot import RobotConfig
from envs.sim.workspace import WorkspaceConfig
from envs.tasks import Task
from language import COLORS, DEVICES, NOUNS, SEE_THROUGH, SHAPES, Scene, Tokenizer, color_name, color_table

NEAR, CLOSE = 0.2, 0.04  # metres in which one place is seen from another: finely, and once more, more finely
FARTHEST = 3.0  # metres from the origin that a fingertip is looked for
OBJECT_WIDTH = 3 + 4 + 4 + len(SHAPES) + 1 + 1
OFFSET = slice(OBJECT_WIDTH, OBJECT_WIDTH + 6)  # where the offsets from the gripper are, if any
COLUMNS = slice(OFFSET.stop, None)  # where a task's own columns are, if any
FACING = slice(OFFSET.stop, OFFSET.stop + 2)  # where devices face
# A task is about shapes or about devices: each noun's column in the one-hot of its kind.
_ONE_HOT = np.array([(SHAPES if noun in SHAPES else DEVICES).index(noun) for noun in NOUNS])
ATTRIBUTES = slice(7, OBJECT_WIDTH)  # what an object keeps all along: colour, shape, size, role


class Bounds:
    """Least and greatest values, (2, width) float32 each, of what varies: position (m), robot and objects rows."""

    def __init__(self, workspace: WorkspaceConfig, robot: RobotConfig, chain: Kinematics, task: Task) -> None:
        low, high = np.reshape(workspace.bounds, (3, 2)).T
        speed, ones = 2 * np.array(robot.max_speed), np.ones(6)  # a joint that is struck can exceed its own speed
        rest = OBJECT_WIDTH - 7 - 2
        self.position = _pair([low], [high])
        goal = [low], [high]
        gripper = 3 if task.grips else 1
        self.robot = _pair(
            [chain.low - 0.1, -speed, low, -ones, np.zeros(gripper)],
            [chain.high + 0.1, speed, high, ones, np.ones(gripper)],
        )
        tip, tilt = np.full(3, FARTHEST), np.ones(3)
        self.gesture = _pair([-tip, -tilt, [0.0]], [tip, tilt, [1.0]])
        self.pointing = _pair([np.zeros(3)], [[np.pi, np.pi, 2 * FARTHEST]])
        least, most = [low, -np.ones(4), np.zeros(rest), [0.0, 0.0]], [high, np.ones(4), np.ones(rest), [0.2, 1.0]]
        if task.moves:
            offset = np.repeat((NEAR, CLOSE), 3)
            least += [-offset, [column.low for column in task.columns]]
            most += [offset, [column.high for column in task.columns]]
            memory = task.memory[0]
            goal = (
                [low, low, -offset, -offset, -offset, np.zeros(1), np.zeros_like(memory)],
                [high, high, offset, offset, offset, np.ones(1), np.ones_like(memory)],
            )
        self.objects, self.goal = _pair(least, most), _pair(*goal)


def observation_spec(bounds: Bounds, worlds: int, task: Task, tokenizer: Tokenizer, actions: int) -> Composite:
    """The spec of the table above, for `worlds` worlds of this task and as many numbers an action."""
    slots, words = task.config.slots, len(tokenizer.vocabulary)
    spec = Composite(
        robot=_bounded(bounds.robot, worlds),
        objects=_bounded(bounds.objects, worlds, slots),
        objects_mask=Binary(slots, shape=(worlds, slots), dtype=torch.bool),
        hold=Bounded(-1, 1, shape=(worlds, actions), dtype=torch.float32),
        instruction=Categorical(words, shape=(worlds, tokenizer.length), dtype=torch.int64),
        privileged=Composite(
            referent=Categorical(slots, shape=(worlds,), dtype=torch.int64),
            goal=_bounded(bounds.goal, worlds),
            kind=Categorical(len(task.kind_names), shape=(worlds,), dtype=torch.int64),
            sentence=Bounded(0, 255, shape=(worlds, SENTENCE_BYTES), dtype=torch.uint8),
            shape=(worlds,),
        ),
        reward_terms=Unbounded(shape=(worlds, len(task.terms)), dtype=torch.float32),
        shape=(worlds,),
    )
    if task.places:
        spec["privileged", "target"] = Categorical(slots, shape=(worlds,), dtype=torch.int64)
    if task.moves:
        spec["objects_near"] = Bounded(0, 1, shape=(worlds, slots), dtype=torch.float32)
        spec["privileged", "held"] = Bounded(-1, slots - 1, shape=(worlds,), dtype=torch.int64)
        spec["privileged", "movable"] = Binary(slots, shape=(worlds, slots), dtype=torch.bool)
    for name in ("success", "wrong_object", "wrong_target", "at_goal"):
        spec[name] = Binary(1, shape=(worlds, 1), dtype=torch.bool)
    if task.stages > 1:
        spec["stage"] = Categorical(task.stages, shape=(worlds,), dtype=torch.int64)
    if task.points:
        spec["gesture"] = _bounded(bounds.gesture, worlds)
        spec["privileged", "pointing"] = _bounded(bounds.pointing, worlds)
    return spec


def attributes(scene: Scene) -> NDArray[np.float64]:
    """(K, OBJECT_WIDTH - 7) the lasting part of each object's row."""
    shape = np.eye(len(SHAPES))[_ONE_HOT[scene.nouns]]
    colors = color_table()[scene.colors]
    colors[scene.targets, 3] = SEE_THROUGH
    return np.concatenate((colors, shape, scene.sizes[:, None], scene.targets[:, None]), axis=1)


def lasting_rows(scene: Scene, yaw: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """(K, OBJECT_WIDTH) the objects' rows as they would be if nothing moved. yaw: (K,) radians."""
    half = (np.zeros(len(scene)) if yaw is None else yaw) / 2
    turned = np.stack((np.zeros_like(half), np.zeros_like(half), np.sin(half), np.cos(half)), axis=1)
    return np.concatenate((scene.positions, turned, attributes(scene)), axis=1)


def seen_scene(objects: NDArray, viewpoint: str = "robot", devices: bool = False) -> Scene:
    """The scene of observed object rows (K, D), as words see it: the inverse of what `attributes` writes.

    devices: whether it is they that are seen, or shapes.
    """
    among = DEVICES if devices else SHAPES
    colors, shapes = objects[:, 7:11], objects[:, 11 : 11 + len(among)]
    return Scene.from_arrays(
        nouns=[list(NOUNS).index(among[column]) for column in shapes.argmax(1)],
        colors=[list(COLORS).index(color_name(color)) for color in colors],
        positions=objects[:, :3],
        size=objects[:, OBJECT_WIDTH - 2],
        targets=objects[:, OBJECT_WIDTH - 1] > 0.5,
        viewpoint=viewpoint,
    )


def offsets(places: NDArray[np.float64], start: NDArray[np.float64]) -> NDArray[np.float64]:
    """(..., 6) metres from `start` to places, both (..., 3): twice, since each has bounds of its own."""
    offset = places - start
    return np.concatenate((offset, offset), axis=-1)


def clipped(values: NDArray[np.float64], bounds: NDArray[np.float32]) -> Tensor:
    """float32 within bounds (2, width); what is not a number stays so, to be seen."""
    return torch.from_numpy(np.clip(values.astype(np.float32), bounds[0], bounds[1]))


def _pair(lows: list, highs: list) -> NDArray[np.float32]:
    return np.stack((np.concatenate(lows), np.concatenate(highs))).astype(np.float32)


def _bounded(bounds: NDArray[np.float32], *batch: int) -> Bounded:
    shape = (*batch, bounds.shape[1])
    low, high = (torch.tensor(bound).expand(shape) for bound in bounds)
    return Bounded(low, high, shape, dtype=torch.float32)
