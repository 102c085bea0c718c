"""The longest way through a program: loops with counters, tables, calls, branches, and what has no bound."""

import random

import pytest

from servogen.pic import wcet
from servogen.pic.assembler import Assembly, assemble
from servogen.pic.listing import ListedFunction
from servogen.pic.wcet import TimedProgram, Times, Unbounded
from servogen.simulator import Machine
from servogen.units import Clock, Cycles
from tests.campaigns import sampled

ARITHMETIC = ("addwf", "subwf", "xorwf", "andwf", "rlf", "rrf", "incf", "comf", "swapf", "movf")


def code(text: str) -> Assembly:
    return assemble(f'    list p=16f84, r=dec\n    include "p16f84.inc"\n    org 0\n{text}\n    end\n')


def timed(text: str) -> tuple[TimedProgram, dict[str, int]]:
    """Return the program and its labels; functions begin at `main` and at labels that begin with "f_"."""
    made = code(text)
    labels = dict(made.labels)
    starts = sorted(at for name, at in labels.items() if name.startswith("f_") or name == "main")
    ends = [*starts[1:], max(made.image.program) + 1]
    names = {at: name for name, at in labels.items()}
    functions = [ListedFunction(names[a], a, b) for a, b in zip(starts, ends, strict=True)]
    return TimedProgram(made.image.program, functions), labels


def most(text: str, start: str = "start", end: str = "done", without: str | None = None) -> int | None:
    """The longest way between two labels."""
    program, labels = timed(text)
    return program.longest(labels[start], {labels[end]}, {labels[without]} if without else ())


def test_the_longer_of_two_ways_counts_where_the_value_is_not_known() -> None:
    text = "main\nstart\n btfss PORTB, 0\n goto far\n goto done\nfar\n nop\n nop\n nop\ndone\n nop"
    assert most(text) == 1 + 2 + 3
    known = text.replace("start\n btfss PORTB, 0", "start\n movlw 1\n movwf 0x20\n btfss 0x20, 0")
    assert most(known) == 1 + 1 + 2 + 2


def test_a_loop_whose_counter_comes_from_outside_has_no_bound() -> None:
    text = "main\nstart\n movf PORTB, w\n movwf 0x20\nagain\n decfsz 0x20, f\n goto again\ndone\n nop"
    assert most(text) is None


def test_writing_through_an_unknown_pointer_may_change_the_counter() -> None:
    text = "main\nstart\n movlw 5\n movwf 0x20\n{}again\n decfsz 0x20, f\n goto again\ndone\n nop"
    assert most(text.format(" clrf INDF\n")) is None
    assert most(text.format(" movlw 0x30\n movwf FSR\n clrf INDF\n")) == 2 + 3 + 4 * 3 + 2


def test_a_call_costs_its_body_and_a_return_beyond_the_start_goes_to_every_caller() -> None:
    text = (
        "main\n call f_one\n nop\n nop\n nop\ndone\n nop\n goto main\n"
        "f_one\nstart\n nop\n call f_two\n return\nf_two\n nop\n return\n"
    )
    assert most(text) == 1 + (2 + 1 + 2) + 2 + 3
    twice = text.replace(" nop\n goto main", " call f_one\n goto done")
    assert most(twice) == 1 + (2 + 1 + 2) + 2 + 3  # the other way back is shorter: 2


def test_a_loop_around_a_call_is_counted_unless_the_call_changes_its_counter() -> None:
    text = (
        "main\nstart\n movlw 5\n movwf 0x20\nagain\n call f_one\n decfsz 0x20, f\n goto again\n"
        "done\n nop\n goto done\n"
        "f_one\n btfsc PORTB, 0\n {}\n return\n"
    )
    body = 2 + 1 + 1 + 2
    assert most(text.format("clrf 0x21")) == 2 + 5 * body + 4 * 3 + 2
    for changes in ("incf 0x20, f", "clrf INDF"):
        assert most(text.format(changes)) is None
    nested = text.format("call f_two") + "f_two\n incf 0x20, f\n return\n"
    assert most(nested) is None


