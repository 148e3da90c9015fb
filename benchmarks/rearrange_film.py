"""A film of commands that people wrote, carried out on the board one after another.

    python -m benchmarks.rearrange_film --data FOLDER --out docs/commands.gif

FOLDER has the Robot Commands Treebank, as for `benchmarks.rearrange`. Each command is understood in its own scene, and
the scripted expert carries it out; between two commands the film cuts to the next scene. The subtitle is the command,
and words beside the board show whose left and front are meant. The film runs in real time.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from tensordict import TensorDict

from benchmarks.rearrange import Job, begin, difference, moves, understood
from core.overrides import compose
from envs import read_env
from envs.experts.board import MoveRunner
from envs.interactive.interactive_env import InteractiveEnv
from envs.sim.rendering import paint
from human import Camera
from language.colors import COLORS
from tools.films import Frame, write_gif
from trainers.evaluation.video import wrap_text

# Commands of the part that the grammar was developed on, by number, of different kinds and with at most 16 blocks.
NUMBERS = ("2832", "3404", "3507", "2392", "3524", "2467", "3741", "2051", "3861", "3731", "3898", "3692")
MOST_BLOCKS = 16
WIDTH, HEIGHT, CAPTION = 560, 380, 74  # pixels
SUPERSAMPLING = 2
CAMERA = Camera(
    target=[0.43, 0.0, 0.08],
    distance=0.64,
    yaw=50.0,
    pitch=-33.0,
    fov=42.0,
    width=SUPERSAMPLING * WIDTH,
    height=SUPERSAMPLING * HEIGHT,
)
FRAME_TIME = 50  # milliseconds: that of a control step
FIRST_TIME, LAST_TIME = 1200, 900  # milliseconds for which the scenes before and after are shown
SETTLING = 8  # control steps after the last move
OTHER_COLORS = {"magenta": (1.0, 0.0, 0.75), "white": (1.0, 1.0, 1.0)}  # of the Treebank, beside the language's own
SIDES = {"left": (0.54, 0.19), "right": (0.38, -0.19), "front": (0.63, 0.0), "back": (0.255, -0.08)}  # metres
WHOSE = "left, right, front and back are those of the arm, which faces its front"
SOURCE = "Robot Commands Treebank (Dukes 2014), SemEval-2014 task 6; real time"

Picture = NDArray[np.uint8]


def film(jobs: Sequence[tuple[str, Job]], robot: str) -> Iterator[Frame]:
    """Yield the frames of commands with their jobs. Raises RuntimeError if one does not reach the board after."""
    changes = [f"task.num_objects={MOST_BLOCKS}", "task.curriculum={near: 0, held: 1, placed: 0}"]
    config = read_env(compose(["task=rearrange", f"robot={robot}", *changes]))
    workspace = replace(config.workspace, camera=CAMERA)
    with closing(InteractiveEnv(replace(config, workspace=workspace))) as env:
        for number, (sentence, job) in enumerate(jobs, start=1):
            yield from _scene(env, job, f"{number}. {sentence}")
            print(f"{number} of {len(jobs)}: {sentence}", flush=True)


def _scene(env: InteractiveEnv, job: Job, sentence: str) -> Iterator[Frame]:
    grid, order = begin(env, job.board)
    _paint(env, job, order)
    yield _frame(env, sentence), FIRST_TIME
    runner = MoveRunner(env, moves(job, grid, order))
    while (action := runner()) is not None:
        env.step(TensorDict({"action": action}, env.batch_size))
        yield _frame(env, sentence), FRAME_TIME
    for _ in range(SETTLING):
        env.step(TensorDict({"action": env.towards(env.commanded_gripper)}, env.batch_size))
    if wrong := difference(env, job, grid, order):
        raise RuntimeError(f"scene {job.number}: wrong is {wrong}")
    yield _frame(env, sentence), LAST_TIME


def _paint(env: InteractiveEnv, job: Job, order: Sequence[int]) -> None:
    """Give the blocks the colours of the Treebank."""
    bodies = [body for body in env.bodies() if body is not None]
    for number, (*_, color, _shape) in zip(order, job.board.before.blocks, strict=True):
        rgb = OTHER_COLORS[color] if color in OTHER_COLORS else COLORS[color].rgb
        paint(bodies[number], (*rgb, 1.0), env.client)


def _frame(env: InteractiveEnv, sentence: str) -> Image.Image:
    """Return the scene with its subtitle."""
    picture = Image.fromarray(env.render()).resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)
    image = Image.new("RGB", (WIDTH, HEIGHT + CAPTION), "black")
    image.paste(picture, (0, 0))
    draw, small = ImageDraw.Draw(image), ImageFont.load_default(size=12)
    for name, place in SIDES.items():
        draw.text(pixel((*place, 0.0)), name, "black", small, anchor="mm")
    font = ImageFont.load_default(size=17)
    for row, text in enumerate(wrap_text(sentence, WIDTH - 12, font)[:2]):
        draw.text((6, HEIGHT + 2 + 20 * row), text, fill="white", font=font)
    for row, text in enumerate((WHOSE, SOURCE)):
        draw.text((6, HEIGHT + 43 + 14 * row), text, fill="#a0a0a0", font=small)
    return image


def pixel(place: Sequence[float]) -> tuple[float, float]:
    """Return where the film shows a place (3,), metres."""
    yaw, pitch = np.deg2rad([CAMERA.yaw, CAMERA.pitch])
    ahead = np.array([-np.sin(yaw) * np.cos(pitch), np.cos(yaw) * np.cos(pitch), np.sin(pitch)])
    right = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    from_eye = np.subtract(place, CAMERA.target) + CAMERA.distance * ahead
    x, y, depth = (float(from_eye @ axis) for axis in (right, np.cross(ahead, right), ahead))
    focal = HEIGHT / 2 / np.tan(np.deg2rad(CAMERA.fov) / 2)
    return WIDTH / 2 + focal * x / depth, HEIGHT / 2 + focal * y / depth


def main() -> int:
    """Write the film; return 1 if a command is not in the data, or not understood."""
    options = _arguments().parse_args()
    wanted = options.numbers.split(",")
    found = {item.number: (item.text, job) for item, job in understood(options.data, "develop", wanted)}
    jobs = [(text, job) for text, job in (found.get(number, ("", None)) for number in wanted) if job is not None]
    if len(jobs) < len(wanted):
        print(f"error: --numbers: {len(wanted) - len(jobs)} of these commands are not understood", file=sys.stderr)
        return 1
    frames = list(film(jobs, options.robot))
    write_gif(options.out, frames, [image for image, time in frames if time == FIRST_TIME])
    print(f"{options.out}: {len(frames)} frames, {options.out.stat().st_size} bytes")
    return 0


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with commands.txt and configuration.txt")
    parser.add_argument("--out", type=Path, required=True, help="the GIF")
    parser.add_argument("--numbers", default=",".join(NUMBERS), help="of the commands, in the order of the film")
    parser.add_argument("--robot", default="kuka", help="an option of robot= (kuka)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
