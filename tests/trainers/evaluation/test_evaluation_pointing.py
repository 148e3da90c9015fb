"""Success by difficulty of the gesture: which values are counted, and in which bin."""

from __future__ import annotations

import math

import pytest
import torch
from tensordict.nn import TensorDictModule
from torchrl.data import Unbounded

from tests.helpers.fake_env import FakeEnv, make_env
from trainers.evaluation.evaluation import EpisodeOutcome, by_pointing, evaluate

STILL = TensorDictModule(lambda robot: robot[:, :3] * 0, in_keys=["robot"], out_keys=["action"])


def episode(success, **pointing):
    return EpisodeOutcome(0, success, success, False, 0.0, 1, pointing)


class Pointed(FakeEnv):
    """Episodes of four steps. The gesture moves to another object at step `turns`; the measures drift at each step.

    In world w the angle to the rival starts at 3.2 + w degrees, the distance at 41 + w cm, and the ray's error is 1.5
    degrees; after the move they are 20 degrees and 60 cm. World 2 has no gesture.
    """

    turns = 0

    def __init__(self, worlds, seed):
        super().__init__(worlds, seed)
        self.observation_spec["gesture"] = Unbounded((worlds, 7))
        self.observation_spec["privileged", "pointing"] = Unbounded((worlds, 3))

    def _step(self, tensordict):
        out = super()._step(tensordict)
        ended = (self.world["step"] >= 4).unsqueeze(-1)
        return out.update({"done": ended, "terminated": ended, "truncated": ended & False})

    def _observe(self, *flags):
        out, step = super()._observe(*flags), self.world["step"]
        n = len(step)
        moved = (step >= self.turns) & bool(self.turns)
        world = torch.arange(n)
        apart = torch.where(moved, 20, 3.2 + world) + 0.5 * step
        metres = torch.where(moved, 0.6, 0.41 + 0.01 * world) + 0.1 * step
        pointing = torch.stack((torch.full((n,), math.radians(1.5)), torch.deg2rad(apart), metres), 1)
        shown = (world != 2)[:, None]
        return out.update({"gesture": (moved[:, None] + torch.ones(n, 7)) * shown}).set(
            ("privileged", "pointing"), pointing * shown
        )


def ranges(bins):
    return {(each.low, each.high): each.episodes for each in bins}


def test_the_measures_at_the_start_of_an_episode_are_counted():
    found = evaluate(Pointed(4, 0), STILL, 8, seed=0).by_pointing
    assert ranges(found["angle"]) == {(3, 4): 2, (4, 5): 2, (6, 8): 2}
    assert ranges(found["distance"]) == {(40, 45): 6}
    assert ranges(found["stray"]) == {(0.4, 0.5): 2, (0.3, 0.4): 2, (0.2, 0.3): 2}
    assert ranges(found["objects"]) == {(3, 4): 6}


def test_an_episode_whose_gesture_moves_is_counted_by_the_last_object(monkeypatch):
    monkeypatch.setattr(Pointed, "turns", 2)
    found = evaluate(Pointed(4, 0), STILL, 8, seed=0).by_pointing
    assert ranges(found["angle"]) == {(20, 30): 6}
    assert ranges(found["distance"]) == {(70, 100): 6}


def test_an_edge_belongs_to_the_bin_above_it():
    bins = by_pointing([episode(True, angle=3.0), episode(False, angle=3.999), episode(True, angle=90.0)])
    assert [(b.low, b.high, b.episodes, b.success_at_end) for b in bins["angle"]] == [
        (3, 4, 2, 0.5),
        (30, None, 1, 1.0),
    ]
    assert list(bins) == ["angle"]
    assert bins["angle"][0].ci95 == pytest.approx((0.0945, 0.9055), abs=1e-3)


def test_a_single_object_has_no_rival():
    class Single(Pointed):
        def _observe(self, *flags):
            out = super()._observe(*flags)
            out["objects_mask"][:, 1:] = False
            return out

    assert set(evaluate(Single(4, 0), STILL, 4, seed=0).by_pointing) == {"objects", "distance"}


def test_without_gestures_there_are_no_bins():
    result = evaluate(make_env(4, 0), STILL, 4, seed=0)
    assert result.by_pointing == {}
    assert "by_pointing" not in result.as_dict()
