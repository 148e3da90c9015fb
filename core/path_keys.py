"""Keys whose value is a path. They take the rest of the word as it is, whatever characters it has.

Hydra wants quotes around most characters, and OmegaConf takes `${...}` as an interpolation. So words are plain
everywhere in this project, and `to_hydra` and `from_hydra` translate them where Hydra reads or returns them.
"""

from __future__ import annotations

import re
from collections.abc import Callable

OUTPUTS = ("hydra.run.dir", "hydra.sweep.dir")  # folders whose names may hold interpolations of Hydra: ${now:%H}
PATH_KEYS = (
    *OUTPUTS,
    "resume",
    "init",
    "sweep.resume",
    "robot.urdf",
    "workspace.human.urdf",
    "gesture.weights",
    "perception.weights",
    "hydra.launcher.submitit_folder",
)
NOT_PATHS = ("", "null", "???")  # values that are no path: none is given
INTERPOLATION = re.compile(r"(\\*)\$\{([^{}]*)\}?")
LIST = re.compile(r"choice\(.*\)", re.DOTALL)  # several values of a sweep


def is_path(word: str) -> bool:
    """Whether a word `key=value` sets a path to one value."""
    key, _, value = word.partition("=")
    return key.lstrip("+") in PATH_KEYS and value not in NOT_PATHS and not LIST.fullmatch(value)


def to_hydra(word: str, is_known: Callable[[str], bool] = lambda name: False) -> str:
    """Return the word in Hydra's syntax, with its path quoted; another word unchanged.

    Args:
        word: `key=value`.
        is_known: whether a name is a key of the config or a resolver, and so `${name}` an interpolation. Only names of
            `OUTPUTS` are asked for.
    """
    if not is_path(word):
        return word
    from hydra.core.override_parser.types import Quote, QuotedString

    key, _, value = word.partition("=")
    text = escaped(value, is_known if key.lstrip("+") in OUTPUTS else lambda name: False)
    return f"{key}={QuotedString(text, Quote.single).with_quotes()}"


def from_hydra(word: str) -> str:
    """Return a word of Hydra's with its path as it is; a word that sets no path, or several, unchanged."""
    key = word.partition("=")[0]
    if not is_path(word):
        return word
    from hydra.core.override_parser.overrides_parser import OverridesParser

    path = OverridesParser.create().parse_override(word).value()
    return f"{key}={unescaped(path)}" if isinstance(path, str) else word


def escaped(path: str, is_known: Callable[[str], bool] = lambda name: False) -> str:
    """Return the path as a value of OmegaConf: its `${` begin no interpolation, unless their names are known."""

    def escape(match: re.Match[str]) -> str:
        name = match[2].partition(":")[0]
        return (
            match[0]
            if match[0].endswith("}") and name and is_known(name)
            else f"{2 * match[1]}\\{match[0][len(match[1]) :]}"
        )

    return INTERPOLATION.sub(escape, path)


def unescaped(value: str) -> str:
    """Return the path of a value that `escaped` made."""
    return re.sub(r"(\\*)\\\$\{", lambda match: match[1][: len(match[1]) // 2] + "${", value)
