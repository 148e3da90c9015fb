"""Files made to execute something, to fill the memory, to hang, or to overwrite files of others."""

from __future__ import annotations

import json
import os
import pickle
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import yaml

from core.overrides import apply, compose
from human.ray_reader import SHIPPED_WEIGHTS
from tools.forked import call
from trainers.run import checkpoint
from trainers.run.metrics import MetricsWriter, read_metrics
from trainers.run.run_folder import FolderLock
from trainers.sweeps.arguments import expand_resume
from trainers.sweeps.job import find_job_folder
from trainers.sweeps.runs import find_runs
from trainers.utils.files import atomic_file, write_text

POLICY = "nl_reach_kuka"
RESULT = {"success_at_end": 0.5, "ci95": [0.4, 0.6], "episodes": 50, "wrong_object": 0.1, "frames": 7, "wall_s": 1.5}
SCENE = "- {id: a, noun: cube, color: red, position: [0.5, 0.1, 0.0]}\n"
MAX_SECONDS, MAX_BYTES = 1.0, 200 * 2**20
Case = tuple[str, Callable[[Path], Callable[[], object]]]  # name, and a maker of the file that returns its reader


class Owned:
    """A pickle that creates a file when it is loaded."""

    def __reduce__(self) -> Any:
        return os.mkdir, ("owned",)


def _failure(read: Callable[[], object], folder: Path) -> str:
    outcome = call(read, folder / "work", timeout=30.0)
    if any(folder.rglob("owned")):
        return "executed"
    if (folder / "others").read_text() != "precious":
        return "a file of others was changed"
    if outcome.cpu_seconds > MAX_SECONDS or outcome.code < 0:
        return f"{outcome.cpu_seconds:.1f} s, exit status {outcome.code}"
    return f"{outcome.memory / 2**20:.0f} MiB" if outcome.memory > MAX_BYTES else ""


def _bomb(levels: int = 9, merge: str = "<<") -> str:
    lines = ["a0: &a0 {k: v}"]
    lines += [f"a{i}: &a{i} {{{merge}: [{', '.join([f'*a{i - 1}'] * 9)}]}}" for i in range(1, levels)]
    return "\n".join(lines)


YAMLS = {
    "merge bomb": _bomb(),
    "alias bomb": _bomb(merge="x"),
    "deep nesting": "[" * 100_000,
    "a million objects": SCENE * 1_000_000,
    "os.system tag": "!!python/object/apply:os.mkdir [owned]",
    "object tag": "!!python/object/new:subprocess.Popen [[touch, owned]]",
    "sexagesimal number": "- {noun: cube, color: red, position: [" + "1:" * 20_000 + "1.5, 0, 0]}",
    "endless number": "- " + "9" * 60_000,
    "binary": "- !!binary " + "AAAA" * 50_000,
}


def _scenes() -> Iterator[Case]:
    from language.scene_file import read_scene

    for name, text in YAMLS.items():
        yield f"scene: {name}", partial(_written, "scene.yaml", text, read_scene)
    yield "scene: FIFO", partial(_fifo, "scene.yaml", read_scene)
    yield "scene: /dev/zero", partial(_linked, "scene.yaml", "/dev/zero", read_scene)
    yield "scene: sparse terabyte", partial(_sparse, "scene.yaml", read_scene)


def _records() -> Iterator[Case]:
    for name, text in YAMLS.items():
        yield f"config.yaml: {name}", partial(_written, "config.yaml", text, lambda path: find_runs(path.parent))
        yield f"sweep.yaml: {name}", partial(_written, "sweep.yaml", text, _resume_sweep)
    for name in ("sweep.yaml", "config.yaml", "job.json", "metrics.csv", "eval.json"):
        yield f"{name}: FIFO", partial(_fifo, name, _read_run)
        yield f"{name}: sparse terabyte", partial(_sparse, name, _read_run)
    yield "job.json: deep nesting", partial(_written, "job.json", "[" * 200_000, _read_run)
    words = (
        "+hydra.callbacks.x._target_=joblib.load",
        "hydra.launcher._target_=os.mkdir",
        "hydra.searchpath=[file://.]",
    )
    for word in (
        *words,
        "+hydra.callbacks.x={_target_: os.mkdir, path: owned}",
        "seed=${oc.env:HOME}",
        "robot.urdf=/x",
    ):
        text = yaml.safe_dump([{"overrides": [word]}])
        yield f"sweep.yaml: {word}", partial(_written, "sweep.yaml", text, _run_sweep)


