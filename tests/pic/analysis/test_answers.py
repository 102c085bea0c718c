"""The words and numbers of every answer, and response times with interrupts against the equation itself."""

from __future__ import annotations

from typing import Any

import pytest

from servogen.errors import InputError
from servogen.pic.analysis import values
from servogen.pic.analysis.facts import EVERYTHING, Answer, Facts, Finding, Status, decided_and_fine
from servogen.pic.analysis.paths import Paths, PinWrite, in_memory, pin_text, place_text
from servogen.pic.analysis.state import (
    BANK,
    DIGIT,
    INTCON,
    LATCHES,
    OPTION,
    PCLATH,
    TMR0,
    TRISA,
    TRISB,
)  # fmt: skip
from servogen.pic.analysis.times import CycleSpan, ProgramTimes, in_words
from servogen.pic.analysis.values import Value
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.pic.known_values import CARRY, FSR, PCL, ZERO, W
from servogen.pic.wcet import Unbounded
from servogen.units import Clock
from tests.pic.analysis.programs import CLOCK, INTERRUPT, facts
from tests.pic.analysis.test_facts import SET_UP, nested_calls, watched


def said(answer: Answer) -> tuple[str, str, list[str]]:
    """Return the status, the text and the findings of an answer."""
    return str(answer.status), answer.text, [f"0x{each.address:03X}: {each.text}" for each in answer.findings]


FINE = SET_UP + "main\n bsf PORTB, 0\n goto main\n"


def test_the_answers_about_a_program_without_faults() -> None:
    answers = facts(FINE).answers()
    assert [(each.question, *said(each)) for each in answers] == [
        ("every path is followed", "holds", "6 words on paths from reset", []),
        ("the stack never holds more than 8 return addresses", "holds", "at most 0 of 8 levels", []),
        ("nothing is read that was never written", "holds",
         "whatever is read was written before: RAM, W, FSR, C, DC, Z, TMR0 and the port latches", []),
        ("only outputs are written", "holds",
         "outputs: RB0, RB1, RB2, RB3, RB4, RB5, RB6, RB7; no other pin is set to 1, or changed by itself",
         []),
        ("every word can be reached", "holds", "all 6 words are on a path", []),
        ("the watchdog never times out", "holds", "the configuration word leaves it off", []),
    ]  # fmt: skip
    assert decided_and_fine(answers)
    assert [each.over for each in answers] == [EVERYTHING] * 5 + ["every path"]
    assert answers[1].to_json() == {
        "question": "the stack never holds more than 8 return addresses", "status": "holds",
        "text": "at most 0 of 8 levels", "over": EVERYTHING, "findings": [], "levels": 0,
    }  # fmt: skip
    assert dict(answers[4].numbers) == {"unreachable_words": 0}


def test_a_finding_has_its_address_and_line() -> None:
    assert str(Finding(0x12, None, "x")) == "0x012: x"
    assert str(Finding(0x3FF, "a.asm:7", "x")) == "0x3FF (a.asm:7): x"
    assert Finding(1, "a:2", "x").to_json() == {"address": 1, "source": "a:2", "text": "x"}
    fine = Answer("q", Status.HOLDS, "t")
    assert decided_and_fine([fine, fine])
    assert not decided_and_fine([fine, Answer("q", Status.NOT_DECIDED, "t")])
    assert not decided_and_fine([Answer("q", Status.FOUND, "t"), fine])


