"""Composition of the config by Hydra: the options of its groups, then single values."""

from __future__ import annotations

import os
import pickle
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import islice
from pathlib import Path
from typing import Any, cast

from core.errors import ConfigError, did_you_mean
from core.path_keys import OUTPUTS, escaped, to_hydra
from core.plugins import ROOT, options_in, own_files, search_words

MAX_RUNS = 10_000  # of a sweep
FOLDER_RESOLVERS = ("now", "hydra", "tag")  # that the name of an output folder may have, beside keys of the config


def groups() -> dict[str, list[str]]:
    """Return each config group with its options."""
    return {group: list(options) for group, options in _groups_on_disk(own_files())}


def option_file(group: str, option: str) -> Path:
    """Return the YAML of an option."""
    every = [*options_in(ROOT), *(Path(path) for path, _ in own_files())]
    return next(path for path in every if (path.parent.name, path.stem) == (group, option))


@cache
def _groups_on_disk(own: tuple[tuple[str, int], ...]) -> list[tuple[str, list[str]]]:
    options: dict[str, list[str]] = {}
    for path in sorted([*options_in(ROOT), *(Path(path) for path, _ in own)]):
        options.setdefault(path.parent.name, []).append(path.stem)
    return [(group, sorted(options[group])) for group in sorted(options)]


def quoted(arguments: Iterable[str]) -> list[str]:
    """Return the arguments as Hydra reads them: numeric options (scenario=1,2) and paths are in quotes."""
    names = set(groups())
    words = [to_hydra(word, _is_interpolated) for word in arguments]
    return [re.sub(r"(?<=[=,])\d+(?=,|$)", r"'\g<0>'", w) if w.split("=")[0] in names else w for w in words]


def _is_interpolated(name: str) -> bool:
    """Whether `${name}` or `${name:...}` in the name of an output folder is an interpolation."""
    from omegaconf import OmegaConf

    return name in FOLDER_RESOLVERS or OmegaConf.select(composed([])[0], name, default=ROOT) is not ROOT


def parse(words: Sequence[str]) -> list[Any]:
    """Return Hydra's `Override` of each word. Raises ConfigError for a word that is none."""
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.errors import HydraException

    parser, overrides = OverridesParser.create(), []
    for word in words:
        try:
            [override] = parser.parse_overrides([to_hydra(word, _is_interpolated)])
            override.input_line = word
            override.config_loader = cast(Any, _Options())
            overrides.append(override)
        except (HydraException, ValueError) as error:
            key, _, value = word.partition("=")
            if key != key.strip():
                raise ConfigError(f"{word} has a blank in its key; give {key.strip()}={value.strip()}") from None
            key = key.lstrip("+~")
            if "=" in word and key and not key.isascii():
                raise ConfigError(f"{word}: {key} is not a known key; keys are written in Latin letters") from None
            reason = " ".join((str(error).splitlines() or ["not an override"])[0].split())
            raise ConfigError(f"{word}: {reason}; overrides are written key=value") from None
        _check_values(overrides[-1])
    return overrides


def split_run_folder(words: Sequence[str]) -> tuple[list[str], Path | None]:
    """Return the words for Hydra, and the folder of the run if its name has a `${` that is no interpolation.

    Hydra, which would read that again as one, is given a folder above it. Raises ConfigError for a sweep.
    """
    kept, folder = [], None
    for word in words:
        key, _, value = word.partition("=")
        if key not in OUTPUTS or "\\${" not in escaped(value, _is_interpolated):
            kept.append(word)
        elif key == "hydra.run.dir":
            folder = Path(value).absolute()
            kept.append(f"{key}={next(each for each in folder.parents if '${' not in str(each))}")
        else:
            raise ConfigError(f"{word}: Hydra would replace ${{...}} in the name; give another one")
    return kept, folder


