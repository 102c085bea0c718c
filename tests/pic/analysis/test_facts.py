"""Questions about a program by itself, on small programs whose answers were worked out by hand."""

import random

import pytest

from servogen.errors import InputError
from servogen.pic.analysis.facts import Answer, Facts, Status
from servogen.pic.analysis.paths import PathExplorer
from servogen.pic.assembler import assemble
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.simulator import Machine, trace
from servogen.units import Cycles
from tests.campaigns import sampled
from tests.pic.analysis.programs import CLOCK, INTERRUPT, assembled, facts

SET_UP = " clrf PORTB\n bsf STATUS, 5\n clrf PORTB\n bcf STATUS, 5\n"
"""Makes RB0 to RB7 outputs, low."""


def nested_calls(levels: int) -> str:
    calls = "".join(f"f{level}\n call f{level + 1}\n return\n" for level in range(1, levels))
    return f"main\n call f1\n goto main\n{calls}f{levels}\n return\n"


def addresses(answer: Answer) -> list[int]:
    return [finding.address for finding in answer.findings]


def test_eight_calls_one_in_the_other_fill_the_stack_and_a_ninth_overflows_it() -> None:
    eight, nine = facts(nested_calls(8)).stack(), facts(nested_calls(9)).stack()
    assert (eight.status, dict(eight.numbers)["levels"]) == (Status.HOLDS, 8)
    assert nine.status is Status.FOUND
    # main's call and goto, then a call and a return for each of f1 to f7: f8's call is at 2 + 2 * 7
    assert addresses(nine) == [2 + 2 * 7]


@pytest.mark.parametrize(("levels", "status"), [(7, Status.HOLDS), (8, Status.FOUND)])
def test_an_interrupt_needs_a_level_wherever_it_may_come(levels: int, status: Status) -> None:
    enabled = nested_calls(levels).replace("main\n", "main\n movlw 0xA0\n movwf INTCON\n", 1)
    answer = facts(INTERRUPT.format(work="") + enabled).stack()
    assert (answer.status, dict(answer.numbers)["levels"]) == (status, levels + 1)


def test_calls_of_the_interrupt_count_on_top_of_those_that_it_interrupts() -> None:
    main = (
        "main\n movlw 0xA0\n movwf INTCON\nagain\n call f1\n goto again\nf1\n return\nf2\n call f1\n return"
    )
    answer = facts(INTERRUPT.format(work=" call f2") + main).stack()
    assert dict(answer.numbers)["levels"] == 1 + 1 + 2


def test_where_the_interrupt_is_masked_its_levels_do_not_count() -> None:
    main = (
        "main\n movlw 0xA0\n movwf INTCON\nagain\n clrf INTCON\nwait\n btfsc INTCON, 7\n goto again\n"
        " call f1\n movlw 0xA0\n movwf INTCON\n goto again\n"
    )
    deep = nested_calls(8).split("goto main\n")[1]
    answer = facts(INTERRUPT.format(work="") + main + deep).stack()
    assert (answer.status, dict(answer.numbers)["levels"]) == (Status.HOLDS, 8)


def test_clearing_gie_once_may_fail_as_the_data_sheets_of_the_family_warn() -> None:
    """An interrupt during BCF INTCON, GIE sets it again when it returns: the calls may be interrupted."""
    main = "main\n movlw 0xA0\n movwf INTCON\n bcf INTCON, 7\n call f1\nend1\n goto end1\n"
    deep = nested_calls(8).split("goto main\n")[1]
    assert facts(INTERRUPT.format(work="") + main + deep).stack().status is Status.FOUND


def test_recursion_and_a_return_without_a_call_are_found() -> None:
    assert (
        facts("main\n call f\n goto main\nf\n btfss PORTB, 0\n call f\n return").stack().status
        is Status.FOUND
    )
    lone = facts("main\n nop\n return").stack()
    assert (lone.status, addresses(lone)) == (Status.FOUND, [1])


def test_a_call_through_a_computed_jump_is_followed_to_its_targets() -> None:
    text = (
        "main\n movf PORTB, w\n andlw 1\n call table\n goto main\n"
        "table\n addwf PCL, f\n goto f0\n goto f1\nf0\n return\nf1\n call f2\n return\nf2\n call f0\n return"
    )
    answer = facts(text).stack()
    assert (answer.status, dict(answer.numbers)["levels"]) == (Status.HOLDS, 3)