def test_the_levels_of_the_stack_in_words() -> None:
    assert said(facts(nested_calls(3)).stack()) == ("holds", "at most 3 of 8 levels", [])
    deep = facts(nested_calls(9)).stack()
    # main's call is at 0, f1's at 2, f2's at 4 ...: the eight before the ninth
    before = ", ".join(f"0x{at:03X}" for at in (0, *range(2, 16, 2)))
    assert said(deep) == (
        "found", "it may",
        [f"0x010: a call pushes a ninth return address; the calls before it are at {before}"],
    )  # fmt: skip
    assert dict(deep.numbers) == {"levels": None}
    assert said(facts("main\n nop\n return").stack())[2] == ["0x001: a return finds the stack empty"]
    enabled = nested_calls(2).replace("main\n", "main\n movlw 0xA0\n movwf INTCON\n", 1)
    assert said(facts(INTERRUPT.format(work="") + enabled).stack())[1] == (
        "at most 3 of 8 levels: 2 when an interrupt comes, 1 by the interrupt"
    )
    called = INTERRUPT.format(work=" call f2") + enabled
    assert (
        said(facts(called).stack())[1]
        == "at most 4 of 8 levels: 2 when an interrupt comes, 2 by the interrupt"
    )
    nested = facts(INTERRUPT.format(work=" bsf INTCON, 7\n nop") + enabled).stack()
    assert nested.status is Status.FOUND
    assert "interrupts are enabled inside the interrupt: they may nest without a bound" in said(nested)[2][-1]


def test_what_is_not_followed_is_stated() -> None:
    jump = facts("main\n movf PORTB, w\n movwf PCL\n nop\nhere\n goto here")
    assert said(jump.followed()) == (
        "not decided", "the other answers hold if what is stated here is true",
        ["0x001: a computed jump: paths were not followed beyond it"],
    )  # fmt: skip
    assert jump.stack().status is Status.NOT_DECIDED
    assert jump.unreachable().status is Status.NOT_DECIDED
    table = facts("main\n movf PORTB, w\n addwf PCL, f\n goto main\n goto main")
    assert said(table.followed())[2] == ["0x001: a jump into the table 0x002 to 0x003: assumed to stay in it"]
    pointer = facts("main\n movf PORTB, w\n movwf FSR\n clrf INDF\n goto main")
    assert said(pointer.followed())[2] == ["0x002: the pointer is unknown: assumed to address a byte of RAM"]
    undefined = Facts(Image({0: 0x0001, 1: 0x2801}, config=0x3FF1), None, CLOCK)
    assert said(undefined.followed())[2] == ["0x000: no data sheet defines this word"]
    beyond = facts("main\n movlw 2\n call t\n goto main\nt\n addwf PCL, f\n retlw 1\n retlw 2\n return")
    assert said(beyond.followed()) == (
        "found", "1 computed jump may go beyond the table",
        ["0x003: the index leads beyond the table of RETLWs after it, to 0x006"],
    )  # fmt: skip


def test_writes_of_inputs_in_words() -> None:
    half = " clrf PORTB\n bsf STATUS, 5\n movlw 0xF0\n movwf PORTB\n bcf STATUS, 5\n"
    never = facts(half + " movlw 0x31\n movwf PORTB\nhere\n goto here")
    assert said(never.outputs()) == (
        "found", "pins that are inputs are written by 1 instruction",
        ["0x006: writes RB4, RB5, never an output"],
    )  # fmt: skip
    early = facts(" bsf PORTA, 4\nhere\n goto here")
    assert said(early.outputs())[2] == ["0x000: writes RA4, never an output"]
    text = (
        SET_UP
        + " bsf STATUS, 5\n btfsc 0x20, 0\n bsf PORTB, 7\n bcf STATUS, 5\n bsf PORTB, 7\nhere\n goto here"
    )
    assert said(facts(text).outputs())[2] == ["0x008: writes RB7, which may be an input then"]
    open_ = (
        " clrf PORTB\n bsf STATUS, 5\n bcf PORTB, 0\n bcf STATUS, 5\n movf PORTA, w\n andlw 3\n movwf PORTB\n"
    )
    assert said(facts(open_ + "here\n goto here").outputs()) == (
        "not decided", "the values that are written are not known well enough",
        ["0x006: may write RB1, which may be inputs then"],
    )  # fmt: skip
    assert said(facts("here\n goto here").outputs())[1] == (
        "outputs: none; no other pin is set to 1, or changed by itself"
    )


