"""The arrays that N worlds are kept in, side by side: what was asked, what stands where, how the arms are."""

from __future__ import annotations

from collections.abc import Sequence
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from envs.mdp.observation_spec import ATTRIBUTES, OBJECT_WIDTH, SENTENCE_BYTES, attributes, in_bytes
from envs.mdp.scene_sampling import encoded
from envs.sim.kinematics import Array, Kinematics, Pose
from envs.sim.object_shapes import Hold
from envs.sim.robot import RobotConfig
from envs.sim.world import PARKED, World
from envs.tasks import Episode, State
from language import Tokenizer

_angle_and_speed = itemgetter(0, 1)


class WorldState:
    """N worlds of K slots and an arm of J joints and F fingers; metres, radians.

    state: as tasks see it; its places and turns are views of rows. rows: (N, K, OBJECT_WIDTH), as observed but for what
    is not shown. joints: (N, J + F, 2) angle and speed, fingers last. commanded, angles: (N, J) joints last commanded
    and measured. pose: of the grippers. slots: for each world, those of its objects, in their order. instruction
    (N, L), kind (N,) and sentence (N, SENTENCE_BYTES): what was said. steps: (N,) control steps since an episode began.
    """

    def __init__(
        self, worlds: Sequence[World], robot: RobotConfig, chain: Kinematics, slots: int, tokenizer: Tokenizer
    ) -> None:
        count, joints = len(worlds), len(robot.joints)
        self._worlds, self._chain, self._tokenizer = worlds, chain, tokenizer
        self.index = np.arange(count)
        self.joints = np.zeros((count, joints + len(robot.fingers), 2))
        self.commanded, self.angles = np.zeros((2, count, joints))
        self.pose: Pose = chain.forward(self.angles)
        self.rows = np.zeros((count, slots, OBJECT_WIDTH))
        self.rows[..., :3] = PARKED
        shown, movable, targets = np.zeros((3, count, slots), bool)
        referent, target, held = np.zeros((3, count), np.int64)
        places, turns = self.rows[..., :3], self.rows[..., 3:7]
        self.state = State(np.zeros((count, 3)), places, shown, referent, target, movable, targets, turns, held)
        self.slots = [np.arange(slots) for _ in range(count)]
        self.instruction = np.zeros((count, tokenizer.length), np.int64)
        self.kind = np.zeros(count, np.int64)
        self.sentence = np.zeros((count, SENTENCE_BYTES), np.uint8)
        self.steps = np.zeros(count, np.int64)

    def begin(self, i: int, episode: Episode, order: NDArray[np.int64], joints: Array, opening: float) -> None:
        """Lay an episode out in world i. order: (K,) its objects' slots. joints (J,), opening: how the arm begins."""
        self._note(i, episode, order)
        self.commanded[i] = joints
        scene, by_slot = episode.scene, np.argsort(order, kind="stable")
        yaw = np.zeros(len(scene)) if episode.yaw is None else episode.yaw
        self._worlds[i].reset(
            joints.tolist(),
            opening,
            scene.nouns[by_slot].tolist(),
            Hold.of(scene.targets, episode.fixed)[by_slot].tolist(),
            scene.positions[by_slot].tolist(),
            yaw[by_slot].tolist(),
            self.rows[i, np.sort(order), 7:11],
        )

    def _note(self, i: int, episode: Episode, order: NDArray[np.int64]) -> None:
        """What is shown in world i, and what is asked."""
        scene, state = episode.scene, self.state
        self.slots[i] = order
        self.rows[i] = 0.0
        self.rows[i, :, :3] = PARKED
        self.rows[i, order, ATTRIBUTES] = attributes(scene)
        free = Hold.of(scene.targets, episode.fixed) == Hold.FREE
        for mask, those in ((state.shown, True), (state.movable, free), (state.targets, scene.targets)):
            mask[i] = False
            mask[i, order] = those
        state.referent[i] = order[episode.referent]
        state.target[i] = order[episode.referent if episode.target is None else episode.target]
        self.instruction[i] = encoded(self._tokenizer, episode)
        self.sentence[i] = in_bytes(episode.sentence)
        self.kind[i], self.steps[i] = episode.kind, 0

    def read(self, worlds: NDArray[np.int64]) -> None:
        """Take the measured state of these worlds from PyBullet."""
        joints: list[list[tuple]] = []
        poses: list[float] = []
        for i in worlds.tolist():
            world = self._worlds[i]
            joints.append(list(map(_angle_and_speed, world.robot.states())))
            for position, quaternion in world.objects():
                poses += position
                poses += quaternion
        self.joints[worlds] = joints
        shown = np.zeros_like(self.state.shown)
        shown[worlds] = self.state.shown[worlds]
        self.rows[shown, :7] = np.reshape(poses, (-1, 7))
        self.angles = np.ascontiguousarray(self.joints[:, : self.commanded.shape[1], 0])
        self.pose = self._chain.forward(self.angles)
        self.state.gripper = self.pose.position
