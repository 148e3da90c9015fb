"""Random scenes of the language, for tests and benchmarks."""

from __future__ import annotations

from numpy.random import Generator

from language import COLORS, SHAPES, VIEWPOINTS, Scene


def random_scene(count: int, rng: Generator) -> Scene:
    """Return `count` random objects of three sizes and several heights, a fifth of them targets.

    The viewpoint is the robot's or the human's.
    """
    return Scene.from_arrays(
        nouns=rng.integers(len(SHAPES), size=count),
        colors=rng.integers(len(COLORS), size=count),
        positions=rng.uniform([0.3, -0.3, 0.0], [0.7, 0.3, 0.2], size=(count, 3)),
        size=rng.choice([0.03, 0.05, 0.07], size=count),
        targets=rng.random(count) < 0.2,
        viewpoint=list(VIEWPOINTS)[rng.integers(len(VIEWPOINTS))],
    )
