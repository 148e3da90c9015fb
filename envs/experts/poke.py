"""Poke: down beside the referent, a short push, and up."""

from __future__ import annotations

import numpy as np
from torch import Tensor

from envs.experts.base import Array, Slots, choose_rows
from envs.experts.push import FREE, Pusher
from envs.experts.registry import register_expert
from envs.tasks.geometry import length
from envs.workspace_env import WorkspaceEnv

FAR = 0.028  # metres that it pushes
STEP = 0.006  # ... in a control step: a faster one sends the object away
WAYS = 8  # directions in which it may push


@register_expert("poke")
class PokeExpert(Pusher):
    """Pushes in the direction with the most room. It remembers that direction and where the object stood."""

    def __init__(self, env: WorkspaceEnv) -> None:
        super().__init__(env)
        self._stood, self._way = np.zeros((2, len(self._rows), 3))

    def act(self, referent: Slots, target: Slots) -> Tensor:
        thing = self._place(referent)
        for i in np.flatnonzero(self._env.elapsed == 0).tolist():
            self._stood[i], self._way[i] = thing[i], self._freest_direction(i, thing[i])
        poked = length((thing - self._stood)[:, :2]) > FAR
        return self._env.towards(choose_rows(poked, self._back(thing, self._way), self._push(thing, self._way, STEP)))

    def _freest_direction(self, i: int, thing: Array) -> Array:
        """(3,) the direction in which world i's object, and the gripper behind it, are farthest from other objects."""
        state, angles = self._env.state, np.arange(WAYS) * 2 * np.pi / WAYS
        ways = np.stack((np.cos(angles), np.sin(angles), np.zeros(WAYS)), axis=1)
        starts = thing - (self._apart + FREE) * ways
        others = state.objects[i, state.movable[i] & (length(state.objects[i] - thing) > 0)]
        low, high = np.reshape(self._env.config.workspace.gripper_box, (3, 2)).T
        inside = ((starts >= low) & (starts <= high))[:, :2].all(1)
        places = np.concatenate((starts[:, None], (thing + 2 * FAR * ways)[:, None]), axis=1)
        room = length(places[:, :, None] - others).min((1, 2), initial=1.0)
        return ways[np.where(inside, room, -1.0).argmax()]