def test_unwritten_and_unreachable_words_in_words() -> None:
    found = facts("main\n incf 0x20, f\n movf 0x21, w\nhere\n goto here").unwritten_reads()
    assert said(found) == (
        "found", "2 instructions may use values that were never written",
        ["0x000: reads byte 0x20, not written on every path from reset",
         "0x001: reads byte 0x21, not written on every path from reset"],
    )  # fmt: skip
    named = facts(
        " cblock 0x20\n a\n b:2\n endc\nmain\n incf a, f\n incf b, f\n incf b+1, f\nhere\n goto here"
    )
    assert [text.split(",")[0] for text in said(named.unwritten_reads())[2]] == [
        "0x000: reads a (0x20)", "0x001: reads b[0] (0x21)", "0x002: reads b[1] (0x22)"
    ]  # fmt: skip
    late = facts(" bsf STATUS, 5\n movlw 0xFE\n movwf PORTB\nhere\n goto here").unwritten_reads()
    assert said(late)[2] == ["0x002: makes RB0 outputs before their latches are written"]
    far = facts("main\n goto here\n nop\n nop\nhere\n goto here\n nop").unreachable()
    assert said(far) == (
        "found", "3 of 5 words are never executed",
        ["0x001: 2 words to 0x002 are never executed", "0x004: is never executed"],
    )  # fmt: skip


def test_the_watchdog_in_words() -> None:
    """7 ms without the prescaler; OPTION_REG is 0xFF after a reset: 7 ms then, too, as the program runs."""
    found = watched(
        " bsf STATUS, 5\n movlw 0xC0\n movwf 0x01\n bcf STATUS, 5\nmain\n clrwdt\n goto main"
    ).watchdog()
    assert said(found) == (
        "holds",
        "at most 4 cycles (0.004 ms at 4000000 Hz) between two clearings; the shortest period is 7 ms", [],
    )  # fmt: skip
    assert found.over == f"{EVERYTHING}; chips whose watchdog takes at least 7 ms"
    assert dict(found.numbers) == {"cycles": 4}
    # PSA gives the prescaler to the watchdog: 1:8 is 56 ms; 1:128 after a reset is longer still.
    slow = watched(
        " bsf STATUS, 5\n movlw 0xCB\n movwf 0x01\n bcf STATUS, 5\nmain\n clrwdt\n goto main"
    ).watchdog()
    assert slow.text.endswith("the shortest period is 56 ms")
    waits = watched("main\n clrwdt\nwait\n btfss PORTB, 0\n goto wait\n goto main").watchdog()
    assert said(waits) == (
        "not decided", "loop at 0x001, 0x002",
        ["0x001: the time from here is not bounded", "0x002: the time from here is not bounded"],
    )  # fmt: skip
    assert dict(waits.numbers) == {"cycles": None}
    without = Facts(Image({0: encode("CLRWDT"), 1: encode("GOTO", k=0)}), None, CLOCK).watchdog()
    assert without.over.endswith("; the file has no configuration word: the watchdog is assumed to be on")
    assert without.status is Status.HOLDS
    sleeps = watched("main\n sleep\n goto main").watchdog()
    assert said(sleeps) == (
        "not decided", "sleep at 0x000", ["0x000: the time from here is not bounded"]
    )  # fmt: skip