class _Options:
    """What Hydra's `Override` asks for the options that `glob(...)` stands for."""

    def get_group_options(self, group: str, results_filter: Any = None) -> list[str]:
        """Return the options of a group. Raises ValueError for a key that is none."""
        if group not in groups():
            raise ValueError(f"glob(...) chooses among the options of a group, and {group} is a single key")
        return groups()[group]


def _check_values(override: Any) -> None:
    """Raises ConfigError for a sweep whose values cannot be listed."""
    from hydra.core.override_parser.types import IntervalSweep
    from hydra.errors import HydraException

    word = override.input_line
    if isinstance(override.value(), IntervalSweep):
        raise ConfigError(f"{word}: an interval has no values to list; give choice(0,1) or range(0,2)")
    if not override.is_sweep_override():
        return
    try:
        count = sum(1 for _ in islice(override.sweep_iterator(), MAX_RUNS + 1))
    except (HydraException, ValueError, ArithmeticError) as error:
        raise ConfigError(f"{word}: {' '.join(str(error).split())}") from None
    if count > MAX_RUNS:
        raise ConfigError(f"{word} are more than {MAX_RUNS:,} runs; give fewer values")


def compose(overrides: Iterable[str] = ()) -> Any:
    """Compose the project's config with Hydra overrides, and add the chosen options as `with_choices` does.

    Raises ConfigError for what Hydra refuses.
    """
    return with_choices(*composed(overrides))


def with_choices(config: Any, choices: Mapping[str, Any]) -> Any:
    """Add a key `choices` to a composed config: the option of each config group, such as `{"robot": "kuka", ...}`.

    A group's values alone do not determine its option: options can share a name, and single keys can be overridden.

    Args:
        config: a composed DictConfig; it is changed.
        choices: `hydra.runtime.choices`.
    """
    from omegaconf import open_dict

    with open_dict(config):
        config["choices"] = {group: str(choices[group]) for group in groups() if group in choices}
    return config


def composed(overrides: Iterable[str]) -> tuple[Any, Mapping[str, Any]]:
    """Return the composed config, which the caller may change, and the option of each group. Raises ConfigError."""
    result = _composed_once(tuple(overrides), own_files())
    return pickle.loads(result.config), result.choices


def output_folder(overrides: Iterable[str], mode: str) -> str:
    """Return `hydra.run.dir` or `hydra.sweep.dir`, with interpolations. mode: "run" or "sweep". Raises ConfigError."""
    return _composed_once(tuple(overrides), own_files()).folders[mode]


@dataclass(frozen=True)
class _Composed:
    """What Hydra composed. config: pickled, since a copy by pickle takes a fifth of the time of `deepcopy`."""

    config: bytes
    choices: Mapping[str, Any]
    folders: Mapping[str, str]


@lru_cache(maxsize=512)
def _composed_once(overrides: tuple[str, ...], own: tuple[tuple[str, int], ...]) -> _Composed:
    """Compose with Hydra, which takes 0.1 s, and check that every interpolation resolves. Raises ConfigError."""
    from omegaconf import OmegaConf, open_dict
    from omegaconf.errors import OmegaConfBaseException

    config = compose_hydra(overrides)
    hydra = config.hydra
    places: Any = {mode: OmegaConf.to_container(hydra[mode], resolve=False) for mode in ("run", "sweep")}
    folders = {mode: str(place["dir"]) for mode, place in places.items()}
    with open_dict(config):
        del config["hydra"]
    try:
        OmegaConf.to_container(config, resolve=True)
    except OmegaConfBaseException as error:
        value = OmegaConf.to_container(config, resolve=False)
        for name in str(error.full_key).split("."):
            value = value[name] if isinstance(value, dict) and name in value else value
        reason = str(error.msg or error).splitlines()[0]
        raise ConfigError(f"{error.full_key}={value} cannot be resolved: {reason}; write the value itself") from None
    return _Composed(pickle.dumps(config), dict(hydra.runtime.choices), folders)


