"""Grounding: which object slot the words and the ray mean, by attention over the slots.

instruction ─► queries ─┐
objects, mask, ray ─────┴─► logits of the slots ─► the referent's row
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import torch
import torch.nn.functional as F
from tensordict import NestedKey, TensorDictBase
from torch import Tensor, nn

from trainers.models.networks import Normalise, mlp

QUERIES = 4  # for each choice: the object, its two anchors, and the relation
UNIQUE_ABOVE = 64  # sentences; larger batches are searched for repetitions
SCENE_KEYS = ("objects", "objects_mask")
GESTURE = "gesture"
NEAR, OBSTACLE = "objects_near", "obstacle"
RAY_FEATURES = 5  # numbers that describe an object's position relative to a ray
REFERENT, TARGET, VERB = ("privileged", "referent"), ("privileged", "target"), ("privileged", "verb")
SLOTS = {"attention_logits": REFERENT, "target_logits": TARGET}  # the attention, and the slot that it should choose
VERB_LOGITS = "verb_logits"
LABELS = SLOTS | {VERB_LOGITS: VERB}
MAPS = 4  # linear maps of a position to three numbers; with 8 of them, accuracy on fresh scenes was lower
MASKED = -1e9  # the logit of an absent slot: finite, so that an empty sentence or scene gives no NaN


class QueryEncoder(nn.Module):
    """An instruction (N, L) int64, 0 = pad, to queries (N, Q, E): Q = 4 * choices, and one more for the verb.

    choices: how many objects the words name: the referent and, if it is to be brought somewhere, its target.
    reads_verb: whether the last query is for the verb.
    """

    hash_weights: Tensor

    def __init__(
        self, word_embedding: nn.Module, *, length: int, width: int, choices: int = 1, reads_verb: bool = False
    ) -> None:
        super().__init__()
        self.word_embedding = word_embedding  # (N, L) to (N, L, E)
        self.positions = nn.Parameter(0.1 * torch.randn(length, width))
        self.convolutions = nn.ModuleList(nn.Linear(3 * width, width) for _ in range(2))
        queries = QUERIES * choices + reads_verb
        self.roles = nn.Linear(width, queries)
        # Referent and target differ even if the words describe neither: one can be moved, the other marks a place.
        self.base_queries = nn.Parameter(0.1 * torch.randn(queries, width)) if choices > 1 else None
        generator = torch.Generator().manual_seed(1)
        self.register_buffer("hash_weights", torch.randint(2**62, (length,), generator=generator))

    def forward(self, tokens: Tensor) -> Tensor:
        # The words are the same at every step of an episode, so a training batch repeats few sentences many times.
        if len(tokens) <= UNIQUE_ABOVE:
            return self.encode(tokens)
        _, copy = torch.unique((tokens * self.hash_weights).sum(-1), return_inverse=True)
        first = copy.new_empty(int(copy.max()) + 1).scatter_(0, copy, torch.arange(len(copy), device=copy.device))
        return self.encode(tokens[first])[copy]

    def encode(self, tokens: Tensor) -> Tensor:
        """Return queries, without the search for repetitions.

        Which words belong to which query depends on the whole sentence; their content depends on each word alone. So a
        known word means the same beside an unknown one, and pairs of words that were never trained together have the
        meaning of their parts: 98 % accuracy on such pairs in fresh scenes, against 97 % with queries of mixed words.
        """
        present = (tokens != 0).unsqueeze(-1)
        words = self.word_embedding(tokens) * present
        x = words + self.positions * present
        for convolution in self.convolutions:
            # A convolution of width 3, written as one product: PyTorch's own takes 3 times as long at these sizes.
            before, after = F.pad(x, (0, 0, 1, 0))[:, :-1], F.pad(x, (0, 0, 0, 1))[:, 1:]
            x = x + F.relu(convolution(torch.cat([before, x, after], -1))) * present
        weights = self.roles(x).sigmoid() * present
        queries = weights.transpose(1, 2) @ words
        return queries if self.base_queries is None else queries + self.base_queries


class GroundingEncoder(nn.Module):
    """Instruction (N, L) and scene to attention logits (N, K) and the referent's row (N, D).

    The scene is objects (N, K, D), mask (N, K), where a person points gesture (N, 7), and further observations, which
    add columns to the rows; `scene_keys` has their keys. D counts these columns too.
    With two choices (referent and target) there are two logits, and the two rows are concatenated, (N, 2 * D). Where
    the words name one of V verbs, there are logits (N, V) of them too, and their probabilities follow the rows.

    A slot's logit has four parts:

    * how well its row matches the words for the referent;
    * its position relative to the two anchors that the words attend to ("left of *that*", "between *that* and *that*");
    * its position relative to the ray of the finger;
    * its comparison with every other slot that fits so far ("leftmost", "nearest to *that*").

    The referent is the attention-weighted sum of the normalised rows, so the actor has the same input whatever the
    number of objects, and never sees a word.

    Args:
        objects: normalises object rows.
        word_embedding: tokens (N, L) to (N, L, E).
        length: L.
        embedding: E.
        width: features of a slot.
        reads_gesture: whether the scene has a gesture.
        choices: 1, or 2 where the words name a target as well.
        observes_obstacles: whether to write the nearest obstacle as well, from objects_near (N, K).
        verbs: V; 0 if there is only one verb.
        further: by key, normalises an observation (N, K, F), or (N, F), which is repeated in each row.
    """

    def __init__(
        self,
        objects: Normalise,
        word_embedding: nn.Module,
        *,
        length: int,
        embedding: int,
        width: int,
        reads_gesture: bool = False,
        choices: int = 1,
        observes_obstacles: bool = False,
        verbs: int = 0,
        further: Mapping[NestedKey, Normalise] | None = None,
    ) -> None:
        super().__init__()
        self.further_keys, self.further = tuple(further or ()), nn.ModuleList((further or {}).values())
        self.scene_keys = (*SCENE_KEYS, *(GESTURE,) * reads_gesture, *self.further_keys)
        self.observes_obstacles = observes_obstacles
        self.slot_keys, self.verbs = tuple(SLOTS)[:choices], verbs
        self.logit_keys = (*self.slot_keys, VERB_LOGITS) if verbs else self.slot_keys
        self.out_keys = (*self.logit_keys, "referent")
        row = objects.shape[-1] + sum(each.shape[-1] for each in (further or {}).values())
        self.normalise, self.outputs = objects, row * choices + verbs
        self.obstacle_width = (row + 1) * observes_obstacles
        self.query_encoder = QueryEncoder(
            word_embedding, length=length, width=embedding, choices=choices, reads_verb=verbs > 0
        )
        self.verb_scorer = nn.Linear(embedding, verbs) if verbs else None
        self.slot_mlp = mlp(row, [width], width)
        self.slot_linear = nn.Linear(row, width)
        self.query_projection = nn.Linear(embedding, width)
        self.scale = width**-0.5
        # A row begins with its position (m). Given the whole row, the network first has to find out that colours are
        # not positions: accuracy on fresh scenes was then 85 instead of 97 % after 1000 steps.
        self.position_maps = nn.Linear(3, 3 * MAPS, bias=False)
        self.origin = nn.Parameter(torch.zeros(3 * MAPS))  # "nearest" has no anchor: distances are taken from here
        self.relation_scorer = mlp(9 * MAPS + 4 * MAPS + embedding, [width], 1)
        self.comparison_scorer = mlp(6 * MAPS + embedding, [width // 2], 1)
        # Linear from the ray to the logit: the likeliest object is a linear function of these numbers.
        self.ray_weights = nn.Linear(embedding, RAY_FEATURES) if reads_gesture else None

    def forward(self, instruction: Tensor, *scene: Tensor) -> tuple[Tensor, ...]:
        return self.attend(self.encode_words(instruction), *scene)

    def encode_words(self, instruction: Tensor) -> Tensor:
        """Return the queries (N, Q, E) of tokens (N, L)."""
        return self.query_encoder(instruction)

    def encode_all_words(self, instruction: Tensor) -> Tensor:
        """`encode_words` without the search for repetitions, which no exported file can express."""
        return self.query_encoder.encode(instruction)

    def attend(self, queries: Tensor, objects: Tensor, mask: Tensor, *more: Tensor) -> tuple[Tensor, ...]:
        """`forward`, given the queries (N, Q, E) of `encode_words`."""
        gesture = None if self.ray_weights is None else more[0]
        rows = self.rows(objects, *more[len(more) - len(self.further) :])
        slots = self.slot_mlp(rows) + self.slot_linear(rows)
        logits = [
            self._attention_logits(each, rows, slots, objects, mask, gesture)
            for each in queries[:, : QUERIES * len(self.slot_keys)].split(QUERIES, dim=1)
        ]
        context = [(each.softmax(-1).unsqueeze(1) @ rows).squeeze(1) for each in logits]
        if self.verb_scorer is not None:
            logits.append(self.verb_scorer(queries[:, -1]))
            context.append(logits[-1].softmax(-1))
        return *logits, torch.cat(context, -1)

    def rows(self, objects: Tensor, *further: Tensor) -> Tensor:
        """Return the normalised rows (N, K, D) of objects (N, K, ...), with the columns of further observations."""
        rows = self.normalise(objects)
        if not further:
            return rows
        columns = [normalise(value) for normalise, value in zip(self.further, further, strict=True)]
        repeated = (each if each.dim() == rows.dim() else each.unsqueeze(1) for each in columns)
        return torch.cat([rows, *(each.expand(*rows.shape[:2], -1) for each in repeated)], -1)

    def rows_of(self, frames: TensorDictBase) -> Tensor:
        """Return the rows (N, K, D) of frames (N,)."""
        return self.rows(frames["objects"], *(frames[key] for key in self.further_keys))

    def _attention_logits(
        self, queries: Tensor, rows: Tensor, slots: Tensor, objects: Tensor, mask: Tensor, gesture: Tensor | None
    ) -> Tensor:
        """Return attention logits (N, K) of one choice's queries (N, 4, E), given the features of the slots."""
        scores = slots @ self.query_projection(queries[:, :3]).transpose(1, 2) * self.scale
        scores = scores.masked_fill(~mask.unsqueeze(-1), MASKED)
        positions = self.position_maps(rows[..., :3])
        anchors = scores[..., 1:].softmax(1).transpose(1, 2) @ positions  # (N, 2, 3 * MAPS)
        relation = queries[:, 3].unsqueeze(1).expand(-1, rows.shape[1], -1)
        first, second = positions - anchors[:, :1], positions - anchors[:, 1:]
        distances = _lengths(first), _lengths(second), _lengths(positions + self.origin)
        between = _lengths(first - second)
        relative = torch.cat([positions, first, second, *distances[:2], between, distances[2], relation], -1)
        fits = scores[..., 0] + self.relation_scorer(relative).squeeze(-1)
        if self.ray_weights is not None and gesture is not None:
            weights = self.ray_weights(queries[:, 3]).unsqueeze(1)
            fits = fits + (ray_features(objects[..., :3], gesture) * weights).sum(-1)
        fits = fits.masked_fill(~mask, MASKED)
        lead = self._pairwise_lead(torch.cat([positions, *distances], -1), relation)
        logits = fits + (lead * fits.sigmoid().unsqueeze(1)).sum(-1)
        return logits.masked_fill(~mask, MASKED)

    def _pairwise_lead(self, features: Tensor, relation: Tensor) -> Tensor:
        """Return (N, K, K): how far each slot (N, K, F) exceeds each other one, as relation (N, K, E) compares."""
        difference = features.unsqueeze(2) - features.unsqueeze(1)
        relation = relation.unsqueeze(2).expand(-1, -1, features.shape[1], -1)
        return self.comparison_scorer(torch.cat([difference, relation], -1)).squeeze(-1)

    def keep_mean(self, frames: TensorDictBase) -> None:
        """Keep the attention-weighted rows of encoded frames, and write the obstacle."""
        self.write_obstacle(frames, frames[self.logit_keys[0]].argmax(-1))

    def select_likeliest(self, frames: TensorDictBase) -> None:
        """Replace the attention-weighted rows by the likeliest slot's, verbs by the likeliest, and write the obstacle.

        A mean of two objects is a position at neither.
        """
        self._select(frames, [frames[key].argmax(-1) for key in self.logit_keys])

    def select_labelled(self, frames: TensorDictBase) -> None:
        """Write the rows of the labelled slots, the labelled verb and the obstacle; the words are not read."""
        self._select(frames, [frames[LABELS[key]] for key in self.logit_keys])

    def _select(self, frames: TensorDictBase, chosen: Sequence[Tensor]) -> None:
        """chosen: (N,) for each of the logits."""
        rows = self.rows_of(frames)
        each = torch.arange(rows.shape[0], device=rows.device)
        context = [rows[each, slot] for slot in chosen[: len(self.slot_keys)]]
        if self.verbs:
            context.append(F.one_hot(chosen[-1], self.verbs).to(rows))
        frames.set("referent", torch.cat(context, -1))
        self.write_obstacle(frames, chosen[0])

    def write_obstacle(self, frames: TensorDictBase, referent: Tensor) -> None:
        """Write "obstacle", the row of the nearest object that the arm could hit, other than the referent.

        The row and a 1 after it fade with the distance, so that they do not jump where another one becomes the nearest.
        Does nothing without `observes_obstacles`.

        Args:
            frames: (N,), with objects_near (N, K).
            referent: slots (N,).
        """
        if not self.observes_obstacles:
            return
        near, slot = frames[NEAR].scatter(1, referent.unsqueeze(1), 0.0).max(1, keepdim=True)
        rows = self.rows_of(frames)
        row = rows.gather(1, slot.unsqueeze(-1).expand(-1, 1, rows.shape[-1])).squeeze(1)
        frames.set(OBSTACLE, near * torch.cat([row, torch.ones_like(near)], -1))


