"""Checkpoints: saving, loading and finding them, and policies that are built from them.

A file can be whole and still not be a checkpoint of this project, so its content is checked when it is read.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch

from core.errors import ConfigError
from core.safe_files import FileError, check_plain
from core.spaces import public_keys
from core.stored_config import config_from_file
from trainers.algorithms.settings import read_algorithm
from trainers.config import read_policy
from trainers.environment import TrainingEnv, readers_of
from trainers.export import policy_file
from trainers.models.policy import MoveBounds, Policy, build_policy
from trainers.utils.files import atomic_file
from trainers.utils.tensor_archive import read_tensors

FORMAT = 2  # of the files; format 1 has other names for the parameters
POLICY_KEYS = ("config", "vocabulary", "widths", "algorithm")  # of a published policy
KEYS = (*POLICY_KEYS, "counters", "rng")  # of a checkpoint that training can resume
MIN_FREE_BYTES = 64 * 2**20  # left free on the disk after writing a checkpoint
MAX_WORDS = 100_000
UNKNOWN_ROW = 1  # the embedding of words that are not in the vocabulary


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
    required, free = 2 * size_in_bytes(payload) + MIN_FREE_BYTES, shutil.disk_usage(path.parent).free
    if free < required:
        raise CheckpointError(
            f"{path}: a checkpoint needs {required / 2**20:.0f} MiB of free disk space, {free / 2**20:.0f} are free"
        )
    with atomic_file(path) as file:
        torch.save({"format": FORMAT, **payload}, file)


def load(path: Path, to_train: bool = False, given: Sequence[str] | None = ()) -> dict[str, Any]:
    """Load a checkpoint or a published policy to the CPU. Nothing in the file is executed.

    Args:
        path: of a file that `save` or `trainers.export.publish` wrote.
        to_train: refuse a published policy, which training cannot resume.
        given: overrides of the user's command line, for `core.stored_config`; None if the caller has another config.

    Returns:
        The payload of `save`. That of a published policy has the keys of `POLICY_KEYS`, and of the algorithm only the
        policy.

    Raises:
        CheckpointError: the file is missing, damaged, not a checkpoint, or refused.
        ConfigError: its config names places that only the user's command line may name.
    """
    if not path.is_file():
        raise CheckpointError(f"checkpoint {path} does not exist")
    is_policy = path.suffix == ".safetensors"
    if is_policy and to_train:
        raise CheckpointError(
            f"{path} is a published policy without optimiser and critic, so training cannot resume from it; "
            "give the run's directory: resume=<run dir>"
        )
    payload = _read(path, is_policy)
    if given is not None:
        payload["config"] = config_from_file(payload["config"], path, given, to_train)
    return payload


def _read(path: Path, is_policy: bool) -> dict[str, Any]:
    """Return the payload of a file, whose config is not checked. Raises CheckpointError."""
    try:
        if is_policy:
            return _validated(path, policy_file.unpack(path), POLICY_KEYS)
        return _validated(path, read_tensors(path))
    except CheckpointError:
        raise
    except FileError as error:
        raise CheckpointError(f"checkpoint {path} {error}{_way_out(path)}") from None
    except Exception as error:  # torch, zipfile and safetensors raise many types for a bad file
        problem = f"{path} is damaged or not a checkpoint of this project: {_first_line(error)}"
        raise CheckpointError(problem + _way_out(path)) from None


def _way_out(path: Path) -> str:
    """Return the end of a message about a damaged last.pt, where the run's best.pt can take its place."""
    best = path.with_name("best.pt")
    return f"; {best} is there: give it in place of the run" if path.name == "last.pt" and best.is_file() else ""


def find(path: Path, name: str = "last", key: str = "checkpoint") -> Path:
    """Return the checkpoint file that a path stands for.

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
        path = policy_file.folder_of(path) or path
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
            + policy_file.suggestion(path)
        )
    raise CheckpointError(f"{key}={path} has no checkpoints/last.pt or best.pt, and no {policy_file.NAME}")


def result_file(path: Path) -> Path:
    """Return a file for a result of this checkpoint, with a number that is not taken yet.

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
    """Return the shapes of one world's observations and actions, for which the networks are built."""
    shapes = {key: list(observation_spec[key].shape[1:]) for key in public_keys(observation_spec)}
    return {"gesture": []} | shapes | {"action": list(action_spec.shape[1:])}


