"""Names of the objects of a scene, for messages to a person."""

from __future__ import annotations

from language import LanguageError, Scene, describe


def object_names(scene: Scene) -> list[str]:
    """The name of each object."""
    return [object_name(index, scene) for index in range(len(scene))]


def object_name(index: int, scene: Scene) -> str:
    """The shortest description that fits this object only; "a <colour> <noun>" if there is none."""
    try:
        return describe(index, scene)
    except LanguageError:
        return f"a {scene[index].color} {scene[index].noun}"
