"""Libraries that not everybody has."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from conf.schema import ConfigError


def needed(*names: str) -> list[Any]:
    """The modules of the extra `record`. Raises ConfigError that tells how to get one that is missing."""
    try:
        return [import_module(name) for name in names]
    except ImportError as error:
        missing = (error.name or str(error)).partition(".")[0]
        raise ConfigError(
            f'recordings in this format need {missing}, which is not installed: pip install -e ".[record]"'
        ) from None
