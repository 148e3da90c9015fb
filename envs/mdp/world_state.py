"""The state of N worlds as arrays: the goals of their episodes, the poses of objects, the states of the arms."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from envs.mdp.goals import Goal, in_bytes, sentence_bytes
from envs.mdp.object_rows import ATTRIBUTES, OBJECT_WIDTH, attributes
from envs.sim.kinematics import Array, Kinematics, Pose
from envs.sim.object_pool import PARKED, USUAL, Mobility
from envs.sim.robot_config import RobotConfig
from envs.sim.world import SimulatedWorld
from envs.tasks import EpisodeSpec, State
from language import Tokenizer


class WorldState:
    """N worlds of K slots, with an arm of J joints and F fingers; metres, radians.

    state: as tasks see it; its positions and quaternions are views of `rows`. rows: (N, K, OBJECT_WIDTH), the rows of
    the observation `objects`, but for slots that are not shown. joints: (N, J + F, 2) angle and speed, fingers last.
    commanded, angles: (N, J) joint angles last commanded and measured. pose: of the grippers. slots: for each world,
    the slots of its objects in their order. goals: of each world; `set_goal` writes it, and also
    instruction (N, L), kind (N,) and sentence (N, B). steps: (N,) control steps since an instruction was
    given. instructions_given: (N,) how many the episode has had.
    """

    def __init__(
        self,
        *,
        worlds: Sequence[SimulatedWorld],
        robot: RobotConfig,
        kinematics: Kinematics,
        slots: int,
        tokenizer: Tokenizer,
    ) -> None:
        count, joints = len(worlds), len(robot.joints)
        self._worlds, self._kinematics, self._tokenizer = worlds, kinematics, tokenizer
        self.index = np.arange(count)
        self.joints = np.zeros((count, joints + len(robot.fingers), 2))
        self.commanded, self.angles = np.zeros((2, count, joints))
        self.pose: Pose = kinematics.forward(self.angles)
        self.rows = np.zeros((count, slots, OBJECT_WIDTH))
        self.rows[..., :3] = PARKED
        shown, movable, goals = np.zeros((3, count, slots), bool)
        referent, target, held = np.zeros((3, count), np.int64)
        places, quaternions = self.rows[..., :3], self.rows[..., 3:7]
        nouns, self.kind = np.zeros((count, slots), np.int64), np.zeros(count, np.int64)
        yaw = np.zeros((count, slots))
        self.state = State(
            gripper=np.zeros((count, 3)),
            objects=places,
            shown=shown,
            referent=referent,
            target=target,
            movable=movable,
            goals=goals,
            quaternions=quaternions,
            held=held,
            nouns=nouns,
            kind=self.kind,
            yaw=yaw,
        )
        self.slots = [np.arange(slots) for _ in range(count)]
        self.goals = [Goal(referent=0, target=0, sentence="", policy_sentence="", kind=0)] * count
        self.instruction = np.zeros((count, tokenizer.length), np.int64)
        self.sentence = np.zeros((count, sentence_bytes(tokenizer)), np.uint8)
        self.steps = np.zeros(count, np.int64)
        self.begun = np.zeros(count, bool)  # whether a world has had an episode
        self.instructions_given = np.ones(count, np.int64)

    def begin(self, i: int, episode: EpisodeSpec, slots: NDArray[np.int64], *, joints: Array, opening: float) -> None:
        """Begin an episode in world i.

        Args:
            i: the world.
            episode: to begin.
            slots: (K,) of its objects.
            joints: (J,) angles of the arm, radians.
            opening: of each finger, metres.
        """
        self._show(i, episode, slots)
        self.set_goal(i, Goal.of(episode, slots))
        self.steps[i], self.instructions_given[i], self.begun[i] = 0, 1, True
        self.commanded[i] = joints
        scene, by_slot = episode.scene, np.argsort(slots, kind="stable")
        yaw = np.zeros(len(scene)) if episode.yaw is None else episode.yaw
        shapes = scene.nouns if episode.shapes is None else episode.shapes
        drawn = episode.randomized
        self._worlds[i].pool.dynamics = USUAL if drawn is None else (drawn.mass, drawn.friction)
        self._worlds[i].reset(
            joints=joints.tolist(),
            opening=opening,
            nouns=shapes[by_slot].tolist(),
            mobilities=Mobility.of(scene.targets, episode.fixed)[by_slot].tolist(),
            positions=scene.positions[by_slot].tolist(),
            yaw=yaw[by_slot].tolist(),
            colors=self.rows[i, np.sort(slots), 7:11],
            resting=_resting(episode)[by_slot].tolist(),
            shares=None if episode.shares is None else episode.shares[by_slot].tolist(),
        )

    def _show(self, i: int, episode: EpisodeSpec, slots: NDArray[np.int64]) -> None:
        """Write the values that are constant during the episode: the shown slots, and the attributes of objects."""
        scene, state = episode.scene, self.state
        self.slots[i] = slots
        self.rows[i] = 0.0
        self.rows[i, :, :3] = PARKED
        self.rows[i, slots, ATTRIBUTES] = attributes(scene)
        goals = scene.targets if episode.goals is None else episode.goals
        free = Mobility.of(scene.targets, episode.fixed) == Mobility.FREE
        for array, values in (
            (state.shown, True),
            (state.movable, free),
            (state.goals, goals),
            (state.nouns, scene.nouns),
            (state.yaw, 0.0 if episode.yaw is None else episode.yaw),
        ):
            array[i] = 0
            array[i, slots] = values

    def set_goal(self, i: int, goal: Goal) -> None:
        """Set the goal of world i. The task must be reset for that world afterwards."""
        self.goals[i] = goal
        self.state.referent[i], self.state.target[i] = goal.referent, goal.target
        self.instruction[i] = self._tokenizer.encode(goal.policy_sentence)
        self.sentence[i], self.kind[i] = in_bytes(goal.sentence, self.sentence.shape[1]), goal.kind

    def advance(self, targets: Array) -> None:
        """One control step of every world towards motor targets (N, J + F), fingers last."""
        measured = []
        for world, target in zip(self._worlds, targets.tolist(), strict=True):
            world.advance(target)
            measured.append(_measure(world))  # at once: after other worlds have stepped, its memory is out of the cache
        self._write(self.index, measured)

    def read(self, worlds: NDArray[np.int64]) -> None:
        """Read the measured state of these worlds from PyBullet."""
        self._write(worlds, [_measure(self._worlds[i]) for i in worlds.tolist()])

    def _write(self, worlds: NDArray[np.int64], measured: Sequence[tuple[list[float], list[float]]]) -> None:
        """Write the results of `_measure` for these worlds to the arrays."""
        self.joints[worlds] = np.reshape([joints for joints, _ in measured], (len(worlds), *self.joints.shape[1:]))
        shown = np.zeros_like(self.state.shown)
        shown[worlds] = self.state.shown[worlds]
        self.rows[shown, :7] = np.reshape(list(chain.from_iterable(poses for _, poses in measured)), (-1, 7))
        self.angles = np.ascontiguousarray(self.joints[:, : self.commanded.shape[1], 0])
        self.pose = self._kinematics.forward(self.angles)
        self.state.gripper = self.pose.position


def _measure(world: SimulatedWorld) -> tuple[list[float], list[float]]:
    """Angle and speed of each joint, and position and quaternion of each object, in one list each."""
    joints = [value for state in world.robot.states() for value in state[:2]]
    return joints, [value for pose in world.object_poses() for part in pose for value in part]


def _resting(episode: EpisodeSpec) -> NDArray[np.bool_]:
    """(K,) which objects do not fall as the episode begins, although they are above the table."""
    if episode.resting is None:
        return np.zeros(len(episode.scene), bool)
    held = episode.start is not None and episode.start.held
    return episode.resting & ~(held & (np.arange(len(episode.scene)) == episode.referent))
