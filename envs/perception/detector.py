"""Finding things in the pictures of one moment: the network on each picture, and what several cameras see together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from core.cameras import Camera, CameraFrame
from envs.perception.assignment import assignment
from envs.perception.detections import NOUN_NAMES, Detections, View, probabilities, probability
from envs.perception.network import CELL, HEIGHT_UNIT, PART, SIZE_UNIT, SightNetwork, camera_numbers, folded
from envs.perception.poses import CUBE, LEVER, WHEEL, wheel_shares, wrapped
from envs.perception.tracking import QUARTER
from envs.perception.weights_file import load
from language import DEVICES, FITTINGS, HAND

Array = NDArray[np.float64]
MOST = 64  # cells of one picture that may be the middle of a thing
ALIKE, OTHER = 4.5, 2.5  # pixels within which cells tell of one thing: of the same colour, and of another
FAINT = 0.15  # presence in one picture from which a thing is looked for in the others
FAINT_HEAT = np.log(FAINT / (1 - FAINT))  # the network's number of that presence
PRESENT = 0.35  # presence from which one picture alone is believed
SAME = 0.02  # metres within which one camera sees one thing, whatever it looks like
GATE = 25.0  # square of the Mahalanobis distance up to which two cameras may see the same thing
FLOOR = 0.0015  # metres: the least standard deviation of a place
APART = 0.3  # metres beyond which two cameras never see the same thing
SLACK = 0.08  # metres along the line of sight by which a half hidden thing may be misplaced
UNIQUE = np.array([noun in (*FITTINGS, HAND) for noun in NOUN_NAMES])
WIDE = np.array([0.09 if noun in DEVICES else 0.04 for noun in NOUN_NAMES])  # metres within which alike things are one:
WIDE[UNIQUE] = np.inf  # the handle of a wheel may be mistaken for another part of it, and there is one drawer
FACING = np.isin(np.arange(len(NOUN_NAMES)), (LEVER, WHEEL))


class SightDetector:
    """Finds things by a network. Implements `envs.perception.Detector`."""

    def __init__(self, network: SightNetwork) -> None:
        self._network = folded(network).to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def __call__(self, views: Mapping[str, View]) -> Detections:
        return fuse(self.each(list(views.values())), [view.frame.place for view in views.values()])

    def each(self, views: Sequence[View]) -> list[Detections]:
        """Return what is seen in each picture. Pictures of one size are read together, which is a third faster."""
        found: dict[int, Detections] = {}
        for size in dict.fromkeys(view.picture.shape for view in views):
            chosen = [i for i, view in enumerate(views) if view.picture.shape == size]
            numbers = self._read([views[i] for i in chosen])
            found |= {i: decode(numbers[[k]], views[i].camera, views[i].frame) for k, i in enumerate(chosen)}
        return [found[i] for i in range(len(views))]

    @torch.no_grad()
    def _read(self, views: Sequence[View]) -> Tensor:
        """Return the network's numbers (M, WIDTH, h, w) for pictures of one size."""
        pictures = torch.from_numpy(np.stack([view.picture for view in views])).permute(0, 3, 1, 2).float().div_(255)
        cameras = torch.from_numpy(np.stack([camera_numbers(view.camera, view.frame) for view in views]))
        numbers: Tensor = self._network(pictures.contiguous(memory_format=torch.channels_last), cameras)
        return numbers


