"""Films for pages, as GIFs: small files, because all frames have one palette. They run in real time.

    python -m benchmarks.films chain --checkpoint anything_kuka --seed 6 --out docs/chain.gif
    python -m benchmarks.films commands --data FOLDER --out docs/commands.gif
    python -m benchmarks.films scene drawer --out docs/films/drawer.gif

`scene`: a prepared scene of the page, whose sentences are said one after another, seen from opposite the robot; below
it are the sentence and the answer.

`chain`: instructions that a policy carries out one after another in one room. `commands`: commands that people wrote,
from the Robot Commands Treebank in FOLDER, as for `benchmarks.rearrange`. Each is understood in its own scene, and the
scripted expert carries it out; between two commands the film cuts to the next scene, and words beside the board show
whose left and front are meant. The subtitle is the sentence.
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

import deixis
from benchmarks.rearrange import Job, begin, difference, moves, understood
from core.overrides import compose
from demo.session import Session
from demo.session_config import make_config
from demo.shared_scene import PREPARED, Pointed
from envs import read_env
from envs.experts.board import MoveRunner
from envs.interactive.interactive_env import InteractiveEnv
from envs.sim.rendering import paint
from envs.sim.workspace import FILM
from human import Camera
from language.colors import COLORS
from trainers.evaluation.video import sentence_of, wrap_text

Frame = tuple[Image.Image, int]  # and for how many milliseconds it is shown
Size = tuple[int, int]  # width and height of the picture, pixels
SUPERSAMPLING = 2
STEP_TIME = 50  # milliseconds of a control step

# ---- Chain
CHAIN_SIZE, CHAIN_CAPTION = (520, 360), 60  # pixels; the caption is below the picture
CHAIN_CAMERA = {"target": [0.5, -0.06, 0.1], "distance": 1.5, "yaw": 10, "pitch": -36, "fov": 42}
CHAIN_LAST_TIME = 1500  # milliseconds
SKIPPED = 2  # every SKIPPED-th control step is shown
SAMPLED = 40  # every SAMPLED-th frame contributes to the palette

# ---- Scenes of the page
SCENE_SIZE, SCENE_CAPTION = (440, 320), 68  # pixels
SCENE_CAMERA = {"target": [0.43, 0.0, 0.06], "yaw": 90, "pitch": -52, "fov": 52}  # opposite the robot
SCENE_DISTANCES, SCENE_DISTANCE = {"drawer": 0.95}, 0.75  # metres; of the others
SCENE_SKIPPED, SCENE_LAST_TIME, MOST_STEPS = 3, 1400, 400  # control steps, milliseconds, control steps

# ---- Commands
# Of the part that the grammar was developed on, by number, of different kinds and with at most 16 blocks.
NUMBERS = ("2832", "3404", "3507", "2392", "3524", "2467", "3741", "2051", "3861", "3731", "3898", "3692")
MOST_BLOCKS = 16
BOARD_SIZE, BOARD_CAPTION = (560, 380), 74  # pixels
BOARD_CAMERA = Camera(
    target=[0.43, 0.0, 0.08],
    distance=0.64,
    yaw=50.0,
    pitch=-33.0,
    fov=42.0,
    width=SUPERSAMPLING * BOARD_SIZE[0],
    height=SUPERSAMPLING * BOARD_SIZE[1],
)
FIRST_TIME, LAST_TIME = 1200, 900  # milliseconds for which the scenes before and after are shown
SETTLING = 8  # control steps after the last move
OTHER_COLORS = {"magenta": (1.0, 0.0, 0.75), "white": (1.0, 1.0, 1.0)}  # of the Treebank, beside the language's own
SIDES = {"left": (0.54, 0.19), "right": (0.38, -0.19), "front": (0.63, 0.0), "back": (0.255, -0.08)}  # metres
WHOSE = "left, right, front and back are those of the arm, which faces its front"
SOURCE = "Robot Commands Treebank (Dukes 2014), SemEval-2014 task 6; real time"


def write_gif(path: Path, frames: Sequence[Frame], samples: Sequence[Image.Image]) -> None:
    """Write a GIF and print its size.

    Args:
        path: of the file.
        frames: all of one size.
        samples: images of that size with all colours of the film; the palette is made of them.
    """
    width, height = frames[0][0].size
    sheet = Image.new("RGB", (width, height * len(samples)))
    for row, image in enumerate(samples):
        sheet.paste(image, (0, row * height))
    palette = sheet.quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=3)
    images = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image, _ in frames]
    times = [time for _, time in frames]
    images[0].save(path, save_all=True, append_images=images[1:], duration=times, loop=0, optimize=True)
    print(f"{path}: {len(frames)} frames, {path.stat().st_size} bytes")


def captioned(picture: NDArray[np.uint8], size: Size, caption: int) -> Image.Image:
    """Return a picture (H, W, 3) in this size, above a black stripe of `caption` pixels."""
    image = Image.new("RGB", (size[0], size[1] + caption), "black")
    image.paste(Image.fromarray(picture).resize(size, Image.Resampling.LANCZOS), (0, 0))
    return image


# ---- Chain


def film_chain(checkpoint: str, seed: int, length: int) -> Iterator[Frame]:
    """Yield the frames of a chain. Raises RuntimeError if an instruction is not carried out."""
    policy = deixis.load_policy(checkpoint)
    size = dict(zip(("width", "height"), (SUPERSAMPLING * side for side in CHAIN_SIZE), strict=True))
    camera = [f"workspace.cameras.film.{key}={value}" for key, value in (CHAIN_CAMERA | size).items()]
    with closing(policy.make_env(1, camera, seed, render=True, instructions=length)) as env:
        state, done, steps = env.reset(), 0, 0
        while done < length:
            sentence = sentence_of(state)
            if steps % SKIPPED == 0:
                yield _chain_frame(env.render(), f"{done + 1}. {sentence}"), SKIPPED * STEP_TIME
            step = env.step(policy(state))
            state, steps = env.step_mdp(step), steps + 1
            if step["next", "success"][0]:
                done += 1
                print(f"{done} of {length}: {sentence}", flush=True)
            elif step["next", "done"][0]:
                raise RuntimeError(f"'{sentence}' was not carried out")
        yield _chain_frame(env.render(), f"{done}. {sentence}"), CHAIN_LAST_TIME


def _chain_frame(picture: NDArray[np.uint8], sentence: str) -> Image.Image:
    image = captioned(picture, CHAIN_SIZE, CHAIN_CAPTION)
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(size=18)
    for row, text in enumerate(wrap_text(sentence, CHAIN_SIZE[0] - 16, font)[:2]):
        draw.text((8, CHAIN_SIZE[1] + 6 + 24 * row), text, fill="white", font=font)
    return image


# ---- Commands


def film_commands(jobs: Sequence[tuple[str, Job]], robot: str) -> Iterator[Frame]:
    """Yield the frames of commands with their jobs. Raises RuntimeError if one does not reach the board after."""
    changes = [f"task.num_objects={MOST_BLOCKS}", "task.curriculum={near: 0, held: 1, placed: 0}"]
    config = read_env(compose(["task=rearrange", f"robot={robot}", *changes]))
    workspace = replace(config.workspace, cameras={**config.workspace.cameras, FILM: BOARD_CAMERA})
    with closing(InteractiveEnv(replace(config, workspace=workspace))) as env:
        for number, (sentence, job) in enumerate(jobs, start=1):
            yield from _board_scene(env, job, f"{number}. {sentence}")
            print(f"{number} of {len(jobs)}: {sentence}", flush=True)


def _board_scene(env: InteractiveEnv, job: Job, sentence: str) -> Iterator[Frame]:
    grid, order = begin(env, job.board)
    _paint(env, job, order)
    yield _board_frame(env, sentence), FIRST_TIME
    runner = MoveRunner(env, moves(job, grid, order))
    while (action := runner()) is not None:
        env.step(TensorDict({"action": action}, env.batch_size))
        yield _board_frame(env, sentence), STEP_TIME
    for _ in range(SETTLING):
        env.step(TensorDict({"action": env.towards(env.commanded_gripper)}, env.batch_size))
    if wrong := difference(env, job, grid, order):
        raise RuntimeError(f"scene {job.number}: wrong is {wrong}")
    yield _board_frame(env, sentence), LAST_TIME


def _paint(env: InteractiveEnv, job: Job, order: Sequence[int]) -> None:
    """Give the blocks the colours of the Treebank."""
    bodies = [body for body in env.bodies() if body is not None]
    for number, (*_, color, _shape) in zip(order, job.board.before.blocks, strict=True):
        rgb = OTHER_COLORS[color] if color in OTHER_COLORS else COLORS[color].rgb
        paint(bodies[number], (*rgb, 1.0), env.client)


def _board_frame(env: InteractiveEnv, sentence: str) -> Image.Image:
    image = captioned(env.render(), BOARD_SIZE, BOARD_CAPTION)
    draw, small = ImageDraw.Draw(image), ImageFont.load_default(size=12)
    for name, place in SIDES.items():
        draw.text(_pixel((*place, 0.0)), name, "black", small, anchor="mm")
    width, height = BOARD_SIZE
    font = ImageFont.load_default(size=17)
    for row, text in enumerate(wrap_text(sentence, width - 12, font)[:2]):
        draw.text((6, height + 2 + 20 * row), text, fill="white", font=font)
    for row, text in enumerate((WHOSE, SOURCE)):
        draw.text((6, height + 43 + 14 * row), text, fill="#a0a0a0", font=small)
    return image


def _pixel(place: Sequence[float]) -> tuple[float, float]:
    """Return where the film of the board shows a place (3,), metres."""
    yaw, pitch = np.deg2rad([BOARD_CAMERA.yaw, BOARD_CAMERA.pitch])
    ahead = np.array([-np.sin(yaw) * np.cos(pitch), np.cos(yaw) * np.cos(pitch), np.sin(pitch)])
    right = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    from_eye = np.subtract(place, BOARD_CAMERA.target) + BOARD_CAMERA.distance * ahead
    x, y, depth = (float(from_eye @ axis) for axis in (right, np.cross(ahead, right), ahead))
    width, height = BOARD_SIZE
    focal = height / 2 / np.tan(np.deg2rad(BOARD_CAMERA.fov) / 2)
    return width / 2 + focal * x / depth, height / 2 + focal * y / depth


# ---- Scenes of the page


def film_scene(name: str) -> Iterator[Frame]:
    """Yield the frames of a prepared scene of the page, in which its sentences are said one after another.

    Raises RuntimeError if the robot does not come to rest.
    """
    prepared = PREPARED[name]
    size = dict(zip(("width", "height"), (SUPERSAMPLING * side for side in SCENE_SIZE), strict=True))
    camera = [f"workspace.cameras.film.{key}={value}" for key, value in (SCENE_CAMERA | size).items()]
    camera.append(f"workspace.cameras.film.distance={SCENE_DISTANCES.get(name, SCENE_DISTANCE)}")
    config = make_config(**prepared.scene.choices, overrides=camera)
    with closing(Session(config, prepared.scene.seed)) as session:
        session.set_viewpoint(prepared.scene.viewpoint)
        for event in prepared.scene.events:
            if isinstance(event, Pointed):
                session.point_at(event.place)
        for _ in range(SETTLING):
            session.step()
        yield _scene_frame(session, "", prepared.title), FIRST_TIME
        for sentence in prepared.sentences:
            answer, began = session.say(sentence).message, session.steps
            yield _scene_frame(session, sentence, answer), FIRST_TIME
            yield from _until_rest(session, sentence)
            answer = session.view.status if session.steps > began else answer
            yield _scene_frame(session, sentence, answer), SCENE_LAST_TIME
            print(f"{name}: {sentence}: {answer}", flush=True)


def _until_rest(session: Session, sentence: str) -> Iterator[Frame]:
    for step in range(MOST_STEPS):
        if not session.busy:
            return
        session.step()
        if step % SCENE_SKIPPED == 0:
            yield _scene_frame(session, sentence, session.view.status), SCENE_SKIPPED * STEP_TIME
    raise RuntimeError(f"'{sentence}': the robot does not come to rest")


def _scene_frame(session: Session, said: str, answer: str) -> Image.Image:
    image = captioned(session.env.render(), SCENE_SIZE, SCENE_CAPTION)
    draw, height = ImageDraw.Draw(image), SCENE_SIZE[1]
    if said:
        draw.text((8, height + 5), f"\u201c{said}\u201d", fill="white", font=ImageFont.load_default(size=17))
    small = ImageFont.load_default(size=13)
    for row, text in enumerate(wrap_text(answer, SCENE_SIZE[0] - 16, small)[:2]):
        draw.text((8, height + 30 + 16 * row), text, fill="#b8c4d4", font=small)
    return image


# ---- Command line


def main() -> int:
    """Write a film; return 1 if something in it is not understood or not carried out."""
    options = _arguments().parse_args()
    try:
        if options.what == "chain":
            frames = list(film_chain(options.checkpoint, options.seed, options.length))
            samples = [image for image, _ in frames[::SAMPLED]]
        elif options.what == "scene":
            frames = list(film_scene(options.name))
            samples = [image for image, _ in frames[:: max(1, len(frames) // 8)]]
        else:
            frames = list(film_commands(_jobs(options), options.robot))
            samples = [image for image, time in frames if time == FIRST_TIME]
    except RuntimeError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    write_gif(options.out, frames, samples)
    return 0


def _jobs(options: argparse.Namespace) -> list[tuple[str, Job]]:
    """Return the commands with their jobs. Raises RuntimeError if one is not in the data, or not understood."""
    wanted = options.numbers.split(",")
    found = {item.number: (item.text, job) for item, job in understood(options.data, "develop", wanted)}
    jobs = [(text, job) for text, job in (found.get(number, ("", None)) for number in wanted) if job is not None]
    if len(jobs) < len(wanted):
        raise RuntimeError(f"--numbers: {len(wanted) - len(jobs)} of these commands are not understood")
    return jobs


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    kinds = parser.add_subparsers(dest="what", required=True)
    chain, commands = kinds.add_parser("chain"), kinds.add_parser("commands")
    chain.add_argument("--checkpoint", default="anything_kuka", help="a run, a file or a pretrained policy")
    chain.add_argument("--seed", type=int, default=0, help="of the room and its instructions")
    chain.add_argument("--length", type=int, default=10, help="instructions")
    commands.add_argument("--data", type=Path, required=True, help="folder with commands.txt and configuration.txt")
    commands.add_argument("--numbers", default=",".join(NUMBERS), help="of the commands, in the order of the film")
    commands.add_argument("--robot", default="kuka", help="an option of robot= (kuka)")
    scene = kinds.add_parser("scene")
    scene.add_argument("name", choices=PREPARED)
    for each in (chain, commands, scene):
        each.add_argument("--out", type=Path, required=True, help="the GIF")
    return parser


if __name__ == "__main__":
    sys.exit(main())
