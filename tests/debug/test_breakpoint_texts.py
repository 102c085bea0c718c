"""Names, texts of breakpoints and sentences about pins."""

from __future__ import annotations

import pytest

from servogen.debug.breakpoints import (
    AtAddress,
    AtCondition,
    AtEdge,
    first_stop,
    parse_breakpoint,
    writing_addresses,
)
from servogen.debug.pins import explain_pin
from servogen.debug.symbols import ListedLine, Variable, current_line, line_at, routine, variable
from servogen.debug.time_machine import TimeMachine
from servogen.edges import HIGH, LOW, PINS, edge_chunk
from servogen.errors import InputError
from servogen.pic.assembler import assemble
from servogen.pic.image import Image
from servogen.pic.listing import ListedFunction, Listing, ListingRow
from tests.simulator.helpers import CLOCK, image


def rows(*lines: tuple[str | None, int | None]) -> Listing:
    """Return a listing of words of these (file, line)."""
    return Listing(
        tuple(ListingRow(at, 0, "NOP", "1", file, line) for at, (file, line) in enumerate(lines)),
        (ListedFunction("go", 2, 3),),
        variables=((0x20, "n", 1), (0x21, "w.x", 2)),
        sources=(("dir/a.c", "first\n  second  \n"),),
        labels=(("again", 1),),
    )


LISTED = rows(
    ("dir/a.c", 1), ("dir/a.c", 2), ("dir/a.c", 1), ("dir/a.c", 1), (None, None), ("b.c", 1), ("a.c", 3)
)


