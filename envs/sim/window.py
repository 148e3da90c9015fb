"""A PyBullet client that is shown in a window."""

from __future__ import annotations

import ctypes
import math
import os
import sys
from contextlib import suppress

import pybullet as bullet

from core.errors import ConfigError
from core.system import suppress_stdout
from human import Camera

WIDTH, HEIGHT = 960, 720  # pixels
BACKGROUND = "--background_color_red=0.93 --background_color_green=0.94 --background_color_blue=0.96"
ZOOM = 0.9  # part of the camera's distance: nearer, so that small objects can be distinguished
DISABLED = (  # PyBullet's panels and its own keys: "w" would draw wireframes
    bullet.COV_ENABLE_GUI,
    bullet.COV_ENABLE_KEYBOARD_SHORTCUTS,
    bullet.COV_ENABLE_MOUSE_PICKING,
    bullet.COV_ENABLE_SHADOWS,  # half of the time without a graphics card
)


class Window:
    """A window with the camera's view; nothing is drawn until `show(True)`. client: PyBullet's client, 0.

    It must be opened before any other client of the process: Bullet reports the view of the first client alone.

    Args:
        camera: where the scene is seen from.
        asked: the setting that asks for the window, for error messages.

    Raises:
        ConfigError: no window can be opened.
    """

    def __init__(self, camera: Camera, asked: str = "by_hand=true") -> None:
        if problem := display_problem():
            raise ConfigError(f"{asked} {problem}")
        try:
            with suppress_stdout():
                self.client = bullet.connect(bullet.GUI, options=f"--width={WIDTH} --height={HEIGHT} {BACKGROUND}")
        except bullet.error as error:
            raise ConfigError(f"{asked} opens no window: {error}") from None
        if self.client != 0:
            self.close()
            raise ConfigError(f"{asked} opens no window: this process has worlds already")
        for flag in DISABLED:
            bullet.configureDebugVisualizer(flag, 0, physicsClientId=self.client)
        bullet.resetDebugVisualizerCamera(self._distance(camera), camera.yaw, camera.pitch, camera.target, self.client)
        self.show(False)

    @staticmethod
    def _distance(camera: Camera) -> float:
        """Metres from the camera's target at which the window, with its field of view of 90 degrees, shows the same."""
        return ZOOM * camera.distance * math.tan(math.radians(camera.fov) / 2)

    def show(self, enabled: bool) -> None:
        """Draw from now on, or keep the last picture, which is faster while much changes."""
        bullet.configureDebugVisualizer(bullet.COV_ENABLE_RENDERING, int(enabled), physicsClientId=self.client)

    def close(self) -> None:
        with suppress_stdout(), suppress(bullet.error):  # a person may have closed it
            bullet.disconnect(self.client)


def display_problem() -> str | None:
    """Return why no window can be opened: without a display or OpenGL, PyBullet would end the program."""
    if not sys.platform.startswith("linux"):
        return None
    name = os.environ.get("DISPLAY")
    if not name:
        return "needs a display: DISPLAY is not set"
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError:
        return "needs a display: libX11 is not installed"
    x11.XOpenDisplay.restype = ctypes.c_void_p
    display = ctypes.c_void_p(x11.XOpenDisplay(None))
    if not display:
        return f"needs a display: DISPLAY={name} cannot be opened"
    numbers = [ctypes.byref(ctypes.c_int()) for _ in range(3)]
    opengl = x11.XQueryExtension(display, b"GLX", *numbers)
    x11.XCloseDisplay(display)
    return None if opengl else f"needs OpenGL: the display {name} has none"
