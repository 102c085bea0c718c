"""What the paths of small programs do, in every part, worked out by hand; and from what an index is made."""

from __future__ import annotations

from dataclasses import fields

import pytest

from servogen.pic.analysis import values
from servogen.pic.analysis.demand import APART, ExecutionGroup, Graph, SplitPlan
from servogen.pic.analysis.paths import PathExplorer, Paths, PinWrite, explore
from servogen.pic.analysis.state import INTCON, LATCHES, OPTION, TMR0, TRISB, bit, bits
from servogen.pic.isa import encode
from servogen.pic.known_values import CARRY, FSR, ZERO, W
from tests.pic.analysis.programs import INTERRUPT, assembled
from tests.pic.analysis.test_facts import nested_calls

RB = [5 + number for number in range(8)]


def paths(text: str) -> Paths:
    return explore(assembled(text).image.program)


def assert_are(found: Paths, **expected: object) -> None:
    """Compare some parts; all others must be empty or as at the beginning."""
    plain = Paths()
    for part in fields(Paths):
        assert getattr(found, part.name) == expected.get(part.name, getattr(plain, part.name)), part.name


def test_a_straight_program_does_nothing_special() -> None:
    assert_are(paths("main\n clrf 0x20\n incf 0x20, f\n goto main"), executed={0, 1, 2})


def test_calls_returns_and_their_depth() -> None:
    found = paths("main\n call f\n call g\n goto main\nf\n call g\n return\ng\n return")
    assert_are(found, executed=set(range(6)), depth=2, called_from={3: {0}, 5: {1, 3}})


def test_outputs_options_and_the_timer() -> None:
    found = paths(
        " clrf PORTB\n movlw 7\n movwf TMR0\n bsf STATUS, 5\n movlw 0xF8\n movwf TRISB\n movlw 0x82\n"
        " movwf OPTION_REG\n bcf STATUS, 5\nhere\n goto here"
    )
    assert_are(
        found, executed=set(range(10)), outputs=set(RB[:3]), option_writes={7: values.constant(0x82)},
        timer_writes={2: values.constant(7)},
    )  # fmt: skip
    assert found.options == values.of({0xFF, 0x82})


def test_writes_of_pins_before_and_after_their_directions_are_set() -> None:
    """The first BSF writes to the latches of RB4 to RB7 what these inputs read (DS35007 section 4)."""
    found = paths(
        " bsf PORTB, 0\n bsf STATUS, 5\n movlw 0x0F\n movwf TRISB\n bcf STATUS, 5\n bsf PORTB, 1\n"
        " bsf PORTB, 4\n bsf PORTA, 2\nhere\n goto here"
    )
    assert_are(
        found, executed=set(range(9)), outputs=set(RB[4:]),
        early_writes={PinWrite(0, RB[0]), PinWrite(7, 2)}, input_writes={PinWrite(5, RB[1])},
        driven_unwritten={PinWrite(3, pin) for pin in RB[4:]},
    )  # fmt: skip


def test_a_jump_that_pclath_leads_to_another_page_does_not_stay_in_the_table_after_it() -> None:
    """DS35007 section 2.4: PC<12:8> are PCLATH. The table after the jump is never reached."""
    found = paths(
        " movlw 3\n movwf PCLATH\n movf PORTB, w\n andlw 1\n addwf PCL, f\n goto one\n goto two\none\n nop\n"
        "two\n goto two\n org 0x305\n goto there\n goto there\nthere\n goto there"
    )
    assert_are(found, executed={*range(5), 0x305, 0x306, 0x307}, computed={4: {0x305, 0x306}})


def test_what_is_read_or_driven_unwritten() -> None:
    found = paths(" incf 0x20, f\n bsf STATUS, 5\n bcf TRISB, 7\n bcf STATUS, 5\nhere\n goto here")
    assert_are(
        found, executed=set(range(5)), outputs={RB[7]}, unwritten_reads={(0, 0x20)},
        driven_unwritten={PinWrite(2, RB[7])},
    )  # fmt: skip


