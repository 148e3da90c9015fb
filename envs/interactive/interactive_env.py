"""One world that a person directs: they say what is meant now, point, and put things elsewhere, while it goes on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from tensordict import TensorDictBase
from torch import Tensor

from envs.config import EnvConfig
from envs.mdp.goals import Goal
from envs.mdp.observation_spec import seen_scene
from envs.sim.visual_shapes import VisualShapes
from envs.sim.window import Window
from envs.workspace_env import WorkspaceEnv
from human import Gesture
from language import Scene

Array = NDArray[np.float64]
POINTING = 60  # physics steps that an arm takes to point elsewhere: a quarter of a second, as people take


class InteractiveEnv(WorkspaceEnv):
    """A world whose episodes begin when somebody says so. Objects go by their number in `scene`.

    client: Bullet's number. looks: what is drawn, and where it is. shows: whether somebody stands there who can point.
    """

    def __init__(self, config: EnvConfig, seed: int = 0, window: Window | None = None) -> None:
        super().__init__(config, 1, seed, render=True, window=window)
        self._only = self._worlds[0]
        self.client = self._only.client
        self.looks = VisualShapes(self.client)
        self.shows = self._only.person is not None

    # ---- what is there

    def scene(self) -> Scene:
        """The objects, as words see them."""
        return seen_scene(self._arrays.rows[0, self._slots], self.config.task.viewpoint, self.task.operates)

    def bodies(self) -> list[int]:
        """Bullet's number of each object's body; of devices, which have several, none."""
        return list(self._only.pool.shown)

    @property
    def stock(self) -> list[int]:
        """All that `bodies` can be, in one episode or another."""
        return self._only.pool.bodies

    @property
    def _slots(self) -> NDArray[np.int64]:
        return np.flatnonzero(self._state.shown[0])

    @property
    def rest(self) -> Array:
        """(3,) where the gripper is as an episode begins, but for noise, metres."""
        return self.chain.forward(self.chain.rest[None]).position[0]

    # ---- what is meant

    def tell(self, sentence: str, referent: int, target: int | None = None) -> TensorDictBase:
        """From now on this is asked for, and the time begins anew; nothing is moved. Returns what is observed."""
        slots, arrays = self._slots, self._arrays
        arrays.read(arrays.index)
        where = int(slots[referent if target is None else target])
        self._set_goal(0, Goal(int(slots[referent]), where, sentence, sentence, arrays.goals[0].kind))
        arrays.steps[0] = 0
        return self._begun()

    def still(self) -> Tensor:
        """(1, A) the action that leaves the arm where it is, its gripper as it is told to be now."""
        hold = torch.from_numpy(self._hold())
        if self._grips.grips:
            hold[0, -1] = 1.0 if self._grips.closed[0] else -1.0
        return hold

    # ---- what a person does

    def point(self, target: ArrayLike) -> tuple[Array, Array]:
        """Let the person point at target (3,), metres: the ray that they will show, its origin and direction.

        Raises Unreachable, and nothing moves.
        """
        person = self._only.person
        assert person is not None
        joints, origin, direction = person.aim(np.asarray(target, np.float64), self.config.gesture.style)
        if self.task.points:
            self._gestures.move(0, Gesture(joints, origin, direction))
        else:
            person.move(joints, POINTING)
        return origin, direction

    def put(self, index: int, position: Sequence[float]) -> None:
        """Put an object there, (3,) metres, as it is turned; it comes to rest by itself. A held one is let go first."""
        if self._state.held[0] == self._slots[index]:
            self._only.release()
        self._only.pool.move(index, position)
        self._arrays.read(self._arrays.index)
