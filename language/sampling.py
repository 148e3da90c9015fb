"""Random instructions, for a given scene or for random scenes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from language.describing import Describer
from language.errors import LanguageError
from language.generator import KINDS, MAX_DEPTH
from language.instruction import Command, Instruction, ObjectPhrase, say
from language.lexicon import LONGEST_SENTENCE
from language.objects import Scene
from language.placement import ObjectSpec, from_all
from language.task_generation import generate_tasks, possible_goals
from language.verbs import VERBS
from language.wording import Wording

OBJECT_COUNTS = (3, 8)  # smallest and largest number of objects in a random scene
AREA = (0.3, 0.7, -0.3, 0.3, 0.0, 0.2)  # of the objects: x0, x1, y0, y1, z0, z1, metres
WIDTHS = (0.03, 0.05, 0.07)  # metres: small, neither, large
SPACING = 0.08  # metres between centres
TARGET_SHARE = 0.25  # share of targets among the objects
TRIES = 50  # attempts to find an instruction whose sentence is not too long


@dataclass(frozen=True)
class Sample:
    """An instruction, a sentence for it, and the scene, in which each of its phrases fits exactly one object."""

    command: Command
    sentence: str
    scene: Scene


class NestedDescriber(Describer):
    """Draws phrases of exactly `depth` nested relations, 1 to MAX_DEPTH."""

    def __init__(self, depth: int) -> None:
        super().__init__(("relation",), redundant=True)
        self.depth = depth

    def nameable(self, scene: Scene) -> np.ndarray:
        """Return (K,) bool: which objects such a phrase fits uniquely."""
        return self.expressions(scene).nameable_nested(self.depth)

    def phrase(self, scene: Scene, referent: int, rng: Generator) -> ObjectPhrase:
        """Return a phrase that fits the referent alone. Raises LanguageError if there is none."""
        return self.expressions(scene).draw_nested(self.depth, referent, rng)


def sample(
    number: int,
    rng: Generator,
    scene: Scene | None = None,
    depth: int | None = None,
    steps: int = 1,
    wording: Wording | None = None,
) -> Iterator[Sample]:
    """Yield random instructions.

    Args:
        number: how many.
        rng: random generator.
        scene: None: a new random scene for each instruction.
        depth: nested relations in each phrase; None: all kinds of phrases, up to two relations.
        steps: of each instruction.
        wording: draws the words; None: the standard sentences.

    Raises:
        LanguageError: a depth outside 0 to MAX_DEPTH, fewer than 1 step, or no scene allows such an instruction.
    """
    describer = _describer(depth)
    for _ in range(number):
        for _ in range(TRIES):
            around = scene or draw_scene(rng)
            command = _command(around, describer, rng, steps)
            sentence = "" if command is None else wording.say(command, rng) if wording else say(command)
            if command is not None and len(sentence) <= LONGEST_SENTENCE:
                yield Sample(command, sentence, around)
                break
        else:
            wanted = f"{steps} step{'s'[: steps > 1]}" + ("" if depth is None else f" with {depth} nested relations")
            raise LanguageError(f"no instruction of {wanted} can be said {'here' if scene else 'in any random scene'}")


def draw_scene(rng: Generator) -> Scene:
    """Return a random scene of OBJECT_COUNTS objects in AREA, the first of which is real."""
    count = int(rng.integers(OBJECT_COUNTS[0], OBJECT_COUNTS[1] + 1))
    target = rng.random(count) < TARGET_SHARE
    target[0] = False
    sizes = rng.choice(WIDTHS, count).tolist()
    specs = [
        ObjectSpec(None, None, AREA, size, role="target" if only_marks else "real")
        for size, only_marks in zip(sizes, target, strict=True)
    ]
    return from_all(specs).draw(rng, SPACING).scene


def _describer(depth: int | None) -> Describer:
    if depth is not None and not 0 <= depth <= MAX_DEPTH:
        raise LanguageError(f"depth={depth} must be from 0 to {MAX_DEPTH}")
    if depth:
        return NestedDescriber(depth)
    return Describer(KINDS if depth is None else [kind for kind in KINDS if kind not in ("relation", "nested")])


def _command(scene: Scene, describer: Describer, rng: Generator, steps: int) -> Command | None:
    """Return an instruction whose phrases are unique in the scene, or None."""
    if steps == 1:
        return _instruction(scene, describer, rng)
    generated = generate_tasks(scene, 1, steps, seed=int(rng.integers(2**32)), describer=describer)
    return generated[0].command if generated else None


def _instruction(scene: Scene, describer: Describer, rng: Generator) -> Instruction | None:
    """Return a task, drawn uniformly among the feasible ones, for nameable objects; None if none is feasible."""
    named = describer.nameable(scene)
    things, movable = (np.flatnonzero(fit) for fit in (named, named & ~scene.targets))
    goals_of = {name: np.flatnonzero(named & possible_goals(name, scene)) for name in VERBS}
    possible = [
        name
        for name, task in VERBS.items()
        if len(movable if task.moves else things)
        and (not task.needs_goal or len(goals_of[name][1:] if task.effect == "on" else goals_of[name]))
    ]
    if not possible:
        return None
    task = possible[rng.integers(len(possible))]
    referent = int(rng.choice(movable if VERBS[task].moves else things))
    phrase = describer.phrase(scene, referent, rng)
    goals = goals_of[task][goals_of[task] != referent]
    says_goal = len(goals) and VERBS[task].takes_goal and (VERBS[task].needs_goal or rng.random() < 0.5)
    return Instruction(task, phrase, describer.phrase(scene, int(rng.choice(goals)), rng) if says_goal else None)