def test_a_table_a_computed_jump_and_one_beyond_its_table() -> None:
    text = "main\n movf PORTB, w\n andlw 1\n call t\n goto main\nt\n addwf PCL, f\n retlw 1\n retlw 2\n{}"
    assert_are(
        paths(text.format("")), executed=set(range(7)), depth=1, called_from={4: {2}}, computed={4: {5, 6}}
    )
    free = paths(text.format("").replace("andlw 1", "andlw 7"))
    assert_are(
        free, executed=set(range(7)), depth=1, called_from={4: {2}}, computed={4: {5, 6}}, tables={4: (5, 6)}
    )
    certain = paths(text.format(" return").replace("movf PORTB, w\n andlw 1", "movlw 2\n nop"))
    assert_are(
        certain, executed={0, 1, 2, 3, 4, 7}, depth=1, called_from={4: {2}}, computed={4: {7}}, beyond={4: 7}
    )


@pytest.mark.parametrize(
    ("text", "computed"),
    [
        (" movlw 0xFF\n addwf PCL, f", {1: {1}}),  # 1 + 1 + 255 = 1 modulo 256
        (" movlw 1\n addwf PCL, f\n nop\n nop\n movlw 2\n movwf PCL", {1: {3}, 5: {2}}),
    ],
)
def test_computed_jumps_that_lead_back_are_followed_once_round(
    text: str, computed: dict[int, set[int]]
) -> None:
    explorer = PathExplorer(assembled(text).image.program)
    assert explorer.explore().computed == computed
    assert explorer.steps < 20
    assert not explorer.gave_up


def test_where_paths_are_lost() -> None:
    nothing = paths("main\n movf PORTB, w\n movwf PCL\n nop")
    assert_are(nothing, executed={0, 1}, lost={1: "a computed jump"})
    deep = paths(nested_calls(9))
    assert deep.lost == {16: "a ninth return address"}
    assert deep.overflows == {16: (1, 3, 5, 7, 9, 11, 13, 15)}
    assert deep.depth == 8
    assert_are(paths("main\n return"), executed={0}, underflows={0}, lost={0: "a return with an empty stack"})
    pcl = paths("main\n movlw 2\n movwf FSR\n clrf INDF\n goto main")
    assert pcl.lost == {2: "a pointer may address PCL"}
    pointer = paths("main\n movf PORTB, w\n movwf FSR\n movf INDF, w\n goto main")
    assert_are(pointer, executed=set(range(4)), pointers={2})


def test_the_analysis_is_given_up_beyond_a_number_of_instructions() -> None:
    """Three instructions; the last one leads to itself with nothing new."""
    words = assembled(" movlw 1\n movlw 2\nhere\n goto here").image.program
    whole = PathExplorer(words, max_steps=3)
    assert whole.explore().lost == {}
    assert not whole.gave_up
    short = PathExplorer(words, max_steps=2)
    assert short.explore().lost == {0: "more than 2 instructions to follow"}
    assert short.gave_up


@pytest.mark.parametrize("limit", [0, 5])
def test_what_the_first_exploration_found_stands_where_the_next_takes_too_long(
    monkeypatch: pytest.MonkeyPatch, limit: int
) -> None:
    words = assembled(MADE).image.program
    first = PathExplorer(words)
    first.explore()
    assert first.undecided
    monkeypatch.setattr("servogen.pic.analysis.paths.MAX_JUMP_STEPS", limit)
    assert explore(words) == first.paths


@pytest.mark.parametrize(
    ("masks", "decided"), [((0x0F, 0), True), ((0x1F, 0), False), ((3, 3), True), ((3, 7), False)]
)
def test_a_state_is_split_into_at_most_sixteen_parts(masks: tuple[int, int], decided: bool) -> None:
    """In each part `x - (x + 1) + 1` is 0, so that the computed jump can only go to the next word."""
    one, other = (f" movf PORTB, w\n andlw {mask}\n movwf 0x2{at}\n" for at, mask in enumerate(masks))
    words = assembled(
        one + other + "head\n incf 0x20, w\n subwf 0x20, w\n addlw 1\n movwf 0x22\n"
        " incf 0x21, w\n subwf 0x21, w\n addlw 1\n iorwf 0x22, w\n addwf PCL, f\n goto head"
    ).image.program
    plan = SplitPlan({(14, ()): bit(W)}, False, {(6, ()): (0x20, 0x21)}, {})
    explorer = PathExplorer(words, plan)
    assert explorer.explore().computed == {14: {15}}
    assert (not explorer.undecided) == decided


def test_an_interrupt_with_an_unknown_pointer_may_change_all_of_ram_and_nothing_above() -> None:
    """DS35007 figure 2-2: RAM is 0x0C to 0x4F."""
    work = " movf PORTB, w\n movwf FSR\n clrf INDF"
    main = "main\n movlw 0xA0\n movwf INTCON\nwait\n goto wait"
    changes = paths(INTERRUPT.format(work=work) + main).interrupt_changes
    assert {place for place in changes if 0x0C <= place <= 0xFF} == set(range(0x0C, 0x50))


