"""A source that would take for ever to assemble, or fill the memory, is an error at its line."""

import pytest

from servogen.errors import InputError
from servogen.pic.assembler import assemble, state
from servogen.pic.image import MAX_RECORDS, read_hex


def doubling(first: str, each: str) -> str:
    """Forty definitions, each of which uses the one before twice: 2^40 of the first."""
    return first + "".join(each.format(this=number, before=number - 1) for number in range(1, 40))


MACROS = "m{this} macro\n m{before}\n m{before}\n endm\n"


@pytest.mark.parametrize(
    ("source", "says"),
    [
        pytest.param(doubling("m0 macro\n nop\n endm\n", MACROS) + " m39\n end\n", "steps", id="macros",
            marks=pytest.mark.campaign),
        pytest.param(doubling("m0 macro\n endm\n", MACROS) + " m39\n end\n", "steps", id="empty macros"),
        pytest.param(doubling("#define a0 1\n",
            "#define a{this} a{before}+a{before}\n") + "x equ a39\n end\n", "more than 2000 characters",
            id="definitions"),
        pytest.param("".join(f"m{n} macro p\n m{n + 1} p p\n endm\n" for n in range(40)) + " m0 xx\n end\n",
            "more than 2000 characters", id="arguments"),
        pytest.param("".join(f"#define a{n} a{n + 1}\n" for n in range(5000)) + "x equ a0\n end\n",
            "definitions are nested too deeply", id="a chain of definitions"),
        pytest.param(" fill 0, .2000000000\n end\n", "FILL of 2000000000 words", id="fill"),
        pytest.param(" fill (nop), .2000000000\n end\n", "FILL of 2000000000 words", id="fill nop"),
        pytest.param(" res .2000000000\n end\n", "RES of 2000000000 words", id="res"),
        pytest.param(" fill 0, -1\n end\n", "FILL of -1 words", id="a negative count"),
        pytest.param("x equ " + "+".join("1" * 900) + "\n end\n", "more than 200 operators", id="a long sum"),
        pytest.param(" dt " + "1," * 500_000 + "1\n end\n", "more than 2000 characters", id="a long line"),
        pytest.param("; x\n" * 11_000 + " end\n", "steps", id="comments"),
        pytest.param(
            "x set 0\n while x < .1000\nx set x+1\n while 0\n" + ";\n" * 5000 + " endw\n endw\n end\n",
            "steps",
            id="a block that is skipped again and again",
        ),
    ],
)  # fmt: skip
def test_what_grows_without_end_is_an_error(source: str, says: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The 100 000 steps are counted out for one source; for the others that need them 10 000 are enough."""
    if says == "steps" and " nop\n" not in source:
        monkeypatch.setattr(state, "MAX_STEPS", 10_000)
    with pytest.raises(InputError, match=says) as caught:
        assemble(source, "grows.asm")
    assert caught.value.location is not None and caught.value.location.line is not None


def test_a_range_of_bad_ram_of_any_size_takes_no_memory() -> None:
    assemble(" __badram 0x30-0x7FFFFFFF\n __badram .0-.2000000000 - .1\n end\n")


def test_a_program_of_the_whole_chip_stays_within_the_budget() -> None:
    source = "put macro n\n local k\nk set n\n while k > 0\n nop\nk set k - 1\n endw\n endm\n put .1023\n"
    assert assemble(source + " goto 0\n end\n").image.words == 1024


def test_deep_nesting_that_is_allowed_does_not_exhaust_the_stack() -> None:
    calls = "".join(f"m{n} macro\n m{n + 1}\n endm\n" for n in range(97))
    sums = "x set " + "(" * 45 + "1" + ")" * 45 + "+1" * 150
    assemble(f"{calls}m97 macro\n{sums}\n endm\n m0\n end\n")


def test_hex_records_without_number_are_refused() -> None:
    text = ":00000000" + "00\n"
    with pytest.raises(
        InputError, match=rf"b\.hex:{MAX_RECORDS + 1}: error: the file has more than 10000 records"
    ):
        read_hex(text * (MAX_RECORDS + 1) + ":00000001FF\n", "b.hex")
    assert read_hex(text * (MAX_RECORDS - 1) + ":00000001FF\n", "b.hex").image.words == 0