def test_the_time_between_marks_in_words() -> None:
    found = facts("main\n nop\nwait\n btfss PORTB, 0\n goto wait\ndone\n goto main\n nop")
    answer = found.time("main", "done", interrupts=False)
    assert answer.text == "at least 3 cycles; no upper bound: loop at 0x001, 0x002"
    assert answer.over == (
        f"every path from main to the first done after it, without the time of interrupts; {EVERYTHING}"
    )
    assert found.time("done", "main", interrupts=True).over.startswith(
        "every path from done to the first main after it, interrupts included; "
    )
    assert found.time("done", "main", interrupts=True).text == "2 to 2 cycles"
    never = found.time("0x004", "main", interrupts=False)
    assert (never.status, never.text, never.question) == (
        Status.HOLDS, "0x004 is never reached", "the time from 0x004 to main"
    )  # fmt: skip
    nowhere = found.time("main", "0x004", interrupts=False)
    assert (nowhere.status, dict(nowhere.numbers)) == (
        Status.NOT_DECIDED, {"minimum_cycles": None, "maximum_cycles": None}
    )  # fmt: skip
    lost = facts("main\n btfss PORTB, 0\n goto on\n movf PORTB, w\n movwf PCL\non\n nop\ndone\n goto main")
    conditional = lost.time("on", "done", interrupts=False)
    assert (conditional.status, conditional.text) == (
        Status.NOT_DECIDED, "1 to 1 cycles, if paths beyond 0x003 were not followed"
    )  # fmt: skip


def test_marks_that_are_not_there_are_named() -> None:
    found = facts("main\n nop\nhere\n goto here")
    assert found.mark("0x3FF") == [0x3FF]
    for text, message in (
        ("0x400", "'0x400' is not an address from 0x000 to 0x3FF"),
        ("0xZZ", "'0xZZ' is not an address from 0x000 to 0x3FF"),
        ("99", "line 99 has no words"),
        ("nothere.c:6", "line nothere.c:6 has no words"),
        ("9" * 5000, f"'{'9' * 5000}' is not a label, a line or an address"),
    ):
        with pytest.raises(InputError) as caught:
            found.mark(text)
        assert caught.value.message == message
    twice = facts("m macro\n nop\n endm\nmain\n m\n goto $\n m\n goto main")
    # Four lines stand before the text.
    assert twice.mark("6") == [0, 2], "the line of the macro's body begins twice"


# -- names -------------------------------------------------------------------------------------------------


def test_places_and_pins_have_the_names_of_the_data_sheet() -> None:
    names = {
        W: "W", FSR: "FSR", CARRY: "C", DIGIT: "DC", ZERO: "Z", BANK: "RP0", TMR0: "TMR0", PCL: "PCL",
        PCLATH: "PCLATH", INTCON: "INTCON", OPTION: "OPTION_REG", TRISA: "TRISA", TRISB: "TRISB",
        0x20: "n (0x20)", 0x21: "byte 0x21", LATCHES: "the latch of RA0", LATCHES + 5: "the latch of RB0",
    }  # fmt: skip
    assert {place: place_text(place, {0x20: "n"}) for place in names} == names
    assert [pin_text(pin) for pin in range(13)] == [
        "RA0", "RA1", "RA2", "RA3", "RA4", "RB0", "RB1", "RB2", "RB3", "RB4", "RB5", "RB6", "RB7"
    ]  # fmt: skip
    assert PinWrite(1, 2).certain


def test_jumps_lead_into_the_1024_words_and_other_words_stay() -> None:
    assert in_memory(encode("GOTO", k=0x405)) == encode("GOTO", k=5)
    assert in_memory(encode("CALL", k=0x7FF)) == encode("CALL", k=0x3FF)
    for word in (encode("GOTO", k=0x3FF), encode("MOVLW", k=255), encode("MOVF", f=1, d=1), 0x0001, 0x3FFF):
        assert in_memory(word) == word


# -- response times: R is the least solution of R = C + (R // T + 2) * I


def interrupted(
    work: int, *, options: Value, writes: Value | None = None, sources: int = 0x20, **more: Any
) -> ProgramTimes:
    """Return the times of a program whose interrupt has `work` NOPs."""
    words = {0: encode("NOP"), 1: encode("GOTO", k=0), 4: encode("BCF", f=0x0B, b=2)}
    words |= {5 + at: encode("NOP") for at in range(work)} | {5 + work: encode("RETFIE")}
    paths = Paths(
        executed=set(words), interrupts=True, interrupt_sources=sources, timer_options=options,
        timer_writes={} if writes is None else {0: writes}, timer_interrupted={0}, **more,
    )  # fmt: skip
    return ProgramTimes(words, paths)