@pytest.mark.parametrize(
    ("text", "addresses"),
    [
        ("line 1", {0, 2, 5}), ("a.c:1", {0, 2}), ("dir/a.c:2", {1}), ("b.c:1", {5}), ("line  3", {6}),
        ("a.c:3", {6}), ("0x0", {0}), ("0x3FF", {0x3FF}), ("0X1f", {0x1F}), ("go()", {2}), ("again ( )", {1}),
    ],
)  # fmt: skip
def test_addresses_of_lines_and_names(text: str, addresses: set[int]) -> None:
    assert parse_breakpoint(f" {text} ", LISTED) == AtAddress(text, frozenset(addresses))


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("ra0", AtEdge("ra0", 0, None)), ("RB7 FALL", AtEdge("RB7 FALL", 12, LOW)),
        ("RA4  rise", AtEdge("RA4  rise", 4, HIGH)),
        ("n == 0", AtCondition("n == 0", Variable(0x20, 1), "==", 0)),
        ("w.x!=0x1F", AtCondition("w.x!=0x1F", Variable(0x21, 2), "!=", 31)),
        ("0x4F <= 999999999", AtCondition("0x4F <= 999999999", Variable(0x4F, 1), "<=", 999_999_999)),
    ],
)  # fmt: skip
def test_edges_and_conditions(text: str, wanted: AtEdge | AtCondition) -> None:
    assert parse_breakpoint(text, LISTED) == wanted


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        ("0x400", "out-of-range", "0x400: the program's addresses end at 0x3FF"),
        ("0x12345", "bad-breakpoint", "'0x12345' is not a breakpoint"),
        ("line 9", "bad-breakpoint", "no instruction belongs to line 9"),
        ("c.c:1", "bad-breakpoint", "no instruction belongs to c.c:1"),
        ("RB8", "unknown-pin", "there is no pin 'RB8'"),
        ("ra5 rise", "unknown-pin", "there is no pin 'RA5'"),
        ("RB0 up", "bad-breakpoint", "'RB0 up' is not a breakpoint"),
        ("n = 3", "bad-breakpoint", "'n = 3' is not a breakpoint"),
        ("n == -1", "bad-breakpoint", "'n == -1' is not a breakpoint"),
        ("m == 1", "unknown-name", "there is no variable 'm'"),
        ("on()", "unknown-name", "there is no function or label 'on'"),
        ("0x0B == 1", "out-of-range", "0x0B is not in RAM, 0x0C to 0x4F"),
    ],
)
def test_what_no_text_of_a_breakpoint_may_be(text: str, code: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_breakpoint(text, LISTED)
    assert (caught.value.code, caught.value.message) == (code, message)


def test_names_are_variables_bytes_functions_and_labels() -> None:
    assert variable("0x0C", None) == Variable(0x0C, 1)
    assert variable("0X4f", LISTED) == Variable(0x4F, 1)
    for text in ("0x0B", "0x50"):
        with pytest.raises(InputError, match="is not in RAM, 0x0C to 0x4F"):
            variable(text, LISTED)
    assert variable("w.x", LISTED) == Variable(0x21, 2)
    assert (routine("go", LISTED), routine("again", LISTED)) == (2, 1)
    with pytest.raises(InputError) as caught:
        variable("n", None)
    assert caught.value.hint == "this program has no names: 0x20"
    with pytest.raises(InputError) as caught:
        routine("n", None)
    assert caught.value.hint == "this program has no names: 0x01F"


def test_a_number_is_its_bytes_the_lowest_first() -> None:
    ram = bytes(range(68))
    assert Variable(0x0C, 1).number(ram) == 0
    assert Variable(0x0D, 2).number(ram) == 0x0201
    assert Variable(0x4E, 2).number(ram) == 0x4342
    assert Variable(0x0C, 1).number(b"\xff" * 68, signed=True) == -1


class OfRam:
    """The RAM of a machine that is not there."""

    def __init__(self, value: int) -> None:
        self.machine = self
        self.ram = bytes([value] * 68)


@pytest.mark.parametrize(
    ("comparison", "holds"),
    [
        ("==", (0, 1, 0)), ("!=", (1, 0, 1)), ("<=", (1, 1, 0)), (">=", (0, 1, 1)), ("<", (1, 0, 0)),
        (">", (0, 0, 1)),
    ],
)  # fmt: skip
def test_comparisons_below_at_and_above_the_value(comparison: str, holds: tuple[int, ...]) -> None:
    condition = parse_breakpoint(f"0x20 {comparison} 5", None)
    assert isinstance(condition, AtCondition)
    assert tuple(condition.holds(OfRam(value)) for value in (4, 5, 6)) == holds  # type: ignore[arg-type]


def test_thewriters_of_of_a_condition_write_its_bytes_or_through_fsr() -> None:
    source = (
        " movwf 0x20\n movwf 0x21\n movwf 0x22\n incf 0x20, w\n incf 0x21, f\n movf INDF, w\n clrf INDF\n"
        " btfsc 0x20, 0\n bsf 0x20, 0\n goto 0x20\n dw 1\n"
    )
    made = assemble(f' include "p16f84.inc"\n{source} end').image
    two = [AtCondition("", Variable(0x20, 2), "==", 1)]
    assert writing_addresses(two, made) == {0, 1, 4, 6, 8}
    assert writing_addresses([*two, AtCondition("", Variable(0x22, 1), "==", 1)], made) == {0, 1, 2, 4, 6, 8}
    assert writing_addresses([], made) == frozenset()


def test_the_first_edge_of_a_recording_that_is_asked_for() -> None:
    chunk = edge_chunk([5, 7, 7, 9], [5, 5, 6, 5], [1, 0, 1, 1])
    both, rise, fall, other = (
        parse_breakpoint(text, None) for text in ("RB0", "RB1 rise", "RB0 fall", "RA0")
    )
    assert first_stop([rise, both], chunk) == (5, both)
    assert first_stop([rise, fall], chunk) == (7, fall)
    assert first_stop([rise], chunk) == (7, rise)
    assert first_stop([other, parse_breakpoint("0x1", None)], chunk) is None
    assert first_stop([], chunk) is None


def test_a_line_is_named_by_its_file_and_shown_without_its_margins() -> None:
    chip = TimeMachine(Image({}), CLOCK, listing=LISTED)
    lines = [line_at(chip, address) for address in (0, 1, 4, 5, 6, 1024, 1028)]
    assert lines == [
        ListedLine("dir/a.c", 1, "first"), ListedLine("dir/a.c", 2, "second"), None, ListedLine("b.c", 1, ""),
        ListedLine("a.c", 3, ""), ListedLine("dir/a.c", 1, "first"), None,
    ]  # fmt: skip
    assert str(lines[1]) == "a.c:2: second"
    assert str(lines[3]) == "b.c:1"
    beyond = rows(("dir/a.c", 3))
    assert line_at(TimeMachine(Image({}), CLOCK, listing=beyond), 0) == ListedLine("dir/a.c", 3, "")


def test_in_routines_without_lines_the_line_of_the_call_runs() -> None:
    """The call in `deep` returns to word 6, that of line 3 to word 3."""
    program = " nop\n nop\n call sub\nend_ goto end_\nsub nop\n call deep\n return\ndeep nop\n return\n"
    nowhere: tuple[None, None] = (None, None)
    listing = rows(("a.c", 1), ("a.c", 2), ("a.c", 3), ("a.c", 4), *[nowhere] * 5)
    chip = TimeMachine(image(program), CLOCK, listing=listing)
    for cycle, line in ((1, 2), (2, 3), (4, 3), (7, 3), (8, 3), (10, 3), (12, 4)):
        chip.seek(cycle)
        assert current_line(chip) == ListedLine("a.c", line, "")
    assert current_line(TimeMachine(Image({}), CLOCK)) is None


# -- sentences about pins ---------------------------------------------------------------------------------

INPUT = (
    "{0} is an input: bit {1} of TRIS{2} is 1, as it is after every reset. "
    "It reads {3}, and the chip does not drive it."
)
WRITTEN = "The program has written 1 to {0}: the pin shows it once bit {1} of TRIS{2} is 0."
NEVER = "This program never writes TRIS{2}: TRIS{2} = 0 would make the whole port outputs."
OUTPUT = "{0} is an output: bit {1} of TRIS{2} is 0. Its latch holds {3}."
OPEN = "{0} is an open drain: for a 1 it needs a pull-up resistor."
BANK_1 = " bsf STATUS, RP0\n"
BANK_0 = " bcf STATUS, RP0\n"


def explained(program: str, pin: str, cycles: int = 40) -> list[str]:
    chip = TimeMachine(image(f"{program}end_ goto end_\n"), CLOCK)
    chip.seek(cycles)
    return explain_pin(chip, PINS.index(pin))


@pytest.mark.parametrize(
    ("program", "pin", "sentences"),
    [
        ("", "RA0", [INPUT.format("RA0", 0, "A", 0), NEVER.format("", 0, "A")]),
        ("", "RB7", [INPUT.format("RB7", 7, "B", 0), NEVER.format("", 0, "B")]),
        (" bsf PORTB, 7\n", "RB7",
         [INPUT.format("RB7", 7, "B", 0), WRITTEN.format("RB7", 7, "B"), NEVER.format("", 0, "B")]),
        (" tris PORTA\n", "RB0", [INPUT.format("RB0", 0, "B", 0), NEVER.format("", 0, "B")]),
        (" movlw 0xFF\n tris PORTA\n", "RA1", [INPUT.format("RA1", 1, "A", 0)]),
        (f"{BANK_1} bcf TRISA, 2\n{BANK_0} bsf PORTA, 2\n", "RA2", [OUTPUT.format("RA2", 2, "A", 1)]),
        (f"{BANK_1} bcf TRISA, 2\n{BANK_0} bsf PORTA, 2\n", "RA3", [INPUT.format("RA3", 3, "A", 0)]),
        (f"{BANK_1} bcf TRISA, 4\n{BANK_0} bsf PORTA, 4\n", "RA4",
         [OUTPUT.format("RA4", 4, "A", 1), OPEN.format("RA4")]),
        (f"{BANK_1} bcf TRISA, 4\n{BANK_0} bcf PORTA, 4\n", "RA4", [OUTPUT.format("RA4", 4, "A", 0)]),
        (f"{BANK_1} bcf TRISB, 3\n", "RB3", [OUTPUT.format("RB3", 3, "B", 0)]),
    ],
)  # fmt: skip
def test_why_a_pin_has_its_level(program: str, pin: str, sentences: list[str]) -> None:
    assert explained(program, pin) == sentences


def test_mclr_is_no_pin_that_is_explained() -> None:
    chip = TimeMachine(image("end_ goto end_\n"), CLOCK)
    assert explain_pin(chip, len(PINS)) == []
    assert explain_pin(chip, len(PINS) - 1) != []


@pytest.mark.parametrize(
    ("program", "writes"),
    [
        (" movwf STATUS\n clrf TRISB\n", True), (" bsf STATUS, RP0\n clrf TRISB\n", True),
        (" clrf STATUS\n bsf TRISB, 7\n", True), (" bsf STATUS, C\n clrf PORTB\n", False),
        (" btfsc STATUS, RP0\n clrf PORTB\n", False), (" movf STATUS, w\n clrf PORTB\n", False),
        (" incf STATUS, w\n clrf PORTB\n", False), (" bsf PORTA, RP0\n clrf PORTB\n", False),
        (" bsf STATUS, RP0\n clrf TRISA\n", False), (" tris 5\n", False), (" clrf INDF\n", True),
        (" movf INDF, w\n", False), (" bsf STATUS, RP0\n movf TRISB, w\n", False),
    ],
)  # fmt: skip
def test_what_counts_as_writing_a_direction(program: str, writes: bool) -> None:
    """`explain_pin` looks at the whole program, before it has run."""
    machine = TimeMachine(image(f"{program}end_ goto end_\n"), CLOCK)
    assert (NEVER.format("", 0, "B") in explain_pin(machine, PINS.index("RB0"))) != writes


def test_a_snapshot_is_kept_every_20_ms() -> None:
    """GOTO to itself takes two cycles, so that 20 000 cycles are reached exactly."""
    chip = TimeMachine(image("end_ goto end_\n"), CLOCK)
    assert chip.snapshots == 1
    for milliseconds, kept in ((19, 1), (20, 2), (39, 2), (40, 3), (400, 21)):
        chip.seek(milliseconds * 1000)
        assert chip.snapshots == kept
    chip.seek(0)
    assert (chip.now, chip.reach, chip.snapshots) == (0, 400_000, 21)
    chip.seek(400_000)
    assert chip.snapshots == 21, "none is kept twice"
