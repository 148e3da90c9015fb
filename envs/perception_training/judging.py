"""How well scenes are seen: what the detector tells beside what is there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from envs.perception.assignment import assignment
from envs.perception.detections import Detections
from envs.perception_training.scenes import LABEL, SEEN

Array = NDArray[np.float64]
NEAR = 0.05  # metres within which a finding may be of a thing


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """The comparison of many scenes.

    errors: (P,) metres, of things that were found. nouns, colors, targets: (P,) bool, which of those were told right.
    yaws: (Q,) radians, of cubes and devices. shares: (R,) of devices and fittings. missed, invented: counts.
    things: how many were to be seen.
    """

    errors: Array
    nouns: NDArray[np.bool_]
    colors: NDArray[np.bool_]
    targets: NDArray[np.bool_]
    missed: int
    invented: int
    things: int
    missed_nouns: tuple[int, ...] = ()

    def summary(self) -> dict[str, float]:
        """Return the figures by name; places in millimetres, the rest as shares."""
        return {
            "things": self.things,
            "median_mm": 1000 * float(np.median(self.errors)),
            "p95_mm": 1000 * float(np.quantile(self.errors, 0.95)),
            "noun": float(self.nouns.mean()),
            "color": float(self.colors.mean()),
            "target": float(self.targets.mean()),
            "missed": self.missed / self.things,
            "invented": self.invented / self.things,
        }


def judge(found: Sequence[Detections], labels: Sequence[Array], positions: Sequence[Array]) -> Judgement:
    """Compare what was found in scenes with what is there.

    Args:
        found: of each scene.
        labels: of each scene, (V, THINGS, len(LABEL)) of its V views. A thing counts if any view shows it.
        positions: of each scene, (THINGS, 3) metres.
    """
    state = LABEL.index("state")
    parts: list[tuple[float, bool, bool, bool]] = []
    missed, invented, things = 0, 0, 0
    lost: list[int] = []
    for one, label, place in zip(found, labels, positions, strict=True):
        seen = (label[..., state] == SEEN).any(0)
        there = (label[..., state] != 0).any(0)
        gap = np.linalg.norm(one.positions[:, None] - place[None], axis=-1)
        rows, columns = assignment(np.where(there[None], np.minimum(gap, 1.0), 2.0))
        pairs = [(i, k) for i, k in zip(rows, columns, strict=True) if there[k] and gap[i, k] < NEAR]
        known = {k for _, k in pairs}
        things += int(seen.sum())
        lost += [int(label[0, k, LABEL.index("noun")]) for k in np.flatnonzero(seen) if k not in known]
        missed = len(lost)
        invented += len(one) - len(pairs)
        for i, k in pairs:
            if seen[k]:
                noun, color, target = (label[0, k, LABEL.index(name)] for name in ("noun", "color", "target"))
                told = one.nouns[i].argmax() == noun, one.colors[i].argmax() == color, (one.targets[i] > 0.5) == target
                parts.append((gap[i, k], *(bool(each) for each in told)))
    table = np.array(parts, float).reshape(-1, 4)
    return Judgement(
        errors=table[:, 0],
        nouns=table[:, 1] > 0,
        colors=table[:, 2] > 0,
        targets=table[:, 3] > 0,
        missed=missed,
        invented=invented,
        things=things,
        missed_nouns=tuple(lost),
    )
