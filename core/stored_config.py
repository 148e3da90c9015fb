"""Configs that come from files: of a checkpoint, a policy, a recording or a sweep. Whatever reads one passes it here.

A file may say *what* is computed: the task, a robot of a package, the algorithm, sizes. It may not say *where*, or
*with what else*: addresses, devices, loggers that send data away, other files. Only the user's command line says that.
Otherwise somebody's run folder could have this machine connect, read or execute.

`PLACES` lists the keys of the second kind. A key whose value is free text is listed there or in `WORDS`; numbers,
truth values and choices from a fixed list describe what is computed. A test looks for keys that are in neither table.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from core.composition import compose, groups
from core.errors import ConfigError


@dataclass(frozen=True)
class Place:
    """A key that says where a run computes, or which other files it reads.

    Attributes:
        harmless: the values that a file may give it. The first one replaces other values where the key is not used.
        trains_only: whether only training uses the key.
    """

    harmless: tuple[Any, ...]
    trains_only: bool = False


PLACES: dict[str, Place] = {
    "device": Place(("cpu",), trains_only=True),
    "logger": Place((["tensorboard"], []), trains_only=True),
    "collector.name": Place(("local",), trains_only=True),
    "collector.address": Place((None,), trains_only=True),
    "collector.dashboard": Place((False,), trains_only=True),
    "robot.urdf": Place(()),  # a relative path in the package that robot.package names is no place
    "workspace.human.urdf": Place((None,)),
    "gesture.weights": Place((None,)),
    "perception.weights": Place((None,)),
}
UNUSED = ("resume", "init", "sweep.resume")  # a run that is resumed or a policy that is loaded needs none of them
WORDS = (  # keys whose free text names something of the project, its words or a robot's parts
    "algo.adapter",
    "algo.compile",
    "algo.critic_normalisation",
    "algo.loss",
    "algo.name",
    "algo.options",
    "algo.target",
    "choices",
    "collector.mode",
    "control.name",
    "gesture.source",
    "gesture.style",
    "gripper.name",
    "perception.cameras",
    "perception.name",
    "physics.name",
    "policy.activation",
    "policy.encoder",
    "policy.imitation",
    "policy.name",
    "policy.pictures",
    "robot.fingers",
    "robot.grippers",
    "robot.hinge.joint",
    "robot.joints",
    "robot.name",
    "robot.package",
    "robot.tip",
    "task.held_out",
    "task.kinds",
    "task.name",
    "task.nouns",
    "task.objects",
    "task.split",
    "task.verbs",
    "task.viewpoint",
    "workspace.fittings",
    "workspace.cameras",
    "workspace.human.camera.mount",
    "workspace.name",
)
WORD = re.compile(r"[\w .,'+{}-]{0,200}")  # no slash, colon or backslash: no path and no address


def config_from_file(
    config: Mapping[str, Any], source: Path, given: Sequence[str] = (), to_train: bool = False
) -> dict[str, Any]:
    """Check a config that a file holds, and return it without places that are not used.

    Args:
        config: composed, as plain values.
        source: the file, for messages.
        given: overrides of the user's command line, which may name any place. They are not applied here.
        to_train: whether a run continues with the config; otherwise the keys that only training uses are reset.

    Raises:
        ConfigError: the config names a place that the user did not.
    """
    checked: dict[str, Any] = copy.deepcopy(dict(config))
    for key, value in _leaves(checked):
        _check_value(key, value, source)
    _add_cameras(checked)
    for key in UNUSED:
        _set(checked, key, None)
    named = {word.partition("=")[0].lstrip("+") for word in given}
    if not to_train and _get(checked, "collector.name") not in (None, "local"):
        checked["collector"] = {"name": "local", "worlds": _get(checked, "collector.worlds")}
    for key, place in PLACES.items():
        value = _get(checked, key)
        if value is None or value in place.harmless or (key == "robot.urdf" and _is_in_package(checked)):
            continue
        used = to_train or not place.trains_only
        if used and key not in named and key.partition(".")[0] not in named:
            raise ConfigError(
                f"{source} asks for {key}={value}: a file may not say where to compute, or which other files to read; "
                f"if you want that, give {key}={value} on the command line"
            )
        if place.harmless:
            _set(checked, key, place.harmless[0])
    return checked


def _add_cameras(config: dict[str, Any]) -> None:
    """Give a config from before `workspace.cameras` the cameras of its workspace today, and its own one for films."""
    from omegaconf import OmegaConf

    workspace = config.get("workspace")
    if not isinstance(workspace, dict) or "camera" not in workspace:
        return
    cameras, name = workspace.get("cameras"), workspace.get("name")
    if not cameras and name in groups()["workspace"]:
        cameras = OmegaConf.to_container(compose([f"workspace={name}"])["workspace"]["cameras"], resolve=True)
    if not cameras or isinstance(cameras, dict):
        workspace["cameras"] = {**(cameras or {}), "film": workspace.pop("camera")}


def place_overrides(words: Sequence[str]) -> list[str]:
    """Return the overrides that name places: they are given again where a run is resumed from its file."""
    keys = {*PLACES, *(key.partition(".")[0] for key in PLACES if key.startswith("collector."))}
    return [word for word in words if word.partition("=")[0].lstrip("+") in keys]


def places_of(config: Mapping[str, Any]) -> list[str]:
    """Return the words that name the config's places: whoever resumes a run from its file gives them again."""
    words = []
    for key, place in PLACES.items():
        value = _get(config, key)
        if value is None or value in place.harmless or (key == "robot.urdf" and _is_in_package(config)):
            continue
        name = "collector" if key == "collector.name" else key
        shown = f"[{','.join(map(str, value))}]" if isinstance(value, list) else str(value)
        words.append(f"{name}={shown.lower() if isinstance(value, bool) else shown}")
    return words


def _check_value(key: str, value: Any, source: Path) -> None:
    """Raise ConfigError for an interpolation, a class to be called, and text where no text belongs."""
    name = key.rpartition(".")[2]
    if name == "_target_" or (isinstance(value, str) and "${" in value):
        raise ConfigError(f"{source}: {key}={value} is not a plain value; a file holds plain values only")
    if isinstance(value, str) and _place_of(key) is None and not WORD.fullmatch(value):
        raise ConfigError(f"{source}: {key}={value[:100]} is neither a number nor a word; a file holds no paths there")


def _place_of(key: str) -> str | None:
    """Return the entry of `PLACES` or `UNUSED` that a leaf belongs to; `logger.0` belongs to `logger`."""
    return next((place for place in (*PLACES, *UNUSED) if key == place or key.startswith(place + ".")), None)


def _is_in_package(config: Mapping[str, Any]) -> bool:
    """Whether the robot's URDF is a file of an installed package."""
    path = Path(str(_get(config, "robot.urdf")))
    return _get(config, "robot.package") != "file" and not path.is_absolute() and ".." not in path.parts


def _leaves(node: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    items = node.items() if isinstance(node, Mapping) else enumerate(node)
    for name, value in items:
        key = f"{prefix}{name}"
        if isinstance(value, Mapping | list | tuple):
            yield from _leaves(value, key + ".")
        else:
            yield key, value


def _get(config: Any, key: str) -> Any:
    for name in key.split("."):
        config = config.get(name) if isinstance(config, Mapping) else None
    return config


def _set(config: Any, key: str, value: Any) -> None:
    """Set a key that exists."""
    *groups, last = key.split(".")
    for name in groups:
        config = config.get(name)
        if not isinstance(config, dict):
            return
    if last in config:
        config[last] = value
