"""Pictures as observations, for policies without object rows: which cameras, and what they see of N worlds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from core.cameras import CameraFrame, project
from envs.mdp.pictures_config import PicturesConfig
from envs.mdp.world_state import WorldState
from envs.sim.kinematics import Array
from envs.sim.workspace import WorkspaceConfig
from envs.sim.world import SimulatedWorld

MARGIN = 1.0  # of a picture's width or height: how far outside of it a place is told


class Photographer:
    """Takes the pictures of N worlds, each once after the world has changed.

    Args:
        config: which pictures.
        workspace: has the cameras.
        worlds: with visual shapes.
        state: of the worlds: cameras may be mounted on grippers.
    """

    def __init__(
        self, config: PicturesConfig, workspace: WorkspaceConfig, worlds: Sequence[SimulatedWorld], state: WorldState
    ) -> None:
        self._worlds, self._state = worlds, state
        self._cameras = [
            replace(workspace.cameras[name], width=config.size, height=config.size) for name in config.cameras
        ]
        self._pixels = np.zeros((len(worlds), len(self._cameras), config.size, config.size, 3), np.uint8)
        self._stale = np.ones(len(worlds), bool)

    def forget(self, worlds: NDArray[np.int64] | slice = slice(None)) -> None:
        """Take new pictures of these worlds, which have changed, when pictures are next asked for."""
        self._stale[worlds] = True

    def pixels(self) -> NDArray[np.uint8]:
        """(N, C, H, W, 3) the present pictures of all cameras."""
        for i in np.flatnonzero(self._stale).tolist():
            for k, camera in enumerate(self._cameras):
                self._pixels[i, k] = self._worlds[i].picture(camera, self._gripper(i))
        self._stale[:] = False
        return self._pixels

    def seen_at(self, places: Array) -> Array:
        """(N, K, C, 2) where places (N, K, 3), metres, are in the pictures: shares of their width and height."""
        seen = np.empty((*places.shape[:2], len(self._cameras), 2))
        for i in range(len(places)):
            for k, camera in enumerate(self._cameras):
                pixels, depths = project(camera, CameraFrame.of(camera, self._gripper(i)), places[i])
                seen[i, :, k] = np.where(depths[:, None] > 0, pixels / (camera.width, camera.height), -MARGIN)
        return seen

    def _gripper(self, i: int) -> tuple[Array, Array]:
        pose = self._state.pose
        return pose.position[i], pose.rotation[i]
