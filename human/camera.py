"""Training and evaluation of the network that reads where a person points: `python -m human.camera train | evaluate`.

    train
      out=pointing.npz  file for the weights; give gesture.weights that file
      frames=16000      pictures that the simulator draws and labels
      epochs=20         passes over the frames
      seed=0            of bodies, frames and network
    evaluate
      weights=<file>    default: the weights that come with the project
      scenes=1000       of scattered objects, one of which is pointed at
      objects=6         in each scene
      aim=object        what is pointed at; aim=area: a random place, and the object nearest to the true ray counts
      seed=1            of the scenes
    workspace.human.camera.pitch=-9 ...   any key of the workspace, to move camera, person or furniture
    task.spacing=0.12 task.object_size=0.05   of the task's keys these two: the distance between objects, their width

`train` prints the ray's errors on people outside the training set after each epoch. `evaluate` prints how often the
object nearest to the ray is the one that was pointed at.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import torch
from numpy.random import Generator
from numpy.typing import NDArray
from torch import Tensor

from core.command_line import check_file, chosen, split
from core.errors import ConfigError, did_you_mean
from core.overrides import check, compose
from core.program import run_program
from core.schema import Checked, any_path, one_of, read, within
from human.arms import Unreachable
from human.body.person_camera import FurnitureBox, PersonCamera, camera_of
from human.config import HumanConfig
from human.pointing import Array, NothingPointedAt, pointed_object
from human.ray_reader import RayNetwork, RayReader, as_input, save
from human.synthetic_frames import FrameGenerator, LabelledFrames
from language import spacing

LEVER = 0.6  # metres from the fingertip to the objects, at which a direction error becomes a distance in the loss
BATCH = 64
LEARNING_RATE = 3e-3
VALIDATION_BODIES = 8  # people outside the training set
VALIDATION_FRAMES = 100  # of each of them


@dataclass(frozen=True, kw_only=True)
class ReaderTraining(Checked):
    """Keys of `train`; the module's docstring describes them."""

    out: str = any_path()
    frames: int = within(1, 1_000_000)
    epochs: int = within(1, 10_000)
    seed: int = within(0, 2**31 - 1)


@dataclass(frozen=True, kw_only=True)
class ReaderEvaluation(Checked):
    """Keys of `evaluate`; the module's docstring describes them."""

    weights: str | None = any_path()
    scenes: int = within(1, 1_000_000)
    objects: int = within(1, 12)
    aim: str = one_of("object", "area")
    seed: int = within(0, 2**31 - 1)


DEFAULTS: dict[type, dict[str, Any]] = {
    ReaderTraining: {"out": "pointing.npz", "frames": 16_000, "epochs": 20, "seed": 0},
    ReaderEvaluation: {"weights": None, "scenes": 1000, "objects": 6, "aim": "object", "seed": 1},
}


@dataclass(frozen=True, kw_only=True)
class PlacingConfig(Checked):
    """Where objects lie (x0, x1, y0, y1), the smallest distance between their centres, and their width, metres."""

    object_area: list[float] = within(-5, 5, count=4)
    spacing: float = within(0, 1)
    object_size: float = within(0.01, 0.2)


@dataclass(frozen=True)
class CameraScene:
    """The person, the furniture in the picture, and where objects lie."""

    human: HumanConfig
    furniture: list[FurnitureBox]
    objects: PlacingConfig

    @classmethod
    def of(cls, overrides: Sequence[str]) -> CameraScene:
        """Return the setup of task=reach_gesture with these overrides. Raises ConfigError."""
        overrides = ["task=reach_gesture", *overrides]
        check(overrides)
        config = compose(overrides)
        workspace, task = config["workspace"], config["task"]
        if workspace.get("human") is None:
            raise ConfigError(f"workspace.name={workspace['name']} has no person to look at: workspace=collabtable")
        human = read(HumanConfig, workspace["human"], "workspace.human")
        camera_of(human)
        boxes = workspace["furniture"].values()
        furniture = [FurnitureBox(list(box["size"]), list(box["position"]), list(box["color"])) for box in boxes]
        numbers = {"object_area": workspace["object_area"], **{name: task[name] for name in ("spacing", "object_size")}}
        return cls(human, furniture, read(PlacingConfig, numbers, ""))


