"""What the cameras of simulated worlds see, as detections."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.cameras import CameraFrame
from envs.perception.config import PerceptionConfig
from envs.perception.detections import Array, Detections, Detector, View, check_picture
from envs.sim.workspace import WorkspaceConfig
from envs.sim.world import SimulatedWorld

Gripper = tuple[Array, Array]  # position (3,), metres, and rotation (3, 3) of its centre


class CameraReader:
    """Takes a picture with each camera, and finds what is seen in them.

    Args:
        worlds: with visual shapes.
        workspace: whose cameras they are.
        config: which cameras take pictures.
        detector: finds things in pictures.

    Raises:
        ConfigError: the workspace lacks a camera, or a camera does not see the table.
    """

    def __init__(
        self,
        worlds: Sequence[SimulatedWorld],
        workspace: WorkspaceConfig,
        config: PerceptionConfig,
        detector: Detector,
    ) -> None:
        config.check(workspace)
        self._worlds, self._detector = worlds, detector
        self._cameras = {name: workspace.cameras[name] for name in config.cameras}

    def read(self, world: int, gripper: Gripper) -> Detections:
        """Return what is seen in a world now. Raises UnusablePicture."""
        views = {}
        for name, camera in self._cameras.items():
            photo = self._worlds[world].photograph(camera, gripper)
            views[name] = View(photo.colors, camera, CameraFrame.of(camera, gripper))
            check_picture(name, views[name])
        return self._detector(views)

    def places(self, gripper: Gripper) -> Array:
        """(C, 3) where the cameras are, metres."""
        return np.array([CameraFrame.of(camera, gripper).place for camera in self._cameras.values()])
