"""Random instructions for a scene, or for scenes drawn for them."""

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
from language.task_generation import generate_tasks
from language.verbs import VERBS
from language.wording import Wording

DRAWN = (3, 8)  # objects in a drawn scene, at least and at most
AREA = (0.3, 0.7, -0.3, 0.3, 0.0, 0.2)  # metres, where they are
WIDTHS = (0.03, 0.05, 0.07)  # metres: one for each word of size, and one that has none
SPACING = 0.08  # metres
TARGETS = 0.25  # how many of them only mark a place
TRIES = 50  # before we give up to find what can be said, in sentences that are not too long to be read


@dataclass(frozen=True)
class Sample:
    """An instruction, a sentence that says it, and the scene where each of its phrases names exactly one object."""

    command: Command
    sentence: str
    scene: Scene


class NestedDescriber(Describer):
    """Draws phrases of exactly `depth` relations, 1 to MAX_DEPTH, each seen from the next."""

    def __init__(self, depth: int) -> None:
        super().__init__(("relation",), redundant=True)
        self.depth = depth

    def nameable(self, scene: Scene) -> np.ndarray:
        """(K,) bool, which objects such a phrase names uniquely."""
        return self.expressions(scene).nameable_nested(self.depth)

    def phrase(self, scene: Scene, referent: int, rng: Generator) -> ObjectPhrase:
        """A phrase that names the referent alone. Raises LanguageError where none does."""
        return self.expressions(scene).draw_nested(self.depth, referent, rng)


def sample(
    number: int,
    rng: Generator,
    scene: Scene | None = None,
    depth: int | None = None,
    steps: int = 1,
    wording: Wording | None = None,
) -> Iterator[Sample]:
    """`number` random instructions of `steps` steps, in this scene or each in a drawn one.

    depth: how many relations are nested in each phrase; None for all kinds of phrases, up to two relations.
    wording: draws the words; None says everything in the first that there are.
    Raises LanguageError for a depth that is not in 0 to MAX_DEPTH, for fewer than 1 step, and where no scene gives
    such an instruction.
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
            raise LanguageError(f"no instruction of {wanted} can be said {'here' if scene else 'in any drawn scene'}")


def draw_scene(rng: Generator) -> Scene:
    """DRAWN objects in the AREA, the first of which is real."""
    count = int(rng.integers(DRAWN[0], DRAWN[1] + 1))
    target = rng.random(count) < TARGETS
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
    """An instruction that can be said in the scene, or None."""
    if steps == 1:
        return _instruction(scene, describer, rng)
    generated = generate_tasks(scene, 1, steps, seed=int(rng.integers(2**32)), describer=describer)
    return generated[0].command if generated else None


def _instruction(scene: Scene, describer: Describer, rng: Generator) -> Instruction | None:
    """A task, evenly among those that can be done here, for an object and perhaps a goal that can be named."""
    named = describer.nameable(scene)
    things, movable, targets = (np.flatnonzero(fit) for fit in (named, named & ~scene.targets, named & scene.targets))
    possible = [
        name
        for name, task in VERBS.items()
        if len(movable if task.moves else things)
        and (not task.needs_goal or len(targets if task.effect != "on" else movable[1:]))
    ]
    if not possible:
        return None
    task = possible[rng.integers(len(possible))]
    referent = int(rng.choice(movable if VERBS[task].moves else things))
    phrase = describer.phrase(scene, referent, rng)
    goals = targets if VERBS[task].effect != "on" else movable[movable != referent]
    says_goal = len(goals) and VERBS[task].takes_goal and (VERBS[task].needs_goal or rng.random() < 0.5)
    return Instruction(task, phrase, describer.phrase(scene, int(rng.choice(goals)), rng) if says_goal else None)
