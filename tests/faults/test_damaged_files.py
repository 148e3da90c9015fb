"""Files of a run, a sweep or a policy with a byte changed, cut, or lost: they are refused, or give the same values."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import torch
import yaml

from core.errors import ConfigError
from core.overrides import compose
from human.ray_reader import SHIPPED_WEIGHTS, load
from language.errors import LanguageError
from language.scene_file import read_scene
from trainers.export import policy_file
from trainers.run import checkpoint
from trainers.run.metrics import MetricsWriter, read_metrics
from trainers.sweeps.runs import add_start, read_config, read_overrides, read_result, read_starts
from trainers.utils.files import write_checked_json, write_checked_yaml

POLICY = "nl_reach_kuka"
RESULT = {"success_at_end": 0.5, "ci95": [0.4, 0.6], "episodes": 50, "wrong_object": 0.1, "frames": 7, "wall_s": 1.5}
SCENE = "- {id: a, noun: cube, color: red, position: [0.5, 0.1, 0.0]}\n"


@dataclass(frozen=True)
class FileKind:
    """A kind of file. write: makes a whole one in a folder and returns its path. read: gives its values.

    checked: whether damage that gives other values is noticed; people write scenes, which have no checksum.
    """

    name: str
    write: Callable[[Path], Path]
    read: Callable[[Path], Any]
    checked: bool = True


def _failure(kind: FileKind, path: Path, whole: str, damage: str) -> str:
    try:
        value = repr(_plain(kind.read(path)))
    except (ConfigError, LanguageError) as error:
        return f"{damage}: message of several lines" if "\n" in str(error) else ""
    except Exception as error:
        return f"{damage}: {type(error).__name__}: {error}"
    same = value == whole or (kind.name == "metrics.csv" and whole.startswith(value.rstrip("]")))
    return "" if same or not kind.checked else f"{damage}: other values"


def _damaged(content: bytes, rng: random.Random) -> tuple[str, bytes]:
    """Return the kind of damage, and the content with it."""
    data, at = bytearray(content), rng.randrange(len(content))
    end = min(len(data), at + rng.choice([1, 8, 100, len(content) // 3]))
    kind = rng.choice(
        ["bit", "byte", "cut", "head lost", "part lost", "zeros", "doubled", "inserted", "empty", "noise"]
    )
    if kind == "bit":
        data[at] ^= 1 << rng.randrange(8)
    elif kind == "byte":
        data[at] = (data[at] + rng.randrange(1, 256)) % 256
    elif kind == "cut":
        del data[at:]
    elif kind == "head lost":
        del data[: at + 1]
    elif kind == "part lost":
        del data[at:end]
    elif kind == "zeros":
        data[at:end] = bytes(end - at)
    elif kind == "doubled":
        data[at:at] = data[at:end]
    elif kind == "inserted":
        data[at:at] = rng.randbytes(rng.choice([1, 4, 64]))
    else:
        data = bytearray(rng.randbytes(rng.randrange(1, 300)) if kind == "noise" else b"")
    return f"{kind} at {at} of {len(content)}", bytes(data)


def _plain(value: Any) -> Any:
    """Return the value with tensors as their bytes, and without entries that only describe the file."""
    if isinstance(value, torch.Tensor):
        return (str(value.dtype), tuple(value.shape), hash(value.detach().contiguous().numpy().tobytes()))
    if isinstance(value, torch.nn.Module):
        return _plain(value.state_dict())
    if isinstance(value, dict):
        return sorted((str(key), _plain(item)) for key, item in value.items() if key != "sha256")
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def _write_checkpoint(folder: Path) -> Path:
    payload = checkpoint.load(checkpoint.find(Path(POLICY)))
    payload |= {"counters": {"frames": 7, "best": 0.5}, "rng": torch.get_rng_state()}
    checkpoint.save(folder / "last.pt", payload)
    return folder / "last.pt"


def _copy(source: Path) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        (folder / source.name).write_bytes(source.read_bytes())
        return folder / source.name

    return write


def _write_metrics(folder: Path) -> Path:
    metrics = MetricsWriter(folder, ["frames", "train/success", "eval/success_at_end"])
    for frames in range(1, 40):
        metrics.write({"frames": frames, "train/success": frames / 41})
    metrics.close()
    return folder / "metrics.csv"


def _write_config(folder: Path) -> Path:
    from omegaconf import OmegaConf

    write_checked_yaml(folder / "config.yaml", OmegaConf.to_yaml(compose(), resolve=True))
    return folder / "config.yaml"


def _write_sweep(folder: Path) -> Path:
    for seed in range(3):
        add_start(folder, ["robot=kuka,panda", f"seed={seed}"])
    return folder / "sweep.yaml"


def _write_json(name: str, values: dict[str, Any]) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        write_checked_json(folder / name, values)
        return folder / name

    return write


def _write_scene(folder: Path) -> Path:
    (folder / "scene.yaml").write_text("".join(SCENE.replace("id: a", f"id: a{i}") for i in range(5)))
    return folder / "scene.yaml"


def _human() -> Any:
    from envs.config import read_env

    return read_env(compose(["workspace=collabtable"])).workspace.human


def _known(values: dict[str, Any], keys: Any) -> str:
    """Return the values under these keys, as text: damage of the checksum's own name only adds a key."""
    return json.dumps({str(key): values.get(key) for key in keys}) + yaml.safe_dump("")


KINDS = (
    FileKind("last.pt", _write_checkpoint, checkpoint.load),
    FileKind("policy.safetensors", _copy(policy_file.FOLDER / POLICY / "policy.safetensors"), checkpoint.load),
    FileKind("pointing.npz", _copy(SHIPPED_WEIGHTS), lambda path: load(path, _human())),
    FileKind("metrics.csv", _write_metrics, read_metrics),
    FileKind("config.yaml", _write_config, lambda path: _known(read_config(path.parent), compose())),
    FileKind("eval.json", _write_json("eval.json", RESULT), lambda path: _known(read_result(path.parent), RESULT)),
    FileKind("job.json", _write_json("job.json", {"overrides": ["seed=1"]}), lambda path: read_overrides(path.parent)),
    FileKind("sweep.yaml", _write_sweep, lambda path: [start["overrides"] for start in read_starts(path.parent)]),
    FileKind("scene.yaml", _write_scene, read_scene, checked=False),
)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_damaged_file_is_refused_or_read_with_the_same_values(kind, row, tmp_path):
    path = kind.write(tmp_path)
    content, whole = path.read_bytes(), repr(_plain(kind.read(path)))
    for index in range(row.number(sample=5, thorough=250)):
        damage, damaged = _damaged(content, row.rng)
        path.write_bytes(damaged)
        row.count(_failure(kind, path, whole, f"{kind.name} {index}: {damage}"))
    row.check()
