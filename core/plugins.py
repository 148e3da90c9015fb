"""What users add from outside of this package: folders of YAML, and modules that register classes.

A folder has the layout of `conf/`: `robot/my_arm.yaml` is the option `robot=my_arm`. It is named on the command line by
`--config-dir`, by the environment variable that this flag sets for the processes of a run, or by an installed package
with an entry point in the group `deixis.config`. Modules are entry points in the group `deixis.plugins`. No config that
comes from a file can name either.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from core.errors import ConfigError

FLAGS = ("--config-dir", "-cd")
VARIABLE = "DEIXIS_CONFIG_DIR"
CONFIG, PLUGINS = "deixis.config", "deixis.plugins"  # groups of entry points
ROOT = Path(__file__).parents[1] / "conf"


def take_config_dir(words: Sequence[str]) -> list[str]:
    """Return the words without `--config-dir <folder>`, whose options this process and its children then have.

    Raises ConfigError for a folder that is none, or that has an option of the project's own name.
    """
    rest, others = list(words), []
    while rest:
        word = rest.pop(0)
        flag, equals, value = word.partition("=")
        if flag not in FLAGS:
            others.append(word)
            continue
        folder = value if equals else (rest.pop(0) if rest else "")
        if not folder or not Path(folder).is_dir():
            raise ConfigError(f"{flag} {folder} is not a folder; it holds YAML as in conf/: robot/my_arm.yaml")
        os.environ[VARIABLE] = str(Path(folder).resolve())
        own_folders()
    return others


def own_folders() -> tuple[Path, ...]:
    """Return the users' folders of YAML. Raises ConfigError for one that is missing, or takes an option's name."""
    given = os.environ.get(VARIABLE)
    folders = (*((Path(given),) if given else ()), *_packaged_folders())
    seen: dict[str, Path] = {}
    for folder in (ROOT, *folders) if folders else ():
        if not folder.is_dir():
            raise ConfigError(f"{VARIABLE}={folder} is not a folder")
        for path in options_in(folder):
            name = f"{path.parent.name}/{path.name}"
            if name in seen:
                raise ConfigError(
                    f"{path} has the name of an option that {seen[name]} has already; give it another one"
                )
            seen[name] = folder
            if folder != ROOT and not (ROOT / path.parent.name).is_dir():
                known = ", ".join(sorted({option.parent.name for option in options_in(ROOT)}))
                raise ConfigError(f"{path} is in no group of the config; choose from {known}")
    return folders


def own_files() -> tuple[tuple[str, int], ...]:
    """Return the users' YAML files, each with the time of its last change: what composed configs depend on."""
    paths = [path for folder in own_folders() for path in options_in(folder)]
    return tuple((str(path), path.stat().st_mtime_ns) for path in paths)


def options_in(folder: Path) -> list[Path]:
    """Return the YAML files of a folder's groups."""
    return sorted(folder.glob("*/*.yaml"))


def search_words() -> list[str]:
    """Return the words by which Hydra also searches the users' folders."""
    places = ",".join("'file://" + str(folder).replace("'", "\\'") + "'" for folder in own_folders())
    return [f"hydra.searchpath=[{places}]"] if places else []


@cache
def load_plugins() -> None:
    """Import the modules of installed packages that register classes. Raises ConfigError for one that fails."""
    for point in _entry_points(PLUGINS):
        try:
            import_module(point.module)
        except Exception as error:  # of the user's own code
            raise ConfigError(
                f"the plugin {point.name} of {_distribution(point)} cannot be imported: {type(error).__name__}: "
                f"{error}; mend {point.module}, or uninstall the package"
            ) from error


def plugin_packages() -> tuple[str, ...]:
    """Return the names of the installed packages that register classes."""
    return tuple(dict.fromkeys(point.module.partition(".")[0] for point in _entry_points(PLUGINS)))


def package_folder(name: str) -> Path | None:
    """Return the folder of an installed package that adds options, where its URDFs are; None for any other name."""
    for point in _entry_points(CONFIG):
        if point.module.split(".")[0] == name:
            return _folder(name)
    return None


@cache
def _packaged_folders() -> tuple[Path, ...]:
    folders = []
    for point in _entry_points(CONFIG):
        folder = _folder(point.module)
        if folder is None:
            raise ConfigError(f"{_distribution(point)} has no package {point.module}, which its entry point names")
        folders.append(folder)
    return tuple(folders)


def _folder(module: str) -> Path | None:
    spec = find_spec(module)
    places = list(spec.submodule_search_locations or ()) if spec else []
    return Path(places[0]) if places else None


@cache
def _entry_points(group: str) -> tuple[Any, ...]:
    from importlib.metadata import entry_points  # 50 ms to import

    return tuple(sorted(entry_points(group=group), key=lambda point: point.name))


def _distribution(point: Any) -> str:
    return point.dist.name if point.dist else "an installed package"
