"""A scripted expert for the fake environment."""

from __future__ import annotations

import torch
from tensordict.nn import TensorDictModule


class Expert(torch.nn.Module):
    """Goes to the object of the named colour. Reads no privileged keys."""

    def forward(self, robot, objects, instruction):
        wanted = instruction[:, 2] - 3
        slot = objects[:, :, 3:6].argmax(-1).eq(wanted.unsqueeze(-1)).float().argmax(-1)
        places = objects[torch.arange(len(slot)), slot, :3]
        return ((places - robot[:, :3]) / 0.2).clamp(-1, 1)


EXPERT = TensorDictModule(Expert(), in_keys=["robot", "objects", "instruction"], out_keys=["action"])
