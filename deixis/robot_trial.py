"""Trials of a robot in the simulation: what the scripted experts achieve with it, and which values suit its motors."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import yaml

from core.composition import compose, groups
from core.errors import ConfigError, did_you_mean
from core.safe_files import FileError, read_yaml
from core.schema import read
from envs import read_env
from envs.experts import EXPERTS, expert
from envs.sim.robot_config import RobotConfig, urdf_path
from envs.sim.robot_import.guess import Given, Guess, RobotGuess
from envs.sim.urdf_file import URDFError
from envs.workspace_env import WorkspaceEnv
from trainers.evaluation.evaluation import evaluate
from trainers.utils.files import WriteError, atomic_file

WORLDS, SEED = 8, 100
MOTORS = ((0.3, 1.0), (0.15, 0.5), (0.08, 0.3))  # gain, and share of the speeds: the later ones for weak motors
GOOD, DISTURBING = 0.98, 0.02  # success that is not tried to be raised; share of episodes that push other objects
CLEARANCES = (0.02, 0.03)  # metres that are tried where it pushes them
KEYS = {  # comments of the YAML
    "base": "m: where the URDF's root stands on the table",
    "max_speed": "rad/s, or m/s",
    "rest": "rad, or m: the gripper points down over the middle of the table",
    "tip_offset": "m: gripper centre in the tip's frame",
    "approach": "where the gripper points, in the tip's frame",
    "magnet": "m: radius and length",
    "reach": "m: x0, x1, y0, y1, z0, z1; []: all of every workspace",
    "clearance": "m over objects that it must not touch",
}
Files = dict[Path, bytes]
Results = dict[str, dict[str, Any]]


class Trial:
    """Tries a guessed robot, and chooses what can only be seen in motion: gain, speeds and clearance.

    Attributes:
        told: what was chosen, in sentences.

    Args:
        guess: the robot.
        urdf: the file that it was guessed from.
        folder: for its mended URDF.
        fixed: keys that the user gave.
    """

    def __init__(self, guess: Guess, urdf: Path, folder: Path, fixed: Sequence[str]) -> None:
        self._fixed, self._values = fixed, dict(guess.values)
        place = urdf.absolute()
        if guess.urdf is not None:
            place = folder / "trial" / f"{guess.values['name']}.urdf"
            place.parent.mkdir()
            place.write_bytes(guess.urdf)
            for name, content in guess.meshes.items():
                meshes = place.parent / f"{guess.values['name']}_meshes"
                meshes.mkdir(exist_ok=True)
                (meshes / name).write_bytes(content)
        self._values |= {"package": "file", "urdf": str(place)}
        self.told: list[str] = []

    def tune(self, tasks: Sequence[str], episodes: int) -> tuple[dict[str, Any], Results]:
        """Return the values with which the experts succeed most often, and their results. Raises ConfigError."""
        values, results = self._motors(tasks, episodes)
        values, results = self._clearances(values, results, tasks, episodes)
        return values, results

    def _motors(self, tasks: Sequence[str], episodes: int) -> tuple[dict[str, Any], Results]:
        speeds = self._values["max_speed"]
        found: list[tuple[float, int, dict[str, Any], Results]] = []
        refused: ConfigError | None = None
        for number, (gain, share) in enumerate(MOTORS):
            changes = {"gain": gain, "max_speed": [round(max(0.01, speed * share), 3) for speed in speeds]}
            values = self._values | {key: value for key, value in changes.items() if key not in self._fixed}
            if number and values == self._values:
                break
            try:
                results = measure(values, tasks, episodes)
            except ConfigError as error:
                refused = refused or error
                continue
            found.append((worst(results), -number, values, results))
            if worst(results) >= GOOD:
                break
        if not found:
            assert refused is not None
            raise ConfigError(self._named(str(refused)))
        _, number, values, results = max(found, key=lambda each: each[:2])
        if number:
            self.told.append(
                f"its motors are weak: gain={values['gain']} and {MOTORS[-number][1]:g} of the speeds suit them better."
            )
        return values, results

    def _named(self, text: str) -> str:
        return text.replace(f"robot.urdf={self._values['urdf']}", f"robot={self._values['name']}")

    def _clearances(
        self, values: dict[str, Any], results: Results, tasks: Sequence[str], episodes: int
    ) -> tuple[dict[str, Any], Results]:
        if "clearance" in self._fixed:
            return values, results
        for clearance in CLEARANCES:
            if disturbed(results) <= DISTURBING:
                break
            higher = values | {"clearance": clearance}
            again = measure(higher, tasks, episodes)
            if worst(again) < min(GOOD, worst(results)) or disturbed(again) >= disturbed(results):
                break
            values, results = higher, again
        if values["clearance"] != self._values["clearance"]:
            self.told.append(f"it reaches {values['clearance']} m over objects, since it pushed others lower down.")
        return values, results


def worst(results: Results) -> float:
    """Return the least success of the tasks."""
    return min(float(result["success_at_end"]) for result in results.values())


def disturbed(results: Results) -> float:
    """Return the greatest share of episodes of a task in which other objects were pushed."""
    return max(float(result["disturbed"] or 0.0) for result in results.values())


def measure(values: Mapping[str, Any], tasks: Sequence[str], episodes: int) -> Results:
    """Return the results of each task's expert. Raises ConfigError for a robot that cannot be built."""
    results = {}
    for task in tasks:
        if task not in EXPERTS:
            raise ConfigError(f"tasks={task} has no scripted expert" + did_you_mean(task, EXPERTS))
        config = compose([f"task={task}", "robot=kuka"])
        config["robot"] = dict(values)
        with closing(WorkspaceEnv(read_env(config).without_curriculum(), min(WORLDS, episodes), SEED)) as env:
            results[task] = evaluate(env, expert(env), episodes, SEED).as_dict()  # type: ignore[arg-type]
    return results