def test_a_function_whose_time_is_its_argument_is_gone_through_each_time() -> None:
    text = (
        "main\nstart\n movlw 3\n movwf 0x20\n call f_wait\n movlw 7\n movwf 0x20\n call f_wait\n"
        "done\n nop\n goto done\n"
        "f_wait\n decfsz 0x20, f\n goto f_wait\n return\n"
    )
    assert most(text) == sum(2 + 2 + 3 * (turns - 1) + 2 + 2 for turns in (3, 7))


def test_a_loop_is_followed_turn_by_turn_where_a_function_in_it_reads_the_counter() -> None:
    """The function waits 2, 3 ... 11 times: the turns of the loop are not alike."""
    text = (
        "main\nstart\n movlw 10\n movwf 0x20\n"
        "turn\n call f_wait\n decfsz 0x20, f\n goto turn\ndone\n goto done\n"
        "f_wait\n movf 0x20, w\n sublw 12\n movwf 0x21\ninner\n decfsz 0x21, f\n goto inner\n return\n"
    )
    waits = sum(2 + 3 + 3 * (12 - left - 1) + 2 + 2 for left in range(1, 11))
    assert most(text) == 2 + waits + 9 * (1 + 2) + 2


def test_a_loop_is_followed_turn_by_turn_where_it_reads_its_counter_through_a_pointer() -> None:
    """Odd turns take one cycle more: the skip is not taken (2 cycles if it is), and the GOTO costs 2."""
    text = (
        "main\nstart\n movlw 0x20\n movwf FSR\n movlw 10\n movwf 0x20\n"
        "turn\n btfsc INDF, 0\n goto odd\nodd\n decfsz 0x20, f\n goto turn\ndone\n goto done\n"
    )
    assert most(text) == 4 + 5 * 2 + 5 * 3 + 9 * (1 + 2) + 2


def test_the_equal_turns_of_a_loop_take_one_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """A counter that starts at 0 is decremented 256 times; 20 states are enough for them."""
    monkeypatch.setattr(wcet, "MAX_STATES", 20)
    text = "main\nstart\n clrf 0x20\nagain\n bsf PORTB, 0\n decfsz 0x20, f\n goto again\ndone\n goto done\n"
    assert most(text) == 1 + 255 * (1 + 1 + 2) + 1 + 2
    uneven = text.replace("bsf PORTB, 0", "btfss 0x20, 0\n nop\n nop")
    assert most(uneven) is None, "turns that differ are followed one by one"


@pytest.mark.parametrize(
    ("kind", "without_bound"),
    [
        ("sleep", "sleep\n goto done"),
        ("computed jump", "movf PORTB, w\n movwf PCL\n nop"),
        ("computed jump", "retfie"),
        ("call", "call f_wait\n goto done"),
    ],
)
def test_between_two_places_with_something_without_a_bound_neither_time_is_known(
    kind: str, without_bound: str
) -> None:
    program, labels = timed(
        f"main\nstart\n btfss PORTB, 0\n goto other\ndone\n goto done\nother\nhere\n {without_bound}\n"
        "f_wait\n btfss PORTB, 0\n goto f_wait\n return\n"
    )
    at = labels["here"] + (without_bound.startswith("movf"))
    found = program.between(labels["start"], {labels["done"]})
    assert found == Times(None, None, (Unbounded(kind, (at,)),))


def test_the_times_of_a_function_that_only_its_arguments_bound_are_those_of_its_calls() -> None:
    program, labels = timed(
        "main\n movlw 3\n movwf 0x20\n call f_wait\n movlw 7\n movwf 0x20\n call f_wait\ndone\n goto done\n"
        "f_wait\n decfsz 0x20, f\n goto f_wait\n return\n"
    )
    assert program.times(labels["f_wait"]).longest is None
    assert program.times_with_arguments(labels["f_wait"]) == program.times(labels["f_wait"]), (
        "no call is known yet"
    )
    assert program.longest(labels["main"], {labels["done"]}) is not None
    assert program.times_with_arguments(labels["f_wait"]) == Times(
        *(3 * (turns - 1) + 2 + 2 for turns in (3, 7))
    )


