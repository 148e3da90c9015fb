"""Checkpoint files: written atomically, checked for damage, and loaded without executing anything in them."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch

from conf.safe_files import FileError
from conf.schema import ConfigError
from trainers.export import policy_file, pretrained
from trainers.run.checkpoint_content import check_content
from trainers.utils.atomic_io import atomic_file
from trainers.utils.observation_keys import public_keys
from trainers.utils.tensor_archive import read_tensors

FORMAT = 2
OLDEST_FORMAT = 2  # format 1 has other names for the parameters
POLICY_KEYS = ("config", "vocabulary", "widths", "algorithm")  # of a published policy
KEYS = (*POLICY_KEYS, "counters", "rng")  # of a checkpoint that training can resume
MIN_FREE_BYTES = 64 * 2**20  # left free on the disk after writing a checkpoint


class CheckpointError(ConfigError):
    """A checkpoint that is missing, damaged, of another program, or trained for another environment."""


def save(path: Path, payload: dict[str, Any]) -> None:
    """Write a checkpoint atomically: after a crash `path` is either the old file or the new one.

    Args:
        path: of the file; its directory is created if missing.
        payload: plain values and tensors under the keys of `KEYS`.

    Raises:
        CheckpointError: the disk has too little free space; nothing is written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    required, free = 2 * _size_in_bytes(payload) + MIN_FREE_BYTES, shutil.disk_usage(path.parent).free
    if free < required:
        raise CheckpointError(
            f"{path}: a checkpoint needs {required / 2**20:.0f} MiB of free disk space, {free / 2**20:.0f} are free"
        )
    with atomic_file(path) as file:
        torch.save({"format": FORMAT, **payload}, file)


def load(path: Path, to_train: bool = False) -> dict[str, Any]:
    """Load a checkpoint or a published policy to the CPU. Nothing in the file is executed.

    Args:
        path: of a file that `save` or `trainers.export.publish` wrote.
        to_train: refuse a published policy, which training cannot resume.

    Returns:
        The payload of `save`. That of a published policy has the keys of `POLICY_KEYS`, and of the algorithm only the
        policy.

    Raises:
        CheckpointError: the file is missing, damaged, not a checkpoint, or refused.
    """
    if not path.is_file():
        raise CheckpointError(f"checkpoint {path} does not exist")
    is_policy = path.suffix == ".safetensors"
    if is_policy and to_train:
        raise CheckpointError(
            f"{path} is a published policy without optimiser and critic, so training cannot resume from it; "
            "give the run's directory: resume=<run dir>"
        )
    try:
        if is_policy:
            return _validated(path, policy_file.unpack(path), POLICY_KEYS)
        return _validated(path, read_tensors(path))
    except CheckpointError:
        raise
    except FileError as error:
        raise CheckpointError(f"checkpoint {path} {error}") from None
    except Exception as error:  # torch, zipfile and safetensors raise many types for a bad file
        raise CheckpointError(f"{path} is damaged or not a checkpoint of this project: {_first_line(error)}") from None


def find(path: Path, name: str = "last", key: str = "checkpoint") -> Path:
    """The checkpoint file that a path stands for.

    Args:
        path: a file, a run directory, its checkpoints/, the directory of a published policy, or the name of a
            pretrained policy. A file or directory takes precedence over a name.
        name: "last" or "best"; if only the other one exists, that is returned.
        key: of the config that has the path, for the error message.

    Raises:
        CheckpointError: there is no checkpoint.
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
            f"{key}={path} does not exist; give a run directory, a file or a pretrained policy"
            + pretrained.suggestion(path)
        )
    raise CheckpointError(f"{key}={path} has no checkpoints/last.pt or best.pt, and no {policy_file.NAME}")


def result_file(path: Path) -> Path:
    """A file for a result of this checkpoint, with a number that is not taken yet.

    It is in the run directory; that of a published policy is in outputs/.
    """
    folder, name = path.parent, "evaluation"
    if path.suffix == ".safetensors":
        folder, name = Path("outputs"), f"evaluation_{path.resolve().parent.name}"
    elif folder.name == "checkpoints":
        folder = folder.parent
    names = (folder / f"{name}_{i}.json" for i in range(1, 10_000))
    return next(name for name in names if not name.exists())


def widths(observation_spec: Any, action_spec: Any) -> dict[str, list[int]]:
    """The shapes of one world's observations and actions, for which the networks are built."""
    shapes = {key: list(observation_spec[key].shape[1:]) for key in public_keys(observation_spec)}
    return {"gesture": []} | shapes | {"action": list(action_spec.shape[1:])}


def check_fits(payload: dict[str, Any], vocabulary: list[str], shapes: dict[str, list[int]]) -> None:
    """Check that a checkpoint fits an environment. A policy with attention over slots takes any number of objects.

    Args:
        payload: of `load`.
        vocabulary: of the environment's tokenizer.
        shapes: of the environment, from `widths`.

    Raises:
        CheckpointError: the checkpoint was trained with other words or shapes.
    """
    any_slots = payload["config"].get("policy", {}).get("name") == "grounded"
    _check_vocabulary(list(payload["vocabulary"]), list(vocabulary))
    for name, theirs in payload["widths"].items():
        shape = shapes.get(name, [])
        skipped = any_slots and name.startswith("objects")  # dimensions that may differ
        if theirs[skipped:] != shape[skipped:]:
            raise CheckpointError(
                f"the checkpoint was trained for another environment: {name} is {theirs} there "
                f"and {shape} here; use the robot, control, task and gesture it was trained with"
            )


def _check_vocabulary(theirs: list[str], ours: list[str]) -> None:
    """Raises CheckpointError, which says what to do, unless both are equal."""
    if theirs == ours:
        return
    extra, missing = sorted(set(theirs) - set(ours)), sorted(set(ours) - set(theirs))
    if theirs == ours[: len(theirs)]:
        raise CheckpointError(
            f"the run was trained before {missing} were added to the vocabulary, and continues only without them; its "
            "policy can still be evaluated: evaluate.py checkpoint=<run dir>"
        )
    what = f"it has {extra or 'no others'} and lacks {missing or 'none'}" if extra or missing else "in another order"
    raise CheckpointError(f"the checkpoint was trained with another vocabulary: {what}")


def _validated(path: Path, payload: Any, keys: Sequence[str] = KEYS) -> dict[str, Any]:
    """The payload, if it has a known format and all keys with good values. Raises CheckpointError or FileError."""
    if not isinstance(payload, dict) or not isinstance(payload.get("format"), int):
        raise CheckpointError(f"{path} is not a checkpoint of this project")
    if payload["format"] > FORMAT:
        raise CheckpointError(f"{path} has format {payload['format']}; this version reads up to {FORMAT}")
    if payload["format"] < OLDEST_FORMAT:
        raise CheckpointError(
            f"{path} has format {payload['format']}, that of an older version; this one reads from {OLDEST_FORMAT}: "
            "train again"
        )
    missing = [key for key in keys if key not in payload]
    if missing:
        raise CheckpointError(f"{path} is not a checkpoint of this project: it lacks {', '.join(missing)}")
    check_content(payload)
    return payload


def _size_in_bytes(value: Any) -> int:
    if isinstance(value, torch.Tensor):
        return value.numel() * value.element_size()
    if isinstance(value, dict):
        return sum(map(_size_in_bytes, value.values()))
    return sum(map(_size_in_bytes, value)) if isinstance(value, list | tuple) else 64


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]
