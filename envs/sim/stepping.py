"""Physics steps of one PyBullet client: many in one call, since a call takes as long as a tenth of a step."""

from __future__ import annotations

from functools import cache, partial

import pybullet as bullet


class Stepper:
    """Takes the physics steps of a client.

    client: PyBullet's client. time_step: its time step between calls, seconds.
    each: take every step in a call of its own, where something happens between steps: Bullet computes the damping of
    joints once in a call, and a window draws once in a call.
    """

    def __init__(self, client: int, time_step: float, each: bool = False) -> None:
        self._time_step, self._each = time_step, each
        self.step = partial(bullet.stepSimulation, client)
        self._set = partial(bullet.setPhysicsEngineParameter, physicsClientId=client)

    def run(self, count: int) -> None:
        """Take `count` physics steps, with the same bits as one call for each."""
        if self._each or count < 3 or not _divides(self._time_step, count):
            for _ in range(count):
                self.step()
        else:
            self._set(fixedTimeStep=self._time_step * count, numSubSteps=count)
            self.step()
            # Forces of motors and constraints that are set from now on are for a single time step.
            self._set(fixedTimeStep=self._time_step, numSubSteps=0)


@cache
def _divides(time_step: float, count: int) -> bool:
    """Whether Bullet, which divides the total time by `count`, then takes steps of exactly this length, seconds."""
    total = time_step * count
    return total / count == time_step and int(total / time_step) == count
