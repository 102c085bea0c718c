"""Worst-case times: what an instruction reads, what lives, where calls lead,
bounds, pieces, and what has no bound. Cycles are counted by hand from DS35007 table 7-2.
"""

from __future__ import annotations

import random

import pytest

from servogen.pic import wcet
from servogen.pic.isa import encode
from servogen.pic.known_values import CARRY, FSR, ZERO, W, word_of
from servogen.pic.listing import ListedFunction
from servogen.pic.wcet import TimedProgram, Times, Unbounded, is_live
from servogen.simulator import Machine
from servogen.units import Clock, Cycles
from tests.campaigns import sampled
from tests.pic.analysis.test_exactness import ROWS, WITH_FILE, encoded
from tests.pic.test_wcet import code, timed

RAM = range(0x0C, 0x50)
PLACES = (W, CARRY, ZERO, FSR, *RAM)


def places(bit_set: int) -> set[int]:
    """Return the places of a bit set."""
    return {place for place in PLACES if is_live(place, bit_set)}


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_what_an_instruction_reads_and_overwrites(row: list[str]) -> None:
    """By the table from the data sheet: flags and W are overwritten entirely, a byte if it is not read."""
    name, reads, writes, flags = row
    files = (0x00, 0x01, 0x03, FSR, 0x06, 0x0C, 0x4F, 0x50) if row in WITH_FILE else (0,)
    for f, d in ((f, d) for f in files for d in (0, 1)):
        word = word_of(encoded(row, f=f, d=d, b=3, k=7))
        to_w = writes == "W" or (writes == "d" and d == 0)
        killed = {W} if to_w else set()
        killed |= {{"C": CARRY, "Z": ZERO}[flag] for flag in flags.split(",") if flag in ("C", "Z")}
        used = {{"W": W, "C": CARRY}[each] for each in reads.split(",") if each in ("W", "C")}
        if row in WITH_FILE and f == 0:
            used |= {FSR, *(RAM if "f" in reads else ())}
        elif row in WITH_FILE and f == 3 and "f" in reads:
            used |= {CARRY, ZERO}
        elif row in WITH_FILE and (f == FSR or f in RAM):
            (used if "f" in reads else killed).add(f)
        uses, kills = wcet.uses_and_kills(word)
        assert (places(uses), places(kills)) == (used, killed), f"{name} 0x{f:02X}, {d}"


def followers(words: dict[int, int], address: int) -> list[int]:
    """Return where an instruction may lead: calls into the function, returns behind every call."""
    word = word_of(words[address])
    calls = [at + 1 for at, number in words.items() if word_of(number).flow == "call"]
    if word.flow in ("jump", "call"):
        return [word.k]
    if word.flow == "return" or word.writes_pcl:
        return [] if word.name == "RETFIE" else calls
    return [address + 1, address + 2] if word.flow == "skip" else [address + 1]


def lives(words: dict[int, int], address: int, place: int) -> bool:
    """Return whether some path from an address reads a place before it overwrites it."""
    seen, waiting = set(), [address]
    while waiting:
        at = waiting.pop()
        if at in seen or at not in words:
            continue
        seen.add(at)
        uses, kills = wcet.uses_and_kills(word_of(words[at]))
        if place in places(uses):
            return True
        if place not in places(kills):
            waiting += followers(words, at)
    return False


@pytest.mark.parametrize("seed", sampled(range(12), 4))
def test_a_place_lives_where_some_path_reads_it_before_it_is_overwritten(seed: int) -> None:
    """Against a search along every path, on random words with jumps, calls and returns."""
    rng = random.Random(seed)
    length = 24
    flow = ("GOTO", "CALL", "RETURN", "RETLW", "RETFIE", "BTFSS", "DECFSZ", "MOVWF PCL")
    words = {}
    for address in range(length):
        row = rng.choice(ROWS)
        number = encoded(row, f=rng.choice((0, 3, FSR, 0x0C, 0x20, 0x4F)), d=rng.randrange(2), b=0, k=5)
        kind = rng.choice((*flow, *[""] * 9))
        if kind in ("GOTO", "CALL"):
            number = encode(kind, k=rng.randrange(length))
        elif kind in ("RETURN", "RETLW", "RETFIE"):
            number = encode(kind)
        elif kind == "MOVWF PCL":
            number = encode("MOVWF", f=2)
        words[address] = number
    live = TimedProgram(words, ()).live
    for address in range(length):
        expected = {
            place for place in (W, CARRY, ZERO, FSR, 0x0C, 0x20, 0x33, 0x4F) if lives(words, address, place)
        }
        assert {
            place
            for place in expected | {W, CARRY, ZERO, FSR, 0x0C, 0x20, 0x33, 0x4F}
            if is_live(place, live[address])
        } == expected