def test_a_jump_through_an_unknown_byte_into_no_table_leaves_the_answers_open() -> None:
    found = facts("main\n movf PORTB, w\n movwf PCL\n nop\nhere\n goto here")
    assert found.followed().status is Status.NOT_DECIDED
    assert addresses(found.followed()) == [1]
    assert found.stack().status is Status.NOT_DECIDED


def test_a_jump_into_a_table_beyond_which_the_index_may_lead_is_stated() -> None:
    table = "main\n movf PORTB, w\n{}\n call table\n goto main\ntable\n addwf PCL, f\n retlw 1\n retlw 2"
    bounded, free = facts(table.format(" andlw 1")), facts(table.format(" andlw 3"))
    assert bounded.followed().status is Status.HOLDS
    assert free.followed().status is Status.NOT_DECIDED


SCRIPT = 3 * [3, 0, 4, 1, 2, 2, 0, 4, 3, 1, 0, 0, 2, 4, 1, 3, 3, 2, 0, 1, 4, 4, 2, 0, 3, 1, 0, 2]
"""More bytes than a set of values has members."""


def script_player(end: int, script: list[int]) -> str:
    """Play a script of rows endlessly, from its beginning after byte number `end`; there are five rows."""
    return (
        f"main\n clrf 0x20\nloop\n movlw {end}\n xorwf 0x20, w\n btfsc STATUS, 2\n clrf 0x20\n"
        " movf 0x20, w\n call script\n movwf 0x21\n incf 0x20, f\n"
        " movf 0x21, w\n call rows\n movwf 0x22\n goto loop\n"
        "rows\n addwf PCL, f\n" + " retlw 7\n" * 5 + "script\n addwf PCL, f\n"
        + "".join(f" retlw {each}\n" for each in script)
    )  # fmt: skip


ROWS_AT = 13
"""The address of its first computed jump, counted by hand; the other one is six words later."""


def test_the_index_of_a_table_is_followed_through_a_counter_and_another_table() -> None:
    """The states are more than are kept apart by all of their values, so that counters must be."""
    text = script_player(len(SCRIPT), SCRIPT)
    plain = PathExplorer(assembled(text).image.program).explore()
    assert sorted(plain.tables) == [ROWS_AT + 6]
    answer = facts(text).followed()
    assert (answer.status, answer.findings) == (Status.HOLDS, ())


@pytest.mark.parametrize(
    ("end", "script", "at", "target"),
    [
        (len(SCRIPT) + 1, SCRIPT, ROWS_AT + 6, ROWS_AT + 6 + 1 + len(SCRIPT)),
        (len(SCRIPT), [*SCRIPT[:-1], 5], ROWS_AT, ROWS_AT + 6),
        (len(SCRIPT), [*SCRIPT[:20], 6, *SCRIPT[21:]], ROWS_AT, ROWS_AT + 7),
    ],
)
def test_an_index_that_exceeds_its_table_by_one_is_found_with_its_place(
    end: int, script: list[int], at: int, target: int
) -> None:
    answer = facts(script_player(end, script)).followed()
    assert answer.status is Status.FOUND
    assert at in addresses(answer)
    assert f"to 0x{target:03X}" in next(each.text for each in answer.findings if each.address == at)


BACK = [*SCRIPT[:40], 255, 13, 3, *SCRIPT[40:]]
"""The script with a part that goes back by 13 bytes until it was played three times."""


def player_that_goes_back(script: list[int]) -> str:
    """Play a script in which 255 is followed by a distance to go back by, and by how often."""
    return (
        "main\n clrf 0x20\n clrf 0x21\nloop\n call read\n movwf 0x22\n"
        " xorlw 255\n btfss STATUS, 2\n goto step\n"
        " call read\n movwf 0x23\n call read\n movf 0x21, f\n btfsc STATUS, 2\n movwf 0x21\n"
        " decf 0x21, f\n btfsc STATUS, 2\n goto on\n movf 0x23, w\n subwf 0x20, f\n"
        "on\n call read\n movwf 0x22\nstep\n movf 0x22, w\n call rows\n movwf 0x24\n goto loop\n"
        "rows\n addwf PCL, f\n" + " retlw 7\n" * 5
        + f"read\n movlw {len(script)}\n xorwf 0x20, w\n btfsc STATUS, 2\n clrf 0x20\n incf 0x20, f\n"
        " decf 0x20, w\n addwf PCL, f\n" + "".join(f" retlw {each}\n" for each in script)
    )  # fmt: skip


