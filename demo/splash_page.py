"""The page before there is anything to show on it: a browser takes it in while the rest of the program still loads."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser

CAMERA, LOOK_AT = (1.25, -1.9, 0.9), (1.2, 0.0, 0.3)  # robot, table and person, left of the panel
LENS = np.deg2rad(60)  # from the bottom of the picture to its top
WAIT = '<div style="padding:2px 12px;font-size:14px">One moment: the robot is being set up.</div>'


def opened(host: str, port: int) -> viser.ViserServer:
    """A server whose page asks for a moment, seen from where the robot will be; `Page` then puts its own there."""
    server = viser.ViserServer(host, port, label="Deixis", verbose=False)
    gui: Any = server.gui
    gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
    camera = server.initial_camera
    camera.position, camera.look_at, camera.fov = CAMERA, LOOK_AT, LENS
    gui.add_html(WAIT)
    return server
