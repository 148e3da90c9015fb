"""The errors that programs show as one line, and the end of their messages."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

MAX_LISTED = 24  # choices listed in a message; of more choices, only their groups are listed


class ConfigError(ValueError):
    """An invalid value that the user gave. The text is the whole message, to be shown without a traceback."""


class UseError(ValueError):
    """A call that does not fit an environment: its state, the number of worlds, or the form of the action."""


class RunError(RuntimeError):
    """A run that had to stop early. The text is the whole message, to be shown without a traceback."""


class Interrupted(Exception):
    """A request to stop, by a signal: a loop raises it between two steps."""


def did_you_mean(word: str, choices: Iterable[str]) -> str:
    """Return the end of an error message: `; did you mean 'x'?` or `; choose from a, b`."""
    choices = [str(choice) for choice in choices]
    near = get_close_matches(str(word), choices, n=1)
    if near:
        return f"; did you mean {near[0]!r}?"
    top = choices if len(choices) <= MAX_LISTED else sorted({choice.partition(".")[0] for choice in choices})
    return f"; choose from {', '.join(top)}"
