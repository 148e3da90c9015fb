"""Graphs of words made from grammars."""

from __future__ import annotations

from language.sentence_graph import sentence_graph

GRAMMAR = """#JSGF V1.0;
grammar test;
public <said> = <step> | <step> then <said> | stop;
<step> = (take | lift [up]) the <thing>;
<thing> = [red | blue] cube;
"""


def test_a_graph_accepts_the_sentences_of_its_grammar_and_no_others():
    graph = sentence_graph(GRAMMAR)
    for sentence in ("stop", "take the cube", "lift up the red cube then take the blue cube then stop"):
        assert graph.accepts(sentence)
    for sentence in (
        "",
        "take the",
        "take up the cube",
        "stop then stop",
        "take the red blue cube",
        "lift the cube then",
    ):
        assert not graph.accepts(sentence)


def test_states_from_which_the_same_can_follow_are_one():
    assert len(sentence_graph("<said> = a c | b c;\n").arcs) == 3