def _tensors() -> Iterator[Case]:
    payload = checkpoint.load(checkpoint.find(Path(POLICY))) | {"counters": {"frames": 7}, "rng": torch.get_rng_state()}
    nested: Any = torch.zeros(1)
    for _ in range(9):
        nested = [nested] * 9
    values: dict[str, Any] = {
        "pickle": {**payload, "x": Owned()},
        "bytearray": {**payload, "x": bytearray(10)},
        "expanded tensor": {**payload, "algorithm": {"policy": {"w": torch.zeros(1).expand(10**9)}}},
        "references": {**payload, "algorithm": {"policy": {"w": torch.zeros(1)}, "x": nested}},
        "_target_": {**payload, "config": payload["config"] | {"x": {"_target_": "os.mkdir", "path": "owned"}}},
        "resolver": {**payload, "config": payload["config"] | {"seed": "${oc.env:HOME}"}},
    }
    for name, value in values.items():
        yield f"last.pt: {name}", partial(_saved, value)
    yield "last.pt: deflated", _deflated
    yield "last.pt: bare pickle", partial(_bytes, "last.pt", pickle.dumps(Owned()), _load)
    yield "last.pt: sparse terabyte", partial(_sparse, "last.pt", _load)
    yield "last.pt: FIFO", partial(_fifo, "last.pt", _load)
    header = (2**40).to_bytes(8, "little")
    yield "policy: header of a terabyte", partial(_bytes, "policy.safetensors", header + b"{}", _load)
    name, header = "policy: header of 90 MB", (90 * 10**6).to_bytes(8, "little")
    yield name, partial(_bytes, "policy.safetensors", header + b"{" + b" " * 90 * 10**6, _load)


def _arrays() -> Iterator[Case]:
    arrays = dict(np.load(SHIPPED_WEIGHTS))
    yield "pointing.npz: deflated bomb", partial(_npz, arrays | {"bomb": np.zeros(10**8, np.uint8)})
    yield "pointing.npz: objects", partial(_npz, arrays | {"middle": np.array([Owned()], dtype=object)})
    yield "pointing.npz: FIFO", partial(_fifo, "pointing.npz", _read_rays)
    yield "pointing.npz: sparse terabyte", partial(_sparse, "pointing.npz", _read_rays)


def _places() -> Iterator[Case]:
    """Folders in which a file of a run is a link to a file of others."""
    writers: dict[str, Callable[[Path], object]] = {
        "metrics.csv": lambda folder: MetricsWriter(folder, ["frames"], after=3).close(),
        "eval.json": lambda folder: write_text(folder / "eval.json", "{}"),
        "checkpoints": lambda folder: FolderLock(folder).__enter__(),
        ".lock": lambda folder: FolderLock(folder).__enter__(),
        "job.json": lambda folder: find_job_folder(folder, ["seed=0"]),
        f".x.{os.getpid()}": lambda folder: _write_in_a_child(folder),
    }
    for name, write in writers.items():
        yield f"{name}: symbolic link", partial(_link_to_others, name, write, os.symlink)
        yield f"{name}: hard link", partial(_link_to_others, name, write, os.link)


def _configs() -> Iterator[Case]:
    """Configs of checkpoints that name files elsewhere."""
    from omegaconf import OmegaConf

    plain: Any = OmegaConf.to_container(compose(), resolve=True)
    for package, urdf in (
        ("file", "/etc/passwd"),
        ("pybullet_data", "../../../etc/passwd"),
        ("pybullet_data", "/etc/passwd"),
    ):
        config = plain | {"robot": plain["robot"] | {"package": package, "urdf": urdf}}
        yield f"robot.urdf={urdf} in {package}", partial(_read_env, config)