LINKED = """
main
 call f_one
 btfsc PORTB, 0
 call f_two
again
 decfsz 0x20, f
 goto again
 goto main
f_one
 movlw 3
 goto f_shared
f_two
 clrf 0x30
 call f_one
 return
f_shared
 incf 0x31, w
 return
"""
"""By address: main 0 to 5, f_one 6 and 7, f_two 8 to 10, f_shared 11 and 12."""


def test_where_code_leads_and_what_it_changes_and_reads() -> None:
    program, labels = timed(LINKED)
    one, two, shared = (labels[f"f_{name}"] for name in ("one", "two", "shared"))
    assert (one, two, shared) == (6, 8, 11)
    assert program.reached(one) == {6, 7, 11, 12}
    assert program.reached(two) == {8, 9, 10, 6, 7, 11, 12}
    assert program.reached(0) == frozenset(range(13))
    assert program.changes(one) == {W, CARRY, ZERO, FSR}
    assert program.changes(two) == {W, CARRY, ZERO, FSR, 0x30}
    assert program.changes(0) == {W, CARRY, ZERO, FSR, 0x30, 0x20}
    assert places(program.reads(one)) == {0x31}
    assert places(program.reads(0)) == {0x31, 0x20}
    # f_one is called from 0 and from 9, f_two from 2; f_shared returns in the place of f_one.
    nowhere: set[int] = set()
    assert {at: set(program.callers(at)) for at in range(13)} == {
        at: returns
        for where, returns in ((range(6), nowhere), ((6, 7, 11, 12), {1, 10}), ((8, 9, 10), {3}))
        for at in where
    }
    assert program.heads == {0, 6, 8, 11, 1, 3, 5, 10} | {4 - 1, 6}
    assert program.loop_heads == {3, 0}
    assert program.home == {
        **dict.fromkeys(range(6), 0), 6: 6, 7: 6, 8: 8, 9: 8, 10: 8, 11: 11, 12: 11
    }  # fmt: skip
    # Neither skips, calls, jumps nor returns.
    assert program.plain == {6, 8, 11}


def test_a_write_through_a_pointer_changes_any_byte() -> None:
    program, _ = timed("main\n clrf INDF\n incf PORTB, w\n return")
    assert program.changes(0) == {W, CARRY, ZERO, FSR, *RAM}
    assert timed("main\n movf INDF, w\n return")[0].changes(0) == {W, CARRY, ZERO, FSR}


@pytest.mark.parametrize(
    ("instruction", "plain"),
    [
        ("nop", True), ("movlw 3", True), ("incf 0x20, f", True), ("addlw 254", True), ("addwf PCL, w", True),
        ("decf 0x20, f", False), ("addlw 255", False), ("sleep", False), ("addwf PCL, f", False),
        ("btfss 0x20, 0", False), ("goto 0", False), ("call 0", False), ("return", False),
    ],
)  # fmt: skip
def test_plain_instructions_only_go_on_and_begin_no_loop(instruction: str, plain: bool) -> None:
    words = code(f" {instruction}\n nop").image.program
    assert (0 in TimedProgram(words, ()).plain) == plain
    assert 0 not in TimedProgram(words, (), bounds={0: 1}).plain
    assert 0 not in TimedProgram(words, (), pieces=[(0, 1)]).plain
    assert 1023 not in TimedProgram({1023: 0}, ()).plain, "the program counter wraps around behind it"


