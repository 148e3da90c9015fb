"""Conditions that a camera meets, each beyond what the training varied, and how exactly scenes are seen in them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from envs.perception.detections import Detections
from envs.perception.detector import SightDetector, fuse
from envs.perception.network import SightNetwork
from envs.perception_training.judging import Judgement, judge
from envs.perception_training.scenes import PLAIN, SETUPS, THINGS, LookVariation, SceneSource, compressed

CAMERAS = "front", "side"
Picture = NDArray[np.uint8]
Change = Callable[[Picture, Generator], Picture]
CASES: tuple[tuple[str, tuple[str, ...], bool], ...] = (  # name, overrides, with the arm among the objects
    ("nl_reach, six objects", SETUPS[0], False),
    ("the same, the arm among them", SETUPS[0], True),
    ("nl_reach_large", ("task=nl_reach_large",), False),
    ("nl_pick_and_place", ("task=nl_pick_and_place",), False),
    ("nl_reach_gesture", SETUPS[5], False),
    ("anything", ("task=anything",), False),
    ("the same, the arm among them", ("task=anything",), True),
)


def judge_setup(
    detector: SightDetector,
    overrides: Sequence[str],
    *,
    scenes: int,
    seed: int,
    looks: LookVariation = PLAIN,
    disturbed: bool = False,
    change: Change | None = None,
) -> Judgement:
    """Return how exactly fresh scenes of a setup are seen. change: what happens to each picture."""
    source, rng = SceneSource(overrides, CAMERAS, seed, looks=looks, disturbed=disturbed), np.random.default_rng(seed)
    found: list[Detections] = []
    labels, positions = [], []
    try:
        for _ in range(scenes):
            drawn = list(source.draw())
            views = [each.view for each in drawn]
            if change is not None:
                views = [replace(view, picture=change(view.picture, rng)) for view in views]
            found.append(fuse(detector.each(views), [view.frame.place for view in views]))
            labels.append(np.stack([each.labels for each in drawn]))
            padded = np.zeros((THINGS, 3))
            padded[: len(drawn[0].positions)] = drawn[0].positions
            positions.append(padded)
    finally:
        source.close()
    return judge(found, labels, positions)


# ---- what happens to pictures


def noisy(picture: Picture, rng: Generator) -> Picture:
    """Noise of a standard deviation of 15 of 255."""
    return np.clip(picture + rng.normal(0.0, 15.0, picture.shape), 0, 255).astype(np.uint8)


def blurred(picture: Picture, rng: Generator) -> Picture:
    """A Gaussian of 1.2 pixels."""
    steps = np.arange(-3, 4)
    kernel = np.exp(-(steps**2) / (2 * 1.2**2))
    kernel /= kernel.sum()
    padded = np.pad(picture.astype(float), ((3, 3), (3, 3), (0, 0)), mode="edge")
    rows = sum(weight * padded[i : i + picture.shape[0]] for i, weight in enumerate(kernel))
    return np.rint(sum(weight * rows[:, i : i + picture.shape[1]] for i, weight in enumerate(kernel))).astype(np.uint8)


def jpeg(picture: Picture, rng: Generator) -> Picture:
    """JPEG of quality 30."""
    return compressed(picture, 30)


def warm(picture: Picture, rng: Generator) -> Picture:
    """White balance off by 25 per cent between red and blue, either way."""
    gain = np.array([1.12, 1.0, 0.88]) if rng.random() < 0.5 else np.array([0.88, 1.0, 1.12])
    return np.clip(picture * gain, 0, 255).astype(np.uint8)


def dark(picture: Picture, rng: Generator) -> Picture:
    """0.7 of the light."""
    return (picture * 0.7).astype(np.uint8)


CONDITIONS: tuple[tuple[str, LookVariation, Change | None], ...] = (
    ("camera moved, sd 3 cm each way", replace(PLAIN, shift=0.03), None),
    ("camera turned, sd 3 degrees each way", replace(PLAIN, turn=3.0), None),
    ("focal length, sd 3.5 %", replace(PLAIN, zoom=0.035), None),
    ("other light", replace(PLAIN, light=1.0), None),
    ("shadows", replace(PLAIN, light=1.0, shadow=1.0), None),
    ("colours of table, walls, robot and clothes", replace(PLAIN, recolor=1.0), None),
    ("textures", replace(PLAIN, recolor=1.0, texture=1.0), None),
    ("things of unknown shapes and colours", replace(PLAIN, unknown=1.0), None),
    ("noise, sd 15 of 255", PLAIN, noisy),
    ("blur, 1.2 pixels", PLAIN, blurred),
    ("JPEG of quality 30", PLAIN, jpeg),
    ("white balance, 12 % each way", PLAIN, warm),
    ("0.7 of the light", PLAIN, dark),
    ("all of them at once, as in training", LookVariation(), None),
)


def report_conditions(network: SightNetwork, scenes: int, seed: int) -> None:
    """Print a row for each case and each condition."""
    detector = SightDetector(network)
    print(f"{'':46}{'median':>8}{'95 %':>8}{'noun':>8}{'colour':>8}{'missed':>8}{'invented':>10}")
    for number, (name, overrides, disturbed) in enumerate(CASES):
        judged = judge_setup(detector, overrides, scenes=scenes, seed=seed + number, disturbed=disturbed)
        print(_row(name, judged), flush=True)
    print("nl_reach, six objects, with")
    for number, (name, looks, change) in enumerate(CONDITIONS):
        judged = judge_setup(detector, SETUPS[0], scenes=scenes, seed=seed + 100 + number, looks=looks, change=change)
        print(_row(f"  {name}", judged), flush=True)


def _row(name: str, judged: Judgement) -> str:
    of = judged.summary()
    shares = f"{of['noun']:8.4f}{of['color']:8.4f}{of['missed']:8.4f}{of['invented']:10.4f}"
    return f"{name:46}{of['median_mm']:5.1f} mm{of['p95_mm']:5.1f} mm{shares}"
