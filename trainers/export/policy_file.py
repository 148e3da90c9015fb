"""A policy alone, as one safetensors file: its weights and, as text beside them, what it was built from.

safetensors runs nothing on reading, but knows no checksums: a flipped bit would load as a weight. So the text has one.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import torch
from safetensors import safe_open
from safetensors.torch import save
from torch import Tensor

NAME = "policy.safetensors"  # in a folder that holds a policy
ABOUT = ("config", "vocabulary", "widths")
ENTRY = "deixis"  # one entry of the file's metadata: of several, the order would differ from run to run


def pack(payload: dict[str, Any], form: int) -> bytes:
    """The file of a checkpoint's policy. payload: as `checkpoint.load` gives it. form: number of the format."""
    weights = {name: tensor.detach().clone() for name, tensor in payload["algorithm"]["policy"].items()}
    about = {"format": form, **{name: payload[name] for name in ABOUT}}
    return save(weights, {ENTRY: json.dumps(about | {"sha256": _digest(weights, about)})})


def unpack(path: Path) -> dict[str, Any]:
    """What a checkpoint's payload has of a policy, on the CPU. Raises ValueError, or safetensors' own errors."""
    with safe_open(path, "pt") as file:
        about = json.loads((file.metadata() or {}).get(ENTRY, "{}"))
        if not isinstance(about, dict) or "sha256" not in about:
            raise ValueError(f"its metadata has no {ENTRY}")
        weights = {name: file.get_tensor(name) for name in file.keys()}
    if about.pop("sha256") != _digest(weights, about):
        raise ValueError("its checksum does not fit")
    return about | {"algorithm": {"policy": weights}}


def _digest(weights: dict[str, Tensor], about: dict[str, Any]) -> str:
    """Of all that the file holds, but for the checksum itself."""
    sha = hashlib.sha256(json.dumps(about, sort_keys=True).encode())
    for name, tensor in sorted(weights.items()):
        sha.update(f"{name} {tensor.dtype} {list(tensor.shape)}".encode())
        sha.update(tensor.contiguous().view(-1).view(torch.uint8).numpy().tobytes())
    return sha.hexdigest()
