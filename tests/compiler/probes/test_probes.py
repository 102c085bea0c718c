"""Pieces of C mean what they mean to gcc and avr-gcc; the judges see what is wrong."""

import shutil
from collections import Counter

import pytest

from tests.compiler.probes.compare import compare, program, tokens_compared, values_compared
from tests.compiler.probes.judges import bytes_of, tokens_of
from tests.compiler.probes.macros import Text
from tests.compiler.probes.probe import Probe, Program

needs_avr_gcc = pytest.mark.skipif(shutil.which("avr-gcc") is None, reason="avr-gcc is not installed")


@needs_avr_gcc
def test_this_compiler_and_the_judges_agree() -> None:
    outcomes = compare(range(100_052, 100_076))
    assert [(each.text, each.message) for each in outcomes if each.bad] == []
    assert Counter(each.kind for each in outcomes)["same"] >= 20


def test_the_tokens_agree_without_avr_gcc() -> None:
    outcomes = compare(range(200_003, 200_083, 4))
    assert [(each.text, each.message) for each in outcomes if each.bad] == []
    assert Counter(each.kind for each in outcomes)["same"] >= 18


def probed(file: str, *values: str) -> Program:
    return Program(1, "xc8", "speed", [Probe("planted", file, "", list(values))])


@needs_avr_gcc
@pytest.mark.parametrize(
    ("file", "value", "difference"),
    [
        # strings joined before their escapes end
        ('static const char s[] = «"25\\xDFC"|"25\\xDF" "C"»;', "sizeof s", "right 5, chip 4"),
        # bits of a field that was given twice
        (
            "struct s { unsigned a : 4; }; static const struct s s = { «.a = 31 & 15|.a = 4» };",
            "s.a",
            "right 4, chip 15",
        ),
        ("", "sizeof «32768L|0x8000»", "right 2, chip 4"),
    ],
)
def test_a_planted_fault_is_seen_and_named(file: str, value: str, difference: str) -> None:
    planted = probed(file, "1", value)
    outcome = values_compared(planted, bytes_of([planted])[1])
    assert (outcome.kind, outcome.message) == ("wrong", f"planted: {value}: {difference}")


def test_a_planted_fault_in_a_macro_is_seen() -> None:
    given, planted = (Text(["#define M a ## b", line]) for line in ("M", "a ## b"))
    assert tokens_compared(1, given, tokens_of({1: given})[1]).kind == "same"
    assert tokens_compared(1, given, tokens_of({1: planted})[1]).kind == "wrong"


def test_a_refusal_has_its_code_and_what_no_judge_accepts_is_not_judged() -> None:
    assert values_compared(probed("", "'ab'"), (98,)).code == "c-number"
    broken = probed("static int x = ;", "1")
    assert bytes_of([broken]) == {}
    assert values_compared(broken, None).kind == "not judged"


def test_a_seed_determines_its_program() -> None:
    assert program(5).chip() == program(5).chip() != program(6).chip()
