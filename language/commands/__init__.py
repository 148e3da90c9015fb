"""Commands as people write them: a wide-coverage understander, which grounds every reading in the scene.

The words are tables (`words`), the chart keeps every reading (`lattice`, `noun_phrases`, `chart`, `sentences`),
phrases are resolved in a `World` (`referents`, `relating`, `resolving`, `places`), readings become plans whose
preconditions are checked (`planning`), and the cheapest plan is chosen by one table of costs (`costs`, `choosing`,
`interpreting`).
"""

from __future__ import annotations

from collections.abc import Sequence

from language.commands.dialogue import Dialogue
from language.commands.outcomes import Action, Outcome, Question, Refusal, Understood
from language.commands.world import Thing, World, board, table
from language.objects import Scene

__all__ = [
    "Action",
    "Dialogue",
    "Outcome",
    "Question",
    "Refusal",
    "Thing",
    "Understood",
    "World",
    "board",
    "interpret",
    "table",
]


def interpret(
    sentence: str, scene: Scene | World, dialogue: Dialogue | None = None, pointed: Sequence[int] = ()
) -> Outcome:
    """Returns what a sentence means in a scene: `Understood`, `Question` or `Refusal`. Never raises for any sentence.

    Args:
        sentence: as a person writes it.
        scene: a table's scene, or a `World`: of a board, or with something in the gripper.
        dialogue: what was said and done before; it remembers this sentence. None: a new one.
        pointed: the objects of gestures, in the order of the words that need one.
    """
    return (dialogue or Dialogue()).answer(sentence, scene, pointed)
