"""What the cameras of simulated worlds see, as detections."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from core.cameras import CameraFrame
from envs.perception.config import PerceptionConfig
from envs.perception.detections import Array, Detections, Detector, View, check_picture
from envs.sim.workspace import WorkspaceConfig
from envs.sim.world import SimulatedWorld

Picture = NDArray[np.uint8]  # (H, W, 3)
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
        self._worlds, self._cameras = worlds, NamedCameras(workspace, config)
        self._detector = detector

    def angles(self, world: int) -> Array | None:
        """Return None: pictures are taken as they are read."""
        return None

    def read(self, world: int, gripper: Gripper) -> Detections:
        """Return what is seen in a world now. Raises UnusablePicture."""
        return self._detector(self._cameras.views(self._cameras.pictures(self._worlds[world], gripper), gripper))

    def places(self, gripper: Gripper) -> Array:
        """(C, 3) where the cameras are, metres."""
        return self._cameras.places(gripper)


class NamedCameras:
    """The cameras of a workspace that take pictures, by name.

    Raises:
        ConfigError: as `CameraReader`.
    """

    def __init__(self, workspace: WorkspaceConfig, config: PerceptionConfig) -> None:
        config.check(workspace)
        self._cameras = {name: workspace.cameras[name] for name in config.cameras}

    def pictures(self, world: SimulatedWorld, gripper: Gripper) -> dict[str, Picture]:
        """Return a picture (H, W, 3) of each camera. The world has visual shapes."""
        return {name: world.picture(camera, gripper) for name, camera in self._cameras.items()}

    def views(self, pictures: Mapping[str, Picture], gripper: Gripper) -> dict[str, View]:
        """Return the pictures with their cameras. gripper: as they were taken. Raises UnusablePicture."""
        views = {}
        for name, camera in self._cameras.items():
            views[name] = View(pictures[name], camera, CameraFrame.of(camera, gripper))
            check_picture(name, views[name])
        return views

    def places(self, gripper: Gripper) -> Array:
        """(C, 3) where the cameras are, metres."""
        return np.array([CameraFrame.of(camera, gripper).place for camera in self._cameras.values()])