def check_fits(payload: dict[str, Any], vocabulary: list[str], shapes: dict[str, list[int]]) -> None:
    """Check that a checkpoint fits an environment.

    A policy with attention, over slots or in pictures, takes any number of objects.

    Args:
        payload: of `load`.
        vocabulary: of the environment's tokenizer.
        shapes: of the environment, from `widths`.

    Raises:
        CheckpointError: the checkpoint was trained with other words or shapes.
    """
    any_slots = payload["config"].get("policy", {}).get("name") in ("grounded", "pixels")
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
    """Raise CheckpointError, which says what to do, unless both are equal."""
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


def fitted_policy(payload: dict[str, Any], config: Any, env: TrainingEnv) -> Policy:
    """Return the policy of a checkpoint for this environment, to act on the CPU, built by `config`.

    Raises CheckpointError if it does not fit the environment.
    """
    payload = extend_vocabulary(payload, env.tokenizer.vocabulary)
    check_fits(payload, list(env.tokenizer.vocabulary), widths(env.observation_spec, env.action_spec))
    algo = read_algorithm(config["algo"])
    bounds = MoveBounds(squash=algo.squashes, clip=algo.clips)
    settings = read_policy(config["policy"])
    spec, readers = env.observation_spec, readers_of(env)
    policy = build_policy(settings, spec, env.action_unit, bounds, payload["vocabulary"], readers)
    _load_networks(policy, payload["algorithm"]["policy"], "the checkpoint has other networks than its config")
    return policy


def start_from(path: Path, policy: Policy, vocabulary: Sequence[str], widths: dict[str, list[int]]) -> None:
    """Give a policy the networks of a checkpoint or of a published policy. It keeps its own exploration noise.

    Args:
        path: of the file.
        policy: of the new run.
        vocabulary: of its tokenizer.
        widths: of its environment, from `widths`.

    Raises:
        CheckpointError: the networks are others, or were trained for other observations or actions.
    """
    payload = extend_vocabulary(load(path), vocabulary)
    try:
        check_fits(payload, list(vocabulary), widths)
    except CheckpointError as error:
        raise CheckpointError(f"init={path} cannot be begun with: {error}") from None
    noise = {name: value for name, value in policy.state_dict().items() if name.endswith("log_std")}
    remedy = "take the values of policy that it was trained with"
    _load_networks(
        policy, payload["algorithm"]["policy"] | noise, f"init={path} has other networks than this run", remedy
    )


def _load_networks(policy: Policy, weights: Mapping[str, torch.Tensor], problem: str, remedy: str = "") -> None:
    """Raise CheckpointError, which begins with `problem`, if the policy has other networks."""
    try:
        policy.load_state_dict(dict(weights))
    except RuntimeError as error:
        text = str(error).splitlines()[-1].strip()
        raise CheckpointError(f"{problem}: {text}" + (f"; {remedy}" if remedy else "")) from None


def extend_vocabulary(payload: dict[str, Any], vocabulary: Sequence[str]) -> dict[str, Any]:
    """Return the payload of a checkpoint with word embeddings for a vocabulary that begins with its own.

    The policy reads the added words as unknown ones, and all others as before. Returns the payload itself where its
    vocabulary is not a proper beginning of this one.
    """
    known = list(payload["vocabulary"])
    if len(known) >= len(vocabulary) or known != list(vocabulary[: len(known)]):
        return payload
    weights = {
        name: _extended(weight, len(vocabulary)) if _is_word_embedding(name, weight, len(known)) else weight
        for name, weight in payload["algorithm"]["policy"].items()
    }
    return payload | {"vocabulary": list(vocabulary), "algorithm": payload["algorithm"] | {"policy": weights}}


def _is_word_embedding(name: str, weight: torch.Tensor, words: int) -> bool:
    return name.endswith("word_embedding.weight") and len(weight) == words


def _extended(weight: torch.Tensor, words: int) -> torch.Tensor:
    return torch.cat((weight, weight[UNKNOWN_ROW].expand(words - len(weight), -1)))


