"""Which pictures policies see. Imports no torch."""

from __future__ import annotations

from dataclasses import dataclass

from core.errors import ConfigError
from core.schema import Checked, within, word
from envs.sim.workspace import WorkspaceConfig


@dataclass(frozen=True, kw_only=True)
class PicturesConfig(Checked):
    """Which pictures policies see. cameras: of `workspace.cameras`. size: their height and width, pixels."""

    cameras: list[str] = word()
    size: int = within(16, 512)

    def check(self, workspace: WorkspaceConfig) -> None:
        """Raise ConfigError unless the workspace has these cameras."""
        if not self.cameras:
            raise ConfigError("policy.pictures.cameras=[] must name at least one camera")
        workspace.named_cameras("policy.pictures.cameras", self.cameras)