def decode(out: Tensor, camera: Camera, frame: CameraFrame) -> Detections:
    """Return what the network's numbers (1, WIDTH, h, w) of one picture tell."""
    cells: NDArray[np.float32] = out[0].flatten(1).numpy()
    heat = cells[PART["heat"]][0]
    places = np.flatnonzero(heat > FAINT_HEAT)
    places = places[np.argsort(-heat[places], kind="stable")[:MOST]]
    if not len(places):
        return Detections.none()
    middles = np.stack((places % out.shape[3], places // out.shape[3]), 1) + 0.5
    rows = cells[:, places].T.astype(np.float64)
    pixels = CELL * (middles + rows[:, PART["offset"]])
    kept = _apart(pixels, rows[:, PART["color"]].argmax(1))
    pixels, numbers = pixels[kept], {name: rows[kept, part] for name, part in PART.items()}
    heights = numbers["height"][:, 0] * HEIGHT_UNIT
    spread = np.exp(numbers["spread"].clip(-5.0, 2.0)) * np.sqrt(2.0)
    nouns = probabilities(numbers["noun"])
    positions, covariances = _placed(
        camera, frame, pixels=pixels, heights=heights, blur=spread[:, 0] * CELL, rise=spread[:, 1] * HEIGHT_UNIT
    )
    sight_yaw = np.arctan2(positions[:, 1] - frame.place[1], positions[:, 0] - frame.place[0])
    turn = numbers["turn"]
    noun = nouns.argmax(1)
    full, quarter = np.arctan2(turn[:, 1], turn[:, 0]), np.arctan2(turn[:, 3], turn[:, 2]) / 4
    yaws = np.where(FACING[noun], wrapped(full + sight_yaw, 2 * np.pi), 0.0)
    yaws = np.where(noun == CUBE, wrapped(quarter + sight_yaw, QUARTER), yaws)
    shares = numbers["share"][:, 0]
    # The handle of a wheel stands at `full`, and its mark at four times `quarter`.
    shares = np.where(noun == WHEEL, wheel_shares(full, 4 * quarter), shares)
    return Detections(
        positions=positions,
        covariances=covariances,
        nouns=nouns,
        colors=probabilities(numbers["color"]),
        sizes=numbers["size"][:, 0] * SIZE_UNIT,
        yaws=yaws,
        shares=np.clip(shares, 0.0, 1.0),
        targets=probability(numbers["target"][:, 0]),
        presence=probability(numbers["heat"][:, 0]),
    )


def _apart(pixels: Array, colors: NDArray[np.int64]) -> list[int]:
    """Return which of M cells, most present first, tell of other things than those before them.

    Neighbouring cells tell of the same thing, or of two that overlap: then they tell of other middles or colours.
    pixels: (M, 2) the middles that they tell of.
    """
    gaps = np.linalg.norm(pixels[:, None] - pixels[None], axis=-1)
    same = gaps < np.where(colors[:, None] == colors[None], ALIKE, OTHER)
    return _firsts(same)


def _firsts(same: NDArray[np.bool_]) -> list[int]:
    """Return those of M things that are the same as none of those that were kept before them. same: (M, M)."""
    kept: list[int] = []
    for k in range(len(same)):
        if not same[k, kept].any():
            kept.append(k)
    return kept


def _placed(
    camera: Camera, frame: CameraFrame, *, pixels: Array, heights: Array, blur: Array, rise: Array
) -> tuple[Array, Array]:
    """Return places (M, 3) and covariances (M, 3, 3) of things at pixels (M, 2) and heights (M,), metres.

    blur: (M,) pixels and rise: (M,) metres, the standard deviations of both.
    """
    across = (pixels - camera.middle) / camera.focal
    rays = np.concatenate((across, np.ones((len(across), 1))), 1) @ frame.axes
    fall = np.minimum(rays[:, 2], -0.05)
    depths = (heights - frame.place[2]) / fall
    positions = frame.place + depths[:, None] * rays
    # A pixel's error moves the point across the line of sight, and on along it until it has the same height again.
    along = rays / fall[:, None]
    right, down = (axis - axis[2] * along for axis in frame.axes[:2])
    side = (blur * depths / camera.focal)[:, None, None] ** 2
    squares = side * (_outer(right) + _outer(down)) + (rise[:, None, None] ** 2) * _outer(along)
    return positions, squares + FLOOR**2 * np.eye(3)


def _outer(vectors: Array) -> Array:
    return vectors[:, :, None] * vectors[:, None, :]


# ---- several cameras


def fuse(each: Sequence[Detections], places: Sequence[Array]) -> Detections:
    """Return what several cameras see together: the places that agree best with all of them.

    Args:
        each: what each camera sees.
        places: (3,) where each camera is, metres.
    """
    merged, slack = Detections.none(), np.zeros((0, 3, 3))
    for one, place in zip(each, places, strict=True):
        one = _distinct(one)
        sight = one.positions - place
        sight /= np.maximum(np.linalg.norm(sight, axis=1, keepdims=True), 1e-9)
        merged, slack = _joined(merged, slack, one, SLACK**2 * _outer(sight))
    return _distinct(merged[merged.presence > PRESENT])


def _joined(one: Detections, slack: Array, other: Detections, other_slack: Array) -> tuple[Detections, Array]:
    """Merge the things of one set with those of another that may be the same; return them and their slack.

    A thing that is half hidden may look higher than it is, so the same thing is looked for all along the line of sight:
    slack, other_slack: (M, 3, 3) square metres, what this adds to the covariances.
    """
    if not len(one) or not len(other):
        return (one, slack) if len(one) else (other, other_slack)
    gap = other.positions[None] - one.positions[:, None]
    sure = one.covariances[:, None] + other.covariances[None]
    unsure = sure + slack[:, None] + other_slack[None]
    near, distance = (np.einsum("abi,abij,abj->ab", gap, np.linalg.inv(squares), gap) for squares in (sure, unsure))
    alike = (one.nouns @ other.nouns.T + 0.05) * (one.colors @ other.colors.T)
    cost = distance + np.minimum(near, GATE) - 2 * np.log(np.maximum(alike, 1e-6))
    allowed = (distance < GATE) & (np.linalg.norm(gap, axis=-1) < APART) & (alike > 1e-3)
    rows, columns = assignment(np.where(allowed, cost, 1e3))
    pairs = allowed[rows, columns]
    rows, columns = rows[pairs], columns[pairs]
    crossed = (near[rows, columns] > GATE)[:, None, None]  # their lines of sight cross where neither saw the thing
    first, second = one[rows], other[columns]
    first = replace(first, covariances=first.covariances + crossed * slack[rows])
    second = replace(second, covariances=second.covariances + crossed * other_slack[columns])
    parts = _mixed(first, second), one[_others(len(one), rows)], other[_others(len(other), columns)]
    none = np.zeros((len(rows), 3, 3))
    slacks = none, slack[_others(len(one), rows)], other_slack[_others(len(other), columns)]
    return _stacked(*parts), np.concatenate(slacks)


def _others(count: int, chosen: NDArray) -> NDArray[np.bool_]:
    rest = np.ones(count, bool)
    rest[chosen] = False
    return rest


def _mixed(one: Detections, other: Detections) -> Detections:
    """Return M things that are each seen twice. What is known better counts more."""
    weights = np.linalg.inv(one.covariances), np.linalg.inv(other.covariances)
    covariances = np.linalg.inv(weights[0] + weights[1])
    positions = np.einsum(
        "mij,mj->mi",
        covariances,
        np.einsum("mij,mj->mi", weights[0], one.positions) + np.einsum("mij,mj->mi", weights[1], other.positions),
    )
    nouns, colors = one.nouns * other.nouns + 1e-9, one.colors * other.colors + 1e-9
    better = one.presence >= other.presence
    odds = one.targets * other.targets, (1 - one.targets) * (1 - other.targets)
    return Detections(
        positions=positions,
        covariances=covariances,
        nouns=nouns / nouns.sum(1, keepdims=True),
        colors=colors / colors.sum(1, keepdims=True),
        sizes=(one.sizes + other.sizes) / 2,
        yaws=np.where(better, one.yaws, other.yaws),
        shares=(one.shares + other.shares) / 2,
        targets=odds[0] / np.maximum(odds[0] + odds[1], 1e-9),
        presence=1 - (1 - one.presence) * (1 - other.presence),
    )


def _stacked(*parts: Detections) -> Detections:
    names = Detections.__dataclass_fields__
    return Detections(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def _distinct(found: Detections) -> Detections:
    """Drop what is another finding of the same thing, less present."""
    order = np.argsort(-found.presence, kind="stable")
    noun, color, positions = found.nouns.argmax(1)[order], found.colors.argmax(1)[order], found.positions[order]
    gaps = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    alike = (noun[:, None] == noun) & ((color[:, None] == color) | UNIQUE[noun][:, None])
    kept = _firsts(gaps < np.where(alike, WIDE[noun][:, None], SAME))
    return found[np.sort(order[kept])]


def load_detector(weights: str | Path | None = None) -> SightDetector:
    """Return the detector with these weights; None: those that come with the project. Raises ConfigError."""
    return SightDetector(load(weights))