def test_a_script_that_goes_back_by_a_distance_is_followed() -> None:
    """Its place is a counter from which a byte of the script is subtracted."""
    assert PathExplorer(assembled(player_that_goes_back(BACK)).image.program).explore().tables
    answer = facts(player_that_goes_back(BACK)).followed()
    assert (answer.status, answer.findings) == (Status.HOLDS, ())
    wrong = facts(player_that_goes_back([*BACK[:35], 5, *BACK[36:]])).followed()
    assert wrong.status is Status.FOUND


def test_copies_of_a_byte_that_pins_chose_stay_equal() -> None:
    """One copy is tested, the other is the index: 0 - 1 would lead beyond the table."""
    text = (
        "main\n nop\n nop\n nop\n nop\n movf PORTB, w\n andlw 3\n"
        " movwf 0x20\n movwf 0x21\n movf 0x20, f\n btfsc STATUS, 2\n"
        " goto main\n decf 0x21, w\n call table\n goto main\n"
        "table\n addwf PCL, f\n retlw 1\n retlw 2\n retlw 3\n"
    )
    assert facts(text).followed().status is Status.HOLDS
    changed = text.replace(" movf 0x20, f", " incf 0x21, f\n movf 0x20, f")
    assert facts(changed).followed().status is not Status.HOLDS


def test_a_byte_whose_masked_bits_are_0_is_bounded() -> None:
    text = (
        "main\n movf PORTB, w\n movwf 0x20\n movlw 0xFC\n andwf 0x20, w\n btfss STATUS, 2\n goto main\n"
        " movf 0x20, w\n call table\n goto main\ntable\n addwf PCL, f\n" + " retlw 1\n" * 4
    )
    assert facts(text).followed().status is Status.HOLDS
    assert facts(text.replace("0xFC", "0xF8")).followed().status is Status.NOT_DECIDED


def test_a_byte_written_on_one_of_two_paths_only_is_found_where_it_is_read() -> None:
    text = "main\n btfss PORTB, 0\n goto read\n clrf 0x20\nread\n incf 0x20, f\nhere\n goto here"
    answer = facts(text).unwritten_reads()
    assert (answer.status, addresses(answer)) == (Status.FOUND, [3])
    assert "byte 0x20" in answer.findings[0].text
    assert answer.findings[0].source is not None
    assert facts(text.replace("main\n", "main\n clrf 0x20\n")).unwritten_reads().status is Status.HOLDS


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (" movwf 0x20", "W"), (" rlf PORTB, w", "C"), (" btfsc STATUS, 2\n nop", "Z"),
        (" btfsc STATUS, 1\n nop", "DC"), (" movf TMR0, w", "TMR0"), (" clrf INDF", "FSR"),
        (" movf FSR, w", "FSR"), (" decfsz 0x4F, f\n nop", "byte 0x4F"),
    ],
)  # fmt: skip
def test_what_a_reset_leaves_undefined_is_found_where_it_is_used_first(text: str, place: str) -> None:
    answer = facts(f"main\n{text}\nhere\n goto here").unwritten_reads()
    assert answer.status is Status.FOUND
    assert f"reads {place}," in answer.findings[0].text


def test_a_loop_that_clears_all_68_bytes_through_fsr_writes_every_one_and_67_are_one_too_few() -> None:
    text = (
        "main\n movlw 0x0C\n movwf FSR\nnext\n clrf INDF\n incf FSR, f\n movlw {}\n xorwf FSR, w\n"
        " btfss STATUS, 2\n goto next\n movf 0x4F, w\nhere\n goto here"
    )
    assert facts(text.format(0x50)).unwritten_reads().status is Status.HOLDS
    assert addresses(facts(text.format(0x4F)).unwritten_reads()) == [8]


def test_latches_are_written_before_pins_become_outputs_or_that_is_found() -> None:
    assert facts(SET_UP + "here\n goto here").unwritten_reads().status is Status.HOLDS
    late = facts(SET_UP.replace(" clrf PORTB\n", " nop\n", 1) + "here\n goto here").unwritten_reads()
    assert addresses(late) == [2]
    assert "RB0, RB1, RB2, RB3, RB4, RB5, RB6, RB7" in late.findings[0].text


