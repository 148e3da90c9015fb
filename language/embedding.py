"""Sentences as vectors of floats, for policies without an encoder of words."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from language.colors import COLORS
from language.objects import ANY_NOUN, NOUNS
from language.tokenizer import Tokenizer

PHRASES = 3  # of a sentence that the vector describes: "the cube between the red ball and the blue one" has three
LATE = 0.5  # what a word counts at the end of the longest sentence; 1 at its beginning
PHRASE_WIDTH = 1 + 4 + len(NOUNS)


class SentenceEmbedding:
    """A fixed embedding: it is not learned, and says nothing but what the words say.

    The numbers of a vector, in [0, 1], in their order:

    1. `PHRASES` times `PHRASE_WIDTH`. A phrase ends with a noun. It is described by 1; by 1, red, green and blue, as
       object rows have them, if a colour is said before that noun; and by the one-hot of the noun in `NOUNS`, which is
       0 for "object", "one" and "thing". All are 0 for a phrase that is not said.
    2. V, one for each word of the vocabulary: 0 if it is not said, else 1 at the beginning of the sentence, and less
       with each word before it, down to `LATE`. Unknown words count as one word, and padding never occurs.

    Args:
        tokenizer: whose token ids are embedded.
    """

    def __init__(self, tokenizer: Tokenizer) -> None:
        self._words, self._length = len(tokenizer.vocabulary), tokenizer.length
        self.width = PHRASES * PHRASE_WIDTH + self._words
        self._meaning = np.zeros((self._words, PHRASE_WIDTH), np.float32)
        ids = {word: number for number, word in enumerate(tokenizer.vocabulary)}
        for name, color in COLORS.items():
            for word in {name, *color.synonyms} & set(ids):
                self._meaning[ids[word], 1:5] = 1.0, *color.rgb
        for word in set(ANY_NOUN) & set(ids):
            self._meaning[ids[word], 0] = 1.0
        for i, (noun, others) in enumerate(NOUNS.items()):
            for word in {noun, *others} & set(ids):
                self._meaning[ids[word], [0, 5 + i]] = 1.0

    def __call__(self, tokens: NDArray[np.int64]) -> NDArray[np.float32]:
        """(N, width) of token ids (N, L)."""
        meaning, worlds = self._meaning[tokens], np.arange(len(tokens))
        ends = meaning[..., 0] > 0
        phrase = ends.cumsum(1) - ends  # the phrase that each word belongs to
        said = [(meaning * (phrase == i)[..., None]).max(1) for i in range(PHRASES)]
        words = np.zeros((len(tokens), self._words), np.float32)
        for place in reversed(range(tokens.shape[1])):  # the first place of a word counts
            words[worlds, tokens[:, place]] = 1.0 - (1.0 - LATE) * place / self._length
        words[:, 0] = 0.0
        said = [values * values[:, :1] for values in said]  # a colour without a noun is no phrase
        return np.concatenate((*said, words), axis=1)