def with_functions(text: str, **options: object) -> tuple[TimedProgram, dict[str, int]]:
    """Return a program and its labels, as `timed` does, with bounds, pieces or targets by label."""
    made = code(text)
    labels = dict(made.labels)
    starts = sorted(at for name, at in labels.items() if name.startswith("f_") or name == "main")
    ends = [*starts[1:], max(made.image.program) + 1]
    functions = [ListedFunction(str(a), a, b) for a, b in zip(starts, ends, strict=True)]
    return TimedProgram(made.image.program, functions, **options), labels  # type: ignore[arg-type]


@pytest.mark.parametrize("turns", [1, 2, 7])
def test_a_loop_with_a_given_bound_is_passed_that_often(turns: int) -> None:
    """MAIN waits for RB0: BTFSS 1, GOTO 2 a turn, and 2 for the skip."""
    text = "main\nwait\n btfss PORTB, 0\n goto wait\n return"
    program, _ = with_functions(text, bounds={0: turns})
    assert program.times(0) == Times(2 + 2, 3 * (turns - 1) + 2 + 2)
    inside, _ = with_functions(text, bounds={1: turns})
    assert inside.times(0) == Times(2 + 2, 3 * turns + 2 + 2)


def test_a_given_bound_holds_for_a_loop_that_writes_through_an_unknown_pointer() -> None:
    """The write may change any byte of RAM, but not how often the loop was passed."""
    program, _ = with_functions("main\nwait\n clrf INDF\n btfss PORTB, 0\n goto wait\n return", bounds={0: 3})
    assert program.times(0) == Times(1 + 2 + 2, 2 * (1 + 1 + 2) + 1 + 2 + 2)


def test_the_bound_of_an_inner_loop_counts_for_the_whole_call() -> None:
    text = (
        "main\n movlw 2\n movwf 0x20\nouter\nwait\n btfss PORTB, 0\n goto wait\n"
        " decfsz 0x20, f\n goto outer\n return"
    )
    program, _ = with_functions(text, bounds={3: 5})
    # Five passes of the GOTO at 3 in both turns together: 5 * 3, and twice the skip 2, DECFSZ 1, GOTO 2.
    assert program.times(0) == Times(2 + 2 * 2 + 1 + 2 + 2 + 2, 2 + 5 * 3 + 2 * 2 + 1 + 2 + 2 + 2)


PIECE = (
    "main\n btfss PORTB, 0\n nop\nbegin\n movlw 4\n movwf 0x20\nturn\n decfsz 0x20, f\n goto turn\nend_\n{}"
)


def test_a_piece_of_equal_times_is_one_step_and_forgets_what_it_changes() -> None:
    text = PIECE.format(" movf 0x20, w\n movwf 0x30\nlast\n decfsz 0x30, f\n goto last\n return")
    alone, labels = with_functions(text)
    piece, _ = with_functions(text, pieces=[(labels["begin"], labels["end_"])])
    made = piece.piece(labels["begin"])
    assert made is not None
    assert (made.cycles, made.end, set(made.changes)) == (
        2 + 3 * 3 + 2,
        labels["end_"],
        {W, CARRY, ZERO, 0x20},
    )
    assert piece.piece(labels["turn"]) is None
    assert alone.times(0).longest == 1 + 1 + 2 + 11 + 2 + 255 * 3 + 2 + 2
    assert piece.times(0).longest is None, "what the piece leaves in 0x20 is not known"
    rest = PIECE.format(" movlw 5\n movwf 0x20\n return")
    for pieces in ([], [(labels["begin"], labels["end_"])]):
        assert with_functions(rest, pieces=pieces)[0].times(0) == Times(15 + 2 + 2, 15 + 2 + 2)


@pytest.mark.parametrize(
    "inside",
    ["clrf INDF", "btfss PORTB, 1\n goto $ + 1", "sleep", "call f_wait", "movf PORTB, w\n movwf PCL"],
)
def test_a_piece_without_one_time_or_with_a_pointer_is_followed(inside: str) -> None:
    text = f"main\nbegin\n {inside}\n nop\nend_\n return\nf_wait\n btfss PORTB, 0\n goto f_wait\n return\n"
    labels = with_functions(text)[1]
    program, _ = with_functions(text, pieces=[(labels["begin"], labels["end_"])])
    assert program.piece(labels["begin"]) is None