def test_an_interrupt_that_saves_registers_does_not_use_them() -> None:
    main = "main\n bsf INTCON, 5\n bsf INTCON, 7\nhere\n goto here"
    assert facts(INTERRUPT.format(work="") + main).unwritten_reads().status is Status.HOLDS
    uses = facts(INTERRUPT.format(work=" rlf 0x40, f") + main).unwritten_reads()
    assert "C," in uses.findings[0].text


def test_a_pin_that_is_written_while_it_is_an_input_is_found() -> None:
    half = " clrf PORTB\n bsf STATUS, 5\n movlw 0xF0\n movwf PORTB\n bcf STATUS, 5\n"
    assert facts(f"{half} bsf PORTB, 3\nhere\n goto here").outputs().status is Status.HOLDS
    wrong = facts(f"{half} bsf PORTB, 4\nhere\n goto here").outputs()
    assert (wrong.status, addresses(wrong)) == (Status.FOUND, [5])
    assert "RB4, never an output" in wrong.findings[0].text
    prepared = facts(f" bsf PORTB, 3\n{half} nop\nhere\n goto here").outputs()
    assert prepared.status is Status.HOLDS  # a latch that is written before its pin becomes an output


def test_a_pin_that_becomes_an_input_again_may_be_written_then() -> None:
    text = (
        SET_UP
        + " bsf STATUS, 5\n btfsc 0x20, 0\n bsf PORTB, 7\n bcf STATUS, 5\n bsf PORTB, 7\nhere\n goto here"
    )
    answer = facts(text).outputs()
    assert (answer.status, addresses(answer)) == (Status.FOUND, [8])


def test_a_value_that_is_not_known_leaves_it_open_whether_inputs_are_written() -> None:
    text = " clrf PORTB\n bsf STATUS, 5\n bcf PORTB, 0\n bcf STATUS, 5\n movf PORTA, w\n{} movwf PORTB\n"
    text += "here\n goto here"
    assert facts(text.format("")).outputs().status is Status.NOT_DECIDED
    assert facts(text.format(" andlw 1\n")).outputs().status is Status.HOLDS


def test_words_that_no_path_executes_are_counted() -> None:
    answer = facts("main\n goto here\n nop\n nop\nhere\n goto here").unreachable()
    assert (answer.status, dict(answer.numbers)["unreachable_words"]) == (Status.FOUND, 2)
    assert addresses(answer) == [1]
    known = facts("main\n movlw 3\n movwf 0x20\n btfss 0x20, 1\n goto main\nhere\n goto here").unreachable()
    assert addresses(known) == [3]  # the branch is never taken: bit 1 of 3 is set


BRANCHES = " movlw 3\n movwf 0x20\nstart\n btfss PORTB, 0\n goto far\n nop\n"
BRANCHES += "loop\n decfsz 0x20, f\n goto loop\n goto done\nfar\n nop\n nop\n"
BRANCHES += "done\n nop\n movlw 3\n movwf 0x20\n goto start\n"


def test_the_best_and_the_worst_time_between_two_marks() -> None:
    found = facts(f"main\n{BRANCHES}")
    answer = found.time("start", "done", interrupts=True)
    # RB0 low: the skip is not taken, GOTO, two NOPs. High: 2, NOP, three turns, GOTO. The counter is known to
    # be 3 on the way from main only; from the mark itself it may be anything.
    assert dict(answer.numbers)["minimum_cycles"] == 1 + 2 + 1 + 1
    whole = found.time("main", "done", interrupts=True)
    assert dict(whole.numbers) == {"minimum_cycles": 2 + 5, "maximum_cycles": 2 + 2 + 1 + (3 + 3 + 2) + 2}
    assert whole.status is Status.HOLDS


def test_a_time_with_a_loop_that_waits_for_a_pin_is_not_decided_and_says_where() -> None:
    answer = facts("main\n nop\nwait\n btfss PORTB, 0\n goto wait\ndone\n goto main").time(
        "main", "done", interrupts=False
    )
    assert answer.status is Status.NOT_DECIDED
    assert "loop at 0x001" in answer.text
    assert dict(answer.numbers) == {"minimum_cycles": 3, "maximum_cycles": None}


FILLER = " nop\n" * 5


