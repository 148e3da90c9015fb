"""Videos of episodes, with the instruction and the outcome written below each frame."""

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

WIDTH = 480  # pixels of a frame whose caption has the sizes below; wider frames have larger letters
LINE_HEIGHT, MARGIN, LETTERS, SMALL = 20, 5, 14, 11  # of the caption, pixels
SENTENCE_LINES = 2  # lines for the instruction, above the line of the outcome
OUTCOME_FRAMES = 30  # for which the outcome is shown


@torch.no_grad()
def record_video(env: EnvBase, policy: TensorDictModuleBase, path: Path, episodes: int, fps: int = 20) -> list[str]:
    """Record episodes of world 0 under the deterministic policy.

    Args:
        env: built for rendering, with `film` and `config.task.whose_left`.
        policy: writes "action"; it does not receive the privileged keys.
        path: of the mp4 file.
        episodes: their number.
        fps: frames a second; the control rate gives a video in real time.

    Returns:
        The outcome of each episode.
    """
    outcomes: list[str] = []
    state, note = env.reset(), env.config.task.whose_left
    with open_video(path, fps) as video, set_exploration_type(ExplorationType.DETERMINISTIC):
        while len(outcomes) < episodes:
            sentence = sentence_of(state)
            video.append_data(add_caption(env.film(), sentence, note=note))
            state["action"] = policy(state.exclude("privileged"))["action"]
            step = env.step(state)
            if step["next", "done"][0]:
                outcomes.append(outcome_of(step["next"]))
                last = add_caption(env.film(), sentence, outcomes[-1], note)  # filmed before the reset
                for _ in range(OUTCOME_FRAMES):
                    video.append_data(last)
            state = env.maybe_reset(env.step_mdp(step))
    return outcomes


def sentence_of(state: TensorDictBase) -> str:
    """Return the instruction of world 0 as text; "" if there is none."""
    text = bytes(state["privileged", "sentence"][0].tolist()).rstrip(b"\0")
    return text.decode("utf-8", errors="replace")


def outcome_of(state: TensorDictBase) -> str:
    """Return how the episode of world 0 ended. state: after its last step."""
    for name in ("success", "wrong_object", "wrong_target"):
        if name in state.keys() and state[name][0]:
            return name.replace("_", " ")
    return "out of time" if state["truncated"][0] else "failed"


def add_caption(frame: np.ndarray, sentence: str, outcome: str = "", note: str = "") -> np.ndarray:
    """Return the frame (H, W, 3) uint8 with lines of text below it. H.264 requires the even height and width.

    note: a last line in small grey letters.
    """
    height, width = frame.shape[0], frame.shape[1]
    scale, rows = max(1.0, width / WIDTH), SENTENCE_LINES + 1 + bool(note)
    line, margin = round(scale * LINE_HEIGHT), round(scale * MARGIN)
    caption = rows * line
    image = Image.new("RGB", (width + width % 2, height + height % 2 + caption + caption % 2), "black")
    image.paste(Image.fromarray(frame), (0, 0))
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(size=scale * LETTERS)
    lines = wrap_text(sentence or "(no words)", width - 2 * margin, font)[:SENTENCE_LINES]
    for row, text in enumerate(lines):
        draw.text((margin, height + row * line), text, fill="white", font=font)
    colour = "lightgreen" if outcome == "success" else "orange"
    draw.text((margin, height + SENTENCE_LINES * line), outcome, fill=colour, font=font)
    if note:
        place = (margin, height + (SENTENCE_LINES + 1) * line)
        draw.text(place, note, fill="#a0a0a0", font=ImageFont.load_default(size=scale * SMALL))
    return np.asarray(image)


def wrap_text(text: str, width: float, font: Any) -> list[str]:
    """Return the text in lines of at most `width` pixels; a longer word gets a line of its own."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and font.getlength(longer) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def open_video(path: Path, fps: int, *options: str) -> Any:
    """Return an mp4 file to append frames to, as a context manager. options: ffmpeg's output options."""
    from imageio.v2 import get_writer

    return get_writer(path, fps=fps, macro_block_size=2, output_params=list(options))
