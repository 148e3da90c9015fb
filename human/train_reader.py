"""Training of the ray reader on generated frames, and the errors of its rays."""

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

LEVER = 0.6  # metres from the fingertip to the objects, at which a direction error becomes a distance in the loss
BATCH = 64
LEARNING_RATE = 3e-3


def fit(frames: LabelledFrames, epochs: int, seed: int, validation: LabelledFrames | None = None) -> RayNetwork:
    """Trains a network and prints each epoch's loss.

    Args:
        frames: to learn from.
        epochs: passes over the frames.
        seed: of the initial parameters, the order of frames and the augmentation.
        validation: other frames, whose errors are printed after each epoch.

    Returns:
        The network, in evaluation mode.
    """
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = RayNetwork(frames.pictures.shape[1], frames.tips.mean(0))
    rng, torch_rng = np.random.default_rng(seed), torch.Generator().manual_seed(seed)
    steps = epochs * max(1, len(frames.tips) // BATCH)
    optimizer = torch.optim.AdamW(network.parameters(), LEARNING_RATE, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, LEARNING_RATE, total_steps=steps, pct_start=0.15)
    for epoch in range(epochs):
        loss = _epoch(network.train(), frames, rng, torch_rng, optimizer, schedule)
        summary = _validation_summary(network.eval(), validation)
        print(f"epoch {epoch + 1}/{epochs}: loss {loss:.4f} m{summary}", flush=True)
    return network.eval()


def _epoch(
    network: RayNetwork,
    frames: LabelledFrames,
    rng: Generator,
    torch_rng: torch.Generator,
    optimizer: Any,
    schedule: Any,
) -> float:
    """Learns from every frame once; returns the mean loss."""
    order, losses = rng.permutation(len(frames.tips)), []
    for batch in np.split(order, range(BATCH, len(order) - BATCH + 1, BATCH)):
        pictures = vary_exposure(as_input(frames.pictures[batch]), torch_rng)
        loss = ray_loss(network(pictures), frames, batch)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
        losses.append(loss.item())
    return float(np.mean(losses))


def vary_exposure(pictures: Tensor, generator: torch.Generator) -> Tensor:
    """Returns pictures (M, 3, H, W) with random exposure, white balance and sensor noise (data augmentation)."""
    m = len(pictures)
    gain = (0.8 + 0.4 * torch.rand(m, 1, 1, 1, generator=generator)) * (
        0.93 + 0.14 * torch.rand(m, 3, 1, 1, generator=generator)
    )
    noise = torch.randn(pictures.shape, generator=generator) * 0.025 * torch.rand(m, 1, 1, 1, generator=generator)
    return (pictures * gain + noise).clamp_(0, 1)


def ray_loss(rays: tuple[Tensor, Tensor], frames: LabelledFrames, indices: NDArray[np.int64]) -> Tensor:
    """Returns the loss in metres: the mean error of the fingertips plus that of the directions at LEVER from there.

    Args:
        rays: fingertips and directions, (M, 3) each.
        frames: with the true rays.
        indices: (M,), the frames that the rays belong to.
    """
    tips, directions = (torch.from_numpy(each[indices]).float() for each in (frames.tips, frames.directions))
    return ((rays[0] - tips).norm(dim=1) + LEVER * (rays[1] - directions).norm(dim=1)).mean()


@torch.no_grad()
def _validation_summary(network: RayNetwork, validation: LabelledFrames | None) -> str:
    if validation is None:
        return ""
    parts = [network(as_input(part)) for part in np.array_split(validation.pictures, 8)]
    tips, directions = (torch.cat(each).numpy().astype(np.float64) for each in zip(*parts, strict=True))
    return "; people not learned from: " + error_summary(tips, directions, validation.tips, validation.directions)


def error_summary(tips: Array, directions: Array, true_tips: Array, true_directions: Array) -> str:
    """Returns the errors of N rays, arrays (N, 3), in words: medians and 90 % quantiles."""
    angle, off = angles_between(directions, true_directions), 100 * np.linalg.norm(tips - true_tips, axis=1)
    return (
        f"direction {np.median(angle):.2f} degrees off (90 %: {np.quantile(angle, 0.9):.2f}), "
        f"fingertip {np.median(off):.2f} cm (90 %: {np.quantile(off, 0.9):.2f})"
    )


def angles_between(one: Array, other: Array) -> Array:
    """Returns the angles (N,) between unit vectors (N, 3), degrees."""
    return np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(one - other, axis=1) / 2, 0, 1)))
