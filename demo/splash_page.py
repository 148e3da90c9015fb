"""The page while the robot loads: a browser can open it at once."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser

CAMERA, LOOK_AT = (1.25, -1.9, 0.9), (1.2, 0.0, 0.3)  # metres: shows robot, table and person left of the panel
FIELD_OF_VIEW = np.deg2rad(60)  # vertical
MESSAGE = '<div style="padding:2px 12px;font-size:14px">One moment: the robot is loading.</div>'


def open_splash_page(host: str, port: int) -> viser.ViserServer:
    """Starts a server whose page shows a message and the camera's view; `Page` replaces the content later."""
    server = viser.ViserServer(host, port, label="Deixis", verbose=False)
    gui: Any = server.gui
    gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
    camera = server.initial_camera
    camera.position, camera.look_at, camera.fov = CAMERA, LOOK_AT, FIELD_OF_VIEW
    gui.add_html(MESSAGE)
    return server
