"""Films as GIFs, for pages: small files, because all frames have one palette."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

import deixis
from trainers.evaluation.video import sentence_of, wrap_text

Frame = tuple[Image.Image, int]  # and for how many milliseconds it is shown


def write_gif(path: Path, frames: Sequence[Frame], samples: Sequence[Image.Image]) -> None:
    """Write a GIF.

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


WIDTH, HEIGHT, CAPTION = 520, 360, 60  # pixels
SUPERSAMPLING = 2
CAMERA = {"target": [0.5, -0.06, 0.1], "distance": 1.5, "yaw": 10, "pitch": -36, "fov": 42}
FRAME_TIME, LAST_TIME = 50, 1500  # milliseconds: a control step takes 50
SKIPPED = 2  # every SKIPPED-th control step is shown
SAMPLED = 40  # every SAMPLED-th frame contributes to the palette


def film(checkpoint: str, seed: int, length: int) -> Iterator[Frame]:
    """Yield the frames of a chain. Raises RuntimeError if an instruction is not carried out."""
    policy = deixis.load_policy(checkpoint)
    size = {"width": SUPERSAMPLING * WIDTH, "height": SUPERSAMPLING * HEIGHT}
    camera = [f"workspace.camera.{key}={value}" for key, value in (CAMERA | size).items()]
    with closing(policy.make_env(1, camera, seed, render=True, instructions=length)) as env:
        state, done, steps = env.reset(), 0, 0
        while done < length:
            sentence = sentence_of(state)
            if steps % SKIPPED == 0:
                yield _frame(env.render(), f"{done + 1}. {sentence}"), SKIPPED * FRAME_TIME
            step = env.step(policy(state))
            state, steps = env.step_mdp(step), steps + 1
            if step["next", "success"][0]:
                done += 1
                print(f"{done} of {length}: {sentence}", flush=True)
            elif step["next", "done"][0]:
                raise RuntimeError(f"'{sentence}' was not carried out")
        yield _frame(env.render(), f"{done}. {sentence}"), LAST_TIME


def _frame(picture: NDArray[np.uint8], sentence: str) -> Image.Image:
    """Return the room with its subtitle."""
    image = Image.new("RGB", (WIDTH, HEIGHT + CAPTION), "black")
    image.paste(Image.fromarray(picture).resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS), (0, 0))
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(size=18)
    for row, text in enumerate(wrap_text(sentence, WIDTH - 16, font)[:2]):
        draw.text((8, HEIGHT + 6 + 24 * row), text, fill="white", font=font)
    return image


def main() -> int:
    """Write the film."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--checkpoint", default="anything_kuka", help="a run, a file or a pretrained policy")
    parser.add_argument("--seed", type=int, default=0, help="of the room and its instructions")
    parser.add_argument("--length", type=int, default=10, help="instructions")
    parser.add_argument("--out", type=Path, required=True, help="the GIF")
    options = parser.parse_args()
    try:
        frames = list(film(options.checkpoint, options.seed, options.length))
    except RuntimeError as error:
        print(f"error: --seed={options.seed}: {error}", file=sys.stderr)
        return 1
    write_gif(options.out, frames, [image for image, _ in frames[::SAMPLED]])
    print(f"{options.out}: {len(frames)} frames, {options.out.stat().st_size} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