@pytest.mark.parametrize(
    ("option", "prescale"),
    [(0x08, 1), (0x0F, 1), (0x00, 2), (0x01, 4), (0x02, 8), (0x05, 64), (0x07, 256), (0xD7, 256)],
)
@pytest.mark.parametrize("first", [None, 0, 100, 255])
def test_tmr0_overflows_after_the_counts_that_are_left_times_the_prescaler(
    option: int, prescale: int, first: int | None
) -> None:
    """DS35007 register 2-2: PSA, bit 3, takes the prescaler away; else it is 2, 4 ... 256."""
    written = None if first is None else values.of({0, first})
    times = interrupted(1, options=values.constant(option), writes=written)
    assert times.overflow_period() == ((256 - (first or 0)) * prescale, "")


def test_the_fastest_of_several_clocks_of_tmr0_counts() -> None:
    assert interrupted(1, options=values.of({0x02, 0x01})).overflow_period() == (1024, "")
    assert interrupted(1, options=values.of({0x02, 0x08})).overflow_period() == (256, "")
    pulses = (None, "TMR0 counts pulses of RA4")
    assert interrupted(1, options=values.of({0x02, 0x22})).overflow_period() == pulses
    unknown = interrupted(1, options=values.constant(0x08), writes=values.ANY).overflow_period()
    assert unknown == (None, "what the program writes to TMR0 is not known")


