"""docs/language.md: its Python runs, and its commands print what it shows."""

import copy
import importlib
import io
import re
import shlex
from pathlib import Path

import pytest

import language
from language import COLORS, NOUNS, RELATIONS, SIZES, SUPERLATIVES, VERBS
from language.cli import main

PAGE = (Path(language.__file__).parent.parent / "docs" / "language.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
PYTHON = [code for kind, code in BLOCKS if kind == "python"]
CONSOLE = "".join(text for kind, text in BLOCKS if kind == "console")
STEP = dict.fromkeys(language.GroundedStep.__dataclass_fields__, str)
KNOWN = {"object": language.Object, "scene": language.Scene, **STEP}  # names that the table uses
REGISTRIES = (COLORS, NOUNS, SIZES, RELATIONS, SUPERLATIVES, VERBS)


@pytest.fixture
def registries():
    before = [copy.copy(registry) for registry in REGISTRIES]
    yield
    for registry, kept in zip(REGISTRIES, before, strict=True):
        registry.clear()
        registry.update(kept)


@pytest.mark.slow
@pytest.mark.parametrize("code", PYTHON, ids=range(len(PYTHON)))
def test_an_example_runs(code, registries):
    exec(compile(code, "docs/language.md", "exec"), {"__name__": "example"})


def test_the_page_shows_how_to_add_each_kind_of_word():
    added = [
        f"**A{kind}**" for kind in (" relation", " superlative", " verb", " template", " colour", " noun", " synonym")
    ]
    assert [kind for kind in added if kind not in PAGE] == []
    assert len(PYTHON) >= len(added)


def test_commands_print_what_the_page_shows(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    shown = [part.partition("\n")[::2] for part in CONSOLE.split("$ ")[1:]]
    assert len(shown) > 10
    for command, wanted in shown:
        if command.startswith("cat "):
            Path(command.removeprefix("cat ")).write_text(wanted)
        else:
            printed = run(command, monkeypatch, capsys)
            assert re.fullmatch(pattern(wanted), printed), f"{command}\n{printed}"


def run(command, monkeypatch, capsys):
    """What a command prints on both streams."""
    words, _, source = command.partition(" < ")
    if source:
        monkeypatch.setattr("sys.stdin", io.StringIO(Path(source).read_text()))
    program, *arguments = shlex.split(words)
    assert [program, *arguments[:2]] == ["python", "-m", "language"]
    status = main(arguments[2:])
    out, errors = capsys.readouterr()
    assert (status == 2) == any(word in out + errors for word in ("error", "question: "))
    return out + errors


def pattern(wanted):
    """A regular expression for the lines shown; "..." stands for anything within a line."""
    return re.escape(wanted).replace(re.escape("..."), ".*")


def test_every_function_in_the_table_exists():
    table = PAGE.partition("| the original |")[2].partition("\n\n")[0]
    ours = re.findall(r"`((?:\w+\.)*\w+)[`(]", "".join(line.rsplit(" | ", 1)[-1] for line in table.splitlines()))
    assert len(set(ours)) > 20
    assert [name for name in ours if not exists(name)] == []


def exists(name):
    """Whether a dotted name is one of language's, of a module's, or of an object of a scene or a step."""
    if name.startswith("language."):
        module, _, name = name.rpartition(".")
        return hasattr(importlib.import_module(module), name)
    first, *rest = name.split(".")
    found = getattr(language, first, None) or KNOWN.get(first)
    return found is not None and (not rest or rest[0] in dir(found) or rest[0] in found.__dataclass_fields__)