def test_a_call_with_an_unknown_argument_leaves_the_function_without_a_bound() -> None:
    program, labels = timed(
        "main\n movlw 3\n movwf 0x20\n call f_wait\n movf PORTB, w\n movwf 0x20\n"
        " call f_wait\ndone\n goto done\nf_wait\n decfsz 0x20, f\n goto f_wait\n return\n"
    )
    assert program.times(labels["main"]).longest is None
    found = program.times_with_arguments(labels["f_wait"])
    assert found.longest is None, "PORTB may be 255"
    assert found.shortest == 2 + 2, "or 1"


def test_a_function_for_which_no_states_are_left_may_return_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """That nothing was explored does not mean that it never returns: its callers go on after the call."""
    monkeypatch.setattr(wcet, "MAX_PROGRAM_STATES", 1)
    program, labels = timed(
        "main\n btfss PORTB, 0\n goto main\ndone\n goto done\nf_one\n call f_two\n return\nf_two\n return\n"
    )
    program.times(labels["main"])
    for name, returns_after in (("f_two", 2), ("f_one", 2 + 2 + 2)):
        times = program.times(labels[name])
        assert times.shortest is not None and times.shortest <= returns_after
        assert times.longest is None


def test_a_table_costs_its_jump_and_its_return() -> None:
    table = "f_table\n addwf PCL, f\n retlw 1\n retlw 2\n"
    assert most(f"main\nstart\n movf PORTB, w\n call f_table\ndone\n nop\n{table}") == 1 + 2 + 2 + 2
    other = table.replace("retlw 2", "goto f_table")
    assert most(f"main\nstart\n movf PORTB, w\n call f_table\ndone\n nop\n{other}") is None


def test_a_jump_at_the_end_of_a_function_leads_to_a_table_elsewhere() -> None:
    """CALL 2, MOVWF 1, MOVWF PCL 2, RETLW 2: so the compiler reads flash through a pointer."""
    text = (
        "main\nstart\n call f_read\ndone\n nop\n"
        "f_read\n movwf PCLATH\n movwf PCL\nf_table\n retlw 1\n retlw 2\n"
    )
    assert most(text) == 2 + 1 + 2 + 2
    assert most(text.replace("f_table", " nop\nf_table")) is None


def test_a_jump_to_another_function_costs_two_cycles_and_that_functions_way_to_its_return() -> None:
    two = "f_two\n btfss PORTB, 0\n return\n nop\n return\n"
    program, labels = timed(f"main\n call f_one\ndone\n goto done\nf_one\n nop\n goto f_two\n{two}")
    assert program.times(labels["f_two"]) == Times(Cycles(1 + 2), Cycles(2 + 1 + 2))
    assert program.times(labels["f_one"]) == Times(Cycles(1 + 2 + 3), Cycles(1 + 2 + 5))


def test_ways_through_a_forbidden_address_do_not_count() -> None:
    text = "main\nstart\n btfss PORTB, 0\n goto far\n goto done\nfar\n nop\n nop\n nop\ndone\n nop"
    assert most(text, without="far") == 2 + 2
    assert most("main\nstart\n goto far\nfar\n nop\ndone\n nop", without="far") is None


