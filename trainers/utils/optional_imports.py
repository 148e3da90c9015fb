"""Optional dependencies."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from conf.schema import ConfigError


def import_optional(*names: str, extra: str = "record") -> list[ModuleType]:
    """Import modules that an extra of the package installs.

    Args:
        names: dotted names of the modules.
        extra: name of the extra, for the error message.

    Raises:
        ConfigError: a module is missing; the message says how to install it.
    """
    try:
        return [import_module(name) for name in names]
    except ImportError as error:
        missing = (error.name or str(error)).partition(".")[0]
        raise ConfigError(
            f'recordings in this format need {missing}, which is not installed: pip install -e ".[{extra}]"'
        ) from None
