"""Each form of statement takes the shortest sequence that is known, or no more words than it does.

A module in `statements` has a table of each kind: `SHORTEST`, what an expert in this chip's assembly writes;
`MOST_WORDS`, statements for which there may be shorter sequences; and `AS_GENERATED`, the words of all of
them as the code generator writes them. Words may get fewer, never more.
"""

from __future__ import annotations

from types import ModuleType

import pytest

from tests.compiler.codegen.forms import compiled, words
from tests.compiler.codegen.statements import assignments, bits, calls_and_loops, conditions, indirect

TOPICS = (assignments, bits, calls_and_loops, conditions, indirect)
topics = pytest.mark.parametrize("topic", TOPICS, ids=lambda each: each.__name__.rpartition(".")[2])


def bodies(topic: ModuleType) -> tuple[str, ...]:
    return (*topic.SHORTEST, *topic.MOST_WORDS)


@topics
def test_a_statement_takes_the_shortest_sequence(topic: ModuleType) -> None:
    forms = compiled(bodies(topic))
    assert {body: forms[body] for body in topic.SHORTEST} == topic.SHORTEST


@topics
def test_no_statement_takes_more_words(topic: ModuleType) -> None:
    forms = compiled(bodies(topic))
    longer = {body: forms[body] for body, most in topic.MOST_WORDS.items() if forms[body].count(";") >= most}
    assert longer == {}


@topics
def test_the_code_generator_alone_takes_no_more_words(topic: ModuleType) -> None:
    assert words(bodies(topic), "none") <= topic.AS_GENERATED
