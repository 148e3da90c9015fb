"""Pictures and words to places: which of the things in the pictures the words mean, without object rows.

pixels ─► convolutions ─► cells: features, a place each ─┐
instruction ─► queries ──────────────────────────────────┴─► attention over cells ─► places of referent and target

The actor is given these places, relative to the gripper too. At no time does the network see positions, colours or
shapes other than in pictures. In training, the simulator tells which cell shows what (`PictureBC`).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import torch
import torch.nn.functional as F
from tensordict import TensorDictBase
from torch import Tensor, nn
from torchrl.data import Composite

from core.errors import ConfigError
from trainers.config import PixelsConfig
from trainers.models.grounding import MAPS, QUERIES, QueryEncoder
from trainers.models.networks import Normalise, mlp

PIXELS, TIP = "pixels", "tip"
STRIDE = 4  # pixels across a cell
UNIT = 0.2  # metres, of places within the network
SAME = 0.06  # metres from the likeliest cell's place within which other cells show the same thing
REACHES = (0.2, 0.04)  # metres at which the offsets that the actor is given are clipped


class Cells(NamedTuple):
    """What T cells of all cameras show, before any words.

    features: (N, T, F). presence: (N, T) logits of a thing's centre being in the cell.
    """

    features: Tensor
    presence: Tensor

    def select(self, cells: Tensor) -> Cells:
        """Return the cells (N, k)."""
        index = cells.unsqueeze(-1).expand(-1, -1, self.features.shape[-1])
        return Cells(self.features.gather(1, index), self.presence.gather(1, cells))

    def repeat(self, times: int) -> Cells:
        """Return (N * times, ...): each of the N as often as it has sentences."""
        return self if times == 1 else Cells(*(each.repeat_interleave(times, 0) for each in self))


class PictureEncoder(nn.Module):
    """Instruction (N, L), pixels (N, C, H, W, 3) and tip (N, 3) to where the actor is to act, (N, outputs).

    Two words' worth of attention, as in `GroundingEncoder`: the words match features of cells, find the anchors that
    relations refer to, and score each cell's place relative to these. Only the `cells` that most likely show a thing
    take part.

    Args:
        config: of the policy.
        spec: of the environment's observations.
        words: size of the vocabulary.
        length: L.
        choices: 1, or 2 where the words name a target as well.

    Raises:
        ConfigError: nothing observes pictures, or no cells divide them.
    """

    out_keys = ("referent",)
    logit_keys = ()
    scene_keys = (PIXELS, TIP)
    observes_obstacles = False
    obstacle_width = verbs = 0

    middle: Tensor
    axes: Tensor

    def __init__(self, config: PixelsConfig, spec: Composite, *, words: int, length: int, choices: int) -> None:
        super().__init__()
        if PIXELS not in spec.keys():
            raise ConfigError("policy=pixels needs an environment that observes pixels: build it with policy=pixels")
        cameras, size = spec[PIXELS].shape[1], spec[PIXELS].shape[2]
        if size % STRIDE:
            raise ConfigError(f"policy.pictures.size={size} must be a multiple of {STRIDE}")
        self.side, self.choices = size // STRIDE, choices
        self.count = min(config.cells, cameras * self.side**2)
        self.objects = Normalise(spec["objects"])
        self.register_buffer("middle", self.objects.centre[:3].clone())
        self.outputs = 9 * choices + 6 * (choices - 1)
        features = config.channels[-1]
        self.convolutions = _convolutions(config.channels)
        axis = torch.linspace(-1.0, 1.0, size)
        self.register_buffer("axes", torch.stack(torch.meshgrid(axis, axis, indexing="ij")), persistent=False)
        self.cell_embedding = nn.Parameter(0.02 * torch.randn(cameras, self.side**2, features))
        self.from_tip = nn.Linear(3, features)
        self.norm = nn.LayerNorm(features)
        self.presence, self.place = nn.Linear(features, 1), mlp(features, [64], 3)
        self.row = mlp(features, [64], self.objects.shape[0])  # read by the loss alone
        self.queries = QueryEncoder(
            nn.Embedding(words, config.embedding, padding_idx=0), length=length, width=config.embedding, choices=choices
        )
        self.match, self.project = (
            mlp(features, [config.width], config.width),
            nn.Linear(config.embedding, config.width),
        )
        self.maps, self.origin = nn.Linear(3, 3 * MAPS, bias=False), nn.Parameter(torch.zeros(3 * MAPS))
        self.relative = nn.Linear(3 + 3 * MAPS, config.width)
        self.relation = nn.Linear(6 + MAPS + config.embedding, config.width)
        self.score = nn.Linear(config.width, 1)

    def forward(self, instruction: Tensor, *scene: Tensor) -> tuple[Tensor, ...]:
        return self.attend(self.encode_words(instruction), *scene)

    def encode_words(self, instruction: Tensor) -> Tensor:
        """Return the queries (N, Q, E) of tokens (N, L)."""
        return self.queries(instruction)

    def encode_all_words(self, instruction: Tensor) -> Tensor:
        """`encode_words` without the search for repetitions, which no exported file can express."""
        return self.queries.encode(instruction)

    def attend(self, queries: Tensor, pixels: Tensor, tip: Tensor) -> tuple[Tensor, ...]:
        """`forward`, given the queries of `encode_words`."""
        seen = self.see(pixels, tip)
        seen = seen.select(self.likeliest(seen))
        places = self.place(seen.features)
        chosen = [chosen_place(each, places) for each in self.attention_logits(queries, seen, places)]
        return (self.context(torch.stack(chosen, 1), tip),)

    def see(self, pixels: Tensor, tip: Tensor) -> Cells:
        """Return what pictures (N, C, H, W, 3) uint8 show, with the gripper at tip (N, 3), metres."""
        count, cameras = pixels.shape[:2]
        x = pixels.flatten(0, 1).permute(0, 3, 1, 2).float() / 127.5 - 1
        x = torch.cat([x, self.axes.expand(len(x), -1, -1, -1)], 1).contiguous(memory_format=torch.channels_last)
        x = self.convolutions(x).flatten(2).transpose(1, 2).reshape(count, cameras, self.side**2, -1)
        gripper = self.from_tip((tip - self.middle) / UNIT)
        x = F.relu(self.norm(x + self.cell_embedding + gripper[:, None, None])).flatten(1, 2)
        return Cells(x, self.presence(x).squeeze(-1))

    def likeliest(self, seen: Cells) -> Tensor:
        """Return the cells (N, count) that most likely show a thing."""
        return seen.presence.topk(self.count, 1).indices

    def attention_logits(self, queries: Tensor, seen: Cells, places: Tensor) -> list[Tensor]:
        """Return for each choice the logits (N, T) of the cells being what the words mean.

        Args:
            queries: (N, Q, E) of `encode_words`.
            seen: the cells.
            places: (N, T, 3) where the thing is that each of them shows, in `UNIT`; they get no gradient.
        """
        matched, places, shown = self.match(seen.features), places.detach(), F.logsigmoid(seen.presence)
        mapped = _lengths(self.maps(places) + self.origin)
        logits = []
        for each in queries.split(QUERIES, dim=1):
            scores = matched @ self.project(each[:, :3]).transpose(1, 2) * matched.shape[-1] ** -0.5
            scores = scores + shown.unsqueeze(-1)
            anchors = scores[..., 1:].softmax(1).transpose(1, 2) @ places  # (N, 2, 3)
            distances = [_lengths(self.maps(places - anchors[:, i : i + 1])) for i in range(2)]
            apart = _lengths(self.maps(anchors[:, 0] - anchors[:, 1]))
            relation = self.relation(torch.cat([anchors.flatten(1), apart, each[:, 3]], -1))
            hidden = self.relative(torch.cat([places, *distances, mapped], -1)) + relation.unsqueeze(1)
            logits.append(scores[..., 0] + self.score(F.relu(hidden)).squeeze(-1))
        return logits

    def context(self, places: Tensor, tip: Tensor) -> Tensor:
        """Return what the actor is given (N, outputs) of places (N, choices, 3), in `UNIT`.

        The places, their offsets from the gripper, and the target's from the referent, each offset clipped twice:
        grasping and releasing need centimetres.
        """
        metres = places * UNIT + self.middle
        offsets = [*(metres - tip.unsqueeze(1)).unbind(1), *(metres[:, 1:] - metres[:, :-1]).unbind(1)]
        clipped = [(offset / reach).clamp(-1.0, 1.0) for offset in offsets for reach in REACHES]
        return torch.cat([(places * UNIT * self.objects.gain[:3]).flatten(1), *clipped], -1)

    def units(self, places: Tensor) -> Tensor:
        """Return places (..., 3), metres, as the network has them."""
        return (places - self.middle) / UNIT

    def keep_mean(self, frames: TensorDictBase) -> None:
        """Do nothing: the place of the likeliest cells is what the actor is given in training, too."""

    select_likeliest = select_labelled = keep_mean

    def write_obstacle(self, frames: TensorDictBase, referent: Tensor) -> None:
        """Do nothing: no object rows are observed."""


def chosen_place(logits: Tensor, places: Tensor) -> Tensor:
    """Return the place (N, 3) of the likeliest of T cells: the mean of those cells that show the same thing.

    logits: (N, T). places: (N, T, 3), in `UNIT`. A mean of two things is a place of neither.
    """
    likeliest = logits.argmax(1)
    middle = places.gather(1, likeliest[:, None, None].expand(-1, 1, 3))
    same = (places - middle).square().sum(-1) <= (SAME / UNIT) ** 2
    weights = logits.masked_fill(~same, -torch.inf).softmax(1)
    return (weights.unsqueeze(1) @ places).squeeze(1)


def _convolutions(channels: Sequence[int]) -> nn.Sequential:
    """Return the layers from pictures and their two axes to cells: the first two halve the size."""
    layers: list[nn.Module] = []
    for index, (before, after) in enumerate(pairwise([5, *channels])):
        kernel, stride = (5 if index == 0 else 3), (2 if index < 2 else 1)
        layers += [nn.Conv2d(before, after, kernel, stride, kernel // 2), nn.ReLU()]
    return nn.Sequential(*layers[:-1])


def _lengths(vectors: Tensor) -> Tensor:
    """Return the length (..., MAPS) of each three of (..., 3 * MAPS)."""
    return (vectors.unflatten(-1, (MAPS, 3)).square().sum(-1) + 1e-6).sqrt()
