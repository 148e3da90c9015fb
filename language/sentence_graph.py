"""From a JSGF grammar to the smallest graph of words that accepts the same sentences, as recognisers search it.

The part of JSGF that `language/speech_grammar.py` writes: rules of words, (groups), [optional parts] and | for "or".
A rule may end with itself; else it refers to rules below it.
"""

from __future__ import annotations

import re
from collections import defaultdict
from typing import NamedTuple

TOKEN = re.compile(r"<\w+>|[\w']+|[()|\[\]]")
RULE = re.compile(r"^(?:public )?<(\w+)> = (.*);$", re.MULTILINE)

Arcs = list[list[tuple[str, int]]]  # by state, words and next states; the word "" is none


class SentenceGraph(NamedTuple):
    """States are numbered; 0 is the start. arcs: by state, the next state for each word. ends: where sentences end."""

    arcs: list[dict[str, int]]
    ends: frozenset[int]

    def accepts(self, sentence: str) -> bool:
        """Return whether it is one of its sentences."""
        state = 0
        for word in sentence.split():
            if word not in self.arcs[state]:
                return False
            state = self.arcs[state][word]
        return state in self.ends


def sentence_graph(grammar: str) -> SentenceGraph:
    """Return the graph of a grammar's first rule."""
    rules = {name: TOKEN.findall(body) for name, body in RULE.findall(grammar)}
    return _Rules(rules).graph(next(iter(rules)))


class _Rules:
    """The rules of a grammar, each of which becomes a smallest graph once."""

    def __init__(self, rules: dict[str, list[str]]) -> None:
        self._rules, self._graphs = rules, dict[str, SentenceGraph]()

    def graph(self, name: str) -> SentenceGraph:
        """Return the graph of a rule."""
        if name not in self._graphs:
            arcs: Arcs = [[], []]
            self._add(arcs, name)
            self._graphs[name] = _smallest(*_deterministic(arcs))
        return self._graphs[name]

    def _add(self, arcs: Arcs, name: str) -> None:
        """Add a rule between the states 0 and 1."""
        tokens = self._rules[name]
        groups = [(0, 1)]  # of the open brackets: start and end
        state = 0
        for token in tokens:
            start, end = groups[-1]
            if token == "|":
                arcs[state].append(("", end))
                state = start
            elif token in "([":
                inner, after = len(arcs), len(arcs) + 1
                arcs += [[], []]
                arcs[state] += [("", inner), *([("", after)] if token == "[" else [])]
                groups.append((inner, after))
                state = inner
            elif token in ")]":
                arcs[state].append(("", end))
                groups.pop()
                state = end
            else:
                state = self._follow(arcs, state, token, name)
        arcs[state].append(("", 1))

    def _follow(self, arcs: Arcs, state: int, token: str, inside: str) -> int:
        """Add a word or a rule after a state. Return the state behind it."""
        after = len(arcs)
        arcs.append([])
        if token[0] != "<":
            arcs[state].append((token, after))
        elif token[1:-1] == inside:  # at its own end
            arcs[state].append(("", 0))
        else:
            graph = self.graph(token[1:-1])
            first = len(arcs)
            arcs += [[(word, first + to) for word, to in row.items()] for row in graph.arcs]
            arcs[state].append(("", first))
            for each in graph.ends:
                arcs[first + each].append(("", after))
        return after


def _deterministic(arcs: Arcs) -> tuple[list[dict[str, int]], set[int]]:
    """Return arcs with one next state for each word, and the states where sentences end, from those of 0 to 1."""
    closures: dict[int, frozenset[int]] = {}

    def closure(state: int) -> frozenset[int]:
        if state not in closures:
            found, waiting = {state}, [state]
            while waiting:
                for word, after in arcs[waiting.pop()]:
                    if not word and after not in found:
                        found.add(after)
                        waiting.append(after)
            closures[state] = frozenset(each for each in found if each == 1 or any(word for word, _ in arcs[each]))
        return closures[state]

    first = closure(0)
    numbers, made, waiting = {first: 0}, [], [first]
    for states in waiting:  # grows meanwhile
        nexts: dict[str, set[int]] = defaultdict(set)
        for state in states:
            for word, after in arcs[state]:
                if word:
                    nexts[word] |= closure(after)
        row = {}
        for word, afters in nexts.items():
            known = frozenset(afters)
            if known not in numbers:
                numbers[known] = len(numbers)
                waiting.append(known)
            row[word] = numbers[known]
        made.append(row)
    return made, {number for states, number in numbers.items() if 1 in states}


def _smallest(arcs: list[dict[str, int]], ends: set[int]) -> SentenceGraph:
    """Join the states from which the same sentences can follow (Moore's algorithm). State 0 stays the start."""
    classes, count = [int(state in ends) for state in range(len(arcs))], 0
    while count != len(set(classes)):
        count = len(set(classes))
        numbers: dict[object, int] = {}
        classes = [
            numbers.setdefault(
                (classes[state], frozenset((word, classes[to]) for word, to in row.items())), len(numbers)
            )
            for state, row in enumerate(arcs)
        ]
    joined: list[dict[str, int]] = [{} for _ in range(count)]
    for state, row in enumerate(arcs):
        joined[classes[state]] = {word: classes[to] for word, to in row.items()}
    return SentenceGraph(joined, frozenset(classes[state] for state in ends))
