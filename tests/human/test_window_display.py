import pybullet as bullet

from human.body.window import WindowDisplay


def test_text_waits_for_a_window_that_has_not_drawn_anything():
    client = bullet.connect(bullet.DIRECT)  # its camera, too, has a projection of zeros
    assert not any(bullet.getDebugVisualizerCamera(client)[3])
    WindowDisplay(client).write(["pointing at the red cube"])
    bullet.disconnect(client)
