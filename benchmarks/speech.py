"""Spoken instructions: how many words and plans are right where synthesised voices say what scenes' scripts ask for.

    pip install ttspico                            # two of the voices; it is compiled
    python -m benchmarks.speech                    # 200 instructions, each by three voices
    python -m benchmarks.speech --snr 20           # with white noise, 20 dB below the voice
    python -m benchmarks.speech --errors           # also what was heard instead
    python -m benchmarks.speech --json             # the last line as JSON

Each instruction is of another scene. Words right: 1 - (words inserted, lost and replaced) / words said, where "grey" is
"gray". Sentences right: with all words. Plans right: what was heard is planned as what was said, typed.
The intervals are Wilson's for shares, and of a bootstrap over instructions for words (95 %).
"""

from __future__ import annotations

import argparse
import json
import re
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator

from demo.session import Session
from demo.session_config import make_config
from language import LanguageError, Outcome, Plan
from language.hearing import RATE, Recogniser, Sound
from language.speech_grammar import speech_grammar
from language.voices import VOICES
from trainers.evaluation.evaluation import wilson

TASKS = ("nl_reach", "nl_pick_and_place", "anything")
RESAMPLES = 2000  # of the bootstrap


class Heard(NamedTuple):
    """What became of one spoken instruction. seconds: of the sound. took: seconds of CPU time to hear it."""

    said: str
    heard: str
    wrong: int
    words: int
    plan: bool
    seconds: float
    took: float


def plain(sentence: str) -> list[str]:
    """Return the words of a sentence, in one spelling."""
    return re.findall(r"[a-z']+", sentence.lower().replace("grey", "gray"))


def distance(said: list[str], heard: list[str]) -> int:
    """Return the least number of words that are inserted, lost and replaced."""
    costs = list(range(len(heard) + 1))
    for number, word in enumerate(said, 1):
        row = [number]
        for at, other in enumerate(heard):
            row.append(min(costs[at] + (word != other), costs[at + 1] + 1, row[at] + 1))
        costs = row
    return costs[-1]


def planned(outcome: Outcome) -> tuple[Any, ...]:
    """Return what an outcome comes to, to compare two of them."""
    if isinstance(outcome, Plan):
        return tuple((step.verb, step.object, step.goal, step.place) for step in outcome.steps)
    return type(outcome).__name__, getattr(outcome, "text", "")


def with_noise(sound: Sound, snr: float, rng: Generator) -> Sound:
    """Return a sound with white noise. snr: of powers, in dB."""
    level = np.sqrt(np.mean(np.square(sound, dtype=np.float64)) / 10 ** (snr / 10))
    return np.clip(sound + rng.normal(0, level, len(sound)), -32768, 32767).astype(np.int16)


def measured(args: argparse.Namespace) -> Iterator[tuple[str, Heard]]:
    """Yield each voice's name with what became of each of its instructions."""
    recogniser, rng = Recogniser(), np.random.default_rng([args.seed, 46])
    for number, task in enumerate(TASKS):
        session = Session(make_config(task=task, driver="expert"), args.seed)
        for _ in range(number, args.count, len(TASKS)):
            session.shuffle(int(rng.integers(2**31)))
            said, verbs = session.env.sentence(), session.env.task.verbs or (session.env.task.verb,)
            grammar = speech_grammar(session.scene(), verbs, session.env.has_person)
            for name, voice in VOICES.items():
                sound = voice(said)
                sound = sound if args.snr is None else with_noise(sound, args.snr, rng)
                yield name, hear(recogniser, session, said, sound, grammar)
        session.close()


def hear(recogniser: Recogniser, session: Session, said: str, sound: Sound, grammar: str) -> Heard:
    """Return what becomes of a sound."""
    start = time.process_time()
    try:
        heard = recogniser.hear(sound, grammar)
    except LanguageError:
        heard = ""
    took = time.process_time() - start
    words = plain(said)
    same = bool(heard) and planned(session.preview(heard)) == planned(session.preview(said))
    return Heard(said, heard, distance(words, plain(heard)), len(words), same, len(sound) / RATE, took)


def summary(found: list[Heard]) -> dict[str, Any]:
    """Return the shares that are right, each with its interval."""
    wrong, words = np.array([each.wrong for each in found]), np.array([each.words for each in found])
    drawn = np.random.default_rng(0).integers(len(found), size=(RESAMPLES, len(found)))
    interval = np.quantile(1 - wrong[drawn].sum(1) / words[drawn].sum(1), (0.025, 0.975))
    words_right = float(1 - wrong.sum() / words.sum())
    result = {"sounds": len(found), "words_right": words_right, "words_ci95": interval.tolist()}
    for name, right in {"sentences": wrong == 0, "plans": np.array([each.plan for each in found])}.items():
        result[f"{name}_right"] = float(right.mean())
        result[f"{name}_ci95"] = list(wilson(int(right.sum()), len(right)))
    took = sum(each.took for each in found) / sum(each.seconds for each in found)
    return {**result, "time_as_share_of_sound": took}


def shown(result: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of a summary."""
    for name, value in result.items():
        if not name.endswith("_ci95"):
            low, high = result.get(f"{name.removesuffix('_right')}_ci95", (None, None))
            text = f"{value:.3f}" if isinstance(value, float) else str(value)
            yield f"{name:24} {text}" + (f" ({low:.3f}-{high:.3f})" if low is not None else "")


def main() -> None:
    """Run the benchmark and print its table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--count", type=int, default=200, help="instructions (200)")
    options.add_argument("--seed", type=int, default=1, help="of the scenes (1)")
    options.add_argument("--snr", type=float, help="of added white noise, dB (none)")
    options.add_argument("--errors", action="store_true", help="print what was misheard")
    options.add_argument("--json", action="store_true", help="print all figures as a last line of JSON")
    args = options.parse_args()
    found: dict[str, list[Heard]] = {name: [] for name in VOICES}
    for name, heard in measured(args):
        found[name].append(heard)
        if args.errors and (heard.wrong or not heard.plan):
            print(f"{name}: {heard.said!r} was heard as {heard.heard!r}; plan {'right' if heard.plan else 'wrong'}")
    everything = [each for voice in found.values() for each in voice]
    results = {voice: summary(heard) for voice, heard in {**found, "all": everything}.items()}
    for voice, result in results.items():
        for line in shown(result):
            print(f"{voice:20} {line}")
    if args.json:
        print(json.dumps(results))


if __name__ == "__main__":
    main()
