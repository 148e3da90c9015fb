"""Which object do the words mean? Tokens ask, object slots answer.

Attention over object slots with queries from language follows the neural module networks of Andreas et al. 2016
and the two hops ("left of *that*") of end-to-end memory networks, Sukhbaatar et al. 2015.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from tensordict import TensorDictBase
from torch import Tensor, nn
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer

from trainers.networks import Normalise, mlp

SEEN = ["objects", "objects_mask", "instruction"]
REFERENT = ("privileged", "referent")
FAR = -1e9  # the logit of what is not there: finite, so that an empty sentence or scene gives no NaN


class Asker(nn.Module):
    """An instruction (N, L) int64, 0 = pad, to three queries (N, 3, E): the referent, its anchor, the relation."""

    hash: Tensor

    def __init__(self, vocabulary: int, length: int, width: int) -> None:
        super().__init__()
        self.embed = nn.Embedding(vocabulary, width, padding_idx=0)
        self.place = nn.Parameter(0.1 * torch.randn(length, width))
        self.near = nn.ModuleList(nn.Linear(3 * width, width) for _ in range(2))
        self.roles = nn.Linear(width, 3)
        self.register_buffer("hash", torch.randint(2**62, (length,), generator=torch.Generator().manual_seed(1)))

    def forward(self, tokens: Tensor) -> Tensor:
        # One episode says the same words at every step, so a training batch holds few sentences many times over.
        if len(tokens) <= 64:
            return self.encode(tokens)
        _, copy = torch.unique((tokens * self.hash).sum(-1), return_inverse=True)
        first = copy.new_empty(int(copy.max()) + 1).scatter_(0, copy, torch.arange(len(copy), device=copy.device))
        return self.encode(tokens[first])[copy]

    def encode(self, tokens: Tensor) -> Tensor:
        said = (tokens != 0).unsqueeze(-1)
        x = (self.embed(tokens) + self.place) * said
        for near in self.near:
            # A convolution of width 3, written as one product: PyTorch's own takes 3 times as long at these sizes.
            before, after = F.pad(x, (0, 0, 1, 0))[:, :-1], F.pad(x, (0, 0, 0, 1))[:, 1:]
            x = x + F.relu(near(torch.cat([before, x, after], -1))) * said
        heed = self.roles(x).masked_fill(~said, FAR).softmax(1)
        return heed.transpose(1, 2) @ x


class Grounder(nn.Module):
    """objects (N, K, D), mask (N, K), instruction (N, L) to attention logits (N, K) and the referent's row (N, D).

    The referent is the attention-weighted sum of the normalised rows, so the arm's part of the network has the same
    input whatever the number of objects, and never sees a word.
    """

    writes = ("attention_logits", "referent")

    def __init__(self, objects: Normalise, vocabulary: int, length: int, embedding: int, width: int) -> None:
        super().__init__()
        row = objects.shape[-1]
        self.objects, self.outputs = objects, row
        self.ask = Asker(vocabulary, length, embedding)
        self.slot = mlp(row, [width], width)
        self.linear = nn.Linear(row, width)  # positions pass unbent, so that "left of" is one subtraction away
        self.match = nn.Linear(embedding, width)
        self.relate = mlp(3 * width + embedding, [width], 1)
        self.scale = width**-0.5

    def forward(self, objects: Tensor, mask: Tensor, instruction: Tensor) -> tuple[Tensor, ...]:
        return self.point(objects, mask, self.ask(instruction))

    def point(self, objects: Tensor, mask: Tensor, asked: Tensor) -> tuple[Tensor, ...]:
        """The same, of queries (N, 3, E) that `ask` has made of the words."""
        rows = self.objects(objects)
        referent, anchor, relation = asked.unbind(1)
        slots = self.slot(rows) + self.linear(rows)
        keys = self.match(torch.stack([referent, anchor], 1))
        scores = (slots @ keys.transpose(1, 2) * self.scale).masked_fill(~mask.unsqueeze(-1), FAR)
        that = scores[..., 1].softmax(-1).unsqueeze(1) @ slots
        that = that.expand_as(slots)
        how = relation.unsqueeze(1).expand(-1, slots.shape[1], -1)
        logits = scores[..., 0] + self.relate(torch.cat([slots, that, slots - that, how], -1)).squeeze(-1)
        logits = logits.masked_fill(~mask, FAR)
        return logits, (logits.softmax(-1).unsqueeze(1) @ rows).squeeze(1)


class Flattener(nn.Module):
    """The same inputs to one flat row (N, F): normalised objects, mask and the mean embedding of the words."""

    writes = ("scene",)

    def __init__(self, objects: Normalise, slots: int, vocabulary: int, embedding: int) -> None:
        super().__init__()
        self.objects = objects
        self.ask = nn.EmbeddingBag(vocabulary, embedding, mode="mean", padding_idx=0)
        self.outputs = slots * (objects.shape[-1] + 1) + embedding

    def forward(self, objects: Tensor, mask: Tensor, instruction: Tensor) -> tuple[Tensor, ...]:
        return self.point(objects, mask, self.ask(instruction))

    def point(self, objects: Tensor, mask: Tensor, asked: Tensor) -> tuple[Tensor, ...]:
        """The same, of the embedding (N, E) that `ask` has made of the words."""
        there = mask.to(objects.dtype)
        rows = self.objects(objects) * there.unsqueeze(-1)
        return (torch.cat([rows.flatten(1), there, asked], -1),)


class Scenes:
    """What was said in which scene, one row an episode begun, kept for the whole run.

    A batch of PPO holds a hundred or two scenes, each at many steps, and is forgotten: relations learned from that
    alone reached 92 % of fresh sentences. Drawn from all scenes met so far they reach more than 99 %.
    """

    def __init__(self, capacity: int, device: torch.device) -> None:
        self.memory = TensorDictReplayBuffer(storage=LazyTensorStorage(capacity, device=device))

    def remember(self, batch: TensorDictBase) -> TensorDictBase:
        """Keep the scenes that begin in a batch (worlds, steps), or that it begins with, and return them."""
        begins = torch.ones(batch.shape, dtype=torch.bool)
        begins[:, 1:] = batch["next", "done"][:, :-1, 0].cpu()
        scenes = batch.select(*SEEN, REFERENT)[begins]
        self.memory.extend(scenes)
        return scenes

    def sample(self, count: int) -> TensorDictBase:
        """Scenes (count,) drawn evenly, with replacement."""
        return self.memory.sample(count)


def grounding(batch: TensorDictBase) -> tuple[Tensor, Tensor]:
    """Cross-entropy of the attention against the true referent, and its accuracy, scalars.

    batch: 1-D, with attention_logits (N, K), from a policy that `attends`, and privileged/referent (N,).
    """
    logits, referent = batch["attention_logits"], batch[REFERENT]
    return F.cross_entropy(logits, referent), (logits.argmax(-1) == referent).float().mean()
