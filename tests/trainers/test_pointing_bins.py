"""Success by what makes a gesture hard to read: which values count, and in which bin."""

import math

import pytest
import torch
from tensordict.nn import TensorDictModule
from torchrl.data import Unbounded

import evaluate as program
from tests.helpers.fake_env import FakeEnv, make_env
from trainers.reports.plots import bin_name, pointing_plot
from trainers.rollout.evaluation import BINS, Episode, by_pointing, evaluate

STILL = TensorDictModule(lambda robot: robot[:, :3] * 0, in_keys=["robot"], out_keys=["action"])


def episode(success, **pointing):
    return Episode(0, success, success, False, 0.0, 1, pointing)


class Pointed(FakeEnv):
    """Episodes of four steps; the finger moves on before the step `turns`, and at each step the values drift.

    World w begins 3.2 + w degrees from the rival, 41 + w cm from the fingertip, and the finger strays by 1.5 degrees;
    after the move it is 20 degrees and 60 cm. World 2 shows no gesture.
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


def test_the_values_at_the_beginning_count():
    found = evaluate(Pointed(4, 0), STILL, 8, seed=0).by_pointing
    assert ranges(found["angle"]) == {(3, 4): 2, (4, 5): 2, (6, 8): 2}
    assert ranges(found["distance"]) == {(40, 45): 6}
    assert ranges(found["stray"]) == {(0.4, 0.5): 2, (0.3, 0.4): 2, (0.2, 0.3): 2}
    assert ranges(found["objects"]) == {(3, 4): 6}


def test_a_finger_that_moves_on_counts_by_what_it_shows_last(monkeypatch):
    monkeypatch.setattr(Pointed, "turns", 2)
    found = evaluate(Pointed(4, 0), STILL, 8, seed=0).by_pointing
    assert ranges(found["angle"]) == {(20, 30): 6}
    assert ranges(found["distance"]) == {(70, 100): 6}


def test_edges_belong_to_the_bin_that_they_begin():
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


def test_nothing_changes_where_nobody_points():
    result = evaluate(make_env(4, 0), STILL, 4, seed=0)
    assert result.by_pointing == {}
    assert "by_pointing" not in result.as_dict()


def test_a_picture_and_lines_of_text(tmp_path):
    ended = [episode(k % 3 > 0, angle=k, objects=2.0 + k % 7, distance=40.0 + k, stray=k / 30) for k in range(40)]
    report = evaluate(Pointed(4, 0), STILL, 8, seed=0).as_dict()
    report["by_pointing"] = {name: [b.as_dict() for b in bins] for name, bins in by_pointing(ended).items()}
    assert set(report["by_pointing"]) == set(BINS)
    pointing_plot(report["by_pointing"], tmp_path / "all.png", "everything")
    pointing_plot({"objects": report["by_pointing"]["objects"]}, tmp_path / "one.png", "a single panel")
    assert all((tmp_path / name).stat().st_size > 5000 for name in ("all.png", "one.png"))
    text = program.describe(report, tmp_path / "x.json")
    assert "angle 30+ " in text
    assert "objects 8 " in text
    assert bin_name("stray", [0.1, 0.2]) == "0.1-0.2"
