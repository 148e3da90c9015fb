"""Typed configuration: each parameter is declared once, as a field of a frozen dataclass, and valued once, in YAML.

    @dataclass(frozen=True)
    class StepConfig(Checked):
        max_move: float = within(0.001, 0.2)       # metres per control step

    config = read(StepConfig, cfg.control, "control")

`read` raises ConfigError for unknown, missing and mistyped keys, for numbers that are not finite or out of range, and
for unknown choices. The message is one sentence with the full key, the value and what would be right. A field with a
default may be left out.
"""

from __future__ import annotations

import dataclasses
import math
import os
import re
from functools import cache
from types import UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from core.errors import ConfigError, did_you_mean

T = TypeVar("T")
UNKNOWN = object()
PLAIN = (bool, int, float, str, type(None))
MOST = 1000  # entries of a list
MAX_PATH = 4096  # characters of a path
SHOWN = 200  # characters of a value in a message
WORD = re.compile(r"[\w.+-][\w .+-]{0,99}")
EXACT = 2**53  # up to which every whole number is a float


def within(
    low: float,
    high: float,
    count: int | tuple[int, int] | None = None,
    default: Any = dataclasses.MISSING,
) -> Any:
    """Declare a field: a number in [low, high], or a list or group of such numbers.

    count: the list's length, or the least and the greatest that it may have; None: up to `MOST`.
    """
    return _field(default, {"within": (low, high), "count": count})


def one_of(*choices: str, default: Any = dataclasses.MISSING) -> Any:
    """Declare a field: one of these words, or a list of different ones."""
    return _field(default, {"one_of": choices})


def word(default: Any = dataclasses.MISSING) -> Any:
    """Declare a field: a name that may become part of a file's name, or a list of different ones."""
    return _field(default, {"matches": (WORD, "letters, digits and . _ + - or spaces")})