# ---- Training


def train(config: ReaderTraining, setup: CameraScene) -> RayNetwork:
    """Generate frames, train a network on them, save and return it. Raises ConfigError."""
    camera = camera_of(setup.human)
    if camera.width != camera.height or camera.width % 16:
        raise ConfigError(f"workspace.human.camera.width={camera.width} must be its height, and a multiple of 16")
    out = check_file("out", config.out)
    rng, began = np.random.default_rng(config.seed), time.perf_counter()
    frames = generate_frames(setup, config.frames, rng)
    validation = generate_frames(setup, VALIDATION_FRAMES * VALIDATION_BODIES, rng, VALIDATION_BODIES)
    print(f"{config.frames} frames drawn in {time.perf_counter() - began:.0f} s", flush=True)
    network = fit(frames, config.epochs, config.seed, validation)
    save(out, network, setup.human)
    print(f"saved {out.stat().st_size / 1000:.0f} kB in {out}, {time.perf_counter() - began:.0f} s in all")
    return network


def generate_frames(setup: CameraScene, count: int, rng: Generator, bodies: int | None = None) -> LabelledFrames:
    """Return `count` frames of a new pool of random people; bodies: its size."""
    generator = FrameGenerator(setup.human, setup.furniture, area=setup.objects.object_area, rng=rng, bodies=bodies)
    try:
        return generator.frames(count)
    finally:
        generator.close()


def fit(frames: LabelledFrames, epochs: int, seed: int, validation: LabelledFrames | None = None) -> RayNetwork:
    """Train a network and print each epoch's loss.

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
    """Learn from every frame once; return the mean loss."""
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
    """Return pictures (M, 3, H, W) with random exposure, white balance and sensor noise (data augmentation)."""
    m = len(pictures)
    gain = (0.8 + 0.4 * torch.rand(m, 1, 1, 1, generator=generator)) * (
        0.93 + 0.14 * torch.rand(m, 3, 1, 1, generator=generator)
    )
    noise = torch.randn(pictures.shape, generator=generator) * 0.025 * torch.rand(m, 1, 1, 1, generator=generator)
    return (pictures * gain + noise).clamp_(0, 1)


def ray_loss(rays: tuple[Tensor, Tensor], frames: LabelledFrames, indices: NDArray[np.int64]) -> Tensor:
    """Return the loss in metres: the mean error of the fingertips plus that of the directions at LEVER from there.

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
    """Return the errors of N rays, arrays (N, 3), in words: medians and 90 % quantiles."""
    angle, off = angles_between(directions, true_directions), 100 * np.linalg.norm(tips - true_tips, axis=1)
    return (
        f"direction {np.median(angle):.2f} degrees off (90 %: {np.quantile(angle, 0.9):.2f}), "
        f"fingertip {np.median(off):.2f} cm (90 %: {np.quantile(off, 0.9):.2f})"
    )


def angles_between(one: Array, other: Array) -> Array:
    """Return the angles (N,) between unit vectors (N, 3), degrees."""
    return np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(one - other, axis=1) / 2, 0, 1)))


# ---- Evaluation


