"""Export a policy for programs without Deixis: `deixis export checkpoint=nl_reach_kuka format=onnx`.

    checkpoint=...    a run directory, a checkpoint file, or a pretrained policy by name
    format=onnx       or torchscript, or safetensors (the weights alone); onnx needs pip install -e ".[export]"
    samples=100       observations with the policy's actions, to check a program that runs the file
    out=<dir>         directory of the files; default: a numbered one in outputs/
    task.num_objects=6 ...   any key of the run's config that sizes of observations follow from

Writes the deterministic policy (its normalisation is in it), interface.json (inputs, output, words, robot, control)
and samples.npz. docs/export.md describes them.
"""

from __future__ import annotations

import inspect
import json
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.data import Bounded, TensorSpec

from core.command_line import check_folder, split
from core.errors import ConfigError
from core.machine_limits import require_docstrings
from core.program import run_program
from core.schema import Checked, any_path, one_of, read, within
from deixis import __version__
from deixis.policy import LoadedPolicy, load_policy
from envs.mdp.object_rows import column_names
from envs.mdp.observations import descriptions
from envs.workspace_env import WorkspaceEnv
from language.lexicon import SAME, WORD_OR_MARK
from trainers.export import policy_file
from trainers.export.exported_policy import ExportedPolicy, names, write_onnx, write_torchscript
from trainers.run import checkpoint
from trainers.utils.files import atomic_directory, refuse_existing

FILES = {"onnx": "policy.onnx", "torchscript": "policy.ts", "safetensors": policy_file.NAME}
FORM = 1  # version of interface.json
DEFAULTS = {"format": "onnx", "samples": 100, "out": None}
WORLDS = 20  # from which the samples are taken
STEPS = 3  # of control between two of them in a world
SEED = 0  # of the samples


@dataclass(frozen=True, kw_only=True)
class ExportConfig(Checked):
    """The program's own keys; see the top of this file."""

    checkpoint: str = any_path()
    format: str = one_of(*FILES)
    samples: int = within(2, 100_000)
    out: str | None = any_path()


def parse(arguments: list[str]) -> tuple[ExportConfig, list[str]]:
    """Read the program's own keys, and return the other words: overrides of the run's config. Raises ConfigError."""
    names_of_keys = [field.name for field in fields(ExportConfig)]
    own, overrides = split(arguments, names_of_keys, "checkpoint=nl_reach_kuka")
    if "checkpoint" not in own:
        raise ConfigError("checkpoint=<run dir, file or name> is missing")
    return read(ExportConfig, DEFAULTS | own, ""), overrides


def main(arguments: list[str]) -> Path:
    """Export a policy, print where it is, and return the directory. Raises ConfigError; nothing is written then."""
    require_docstrings()
    config, overrides = parse(arguments)
    path = checkpoint.find(Path(config.checkpoint))
    place = Path(config.out) if config.out else _numbered(path, config.format)
    refuse_existing(place)
    check_folder("out", str(place))
    policy = load_policy(path, overrides=overrides)
    exported = ExportedPolicy(policy.networks).eval()
    with closing(policy.make_env(WORLDS, overrides, SEED)) as env, atomic_directory(place) as folder:
        samples = draw_samples(policy, env, config.samples)
        if config.format == "safetensors":
            (folder / FILES["safetensors"]).write_bytes(_weights(path, overrides))
        else:
            write = write_onnx if config.format == "onnx" else write_torchscript
            write(exported, samples[:2], folder / FILES[config.format])
        values = dict(zip(names(exported.keys), map(Tensor.numpy, exported.inputs(samples)), strict=True))
        np.savez_compressed(folder / "samples.npz", **values, action=samples["action"].numpy())  # type: ignore[arg-type]
        text = json.dumps(describe_interface(config, env, exported), indent=1)
        (folder / "interface.json").write_text(text + "\n", encoding="utf-8")
    print(f"{place}: {', '.join(sorted(file.name for file in place.iterdir()))}")
    return place


def _weights(path: Path, overrides: list[str]) -> bytes:
    return policy_file.pack(checkpoint.load(path, given=overrides), checkpoint.FORMAT)


def _numbered(path: Path, form: str) -> Path:
    """Return a directory in outputs/ that does not exist yet."""
    folder = path.parent.parent if path.parent.name == "checkpoints" else path.parent
    places = (Path("outputs") / f"{folder.resolve().name}_{form}_{i}" for i in range(1, 10_000))
    return next(place for place in places if not place.exists())


