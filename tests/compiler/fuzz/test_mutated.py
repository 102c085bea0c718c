"""Wrong sources get diagnostics, never a traceback; the command `python -m tests.compiler.fuzz` tries many
more.
"""

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.errors import InputError
from tests.campaigns import sampled
from tests.compiler.fuzz.__main__ import LEVELS, verdict
from tests.compiler.fuzz.mutate import DIALECTS, Corpus


@pytest.mark.parametrize("first", sampled(range(0, 60, 15), 2))
def test_a_mutated_source_has_a_program_or_diagnostics(first: int) -> None:
    for seed in range(first, first + 15):
        text, dialect = Corpus.of_tests().mutated(seed)
        kind, said = verdict(text, dialect, LEVELS[seed % len(LEVELS)], limit=False)
        assert kind in ("program", "diagnostics"), f"seed {seed}: {said}"


def test_every_dialect_and_level_is_mutated() -> None:
    corpus = Corpus.of_tests()
    assert {dialect for _, dialect in corpus.texts} == set(DIALECTS)
    tried = {(corpus.mutated(seed)[1], LEVELS[seed % len(LEVELS)]) for seed in range(600)}
    assert len(tried) == len(DIALECTS) * len(LEVELS)


def test_the_same_seed_is_the_same_source() -> None:
    corpus = Corpus.of_tests()
    assert corpus.mutated(5) == corpus.mutated(5) != corpus.mutated(6)


@pytest.mark.parametrize("opening", ["(", "-", "{", "if (1) ", "x = ", "(char)"])
def test_deep_nesting_is_an_error_that_says_so(opening: str) -> None:
    text = f"char x;\nvoid main(void) {{ {opening * 5000}x; }}"
    with pytest.raises(InputError) as caught:
        compile_sources([Source(text, "deep.c")], Options(dialect="xc8"))
    assert str(caught.value.diagnostics[-1]).startswith("deep.c")


def test_a_serial_setting_with_leading_zeros_is_decimal() -> None:
    settings = "".join(
        f"#pragma RS232_{name} {value}\n"
        for name, value in (("TXPORT", "006"), ("TXPIN", "08"), ("BAUD", "9600"))
    )
    kind, said = verdict(settings + "void main(void) { putchar('a'); }\n", "c2c", limit=False)
    assert kind == "diagnostics"  # there is no pin 8
    assert not said