def test_an_interrupt_that_restores_what_it_uses() -> None:
    main = "main\n movlw 0xA0\n movwf INTCON\nwait\n call f\n goto wait\nf\n return"
    found = paths(INTERRUPT.format(work=" incf 0x42, f") + main)
    begin = 4 + 11
    assert_are(
        found, executed={0, *range(4, begin + 5)}, depth=1, depth_when_interrupted=1, depth_of_interrupt=1,
        called_from={begin + 4: {begin + 2}}, interrupts=True, interrupt_sources=0x20,
        timer_options=values.constant(0xFF), timer_interrupted={begin + at for at in (2, 3, 4)},
        unwritten_reads={(9, 0x42)},
        interrupt_changes=found.interrupt_changes,
    )  # fmt: skip
    assert found.interrupt_changes >= {0x40, 0x41, 0x42, INTCON, W}
    assert not found.interrupt_changes & {0x43, FSR, OPTION, TRISB, TMR0}


@pytest.mark.parametrize(
    ("old", "new", "lost"),
    [
        ("swapf 0x41, w\n", "movf 0x41, w\n", True), (" swapf 0x40, f\n", "", True),
        ("movwf 0x40\n", "nop\n", True),
        ("bcf STATUS, 5\n", "nop\n", False), ("bcf INTCON, 2\n", "nop\n", False),
        ("bcf INTCON, 2\n", "clrf FSR\n", True), ("bcf INTCON, 2\n", "clrf PCLATH\n", True),
        ("bcf INTCON, 2\n", "bsf STATUS, 5\n", False),
    ],
)  # fmt: skip
def test_registers_that_an_interrupt_does_not_restore(old: str, new: str, lost: bool) -> None:
    main = "main\n movlw 0xA0\n movwf INTCON\nwait\n goto wait"
    whole = INTERRUPT.format(work="") + main
    assert whole.count(old) >= 1
    assert bool(paths(whole.replace(old, new, 1)).not_restored) == lost
    assert not paths(whole).not_restored


def test_interrupts_inside_the_interrupt_and_of_other_sources() -> None:
    main = "main\n movlw 0xF8\n movwf INTCON\nwait\n goto wait"
    nested = paths(INTERRUPT.format(work=" bsf INTCON, 7\n nop") + main)
    assert nested.nested_interrupts == set(range(10, 16))
    assert nested.interrupt_sources == 0x78
    only = paths(INTERRUPT.format(work="") + main.replace("0xF8", "0x90"))
    assert (only.interrupt_sources, only.timer_options, only.nested_interrupts) == (0x10, None, set())
    masked = paths(INTERRUPT.format(work="") + main.replace("0xF8", "0x78"))
    assert (masked.interrupts, masked.depth_when_interrupted, masked.depth_of_interrupt) == (False, None, 0)


def test_a_loop_with_a_known_counter_is_followed_to_its_end() -> None:
    """The word behind the loop is executed, the one behind a skip that is never taken is not."""
    text = "main\n movlw {0}\n movwf 0x20\nloop\n decfsz 0x20, f\n goto loop\n"
    text += " movf 0x20, f\n btfss STATUS, 2\n nop\n"
    for count in (1, 3, 200):
        found = paths(text.format(count) + "here\n goto here")
        assert found.executed == ({*range(8)} - {6} - ({3} if count == 1 else set()))


@pytest.mark.parametrize(
    ("text", "open_pins"),
    [
        (" bsf PORTB, 0", {}),  # before the directions are set
        (" movf PORTA, w\n movwf PORTB", {}),
        (" bsf STATUS, 5\n bcf TRISB, 7\n bcf STATUS, 5\n bsf PORTB, 0", {}),  # certainly of an input
        (" bsf STATUS, 5\n bcf TRISB, 7\n bcf STATUS, 5\n movf PORTA, w\n movwf PORTB",
         {(4, ()): bits((FSR, W))}),
        (" bsf STATUS, 5\n clrf TRISB\n bcf STATUS, 5\n movf PORTA, w\n movwf PORTB", {}),  # of outputs only
    ],
)  # fmt: skip
def test_writes_are_open_of_which_it_is_not_known_whether_they_write_inputs(
    text: str, open_pins: dict[tuple[int, tuple[int, ...]], int]
) -> None:
    explorer = PathExplorer(assembled(f" clrf PORTB\n{text}\nhere\n goto here").image.program)
    explorer.explore()
    shifted = {(address + 1, stack): used for (address, stack), used in open_pins.items()}
    assert (explorer.open_pins, explorer.open) == (shifted, (0, len(shifted)))


