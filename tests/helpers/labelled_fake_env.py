"""The fake environment with an expert's labels: the expert goes straight to the referent."""

import torch
from torchrl.data import Bounded

from tests.helpers.fake_env import MOVE, FakeEnv

LABEL = ("privileged", "expert_action")


class LabelledFakeEnv(FakeEnv):
    def __init__(self, worlds, seed):
        super().__init__(worlds, seed)
        self.observation_spec[LABEL] = Bounded(-1, 1, (worlds, 3))

    def _observe(self, *outcome):
        world = self.world
        referent = world["places"][torch.arange(len(world["hand"])), world["referent"]]
        return super()._observe(*outcome).set(LABEL, ((referent - world["hand"]) / MOVE).clamp(-1, 1))


def make_labelled(worlds, seed):
    return LabelledFakeEnv(worlds, seed)
