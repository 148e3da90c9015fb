"""An environment with one world that a person instructs: sentences, pointing, and objects that are moved by hand."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from tensordict import TensorDictBase
from torch import Tensor

from core.cameras import CameraFrame
from envs.config import EnvConfig
from envs.mdp.goals import Goal
from envs.mdp.object_rows import scene_of_rows
from envs.perception import View
from envs.sim.rendering import VisualShapes
from envs.sim.window import Window
from envs.workspace_env import WorkspaceEnv
from human import PointingGesture
from language import NOUNS, SHAPES, LanguageError, Scene, describe

Array = NDArray[np.float64]
POINTING_STEPS = 60  # physics steps of a pointing motion: a quarter of a second, about as long as people take


class InteractiveEnv(WorkspaceEnv):
    """One world whose episodes start with `give_instruction` and have one. Objects are numbered as in `scene()`.

    With perception=camera the objects are those that cameras see.

    client: PyBullet's client number. robot, furniture: of the world. visual_shapes: what is drawn, and its poses.
    has_person: whether the workspace has a person who can point.
    """

    def __init__(self, config: EnvConfig, seed: int = 0, window: Window | None = None) -> None:
        super().__init__(config, 1, seed, render=True, window=window)
        self._single_world = self._worlds[0]
        self.client = self._single_world.client
        self.robot, self.furniture = self._single_world.robot, self._single_world.furniture
        self.visual_shapes = VisualShapes(self.client)
        self.has_person = self._single_world.person is not None

    # ---- State

    def scene(self) -> Scene:
        """Return the objects as the language sees them."""
        slots = self._slots
        return scene_of_rows(self.rows[0, slots], self.config.task.viewpoint, self.sight.state.nouns[0, slots])

    def moved(self) -> Array:
        """(K,) how far devices are from their start, in shares of their way; 0 for other objects."""
        return self.sight.task.moved(self.sight.state)[0, self._slots]

    def bodies(self) -> list[int | None]:
        """PyBullet's body number of each object; None for devices and fittings, which are no single bodies, and for
        what is not there."""
        true = np.flatnonzero(self._state.shown[0])
        loose = true[np.array([noun in SHAPES for noun in NOUNS])[self._state.nouns[0, true]]]
        bodies = dict(zip(loose.tolist(), self._single_world.pool.shown, strict=True))
        return [bodies.get(slot) for slot in self._slots.tolist()]

    def shapes(self) -> list[str]:
        """Return the shape of each loose object: a noun of the scene, or "pyramid", which cameras do not tell."""
        if self.config.perception.sees:
            nouns = [list(NOUNS)[noun] for noun in self.sight.state.nouns[0, self._slots]]
            return [noun for noun in nouns if noun in SHAPES]
        return list(self._single_world.pool.nouns)

    @property
    def all_bodies(self) -> list[int]:
        """Every body that `bodies` returns in any episode."""
        return self._single_world.pool.bodies

    @property
    def _slots(self) -> NDArray[np.int64]:
        return np.flatnonzero(self.sight.state.shown[0])

    @property
    def held(self) -> int | None:
        """The number of the object that the gripper holds; None for nothing."""
        return next(iter(np.flatnonzero(self._slots == self.sight.state.held[0]).tolist()), None)

    @property
    def rest_position(self) -> Array:
        """(3,) metres: where the gripper is when an episode starts, without the noise."""
        return self.kinematics.forward(self.kinematics.rest[None]).position[0]

    def views(self, names: Iterable[str]) -> dict[str, View]:
        """Return the pictures that cameras of the workspace take now, by their names."""
        pose = self.kinematics.forward(self._arrays.angles)
        gripper, found = (pose.position[0], pose.rotation[0]), {}
        for name in names:
            camera = self.config.workspace.cameras[name]
            picture = self._single_world.picture(camera, gripper)
            found[name] = View(picture, camera, CameraFrame.of(camera, gripper))
        return found

    # ---- Instructions

    def give_instruction(
        self, sentence: str, referent: int, target: int | None = None, verb: str | None = None
    ) -> TensorDictBase:
        """Start an episode with this instruction. Moves nothing. Returns the observation.

        verb: of the sentence, where the task has several (`Task.verbs`).
        """
        slots, arrays = self._slots, self._arrays
        arrays.read(arrays.index)
        where = int(slots[referent if target is None else target])
        kind = arrays.goals[0].kind if verb is None else self.task.kind_names.index(verb)
        goal = Goal(referent=int(slots[referent]), target=where, sentence=sentence, policy_sentence=sentence, kind=kind)
        self._set_goal(0, goal)
        arrays.steps[0] = 0
        return self._first_observation()

    def _next_goals(self, success: NDArray[np.bool_]) -> Iterator[tuple[int, Goal]]:
        """Return None: the person says what is next."""
        return iter(())

    def hold_action(self) -> Tensor:
        """(1, A) the action that keeps the arm where it is, and the gripper as it is commanded now."""
        hold = torch.from_numpy(self._source.hold())
        if self._grip_controller.can_grip:
            hold[0, -1] = 1.0 if self._grip_controller.closed[0] else -1.0
        return hold

    def leads_to(self, action: Tensor) -> Array:
        """(3,) metres: where an action (1, A) in the present state commands the gripper to be after a control step."""
        arm = action.numpy()[:, : len(self.control.unit)].astype(np.float64)
        joints = self.control.targets(arm, self._arrays.commanded, self._arrays.angles)
        return self.kinematics.forward(joints).position[0]

    # ---- Actions of the person

    def point_at(self, target: ArrayLike) -> tuple[Array, Array]:
        """Let the person point at target (3,), metres. Returns origin (3,) and direction (3,) of the final ray.

        Raises Unreachable, and then nothing moves.
        """
        person = self._single_world.person
        assert person is not None
        joints, origin, direction = person.aim(np.asarray(target, np.float64), self.config.gesture.style)
        if self.task.points:
            self._gestures.move(0, PointingGesture(joints, origin, direction))
        else:
            person.move(joints, POINTING_STEPS)
        return origin, direction

    def put_object(self, index: int, position: Sequence[float]) -> None:
        """Put a loose object at position (3,), metres, without turning it. A held object is released first."""
        if self._state.held[0] == self._slots[index]:
            self._single_world.release()
        pool, body = self._single_world.pool, self.bodies()[index]
        assert body is not None, "only what is there and loose can be moved"
        pool.move(pool.shown.index(body), position)
        self._arrays.read(self._arrays.index)
        if self._perceived is not None:
            self._perceived.look_again()


# ---- names of objects, for messages


def object_names(scene: Scene) -> list[str]:
    """Return the name of each object."""
    return [object_name(index, scene) for index in range(len(scene))]


def object_name(index: int, scene: Scene) -> str:
    """Return the shortest description that fits this object only; "a <colour> <noun>" if there is none."""
    try:
        return describe(index, scene)
    except LanguageError:
        return f"a {scene[index].color} {scene[index].noun}"
