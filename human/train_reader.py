"""Learning to read rays: from frames that a `Studio` has drawn to a network, and how far off its rays are."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.random import Generator
from numpy.typing import NDArray
from torch import Tensor

from human.pointing_ik import Array
from human.ray_reader import RayNetwork, as_input
from human.synthetic_frames import LabelledFrames

REACH = 0.6  # metres from the fingertip to what is pointed at, at which an error of the direction is weighed
BATCH = 64
RATE = 3e-3


def fit(frames: LabelledFrames, epochs: int, seed: int, trial: LabelledFrames | None = None) -> RayNetwork:
    """A network that has learned these frames. trial: others, to print how well it reads them."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = RayNetwork(frames.pictures.shape[1], frames.tips.mean(0))
    rng, chance = np.random.default_rng(seed), torch.Generator().manual_seed(seed)
    steps = epochs * max(1, len(frames.tips) // BATCH)
    optimizer = torch.optim.AdamW(network.parameters(), RATE, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, RATE, total_steps=steps, pct_start=0.15)
    for epoch in range(epochs):
        loss = _epoch(network.train(), frames, rng, chance, optimizer, schedule)
        print(f"epoch {epoch + 1}/{epochs}: loss {loss:.4f} m{_tried(network.eval(), trial)}", flush=True)
    return network.eval()


def _epoch(
    network: RayNetwork, frames: LabelledFrames, rng: Generator, chance: torch.Generator, optimizer: Any, schedule: Any
) -> float:
    """Learn once from every frame; returns the loss on average."""
    order, losses = rng.permutation(len(frames.tips)), []
    for batch in np.split(order, range(BATCH, len(order) - BATCH + 1, BATCH)):
        pictures = vary_exposure(as_input(frames.pictures[batch]), chance)
        loss = ray_loss(network(pictures), frames, batch)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
        losses.append(loss.item())
    return float(np.mean(losses))


def vary_exposure(pictures: Tensor, chance: torch.Generator) -> Tensor:
    """The pictures (M, 3, H, W) as another exposure by a noisy sensor would have them."""
    m = len(pictures)
    gain = (0.8 + 0.4 * torch.rand(m, 1, 1, 1, generator=chance)) * (
        0.93 + 0.14 * torch.rand(m, 3, 1, 1, generator=chance)
    )
    noise = torch.randn(pictures.shape, generator=chance) * 0.025 * torch.rand(m, 1, 1, 1, generator=chance)
    return (pictures * gain + noise).clamp_(0, 1)


def ray_loss(seen: tuple[Tensor, Tensor], frames: LabelledFrames, picked: NDArray[np.int64]) -> Tensor:
    """Metres: how far off the fingertips are, and how far off the directions lead at REACH from there."""
    tips, directions = (torch.from_numpy(each[picked]).float() for each in (frames.tips, frames.directions))
    return ((seen[0] - tips).norm(dim=1) + REACH * (seen[1] - directions).norm(dim=1)).mean()


@torch.no_grad()
def _tried(network: RayNetwork, trial: LabelledFrames | None) -> str:
    if trial is None:
        return ""
    parts = [network(as_input(part)) for part in np.array_split(trial.pictures, 8)]
    tips, directions = (torch.cat(each).numpy().astype(np.float64) for each in zip(*parts, strict=True))
    return "; people not learned from: " + error_summary(tips, directions, trial.tips, trial.directions)


def error_summary(tips: Array, directions: Array, true_tips: Array, true_directions: Array) -> str:
    """How far off rays (N, 3) are, in words."""
    angle, off = angles_between(directions, true_directions), 100 * np.linalg.norm(tips - true_tips, axis=1)
    return (
        f"direction {np.median(angle):.2f} degrees off (90 %: {np.quantile(angle, 0.9):.2f}), "
        f"fingertip {np.median(off):.2f} cm (90 %: {np.quantile(off, 0.9):.2f})"
    )


def angles_between(one: Array, other: Array) -> Array:
    """(N,) degrees between unit vectors (N, 3)."""
    return np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(one - other, axis=1) / 2, 0, 1)))