def evaluate(config: ReaderEvaluation, setup: CameraScene) -> dict[str, float]:
    """Let the person point at objects; print and return how often the camera's ray finds them.

    Returns:
        "camera" and "true_ray": the shares of scenes in which the object nearest to that ray is the referent.
        "frames_per_second": pictures rendered and read per second.

    Raises:
        ConfigError: objects do not fit the area, or lie out of the person's reach.
    """
    rng = np.random.default_rng(config.seed)
    camera = PersonCamera(setup.human, setup.furniture)
    camera.hide_invisible_shapes()
    reader = RayReader(setup.human, config.weights)
    rays, correct, seconds = [], [], 0.0
    for _ in range(config.scenes):
        positions, referent, joints = _scene(config, setup, camera, rng)
        began = time.perf_counter()
        tips, directions = reader.read(camera.picture(joints)[None])
        seconds += time.perf_counter() - began
        read_ray, true_ray = (tips[0], directions[0]), camera.body.ray()
        rays.append((*read_ray, *true_ray))
        correct.append([_pointed_or_none(ray, positions) == referent for ray in (read_ray, true_ray)])
    camera.close()
    return _report(config, rays, correct, seconds)


def _report(config: ReaderEvaluation, rays: list, correct: list[list[bool]], seconds: float) -> dict[str, float]:
    """Print and returns the results of `evaluate`."""
    by_camera, by_true_ray = np.mean(correct, axis=0).tolist()
    rate = config.scenes / seconds
    print(error_summary(*(np.stack(each) for each in zip(*rays, strict=True))))
    shares = f"camera {by_camera:.3f}, true ray {by_true_ray:.3f}"
    print(f"pointed object of {config.objects}: {shares}, {config.scenes} scenes")
    print(f"{rate:.0f} frames/s rendered and read")
    return {"camera": by_camera, "true_ray": by_true_ray, "frames_per_second": rate}


def _scene(
    config: ReaderEvaluation, setup: CameraScene, camera: PersonCamera, rng: Generator
) -> tuple[Array, int, Array]:
    """Pose the body; return objects at (K, 3), metres, the referent and the arm's angles (J,). Raises ConfigError."""
    while True:
        positions = scatter(setup, config.objects, rng)
        referent: int | None = int(rng.integers(config.objects))
        x0, x1, y0, y1 = setup.objects.object_area
        target = positions[referent]
        if config.aim == "area":
            target = rng.uniform([x0, y0, 0.0], [x1, y1, setup.objects.object_size])
        try:
            camera.body.pose(camera.body.solve(target))
        except Unreachable as error:
            raise ConfigError(
                f"workspace.object_area={setup.objects.object_area} contains places out of reach: {error}"
            ) from None
        if config.aim == "area":
            referent = _pointed_or_none(camera.body.ray(), positions)
        if referent is not None:
            return positions, referent, camera.body.angles


def _pointed_or_none(ray: tuple[Array, Array], positions: Array) -> int | None:
    """Return the object that is pointed at, or None."""
    try:
        return int(pointed_object(*ray, positions))
    except NothingPointedAt:
        return None


def scatter(setup: CameraScene, count: int, rng: Generator) -> Array:
    """Return centres (count, 3) of objects on the table, metres, at least the spacing apart. Raises ConfigError."""
    places = spacing.scatter(rng, count, setup.objects.object_area, setup.objects.spacing)
    if places:
        return np.column_stack((places, np.full(count, setup.objects.object_size / 2)))
    raise ConfigError(
        f"objects={count} do not fit workspace.object_area={setup.objects.object_area}, "
        f"task.spacing={setup.objects.spacing} apart"
    )


# ---- Command line

COMMANDS: dict[str, tuple[type, Any]] = {"train": (ReaderTraining, train), "evaluate": (ReaderEvaluation, evaluate)}


def main(arguments: Sequence[str]) -> Any:
    """Run `train` or `evaluate` with the arguments that follow it. Raises ConfigError."""
    (kind, command_function), words = chosen(COMMANDS, arguments)
    names = [field.name for field in fields(kind)]
    own, overrides = split(words, names, "seed=1")
    for word in overrides:
        key = word.partition("=")[0]
        if key.split(".")[0] not in ("workspace", "task"):
            raise ConfigError(f"{word}: {key} is not a known key" + did_you_mean(key, names))
    return command_function(read(kind, DEFAULTS[kind] | own, ""), CameraScene.of(overrides))


if __name__ == "__main__":
    torch.set_num_threads(1)
    run_program(main, __file__)
