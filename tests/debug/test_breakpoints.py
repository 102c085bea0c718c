"""What stops a run: lines, edges and conditions, and the texts that describe them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.debug.breakpoints import AtAddress, AtCondition, AtEdge, parse_breakpoint, run_to
from servogen.debug.symbols import Variable
from servogen.debug.time_machine import TimeMachine
from servogen.edges import HIGH, PINS, EdgeChunk, join
from servogen.errors import InputError
from servogen.pic.device import device
from servogen.units import Clock
from tests.simulator.helpers import image

C = """\
#pragma CLOCK_FREQ 4000000
char n;
void main(void)
{
    set_bit(STATUS, RP0);
    TRISB = 0;
    clear_bit(STATUS, RP0);
    n = 0;
    while (1) {
        PORTB = n;
        n = n + 1;
        delay_us(100);
    }
}
"""
DONE = compile_sources([Source(C, "count.c")], Options(dialect="c2c", device=device("PIC16F84")))


def machine() -> TimeMachine:
    return TimeMachine(DONE.image, Clock(4_000_000), listing=DONE.listing)


def n_of(chip: TimeMachine) -> int:
    return chip.machine.ram[DONE.listing.variable("n") - 0x0C]


def run(chip: TimeMachine, *texts: str) -> str | None:
    found = run_to(chip, 200_000, [parse_breakpoint(text, DONE.listing) for text in texts], DONE.image)
    return found[0].text if found else None


def test_a_line_stops_before_its_first_instruction_each_time() -> None:
    chip = machine()
    for turn in range(4):
        assert run(chip, "line 11") == "line 11"
        assert n_of(chip) == turn
    assert run(chip, "count.c:12") == "count.c:12"
    assert n_of(chip) == 4


def test_a_change_stops_behind_each_instruction_that_makes_one_and_no_other() -> None:
    chip = machine()
    for turn in range(1, 4):
        assert run(chip, "n changes") == "n changes"
        assert n_of(chip) == turn, "the n = 0 of a byte that is 0 is no change"
        assert run(chip, "RB0 changes") == "RB0 changes"


def test_all_that_stop_at_one_moment_are_told() -> None:
    """PORTB = n makes n's edges in one instruction; n = n + 1 changes n and makes a comparison true."""
    for texts in (
        ("n changes", "n == 3"),
        ("RB0 fall", "RB1 rise"),
        ("RB2 rise", "RB1 fall", "RB0 fall"),
        ("n == 1", "line 12"),
    ):
        chip, every = machine(), [parse_breakpoint(text, DONE.listing) for text in texts]
        while (found := run_to(chip, 200_000, every, DONE.image)) != every:
            assert found, texts


def test_an_edge_stops_behind_the_instruction_that_makes_it() -> None:
    chip = machine()
    assert run(chip, "RB1 rise") == "RB1 rise"
    assert n_of(chip) == 2
    assert chip.machine.levels[PINS.index("RB1")] == HIGH
    assert run(chip, "rb1 fall", "RB7") == "rb1 fall"
    assert n_of(chip) == 4


def test_a_condition_stops_when_it_comes_true_and_not_while_it_stays_so() -> None:
    chip = machine()
    assert run(chip, "n > 16") == "n > 16"
    assert n_of(chip) == 17
    before = chip.now
    assert run(chip, "n > 16") == "n > 16"  # n is a byte: after 255 comes 0, and 17 again
    assert n_of(chip) == 17 and chip.now - before > 256 * 100
    assert run(chip, "n == 0x20", "n == 19") == "n == 19"


def test_the_first_of_several_stops_it() -> None:
    chip = machine()
    assert run(chip, "n == 7", "RB2 rise", "line 12") == "line 12"
    assert run(chip, "n == 7", "RB2 rise") == "RB2 rise"
    assert run(chip, "n == 7", "RB2 rise") == "n == 7"


def test_a_condition_comes_true_by_the_second_of_two_writes_in_a_row() -> None:
    """The low byte is written first: 0x0105 is there after the fourth instruction, in cycle 4."""
    made = image(" movlw 5\n movwf 0x20\n movlw 1\n movwf 0x21\n movwf 0x20\n movwf 0x21\nend_ goto end_\n")
    for value, cycle in ((0x0105, 4), (0x0101, 5)):
        chip = TimeMachine(made, Clock(4_000_000))
        condition = AtCondition("word", Variable(0x20, 2), "==", value)
        assert run_to(chip, 100, [condition], made) == [condition]
        assert chip.now == cycle


def test_an_edge_that_a_write_through_fsr_makes_is_kept_and_stops_too() -> None:
    """The write through FSR is watched, because it may reach the condition's byte."""
    text = (
        " bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\n movlw 6\n movwf FSR\n movwf INDF\nend_ goto end_\n"
    )
    made = image(text)
    condition = AtCondition("never", Variable(0x20, 1), "==", 1)
    for stops, kept in (([condition], 2), ([condition, AtEdge("RB2", PINS.index("RB2"), HIGH)], 2)):
        chip = TimeMachine(made, Clock(4_000_000))
        edges: list[EdgeChunk] = []
        found = run_to(chip, 100, stops, made, edges)
        assert found == stops[1:]
        assert [tuple(row) for row in zip(*join(edges), strict=True)][-kept:] == [(5, 6, 1), (5, 7, 1)]


def test_a_run_without_a_hit_ends_where_it_should() -> None:
    chip = machine()
    assert run(chip, "RA3 rise", "n == 300") is None
    assert chip.now >= 200_000


def test_a_function_stops_before_its_first_instruction() -> None:
    chip = machine()
    assert run(chip, "main()") == "main()"
    start = next(each.start for each in DONE.listing.functions if each.name == "main")
    assert chip.machine.pc == start > 0


def test_texts_are_parsed() -> None:
    assert parse_breakpoint("0x01f", None) == AtAddress("0x01f", frozenset((0x1F,)))
    local = replace(DONE.listing, variables=((0x21, "main.step", 2),))
    wanted = AtCondition("main.step < 3", Variable(0x21, 2), "<", 3)
    assert parse_breakpoint("main.step < 3", local) == wanted
    assert parse_breakpoint(" RB0 ", None) == AtEdge("RB0", PINS.index("RB0"), None)
    assert parse_breakpoint("0x20>=0x10", None) == AtCondition("0x20>=0x10", Variable(0x20, 1), ">=", 16)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is not a breakpoint"), ("width >", "is not a breakpoint"),
        ("__import__('os')", "is not a breakpoint"),
        ("line 99", "no instruction belongs to line 99"),
        ("main.c:11", "no instruction belongs"), ("0x400", "end at 0x3FF"), ("RA7 rise", "no pin 'RA7'"),
        ("mian()", "did you mean 'main'"), ("m == 3", "no variable 'm'"), ("0x05 == 3", "not in RAM"),
    ],
)  # fmt: skip
def test_bad_texts_are_refused(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_breakpoint(text, DONE.listing)
