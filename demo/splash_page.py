"""The page while the robot loads: a browser can open it at once."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser

from demo.client_messages import MessageCheck
from demo.guarded_server import open_guarded_server
from demo.page_gate import PageGate

CAMERA, LOOK_AT = (1.25, -1.9, 0.9), (1.2, 0.0, 0.3)  # metres: shows robot, table and person left of the panel
VIEWS: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {  # from near by, by workspace
    "board": ((0.72, -0.8, 0.6), (0.68, 0.0, 0.12)),
    "room": ((1.21, -0.56, 0.74), (0.53, 0.145, 0.05)),
    "studio": ((0.7, -1.25, 0.95), (0.52, -0.04, 0.05)),
}
FIELD_OF_VIEW = np.deg2rad(60)  # vertical
MESSAGE = '<div style="padding:2px 12px;font-size:14px">One moment: the robot is loading.</div>'


def set_camera(server: viser.ViserServer, workspace: str) -> None:
    """Shows the workspace, in all browsers and in those that come later."""
    position, look_at = VIEWS.get(workspace, (CAMERA, LOOK_AT))
    cameras: list[Any] = [server.initial_camera, *(client.camera for client in server.get_clients().values())]
    for camera in cameras:
        camera.position, camera.look_at = position, look_at


def open_splash_page(host: str, port: int, gate: PageGate, check: MessageCheck) -> viser.ViserServer:
    """Starts a server whose page shows a message and the camera's view; `Page` replaces the content later."""
    server = open_guarded_server(host, port, gate, check, label="Deixis")
    gui: Any = server.gui
    gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
    camera = server.initial_camera
    camera.position, camera.look_at, camera.fov = CAMERA, LOOK_AT, FIELD_OF_VIEW
    gui.add_html(MESSAGE)
    return server
