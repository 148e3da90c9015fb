"""What is seen, in words and drawn on pictures: boxes, names, places and their uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.cameras import project
from envs.perception.detections import COLOR_NAMES, NOUN_NAMES, Array, Detections, View
from language import HAND, color_table

NINETY_FIVE = 2.8  # standard deviations within which 95 % of a normal distribution in three dimensions are
UNSURE = 0.8  # probability below which a word gets a question mark
LEAST_SIZE = 0.02  # metres of a box
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
INK, LABEL = (15, 15, 15), (255, 255, 255)
TURN = np.linspace(0, 2 * np.pi, 25)


@dataclass(frozen=True, kw_only=True)
class SeenThing:
    """One thing that is seen.

    name: its colour and noun, "transparent" before them for what only marks a place; "?" after what is unsure.
    within: metres from its place within which it is with 95 %. certain: the probability of presence, noun and colour.
    """

    name: str
    noun: str
    color: str
    position: Array
    within: float
    certain: float
    number: int

    @property
    def line(self) -> str:
        """The thing as a line of text."""
        x, y, z = self.position
        place = f"x {x:6.3f}  y {y:6.3f}  z {z:6.3f} m"
        return f"{self.name:28} {place}  within {1000 * self.within:4.1f} mm (95 %)  {self.certain:4.0%} certain"


def seen_things(found: Detections) -> list[SeenThing]:
    """Return the things that are seen, those of which is most certain that they are there first."""
    order = np.argsort(-found.presence, kind="stable")
    return [_thing(found, int(index)) for index in order]


def _thing(found: Detections, index: int) -> SeenThing:
    noun, color = int(found.nouns[index].argmax()), int(found.colors[index].argmax())
    is_hand = NOUN_NAMES[noun] == HAND
    shares = found.nouns[index, noun], 1.0 if is_hand else found.colors[index, color]
    words = [] if is_hand else [COLOR_NAMES[color] + ("" if shares[1] >= UNSURE else "?")]
    words.append(NOUN_NAMES[noun] + ("" if shares[0] >= UNSURE else "?"))
    if found.targets[index] > 0.5:
        words.insert(0, "transparent")
    longest = float(np.sqrt(max(np.linalg.eigvalsh(found.covariances[index])[-1], 0.0)))
    return SeenThing(
        name=" ".join(words),
        noun=NOUN_NAMES[noun],
        color=COLOR_NAMES[color],
        position=found.positions[index],
        within=NINETY_FIVE * longest,
        certain=float(found.presence[index] * shares[0] * shares[1]),
        number=index,
    )


def as_plain(found: Detections) -> list[dict[str, Any]]:
    """Return the things that are seen as values of JSON: metres, radians and probabilities."""
    rows = []
    for thing in seen_things(found):
        k = thing.number
        rows.append(
            {
                "name": thing.name,
                "noun": thing.noun,
                "color": thing.color,
                "position": _numbers(found.positions[k]),
                "within_95": round(thing.within, 5),
                "covariance": [[float(f"{value:.4g}") for value in row] for row in found.covariances[k].tolist()],
                "size": round(float(found.sizes[k]), 4),
                "yaw": round(float(found.yaws[k]), 4),
                "share": round(float(found.shares[k]), 4),
                "probabilities": {
                    "presence": round(float(found.presence[k]), 4),
                    "noun": round(float(found.nouns[k].max()), 4),
                    "color": round(float(found.colors[k].max()), 4),
                    "transparent": round(float(found.targets[k]), 4),
                },
            }
        )
    return rows


def _numbers(values: Array) -> list[float]:
    return [round(value, 5) for value in values.tolist()]


# ---- pictures


def drawn(view: View, found: Detections, width: int | None = None) -> NDArray[np.uint8]:
    """Return a view's picture (H, W, 3) with a box, a name and the uncertainty's ellipse for each thing in it.

    width: pixels of the result; None: those of the picture.
    """
    from PIL import Image, ImageDraw

    scale = 1.0 if width is None else width / view.camera.width
    size = (round(view.camera.width * scale), round(view.camera.height * scale))
    image = Image.fromarray(view.picture).resize(size, Image.Resampling.BICUBIC)
    draw = ImageDraw.Draw(image)
    colors = (255 * color_table()[:, :3]).astype(int).tolist()
    for thing in reversed(seen_things(found)):
        outline = _outline(view, found, thing.number, scale)
        if outline is None:
            continue
        box, ellipse = outline
        color = tuple(colors[COLOR_NAMES.index(thing.color)])
        draw.rectangle(_around(box, 1), outline=INK)
        draw.rectangle(box, outline=color, width=2)
        draw.line(ellipse, fill=LABEL, width=1)
        _label(draw, thing, box, size)
    return np.asarray(image, np.uint8)


def _around(box: Sequence[float], border: float) -> tuple[float, ...]:
    return box[0] - border, box[1] - border, box[2] + border, box[3] + border


def _outline(
    view: View, found: Detections, index: int, scale: float
) -> tuple[tuple[float, ...], list[tuple[float, float]]] | None:
    """Return the box (x0, y0, x1, y1) and the ellipse of a thing, pixels; None where it is not in the picture."""
    middle, size = found.positions[index], max(float(found.sizes[index]), LEAST_SIZE)
    cosine, sine = np.cos(found.yaws[index]), np.sin(found.yaws[index])
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    pixels, depths = project(view.camera, view.frame, np.vstack((middle + size * CORNERS @ turn.T, middle)))
    inside = (pixels[-1] >= 0).all() and (pixels[-1] < [view.camera.width, view.camera.height]).all()
    if (depths < 0.05).any() or not inside:
        return None
    low, high = scale * pixels[:-1].min(0), scale * pixels[:-1].max(0)
    root = np.linalg.cholesky(found.covariances[index] + 1e-12 * np.eye(3))
    tips, _ = project(view.camera, view.frame, middle + 1e-3 * np.eye(3))
    slope = (tips - pixels[-1]).T / 1e-3 @ root  # (2, 3): pixels for a standard deviation along each axis
    left, lengths, _ = np.linalg.svd(slope, full_matrices=False)
    circle = np.stack((np.cos(TURN), np.sin(TURN)))
    ellipse = scale * (pixels[-1] + (NINETY_FIVE * left @ (lengths[:, None] * circle)).T)
    return (*low.tolist(), *high.tolist()), [(x, y) for x, y in ellipse.tolist()]


def _label(draw: Any, thing: SeenThing, box: Sequence[float], size: tuple[int, int]) -> None:
    """Write a thing's name beside its box, inside the picture."""
    text = f"{thing.name} {thing.certain:.0%}"
    x0, y0, x1, y1 = draw.textbbox((0, 0), text)
    left = min(max(box[0], 0), max(size[0] - (x1 - x0) - 4, 0))
    top = box[1] - (y1 - y0) - 6 if box[1] > y1 - y0 + 6 else box[3] + 2
    draw.rectangle((left, top, left + x1 - x0 + 4, top + y1 - y0 + 4), fill=INK)
    draw.text((left + 2 - x0, top + 2 - y0), text, fill=LABEL)
