"""Films as GIFs, for pages: small files, because all frames have one palette."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PIL import Image

Frame = tuple[Image.Image, int]  # and for how many milliseconds it is shown


def write_gif(path: Path, frames: Sequence[Frame], samples: Sequence[Image.Image]) -> None:
    """Writes a GIF.

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
