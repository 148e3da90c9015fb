"""Checks of a checkpoint's content: a file can be whole and still not be a checkpoint of this project."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch

from conf.safe_files import FileError, check_plain

MAX_WORDS = 100_000


def check_content(payload: Mapping[str, Any]) -> None:
    """Checks the type and the values of each known key of a payload. Other keys are not looked at.

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


def _check_vocabulary(words: Any) -> None:
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
    "vocabulary": _check_vocabulary,
    "widths": _check_widths,
    "algorithm": _check_algorithm,
    "counters": _check_counters,
    "rng": _check_rng,
}