def _field(default: Any, metadata: dict[str, Any]) -> Any:
    """Declare a field. default: a tuple stands for a list, of which each object gets its own."""
    if isinstance(default, tuple):
        return dataclasses.field(default_factory=lambda: list(default), metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def text(pattern: str, wanted: str, default: Any = dataclasses.MISSING) -> Any:
    """Declare a field: text that this pattern matches as a whole, or a list of different ones.

    wanted: what would be right, for the error message.
    """
    return _field(default, {"matches": (re.compile(pattern), wanted)})


def checked_by(check: str, default: Any = dataclasses.MISSING) -> Any:
    """Declare a field that no rule here describes. check: what checks it, for the reader."""
    return dataclasses.field(default=default, metadata={"checked_by": check})


def any_path(default: Any = dataclasses.MISSING) -> Any:
    """Declares a field: the path of a file or folder, with any characters that a path may have."""
    return dataclasses.field(default=default, metadata={"path": True})


@dataclasses.dataclass(frozen=True)
class Checked:
    """A dataclass whose fields are checked against their metadata on construction. Raises ConfigError."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            name, value = field.name, getattr(self, field.name)
            items = value if isinstance(value, list) else [value]
            if isinstance(value, list):
                _check_length(name, value, field.metadata)
            named = value.items() if isinstance(value, dict) else ((None, item) for item in items)
            for key, item in named:
                _check(name if key is None else f"{name}.{key}", item, field.metadata)


def _check_length(name: str, value: list[Any], rule: Any) -> None:
    """Raise ConfigError for a list that is too short or too long, or that has a word twice."""
    count = rule.get("count")
    least, most = count if isinstance(count, tuple) else (0, MOST) if count is None else (count, count)
    if not least <= len(value) <= most:
        wanted = f"{least}" if least == most else f"{least} to {most}"
        kind = "numbers" if "within" in rule else "entries"
        raise ConfigError(f"{name}={shown(value)} must be {wanted} {kind}")
    if "one_of" in rule or "matches" in rule:
        twice = next((item for index, item in enumerate(value) if item in value[:index]), None)
        if twice is not None:
            raise ConfigError(f"{name}={shown(value)} has {shown(twice)} twice")


def shown(value: Any) -> str:
    """Return a value for a message: on one line, and cut where it is long."""
    line = "".join(c if c.isprintable() else repr(c)[1:-1] for c in str(value))
    return line if len(line) <= SHOWN else f"{line[:SHOWN]}..."


def _check(name: str, value: Any, rule: Any) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise ConfigError(f"{name}={value} is not a finite number")
    if value is not None and "within" in rule:
        low, high = rule["within"]
        if not isinstance(value, int | float):
            raise ConfigError(f"{name}={shown(value)} must be a number in [{low:g}, {high:g}]")
        if not low <= value <= high:
            raise ConfigError(f"{name}={shown(value)} is out of range: it must be in [{low:g}, {high:g}]")
    if value is not None and "path" in rule and not _is_path(value):
        raise ConfigError(f"{name}={shown(value)} is no path")
    if value is not None and "one_of" in rule and value not in rule["one_of"]:
        raise ConfigError(f"{name}={shown(value)} is not known" + did_you_mean(value, rule["one_of"]))
    if value is not None and "matches" in rule and not rule["matches"][0].fullmatch(str(value)):
        raise ConfigError(f"{name}={shown(value)} must be {rule['matches'][1]}")


def _is_path(value: str) -> bool:
    """Whether a file system can have such a path."""
    return 0 < len(value) < MAX_PATH and "\0" not in value and all(len(os.fsencode(x)) < 256 for x in value.split("/"))


def read(cls: type[T], node: Any, key: str) -> T:
    """Read a config node into a dataclass.

    Args:
        cls: a dataclass.
        node: a DictConfig or dict.
        key: the node's key in the config ("algo"), which prefixes field names in error messages.

    Returns:
        An instance of `cls`.

    Raises:
        ConfigError: see the module's docstring.
    """
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    dataclass: Any = cls
    declared, hints = dataclasses.fields(dataclass), _hints(dataclass)
    fields = [field.name for field in declared]
    prefix = f"{key}." if key else ""
    container: Any = OmegaConf.to_container(node, resolve=True) if OmegaConf.is_config(node) else node
    if not isinstance(container, dict):
        raise ConfigError(f"{key}={shown(container)} must be a group of keys: {', '.join(fields)}")
    container = dict(container)
    for name in container:
        if name not in fields:
            raise ConfigError(f"{prefix}{name} is not a known key" + did_you_mean(name, fields))
    paths = {field.name for field in declared if "path" in field.metadata}
    for name, value in container.items():
        if isinstance(value, str) and "${" in value and name not in paths:
            raise ConfigError(f"{prefix}{name}={shown(value)} cannot be resolved; write the value itself")
        if hints.get(name) is bool and _is_number(value):
            raise ConfigError(f"{prefix}{name}={value} must be true or false")
    for field in declared:
        if container.get(field.name, "???" if _required(field) else None) == "???":
            raise ConfigError(f"{prefix}{field.name} has no value; give {prefix}{field.name}=...")
    nested = {
        name: _nested(kind, container.pop(name), prefix + name)
        for name, kind in hints.items()
        if name in container and _dataclass_of(kind)
    }
    try:
        return cls(**nested, **_typed(dataclass, container))
    except ConfigError as error:
        raise ConfigError(prefix + str(error)) from None
    except OmegaConfBaseException as error:
        first = str(error.msg or error).splitlines()[0]
        value = OmegaConf.select(OmegaConf.create(container), str(error.full_key))
        raise _mistyped(f"{prefix}{error.full_key}", value, hints.get(str(error.full_key)), first) from None


def _mistyped(name: str, value: Any, kind: Any, reason: str) -> ConfigError:
    """Return the error for a value that is not of the declared type. reason: in OmegaConf's words."""
    text = shown(value)
    if get_origin(kind) is list and isinstance(value, PLAIN):
        return ConfigError(f"{name}={text} must be a list: {name}=[{text}]")
    return ConfigError(f"{name}={text}: {shown(reason)}")


def _is_number(value: Any) -> bool:
    """Whether OmegaConf would take a number for a truth value."""
    if isinstance(value, str):
        return value.lstrip("+-").isdigit()
    return isinstance(value, int | float) and not isinstance(value, bool)


def _typed(cls: Any, values: dict[str, Any]) -> dict[str, Any]:
    """Return the values of fields as their declared types. Raises OmegaConf's errors."""
    from omegaconf import OmegaConf

    hints = _hints(cls)
    plain = {name: _plain(hints[name], value) for name, value in values.items()}
    others = {name: value for name, value in values.items() if plain[name] is UNKNOWN}
    converted: Any = OmegaConf.to_container(OmegaConf.merge(_structured(cls), others)) if others else {}
    return plain | {name: converted[name] for name in others}


def _plain(kind: Any, value: Any) -> Any:
    """Return the value if it is of the declared type already; else UNKNOWN, for OmegaConf, which is slow, to check."""
    if isinstance(kind, UnionType) and len(get_args(kind)) == 2:  # with None
        return next((plain for each in get_args(kind) if (plain := _plain(each, value)) is not UNKNOWN), UNKNOWN)
    if get_origin(kind) is list and type(value) is list:
        entries = [_plain(get_args(kind)[0], entry) for entry in value]
        return UNKNOWN if UNKNOWN in entries else entries
    if get_origin(kind) is dict and type(value) is dict and all(type(key) is str for key in value):
        named = {key: _plain(get_args(kind)[1], entry) for key, entry in value.items()}
        return UNKNOWN if UNKNOWN in named.values() else named
    if kind is float and type(value) is int and abs(value) < EXACT:
        return float(value)
    return value if kind in PLAIN and type(value) is kind else UNKNOWN


@cache
def _hints(cls: type) -> dict[str, Any]:
    return get_type_hints(cls)


@cache
def _structured(cls: type) -> Any:
    """Return the dataclass as OmegaConf's structured config. Callers must not change it."""
    from omegaconf import OmegaConf

    return OmegaConf.structured(cls)


def _required(field: dataclasses.Field) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def _dataclass_of(kind: Any) -> Any:
    """Return the dataclass in a field's type (itself, optional, in a list or in a dict); None for plain values."""
    inner = next((each for each in get_args(kind) if dataclasses.is_dataclass(each)), kind)
    return inner if dataclasses.is_dataclass(inner) else None


def _nested(kind: Any, node: Any, key: str) -> Any:
    if isinstance(kind, UnionType):
        return None if node is None else read(_dataclass_of(kind), node, key)
    if dataclasses.is_dataclass(kind):
        return read(kind, node, key)  # type: ignore[arg-type]
    if get_origin(kind) is list:
        if not isinstance(node, list):
            raise ConfigError(f"{key}={node} must be a list of groups")
        return [read(_dataclass_of(kind), entry, f"{key}.{index}") for index, entry in enumerate(node)]
    if not isinstance(node, dict):
        raise ConfigError(f"{key}={node} must be a group of named entries")
    return {name: read(_dataclass_of(kind), entry, f"{key}.{name}") for name, entry in node.items()}
