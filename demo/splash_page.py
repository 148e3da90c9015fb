"""The page while the robot loads: a browser can open it at once."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser

from demo.guarded_server import PageParts, open_guarded_server
from demo.page_gate import PageGate

CAMERA, LOOK_AT = (0.98, 0.08, 0.7), (0.42, 0.0, 0.1)  # metres: over the table, as the person sees it who points
VIEWS: dict[
    str, tuple[tuple[float, float, float], tuple[float, float, float]]
] = {  # by workspace, where others are better
    "board": ((0.82, 0.03, 0.45), (0.43, 0.0, 0.08)),
    "room": ((1.02, 0.05, 0.7), (0.42, 0.0, 0.06)),
    "studio": ((0.9, 0.06, 0.84), (0.41, 0.0, 0.04)),
    "handover": ((0.8, -0.02, 0.58), (0.42, 0.0, 0.08)),
}
FIELD_OF_VIEW = np.deg2rad(60)  # vertical


def set_camera(server: viser.ViserServer, workspace: str) -> None:
    """Shows the workspace, in all browsers and in those that come later."""
    position, look_at = VIEWS.get(workspace, (CAMERA, LOOK_AT))
    cameras: list[Any] = [server.initial_camera, *(client.camera for client in server.get_clients().values())]
    for camera in cameras:
        camera.position, camera.look_at = position, look_at


def open_splash_page(host: str, port: int, gate: PageGate, parts: PageParts) -> viser.ViserServer:
    """Starts a server whose page says that the robot is loading; `Page` shows the rest later."""
    server = open_guarded_server(host, port, gate, parts, label="Deixis")
    gui: Any = server.gui
    gui.configure_theme(show_logo=False, show_share_button=False)
    camera = server.initial_camera
    camera.position, camera.look_at, camera.fov = CAMERA, LOOK_AT, FIELD_OF_VIEW
    return server
