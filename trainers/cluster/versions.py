"""The versions that must be equal on all nodes of a cluster, so that the nodes compute the same."""

from __future__ import annotations

import platform
import zlib
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

ROOT = Path(__file__).parents[2]
OWN = ("conf", "envs", "human", "language", "trainers")  # packages of this project
SUFFIXES = (".py", ".yaml")
LIBRARIES = ("torch", "torchrl", "tensordict", "pybullet", "numpy")


def versions() -> dict[str, str]:
    """By name: Python's and the libraries' versions, and for Deixis a checksum of its sources."""
    found = {"Deixis": f"sources {_checksum():08x}", "Python": ".".join(platform.python_version_tuple()[:2])}
    for name in LIBRARIES:
        try:
            found[name] = version(name).partition("+")[0]
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def difference(own: Mapping[str, str], theirs: Mapping[str, str]) -> str:
    """The first difference as text; "" if there is none."""
    names = [name for name in own if own[name] != theirs.get(name)]
    return f"{names[0]} {theirs.get(names[0])} there, {own[names[0]]} here" if names else ""


def _checksum() -> int:
    checksum = 0
    for package in OWN:
        for file in sorted((ROOT / package).rglob("*")):
            if file.suffix in SUFFIXES:
                checksum = zlib.crc32(file.relative_to(ROOT).as_posix().encode() + file.read_bytes(), checksum)
    return checksum
