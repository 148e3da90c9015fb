"""Teach a network to read where a person points, and try it: `python -m human.camera train`, `... evaluate`.

    train
      out=pointing.npz  where the weights go; give gesture.weights that file
      frames=16000      pictures that the simulator draws and labels
      epochs=20         times that each is learned from
      seed=0            of bodies, frames and network
    evaluate
      weights=<file>    the ones that come with the project otherwise
      scenes=1000       scattered objects, one of which is pointed at
      objects=6         in each
      aim=object        what is pointed at; or area: somewhere, and the object nearest to the true ray is meant
      seed=1            of the scenes
    workspace.human.camera.pitch=-9 ...   any key of the workspace, to place camera, person or furniture elsewhere;
    task.spacing=0.12 task.object_size=0.05   of the task's keys these two count: how far apart objects are, how large

`train` prints after each epoch how far off the ray is on frames of people who were not learned from; `evaluate` prints
how often the object nearest to the ray is the one that was pointed at.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.random import Generator

from conf.arguments import run, split
from conf.overrides import check, compose
from conf.schema import Checked, ConfigError, did_you_mean, one_of, read, within
from human.body.person_camera import FurnitureBox, PersonCamera, camera_of
from human.config import HumanConfig
from human.pointing import Array, NothingPointedAt, pointed_object
from human.pointing_arm import Unreachable
from human.ray_reader import RayNetwork, RayReader, save
from human.synthetic_frames import FrameGenerator, LabelledFrames
from human.train_reader import error_summary, fit

VALIDATION_BODIES = 8  # bodies, and 100 times as many frames, that are not learned from
TRIES = 1000


@dataclass(frozen=True, kw_only=True)
class TrainConfig(Checked):
    out: str
    frames: int = within(1, 1_000_000)
    epochs: int = within(1, 10_000)
    seed: int = within(0, 2**31 - 1)


@dataclass(frozen=True, kw_only=True)
class EvaluateConfig(Checked):
    weights: str | None
    scenes: int = within(1, 1_000_000)
    objects: int = within(1, 12)
    aim: str = one_of("object", "area")
    seed: int = within(0, 2**31 - 1)


DEFAULTS: dict[type, dict[str, Any]] = {
    TrainConfig: {"out": "pointing.npz", "frames": 16_000, "epochs": 20, "seed": 0},
    EvaluateConfig: {"weights": None, "scenes": 1000, "objects": 6, "aim": "object", "seed": 1},
}


@dataclass(frozen=True, kw_only=True)
class Objects(Checked):
    """Where objects are put (x0, x1, y0, y1), how far apart, and how wide they are, metres."""

    object_area: list[float] = within(-5, 5, count=4)
    spacing: float = within(0, 1)
    object_size: float = within(0.01, 0.2)


@dataclass(frozen=True)
class Setup:
    """Where it all happens: the person, the furniture, and where objects are put."""

    human: HumanConfig
    furniture: list[FurnitureBox]
    objects: Objects

    @classmethod
    def of(cls, overrides: Sequence[str]) -> Setup:
        """The place that a task with a pointing person has. Raises ConfigError."""
        overrides = ["task=reach_gesture", *overrides]
        check(overrides)
        config = compose(overrides)
        workspace, task = config["workspace"], config["task"]
        if workspace.get("human") is None:
            raise ConfigError(f"workspace.name={workspace['name']} has no person to look at: workspace=collabtable")
        human = read(HumanConfig, workspace["human"], "workspace.human")
        camera_of(human)
        boxes = workspace["furniture"].values()
        blocks = [FurnitureBox(list(box["size"]), list(box["position"]), list(box["color"])) for box in boxes]
        numbers = {"object_area": workspace["object_area"], **{name: task[name] for name in ("spacing", "object_size")}}
        return cls(human, blocks, read(Objects, numbers, ""))


# ---------------------------------------------------------------------------------------------------------- train


def train(config: TrainConfig, place: Setup) -> RayNetwork:
    """Draw frames, learn from them, save and return the network."""
    camera = camera_of(place.human)
    if camera.width != camera.height or camera.width % 16:
        raise ConfigError(f"workspace.human.camera.width={camera.width} must be its height, and a multiple of 16")
    out = _writable(config.out)
    rng, began = np.random.default_rng(config.seed), time.perf_counter()
    frames, trial = (
        generate_frames(place, config.frames, rng),
        generate_frames(place, 100 * VALIDATION_BODIES, rng, VALIDATION_BODIES),
    )
    print(f"{config.frames} frames drawn in {time.perf_counter() - began:.0f} s", flush=True)
    network = fit(frames, config.epochs, config.seed, trial)
    save(out, network, place.human)
    print(f"saved {out.stat().st_size / 1000:.0f} kB in {out}, {time.perf_counter() - began:.0f} s in all")
    return network


def _writable(name: str) -> Path:
    """Where weights can be written. Raises ConfigError now rather than after the training."""
    path = Path(name)
    fresh = not path.exists()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.open("ab").close()
        if fresh:
            path.unlink()
    except OSError as error:
        raise ConfigError(f"out={name} can't be written: {error.strerror}") from None
    return path


def generate_frames(place: Setup, count: int, rng: Generator, bodies: int | None = None) -> LabelledFrames:
    """So many frames of people drawn anew."""
    studio = FrameGenerator(place.human, place.furniture, place.objects.object_area, rng, bodies)
    try:
        return studio.frames(count)
    finally:
        studio.close()


# ------------------------------------------------------------------------------------------------------- evaluate


def evaluate(config: EvaluateConfig, place: Setup) -> dict[str, float]:
    """Let the person point at objects, print and return how often the camera's ray finds them."""
    rng = np.random.default_rng(config.seed)
    sight = PersonCamera(place.human, place.furniture)
    sight.hide_invisible_shapes()
    reader = RayReader(place.human, config.weights)
    rays, right, spent = [], [], 0.0
    for _ in range(config.scenes):
        positions, meant, joints = _scene(config, place, sight, rng)
        began = time.perf_counter()
        tips, directions = reader.read(sight.picture(joints)[None])
        spent += time.perf_counter() - began
        true = sight.body.ray()
        rays.append((tips[0], directions[0], *true))
        right.append([_found(ray, positions) == meant for ray in ((tips[0], directions[0]), true)])
    sight.close()
    camera, true_ray = np.mean(right, axis=0).tolist()
    print(error_summary(*(np.stack(each) for each in zip(*rays, strict=True))))
    print(f"pointed object of {config.objects}: camera {camera:.3f}, true ray {true_ray:.3f}, {config.scenes} scenes")
    rate = config.scenes / spent
    print(f"{rate:.0f} frames/s rendered and read")
    return {"camera": camera, "true_ray": true_ray, "frames_per_second": rate}


