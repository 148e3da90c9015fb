"""A check that Python finds this project's own packages, and no others of the same names."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]  # the folder that all packages and programs of the project lie in


class ForeignPackageError(ImportError):
    """Another package owns the name of one of ours."""


def check_origins(*names: str) -> None:
    """Raise ForeignPackageError unless each top-level package or module lies beside this package.

    Imports none of them.
    """
    for name in names:
        place = _origin(name)
        if place is None:
            raise ForeignPackageError(
                f"deixis needs its package '{name}' in {ROOT}, which is missing: install deixis again"
            )
        if place.resolve().parent != ROOT:
            raise ForeignPackageError(
                f"deixis needs its own '{name}' from {ROOT}, but Python finds another one first: {place}; "
                "rename that one, or remove its folder from sys.path"
            )


def _origin(name: str) -> Path | None:
    """Return the folder of a top-level package or the file of a top-level module; None if there is none."""
    loaded = sys.modules.get(name)
    if loaded is not None and loaded.__spec__ is None:
        return None if loaded.__file__ is None else Path(loaded.__file__)
    spec = find_spec(name)
    if spec is None:
        return None
    if spec.submodule_search_locations:
        return Path(next(iter(spec.submodule_search_locations)))
    return None if spec.origin is None else Path(spec.origin)
