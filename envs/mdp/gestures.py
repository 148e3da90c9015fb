"""Who points where, in all worlds: the arms, the rays that are observed, and fingers that move on in mid-episode."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from conf.schema import ConfigError
from envs.sim.workspace import WorkspaceConfig
from envs.sim.world import World
from envs.tasks import Episode, GestureSwitch
from human import Gesture, GestureConfig, HumanConfig, Person, PointingArm, ray_offsets
from human.body.person_camera import FurnitureBox
from human.ray_reader import CameraRayReader

RAY_WIDTH = 7  # origin (m), unit direction, and 1 where a gesture is shown; all 0 where none is
NEVER = -1


def make_person(human: HumanConfig | None, config: GestureConfig) -> Person | None:
    """The person who points; None where nobody is asked to. Raises ConfigError where nobody is there."""
    if config.source == "none":
        return None
    if human is None:
        raise ConfigError(f"gesture.source={config.source} needs a person in the workspace: workspace=collabtable")
    return Person(human, config)


def make_ray_reader(workspace: WorkspaceConfig, config: GestureConfig) -> CameraRayReader | None:
    """The camera whose pictures rays are read from; None where they are not. Raises ConfigError."""
    if config.source != "camera" or workspace.human is None:
        return None
    blocks = [FurnitureBox(box.size, box.position, box.color) for box in workspace.furniture.values()]
    return CameraRayReader(workspace.human, blocks, config)


def ray_of(gesture: Gesture | None) -> NDArray[np.float64]:
    """(RAY_WIDTH,) what is observed of a gesture."""
    if gesture is None or not gesture.shown:
        return np.zeros(RAY_WIDTH)
    return np.concatenate((gesture.origin, gesture.direction, [1.0]))


class Gestures:
    """rays: (N, RAY_WIDTH) float64, as observed. points: whether anybody points; all else is for nothing where not.

    watch: the camera whose pictures rays are read from; none: they are the fingers' own.
    """

    def __init__(self, config: GestureConfig, worlds: Sequence[World], watch: CameraRayReader | None = None) -> None:
        self._config, self._worlds, self._watch = config, worlds, watch
        self.points = config.source != "none"
        self.rays = np.zeros((len(worlds), RAY_WIDTH))
        self._turns: list[GestureSwitch | None] = [None] * len(worlds)
        self._due = np.full(len(worlds), NEVER)
        self._moving: list[int] = []
        self._measures, self._stale = np.zeros((len(worlds), 3)), np.ones(len(worlds), bool)
        self._meant = np.full(len(worlds), NEVER)

    def begin(self, i: int, episode: Episode) -> None:
        """Pose the person of world i as this episode begins; `read` then sees the finger."""
        self.rays[i], self._turns[i], self._due[i] = 0.0, None, NEVER
        if episode.gesture is None:
            return
        self._person(i).pose(episode.gesture.joints)
        self._worlds[i].show_finger(episode.gesture.shown)
        self._turns[i], self._due[i] = episode.turn, NEVER if episode.turn is None else episode.turn.at
        self.rays[i, 6] = episode.gesture.shown

    def switch(self, steps: NDArray[np.int64]) -> list[tuple[int, int]]:
        """Send arms on to another object where it is time to: (world, object that is meant now) for each.

        steps: (N,) control steps since each episode began.
        """
        turned = []
        for i in np.flatnonzero(self._due == steps).tolist():
            turn = self._turns[i]
            assert turn is not None
            self.move(i, turn.gesture)
            turned.append((i, turn.referent))
        return turned

    def move(self, i: int, gesture: Gesture) -> None:
        """Let the arm of world i move to this gesture, over the next `frames` physics steps."""
        self._person(i).move(gesture.joints, self._config.frames)
        self._worlds[i].show_finger(gesture.shown)
        self.rays[i, 6] = gesture.shown
        self._moving.append(i)

    def point(self, i: int, gesture: Gesture) -> None:
        """Let the arm of world i take this gesture before anything else happens, and keep it for this episode."""
        self._due[i] = NEVER
        self.move(i, gesture)
        while self._person(i).moving:
            self._worlds[i].step_physics()
        self.follow()

    def follow(self) -> None:
        """See again the fingers that are moving."""
        if self._moving:
            self.read(self._moving)
            self._moving = [i for i in self._moving if self._person(i).moving]

    def read(self, worlds: Sequence[int]) -> None:
        """See the fingers of these worlds as they are now."""
        if not self.points:
            return
        raised = [i for i in worlds if self.rays[i, 6]]
        if raised and self._watch is not None:
            seen = self._watch.rays([self._person(i).angles for i in raised])
            self.rays[raised, :6] = np.concatenate(seen, axis=1)
        elif raised:
            self.rays[raised, :6] = [np.concatenate(self._person(i).ray(self._config.style)) for i in raised]
        self.rays[worlds] *= self.rays[worlds, 6:]
        self._stale[worlds] = True

    def measures(
        self, positions: NDArray[np.float64], shown: NDArray[np.bool_], referent: NDArray[np.int64]
    ) -> NDArray:
        """(N, 3) how hard it was to tell what is meant when the finger last moved; 0 where no gesture is shown.

        Radians from the ray to the referent, radians between the referent and the object nearest to it, both seen from
        the fingertip, and metres from there to the referent.

        positions (N, K, 3), metres; shown (N, K) bool; referent (N,) slots.
        """
        rows = np.flatnonzero(self._stale | (referent != self._meant))
        if len(rows):
            self._measures[rows] = self._measured(rows, positions[rows], shown[rows], referent[rows])
            self._stale[rows], self._meant[rows] = False, referent[rows]
        return self._measures

    def _measured(
        self, rows: NDArray[np.int64], places: NDArray[np.float64], shown: NDArray[np.bool_], meant: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """`measures` of these worlds alone, R of N."""
        each, raised = np.arange(len(rows)), self.rays[rows, 6:]
        origin = self.rays[rows, :3]
        offset = places[each, meant] - origin
        apart = np.where(shown, ray_offsets(origin, offset, places).angle, np.inf)
        apart[each, meant] = np.inf
        direction = np.where(raised > 0, self.rays[rows, 3:6], offset)
        ray = ray_offsets(origin, direction, (origin + offset)[:, None]).angle[:, 0]
        rival = np.minimum(apart.min(1), np.pi)
        return raised * np.stack((ray, rival, np.linalg.norm(offset, axis=1)), axis=1)

    def close(self) -> None:
        """Free the camera's client. Twice is once."""
        if self._watch is not None:
            self._watch.close()

    def _person(self, i: int) -> PointingArm:
        person = self._worlds[i].person
        assert person is not None
        return person
