"""The small records of a run as YAML and JSON files with a checksum, so that damage is noticed when they are read.

The checksum of a YAML file is its first line, a comment; that of a JSON file is its first key. Files without one are
read too: people write them by hand, and earlier versions did.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from conf.safe_files import FileError, parse_yaml, read_bytes, read_json
from trainers.utils.atomic_io import write_json, write_text

KEY = "sha256"
FIRST_LINE = f"# {KEY}: "
EDITED = f"damaged: its {KEY} does not fit; if you edited it, remove the {KEY}"


def write_checked_json(path: Path, values: Mapping[str, Any]) -> None:
    """Write plain values as indented JSON with a checksum, atomically. Raises WriteError."""
    write_json(path, {KEY: _digest(_canonical(values)), **values})


def read_checked_json(path: Path) -> dict[str, Any]:
    """Returns the values of a JSON file without their checksum. Raises FileError for a damaged file."""
    values = read_json(path)
    if not isinstance(values, dict):
        raise FileError("is damaged: it holds no group of keys")
    checksum = values.pop(KEY, None)
    if checksum is not None and checksum != _digest(_canonical(values)):
        raise FileError(f"is {EDITED}")
    return values


def write_checked_yaml(path: Path, text: str) -> None:
    """Write YAML below a line with its checksum, atomically. Raises WriteError."""
    write_text(path, f"{FIRST_LINE}{_digest(text)}\n{text}")


def read_checked_yaml(path: Path, max_bytes: int) -> Any:
    """Returns the plain value of a YAML file. Raises FileError for a damaged file."""
    content = read_bytes(path, max_bytes)
    first, _, rest = content.partition(b"\n")
    checksum = first.removeprefix(FIRST_LINE.encode())
    if checksum != first and checksum.decode(errors="replace").strip() != hashlib.sha256(rest).hexdigest():
        raise FileError(f"is {EDITED}")
    value = parse_yaml(content)
    if value is None:
        raise FileError("is damaged: it is empty")
    return value


def _canonical(values: Mapping[str, Any]) -> str:
    return json.dumps(values, sort_keys=True)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8")).hexdigest()
