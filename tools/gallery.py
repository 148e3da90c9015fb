"""Contact sheets of all workspaces and tasks: `python -m tools.gallery` renders them.

    out=docs/gallery   the folder of workspaces.png (every workspace with every robot, and its person if any) and
                       tasks.png (every task while the scripted expert acts, with its sentence)
    seed=3             of the episodes
    robot=panda ...    any override of the config, as in train.py

The camera is the workspace's own.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from core.command_line import out_folder, split
from core.overrides import check, compose, groups
from core.program import run_program
from core.schema import Checked, any_path, read, within
from envs.config import EnvConfig, read_env
from envs.experts import expert
from envs.sim.workspace import FILM
from envs.workspace_env import WorkspaceEnv

COLUMNS, WIDTH, HEIGHT = 3, 400, 300  # cells in a row, pixels of a picture
SUPERSAMPLING = 2  # pixels rendered per pixel, in each direction: the renderer does not smooth edges
CAPTION_CHARACTERS, LINE, MARGIN = 60, 17, 6  # characters in a line of a caption, pixels of a line, pixels of a margin
COLOURS = 256  # of a sheet: a small file without a visible difference
EPISODE_SHARE = 0.6  # of the expert's episode, after which a task is shown
DEFAULTS = {"out": "docs/gallery", "seed": 3}

Picture = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class GalleryConfig(Checked):
    out: str = any_path()
    seed: int = within(0, 2**31 - 1)


@dataclass(frozen=True)
class Cell:
    """A picture (H, W, 3) with a title and, below it, the sentence."""

    picture: Picture
    title: str
    sentence: str = ""


def workspaces(names: Iterable[str], robots: Sequence[str], overrides: Sequence[str] = (), seed: int = 3) -> list[Cell]:
    """Return each workspace with each robot at the start of an episode. Raises ConfigError."""
    cells = []
    for name in names:
        for robot in robots:
            choice = [f"workspace={name}", f"robot={robot}"]
            has_person = read_env(compose(choice)).workspace.human is not None
            with closing(make_env([*choice, *["gesture=ray"] * has_person, *overrides], seed)) as env:
                env.reset()
                cells.append(Cell(picture_of(env), f"{name}, {robot}"))
    return cells


def tasks(names: Iterable[str], overrides: Sequence[str] = (), seed: int = 3) -> list[Cell]:
    """Return each task while the scripted expert acts. Raises ConfigError."""
    cells = []
    for name in names:
        with closing(make_env([f"task={name}", *overrides], seed)) as env:
            steps = run_expert(env, env.config.task.max_steps)
            env.set_seed(seed)
            run_expert(env, round(EPISODE_SHARE * steps))
            cells.append(Cell(picture_of(env), name, env.sentence() or "(no words)"))
    return cells


def make_env(overrides: Sequence[str], seed: int) -> WorkspaceEnv:
    """Return one world with the evaluations' initial states and a camera of higher resolution."""
    config: EnvConfig = read_env(compose(overrides)).without_curriculum()
    camera = replace(config.workspace.film, width=SUPERSAMPLING * WIDTH, height=SUPERSAMPLING * HEIGHT)
    workspace = replace(config.workspace, cameras={**config.workspace.cameras, FILM: camera})
    return WorkspaceEnv(replace(config, workspace=workspace), seed=seed, render=True)


def run_expert(env: WorkspaceEnv, steps: int) -> int:
    """Run the expert for up to `steps` control steps of an episode; return the number of steps taken."""
    actor, now = expert(env), env.reset()
    for step in range(steps):
        now = env.step(actor(now))["next"]
        if now["done"].any():
            return step + 1
    return steps


def picture_of(env: WorkspaceEnv) -> Picture:
    """Return the camera's picture, (HEIGHT, WIDTH, 3)."""
    return np.asarray(Image.fromarray(env.render()).resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS))


def sheet(cells: Sequence[Cell]) -> Image.Image:
    """Return the cells in rows, with a caption below each picture."""
    font, bold = ImageFont.load_default(size=13), ImageFont.load_default(size=15)
    captions = [textwrap.wrap(cell.sentence, CAPTION_CHARACTERS) for cell in cells]
    wide, high = WIDTH + MARGIN, HEIGHT + (1 + max(map(len, captions))) * LINE + 2 * MARGIN
    rows = -(-len(cells) // COLUMNS)
    image = Image.new("RGB", (min(COLUMNS, len(cells)) * wide + MARGIN, rows * high + MARGIN), "white")
    draw = ImageDraw.Draw(image)
    for i, (cell, caption) in enumerate(zip(cells, captions, strict=True)):
        x, y = MARGIN + i % COLUMNS * wide, MARGIN + i // COLUMNS * high
        image.paste(Image.fromarray(cell.picture), (x, y))
        draw.text((x, y + HEIGHT + 2), cell.title, fill="black", font=bold)
        for row, text in enumerate(caption, start=1):
            draw.text((x, y + HEIGHT + 3 + row * LINE), text, fill="#444444", font=font)
    return image.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=3, dither=Image.Dither.NONE)


def main(arguments: list[str]) -> None:
    """Render both sheets. Raises ConfigError."""
    own, overrides = split(arguments, [field.name for field in fields(GalleryConfig)], "out=docs/gallery")
    config = read(GalleryConfig, DEFAULTS | own, "")
    check(overrides)
    folder = out_folder(config.out)
    options = groups()
    sheets = {
        "workspaces.png": workspaces(options["workspace"], options["robot"], overrides, config.seed),
        "tasks.png": tasks(options["task"], overrides, config.seed),
    }
    for name, cells in sheets.items():
        sheet(cells).save(folder / name, optimize=True)
        print(f"{folder / name}: {len(cells)} pictures")


if __name__ == "__main__":
    run_program(main, __file__)
