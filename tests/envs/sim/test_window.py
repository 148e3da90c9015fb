"""The window on a virtual screen (Xvfb) with real key presses, as a person uses `by_hand=true` and `play.py --gui`."""

from __future__ import annotations

import time

import pytest

from tests.helpers.screen import TIMEOUT, start  # noqa: F401  a fixture

PROGRAM = """
from core.overrides import compose
from core.platform_tuning import lean_imports
with lean_imports():
    import envs.workspace_env
from envs import read_env
from envs.interactive.by_hand import ByHandEnv, run_by_hand
from envs.experts import Oracle
from human.body.window import WindowDisplay

class PrintingDisplay(WindowDisplay):
    def write(self, lines):
        super().write(lines)
        print("|".join(lines), flush=True)

    def draw(self, origin, target):
        super().draw(origin, target)
        print("target", *(f"{metres:.3f}" for metres in target), flush=True)

    def clear(self):
        super().clear()
        print("cleared", flush=True)

env = ByHandEnv(read_env(compose(["task=reach_gesture", "gesture.frames=3"])), seed=0)
keys, _ = env.user_interface()
# A window is always client 0 of PyBullet.
print("results", run_by_hand(env, Oracle(env), 5, keys=keys, display=PrintingDisplay(0)), flush=True)
env.close()
"""


@pytest.mark.slow
def test_play_draws_the_robot_in_a_window_and_ends_with_escape(start):  # noqa: F811
    program = start("play.py", "--gui", "task=nl_reach")
    deadline = time.monotonic() + TIMEOUT
    while not is_drawn(program.picture()) and program.process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.1)
    if program.process.poll() is not None:
        program.until("an end")  # skips if PyBullet cannot open a window at all
    program.press("Escape")
    assert program.exit_code() == 0


@pytest.mark.slow
def test_keys_at_the_window_choose_the_referent(start):  # noqa: F811
    program = start("-c", PROGRAM)
    target = metres_in(program.until("target"))
    assert "arrows" in program.until("pointing at")
    for key, axis, metres in (
        ("Left", 0, -0.05),
        ("Up", 1, 0.05),
        ("Right", 0, 0.05),
        ("u", 2, 0.05),
        ("Down", 1, -0.05),
    ):
        target[axis] += metres
        program.press(key)
        assert metres_in(program.until("target")) == pytest.approx(target, abs=1e-3), key
        program.until("pointing at")
    program.press("2")
    program.until("step 2 cm")
    lower = metres_in(program.press("Next", until="target"))  # page down
    assert lower[:2] == pytest.approx(target[:2], abs=1e-3)
    assert lower[2] < target[2]
    program.press("w")  # a key of PyBullet's own, which would draw wireframes
    assert is_drawn(program.picture())
    program.press("Return")
    meant = program.until("meant:").split("|")[1]
    assert meant in program.until("|success|")
    program.press("Return")
    program.until("arrows")
    program.press("Escape")
    result = program.until("results")
    assert result.count("EpisodeResult(") == 1
    assert "success" in result
    assert program.exit_code() == 0


def metres_in(line: str) -> list[float]:
    return [float(metres) for metres in line.split()[1:]]


def is_drawn(picture):
    """Dark words on the pale wall at the top left, a blue arm, and no panels, which would be dark at the left edge."""
    words, below = picture[15:130, 10:400], picture[200:700, 0:200]
    written = 0.01 < (words < 90).all(-1).mean() < 0.3 and (words > 200).all(-1).mean() > 0.5
    red, blue = (picture[..., channel].astype(int) for channel in (0, 2))
    return written and (blue > red + 60).mean() > 0.005 and (below > 70).all(-1).mean() > 0.8