def test_a_piece_knows_what_its_calls_change() -> None:
    text = "main\nbegin\n call f_set\n nop\nend_\n return\nf_set\n clrf 0x41\n return\n"
    labels = with_functions(text)[1]
    program, _ = with_functions(text, pieces=[(labels["begin"], labels["end_"])])
    made = program.piece(labels["begin"])
    assert made is not None
    assert (made.cycles, set(made.changes)) == (2 + 1 + 2 + 1, {W, CARRY, ZERO, FSR, 0x41})


def test_an_end_inside_a_piece_is_seen() -> None:
    text = PIECE.format(" return")
    labels = with_functions(text)[1]
    program, _ = with_functions(text, pieces=[(labels["begin"], labels["end_"])])
    assert program.between(0, {labels["begin"] + 1}) == Times(2 + 1, 2 + 1)
    assert program.between(0, {labels["end_"]}) == Times(2 + 11 + 2, 2 + 11 + 2)


JUMP = (
    "main\n movf PORTB, w\n andlw 1\n addwf PCL, f\n goto one\n goto two\n"
    "one\n return\ntwo\n nop\n nop\n return"
)


def test_a_computed_jump_goes_to_its_known_targets() -> None:
    assert with_functions(JUMP)[0].times(0) == Times(1 + 1 + 2, None, (Unbounded("computed jump", (2,)),))
    program, _ = with_functions(JUMP, targets={2: (3, 4)})
    assert program.times(0) == Times(1 + 1 + 2 + 2 + 2, 1 + 1 + 2 + 2 + 2 + 2)
    assert program.targets(2) == (3, 4)
    assert program.targets(1) == ()
    assert program.reached(0) == frozenset(range(9))
    assert with_functions(JUMP, targets={2: (4,)})[0].times(0) == Times(10, 10)


@pytest.mark.parametrize("flag", [0, 2])
def test_after_a_computed_jump_its_flags_are_not_known(flag: int) -> None:
    """ADDWF with PCL sets them: Z was 1 and C 0 before. BTFSS 1, GOTO 2, two NOPs; or 2 if it skips."""
    program, labels = with_functions(
        "main\n bcf STATUS, 0\n movlw 0\n iorlw 0\n addwf PCL, f\n nop\n"
        f"here\n btfss STATUS, {flag}\n goto far\n return\nfar\n nop\n nop\n return",
        targets={3: (5,)},
    )
    assert labels["here"] == 5
    assert program.times(0) == Times(3 + 2 + 2 + 2, 3 + 2 + 1 + 2 + 2 + 2)


@pytest.mark.parametrize(("back", "turns"), [("return", 9), ("retlw 3", 3)])
def test_a_function_with_an_end_inside_is_followed_and_returns_with_its_w(back: str, turns: int) -> None:
    """MOVLW 1, CALL 2, BTFSS 1 and GOTO 2 to the end in it; or BTFSS 2, the return 2, MOVWF 1, the loop."""
    program, labels = with_functions(
        "main\n movlw 9\n call f_one\n movwf 0x20\nturn\n decfsz 0x20, f\n goto turn\ndone\n goto done\n"
        f"f_one\n btfss PORTB, 0\n goto out\n {back}\nout\n nop\n return\n"
    )
    whole = 1 + 2 + 2 + 2 + 1 + 3 * (turns - 1) + 2
    done, out = labels["done"], labels["out"]
    assert program.between(0, {done, out}) == Times(1 + 2 + 1 + 2, whole)
    assert program.longest(0, {done}, without={out}) == whole


@pytest.mark.parametrize("count", [0, 1, 2, 3, 255])
@pytest.mark.parametrize(
    ("loop", "turn", "last"),
    [
        ("movwf 0x20\nturn\n decfsz 0x20, f\n goto turn", 3, 2),
        ("movwf 0x20\nturn\n decf 0x20, f\n btfss STATUS, 2\n goto turn", 4, 3),
        ("nop\nturn\n addlw 255\n btfss STATUS, 2\n goto turn", 4, 3),
        ("movwf 0x20\nturn\n incfsz 0x20, f\n goto turn", -3, 2),
    ],
)
def test_a_loop_that_counts_takes_its_turns(count: int, loop: str, turn: int, last: int) -> None:
    """A counter of 0 is decremented 256 times; one that is incremented takes what is left up to 256."""
    turns = (256 - count) if turn < 0 else count or 256
    program, _ = timed(f"main\n movlw {count}\n {loop}\n return")
    expected = 2 + abs(turn) * (turns - 1) + last + 2
    assert program.times(0) == Times(expected, expected)


