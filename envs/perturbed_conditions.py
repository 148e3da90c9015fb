"""The conditions under which `evaluate.py robustness=true` evaluates a policy. Each changes one thing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from core.errors import ConfigError
from envs.tasks import RandomizeConfig

PLAIN = "plain"
MORE_OBJECTS = 2
MOST_OBJECTS = 8
WORKSPACES = ("table", "collabtable", "drawer", "fridge")


@dataclass(frozen=True)
class Condition:
    """overrides: of the checkpoint's config. randomize: the domain randomisation of every episode."""

    overrides: list[str] = field(default_factory=list)
    randomize: RandomizeConfig = field(default_factory=RandomizeConfig)


def each_condition(
    config: Mapping[str, Any], evaluate: Callable[[Condition], dict[str, Any]]
) -> tuple[dict[str, dict[str, Any]], dict[str, str]]:
    """Return the results of `evaluate` by the conditions' names, and why the others are impossible for this config.

    Raises:
        ConfigError: even the plain condition is impossible.
    """
    results, impossible = {}, {}
    for name, condition in conditions(config).items():
        try:
            results[name] = evaluate(condition)
        except ConfigError as error:
            if name == PLAIN:
                raise
            impossible[name] = str(error)
    return results, impossible


def conditions(config: Mapping[str, Any]) -> dict[str, Condition]:
    """Return the conditions by their names, the plain one first. config: the checkpoint's, composed.

    Some may be impossible for a task or robot; building an environment for them raises ConfigError.
    """
    task, physics = config["task"], config["physics"]
    return {
        PLAIN: Condition(),
        "start poses, 0.3 rad": Condition(["task.reset_noise=0.3"]),
        **_sizes(task["object_size"]),
        **{
            f"objects {word}": Condition(randomize=RandomizeConfig(mass=[factor, factor]))
            for word, factor in (("4 x lighter", 0.25), ("4 x heavier", 4.0))
        },
        **{
            f"friction x {factor:g}": Condition(randomize=RandomizeConfig(friction=[factor, factor]))
            for factor in (0.5, 2.0)
        },
        **_counts(task),
        **_time_steps(physics),
        "action noise 20 %": Condition(randomize=RandomizeConfig(action_noise=0.2)),
        "observation noise 5 mm": Condition(randomize=RandomizeConfig(observation_noise=0.005)),
        "delay of 1 step": Condition(randomize=RandomizeConfig(delay=[1, 1])),
        **_workspaces(config),
    }


def _sizes(size: float) -> dict[str, Condition]:
    return {
        f"objects {word} ({1000 * new:.0f} mm)": Condition([f"task.object_size={new:g}"])
        for word, new in (("smaller", 0.8 * size), ("larger", 1.2 * size))
    }


def _counts(task: Mapping[str, Any]) -> dict[str, Condition]:
    """Fewer and more objects than in training."""
    usual = task["num_objects"]
    return {
        f"{count} objects": Condition([f"task.num_objects={count}", f"task.min_objects={count}"])
        for count in (usual - 1, min(usual + MORE_OBJECTS, MOST_OBJECTS))
        if count not in (0, usual)
    }


def _time_steps(physics: Mapping[str, Any]) -> dict[str, Condition]:
    """Half and twice the physics' time step, with control steps as long as before."""
    step, substeps = physics["time_step"], physics["substeps"]
    changed = {"half": (step / 2, 2 * substeps), "double": (2 * step, substeps // 2)}
    return {
        f"{word} the time step": Condition([f"physics.time_step={new}", f"physics.substeps={count}"])
        for word, (new, count) in changed.items()
        if substeps % 2 == 0
    }


def _workspaces(config: Mapping[str, Any]) -> dict[str, Condition]:
    """Return the other workspaces in which the task can be done: with a person, where one points."""
    if config["workspace"]["name"] not in WORKSPACES or config["gesture"]["source"] != "none":
        return {}
    others = [name for name in WORKSPACES if name != config["workspace"]["name"]]
    return {f"workspace {name}": Condition([f"workspace={name}"]) for name in others}
