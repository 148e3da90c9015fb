"""Experts that move objects without placing them: push, swipe, poke and throw."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from envs.experts.base import HOVER, UP, Array, Expert, Slots, choose_rows, register_expert
from envs.experts.pick_and_place import GRASP, THERE, Fetch
from envs.tasks.push import LANDED, SHORT
from envs.tasks.shared.geometry import horizontal, length
from envs.workspace_env import WorkspaceEnv

# push
TOOL = 0.025  # metres from the gripper's centre to the side that pushes
FREE = 0.008  # metres between it and the object as it goes down
ASIDE = 0.01  # metres beside the line at which it goes back for another try
CLEAR = 0.02  # metres further away, at which it may go up
FAR = 0.06  # metres behind where it touches the object, within which it goes on pushing
SINK = 0.02  # metres that it goes down in a control step
STEER = 0.4  # share of the lateral error that each step corrects
STEP = 0.012  # metres that it pushes in a control step; if faster, the object slides on
AT_TARGET = 0.025  # metres from its target within which an object is left alone
FINE = 0.042  # ... if it would take another try to push it nearer
# How high above the table a gripper pushes, metres: jaco's fingers spread wider than an object, and pass over it.
HEIGHTS = {"jaco": 0.043}
HEIGHT = 0.025
# swipe
SWIPE_STEP = 0.02  # metres in a control step: slower than it could, so that it keeps to the line
# poke
POKE_FAR = 0.028  # metres that it pushes
POKE_STEP = 0.006  # ... in a control step: a faster one sends the object away
WAYS = 8  # directions in which it may push
# throw
AT = 0.02  # metres from the start of the run within which the run begins
RUN_UP_STEP = 0.012  # metres by which each further try lengthens the run-up: the same one would fall short again
FOLLOW = 3  # control steps after the release at the same speed: slower fingers would be in the way
MARGIN = 0.005  # metres beyond the required distance at the release
WINDOW = 1.2  # control steps' worth of distance within which it releases, so that no step skips the place


# ---- push and poke


class Pusher(Expert):
    """Moves through the air to a place behind an object, and pushes it."""

    def __init__(self, env: WorkspaceEnv) -> None:
        super().__init__(env)
        self._over = env.config.robot.name in HEIGHTS  # whether parts of the gripper extend beyond the object
        self._height = HEIGHTS.get(env.config.robot.name, HEIGHT)
        self._apart = env.config.task.object_size / 2 + TOOL  # metres between the centres as they touch

    def _push(self, thing: Array, way: Array, step: float = STEP) -> Array:
        """Return where the gripper goes (N, 3) to push the object `step` metres along `way`, a unit vector (N, 3)."""
        pushing, aside = self._pushing(thing, way)
        onward = self._env.gripper - STEER * aside + step * way
        onward[:, 2] = self._height
        return choose_rows(pushing, onward, self._around(thing, way))

    def _pushing(self, thing: Array, way: Array) -> tuple[NDArray[np.bool_], Array]:
        """Return whether the gripper is low behind the object (N,), and how far beside the line (N, 3)."""
        offset = (self._env.gripper - thing) * [1.0, 1.0, 0.0]
        along = (offset * way).sum(1)
        aside = offset - along[:, None] * way
        behind = (along < 2 * FREE - self._apart) & (along > -FAR - self._apart) & (length(aside) < ASIDE)
        return behind & (self._env.gripper[:, 2] < self._height + FREE), aside

    def _around(self, thing: Array, way: Array) -> Array:
        """Return where the gripper goes (N, 3): back, up, over, and down behind the object."""
        start = thing - (self._apart + FREE) * way
        gripper = self._env.gripper
        high = gripper[:, 2] > HOVER - 0.02
        over = length((start - gripper)[:, :2]) < np.where(high, 0.005, 0.015)
        start[:, 2] = np.where(over, np.maximum(self._height, gripper[:, 2] - SINK), HOVER)
        return choose_rows(over | high, start, self._back(thing, -horizontal(gripper - thing)))

    def _back(self, thing: Array, way: Array) -> Array:
        """Return where the gripper goes (N, 3) from the object that it touches: back, and then up.

        A gripper that rises at once would lift the object. One with parts beyond the object rises at once all the same,
        since going back would drag it.
        """
        near = (length((self._env.gripper - thing)[:, :2]) < self._apart + CLEAR) & (not self._over)
        high = self._env.gripper[:, 2] > HOVER - 0.04
        return self._env.gripper + choose_rows(near & ~high, -HOVER * way, HOVER * UP)


@register_expert("push", "nl_push")
class PushExpert(Pusher):
    """Pushes the referent to its target."""

    def act(self, referent: Slots, target: Slots) -> Tensor:
        thing, goal = self._place(referent), self._place(target)
        way = horizontal(goal - thing)
        pushing, _ = self._pushing(thing, way)
        there = length((goal - thing)[:, :2]) < np.where(pushing, AT_TARGET, FINE)
        return self._env.towards(choose_rows(there, self._env.gripper, self._push(thing, way)))


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
        poked = length((thing - self._stood)[:, :2]) > POKE_FAR
        return self._env.towards(
            choose_rows(poked, self._back(thing, self._way), self._push(thing, self._way, POKE_STEP))
        )

    def _freest_direction(self, i: int, thing: Array) -> Array:
        """(3,) the direction in which world i's object, and the gripper behind it, are farthest from other objects."""
        state, angles = self._env.state, np.arange(WAYS) * 2 * np.pi / WAYS
        ways = np.stack((np.cos(angles), np.sin(angles), np.zeros(WAYS)), axis=1)
        starts = thing - (self._apart + FREE) * ways
        others = state.objects[i, state.movable[i] & (length(state.objects[i] - thing) > 0)]
        low, high = np.reshape(self._env.config.workspace.gripper_box, (3, 2)).T
        inside = ((starts >= low) & (starts <= high))[:, :2].all(1)
        places = np.concatenate((starts[:, None], (thing + 2 * POKE_FAR * ways)[:, None]), axis=1)
        room = length(places[:, :, None] - others).min((1, 2), initial=1.0)
        return ways[np.where(inside, room, -1.0).argmax()]


