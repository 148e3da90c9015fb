"""docs/understanding.md is up to date, and its examples run."""

import re

import pytest

from language.lattice import TABLES, forget_caches
from language.verbs import KNOWN
from tools.understanding_page import PAGE, page

EXAMPLES = re.findall(r"^```python\n(.*?)^```$", page(), re.MULTILINE | re.DOTALL)


@pytest.fixture
def lexicon():
    before = {category: dict(table) for category, table in TABLES.items()}
    said = {name: verb.words for name, verb in KNOWN.items()}
    yield
    for name, words in said.items():
        object.__setattr__(KNOWN[name], "words", words)
    for category, table in before.items():
        TABLES[category].update(table)
    forget_caches()


def test_the_page_is_what_the_tables_give():
    assert PAGE.read_text("utf-8") == page(), "run python -m tools.understanding_page"


@pytest.mark.parametrize("code", EXAMPLES, ids=range(len(EXAMPLES)))
def test_an_example_of_the_page_runs(code, lexicon):
    exec(
        compile("\n".join(EXAMPLES[: EXAMPLES.index(code) + 1]), "docs/understanding.md", "exec"),
        {"__name__": "example"},
    )


def test_the_page_shows_how_to_teach_a_phrase():
    assert any("teach(" in code for code in EXAMPLES)
