"""Sentences of other people in files, each with a scene and the expected outcome, for `benchmarks/sentences.py`."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from language import Outcome, Plan, Question, Refusal, WorldModel, interpret
from language.errors import LanguageError

RESULTS = ("right", "wrong", "asked", "refused", "understood")


class Sentence(NamedTuple):
    """A sentence with its scene file and its expected outcome, "" for any; group: by which results are counted."""

    text: str
    scene: Path
    object: str = ""
    target: str = ""
    group: str = "all"


def read_sentences(path: Path, scene: Path | None = None) -> list[Sentence]:
    """Return the sentences of a file; `benchmarks/sentences.py` describes the formats.

    Args:
        path: of the file.
        scene: file of the scene of sentences that have none.

    Raises:
        LanguageError: the file is invalid; the message names the line or entry.
    """
    try:
        text = path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise LanguageError(f"{path}: cannot be read: {error}") from None
    if path.suffix == ".tsv":
        return [_line(line, path, number) for number, line in enumerate(text.splitlines(), 1) if _counts(line)]
    if path.suffix not in (".json", ".yaml", ".yml"):
        raise LanguageError(f"{path}: the file must end in .tsv, .json, .yaml or .yml")
    if scene is None:
        raise LanguageError(f"{path}: sentences without scenes need --scene")
    return [Sentence(sentence, scene, group=task) for task, sentence in _annotations(text, path)]


def _counts(line: str) -> bool:
    return bool(line.strip()) and not line.startswith("#")


def _line(line: str, path: Path, number: int) -> Sentence:
    fields = [field.strip() for field in line.split("\t")]
    if not 2 <= len(fields) <= 4:
        raise LanguageError(f"{path}: line {number} has {len(fields)} fields; give sentence, scene, object, target")
    return Sentence(fields[0], path.parent / fields[1], *fields[2:])


def _annotations(text: str, path: Path) -> list[tuple[str, str]]:
    import yaml  # JSON is YAML

    try:
        loaded: Any = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise LanguageError(f"{path}: is not YAML: {' '.join(str(error).split())}") from None
    if isinstance(loaded, dict):
        loaded = [{"task": task, "sentence": each} for task, sentences in loaded.items() for each in sentences]
    for number, entry in enumerate(loaded if isinstance(loaded, list) else [loaded], 1):
        if not isinstance(entry, dict) or not isinstance(entry.get("sentence"), str):
            raise LanguageError(f"{path}: entry {number} must be {{task, sentence}}")
    return [(str(entry.get("task", "all")), entry["sentence"]) for entry in loaded]


def judged(sentence: Sentence, world: WorldModel, ids: tuple[str, ...]) -> tuple[str, str]:
    """Return one of RESULTS, and the outcome in words."""
    outcome = interpret(sentence.text, world)
    found, said = _found(outcome, ids)
    kind = {Question: "asked", Refusal: "refused"}.get(type(outcome), "understood")
    if not sentence.object and not sentence.target:
        return kind, said
    if sentence.object in ("asked", "refused"):
        return ("right" if kind == sentence.object else "wrong" if kind == "understood" else kind), said
    if kind != "understood":
        return kind, said
    pairs = zip((sentence.object, sentence.target), found, strict=True)
    return ("right" if all(expected in ("", name) for expected, name in pairs) else "wrong"), said


def _found(outcome: Outcome, ids: tuple[str, ...]) -> tuple[tuple[str, str], str]:
    """Returns the object and target of the last step that has one, and the outcome in words."""
    if not isinstance(outcome, Plan):
        return ("", ""), getattr(outcome, "text", "")
    if not outcome.steps:
        return ("", ""), "nothing"
    last = outcome.steps[-1]
    held = "held" if outcome.result is not None and outcome.result.held == last.object else ""
    target = held if last.goal is None else ids[last.goal]
    place = "" if last.place is None else "({:.2f}, {:.2f})".format(*last.place)
    return (ids[last.object], target), f"{last.verb} {ids[last.object]} {target or place}".strip()
