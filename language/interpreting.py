"""`interpret`: what a sentence means in a scene."""

from __future__ import annotations

from language.dialogue import Dialogue
from language.meanings import Pointed
from language.objects import Scene
from language.outcomes import Outcome
from language.world import WorldModel


def interpret(
    sentence: str, scene: Scene | WorldModel, dialogue: Dialogue | None = None, pointed: Pointed = ()
) -> Outcome:
    """Return what a sentence means in a scene. Never raises for any sentence.

    Args:
        sentence: as a person writes it.
        scene: a table's scene, or a `WorldModel`: of a board or a room, or with something in the gripper.
        dialogue: what was said and done before; it remembers this sentence. None: a new one.
        pointed: what gestures show, in the order of the words that need one ("this", "that", "here", "there"): the
            index of an object; a sequence of indices where a gesture may show any of them; or a `Gesture`, also for
            a free place of the table. If there are more such words than gestures, the last serves for the rest.

    Raises:
        LanguageError: `pointed` has an index that the scene lacks.
    """
    return (dialogue or Dialogue()).answer(sentence, scene, pointed)
