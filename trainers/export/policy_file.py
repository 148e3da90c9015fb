"""A policy as one safetensors file: its weights, and the config, vocabulary and widths it was built from as metadata.

Reading safetensors executes nothing. The format has no checksums, so that a flipped bit would load as a weight;
therefore the metadata has one. Pretrained policies are such files in `FOLDER`, and are found by name.
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

from core.errors import did_you_mean
from core.safe_files import FileError, check_size

NAME = "policy.safetensors"  # in the directory of a policy
METADATA_KEYS = ("config", "vocabulary", "widths")
MAX_BYTES = 2**30  # of a file
MAX_HEADER_BYTES = 2**20  # the library accepts a hundred times as many, and reads them into as much memory again
ENTRY = "deixis"  # the only metadata entry: the order of several would differ between runs


FOLDER = Path(__file__).resolve().parents[2] / "pretrained"  # beside the packages, in a checkout and in an install


def pack(payload: dict[str, Any], form: int) -> bytes:
    """Return the file's content.

    Args:
        payload: of a checkpoint, as `checkpoint.load` returns it.
        form: version of the checkpoint format.
    """
    weights = {name: tensor.detach().clone() for name, tensor in payload["algorithm"]["policy"].items()}
    metadata = {"format": form, **{name: payload[name] for name in METADATA_KEYS}}
    return save(weights, {ENTRY: json.dumps(metadata | {"sha256": _digest(weights, metadata)})})


def unpack(path: Path) -> dict[str, Any]:
    """Return a checkpoint payload with the policy only, on the CPU. Raises ValueError, or an error of safetensors."""
    check_size(path, MAX_BYTES)
    with open(path, "rb") as file:
        header = int.from_bytes(file.read(8), "little")
    if header > MAX_HEADER_BYTES:
        raise FileError(f"is damaged: it names a header of {header:,} bytes; at most {MAX_HEADER_BYTES:,} are accepted")
    with safe_open(path, "pt") as file:
        metadata = json.loads((file.metadata() or {}).get(ENTRY, "{}"))
        if not isinstance(metadata, dict) or "sha256" not in metadata:
            raise ValueError(f"its metadata has no {ENTRY}")
        weights = {name: file.get_tensor(name) for name in file.keys()}
    if metadata.pop("sha256") != _digest(weights, metadata):
        raise ValueError("its checksum does not fit")
    return metadata | {"algorithm": {"policy": weights}}


def _digest(weights: dict[str, Tensor], metadata: dict[str, Any]) -> str:
    """SHA-256 of the metadata, and of each tensor with its name, type and shape."""
    sha = hashlib.sha256(json.dumps(metadata, sort_keys=True).encode())
    for name, tensor in sorted(weights.items()):
        sha.update(f"{name} {tensor.dtype} {list(tensor.shape)}".encode())
        sha.update(tensor.contiguous().view(-1).view(torch.uint8).numpy().tobytes())
    return sha.hexdigest()


def names() -> list[str]:
    """Return the names of the pretrained policies, sorted."""
    return sorted(file.parent.name for file in FOLDER.glob(f"*/{NAME}"))


def folder_of(path: Path) -> Path | None:
    """Return the folder of the policy that `<name>` or `pretrained/<name>` stands for; None for any other path."""
    if path.parent in (Path(), Path("pretrained")) and path.name in names():
        return FOLDER / path.name
    return None


def suggestion(path: Path) -> str:
    """Return the end of an error message about a checkpoint that does not exist: all names, and the nearest one."""
    return f" ({', '.join(names())}){did_you_mean(path.name, names()).partition('; choose')[0]}"