def _scene(config: EvaluateConfig, place: Setup, sight: PersonCamera, rng: Generator) -> tuple[Array, int, Array]:
    """Objects at (K, 3), metres, which of them is meant, and the arm (J,) of who points at it. Raises ConfigError."""
    while True:
        positions = scatter(place, config.objects, rng)
        meant: int | None = int(rng.integers(config.objects))
        x0, x1, y0, y1 = place.objects.object_area
        target = positions[meant]
        if config.aim == "area":
            target = rng.uniform([x0, y0, 0.0], [x1, y1, place.objects.object_size])
        try:
            sight.body.pose(sight.body.solve(target))
        except Unreachable as error:
            raise ConfigError(
                f"workspace.object_area={place.objects.object_area} holds places out of reach: {error}"
            ) from None
        if config.aim == "area":
            meant = _found(sight.body.ray(), positions)
        if meant is not None:
            return positions, meant, sight.body.angles


def _found(ray: tuple[Array, Array], positions: Array) -> int | None:
    """The object that is pointed at; none where there is none."""
    try:
        return int(pointed_object(*ray, positions))
    except NothingPointedAt:
        return None


def scatter(place: Setup, count: int, rng: Generator) -> Array:
    """(count, 3) centres of objects that lie on the table, none nearer to another than the spacing; metres."""
    x0, x1, y0, y1 = place.objects.object_area
    for _ in range(TRIES):
        places: list[Array] = []
        for spot in rng.uniform([x0, y0], [x1, y1], (8 * count, 2)):
            if all(np.linalg.norm(spot - other) >= place.objects.spacing for other in places):
                places.append(spot)
        if len(places) >= count:
            return np.column_stack((places[:count], np.full(count, place.objects.object_size / 2)))
    raise ConfigError(
        f"objects={count} do not fit workspace.object_area={place.objects.object_area}, "
        f"task.spacing={place.objects.spacing} apart"
    )


# ------------------------------------------------------------------------------------------------ the command line

COMMANDS: dict[str, tuple[type, Any]] = {"train": (TrainConfig, train), "evaluate": (EvaluateConfig, evaluate)}


def main(arguments: Sequence[str]) -> Any:
    """`train` or `evaluate`, with what follows. Raises ConfigError."""
    command = arguments[0] if arguments else ""
    if command not in COMMANDS:
        raise ConfigError(f"{command or 'nothing'} is not a command" + did_you_mean(command, COMMANDS))
    kind, carry_out = COMMANDS[command]
    names = [field.name for field in fields(kind)]
    own, overrides = split(arguments[1:], names, "seed=1")
    for word in overrides:
        key = word.partition("=")[0]
        if key.split(".")[0] not in ("workspace", "task"):
            raise ConfigError(f"{word}: {key} is not a known key" + did_you_mean(key, names))
    return carry_out(read(kind, DEFAULTS[kind] | own, ""), Setup.of(overrides))


if __name__ == "__main__":
    torch.set_num_threads(1)
    run(main, __doc__)
