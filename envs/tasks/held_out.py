"""Which words and phrases no training sentence uses."""

from __future__ import annotations

from dataclasses import dataclass

from conf.schema import Checked, ConfigError
from language import HeldOut, LanguageError


@dataclass(frozen=True, kw_only=True)
class HeldOutConfig(Checked):
    """Words and phrases that the split train never uses, as in `language.HeldOut`."""

    color_noun: list[list[str]]
    relation_noun: list[list[str]]
    phrases: list[str]

    def __post_init__(self) -> None:
        super().__post_init__()
        self.held_out()

    def held_out(self) -> HeldOut:
        """As a `language.HeldOut`. Raises ConfigError."""
        for name in ("color_noun", "relation_noun"):
            for pair in getattr(self, name):
                if len(pair) != 2:
                    raise ConfigError(f"{name}={pair} must be pairs, like [red, cube] or [left of, cube]")
        pairs = {name: tuple((a, b) for a, b in getattr(self, name)) for name in ("color_noun", "relation_noun")}
        try:
            return HeldOut(**pairs, phrases=tuple(self.phrases))
        except LanguageError as error:
            raise ConfigError(str(error)) from None