# ---- Functions that make a file and return the call that reads it


def _written(name: str, text: str, read: Callable[[Path], object], folder: Path) -> Callable[[], object]:
    return _bytes(name, text.encode(), read, folder)


def _bytes(name: str, content: bytes, read: Callable[[Path], object], folder: Path) -> Callable[[], object]:
    (folder / name).write_bytes(content)
    return partial(read, folder / name)


def _fifo(name: str, read: Callable[[Path], object], folder: Path) -> Callable[[], object]:
    os.mkfifo(folder / name)
    return partial(read, folder / name)


def _linked(name: str, target: str, read: Callable[[Path], object], folder: Path) -> Callable[[], object]:
    (folder / name).symlink_to(target)
    return partial(read, folder / name)


def _sparse(name: str, read: Callable[[Path], object], folder: Path) -> Callable[[], object]:
    with open(folder / name, "wb") as file:
        file.truncate(2**40)
    return partial(read, folder / name)


def _link_to_others(name: str, write: Callable[[Path], object], link: Any, folder: Path) -> Callable[[], object]:
    link(folder.parent / "others", folder / name)
    return partial(write, folder)


def _saved(value: Any, folder: Path) -> Callable[[], object]:
    torch.save({"format": checkpoint.FORMAT, **value}, folder / "last.pt")
    return partial(_load, folder / "last.pt")


def _deflated(folder: Path) -> Callable[[], object]:
    torch.save(torch.zeros(150 * 10**6), folder / "large.pt")
    with zipfile.ZipFile(folder / "large.pt") as old, zipfile.ZipFile(folder / "last.pt", "w", 8) as new:
        for name in old.namelist():
            new.writestr(name, old.read(name))
    return partial(_load, folder / "last.pt")


def _npz(arrays: dict[str, Any], folder: Path) -> Callable[[], object]:
    np.savez_compressed(folder / "pointing.npz", **arrays)
    return partial(_read_rays, folder / "pointing.npz")


# ---- Readers


def _load(path: Path) -> None:
    apply(checkpoint.load(checkpoint.find(path))["config"], [])


def _read_rays(path: Path) -> None:
    from envs.config import read_env
    from human.ray_reader import load

    load(path, read_env(compose(["workspace=collabtable"])).workspace.human)


def _read_run(path: Path) -> None:
    with suppress(ValueError):
        read_metrics(path.parent / "metrics.csv")
    if not (path.parent / "eval.json").exists():
        (path.parent / "eval.json").write_text(json.dumps(RESULT))
    (path.parent / "config.yaml").exists() or (path.parent / "config.yaml").write_text("seed: 1")
    find_runs(path.parent)


def _resume_sweep(path: Path) -> list[str]:
    return expand_resume([f"sweep.resume={path.parent}"])


def _run_sweep(path: Path) -> None:
    """Return the work of `train.py sweep.resume=` up to the start of the jobs."""
    import train

    train.check_run(_resume_sweep(path))


def _read_env(config: Any, _: Path) -> Callable[[], object]:
    from envs.config import read_env

    return lambda: read_env(apply(config, []))


def _write_in_a_child(folder: Path) -> None:
    with atomic_file(folder / "x") as file:
        file.write(b"mine")


# ---- The test


@pytest.mark.slow
def test_a_hostile_file_does_no_harm(row):
    """Nothing is executed, takes more than 1 s or 200 MiB, or changes a file of others. Each is read in a fork."""
    import trainers.datasets.dataset
    import trainers.reports.report  # noqa: F401  imported once, before the forks

    every = [*_scenes(), *_records(), *_tensors(), *_arrays(), *_places(), *_configs()]
    number = row.number(sample=10, thorough=len(every))
    for name, make in every if number >= len(every) else row.rng.sample(every, number):
        with tempfile.TemporaryDirectory() as text:
            place = Path(text)
            (place / "others").write_text("precious")
            (place / "work").mkdir()
            read = make(place / "work")
            row.count(f"{name}: {failure}" if (failure := _failure(read, place)) else "")
    row.check()
