"""The file of a seeing network's weights: safetensors in 16 bits, which executes nothing when it is read."""

from __future__ import annotations

from pathlib import Path

import torch
from safetensors import safe_open
from safetensors.torch import save_file

from core.errors import ConfigError
from core.safe_files import FileError, check_size
from envs.perception.network import SightNetwork

SHIPPED_WEIGHTS = Path(__file__).parent / "weights" / "sight.safetensors"
MAX_BYTES = 16 * 2**20
KEY = "perception.weights"
HINT = "train others: python -m envs.perception_training train out=<file>"


def save(path: Path, network: SightNetwork) -> None:
    """Write the network's parameters."""
    path.parent.mkdir(parents=True, exist_ok=True)
    halves = {
        name: value.half().contiguous() for name, value in network.state_dict().items() if "num_batches" not in name
    }
    save_file(halves, path)


def load(path: str | Path | None = None) -> SightNetwork:
    """Return the network of a file, in evaluation mode; None: the weights that come with the project.

    Raises:
        ConfigError: the file is missing or damaged, or holds other weights.
    """
    file = SHIPPED_WEIGHTS if path is None else Path(path)
    try:
        check_size(file, MAX_BYTES)
        with safe_open(file, framework="pt") as tensors:
            values = {name: tensors.get_tensor(name).float() for name in tensors.keys()}
    except FileError as error:
        raise ConfigError(f"{KEY}={file} {error}; {HINT}") from None
    except Exception as error:  # safetensors raises a type of its own, which it does not name in public
        why = (str(error).splitlines() or [type(error).__name__])[0][:200]
        raise ConfigError(f"{KEY}={file} is damaged, or is no file of weights: {why}; {HINT}") from None
    network = SightNetwork()
    wanted = {name: value for name, value in network.state_dict().items() if "num_batches" not in name}
    shapes = {name: tuple(value.shape) for name, value in wanted.items()}
    if {name: tuple(value.shape) for name, value in values.items()} != shapes:
        raise ConfigError(f"{KEY}={file} holds the weights of another network; {HINT}")
    if not all(torch.isfinite(value).all() for value in values.values()):
        raise ConfigError(f"{KEY}={file} holds numbers that are not finite; {HINT}")
    network.load_state_dict(values, strict=False)
    return network.eval()