@pytest.mark.parametrize(
    "loop",
    [
        "turn\n decf 0x20, f\n btfss STATUS, 2\n goto turn\n btfss STATUS, 2\n nop",  # Z is 1: it skips
        "turn\n decfsz 0x20, f\n goto turn\n movf 0x20, w\n btfss STATUS, 2\n nop",
        " movf 0x20, w\nturn\n addlw 255\n btfss STATUS, 2\n goto turn\n btfss STATUS, 0\n nop",  # C is 1
        " movf 0x20, w\nturn\n addlw 255\n btfss STATUS, 2\n goto turn\n iorlw 0\n btfss STATUS, 2\n nop",
    ],
)
def test_what_a_counting_loop_leaves_is_known(loop: str) -> None:
    program, _ = timed(f"main\n movlw 9\n movwf 0x20\n{loop}\n return")
    times = program.times(0)
    one = 3 if "decfsz" in loop else 4
    before = 2 + ("addlw" in loop)
    tested = 2 + ("movf 0x20, w\n btfss" in loop) + ("iorlw" in loop)
    assert times == Times(*[before + 8 * one + one - 1 + tested + 2] * 2)


@pytest.mark.parametrize(
    ("loop", "cycles"),
    [
        ("turn\n decf 0x20, w\n btfss STATUS, 2\n goto turn", None),  # 0x20 stays
        ("turn\n decfsz 0x20, w\n goto turn", None),
        ("turn\n decf 0x20, f\n btfss STATUS, 0\n goto turn", None),  # C does not change
        ("turn\n decf 0x20, f\n btfss 0x21, 2\n goto turn", None),
        ("turn\n addlw 254\n btfss STATUS, 2\n goto turn", 1 + 1 + 2 + 1 + 2),  # 4, 2, 0
        ("turn\n decf 0x20, f\n btfsc STATUS, 2\n goto out\n goto turn\nout", 3 * (1 + 2 + 2) + 1 + 1 + 2),
    ],
)
def test_loops_that_look_like_counting_are_followed(loop: str, cycles: int | None) -> None:
    program, _ = timed(f"main\n movlw 4\n movwf 0x20\n clrf 0x21\n bcf STATUS, 0\n{loop}\n return")
    found = program.times(0)
    if cycles is None:
        assert [each.kind for each in found.unbounded] == ["loop"]
    else:
        assert found == Times(4 + cycles + 2, 4 + cycles + 2)


def reasons(text: str, **options: object) -> list[tuple[str, tuple[int, ...]]]:
    """Return what has no bound in a function at 0, as (kind, addresses)."""
    return [(each.kind, each.addresses) for each in with_functions(text, **options)[0].times(0).unbounded]


def test_what_has_no_bound_is_named_calls_first_then_loops_the_outer_one_first() -> None:
    text = (
        "main\n call f_wait\nouter\n nop\ninner\n btfss PORTB, 0\n goto inner\n btfss PORTB, 1\n goto outer\n"
        " return\nf_wait\n btfss PORTB, 2\n goto f_wait\n return\n"
    )
    assert reasons(text) == [("call", (0,)), ("loop", (1, 2, 3, 4, 5)), ("loop", (2, 3))]


@pytest.mark.parametrize(
    ("text", "expected", "shortest"),
    [
        ("main\n sleep\n return", [("sleep", (0,))], 2),
        ("main\n nop\n movf PORTB, w\n movwf PCL\n nop", [("computed jump", (2,))], 1 + 1 + 2),
        ("main\n nop\n call main\n return", [("call", (1,))], None),
        ("main\nend_\n goto end_", [], None),
        ("main\n btfss PORTB, 0\n return\nend_\n goto end_", [("loop", (2,))], 1 + 2),
        ("main\n call f_two\n return\nf_two\nend_\n goto end_", [("call", (0,))], None),
        ("main\n goto f_two\nf_two\n nop\n return", [], 2 + 1 + 2),
        ("main\n btfss PORTB, 0\n goto f_two\n return\nf_two\nend_\n goto end_", [("call", (1,))], 2 + 2),
        ("main\n btfss PORTB, 0\n call f_two\n return\nf_two\nend_\n goto end_", [("call", (1,))], 2 + 2),
        ("main\n goto f_two\nf_two\n btfss PORTB, 0\n goto f_two\n return", [("call", (0,))], 2 + 2 + 2),
    ],
)
def test_times_of_functions_that_end_elsewhere_or_nowhere(
    text: str, expected: list[tuple[str, tuple[int, ...]]], shortest: int | None
) -> None:
    assert reasons(text) == expected
    assert with_functions(text)[0].times(0).shortest == shortest


