"""`render_mode="human"` on a virtual screen (Xvfb)."""

import time

import pytest

from tests.helpers.screen import TIMEOUT, start  # noqa: F401  a fixture

PROGRAM = """
import time
import gymnasium, numpy
from core.platform_tuning import lean_imports
with lean_imports():
    import envs.workspace_env
env = gymnasium.make("Deixis/NLReach-v0", render_mode="human")
env.reset(seed=0)
began = time.monotonic()
for _ in range(20):
    env.step(numpy.array([0.0, 1.0, 0.0], numpy.float32))
print("rendered", env.render(), "in", time.monotonic() - began, flush=True)
time.sleep(600)
"""


@pytest.mark.slow
def test_a_window_shows_the_robot_in_real_time(start):  # noqa: F811
    program = start("-c", PROGRAM)
    words = program.until("rendered").split()
    assert words[1] == "None"
    assert float(words[3]) > 19 * 0.05  # control steps of 50 ms, the first one at once
    deadline = time.monotonic() + TIMEOUT
    while not has_blue_arm(program.picture()):
        assert time.monotonic() < deadline
        time.sleep(0.1)


def has_blue_arm(picture):
    red, blue = (picture[..., channel].astype(int) for channel in (0, 2))
    return (blue > red + 60).mean() > 0.005
