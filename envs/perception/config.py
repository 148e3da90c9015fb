"""Configuration of what policies observe the world with: the simulator's own state, or the pictures of cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core.cameras import Camera, CameraFrame, project
from core.errors import ConfigError
from core.schema import Checked, any_path, one_of, within, word
from envs.sim.workspace import WorkspaceConfig

STRIDE = 16  # pixels: the network takes pictures whose sides are multiples


@dataclass(frozen=True, kw_only=True)
class PerceptionConfig(Checked):
    """Where the observed rows of objects come from.

    name: "state": the simulator. "camera": pictures alone; the arm's joints and its gripper stay known.
    cameras: the names of the workspace's cameras that take pictures at each control step.
    weights: of the network; None: those that come with the project.
    presence: probability from which on a thing that is seen is taken to be there.
    confirmations: pictures in which a thing that appears within an episode must be seen before it is observed.
    patience: pictures in which its place must be seen empty until a thing is dropped.
    drift, motion: how far a thing may get in a control step, standard deviation in metres: one that rests, and one that
        has just moved.
    """

    name: str = one_of("state", "camera")
    cameras: list[str] = word()
    weights: str | None = any_path()
    presence: float = within(0, 1)
    confirmations: int = within(1, 100)
    patience: int = within(1, 1000)
    drift: float = within(0, 0.1)
    motion: float = within(0, 1)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.sees and not self.cameras:
            raise ConfigError("cameras=[] must name at least one of workspace.cameras in perception.name=camera")

    @property
    def sees(self) -> bool:
        """Whether observations come from pictures."""
        return self.name == "camera"

    def check(self, workspace: WorkspaceConfig) -> None:
        """Raise ConfigError for a camera that is missing, of an unusable size, or that sees nothing of the table."""
        for name, camera in workspace.named_cameras("perception.cameras", self.cameras).items():
            if camera.width % STRIDE or camera.height % STRIDE:
                raise ConfigError(
                    f"workspace.cameras.{name} takes pictures of {camera.width} x {camera.height}, and the network "
                    f"reads those whose width and height are multiples of {STRIDE}"
                )
            if camera.mount == "workspace" and not sees_area(camera, workspace.object_area):
                raise ConfigError(
                    f"workspace.cameras.{name} sees nothing of the table where objects are put, "
                    f"workspace.object_area={list(workspace.object_area)}: turn it, or take another camera"
                )


STATE = PerceptionConfig(
    name="state", cameras=[], weights=None, presence=0.5, confirmations=2, patience=5, drift=0.0003, motion=0.02
)


def sees_area(camera: Camera, area: Sequence[float]) -> bool:
    """Return whether any place of an area x0, x1, y0, y1 of the table, metres, is in the picture of a camera."""
    x0, x1, y0, y1 = area
    grid = np.stack(np.meshgrid(np.linspace(x0, x1, 9), np.linspace(y0, y1, 9), [0.0]), axis=-1).reshape(-1, 3)
    pixels, depths = project(camera, CameraFrame.of(camera), grid)
    inside = (pixels >= 0) & (pixels < [camera.width, camera.height])
    return bool((inside.all(1) & (depths > 0)).any())
