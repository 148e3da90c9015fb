"""Imitation of an expert by a policy that sees pictures: DAgger, and what the simulator teaches about pictures.

Each gradient step takes frames that were collected and scenes that were only drawn. Their pictures teach which cells
show a thing and where it stands, the words which of them they mean. The actor learns the expert's move at the places
that the network sees, and at the true places with noise, which needs no pictures and so takes many more frames.
"""

from __future__ import annotations

import math

import torch
import torch.nn.functional as F
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.data import LazyTensorStorage, ReplayBuffer, TensorDictReplayBuffer

from trainers.algorithms.algorithm import GROUNDING_METRICS, descend
from trainers.algorithms.bc import BC, FULL, WIDTH, preimage
from trainers.algorithms.settings import BCConfig
from trainers.models.grounding import REFERENT, TARGET
from trainers.models.pixels import TIP, Cells, PictureEncoder, chosen_place
from trainers.models.policy import PIXELS, Policy, expert_move, parameters

SEEN_AT = ("privileged", "seen_at")
PLACE_NOISE = 0.005  # metres: the standard deviation of true places that the actor learns from
LABELLED, STEPS = 256, 4  # frames of a gradient step of the actor alone, and such steps for each one with pictures
PRESENT = 8.0  # weight of a cell that shows a thing, of which there are few
UNSEEN = -12.0  # the logit of what is in none of the cells that take part
WEIGHTS = {"loss/cells": 2.0, "loss/places": 1.0, "loss/rows": 0.5}


