"""Overrides of the config: checks with suggestions, and application to a saved config."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any

from core.composition import compose, composed, groups, option_file, parse
from core.errors import ConfigError, did_you_mean
from core.path_keys import escaped, from_hydra, is_path
from core.plugins import ROOT, own_files

FIXED_BY_TRAINING = ("robot", "control", "policy", "algo")  # groups that a checkpoint can't change


def comment(group: str, option: str) -> str:
    """Return the comment at the top of an option's YAML."""
    lines = option_file(group, option).read_text(encoding="utf-8").splitlines()
    top = itertools.takewhile(lambda line: line.startswith("#"), lines)
    return " ".join(line.lstrip("# ") for line in top if "@package" not in line)


def check(arguments: Sequence[str]) -> None:
    """Raise ConfigError for an override of an unknown group, option or key. Flags (--help) are ignored."""
    overrides = parse([word for word in arguments if not word.startswith("-")])
    chosen = _check_words(overrides)
    error = None
    try:
        if any(each.key_or_group not in groups() for each in overrides):
            composed([first_value(each) for each in overrides])
    except ConfigError as refusal:
        error = refusal
    if error is not None or any(map(_is_opened, overrides)):  # Hydra lets words add any key
        _check_keys(overrides, chosen)
    words = [each.input_line for each in overrides if "${" in each.input_line or each.is_delete()]
    if error is not None and words:
        raise ConfigError(str(error) if words[0] in str(error) else f"{words[0]}: {error}")


def _check_words(overrides: Sequence[Any]) -> list[str]:
    """Return the chosen options. Raise ConfigError for a word that sets nothing, and for an unknown option."""
    for override in overrides:
        _check_form(override)
    chosen = [_check_choice(each) for each in overrides if each.key_or_group in groups()]
    return [word for word in chosen if word]


def _check_keys(overrides: Sequence[Any], chosen: Sequence[str]) -> None:
    """Raise ConfigError for a key that the config with the chosen options does not have."""
    plain = [o for o in overrides if o.key_or_group not in groups() and not o.key_or_group.startswith("hydra")]
    keys = known_keys(chosen) if plain else []
    for override in plain:
        key = override.key_or_group
        if (key.rpartition(".")[0] if _is_opened(override) else key) not in keys:
            known = [*keys, *groups()]
            raise ConfigError(f"{override.input_line}: {key} is not a known key" + did_you_mean(key, known))


def _is_opened(override: Any) -> bool:
    """Whether the word adds or deletes a key of a group with free names, such as task.reward."""
    return bool(override.is_add() or override.is_force_add() or override.is_delete())


def first_value(override: Any) -> str:
    """Return the word of an override with the first of its values, if it has several."""
    if not override.is_sweep_override():
        return str(override.input_line)
    return from_hydra(f"{override.key_or_group}={next(iter(override.sweep_string_iterator()))}")


def known_keys(chosen: Sequence[str]) -> list[str]:
    """Return the dotted keys of the config with these options."""
    return list(_known_keys(tuple(chosen), own_files()))


@lru_cache(maxsize=512)
def _known_keys(chosen: tuple[str, ...], own: tuple[tuple[str, int], ...]) -> tuple[str, ...]:
    return tuple(_keys(composed(chosen)[0]))


def _check_form(override: Any) -> None:
    """Raise ConfigError for a word that sets nothing, or that changes which groups there are."""
    word, key = override.input_line, override.key_or_group
    if override.package is not None or ((override.is_add() or override.is_force_add()) and key in groups()):
        raise ConfigError(f"{word}: an option is chosen as {key}={override.value()}")
    if override.is_delete():
        if "." not in key and key not in groups():
            raise ConfigError(f"{word}: every run needs {key}; change it with {key}=<value>")
        return
    if override.is_sweep_override():
        if not list(override.sweep_string_iterator()):
            raise ConfigError(f"{word} has no values: give at least one, as in {key}=0,1")
    elif str(override.value()) in ("", "???"):
        raise ConfigError(f"{word} has no value; give {key}=<value>, or leave it out")


def apply(config: Any, overrides: Sequence[str]) -> Any:
    """Return the config of a checkpoint with overrides.

    An option replaces its whole group; that of `collector` keeps the values of the keys that both options have. The
    option of a group in `FIXED_BY_TRAINING` can't change.

    Args:
        config: of the checkpoint, a plain dict.
        overrides: key=value.

    Raises:
        ConfigError: an unknown key or option, or one that the checkpoint can't change.
    """
    from omegaconf import OmegaConf

    parsed = parse([word for word in overrides if not word.startswith("-")])
    _check_keys(parsed, _check_words(parsed))
    if any(("${" in each.input_line and not is_path(each.input_line)) or each.is_delete() for each in parsed):
        check(overrides)  # composes them all, which takes Hydra 0.1 s more
    options = [word for word in overrides if word.split("=")[0] in groups()]
    fresh: Any = compose(options) if options else None
    changed = OmegaConf.create(config)
    for word in overrides:
        key, _, value = word.partition("=")
        if key == "scenario":
            raise ConfigError(f"{word}: a checkpoint keeps the scenario that it was trained in")
        if key in FIXED_BY_TRAINING and fresh[key].get("name") != changed[key].get("name"):
            raise ConfigError(f"{word}: the checkpoint was trained with {key}={changed[key].get('name')}, and keeps it")
        if key == "gesture" and key in changed:
            changed[key].source = fresh[key].source  # the options differ in nothing else; the other keys are the run's
        elif not value or value == "???":
            raise ConfigError(f"{word} has no value; give {key}=<value>, or leave it out")
        elif key in groups():
            old = changed.get(key) or {} if key == "collector" else {}
            kept = {name: old[name] for name in old if name in fresh[key] and name != "name"}
            OmegaConf.update(changed, key, {**fresh[key], **kept}, merge=False)
        elif OmegaConf.select(changed, key, default=ROOT) is ROOT:
            raise ConfigError(f"{word}: {key} is not a key of this run's config" + did_you_mean(key, _keys(changed)))
        else:
            _update(changed, word)
        if key in groups() and "choices" in changed:
            changed.choices[key] = fresh.choices[key]
    return changed


def _update(config: Any, word: str) -> None:
    """Set a key of the config. Raises ConfigError for a value that does not fit, such as a list for a group."""
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    key, _, value = word.partition("=")
    try:
        new = escaped(value) if is_path(word) else OmegaConf.from_dotlist([f"v={value}"]).v
        OmegaConf.update(config, key, new)
    except (OmegaConfBaseException, YAMLError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise ConfigError(f"{word}: {reason}; it is {OmegaConf.select(config, key)} in the run's config") from None


def _check_choice(override: Any) -> str:
    group, value = override.key_or_group, override.value()
    options = groups()[group]
    given = list(override.sweep_iterator()) if override.is_sweep_override() else [value]
    choices = [
        str(getattr(choice, "text", choice)).strip("'\"") for choice in given
    ]  # `text`: the attribute of a quoted string
    for choice in choices:
        if choice not in options:
            raise ConfigError(f"{group}={choice} is not known" + did_you_mean(choice, options))
    return f"{group}={choices[0]}" if choices else ""


def _keys(config: Any, prefix: str = "") -> Iterable[str]:
    for key in config:
        yield f"{prefix}{key}"
        value = config._get_node(key) if hasattr(config, "_get_node") else config[key]
        if hasattr(value, "keys") and not getattr(value, "_is_none", lambda: False)():
            yield from _keys(value, f"{prefix}{key}.")
