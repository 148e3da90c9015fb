"""Reading of files that someone else may have written: bounded in size and depth, and free of anything that executes.

A file is opened only if it is a regular file, and its size is checked before anything is read: a FIFO does not block,
and /dev/zero does not fill the memory. YAML is bounded again by its events, before a value is built, since aliases can
describe more nodes than the file has bytes.
"""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from core.errors import ConfigError

MAX_BYTES = 256 * 1024  # of a YAML or JSON file
MAX_NODES = 50_000  # of a YAML document, with aliases expanded
MAX_DEPTH = 60  # of nested lists and groups
# Raised by PyYAML for values that cannot be built (a 13th month, a number of thousands of digits).
_UNREADABLE = (ValueError, LookupError, AttributeError, TypeError, ArithmeticError)


class FileError(ConfigError):
    """A file that cannot be read safely. The text continues a sentence that begins with the file's path."""


def read_bytes(path: Path, max_bytes: int = MAX_BYTES) -> bytes:
    """Return the content of a regular file of at most `max_bytes`. Raises FileError."""
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        with open(descriptor, "rb") as file:
            check_size(file.fileno(), max_bytes)
            content = file.read(max_bytes + 1)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        if isinstance(error, FileError):
            raise
        raise FileError(f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(content) > max_bytes:  # files of /proc have more bytes than they say
        raise FileError(f"cannot be read: it has more than {max_bytes:,} bytes")
    return content


def check_size(file: int | Path, max_bytes: int) -> int:
    """Return the size of a regular file, given its path or descriptor. Raises FileError, before anything is read."""
    try:
        status = os.stat(file)
    except (OSError, ValueError) as error:
        raise FileError(f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if not stat.S_ISREG(status.st_mode):
        raise FileError("cannot be read: it is not a regular file")
    if status.st_size > max_bytes:
        raise FileError(f"cannot be read: it has {status.st_size:,} bytes, and at most {max_bytes:,} are accepted")
    return status.st_size


def read_text(path: Path, max_bytes: int = MAX_BYTES) -> str:
    """Return the content of a regular UTF-8 file. Raises FileError."""
    try:
        return read_bytes(path, max_bytes).decode("utf-8")
    except UnicodeDecodeError as error:
        raise FileError(f"is not UTF-8 text: {error.reason} at byte {error.start}") from None


def read_json(path: Path, max_bytes: int = MAX_BYTES) -> Any:
    """Return the plain value of a JSON file. Raises FileError."""
    text = read_text(path, max_bytes)
    try:
        return json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise FileError(f"is not JSON: {error if isinstance(error, ValueError) else 'too deeply nested'}") from None


def read_yaml(path: Path, max_bytes: int = MAX_BYTES, max_nodes: int = MAX_NODES) -> Any:
    """Return the plain value of a YAML file.

    Args:
        path: of the file.
        max_bytes: size of the file.
        max_nodes: values, keys, lists and groups of the document, with aliases expanded.

    Raises:
        FileError: the file cannot be read, is not YAML, has a tag other than YAML's own plain types, or is too large.
    """
    return parse_yaml(read_bytes(path, max_bytes), max_nodes)


def parse_yaml(content: bytes, max_nodes: int = MAX_NODES) -> Any:
    """Return the plain value of a YAML document. Raises FileError, as `read_yaml` does."""
    import yaml  # imported only when a file is read

    fast = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        try:
            return _load(content, fast, max_nodes)
        except yaml.YAMLError:
            _load(content, yaml.SafeLoader, max_nodes)  # libyaml reports the position of a mistake less well
            raise
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        raise FileError(f"is not YAML: {where}{error.problem}") from None
    except yaml.YAMLError as error:
        raise FileError(f"is not YAML: {' '.join(str(error).split())}") from None
    except FileError:
        raise
    except RecursionError:
        raise FileError(f"is not YAML that can be read: nested more than {MAX_DEPTH} deep") from None
    except _UNREADABLE as error:
        raise FileError(f"is not YAML that can be read: {' '.join(str(error).split())[:200]}") from None


def _load(content: bytes, loader: Any, max_nodes: int) -> Any:
    import yaml

    _check_events(yaml.parse(content, Loader=loader), max_nodes)
    return yaml.load(content, Loader=loader)


def _check_events(events: Iterator[Any], max_nodes: int) -> None:
    """Raise FileError for a document that is too deep, or too large with each alias counted as what it repeats."""
    import yaml

    sizes: dict[str, int] = {}  # of the anchors
    open_nodes: list[tuple[str | None, int]] = []  # anchor, and the count of nodes at its start
    count, keys = 0, _KeyCheck()
    for event in events:
        keys.see(event)
        if isinstance(event, yaml.CollectionEndEvent):
            anchor, start = open_nodes.pop()
            if anchor is not None:
                sizes[anchor] = count - start
            continue
        if not isinstance(event, yaml.NodeEvent):
            continue
        count += sizes.get(event.anchor, 1) if isinstance(event, yaml.AliasEvent) else 1
        if isinstance(event, yaml.CollectionStartEvent):
            open_nodes.append((event.anchor, count - 1))
        elif isinstance(event, yaml.ScalarEvent) and event.anchor is not None:
            sizes[event.anchor] = 1
        _check_tag(getattr(event, "tag", None))
        if len(open_nodes) > MAX_DEPTH:
            raise FileError(f"is not YAML that can be read: nested more than {MAX_DEPTH} deep")
        if count > max_nodes:
            raise FileError(f"is not YAML that can be read: it describes more than {max_nodes:,} values")


class _KeyCheck:
    """Raises FileError where a group has a key twice: YAML's libraries take the last value without a word."""

    def __init__(self) -> None:
        self.open: list[tuple[set[str] | None, list[bool]]] = []  # keys of each open group, and whether a key is next

    def see(self, event: Any) -> None:
        """Take the next event of the document."""
        import yaml

        if isinstance(event, yaml.CollectionEndEvent):
            self.open.pop()
        if not isinstance(event, yaml.NodeEvent):
            return
        keys, key_is_next = self.open[-1] if self.open else (None, [False])
        if keys is not None and key_is_next[0] and isinstance(event, yaml.ScalarEvent):
            if event.value in keys:
                line = f"line {event.start_mark.line + 1}, column {event.start_mark.column + 1}"
                raise FileError(f"is not YAML: {line}: the key {event.value[:80]} is given twice")
            keys.add(event.value)
        key_is_next[0] = not key_is_next[0]
        if isinstance(event, yaml.CollectionStartEvent):
            self.open.append((set() if isinstance(event, yaml.MappingStartEvent) else None, [True]))


def _check_tag(tag: str | None) -> None:
    if tag not in (None, "!"):
        raise FileError(f"is not YAML that can be read: the tag {tag} is not accepted; write plain values")


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is not a number of JSON")


def check_plain(value: Any, max_values: int = MAX_NODES) -> None:
    """Check that a value that was read from a file is a plain config, which nothing can execute or look up.

    Args:
        value: anything.
        max_values: how many keys, values and containers it may have; a container counts each time it occurs.

    Raises:
        FileError: it holds other types than text, numbers, booleans, None, lists and groups; a key that is not text or
            begins with an underscore (`_target_`); an interpolation (`${oc.env:HOME}`); or too much.
    """
    left, stack = max_values, [("", value, 0)]
    while stack:
        key, item, depth = stack.pop()
        left -= 1
        if left < 0 or depth > MAX_DEPTH:
            raise FileError("holds a config that is too large or too deeply nested")
        if isinstance(item, dict):
            for name, inner in item.items():
                if not isinstance(name, str) or name.startswith("_"):
                    raise FileError(f"holds the key {key}{name!r}, which is none of this project")
                stack.append((f"{key}{name}.", inner, depth + 1))
        elif isinstance(item, list):
            if len(item) > left:
                raise FileError("holds a config that is too large or too deeply nested")
            stack += [(key, inner, depth + 1) for inner in item]
        elif isinstance(item, str):
            if "${" in item:
                raise FileError(
                    f"holds {key.rstrip('.')}={item[:80]}; interpolations ${{...}} are not accepted in files"
                )
        elif not (item is None or isinstance(item, bool | int | float)):
            raise FileError(f"holds {key.rstrip('.')} of type {type(item).__name__}, which is no plain value")