# ---- files


def files_of(guess: Guess, urdf: Path, target: Path) -> Files:
    """Return the files that stand beside the YAML: a mended URDF, and meshes."""
    if guess.urdf is None:
        return {}
    name = guess.values["name"]
    meshes = {target.parent / f"{name}_meshes" / mesh: content for mesh, content in guess.meshes.items()}
    return {**meshes, target.with_suffix(".urdf"): guess.urdf}


def write_files(files: Files, values: Mapping[str, Any], target: Path, urdf: Path) -> None:
    """Write all files or none, the YAML last. Raises WriteError."""
    mended = target.with_suffix(".urdf")
    place = mended if mended in files else urdf
    content = yaml_of({**values, "package": "file", "urdf": str(place.absolute())}, urdf)
    new = [path for path in (*files, target) if not path.exists()]
    try:
        for path, data in {**files, target: content.encode()}.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            with atomic_file(path) as file:
                file.write(data)
    except (WriteError, OSError) as error:
        for path in new:
            path.unlink(missing_ok=True)
        shutil.rmtree(target.parent / f"{values['name']}_meshes", ignore_errors=True)
        if isinstance(error, WriteError):
            raise
        raise WriteError(f"{target} cannot be written: {error.strerror or error}") from None


def yaml_of(values: Mapping[str, Any], urdf: Path) -> str:
    """Return a robot's YAML, in the order of the shipped ones."""
    order = ["name", "package", "urdf", *(key for key in values if key not in ("name", "package", "urdf"))]
    lines = [f"# {values['name']}: made from {urdf.name!r} by `deixis robot add`. After an edit: `deixis robot check`."]
    for key in order:
        text = yaml.safe_dump(values[key], default_flow_style=True, width=10_000, allow_unicode=True)
        text = text.removesuffix("\n...\n").strip()
        lines.append(f"{key}: {text}" + (f"   # {KEYS[key]}" if key in KEYS else ""))
    return "\n".join([*lines, ""])


# ---- robots that have a YAML


def config_of(place: str, fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a robot: of an option's name, or of the path of a YAML. Raises ConfigError."""
    options = groups()["robot"]
    if place in options:
        values = compose([f"robot={place}"])["robot"]
        node = {key: values[key] for key in values}
    else:
        if not Path(place).suffix:
            raise ConfigError(f"{place} is no robot, and no YAML" + did_you_mean(place, options))
        try:
            node = read_yaml(Path(place))
        except FileError as error:
            raise ConfigError(f"{place} {error}") from None
        if not isinstance(node, dict):
            raise ConfigError(f"{place} must be a group of keys, as in conf/robot/kuka.yaml")
    return asdict(read(RobotConfig, {**node, **fields}, "robot"))


def surveyed(values: Mapping[str, Any], packages: tuple[Path, ...], workspaces: tuple[Any, list[list[float]]]) -> Guess:
    """Return how far a robot reaches and what touches at rest, with all of its values as given. Raises ConfigError."""
    urdf = urdf_path(read(RobotConfig, dict(values), "robot"))
    fields = {key: value for key, value in values.items() if key not in ("name", "package", "urdf")}
    with TemporaryDirectory() as folder:
        try:
            given = Given(name=str(values["name"]), fields=fields, packages=packages)
            return RobotGuess(urdf, given, Path(folder)).make(*workspaces)
        except URDFError as error:
            raise ConfigError(f"{urdf} {error}") from None
