"""The pointing gestures of all worlds: posing the person, the observed rays, and switches within an episode."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.sim.workspace import WorkspaceConfig
from envs.sim.world import SimulatedWorld
from envs.tasks import EpisodeSpec, GestureSwitch
from human import GestureConfig, HumanConfig, Person, PointingArm, PointingGesture, ray_offsets
from human.body.person_camera import FurnitureBox
from human.ray_reader import CameraRayReader

RAY_WIDTH = 7  # origin (m), unit direction, and 1 where a gesture is shown; all 0 where none is
NEVER = -1  # control step of a switch that does not happen


def make_person(human: HumanConfig | None, config: GestureConfig) -> Person | None:
    """Make the person who points; None if gesture.source=none. Raises ConfigError for a workspace without one."""
    if config.source == "none":
        return None
    if human is None:
        raise ConfigError(f"gesture.source={config.source} needs a person in the workspace: workspace=collabtable")
    return Person(human, config)


def make_ray_reader(workspace: WorkspaceConfig, config: GestureConfig) -> CameraRayReader | None:
    """Read rays from camera images; None unless gesture.source=camera. Raises ConfigError."""
    if config.source != "camera" or workspace.human is None:
        return None
    blocks = [FurnitureBox(box.size, box.position, box.color) for box in workspace.furniture.values()]
    return CameraRayReader(workspace.human, blocks, config)


def ray_of(gesture: PointingGesture | None) -> NDArray[np.float64]:
    """(RAY_WIDTH,) the observation of a gesture."""
    if gesture is None or not gesture.shown:
        return np.zeros(RAY_WIDTH)
    return np.concatenate((gesture.origin, gesture.direction, [1.0]))


class Gestures:
    """rays: (N, RAY_WIDTH) float64, as observed. points: whether a person points; if False, methods are no-ops.

    ray_reader: reads rays from camera images; None: rays are those of the fingers.
    """

    def __init__(
        self, config: GestureConfig, worlds: Sequence[SimulatedWorld], ray_reader: CameraRayReader | None = None
    ) -> None:
        self._config, self._worlds, self._ray_reader = config, worlds, ray_reader
        self.points = config.source != "none"
        self.rays = np.zeros((len(worlds), RAY_WIDTH))
        self._switches: list[GestureSwitch | None] = [None] * len(worlds)
        self._switch_steps = np.full(len(worlds), NEVER)
        self._moving: list[int] = []
        self._difficulty, self._stale = np.zeros((len(worlds), 3)), np.ones(len(worlds), bool)
        self._measured_referents = np.full(len(worlds), NEVER)

    def begin(self, i: int, episode: EpisodeSpec) -> None:
        """Pose the person of world i for the beginning of this episode. Call `read` then."""
        self.rays[i], self._switches[i], self._switch_steps[i] = 0.0, None, NEVER
        if episode.gesture is None:
            return
        self._person(i).pose(episode.gesture.joints)
        self._worlds[i].show_finger(episode.gesture.shown)
        self._switches[i], self._switch_steps[i] = (
            episode.gesture_switch,
            NEVER if episode.gesture_switch is None else episode.gesture_switch.at,
        )
        self.rays[i, 6] = episode.gesture.shown

    def switch(self, steps: NDArray[np.int64]) -> list[tuple[int, int]]:
        """Start the switches to another object that are due. Returns (world, new referent's number) of each.

        steps: (N,) control steps since each episode began.
        """
        switched = []
        for i in np.flatnonzero(self._switch_steps == steps).tolist():
            switch = self._switches[i]
            assert switch is not None
            self.move(i, switch.gesture)
            switched.append((i, switch.referent))
        return switched

    def move(self, i: int, gesture: PointingGesture) -> None:
        """Move the arm of world i to this gesture, over the next `frames` physics steps."""
        self._person(i).move(gesture.joints, self._config.frames)
        self._worlds[i].show_finger(gesture.shown)
        self.rays[i, 6] = gesture.shown
        self._moving.append(i)

    def point(self, i: int, gesture: PointingGesture) -> None:
        """Move the arm of world i to this gesture now, without a control step, and keep it for this episode."""
        self._switch_steps[i] = NEVER
        self.move(i, gesture)
        while self._person(i).moving:
            self._worlds[i].step_physics()
        self.follow()

    def follow(self) -> None:
        """After a control step: read the rays of fingers that are moving."""
        if self._moving:
            self.read(self._moving)
            self._moving = [i for i in self._moving if self._person(i).moving]

    def read(self, worlds: Sequence[int]) -> None:
        """Read the rays of these worlds."""
        if not self.points:
            return
        raised = [i for i in worlds if self.rays[i, 6]]
        if raised and self._ray_reader is not None:
            seen = self._ray_reader.rays([self._person(i).angles for i in raised])
            self.rays[raised, :6] = np.concatenate(seen, axis=1)
        elif raised:
            self.rays[raised, :6] = [np.concatenate(self._person(i).ray(self._config.style)) for i in raised]
        self.rays[worlds] *= self.rays[worlds, 6:]
        self._stale[worlds] = True

    def measures(
        self, positions: NDArray[np.float64], shown: NDArray[np.bool_], referent: NDArray[np.int64]
    ) -> NDArray:
        """(N, 3) how hard the gesture is to interpret, as of the finger's last motion; 0 where none is shown.

        The columns: radians from the ray to the referent, radians between the referent and the object nearest to it,
        both seen from the fingertip, and metres from the fingertip to the referent.

        positions (N, K, 3), metres; shown (N, K) bool; referent (N,) slots.
        """
        rows = np.flatnonzero(self._stale | (referent != self._measured_referents))
        if len(rows):
            self._difficulty[rows] = self._measured(rows, positions[rows], shown[rows], referent[rows])
            self._stale[rows], self._measured_referents[rows] = False, referent[rows]
        return self._difficulty

    def _measured(
        self,
        rows: NDArray[np.int64],
        places: NDArray[np.float64],
        shown: NDArray[np.bool_],
        referent: NDArray[np.int64],
    ) -> NDArray[np.float64]:
        """`measures` of these worlds alone, R of N."""
        each, raised = np.arange(len(rows)), self.rays[rows, 6:]
        origin = self.rays[rows, :3]
        offset = places[each, referent] - origin
        apart = np.where(shown, ray_offsets(origin, offset, places).angle, np.inf)
        apart[each, referent] = np.inf
        direction = np.where(raised > 0, self.rays[rows, 3:6], offset)
        ray = ray_offsets(origin, direction, (origin + offset)[:, None]).angle[:, 0]
        rival = np.minimum(apart.min(1), np.pi)
        return raised * np.stack((ray, rival, np.linalg.norm(offset, axis=1)), axis=1)

    def close(self) -> None:
        """Free the camera's client. Idempotent."""
        if self._ray_reader is not None:
            self._ray_reader.close()

    def _person(self, i: int) -> PointingArm:
        person = self._worlds[i].person
        assert person is not None
        return person
