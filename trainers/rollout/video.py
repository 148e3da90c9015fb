"""A film of a few episodes, with what was said and what came of it written on the frame."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from PIL import Image, ImageDraw, ImageFont
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torchrl.envs import EnvBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

LINE, MARGIN, PAUSE = 20, 5, 10  # pixels of a line of the caption, its inset; frames the outcome stays on screen
SAID = 2  # lines for the sentence, above that for the outcome


@torch.no_grad()
def record(env: EnvBase, policy: TensorDictModuleBase, path: Path, episodes: int, fps: int = 20) -> list[str]:
    """Write `episodes` episodes of world 0 under the deterministic policy to the mp4 `path`; their outcomes.

    env: built for rendering. fps: control steps a second, for a film in real time.
    """
    outcomes: list[str] = []
    state = env.reset()
    with (
        writer(path, fps) as film,
        set_exploration_type(ExplorationType.DETERMINISTIC),
    ):
        while len(outcomes) < episodes:
            sentence = said(state)
            film.append_data(caption(env.render(), sentence))
            state["action"] = policy(state.exclude("privileged"))["action"]
            step = env.step(state)
            if step["next", "done"][0]:
                outcomes.append(outcome(step["next"]))
                last = caption(env.render(), sentence, outcomes[-1])  # before the reset takes the scene away
                for _ in range(PAUSE):
                    film.append_data(last)
            state = env.maybe_reset(env.step_mdp(step))
    return outcomes


def said(state: TensorDictBase) -> str:
    """The sentence of world 0."""
    text = bytes(state["privileged", "sentence"][0].tolist()).rstrip(b"\0")
    return text.decode("utf-8", errors="replace")


def outcome(after: TensorDictBase) -> str:
    """How the episode of world 0 that ended in this step went."""
    for name in ("success", "wrong_object", "wrong_target"):
        if name in after.keys() and after[name][0]:
            return name.replace("_", " ")
    return "out of time" if after["truncated"][0] else "failed"


def caption(frame: np.ndarray, sentence: str, ending: str = "") -> np.ndarray:
    """The frame (H, W, 3) uint8 with lines of text below it, even in height and width as H.264 wants."""
    height, width = frame.shape[0], frame.shape[1]
    image = Image.new("RGB", (width + width % 2, height + height % 2 + (SAID + 1) * LINE), "black")
    image.paste(Image.fromarray(frame), (0, 0))
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(size=14)
    for row, text in enumerate(wrapped(sentence or "(no words)", width - 2 * MARGIN, font)[:SAID]):
        draw.text((MARGIN, height + row * LINE), text, fill="white", font=font)
    colour = "lightgreen" if ending == "success" else "orange"
    draw.text((MARGIN, height + SAID * LINE), ending, fill=colour, font=font)
    return np.asarray(image)


def wrapped(sentence: str, width: float, font: Any) -> list[str]:
    """The sentence in lines of at most so many pixels, a longer word on a line of its own."""
    lines = [""]
    for word in sentence.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and font.getlength(longer) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def writer(path: Path, fps: int, *options: str) -> Any:
    """An open mp4 to append frames to. options: for ffmpeg's output."""
    from imageio.v2 import get_writer

    return get_writer(path, fps=fps, macro_block_size=2, output_params=list(options))
