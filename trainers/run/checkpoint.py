"""Files that survive a kill: written beside, synced, renamed; checked and opened without running anything in them."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch

from conf.schema import ConfigError
from trainers.export import policy_file, pretrained
from trainers.utils.atomic_io import atomic_file

FORMAT = 1
POLICY = ("config", "vocabulary", "widths", "algorithm")  # what it takes to act
KEYS = (*POLICY, "counters", "rng")  # ... and to go on training
SPARE = 64 * 2**20  # bytes left free on the disk beside a checkpoint


class CheckpointError(ConfigError):
    """A checkpoint that is missing, damaged, not ours or made for something else."""


def save(path: Path, payload: dict[str, Any]) -> None:
    """Write `payload` (plain values and tensors, the keys of `KEYS`) so that `path` is either the old file or the new.

    Raises CheckpointError where the disk has no room, before anything is written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    needed, free = 2 * _bytes(payload) + SPARE, shutil.disk_usage(path.parent).free
    if free < needed:
        raise CheckpointError(
            f"{path}: {needed / 2**20:.0f} MiB are needed for a checkpoint, {free / 2**20:.0f} are free"
        )
    with atomic_file(path) as file:
        torch.save({"format": FORMAT, **payload}, file)


def load(path: Path, to_train: bool = False) -> dict[str, Any]:
    """The payload of `save`, on the CPU. Nothing in the file is executed. Raises CheckpointError.

    Of a policy alone (`trainers.export.publish`) it has the keys of `POLICY`, and no algorithm but the policy.
    to_train: refuse what training cannot go on from.
    """
    if not path.is_file():
        raise CheckpointError(f"checkpoint {path} does not exist")
    alone = path.suffix == ".safetensors"
    if alone and to_train:
        raise CheckpointError(
            f"{path} is a policy alone, without optimiser and critic: training cannot go on from it; "
            "resume=<run dir> wants the run itself"
        )
    try:
        if alone:
            return _known(path, policy_file.unpack(path), POLICY)
        with zipfile.ZipFile(path) as archive:
            broken = archive.testzip()  # torch does not look at checksums: a flipped bit would load as a weight
        if broken is not None:
            raise CheckpointError(f"checkpoint {path} is damaged (in {broken})")
        payload = torch.load(path, map_location="cpu", weights_only=True)
    except CheckpointError:
        raise
    except Exception as error:  # torch and zipfile name a bad file in a dozen ways
        raise CheckpointError(f"checkpoint {path} is damaged, or is no checkpoint of ours: {_first(error)}") from None
    return _known(path, payload)


def find(path: Path, name: str = "last") -> Path:
    """The checkpoint file that a run directory, its checkpoints/, a published policy or the file itself stands for.

    The name of a pretrained policy stands for that policy, unless a file or directory has this name.

    name: "last" or "best", where there is a choice; the other one where only that exists. Raises CheckpointError.
    """
    if path.is_file():
        return path
    if not path.exists():
        path = pretrained.folder_of(path) or path
    other = "best" if name == "last" else "last"
    for folder in (path / "checkpoints", path):
        for choice in (name, other):
            if (folder / f"{choice}.pt").is_file():
                return folder / f"{choice}.pt"
    if (path / policy_file.NAME).is_file():
        return path / policy_file.NAME
    if not path.exists():
        raise CheckpointError(
            f"checkpoint={path} does not exist; give a run directory, a file or a pretrained policy"
            + pretrained.suggestion(path)
        )
    raise CheckpointError(f"checkpoint={path} holds no checkpoints/last.pt or best.pt, and no {policy_file.NAME}")


def widths(observation_spec: Any, action_spec: Any) -> dict[str, list[int]]:
    """The shapes of one world that a network is built for."""
    names, there = ("robot", "objects", "instruction", "gesture"), set(observation_spec.keys())
    shapes = {name: list(observation_spec[name].shape[1:]) if name in there else [] for name in names}
    return shapes | {"action": list(action_spec.shape[1:])}


def check_fits(payload: dict[str, Any], vocabulary: list[str], shapes: dict[str, list[int]]) -> None:
    """Raise CheckpointError, in one sentence, unless the checkpoint was trained for these words and shapes.

    shapes: as `widths` gives them. A policy that attends to slots takes any number of them.
    """
    any_slots = payload["config"].get("policy", {}).get("name") == "grounded"
    theirs = payload["vocabulary"]
    if list(theirs) != list(vocabulary):
        extra, missing = sorted(set(theirs) - set(vocabulary)), sorted(set(vocabulary) - set(theirs))
        what = (
            f"it has {extra or 'no others'} and lacks {missing or 'none'}" if extra or missing else "in another order"
        )
        raise CheckpointError(f"the checkpoint was trained with another vocabulary: {what}")
    for name, shape in shapes.items():
        theirs = payload["widths"].get(name, [])
        free = any_slots and name == "objects"
        if theirs[free:] != shape[free:]:
            raise CheckpointError(
                f"the checkpoint was trained for another environment: {name} is {theirs} there "
                f"and {shape} here; use the robot, control, task and gesture it was trained with"
            )


def _known(path: Path, payload: Any, keys: Sequence[str] = KEYS) -> dict[str, Any]:
    if not isinstance(payload, dict) or not isinstance(payload.get("format"), int):
        raise CheckpointError(f"{path} is no checkpoint of ours")
    if payload["format"] > FORMAT:
        raise CheckpointError(f"{path} has format {payload['format']}; this version reads up to {FORMAT}")
    missing = [key for key in keys if key not in payload]
    if missing:
        raise CheckpointError(f"{path} is no checkpoint of ours: it lacks {', '.join(missing)}")
    return payload


def _bytes(value: Any) -> int:
    if isinstance(value, torch.Tensor):
        return value.numel() * value.element_size()
    if isinstance(value, dict):
        return sum(map(_bytes, value.values()))
    return sum(map(_bytes, value)) if isinstance(value, list | tuple) else 64


def _first(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]