def compose_hydra(overrides: Iterable[str]) -> Any:
    """Return the composed config with Hydra's own settings under `hydra`. Raises ConfigError for what Hydra refuses."""
    from hydra import compose as hydra_compose
    from hydra import initialize_config_module
    from hydra.errors import HydraException
    from yaml import YAMLError

    words = list(overrides)
    hydra_words = [*quoted(words), *search_words()]
    try:
        with _own_hydra(), initialize_config_module("conf", version_base="1.3"):
            return hydra_compose("config", hydra_words, return_hydra_config=True)
    except (HydraException, ValueError, YAMLError) as error:  # ValueError: a value that names no option
        raise ConfigError(_yaml_error(error) or _one_line(f"{error}\n{error.__cause__ or ''}", words)) from None


def _yaml_error(error: Exception) -> str | None:
    """Return which file is no YAML, where, and what is wrong, in one line; None for another error."""
    from yaml import MarkedYAMLError, YAMLError

    if isinstance(error, UnicodeDecodeError):
        files = [*ROOT.rglob("*.yaml"), *(Path(path) for path, _ in own_files())]
        file = next((path for path in files if path.is_file() and path.read_bytes() == error.object), ROOT)
        return f"{file} is not UTF-8 text: {error.reason} at byte {error.start}"
    if isinstance(error, MarkedYAMLError) and error.problem_mark is not None:
        mark = error.problem_mark
        problem = " ".join(f"{error.context or ''} {error.problem or ''}".split())
        return f"{mark.name}, line {mark.line + 1}, column {mark.column + 1}: {problem}"
    return " ".join(str(error).split()) if isinstance(error, YAMLError) else None


@contextmanager
def _own_hydra() -> Iterator[None]:
    """Within this block, Hydra is as in a fresh process; then as before, for a program with a Hydra of its own."""
    from hydra.core.global_hydra import GlobalHydra
    from hydra.version import VersionBase

    hydra, version = GlobalHydra.instance(), VersionBase.instance()
    held, base = hydra.hydra, version.version_base
    hydra.hydra = None
    try:
        yield
    finally:
        # Hydra puts other objects in place of both.
        GlobalHydra.set_instance(hydra)
        VersionBase.set_instance(version)
        hydra.hydra, version.version_base = held, base


@contextmanager
def raised_by_hydra() -> Iterator[None]:
    """Within this block, which starts Hydra, an error that Hydra or OmegaConf raises itself is a ConfigError.

    Without it, Hydra prints a traceback and exits.
    """
    os.environ.setdefault("HYDRA_FULL_ERROR", "1")  # Hydra raises
    try:
        yield
    except ConfigError:
        raise
    except Exception as error:
        place = error.__traceback__
        while place is not None and place.tb_next is not None:
            place = place.tb_next
        module = "" if place is None else str(place.tb_frame.f_globals.get("__name__"))
        if text := _yaml_error(error):
            raise ConfigError(text) from None
        if module.partition(".")[0] not in ("hydra", "omegaconf"):
            raise
        raise ConfigError(f"Hydra refuses this: {_one_line(str(error), sys.argv[1:])}") from None


def _one_line(text: str, words: Sequence[str]) -> str:
    """Hydra's message in one line that begins with the word that it is about."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    merging = "Error merging override "
    if lines[0].startswith(merging) and len(lines) > 1:
        word = lines[0].removeprefix(merging)
        return f"{word}: {lines[1]}; {_present(word.partition('=')[0])}"
    about = next((word for word in words if (key := word.partition("=")[0]) and key in lines[0]), "")
    options = [line for line in lines[1:] if line.replace("_", "").isalnum()]
    ending = did_you_mean(about.partition("=")[2], options) if options else "; see python train.py --hydra-help"
    return f"{about}: {lines[0].rstrip('.')}{ending}".removeprefix(": ")


def _present(key: str) -> str:
    """Return the kind of value that a key has by default, for an error message."""
    from omegaconf import OmegaConf

    value = OmegaConf.select(compose_hydra([]), key)
    if OmegaConf.is_dict(value):
        return f"it is a group of keys: {', '.join(map(str, value))}"
    return f"its default is {value}"
