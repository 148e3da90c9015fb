"""Statistics of LeRobot features."""

from __future__ import annotations

import numpy as np

from trainers.datasets import lerobot_dataset


def test_merged_statistics_are_those_of_all_values():
    values = np.random.default_rng(0).normal(size=(30, 2))
    merged = lerobot_dataset.merge(lerobot_dataset.of_values(values[:9]), lerobot_dataset.of_values(values[9:]))
    whole = lerobot_dataset.of_values(values)
    for name in ("min", "max", "mean", "std", "count"):
        np.testing.assert_allclose(merged[name], whole[name])
    assert lerobot_dataset.merge(None, whole) is whole


def test_statistics_of_images_are_per_colour_in_the_unit_interval():
    red = np.zeros((8, 8, 3), np.uint8)
    red[..., 0] = 255
    stats = lerobot_dataset.of_images([red, red])
    assert stats["mean"].shape == (3, 1, 1)
    assert stats["mean"].flatten().tolist() == [1.0, 0.0, 0.0]
    assert stats["count"].tolist() == [2]


def test_statistics_are_written_as_lists():
    assert lerobot_dataset.as_lists({"min": np.array([1.0, 2.0])}) == {"min": [1.0, 2.0]}