@pytest.mark.parametrize("work", [0, 3, 20])
@pytest.mark.parametrize("cycles", [1, 100, 255, 256, 601, 5000])
@pytest.mark.parametrize("first", [0, 200])
def test_the_response_time_is_the_least_solution(work: int, cycles: int, first: int) -> None:
    """BCF, the work, RETFIE 2, and a latency of 4 make one interrupt."""
    times = interrupted(work, options=values.constant(0x08), writes=values.of({0, first}))
    one, period = 1 + work + 2 + 4, 256 - first
    least = next(r for r in range(cycles, 100 * cycles + 10_000) if r == cycles + (r // period + 2) * one)
    assert times.with_interrupts(cycles) == (least, "")


def test_what_keeps_a_response_time_from_a_bound() -> None:
    def why(times: ProgramTimes) -> str:
        bound, text = times.with_interrupts(10)
        assert bound is None
        return text

    prescaled = values.constant(0x08)
    for bit, name in ((0x40, "the EEPROM"), (0x10, "RB0/INT"), (0x08, "a change of RB4 to RB7")):
        others = interrupted(1, options=prescaled, sources=0x20 | bit)
        assert why(others) == f"an interrupt by {name} can come at any time"
    every = interrupted(1, options=prescaled, sources=0x78)
    assert (
        why(every) == "an interrupt by the EEPROM or RB0/INT or a change of RB4 to RB7 can come at any time"
    )
    nested = interrupted(1, options=prescaled, nested_interrupts={4})
    assert why(nested) == "the interrupt can be interrupted"
    spoilt = interrupted(1, options=prescaled, not_restored={W})
    assert why(spoilt) == "the interrupt does not restore every register that it changes"
    busy = interrupted(250, options=values.constant(0x08))
    assert why(busy) == "an interrupt of 257 cycles every 256 leaves no time"
    assert interrupted(248, options=values.constant(0x08)).with_interrupts(1)[0] is not None


def test_an_interrupt_that_may_stay_where_it_is_has_no_response_time() -> None:
    words = {0: encode("NOP"), 1: encode("GOTO", k=0), 4: encode("BCF", f=0x0B, b=2)}
    words |= {5: encode("BTFSC", f=6, b=0), 6: encode("GOTO", k=6), 7: encode("RETFIE")}
    paths = Paths(
        executed=set(words), interrupts=True, interrupt_sources=0x20, timer_options=values.constant(0x08),
        timer_writes={},
    )  # fmt: skip
    bound, why = ProgramTimes(words, paths).with_interrupts(10)
    assert (bound, why) == (None, "the interrupt: loop at 0x006")
    always = words | {5: encode("NOP")}
    assert ProgramTimes(always, paths).with_interrupts(10) == (None, "the interrupt: loop at 0x006")
    words[6] = encode("NOP")
    assert ProgramTimes(words, paths).with_interrupts(10)[0] is not None


def clears(*words: int) -> bool:
    numbered = dict(enumerate(words, 4))
    return ProgramTimes(numbered, Paths(executed=set(numbered), interrupts=True)).clears_its_flag()


def test_every_path_of_the_interrupt_has_to_clear_its_flag() -> None:
    clear, back, skip = encode("BCF", f=0x0B, b=2), encode("RETFIE"), encode("BTFSS", f=6, b=0)
    assert clears(clear, back)
    assert not clears(back)
    assert not clears(encode("BCF", f=0x0B, b=1), back)
    assert not clears(encode("BCF", f=0x0C, b=2), back)
    assert not clears(encode("BSF", f=0x0B, b=2), back)
    assert not clears(skip, clear, back), "skipped"
    assert clears(skip, encode("NOP"), clear, back)
    assert clears(skip, encode("GOTO", k=7), clear, clear, back)
    assert not clears(skip, encode("GOTO", k=7), clear, back)
    assert clears(encode("CALL", k=6), back, clear, back)


def test_a_path_that_finds_the_flag_clear_need_not_clear_it() -> None:
    clear, back, nop = encode("BCF", f=0x0B, b=2), encode("RETFIE"), encode("NOP")
    if_set, if_clear = encode("BTFSS", f=0x0B, b=2), encode("BTFSC", f=0x0B, b=2)
    assert clears(if_set, back, clear, back)
    assert not clears(if_set, clear, back), "the flag is set where the skip leads"
    assert clears(if_clear, clear, back)
    assert not clears(if_clear, back, clear, back)
    assert not clears(encode("BTFSS", f=0x0B, b=1), back, clear, back)
    assert clears(if_clear, encode("GOTO", k=8), nop, back, clear, back)
    assert not clears(0x0001, clear, back), "a word that no data sheet defines"


def test_the_longest_and_the_shortest_of_several_beginnings_count() -> None:
    words = {0: encode("NOP"), 1: encode("NOP"), 2: encode("NOP"), 3: encode("GOTO", k=0)}
    times = ProgramTimes(words, Paths(executed=set(words)))
    assert times.between([0, 1], [3], interrupts=False) == CycleSpan(2, 3)
    assert times.between([1, 0], [3], interrupts=True) == CycleSpan(2, 3)
    assert times.between([], [3], interrupts=False) == CycleSpan(None, 0)
    assert times.between([0], [9], interrupts=False).reasons[0].startswith(("loop", "no path"))
    assert times.without_ends([0], [9], interrupts=False).maximum is None


@pytest.mark.parametrize(
    ("kind", "count", "text"),
    [
        ("loop", 1, "loop at 0x010"), ("loop", 4, "loop at 0x010, 0x011, 0x012, 0x013"),
        ("loop", 5, "loop at 0x010, 0x011, 0x012, 0x013, …"),
        ("call", 1, "call of a subroutine without a bound at 0x010"),
        ("computed jump", 1, "computed jump at 0x010"), ("sleep", 1, "sleep at 0x010"),
        ("too many states", 1, "too many states at 0x010"),
    ],
)  # fmt: skip
def test_what_has_no_bound_is_named_by_up_to_four_words(kind: str, count: int, text: str) -> None:
    assert in_words(Unbounded(kind, tuple(range(0x10, 0x10 + count)))) == text


def test_a_clock_gives_the_milliseconds() -> None:
    half = Facts(Image({0: encode("CLRWDT"), 1: encode("GOTO", k=0)}), None, Clock(8_000_000)).watchdog()
    assert "at most 3 cycles (0.0015 ms at 8000000 Hz)" in half.text