@pytest.mark.parametrize(
    ("text", "start", "spans"),
    [
        # A called function runs on into the next: CALL 2, NOP 1, five NOPs, RETURN 2.
        (f"main\n call f\ndone\n call g\n goto main\nf\n nop\ng\n{FILLER} return\n", "main", (10, 10)),
        # A computed jump is the last word before a function, and leads to no RETLW.
        ("main\n call f\ndone\n call g\n goto main\nf\n clrf PCLATH\n movlw far\n movwf PCL\ng\n return\n"
            f"far\n{FILLER} return\n", "main", (2 + 2 + 2 + 5 + 2, 2 + 2 + 2 + 5 + 2)),
        # BCF INDF, 0 clears the carry: 0x03 is STATUS.
        ("main\n bsf STATUS, 0\n movlw 3\n movwf FSR\n btfsc PORTB, 0\n bcf INDF, 0\n"
            f" btfsc STATUS, 0\n goto done\n{FILLER}done\n goto main\n", "main", (3 + 2 + 1 + 2,
            3 + 1 + 1 + 2 + 5)),
        # The end is inside of a loop that counts.
        ("main\n movlw 10\n movwf 0x20\nloop\n decfsz 0x20, f\ndone\n goto loop\n goto done\n", "main", (3,
            3)),
        # ADDWF with PCL clears Z: after the RETLW, BTFSS 1, GOTO 2, five NOPs and GOTO 2; or 2 if it skips.
        ("main\n clrf PCLATH\n call f\n btfss STATUS, 2\n goto more\ndone\n call g\n goto main\n"
            f"more\n{FILLER} goto done\nf\n movf PORTB, w\n andlw 1\n bsf STATUS, 2\n addwf PCL, f\n"
            " retlw 1\n retlw 2\ng\n return\n", "f", (3 + 4 + 2, 3 + 4 + 1 + 2 + 5 + 2)),
    ],
)  # fmt: skip
def test_times_that_what_is_known_before_would_make_too_short(
    text: str, start: str, spans: tuple[int, int]
) -> None:
    answer = facts(text).time(start, "done", interrupts=True)
    assert answer.status is Status.HOLDS
    assert answer.text == f"{spans[0]} to {spans[1]} cycles"


DELAY = " movlw 200\n movwf 0x20\nloop\n decfsz 0x20, f\n goto loop\ndone\n goto main\n"
"""From main to done: 2 + 199 * 3 + 2 cycles."""


def test_interrupts_of_tmr0_are_added_as_often_as_they_can_come() -> None:
    enable = (
        " clrf TMR0\n bsf STATUS, 5\n movlw 0x88\n movwf 0x01\n bcf STATUS, 5\n movlw 0xA0\n movwf INTCON\n"
    )
    text = f"{INTERRUPT.format(work=' nop')}main\n{enable}begin\n{DELAY}".replace(
        "goto main", "goto begin", 2
    )
    text = text.replace("    goto begin\n    org", "    goto main\n    org", 1)
    found = facts(text)
    alone = found.time("begin", "done", interrupts=False)
    assert dict(alone.numbers)["maximum_cycles"] == 2 + 199 * 3 + 2
    one = 10 + 2 + 4  # ten instructions, RETFIE, and the latency
    # R = 601 + (R // 256 + 2) * 16: 601 + 4 * 16 = 665, and 665 // 256 is 2
    assert dict(found.time("begin", "done", interrupts=True).numbers)["maximum_cycles"] == 601 + 4 * one


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (("0xA0", "0x90"), "RB0/INT can come at any time"),
        (("bcf INTCON, 2", "nop"), "without clearing T0IF"),
        (("swapf 0x41, w", "nop"), "does not restore"),
        (("bcf INTCON, 2",
            "movf PORTB, w\n andlw 1\n addwf PCL, f\n goto $ + 2\n goto $ + 2\n bcf INTCON, 2"),
            "without clearing T0IF"),
        (("begin\n", "begin\n bsf INTCON, 2\n"), "may set T0IF itself"),
        (("movlw 0xA0", "movlw 0xA4"), "may set T0IF itself"),
        (("movlw 0x88", "movlw 0x28"), "counts pulses of RA4"),
        # Enabled before TMR0 has its clock: until then it counts at whatever rate RA4 has.
        (("bsf STATUS, 5\n movlw 0x88", "movlw 0xA0\n movwf INTCON\n bsf STATUS, 5\n movlw 0x88"),
            "counts pulses of RA4"),
        (("begin\n", "begin\n movf PORTA, w\n movwf TMR0\n"), "writes to TMR0 is not known"),
        (("begin\n", "begin\n movlw 250\n movwf TMR0\n"), "leaves no time"),
    ],
)  # fmt: skip
def test_interrupts_that_are_not_bounded_leave_the_time_open(change: tuple[str, str], why: str) -> None:
    enable = (
        " clrf TMR0\n bsf STATUS, 5\n movlw 0x88\n movwf 0x01\n bcf STATUS, 5\n movlw 0xA0\n movwf INTCON\n"
    )
    delay = DELAY.replace("main", "begin")
    text = f"{INTERRUPT.format(work=' nop')}main\n movf PORTA, w\n{enable}begin\n{delay}"
    answer = facts(text.replace(*change, 1)).time("begin", "done", interrupts=True)
    assert answer.status is Status.NOT_DECIDED
    assert why in answer.text


