"""What everything looks like: `python -m envs.tools.gallery` renders contact sheets, one picture a cell.

    out=docs/gallery   the folder where workspaces.png (every workspace with every robot, and the person where there is
                       one) and tasks.png (every task, with its sentence, as the scripted expert is at it) go
    seed=3             of the episodes
    robot=panda ...    any override of the config, as of train.py

All is seen by the workspace's own camera.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from conf.arguments import out_folder, run, split
from conf.overrides import check, compose, groups
from conf.schema import Checked, read, within
from envs.config import EnvConfig, read_env
from envs.experts import expert
from envs.workspace_env import WorkspaceEnv

COLUMNS, WIDTH, HEIGHT = 3, 400, 300  # cells a row, pixels of a picture
FINER = 2  # times as many pixels are rendered each way: the renderer does not smooth edges
LETTERS, LINE, MARGIN = 60, 17, 6  # characters in a line of a caption, pixels of a line, its inset
COLOURS = 256  # of a sheet: a fraction of the bytes, and no difference to see
BUSY = 0.6  # share of the expert's episode after which tasks are shown
DEFAULTS = {"out": "docs/gallery", "seed": 3}

Picture = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class GalleryConfig(Checked):
    out: str
    seed: int = within(0, 2**31 - 1)


@dataclass(frozen=True)
class Cell:
    """A picture (H, W, 3) with a title and, below it, what is said there."""

    picture: Picture
    title: str
    said: str = ""


def workspaces(names: Iterable[str], robots: Sequence[str], overrides: Sequence[str] = (), seed: int = 3) -> list[Cell]:
    """Each workspace with each robot, as an episode begins. Raises ConfigError."""
    cells = []
    for name in names:
        for robot in robots:
            choice = [f"workspace={name}", f"robot={robot}"]
            somebody = read_env(compose(choice)).workspace.human is not None
            with closing(stage([*choice, *["gesture=ray"] * somebody, *overrides], seed)) as env:
                env.reset()
                cells.append(Cell(seen(env), f"{name}, {robot}"))
    return cells


def tasks(names: Iterable[str], overrides: Sequence[str] = (), seed: int = 3) -> list[Cell]:
    """Each task, as the scripted expert is at it. Raises ConfigError."""
    cells = []
    for name in names:
        with closing(stage([f"task={name}", *overrides], seed)) as env:
            steps = act(env, env.config.task.max_steps)
            env.set_seed(seed)
            act(env, round(BUSY * steps))
            cells.append(Cell(seen(env), name, env.sentence() or "(no words)"))
    return cells


def stage(overrides: Sequence[str], seed: int) -> WorkspaceEnv:
    """One world with a finer camera, whose episodes begin where judged ones do."""
    config: EnvConfig = read_env(compose(overrides)).judged()
    camera = replace(config.workspace.camera, width=FINER * WIDTH, height=FINER * HEIGHT)
    return WorkspaceEnv(replace(config, workspace=replace(config.workspace, camera=camera)), seed=seed, render=True)


def act(env: WorkspaceEnv, steps: int) -> int:
    """Let the expert do an episode's first steps; how many it took, if the episode was over before."""
    actor, now = expert(env), env.reset()
    for step in range(steps):
        now = env.step(actor(now))["next"]
        if now["done"].any():
            return step + 1
    return steps


def seen(env: WorkspaceEnv) -> Picture:
    """What the camera sees, (HEIGHT, WIDTH, 3)."""
    return np.asarray(Image.fromarray(env.render()).resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS))


def sheet(cells: Sequence[Cell]) -> Image.Image:
    """The cells in rows, each picture above its caption."""
    font, bold = ImageFont.load_default(size=13), ImageFont.load_default(size=15)
    captions = [textwrap.wrap(cell.said, LETTERS) for cell in cells]
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
    run(main, __doc__)
