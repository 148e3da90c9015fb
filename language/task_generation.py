"""Scenes as they would be afterwards: objects moved without simulation, and tasks of several steps made that way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from language.describing import Describer
from language.errors import LanguageError, check_known
from language.instruction import Chain, Command, Instruction
from language.objects import Scene
from language.verbs import LIFTED, VERBS

OCCUPIED = 0.04  # metres between centres: nearer than this, a place is taken
CHAINED = ("reach", "push", "pick_and_place", "swipe", "throw", "lift")  # the tasks that generated chains are made of


def scene_after(task: str, init: int | None, goal: int | None, scene: Scene) -> Scene:
    """The scene when the task is done, without simulation; the same one where nothing moves.

    init: index of the object that is moved, goal: of the one whose place it takes, or on top of which it goes.
    Raises LanguageError for an unknown task.
    """
    check_known("task", task, VERBS)
    effect = VERBS[task].effect
    if init is None or not effect or (effect in ("goal", "on") and goal is None):
        return scene
    positions = scene.positions.copy()
    if effect == "up":
        positions[init] += (0.0, 0.0, LIFTED)
    else:
        positions[init] = scene.positions[goal]
    if effect == "on":
        positions[init, 2] += (scene.sizes[init] + scene.sizes[goal]) / 2
    return scene.moved(positions)


@dataclass(frozen=True)
class GeneratedTask:
    """A command of several steps, with the scene before each step and after the last."""

    command: Command
    scenes: tuple[Scene, ...]


def generate_tasks(
    scene: Scene,
    width: int,
    depth: int,
    seed: int = 0,
    tasks: tuple[str, ...] = CHAINED,
    describer: Describer | None = None,
) -> list[GeneratedTask]:
    """At most `width` different tasks of `depth` steps.

    Each step is feasible in the scene that it meets - what moves is real, where it goes is free - and described
    there, so that `understand` grounds the whole command step by step. Fewer come where the scene gives no more.
    Raises LanguageError for a width or depth below 1, or an unknown task.
    """
    for name, value in (("width", width), ("depth", depth)):
        if value < 1:
            raise LanguageError(f"{name}={value} must be at least 1")
    for task in tasks:
        check_known("task", task, VERBS)
    rng = np.random.default_rng(seed)
    describer = describer or Describer(("color", "shape", "color_shape", "superlative", "relation"))
    found: dict[Command, GeneratedTask] = {}
    for _ in range(10 * width):
        generated = _generate(scene, depth, rng, tasks, describer)
        if generated is not None:
            found.setdefault(generated.command, generated)
        if len(found) == width:
            break
    return list(found.values())


def _generate(
    scene: Scene, depth: int, rng: np.random.Generator, tasks: tuple[str, ...], describer: Describer
) -> GeneratedTask | None:
    steps: list[Instruction] = []
    scenes = [scene]
    for _ in range(depth):
        possible = [option for task in tasks for option in _feasible(task, scenes[-1], describer)]
        if not possible:
            return None
        task, init, goal = possible[rng.integers(len(possible))]
        steps.append(_instruction(task, init, goal, scenes[-1], rng, describer))
        scenes.append(scene_after(task, init, goal, scenes[-1]))
    return GeneratedTask(steps[0] if depth == 1 else Chain(tuple(steps)), tuple(scenes))


def _feasible(task: str, scene: Scene, describer: Describer) -> list[tuple[str, int | None, int | None]]:
    """(task, init, goal) for all that can be done and named here."""
    named = describer.nameable(scene)
    things = np.flatnonzero(named).tolist()
    if not VERBS[task].moves:
        return [(task, None, goal) for goal in things]
    movable = [thing for thing in things if not scene.targets[thing] and _is_free(scene, thing)]
    if not VERBS[task].takes_goal:
        return [(task, init, None) for init in movable]
    real = VERBS[task].effect == "on"
    goals = [goal for goal in things if scene.targets[goal] != real and _is_free(scene, goal)]
    return [(task, init, goal) for init in movable for goal in goals if goal != init]


def _is_free(scene: Scene, thing: int) -> bool:
    """Whether nothing stands where the target is, or on top of the real thing."""
    offset = scene.positions - scene.positions[thing]
    if scene.targets[thing]:
        taken = (np.abs(offset) < OCCUPIED).all(axis=1) & ~scene.targets
    else:
        over = (np.abs(offset[:, :2]) < OCCUPIED).all(axis=1) & (offset[:, 2] > OCCUPIED / 2)
        taken = over & ~scene.targets & (offset[:, 2] < 2 * scene.sizes[thing])
    return not taken.any()


def _instruction(
    task: str, init: int | None, goal: int | None, scene: Scene, rng: np.random.Generator, describer: Describer
) -> Instruction:
    first = goal if init is None else init
    assert first is not None
    phrase = describer.phrase(scene, first, rng)
    return Instruction(task, phrase, None if init is None or goal is None else describer.phrase(scene, goal, rng))