# -- what an index is made from ----------------------------------------------------------------------------


def graph(text: str) -> Graph:
    explorer = PathExplorer(assembled(text).image.program)
    explorer.explore()
    return Graph(explorer.words, explorer.visits)


MADE = (
    "main\n movf 0x20, w\n addwf 0x21, w\n movwf 0x22\n movf 0x22, w\n call t\n goto main\nt\n addwf PCL, f\n"
    " retlw 1\n retlw 2\n"
)


def test_the_bytes_that_an_index_is_made_from_are_demanded_where_they_are_needed() -> None:
    made = graph(MADE)
    jump = (6, (5,))
    assert made.indices() == {jump: bit(W)}
    both = bits((0x20, 0x21))
    demanded = made.demanded(made.indices())
    # Around the loop, both bytes are needed again; 0x22 and W only from where they are made.
    assert {node: places for node, places in demanded.items() if node[0] <= 6} == {
        (0, ()): both, (1, ()): both | bit(W), (2, ()): both | bit(W), (3, ()): both | bit(0x22),
        (4, ()): both | bit(W), jump: both | bit(W), (5, ()): both,
    }  # fmt: skip
    plan = SplitPlan.of(made, made.indices(), pins=True)
    assert plan.apart[2, ()] == (W, 0x20, 0x21)
    assert plan.apart[3, ()] == (0x20, 0x21, 0x22)
    assert (plan.pins, plan.uses, plan.kept[5, ()]) == (True, {jump: bit(W)}, both)
    assert (W, *range(0x0C, 0x50)) == APART


@pytest.mark.parametrize("rotate", ["rlf", "rrf"])
def test_an_index_that_is_rotated_is_made_from_the_carry_too(rotate: str) -> None:
    made = graph(f"main\n {rotate} 0x20, w\n call t\n goto main\nt\n addwf PCL, f\n retlw 1\n retlw 2\n")
    assert made.demanded(made.indices())[0, ()] == bits((0x20, CARRY))


def test_instructions_that_write_the_same_operand_on_the_same_path_are_alike() -> None:
    made = graph(
        "main\n clrf 0x20\n incf 0x20, f\n decf 0x20, w\n clrf 0x21\n call f\n goto main\n"
        "f\n clrf 0x20\n return"
    )
    assert set(made.alike((0, ()))) == {(0, ()), (1, ())}
    assert made.alike((2, ())) == [(2, ())], "it writes W"
    assert set(made.alike((6, (5,)))) == {(6, (5,))}
    assert set(made.alike((3, ()))) == {(3, ())}


def test_bytes_that_get_an_input_or_a_masked_value_are_free() -> None:
    text = (
        "main\n movf PORTB, w\n movwf 0x20\n movf 0x30, w\n movwf 0x21\n andlw 0x0F\n movwf 0x22\n"
        " movf 0x30, w\n andlw 0x1F\n movwf 0x23\n movf PORTB, w\n addwf 0x30, w\n"
        " movwf 0x24\n incf 0x24, w\n movwf 0x25\n"
        " movf PORTB, w\n goto on\non\n movwf 0x26\n incf 0x27, f\n xorwf 0x28, f\n clrf 0x29\n goto main"
    )
    assert graph(text).free() == bits((0x20, 0x22, 0x24, 0x26, 0x28))


def test_nodes_of_undefined_words_pass_on_what_is_demanded() -> None:
    visits = {
        (0, ()): ExecutionGroup({(1, ())}, set()),
        (1, ()): ExecutionGroup({(2, ())}, {0x20}),
        (2, ()): ExecutionGroup(set(), {None}),
    }
    made = Graph({0: 0x0001, 1: encode("MOVF", f=0x20, d=0), 2: encode("MOVWF", f=2)}, visits)
    assert made.indices() == {(2, ()): bit(W)}
    assert made.demanded(made.indices()) == {(2, ()): bit(W), (1, ()): bit(0x20), (0, ()): bit(0x20)}
    assert made.alike((0, ())) == [(0, ())]
    assert made.free() == 0
    assert ZERO < 0 < LATCHES
