"""Sentences of other people: which of them the wide grammar understands, and whether as expected.

    python -m benchmarks.sentences --data sentences.tsv
    python -m benchmarks.sentences --data calvin.yaml --scene scene.yaml

Two formats, by the file's ending:

* `.tsv`: a line each of sentence, scene file, expected object and, optionally, expected target, separated by tabs. The
  expectation is an id of the scene, "held" for a target that is the gripper, "asked" or "refused", or empty for any.
  Paths are relative to the file. Lines that begin with "#" are left out.
* `.json`, `.yaml`, `.yml`: annotations such as CALVIN's: a list of {task, sentence}, or a mapping from tasks to lists
  of sentences. They have no expectation: the outcomes are counted by task, in the scene of `--scene`.

Exits with 1 if a sentence has another outcome than the expected one.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from pathlib import Path

from language.errors import LanguageError
from language.scene_file import read_world
from tools.sentences import RESULTS, judged, read_sentences


def main() -> int:
    """Prints the results by group."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="the sentences: .tsv, .json or .yaml")
    parser.add_argument("--scene", type=Path, help="scene file of sentences that have none")
    parser.add_argument("--errors", action="store_true", help="list the sentences that are not right or understood")
    parser.add_argument("--json", action="store_true", help="print the counts as JSON on the last line")
    options = parser.parse_args()
    try:
        sentences = read_sentences(options.data, options.scene)
        worlds = {scene: read_world(scene) for scene in dict.fromkeys(each.scene for each in sentences)}
    except LanguageError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    counts: Counter[tuple[str, str]] = Counter()
    for sentence in sentences:
        result, said = judged(sentence, *worlds[sentence.scene])
        counts[sentence.group, result] += 1
        if options.errors and result not in ("right", "understood"):
            print(f"{result}\t{sentence.text}\t{said}")
    _print_table(counts)
    if options.json:
        totals = {name: sum(number for (_, result), number in counts.items() if result == name) for name in RESULTS}
        print(json.dumps({**totals, "total": len(sentences)}))
    return int(any(result == "wrong" for _, result in counts))


def _print_table(counts: Counter[tuple[str, str]]) -> None:
    groups = list(dict.fromkeys(group for group, _ in counts))
    width = max([5, *map(len, groups)])
    print(f"{'':{width}}" + "".join(f"{name:>12}" for name in RESULTS))
    for group in groups:
        print(f"{group:{width}}" + "".join(f"{counts[group, name]:12}" for name in RESULTS))


if __name__ == "__main__":
    sys.exit(main())