class PictureBC(BC):
    """`BC` for a policy with a `PictureEncoder`."""

    metrics = ("loss/imitation", *WEIGHTS, *GROUNDING_METRICS, "expert_share", "updates", "lr")

    def __init__(self, config: BCConfig, policy: Policy) -> None:
        super().__init__(config, policy)
        assert isinstance(policy.encoder, PictureEncoder)
        self.encoder = policy.encoder
        self.groups = parameters(policy.encoder), parameters(policy.actor)
        self.labels = [REFERENT, TARGET][: self.encoder.choices]
        self.scenes = TensorDictReplayBuffer(storage=LazyTensorStorage(config.grounding_memory, device=self.device))
        self.taught = ["instruction", PIXELS, TIP, "objects", "objects_mask", SEEN_AT, *self.labels]

    @property
    def scenes_per_update(self) -> int:
        return self.config.grounding_scenes if self.config.grounding_weight > 0 else 0

    def add_scenes(self, scenes: TensorDictBase) -> None:
        """Keep drawn scenes (count,), each with several sentences."""
        self.scenes.extend(scenes.select(*self.taught))

    @property
    def memories(self) -> dict[str, ReplayBuffer]:
        return super().memories | {"scenes": self.scenes}

    def labelled(self, frames: TensorDictBase) -> TensorDictBase:
        """Return what is kept of frames (B,): inputs, the expert's "move", and what the simulator teaches."""
        kept = frames.select(*self.policy.actor_keys, *self.taught)
        return kept.set("move", expert_move(frames, self.policy))

    def learn(self, steps: int) -> list[dict[str, Tensor]]:
        """Take gradient steps."""
        if not steps:
            return []
        frames = self.frames.sample(steps * self.config.batch)
        known = frames.exclude(PIXELS)
        measured = []
        for part in frames.split(self.config.batch):
            scenes = self.scenes.sample(self.config.grounding_batch) if len(self.scenes) else None
            measured.append(self.picture_step(part, scenes))
            for _ in range(STEPS):
                self.actor_step(known[torch.randint(len(known), (LABELLED,), device=self.device)])
        return measured

    def picture_step(self, frames: TensorDictBase, scenes: TensorDictBase | None) -> dict[str, Tensor]:
        """One gradient step on frames (B,) and on scenes (G,) with S sentences each; None: none were drawn."""
        places, measured = self.teach(frames)
        rows = [measured]
        if scenes is not None:
            rows.append(self.teach(scenes)[1])
        measured = {name: torch.stack([row[name] for row in rows]).mean() for name in measured}
        imitation = self.imitate(frames, places)
        loss = imitation + sum(weight * measured[name] for name, weight in WEIGHTS.items())
        loss = loss + self.config.grounding_weight * measured["loss/grounding"]
        descend(self.optimizer, loss, frames, self.config.max_grad_norm, *self.groups)
        return {name: value.detach() for name, value in ({"loss/imitation": imitation} | measured).items()}

    def actor_step(self, frames: TensorDictBase) -> None:
        """One gradient step of the actor, on frames (B,) at the true places with noise."""
        places = self.labelled_places(frames)
        places = self.encoder.units(places + PLACE_NOISE * torch.randn_like(places))
        descend(self.optimizer, self.imitate(frames, places), frames, self.config.max_grad_norm, self.groups[1])

    def imitate(self, frames: TensorDictBase, places: Tensor) -> Tensor:
        """Return the loss of the moves in frames (B,) with the referent, and target, at places (B, choices, 3)."""
        context = self.encoder.context(places, frames[TIP])
        move, _ = self.policy.move_parameters(frames.set(self.policy.context_key, context))
        return F.smooth_l1_loss(preimage(move), preimage(FULL * frames["move"]), beta=WIDTH)

    def teach(self, frames: TensorDictBase) -> tuple[Tensor, dict[str, Tensor]]:
        """Return the places (B * S, choices, 3) that the words mean, and the losses of what the pictures show.

        frames: (B,), with one sentence, or S of them.
        """
        seen = self.encoder.see(frames[PIXELS], frames[TIP])
        cells, inside = self.cells(frames)
        measured = self.cell_losses(seen, frames, cells, inside)
        kept = self.encoder.likeliest(seen)
        instruction = frames["instruction"]
        sentences = instruction.shape[1] if instruction.dim() > 2 else 1
        few = seen.select(kept)
        where_seen = self.encoder.place(few.features).repeat_interleave(sentences, 0)
        words = self.encoder.encode_words(instruction.flatten(0, -2))
        logits = self.encoder.attention_logits(words, few.repeat(sentences), where_seen)
        number = torch.full_like(seen.presence, kept.shape[1], dtype=torch.int64)
        number.scatter_(1, kept, torch.arange(kept.shape[1], device=kept.device).expand(len(kept), -1))
        losses, right, places = [], [], []
        for each, key in zip(logits, self.labels, strict=True):
            slots = frames[key].reshape(-1)
            where = torch.arange(len(frames), device=slots.device).repeat_interleave(sentences)
            meant = number[where.unsqueeze(1), cells[where, slots]]  # (B * S, C)
            log = F.pad(each.log_softmax(1), (0, 1), value=UNSEEN)
            log = log.gather(1, meant).masked_fill(~inside[where, slots], UNSEEN)
            losses.append(-log.logsumexp(1).mean())
            places.append(chosen_place(each, where_seen))
            right.append(self.nearest(frames, where, places[-1]) == slots)
        measured["loss/grounding"] = torch.stack(losses).sum()
        measured["grounding/accuracy"] = torch.stack(right).all(0).float().mean()
        return torch.stack(places, 1), measured

    def cells(self, frames: TensorDictBase) -> tuple[Tensor, Tensor]:
        """Return the cell of each slot's object in each picture, (B, K, C), and whether there is one."""
        seen_at, side = frames[SEEN_AT], self.encoder.side
        inside = ((seen_at >= 0) & (seen_at < 1)).all(-1) & frames["objects_mask"].unsqueeze(-1)
        column, row = (seen_at.clamp(0, 1) * side).long().clamp(max=side - 1).unbind(-1)
        first = torch.arange(seen_at.shape[2], device=seen_at.device) * side**2
        return first + row * side + column, inside

    def cell_losses(self, seen: Cells, frames: TensorDictBase, cells: Tensor, inside: Tensor) -> dict[str, Tensor]:
        """Return the losses of which cells show a thing, of its place and of its row."""
        where = torch.arange(len(frames), device=cells.device)[:, None, None].expand_as(cells)[inside]
        shown = torch.zeros_like(seen.presence)
        shown[where, cells[inside]] = 1.0
        weight = shown.new_tensor(PRESENT)
        features, rows = seen.features[where, cells[inside]], frames["objects"].unsqueeze(2)
        rows = rows.expand(-1, -1, cells.shape[2], -1)[inside]
        places = self.encoder.units(rows[:, :3])
        return {
            "loss/cells": F.binary_cross_entropy_with_logits(seen.presence, shown, pos_weight=weight),
            "loss/places": _sum_of_errors(self.encoder.place(features), places),
            "loss/rows": _sum_of_errors(self.encoder.row(features), self.encoder.objects(rows), beta=1.0),
        }

    def nearest(self, frames: TensorDictBase, where: Tensor, places: Tensor) -> Tensor:
        """Return the slot (M,) whose object is nearest to each place (M, 3). where: (M,) indices of frames (B,)."""
        away = (self.encoder.units(frames["objects"][where][..., :3]) - places.detach().unsqueeze(1)).norm(dim=-1)
        return away.masked_fill(~frames["objects_mask"][where], math.inf).argmin(1)

    def labelled_places(self, frames: TensorDictBase) -> Tensor:
        """Return the places (B, choices, 3), metres, of the referent and, where there are targets, the target."""
        slots = torch.stack([frames[key] for key in self.labels], 1)
        places = frames["objects"][..., :3]
        return places.gather(1, slots.unsqueeze(-1).expand(-1, -1, 3))


def _sum_of_errors(given: Tensor, wanted: Tensor, beta: float = 0.05) -> Tensor:
    """Return the mean over rows (M, D) of the sum of their errors, which are quadratic below `beta`."""
    return F.smooth_l1_loss(given, wanted, beta=beta, reduction="none").sum(-1).mean()
