"""Throw: pick the referent up, accelerate towards its target, and release it so that it lands there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from envs.experts.base import Array, Slots, choose_rows
from envs.experts.place import Fetch
from envs.experts.registry import register_expert
from envs.tasks.geometry import length
from envs.tasks.throw import LANDED, SHORT
from envs.workspace_env import WorkspaceEnv

AT = 0.02  # metres from the start of the run within which the run begins
RUN_UP_STEP = 0.012  # metres by which each further try lengthens the run-up: the same one would fall short again
FOLLOW = 3  # control steps after the release at the same speed: slower fingers would be in the way
MARGIN = 0.005  # metres beyond the required distance at the release
WINDOW = 1.2  # control steps' worth of distance within which it releases, so that no step skips the place


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
        """Updates which grippers are in their run-up, and which have released."""
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
        """Where the run begins (N, 3)."""
        start = goal - self._run * way
        start[:, 2] = self._style.height
        return start

    def _carry(self, thing: Array, goal: Array, way: Array) -> Array:
        """Where the held object goes (N, 3): up, to the start of the run-up, and on."""
        start = self._start(goal, way)
        up, run = thing.copy(), start.copy()
        up[:, 2] = self._style.height
        run[:, 1] = thing[:, 1] + self._style.stride * way[:, 1]
        return choose_rows(self._running, run, choose_rows(thing[:, 2] < self._style.height / 2, up, start))