# ---- swipe


@register_expert("swipe")
class SwipeExpert(Fetch):
    """Keeps the dragged object on the table."""

    def act(self, referent: Slots, target: Slots) -> Tensor:
        thing, goal = self._place(referent), self._place(target)
        held = self._env.state.held == referent
        left = length((goal - thing)[:, :2])
        there = ~held & (left < THERE)
        fetch, close = self._fetch(thing)
        onward = self._env.gripper + (goal - thing) * np.minimum(1.0, SWIPE_STEP / np.maximum(left, 1e-9))[:, None]
        onward[:, 2] = self._env.gripper[:, 2] + (goal - thing)[:, 2]  # a gripper that closed too low must not lift
        place = choose_rows(there, self._env.gripper + HOVER * UP, choose_rows(held, onward, fetch))
        return self._env.towards(place, np.where(held, left > GRASP, close) & ~there)


# ---- throw


class Style(NamedTuple):
    """How a gripper throws.

    height: metres above the table at which it carries the object. run: metres from the target at which the run-up
    begins. stride: metres of run-up in a control step. flight: distance from release to rest, in strides. lead: control
    steps between the command to open and the release.
    """

    height: float
    run: float
    stride: float
    flight: float
    lead: int


STYLES = {"magnet": Style(0.18, 0.31, 0.024, 10.0, 0), "fingers": Style(0.22, 0.27, 0.03, 4.0, 2)}


@register_expert("throw")
class ThrowExpert(Fetch):
    """Accelerates along y, where there is most room, towards the target's side of the table."""

    def __init__(self, env: WorkspaceEnv) -> None:
        super().__init__(env)
        self._style = STYLES[env.config.gripper.of(env.config.robot)]
        self._running, self._letting_go = np.zeros((2, len(self._rows)), bool)
        self._after = np.full(len(self._rows), FOLLOW)  # control steps since it let go
        self._run = np.full((len(self._rows), 1), self._style.run)
        self._last = np.zeros((len(self._rows), 3))

    def act(self, referent: Slots, target: Slots) -> Tensor:
        thing, goal = self._place(referent), self._place(target)
        held = self._env.state.held == referent
        way = np.where(goal[:, 1:2] >= 0, 1.0, -1.0) * [0.0, 1.0, 0.0]
        self._note(thing, goal, way, held)
        fetch, close = self._fetch(thing)
        carry = self._env.gripper + self._carry(thing, goal, way) - thing
        landed = (self._env.task.memory[:, 0] > 0) & (length((goal - thing)[:, :2]) < LANDED)
        follow = ~held & (self._after <= FOLLOW)
        onward = self._env.gripper + self._style.stride * way * follow[:, None]
        place = choose_rows(follow | landed, onward, choose_rows(held, carry, fetch))
        return self._env.towards(place, np.where(held, ~self._letting_go, close & ~follow & ~landed))

    def _note(self, thing: Array, goal: Array, way: Array, held: NDArray[np.bool_]) -> None:
        """Update which grippers are in their run-up, and which have released."""
        left, pace = ((goal - thing) * way).sum(1), ((thing - self._last) * way).sum(1)
        start = self._start(goal, way)
        self._running = held & ((self._running & (left > SHORT)) | (length(start - thing) < AT))
        left -= self._style.lead * pace
        far = np.maximum(self._style.flight * pace, SHORT + MARGIN + WINDOW * pace)
        self._letting_go = held & (self._letting_go | (self._running & (left > SHORT + MARGIN) & (left < far)))
        self._after = np.where(held, 0, self._after + 1)
        self._run[self._after == 1] += RUN_UP_STEP
        self._run[self._env.elapsed == 0] = self._style.run
        self._last = thing

    def _start(self, goal: Array, way: Array) -> Array:
        """Return where the run begins (N, 3)."""
        start = goal - self._run * way
        start[:, 2] = self._style.height
        return start

    def _carry(self, thing: Array, goal: Array, way: Array) -> Array:
        """Return where the held object goes (N, 3): up, to the start of the run-up, and on."""
        start = self._start(goal, way)
        up, run = thing.copy(), start.copy()
        up[:, 2] = self._style.height
        run[:, 1] = thing[:, 1] + self._style.stride * way[:, 1]
        return choose_rows(self._running, run, choose_rows(thing[:, 2] < self._style.height / 2, up, start))