def run(text: str, start: str, end: str) -> int:
    """Return the cycles from one label to the other in a run of the plain simulator."""
    made = code(text)
    labels = dict(made.labels)
    machine = Machine(made.image, Clock(4_000_000))
    moments = []
    for label in (start, end):
        machine.breakpoints = {labels[label]}
        list(machine.stream(Cycles(100_000)))
        assert machine.pc == labels[label]
        moments.append(machine.cycles)
    return int(moments[1] - moments[0])


def recursion(turns: int, after: str = "") -> str:
    """Return a function that calls itself as often as a byte counts, and `after` the inner call does that."""
    return (
        f" goto start\nf_f\n decfsz 0x20, f\n goto more\n return\nmore\n call f_f\n{after} return\n"
        f"f_start\nstart\n clrf 0x21\n movlw {turns}\n movwf 0x20\n call f_f\ndone\n nop\nend_\n goto end_"
    )


@pytest.mark.parametrize("turns", [1, 2, 5, 8])
def test_a_recursion_that_a_known_value_bounds_takes_as_long_as_on_the_chip(turns: int) -> None:
    program, labels = timed(recursion(turns))
    times = program.between(labels["start"], {labels["done"]})
    took = run(recursion(turns), "start", "done")
    assert (times.shortest, times.longest, times.levels) == (took, took, turns)


def test_a_recursion_deeper_than_the_stack_has_no_bound() -> None:
    """With an endless stack 0x21 would count the eleven inner calls that return. The chip returns to the
    eight addresses that it has (DS35007 section 2.3) again and again, until 0x21 has counted to 256.
    """
    text = recursion(12, " incfsz 0x21, f\n return\n goto done\n")
    program, labels = timed(text)
    start, done = labels["start"], {labels["done"]}
    assert run(text, "start", "done") > 256 * 3 > 3 + 11 * (1 + 2 + 2 + 1 + 2) + 2 + 2
    assert program.longest(start, done) is None
    (reason,) = program.between(start, done).unbounded
    assert reason.kind == "stack"


@pytest.mark.parametrize(("levels", "bounded"), [(7, True), (8, True), (9, False), (40, False), (300, False)])
def test_calls_in_each_other_have_a_bound_up_to_the_levels_of_the_stack(levels: int, bounded: bool) -> None:
    """4 cycles for each call and its return, 3 for the last function; a long chain ends, too."""
    took = 4 * levels + 3
    calls = "".join(f"f_{n}\n call f_{n + 1}\n return\n" for n in range(1, levels))
    text = f"main\n call f_1\n return\n{calls}f_{levels}\n nop\n return\n"
    program, labels = timed(text)
    times = program.times(labels["main"])
    if bounded:
        assert (times.shortest, times.longest, times.levels) == (took, took, levels)
    else:
        assert times.longest is None and times.unbounded
    last = program.times(labels[f"f_{levels - 6}"])
    assert (last.longest, last.levels) == (4 * 6 + 3, 6)


def test_a_recursion_of_as_many_turns_as_a_byte_counts_is_given_up() -> None:
    program, labels = timed(recursion(0))
    times = program.between(labels["start"], {labels["done"]})
    assert times.longest is None and times.unbounded