def ray_features(positions: Tensor, gesture: Tensor) -> Tensor:
    """Return (N, K, RAY_FEATURES): positions (N, K, 3), metres, relative to the finger's ray (N, 7); 0 without one.

    The angle to the ray and the distance from it, each with its square, and whether it lies behind the fingertip.
    """
    origin, direction, shown = gesture[:, None, :3], gesture[:, None, 3:6], gesture[:, None, 6:]
    offset = positions - origin
    along = (offset * direction).sum(-1, keepdim=True)
    distance = (offset - along * direction).square().sum(-1, keepdim=True).sqrt()
    # In units of 6 degrees and 1 cm: otherwise near ties of two objects are separated too late in training.
    angle, near = 10 * torch.atan2(distance, along), 20 * distance
    squares = (angle.clamp(max=4.0).square(), near.clamp(max=4.0).square())
    return torch.cat([angle, 100 * distance, *squares, (along < 0).to(along)], -1) * shown


def grounding_loss(frames: TensorDictBase) -> tuple[Tensor, Tensor]:
    """Cross-entropy against the labelled slots and verbs, and the share of frames where all are right, scalars.

    frames: 1-D, with the logits (N, K) of a policy that attends, and the labels (N,).
    """
    keys = [key for key in LABELS if key in frames.keys()]
    loss = torch.stack([F.cross_entropy(frames[key], frames[LABELS[key]]) for key in keys]).sum()
    right = torch.stack([frames[key].argmax(-1) == frames[LABELS[key]] for key in keys])
    return loss, right.all(0).float().mean()


def _lengths(positions: Tensor) -> Tensor:
    """Return the length (..., MAPS) of each three of (..., 3 * MAPS)."""
    return (positions.unflatten(-1, (MAPS, 3)).square().sum(-1) + 1e-6).sqrt()  # a finite gradient at 0