@pytest.mark.parametrize("seed", sampled(range(20), 6))
def test_no_run_takes_longer_and_with_all_known_every_run_takes_as_long(seed: int) -> None:
    """Random programs of arithmetic on known bytes, with skips and counted loops, against the simulator."""
    dice = random.Random(seed)
    lines = ["main", " bsf STATUS, RP0", " clrf TRISB", " bcf STATUS, RP0"]
    lines += [f" movlw {dice.randrange(256)}\n movwf 0x{at:02X}" for at in range(0x20, 0x26)]
    lines += [" bcf STATUS, C", " bcf STATUS, Z", "start", " movlw 0"]
    for number in range(12):
        f = f"0x{dice.randrange(0x20, 0x26):02X}"
        lines.append(f" {dice.choice(ARITHMETIC)} {f}, {dice.choice('wf')}")
        lines.append(
            f" {dice.choice(['btfsc', 'btfss'])} {dice.choice([f'{f}, 3', 'STATUS, C', 'STATUS, Z'])}"
        )
        lines.append(f" goto way_{number}")
        lines.append(
            f" movlw {dice.randrange(1, 9)}\n movwf 0x30\nturn_{number}\n decfsz 0x30, f\n goto turn_{number}"
        )
        lines.append(f"way_{number}")
        lines.append(f" addlw {dice.randrange(256)}")
    text = "\n".join([*lines, "done", " nop", " goto done"])
    made, clock = code(text), Clock(4_000_000)
    labels = dict(made.labels)
    machine = Machine(made.image, clock)
    machine.run_until(pc=labels["start"], limit=1000)
    begun = machine.cycles
    machine.run_until(pc=labels["done"], limit=100_000)
    took = machine.cycles - begun
    bound = most(text)
    assert bound is not None and took <= bound
    # From the beginning every byte is known: there is one way.
    assert most(text, start="main") == machine.cycles


COUNTERS = ("0x20", "0x21", "0x22")
END_OF_TURN = (
    " decfsz {counter}, f\n goto turn_{counter}",
    " decf {counter}, f\n btfss STATUS, Z\n goto turn_{counter}",
)
WAIT = " movwf 0x30\nwait_{number}\n decfsz 0x30, f\n goto wait_{number}\n return"
BODIES = (
    " movf {byte}, w\n andlw 7\n addlw 1\n" + WAIT,
    " movf {byte}, w\n sublw 9\n" + WAIT,
    " movlw {byte}\n movwf FSR\n movf INDF, w\n" + WAIT,
    " movlw 5\n" + WAIT,
    " btfsc {byte}, 0\n nop\n return",
    " incf 0x31, f\n call f_{following}\n return",
)
"""Functions whose time depends on a byte, on none, or on another function's."""


def loops(dice: random.Random, counters: tuple[str, ...]) -> str:
    """Loops in one another, with calls before and behind the inner one."""
    if not counters:
        return ""
    call = " call f_{}\n"
    calls = [call.format(dice.randrange(4)) if dice.random() < 0.6 else "" for _ in range(2)]
    inner = loops(dice, counters[1:]) if dice.random() < 0.7 else ""
    first = f" movlw {dice.randrange(1, 8)}\n movwf {counters[0]}\nturn_{counters[0]}\n"
    return first + calls[0] + inner + calls[1] + dice.choice(END_OF_TURN).format(counter=counters[0]) + "\n"


@pytest.mark.parametrize("seed", sampled(range(14), 5))
def test_loops_with_calls_take_as_long_as_on_the_chip(seed: int) -> None:
    """Everything is known from the beginning: the shortest and the longest time are the simulator's."""
    dice = random.Random(seed)
    lines = ["main", *(f" movlw 3\n movwf {byte}" for byte in (*COUNTERS, "0x31"))]
    lines += [loops(dice, COUNTERS), "done", " goto done"]
    for number in range(4):
        body = dice.choice(BODIES)
        if number == 3 and "call" in body:
            body = BODIES[0]
        lines += [f"f_{number}", body.format(byte=dice.choice(COUNTERS), number=number, following=number + 1)]
    made, text = code("\n".join(lines)), "\n".join(lines)
    labels = dict(made.labels)
    machine = Machine(made.image, Clock(4_000_000))
    machine.run_until(pc=labels["done"], limit=1_000_000)
    assert most(text, start="main") == machine.cycles
