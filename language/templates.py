"""What each task is called: one table, read by `say` and by the grammar alike."""

from __future__ import annotations

SLOT = "{object}"  # where the name of the object goes

# Each task with its templates. The first is what we say, all are what we understand.
TEMPLATES: dict[str, tuple[str, ...]] = {
    "reach": ("reach {object}", "touch {object}", "go to {object}"),
}

POLITE = ("please",)  # may open or close any sentence
