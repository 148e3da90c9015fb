"""Goals of episodes: referent, target and sentence, as slots, tokens and bytes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from envs.tasks import EpisodeSpec, GivenInstruction
from language import LanguageError, Tokenizer


@dataclass(frozen=True, kw_only=True)
class Goal:
    """The goal of one world's episode.

    referent, target: slots; without a target, `target` is the referent's. sentence: as a person says it.
    policy_sentence: as the policy reads it. kind: index into the task's kind_names.
    """

    referent: int
    target: int
    sentence: str
    policy_sentence: str
    kind: int

    @classmethod
    def of(cls, episode: EpisodeSpec, slots: NDArray[np.int64]) -> Goal:
        """Return the goal of an episode whose objects stand in these slots (K,)."""
        target = episode.referent if episode.target is None else episode.target
        return cls(
            referent=int(slots[episode.referent]),
            target=int(slots[target]),
            sentence=episode.sentence,
            policy_sentence=policy_sentence(episode),
            kind=episode.kind,
        )

    @classmethod
    def of_instruction(cls, given: GivenInstruction, slots: NDArray[np.int64]) -> Goal:
        """Return the goal of an instruction in a scene whose objects stand in these slots (K,)."""
        target = given.referent if given.target is None else given.target
        heard = given.sentence if given.heard is None else given.heard
        return cls(
            referent=int(slots[given.referent]),
            target=int(slots[target]),
            sentence=given.sentence,
            policy_sentence=heard,
            kind=given.kind,
        )

    def instruction(self, slots: NDArray[np.int64]) -> GivenInstruction:
        """Return the instruction, in a scene whose objects stand in these slots (K,) in ascending order."""
        referent, target = np.searchsorted(slots, (self.referent, self.target)).tolist()
        return GivenInstruction(
            kind=self.kind,
            referent=referent,
            target=None if target == referent else target,
            sentence=self.sentence,
            heard=self.policy_sentence,
        )


def policy_sentence(episode: EpisodeSpec) -> str:
    """Return the sentence that the policy reads: the episode's own, unless it is rephrased."""
    return episode.sentence if episode.heard is None else episode.heard


def tokens(episode: EpisodeSpec, tokenizer: Tokenizer) -> NDArray[np.int64]:
    """(L,) the tokens that the policy reads."""
    return tokenizer.encode(policy_sentence(episode))


def sentence_bytes(tokenizer: Tokenizer) -> int:
    """Return the bytes that the longest sentence of known words needs, with a space and a mark after each word."""
    return tokenizer.length * (max(len(word.encode()) for word in tokenizer.vocabulary) + 2)


def in_bytes(sentence: str, size: int) -> NDArray[np.uint8]:
    """(size,) the sentence in UTF-8, filled up with zeros. Raises LanguageError for a longer one."""
    encoded = sentence.encode()
    if len(encoded) > size:
        raise LanguageError(f"a sentence has {len(encoded)} bytes; at most {size} fit")
    return np.frombuffer(encoded.ljust(size, b"\0"), np.uint8)
