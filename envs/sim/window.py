"""A PyBullet client that is shown in a window."""

from __future__ import annotations

import ctypes
import math
import os
import sys
from contextlib import suppress

import pybullet as bullet

from conf.schema import ConfigError
from human import Camera
from human.suppress_stdout import suppress_stdout

WIDTH, HEIGHT = 960, 720  # pixels
PAPER = "--background_color_red=0.93 --background_color_green=0.94 --background_color_blue=0.96"
MARGIN = 0.9  # the window shows this much of what the camera does: small things are to be told apart
OFF = (  # PyBullet's panels, and keys of its own: "w" would draw wires
    bullet.COV_ENABLE_GUI,
    bullet.COV_ENABLE_KEYBOARD_SHORTCUTS,
    bullet.COV_ENABLE_MOUSE_PICKING,
    bullet.COV_ENABLE_SHADOWS,  # without a graphics card they take half of the time
)


class Window:
    """Opens with nothing drawn, seen as the camera does. Raises ConfigError where none can be opened.

    To be opened before any other client of the process: Bullet says of the first one alone from where it is looked at.
    asked: what asked for it, to be named where it cannot be had. client: Bullet's number, 0.
    """

    def __init__(self, camera: Camera, asked: str = "by_hand=true") -> None:
        _check_display(asked)
        try:
            with suppress_stdout():
                self.client = bullet.connect(bullet.GUI, options=f"--width={WIDTH} --height={HEIGHT} {PAPER}")
        except bullet.error as error:
            raise ConfigError(f"{asked} opens no window: {error}") from None
        if self.client != 0:
            self.close()
            raise ConfigError(f"{asked} opens no window: this process has worlds already")
        for flag in OFF:
            bullet.configureDebugVisualizer(flag, 0, physicsClientId=self.client)
        bullet.resetDebugVisualizerCamera(self._distance(camera), camera.yaw, camera.pitch, camera.target, self.client)
        self.show(False)

    @staticmethod
    def _distance(camera: Camera) -> float:
        """Metres from the camera's target at which the window shows as much: its lens has 90 degrees."""
        return MARGIN * camera.distance * math.tan(math.radians(camera.fov) / 2)

    def show(self, now: bool) -> None:
        """Draw what happens from now on, or keep the last picture: while much changes, that is faster."""
        bullet.configureDebugVisualizer(bullet.COV_ENABLE_RENDERING, int(now), physicsClientId=self.client)

    def close(self) -> None:
        with suppress_stdout(), suppress(bullet.error):  # a person may have closed it
            bullet.disconnect(self.client)


def _check_display(asked: str) -> None:
    """PyBullet itself ends the program where it finds no display, or no OpenGL there."""
    if not sys.platform.startswith("linux"):
        return
    name = os.environ.get("DISPLAY")
    if not name:
        raise ConfigError(f"{asked} needs a display: DISPLAY is not set")
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError:
        raise ConfigError(f"{asked} needs a display: libX11 is not installed") from None
    x11.XOpenDisplay.restype = ctypes.c_void_p
    display = ctypes.c_void_p(x11.XOpenDisplay(None))
    if not display:
        raise ConfigError(f"{asked} needs a display: DISPLAY={name} cannot be opened")
    numbers = [ctypes.byref(ctypes.c_int()) for _ in range(3)]
    opengl = x11.XQueryExtension(display, b"GLX", *numbers)
    x11.XCloseDisplay(display)
    if not opengl:
        raise ConfigError(f"{asked} needs OpenGL: the display {name} has none")