@pytest.mark.parametrize("first", ["f_f", "f_h"])
def test_the_shortest_time_of_functions_that_call_each_other_does_not_depend_on_which_is_asked_first(
    first: str,
) -> None:
    """f returns after 1 + 2 cycles; h after 2 + 2 + 3 + 2 by way of f, or after 100 NOPs."""
    slow = "slow\n" + " nop\n" * 100 + " return\n"
    text = "f_f\n btfsc PORTB, 0\n return\n call f_h\n return\n"
    text += f"f_h\n btfsc PORTB, 1\n goto slow\n call f_f\n return\n{slow}"
    program, labels = timed(text)
    program.times(labels[first])
    shortest = [program.times(labels[name]).shortest for name in ("f_f", "f_h")]
    for found, least in zip(shortest, (1 + 2, 2 + 2 + 3 + 2), strict=True):
        assert found is not None and found <= least
    assert program.times(labels[first]).shortest == (3 if first == "f_f" else 9)


def test_a_jump_to_itself_is_the_end_of_a_function_that_never_returns_and_a_loop_where_an_end_is_due() -> (
    None
):
    program, labels = with_functions(
        "main\n btfss PORTB, 0\n goto on\nstay\n goto stay\non\n nop\ndone\n return"
    )
    done, stay = labels["done"], labels["stay"]
    found = program.between(0, {done}, must_end=True)
    assert found == Times(1 + 2 + 1, None, (Unbounded("loop", (stay,)),))
    assert program.between(stay, {done}) == Times(None, None, ())
    assert program.between(stay, {done}, must_end=True) == Times(None, None, (Unbounded("loop", (stay,)),))


def test_the_time_from_an_end_is_that_to_the_next() -> None:
    program, _ = with_functions("main\n nop\n nop\n goto main\n")
    assert program.between(0, {0}) == Times(4, 4)
    assert program.between(1, {0, 1}) == Times(3, 3)
    assert program.between(1, {0}, without={2}) == Times(None, None)
    assert program.longest(0, {2}, without={1}) is None


def test_undefined_words_have_no_time() -> None:
    functions = [ListedFunction("main", 0, 3)]
    program = TimedProgram({0: 0x0000, 1: 0x0001, 2: 0x0008}, functions)
    assert program.longest(0, {2}) is None
    assert program.between(0, {2}) == Times(None, None, (Unbounded("undefined word", (0,)),))
    assert program.times(0) == Times(None, None, (Unbounded("computed jump", (0,)),))
    assert program.between(5, {2}) == Times(None, None, (Unbounded("computed jump", (5,)),)), "no function"


def test_a_function_runs_on_into_the_next_where_it_ends() -> None:
    """The start-up code before main has no return: its time ends where main begins."""
    text = "main\n nop\n btfss PORTB, 0\n nop\nf_next\n nop\n nop\n return"
    program, labels = with_functions(text)
    assert program.times(0) == Times(1 + 2, 1 + 1 + 1)
    longer, _ = with_functions("main\n nop\n nop\nf_next\n nop\n return")
    assert longer.times(0) == Times(2, 2)
    assert labels["f_next"] == 3


def test_a_called_function_that_runs_on_into_the_next_returns_there() -> None:
    text = "main\n call f_one\ndone\n goto main\nf_one\n nop\nf_two\n nop\n btfss PORTB, 0\n nop\n return"
    program, labels = with_functions(text)
    assert program.times(labels["f_one"]) == Times(1 + 1 + 2 + 2, 1 + 1 + 2 + 2)
    assert program.between(0, {labels["done"]}) == Times(2 + 6, 2 + 6)


@pytest.mark.parametrize(
    ("loop", "cycles"),
    [
        ("decfsz 0x20, f\nin_\n goto turn", 1),
        ("decf 0x20, f\nin_\n btfss STATUS, 2\n goto turn", 1),
        ("decf 0x20, f\n btfss STATUS, 2\nin_\n goto turn", 2),
    ],
)
def test_an_end_inside_a_loop_that_counts_is_seen(loop: str, cycles: int) -> None:
    program, labels = with_functions(f"main\n movlw 9\n movwf 0x20\nturn\n {loop}\n goto in_")
    assert program.between(0, {labels["in_"]}) == Times(2 + cycles, 2 + cycles)


def test_a_computed_jump_at_the_end_of_a_function_goes_to_its_known_targets() -> None:
    text = (
        "main\n call f_one\ndone\n goto done\nf_one\n movwf PCL\nf_two\n nop\n nop\n return\nretlw_\n retlw 1"
    )
    targets = with_functions(text)[1]
    for target, cycles in (("f_two", 2 + 2 + 2 + 2), ("retlw_", 2 + 2 + 2)):
        program, labels = with_functions(text, targets={2: (targets[target],)})
        assert program.between(0, {labels["done"]}) == Times(cycles, cycles)


