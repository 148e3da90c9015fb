"""Declare a parameter once, as a field of a frozen dataclass; value it once, in YAML; check it on the way.

    @dataclass(frozen=True)
    class StepConfig(Checked):
        max_move: float = within(0.001, 0.2)       # metres a control step

    config = read(StepConfig, cfg.control, "control")

`read` refuses unknown, missing and mistyped keys, numbers that are not finite or out of range, and unknown
choices, each with one sentence that names the full key, the value and what would be right. A field with a default
may be left out.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from difflib import get_close_matches
from types import UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

T = TypeVar("T")
MOST = 24  # choices that a message lists; of more, only the groups


class ConfigError(ValueError):
    """A value that a person gave and can mend. The text is the whole message: no traceback is needed."""


class RunError(RuntimeError):
    """A run that had to end early. The text is the whole message: no traceback is needed."""


def within(low: float, high: float = math.inf, count: int | None = None) -> Any:
    """A number in [low, high], or a list or group of such numbers; count: how many a list must hold."""
    return dataclasses.field(metadata={"within": (low, high), "count": count})


def one_of(*choices: str) -> Any:
    """One (or a list) of these words."""
    return dataclasses.field(metadata={"one_of": choices})


def did_you_mean(word: str, choices: Iterable[str]) -> str:
    """`; did you mean 'x'?` or `; choose from a, b`, to end a message with."""
    choices = [str(choice) for choice in choices]
    near = get_close_matches(str(word), choices, n=1)
    if near:
        return f"; did you mean {near[0]!r}?"
    top = choices if len(choices) <= MOST else sorted({choice.partition(".")[0] for choice in choices})
    return f"; choose from {', '.join(top)}"


@dataclasses.dataclass(frozen=True)
class Checked:
    """A dataclass whose fields obey their metadata. Raises ConfigError on construction otherwise."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            name, value, count = field.name, getattr(self, field.name), field.metadata.get("count")
            if count is not None and len(value) != count:
                raise ConfigError(f"{name}={value} must be {count} numbers")
            items = value if isinstance(value, list) else [value]
            named = value.items() if isinstance(value, dict) else ((None, item) for item in items)
            for key, item in named:
                _check(name if key is None else f"{name}.{key}", item, field.metadata)


def _check(name: str, value: Any, rule: Any) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise ConfigError(f"{name}={value} is not a finite number")
    if value is not None and "within" in rule:
        low, high = rule["within"]
        if not low <= value <= high:
            wanted = f"in [{low:g}, {high:g}]" if math.isfinite(high) else f"at least {low:g}"
            raise ConfigError(f"{name}={value} is out of range: it must be {wanted}")
    if value is not None and "one_of" in rule and value not in rule["one_of"]:
        raise ConfigError(f"{name}={value} is not known" + did_you_mean(value, rule["one_of"]))


def read(cls: type[T], node: Any, key: str) -> T:
    """The config node (DictConfig or dict) as an instance of the dataclass `cls`.

    key: the node's own place in the config ("algo"), put before the field's name in every message.
    Raises ConfigError.
    """
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    declared = dataclasses.fields(cls)  # type: ignore[arg-type]
    fields = [field.name for field in declared]
    prefix = f"{key}." if key else ""
    container: Any = OmegaConf.to_container(node, resolve=True) if OmegaConf.is_config(node) else node
    if not isinstance(container, dict):
        raise ConfigError(f"{key}={container} must be a group of keys: {', '.join(fields)}")
    container = dict(container)
    for name in container:
        if name not in fields:
            raise ConfigError(f"{prefix}{name} is not a known key" + did_you_mean(name, fields))
    for field in declared:
        if container.get(field.name, "???" if _required(field) else None) == "???":
            raise ConfigError(f"{prefix}{field.name} has no value; give {prefix}{field.name}=...")
    nested = {
        name: _nested(kind, container.pop(name), prefix + name)
        for name, kind in get_type_hints(cls).items()
        if name in container and _dataclass_of(kind)
    }
    try:
        typed: Any = OmegaConf.to_container(OmegaConf.merge(OmegaConf.structured(cls), container))
        return cls(**nested, **{name: typed[name] for name in container})
    except ConfigError as error:
        raise ConfigError(prefix + str(error)) from None
    except OmegaConfBaseException as error:
        first = str(error.msg or error).splitlines()[0]
        value = OmegaConf.select(OmegaConf.create(container), str(error.full_key))
        raise ConfigError(f"{prefix}{error.full_key}={value}: {first}") from None


def _required(field: dataclasses.Field) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def _dataclass_of(kind: Any) -> Any:
    """The dataclass that a field is, may be, lists, or maps names to; None for plain values."""
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
