"""Commands as people write them: a parser with wide coverage, which grounds every reading in the scene.

The words are tables (`words`), the chart keeps every reading (`lattice`, `noun_phrases`, `chart`, `sentences`),
phrases are resolved in a `World` (`referents`, `relating`, `resolving`, `places`), readings become plans whose
preconditions are checked (`planning`), and the cheapest plan is chosen by one table of costs (`costs`, `choosing`,
`interpreting`).
"""

from __future__ import annotations

from language.commands.dialogue import Dialogue
from language.commands.gestures import Pointed
from language.commands.meanings import Gesture
from language.commands.outcomes import Action, Outcome, Question, Refusal, Understood
from language.commands.world import Thing, World, board, table
from language.objects import Scene

__all__ = [
    "Action",
    "Dialogue",
    "Gesture",
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


def interpret(sentence: str, scene: Scene | World, dialogue: Dialogue | None = None, pointed: Pointed = ()) -> Outcome:
    """Returns what a sentence means in a scene: `Understood`, `Question` or `Refusal`. Never raises for any sentence.

    Args:
        sentence: as a person writes it.
        scene: a table's scene, or a `World`: of a board, or with something in the gripper.
        dialogue: what was said and done before; it remembers this sentence. None: a new one.
        pointed: what gestures show, in the order of the words that need one ("this", "that", "here", "there"): the
            index of an object; a sequence of indices where a gesture may show any of them; or a `Gesture`, also for
            a free place of the table. If there are more such words than gestures, the last serves for the rest.

    Raises:
        LanguageError: `pointed` has an index that the scene lacks.
    """
    return (dialogue or Dialogue()).answer(sentence, scene, pointed)