def test_the_program_counter_wraps_around_behind_the_last_word() -> None:
    words = {1022: encode("NOP"), 1023: encode("NOP"), 0: encode("RETURN")}
    program = TimedProgram(words, [ListedFunction("f", 1022, 1024), ListedFunction("g", 0, 1)])
    assert program.between(1022, {0}) == Times(2, 2)
    skip = {1023: encode("BTFSS", f=6, b=0), 0: encode("NOP"), 1: encode("NOP")}
    program = TimedProgram(skip, [ListedFunction("f", 1023, 1024), ListedFunction("g", 0, 2)])
    assert program.between(1023, {1}) == Times(2, 1 + 1)


def test_values_that_decide_no_time_do_not_keep_paths_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """Eight branches that leave 1 or 2 in a byte: 256 combinations, if all were remembered.

    Nobody reads the bytes, or they are read but count nothing: then the function is explored once more with
    its counter alone. BTFSC 1, GOTO 2 and two to write, or BTFSC 2, two to write and GOTO 2.
    """
    branches = "".join(
        f" btfsc PORTB, 0\n goto a{n}\n movlw 1\n movwf 0x2{n}\n goto b{n}\n"
        f"a{n}\n movlw 2\n movwf 0x2{n}\nb{n}\n"
        for n in range(8)
    )
    reads = "".join(f" movf 0x2{n}, w\n" for n in range(8))
    loop = " movlw 3\n movwf 0x30\nturn\n decfsz 0x30, f\n goto turn\n"
    rest = 2 + 2 * 3 + 2
    monkeypatch.setattr(wcet, "MAX_STATES", 60)
    monkeypatch.setattr(wcet, "MAX_FUNCTION_STATES", 60)
    program, labels = with_functions(f"main\n{branches}{loop}done\n return")
    assert program.between(0, {labels["done"]}) == Times(8 * 5 + rest, 8 * 6 + rest)
    assert program.times(0) == Times(8 * 5 + rest + 2, 8 * 6 + rest + 2)
    program, labels = with_functions(f"main\n{branches}{loop}{reads}done\n return")
    assert program.times(0) == Times(8 * 5 + rest + 8 + 2, 8 * 6 + rest + 8 + 2)
    assert program.between(0, {labels["done"]}).longest is None, "without a second try"


@pytest.mark.parametrize("limit", (1, 2, 5, 7, 8, 9))
def test_a_search_that_is_given_up_gives_a_lower_bound(limit: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of the eight instructions before `done` begins a state: paths part or meet there."""
    monkeypatch.setattr(wcet, "MAX_STATES", limit)
    program, labels = with_functions(
        "main\n btfss PORTB, 0\n goto left\n goto right\nleft\n btfss PORTB, 1\n goto right\n goto under\n"
        "right\n nop\nunder\n nop\ndone\n nop\n"
    )
    found = program.between(0, {labels["done"]})
    shortest, longest = 2 + 2 + 1 + 1, (1 + 2) + (1 + 2) + 1 + 1
    if limit < 8:
        assert found.longest is None
        assert found.shortest is not None and 0 < found.shortest <= shortest
        assert [each.kind for each in found.unbounded] == ["too many states"]
        assert program.longest(0, {labels["done"]}) is None
    else:
        assert found == Times(shortest, longest)


@pytest.mark.parametrize("jump", ["GOTO", "CALL"])
def test_a_jump_to_address_255_is_no_addition_of_255(jump: str) -> None:
    """MOVLW 1, the jump and the return 2 each; what follows it looks like the end of a loop that counts."""
    words = {
        0: encode("MOVLW", k=3), 1: encode(jump, k=255), 2: encode("BTFSS", f=3, b=2), 3: encode("GOTO", k=1),
        255: encode("RETURN"),
    }  # fmt: skip
    functions = [ListedFunction("f", 0, 255), ListedFunction("g", 255, 256)]
    program = TimedProgram(words, functions)
    assert program.between(0, {255}) == Times(1 + 2, 1 + 2)