@torch.no_grad()
def draw_samples(policy: LoadedPolicy, env: WorkspaceEnv, count: int) -> TensorDictBase:
    """(count,) observations of the policy at work, with its actions, some steps apart."""
    taken, worlds = [], env.batch_size[0]
    frames = policy(env.reset())
    for _ in range(-(-count // worlds)):
        taken.append(frames.exclude("next").clone())
        for _ in range(STEPS):
            frames = policy(env.step_and_maybe_reset(frames)[1])
    return torch.cat(taken)[:count]


def describe_interface(config: ExportConfig, env: WorkspaceEnv, exported: ExportedPolicy) -> dict[str, Any]:
    """Return what a program must know to run the policy, as JSON has it.

    Args:
        config: of the program.
        env: that it acts in.
        exported: the policy.
    """
    return {
        "form": FORM,
        "deixis": __version__,
        "checkpoint": config.checkpoint,
        "file": FILES[config.format],
        "task": env.config.task.name,
        "inputs": _inputs(env, exported),
        "output": {"name": "action", "shape": ["rows", len(env.action_unit)], "dtype": "float32", "low": -1, "high": 1},
        "words": _words(env),
        "robot": _robot(env),
        "control": _control(env),
    }


def _inputs(env: WorkspaceEnv, exported: ExportedPolicy) -> list[dict[str, Any]]:
    """Return what each input is, in the policy's order."""
    meanings, columns = descriptions(), {"robot": _robot_columns(env), "objects": column_names(env.task)}
    inputs = []
    for key, name in zip(exported.keys, names(exported.keys), strict=True):
        described = _described(name, env.observation_spec[key])
        if name in columns:
            described["columns"] = columns[name]
        inputs.append(described | {"description": meanings[name.replace(".", "/")]})
    return inputs


def _described(name: str, spec: TensorSpec) -> dict[str, Any]:
    """Return the name, shape, type and bounds of an input."""
    described = {"name": name, "shape": ["rows", *spec.shape[1:]], "dtype": str(spec.dtype).removeprefix("torch.")}
    if isinstance(spec, Bounded) and spec.dtype.is_floating_point:
        bounds = zip(("low", "high"), (spec.space.low, spec.space.high), strict=True)
        described |= {side: bound[0].reshape(-1, bound.shape[-1])[0].tolist() for side, bound in bounds}  # of a row
    return described


def _robot_columns(env: WorkspaceEnv) -> list[str]:
    """Return a name for each number of the input `robot`."""
    joints, axes = env.config.robot.joints, ("x", "y", "z")
    names = [*(f"angle of {joint}" for joint in joints), *(f"speed of {joint}" for joint in joints)]
    names += [f"gripper {axis}" for axis in axes]
    names += [f"rotation {row}{column}" for column in (1, 2) for row in (1, 2, 3)]
    return names + ["opening"] + ["closing", "held"] * env.task.traits.grips


def _words(env: WorkspaceEnv) -> dict[str, Any]:
    """Return how a sentence becomes the input `instruction`."""
    rule = (
        "Each match of the pattern that begins with a letter, a digit or _ is a word, in lower case and with the "
        "characters of `same` replaced. Its id is its index in the vocabulary, or that of <unk>. Fill up with 0"
    )
    tokenizer = env.tokenizer
    return {
        "rule": rule,
        "pattern": WORD_OR_MARK.pattern,
        "same": SAME,
        "length": tokenizer.length,
        "vocabulary": list(tokenizer.vocabulary),
    }


def _robot(env: WorkspaceEnv) -> dict[str, Any]:
    """Return the arm: its joints in the order of all lists, their limits and speeds in radians and seconds."""
    robot, kinematics = env.config.robot, env.kinematics
    return {
        "name": robot.name,
        "joints": list(robot.joints),
        "low": kinematics.low.tolist(),
        "high": kinematics.high.tolist(),
        "max_speed": list(robot.max_speed),
        "rest": kinematics.rest.tolist(),
        "tip": robot.tip,
        "tip_offset": list(robot.tip_offset),
        "base": list(robot.base),
    }


def _control(env: WorkspaceEnv) -> dict[str, Any]:
    """Return what an action means."""
    config, control, gripper = env.config, env.control, len(env.action_unit) - len(env.control.unit)
    return {
        "name": config.control.name,
        "hz": 1 / (config.physics.time_step * config.physics.substeps),
        "meaning": " ".join(str(inspect.getdoc(type(control))).split()),
        "hold": "the input `hold` is the action that keeps the arm where it is",
        "max_move": config.control.max_move,
        "box": control.box.tolist(),
        "gripper": "the last number closes the gripper above 0 and opens it below" if gripper else None,
    }


def cli(words: Sequence[str] | None = None) -> None:
    """Run `main` with `words`, by default those of this process. Exits with one line for bad input."""
    run_program(main, __file__, words)


if __name__ == "__main__":
    cli()
