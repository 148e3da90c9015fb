"""Generation of tasks with several steps, by moving objects in a scene without simulation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from language.describing import Describer
from language.errors import LanguageError, check_known
from language.instruction import Chain, Command, Instruction
from language.objects import FITTINGS, HAND, NOUNS, Scene
from language.verbs import CHAINED, LIFTED, VERBS

OCCUPIED = 0.04  # metres between centres below which a place is occupied


def scene_after(task: str, init: int | None, goal: int | None, scene: Scene) -> Scene:
    """Return the scene after a task, without simulation; the same scene if nothing moves.

    Args:
        task: a key of VERBS.
        init: index of the object that is moved.
        goal: index of the object whose place it takes, or on top of which it is put.
        scene: the scene before the task.

    Raises:
        LanguageError: an unknown task.
    """
    check_known("task", task, VERBS)
    effect = VERBS[task].effect
    goal = hand_of(scene) if effect == "hand" else goal
    if init is None or effect in ("", "out") or (effect != "up" and goal is None):
        return scene
    positions = scene.positions.copy()
    if effect == "up":
        positions[init] += (0.0, 0.0, LIFTED)
    else:
        positions[init] = scene.positions[goal]
    if effect == "on":
        positions[init, 2] += (scene.sizes[init] + scene.sizes[goal]) / 2
    if effect == "hand":
        positions[init, 2] += scene.sizes[init] / 2
    return scene.moved(positions)


def hand_of(scene: Scene) -> int | None:
    """Return the index of the person's hand, which no words need to name; None if the scene has none."""
    hands = np.flatnonzero(scene.nouns == list(NOUNS).index(HAND)).tolist()
    return hands[0] if hands else None


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
    """Return up to `width` different tasks of `depth` steps; fewer if the scene does not allow more.

    Each step is feasible in the scene after the steps before it (the object that moves is real, its goal is free) and
    is described in that scene, so that `understand` grounds the whole command step by step.

    Args:
        scene: the scene before the first step.
        width: number of tasks.
        depth: number of steps of each task.
        seed: of the random choices.
        tasks: names of the tasks that steps are drawn from.
        describer: names the objects; None: by colour, shape, superlatives and single relations.

    Raises:
        LanguageError: a width or depth below 1, or an unknown task.
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
    """Return (task, init, goal) for everything that is feasible and nameable in the scene."""
    named = describer.nameable(scene)
    things = np.flatnonzero(named).tolist()
    if not VERBS[task].moves:
        return [(task, None, goal) for goal in things]
    movable = [thing for thing in things if not scene.targets[thing] and _is_free(scene, thing)]
    if not VERBS[task].takes_goal:
        return [(task, init, None) for init in movable]
    fit = possible_goals(task, scene)
    goals = [goal for goal in things if fit[goal] and _is_free(scene, goal)]
    return [(task, init, goal) for init in movable for goal in goals if goal != init]


def possible_goals(task: str, scene: Scene) -> np.ndarray:
    """Return (K,) bool: which objects can be a task's goal: targets, real objects, or fittings."""
    if VERBS[task].effect in ("in", "out"):
        return np.isin(scene.nouns, [list(NOUNS).index(noun) for noun in FITTINGS])
    return scene.targets != VERBS[task].goal_is_real


def _is_free(scene: Scene, thing: int) -> bool:
    """Return whether no object is at the target, or on top of the real object."""
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