SELECT = " bsf STATUS, 5\n movlw 0x{:02X}\n movwf OPTION_REG\n bcf STATUS, 5\n"
TIMED = SELECT.format(7) + " clrf 0x40\n clrf 0x41\n movlw 0xA0\n movwf INTCON\n"
"""TMR0 with 1:256, so that it overflows every 65536 cycles; 0x08 lets it count every cycle."""


def completed(text: str, start: str, end: str, cycles: int) -> tuple[int, bool]:
    """Return the longest time between two labels in a run of the plain simulator, and whether its last one
    ended.
    """
    made = assembled(text)
    labels = dict(made.labels)
    begun, longest = None, 0
    for row in trace(Machine(made.image, CLOCK), Cycles(cycles)):
        if row.pc == labels[start]:
            begun = row.cycle
        elif row.pc == labels[end] and begun is not None:
            longest, begun = max(longest, row.cycle - begun), None
    return longest, begun is None


@pytest.mark.campaign
def test_a_clock_of_tmr0_that_only_the_interrupt_selects_counts() -> None:
    """TMR0 overflows inside the interrupt of 300 cycles, which therefore comes again at once, endlessly."""
    work = SELECT.format(8) + " goto $ + 1\n" * 140 + SELECT.format(7)
    text = f"{INTERRUPT.format(work=work)}main\n{TIMED}begin\n{DELAY.replace('main', 'begin')}"
    _, ended = completed(text, "begin", "done", 1_000_000)
    assert not ended
    answer = facts(text).time("begin", "done", interrupts=True)
    assert answer.status is Status.NOT_DECIDED
    assert "leaves no time" in answer.text