def _validated(path: Path, payload: Any, keys: Sequence[str] = KEYS) -> dict[str, Any]:
    """Return the payload, if it has a known format and all keys with good values.

    Raises CheckpointError or FileError.
    """
    if not isinstance(payload, dict) or not isinstance(payload.get("format"), int):
        raise CheckpointError(f"{path} is not a checkpoint of this project")
    if payload["format"] != FORMAT:
        raise CheckpointError(f"{path} has format {payload['format']}; this version reads format {FORMAT}")
    missing = [key for key in keys if key not in payload]
    if missing:
        raise CheckpointError(f"{path} is not a checkpoint of this project: it lacks {', '.join(missing)}")
    check_content(payload)
    return payload


def size_in_bytes(value: Any) -> int:
    if isinstance(value, torch.Tensor):
        return value.numel() * value.element_size()
    if isinstance(value, dict):
        return sum(map(size_in_bytes, value.values()))
    return sum(map(size_in_bytes, value)) if isinstance(value, list | tuple) else 64


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]


def check_content(payload: Mapping[str, Any]) -> None:
    """Check the type and the values of each known key of a payload. Other keys are not looked at.

    Raises:
        FileError: a sentence that the file's path begins; it names the key and what it must be.
    """
    for key, check in CHECKS.items():
        if key in payload:
            check(payload[key])


def _check_config(config: Any) -> None:
    if not isinstance(config, dict):
        raise _wrong("config", config, "a group of keys")
    check_plain(config)


def _check_words(words: Any) -> None:
    good = isinstance(words, list) and 0 < len(words) <= MAX_WORDS and all(isinstance(word, str) for word in words)
    if not good or len(set(words)) != len(words):
        raise _wrong("vocabulary", words, "a list of distinct words")


def _check_widths(widths: Any) -> None:
    good = isinstance(widths, dict) and all(
        isinstance(name, str) and isinstance(shape, list) and all(type(width) is int and width >= 0 for width in shape)
        for name, shape in widths.items()
    )
    if not good:
        raise _wrong("widths", widths, "a list of whole numbers for each observation")


def _check_algorithm(algorithm: Any) -> None:
    policy = algorithm.get("policy") if isinstance(algorithm, dict) else None
    if not isinstance(policy, dict) or not policy:
        raise _wrong("algorithm", algorithm, "a group with the networks of policy")
    for name, value in policy.items():
        if not isinstance(name, str) or not isinstance(value, torch.Tensor):
            raise _wrong(f"algorithm.policy.{name}", value, "a tensor")
    _check_finite("algorithm", algorithm)


def _check_finite(key: str, value: Any) -> None:
    if isinstance(value, torch.Tensor):
        if value.is_floating_point() and not value.isfinite().all():
            raise FileError(
                f"holds a number that is not finite in {key}: training had diverged; take an earlier checkpoint"
            )
    elif isinstance(value, dict):
        for name, inner in value.items():
            _check_finite(f"{key}.{name}", inner)
    elif isinstance(value, list | tuple):
        for index, inner in enumerate(value):
            _check_finite(f"{key}.{index}", inner)


def _check_counters(counters: Any) -> None:
    frames = counters.get("frames") if isinstance(counters, dict) else None
    if type(frames) is not int or frames < 0:
        raise _wrong("counters", counters, "a group with the number of frames")
    check_plain(counters)


def _check_rng(state: Any) -> None:
    try:
        torch.Generator().set_state(state)
    except (TypeError, RuntimeError):
        raise _wrong("rng", state, "the state of torch's generator") from None


def _wrong(key: str, value: Any, wanted: str) -> FileError:
    shown = repr(value)
    if len(shown) > 40 and isinstance(value, dict | list | torch.Tensor):
        shown = f"<{type(value).__name__}>"
    return FileError(f"is not a checkpoint of this project: {key}={shown[:80]} must be {wanted}")


CHECKS = {
    "config": _check_config,
    "vocabulary": _check_words,
    "widths": _check_widths,
    "algorithm": _check_algorithm,
    "counters": _check_counters,
    "rng": _check_rng,
}