def test_a_clock_of_tmr0_that_is_selected_while_its_interrupt_is_masked_counts() -> None:
    """In every turn it overflows within the 601 cycles of the fast clock; the interrupt comes afterwards."""
    wait = " movlw 200\n movwf 0x20\nwait\n decfsz 0x20, f\n goto wait\n"
    masked = f"turn\n bcf INTCON, 5\n{SELECT.format(8)}{wait}{SELECT.format(7)} bsf INTCON, 5\n"
    masked += " decfsz 0x21, f\n goto turn\n"
    begin = f"begin\n movlw 20\n movwf 0x21\n{masked}done\n goto begin\n"
    text = f"{INTERRUPT.format(work='')}main\n{TIMED}{begin}"
    longest, _ = completed(text, "begin", "done", 200_000)
    found = facts(text)
    alone = dict(found.time("begin", "done", interrupts=False).numbers)["maximum_cycles"]
    most = dict(found.time("begin", "done", interrupts=True).numbers)["maximum_cycles"]
    one = 9 + 2 + 4  # nine instructions, RETFIE, and the latency
    assert alone is not None and most is not None
    assert longest > alone + 2 * one, "more interrupts than one clock of 1:256 allows"
    assert longest <= most == alone + (most // 256 + 2) * one


def test_before_tmr0_can_interrupt_its_clock_does_not_count() -> None:
    """Bit by bit from 0xFF after the reset, by way of RA4's pulses and of every cycle, to 1:256."""
    slowly = " bsf STATUS, 5\n bcf OPTION_REG, 5\n bcf OPTION_REG, 3\n bcf STATUS, 5\n"
    enable = TIMED.replace(SELECT.format(7), slowly)
    text = f"{INTERRUPT.format(work=' nop')}main\n{enable}begin\n{DELAY.replace('main', 'begin')}"
    assert dict(facts(text).time("begin", "done", interrupts=True).numbers)["maximum_cycles"] == 601 + 2 * 16


@pytest.mark.parametrize("levels", [7, 8])
def test_where_an_interrupt_overwrites_a_return_address_nothing_more_is_decided(levels: int) -> None:
    """With eight calls in each other the ninth return address is the interrupt's: the first one is lost."""
    enable = TIMED.replace(SELECT.format(7), SELECT.format(8))
    calls = nested_calls(levels).replace("main\n", f"main\n{enable}begin\n", 1)
    calls = calls.replace(" goto main", "done\n goto begin", 1)
    text = INTERRUPT.format(work="") + calls
    _, ended = completed(text, "begin", "done", 100_000)
    found = facts(text)
    statuses = {answer.status for answer in (found.followed(), found.outputs())}
    time = found.time("begin", "done", interrupts=True)
    if levels == 7:
        assert statuses == {Status.HOLDS} and time.status is Status.HOLDS
        return
    assert not ended, "it never gets there again"
    assert statuses == {Status.NOT_DECIDED} and time.status is Status.NOT_DECIDED
    assert "pushes a ninth return address" in str(found.followed().findings[0])


def test_a_mark_that_the_interrupt_may_reach_first_has_no_shortest_time() -> None:
    enable = (
        " bsf STATUS, 5\n movlw 0x88\n movwf 0x01\n bcf STATUS, 5\n clrf TMR0\n movlw 0xA0\n movwf INTCON\n"
    )
    delay = DELAY.replace("done", " call mark").replace("main", "begin")
    text = f"{INTERRUPT.format(work=' call mark')}mark\n return\nmain\n{enable}begin\n{delay}"
    found = facts(text)
    answer = found.time("begin", "mark", interrupts=True)
    assert (answer.status, answer.text) == (Status.NOT_DECIDED, "the interrupt may get there first")
    assert dict(found.time("begin", "mark", interrupts=False).numbers)["minimum_cycles"] == 603
    assert found.time("begin", "begin", interrupts=True).status is Status.HOLDS


WATCHDOG = "main\n clrwdt\n movlw {turns}\n movwf 0x20\n clrf 0x21\nloop\n decfsz 0x21, f\n goto loop\n"
WATCHDOG += " decfsz 0x20, f\n goto loop\n{rest} goto main\n"


def watched(text: str) -> Facts:
    head = '    list p=16f84, r=dec\n    include "p16f84.inc"\n    __config _WDT_ON & _XT_OSC\n    org 0\n'
    made = assemble(f"{head}{text}\n    end\n")
    return Facts(made.image, made.listing, CLOCK)


def test_the_watchdog_is_fed_where_no_path_takes_as_long_as_its_shortest_period() -> None:
    """The postscaler is 1:1: 7 ms are 7000 cycles. One byte's loop takes 255 * 3 + 2 cycles."""
    undivided = " bsf STATUS, 5\n movlw 0xC0\n movwf 0x01\n bcf STATUS, 5\n"
    nine = watched(undivided + WATCHDOG.format(turns=9, rest=" nop\n" * 6)).watchdog()
    between = 1 + 3 + 9 * (255 * 3 + 2) + 8 * 3 + 2 + 2
    assert (nine.status, dict(nine.numbers)["cycles"]) == (Status.HOLDS, between + 6)
    room = 7000 - between
    for more, status in ((room - 1, Status.HOLDS), (room, Status.FOUND)):
        rest = " nop\n" * (more % 2) + " goto $+1\n" * (more // 2)
        answer = watched(undivided + WATCHDOG.format(turns=9, rest=rest)).watchdog()
        assert (answer.status, dict(answer.numbers)["cycles"]) == (status, between + more)


def test_a_loop_without_clrwdt_that_may_last_leaves_the_watchdog_undecided() -> None:
    answer = watched("main\n clrwdt\nwait\n btfss PORTB, 0\n goto wait\n goto main").watchdog()
    assert (answer.status, "loop at 0x001" in answer.text) == (Status.NOT_DECIDED, True)
    stuck = watched("main\n clrwdt\nhere\n goto here").watchdog()
    assert (stuck.status, "loop at 0x001" in stuck.text) == (Status.NOT_DECIDED, True)
    assert watched("main\n clrwdt\n goto main").watchdog().status is Status.HOLDS


def test_marks_are_labels_lines_and_addresses_and_a_wrong_one_is_named() -> None:
    found = facts("main\n nop\nhere\n goto here")
    assert found.mark("here") == found.mark("0x001") == found.mark("8") == [1]
    with pytest.raises(InputError, match="'her' is not a label") as error:
        found.mark("her")
    assert "did you mean 'here'?" in str(error.value)
    with pytest.raises(InputError, match="line 1 has no words"):
        found.mark("1")
    with pytest.raises(InputError, match="0x400"):
        found.mark("0x400")
    with pytest.raises(InputError, match="need C or assembly"):
        Facts(Image({0: 0}), None, CLOCK).mark("here")


def test_a_jump_beyond_the_1024_words_leads_into_them_for_they_repeat() -> None:
    found = Facts(
        Image({0: encode("GOTO", k=0x402), 1: 0x3400, 2: encode("CALL", k=0x404), 3: 0x2803, 4: 8}),
        None,
        CLOCK,
    )
    assert found.paths.executed == {0, 2, 3, 4}
    assert dict(found.time("0x000", "0x003", interrupts=False).numbers)["maximum_cycles"] == 2 + 2 + 2


@pytest.mark.parametrize("seed", sampled(range(12), 4))
def test_any_words_at_all_are_answered(seed: int) -> None:
    rng = random.Random(seed)
    flow = [0x2000, 0x2800, 0x0008, 0x3400, 0x0782, 0x0082, 0x0009]
    words = {
        at: rng.choice([*flow, rng.randrange(1 << 14)]) | rng.randrange(64)
        for at in range(rng.choice([5, 60, 300]))
    }
    found = Facts(Image(words), None, CLOCK)
    assert len(found.answers()) == 6
    assert found.time("0x000", "0x003", interrupts=True).text


@pytest.mark.parametrize("branch", ["btfss", "btfsc"])
def test_a_byte_that_one_path_writes_is_not_written_where_many_paths_are_joined(branch: str) -> None:
    """Forty turns are more states than are kept apart."""
    text = (
        f"main\n clrf 0x20\nloop\n {branch} PORTB, 0\n clrf 0x30\n incf 0x20, f\n movlw 40\n xorwf 0x20, w\n"
        " btfss STATUS, 2\n goto loop\n movf 0x30, w\nhere\n goto here"
    )
    assert addresses(facts(text).unwritten_reads()) == [8]
    assert facts(text.replace("main\n", "main\n clrf 0x30\n")).unwritten_reads().status is Status.HOLDS


def test_a_write_through_a_pointer_to_one_of_two_bytes_writes_neither_for_certain() -> None:
    text = "main\n movf PORTB, w\n andlw {}\n addlw 0x20\n movwf FSR\n clrf INDF\n movf 0x20, w\n"
    text += "here\n goto here"
    assert addresses(facts(text.format(1)).unwritten_reads()) == [5]
    assert facts(text.format(0)).unwritten_reads().status is Status.HOLDS


def test_what_an_interrupt_writes_may_change_between_any_two_instructions() -> None:
    main = "main\n clrf 0x42\n movlw 0xA0\n movwf INTCON\nwait\n btfss 0x42, 0\n goto wait\n goto main\n"
    assert facts(INTERRUPT.format(work=" incf 0x42, f") + main).unreachable().status is Status.HOLDS
    alone = facts(INTERRUPT.format(work=" incf 0x43, f") + main).unreachable()
    assert dict(alone.numbers)["unreachable_words"] == 1


def test_a_pointer_that_only_a_jump_beyond_its_table_leads_to_is_reported() -> None:
    """No index but 30 leads there: the paths that are followed first take the jump to stay in its table."""
    answer = facts(
        "main\n clrf 0x20\nloop\n movf 0x20, w\n call rows\n incf 0x20, f\n movf 0x20, w\n xorlw 40\n"
        " btfss STATUS, 2\n goto loop\n goto main\n"
        "rows\n addwf PCL, f\n" + " retlw 7\n" * 30 + " incf INDF, f\n goto main\n"
    ).followed()
    assert answer.status is Status.FOUND
    texts = [(finding.address, finding.text) for finding in answer.findings]
    assert texts[0] == (0x009, "the index leads beyond the table of RETLWs after it, to 0x028")
    assert (0x028, "the pointer is unknown: assumed to address a byte of RAM") in texts
