"""Delays: the fewest words of two families of loops, and which delays share a routine."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

from servogen.compiler.emit.delay_loops import LoopNest, filler, instructions, plan
from servogen.compiler.emit.delays import Entry, counters, expand_delays
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import Instruction
from tests.compiler.cases import every
from tests.compiler.ir.assembly import Chip, Names, function, texts


def cycles_of(counts: tuple[int, ...], in_w: bool) -> int:
    """The cycles of nested loops, level by level as a stopwatch sees them (counts: innermost first)."""
    total = 2 * len(counts) - in_w  # MOVLW and MOVWF for each counter, one of them less in W
    body = 0
    for level, count in enumerate(counts):
        one, last = (4, 3) if level == 0 and in_w else (3, 2)
        # below the first turn, the inner counters count 256 each
        whole = 0
        for inner in range(level):
            step = (4, 3) if inner == 0 and in_w else (3, 2)
            whole = 256 * whole + 255 * step[0] + step[1]
        body += (count - 1) * (one + whole) + last
    return total + body


def one_or_two_loops() -> dict[int, tuple[int, int]]:
    """The (words, bytes) of each count of cycles that one or two loops take by themselves."""
    found: dict[int, tuple[int, int]] = {}
    for in_w in (True, False):
        nests: list[tuple[int, ...]] = [(inner,) for inner in range(1, 257)]
        nests += [(inner, outer) for inner, outer in product(range(1, 257), range(1, 8))]
        for counts in nests:
            price = 4 * len(counts), len(counts) - in_w
            cycles = cycles_of(counts, in_w)
            found[cycles] = min(found.get(cycles, price), price)
    return found


def test_no_other_loops_of_these_families_take_fewer_words() -> None:
    loops = one_or_two_loops()
    for cycles in [*range(120), *range(760, 790), *range(1015, 1060), *range(1540, 1570), *range(2050, 2100)]:
        prices = [
            (loops[cycles - rest][0] + rest // 2 + rest % 2, loops[cycles - rest][1], rest)
            for rest in range(13)
            if cycles - rest in loops
        ]
        if cycles <= 16:
            prices.append((cycles // 2 + cycles % 2, 0, cycles))
        best = plan(cycles)
        assert (best.words, best.bytes, best.rest) == min(prices), cycles


def ends() -> Iterator[int]:
    """Counts of cycles around the ends of what one to four loops can wait."""
    for levels, in_w in product((1, 2, 3, 4), (True, False)):
        for counts in ((256,) * levels, (1,) * levels):
            most = cycles_of(counts, in_w)
            yield from (most + step for step in (-1, 0, 1, 2, 3, 4, 11, 12, 13, 14))


@every("cycles", sorted({each for each in ends() if each >= 0}))
def test_a_plan_takes_exactly_its_cycles(cycles: int) -> None:
    best = plan(cycles)
    used = cycles_of(best.counts, best.in_w) if best.counts else 0
    assert used + best.rest == cycles
    assert all(1 <= count <= 256 for count in best.counts)
    assert best.rest <= 16
    code = instructions(best, list(_places(best.bytes)), "f.delay")
    assert sum(isinstance(each, Instruction) for each in code) == best.words
    assert all(each.fixed for each in code)


def _places(count: int) -> Iterator[object]:
    names = Names()
    return (names.loc(f"t{at}") for at in range(count))


@every("cycles", [*range(40), 100, 768, 769, 1023, 1024, 1025, 1037, 1300, 2100])
def test_the_instructions_of_a_plan_take_its_cycles(cycles: int) -> None:
    best = plan(cycles)
    made = Function("f")
    made.extend(instructions(best, list(_places(best.bytes)), "f.delay"))  # type: ignore[arg-type]
    chip = Chip({"f": made})
    chip.call("f")
    assert chip.cycles == cycles


def test_the_loops_as_instructions() -> None:
    names = Names()
    places = [names.loc("t1"), names.loc("t2")]
    assert texts(instructions(LoopNest((256, 7), True, 3), places, "d")) == [
        *("*MOVLW 7", "*MOVWF t1", "*MOVLW 0", "*d:", "*ADDLW 255", "*BTFSS Z", "*GOTO d"),
        *("*DECFSZ t1,F", "*GOTO d", "*GOTO d.f0", "*d.f0:", "*NOP"),
    ]
    assert texts(instructions(LoopNest((5, 256), False, 0), places, "d")) == [
        *("*MOVLW 0", "*MOVWF t2", "*MOVLW 5", "*MOVWF t1", "*d:"),
        *("*DECFSZ t1,F", "*GOTO d", "*DECFSZ t2,F", "*GOTO d"),
    ]
    assert texts(filler(0, "d")) == []
    assert texts(filler(1, "d")) == ["NOP"]
    assert texts(filler(4, "d")) == ["GOTO d.f0", "d.f0:", "GOTO d.f1", "d.f1:"]
    assert [
        LoopNest(counts, in_w, rest).words for counts, in_w, rest in (((), False, 5), ((1, 1), True, 4))
    ] == [3, 10]
    assert [
        LoopNest(counts, in_w, 0).bytes for counts, in_w in (((), True), ((1,), True), ((1, 1), False))
    ] == [0, 0, 2]


def expanded(*delays: str, room: bool = True, interrupt: bool = False) -> dict[str, Function]:
    """One function for each text, after its delays were expanded."""
    made = {f"f{at}": function(text, name=f"f{at}") for at, text in enumerate(delays)}
    expand_delays(made, dict.fromkeys(made, room), set(made) if interrupt else set())
    return made


def words(made: dict[str, Function]) -> int:
    return sum(each.size for each in made.values())


def separate(*lengths: int) -> str:
    """Delays that no neighbour can be merged with."""
    return "; ".join(f"DELAY {length}; NOP" for length in lengths)


@every(
    ("lengths", "expected", "routines"),
    [
        # in place: MOVLW, ADDLW, BTFSS, GOTO: four cycles a turn
        ((100,), 4, set()), ((101,), 5, set()), ((2000,), 9, set()),
        # a routine of its own: a CALL each, the loop, a RETURN
        ((100,) * 2, 7, {"__delay_100"}), ((100,) * 9, 14, {"__delay_100"}),
        # two words each and a loop of four; equally long in place is better left there
        ((100, 104), 8, set()), ((100, 104, 108), 10, {"__delay_loop1"}),
        # with as many NOPs in front as cycles are left over
        ((100, 101, 102), 12, {"__delay_loop1"}),
        # 103 is a loop in memory, three cycles a turn, without a cycle left over
        ((100, 103, 108), 12, set()),
        # the greatest of the loop with one counter, and those of two: four words each and a loop of six
        ((1028, 1024, 1020), 10, {"__delay_loop1"}), ((2000, 3000, 4000), 20, {"__delay_loop2"}),
        # CLRF, BSF and GOTO set the same outer counter for all
        ((1500, 1540, 1580, 1620), 17, {"__delay_loop2", "__delay_turns2"}),
        ((2527, 2567, 2607, 2647), 18, {"__delay_loop2", "__delay_turns3"}),
        ((1500,) * 4, 14, {"__delay_1500"}),
    ],
)  # fmt: skip
def test_the_words_of_delays(lengths: tuple[int, ...], expected: int, routines: set[str]) -> None:
    made = expanded(separate(*lengths))
    assert words(made) - len(lengths) == expected
    assert set(made) - {"f0"} >= routines and bool(set(made) - {"f0"}) == bool(routines)
    chip = Chip(made)
    chip.call("f0")
    assert chip.cycles == sum(lengths) + len(lengths)


def test_adjacent_delays_are_one() -> None:
    assert words(expanded("DELAY 60; DELAY 40; NOP")) == 5
    assert words(expanded("DELAY 60; NOP; DELAY 40")) == 9 + 0
    assert words(expanded("DELAY 60; a: DELAY 40; NOP")) == 9
    # ten and twenty turns of the same length are cheaper apart, where the sums differ
    texts_ = [f"DELAY {at}; DELAY 500; NOP" for at in (600, 604, 608, 612, 616, 620)]
    for delays in (texts_, [*texts_, "DELAY 1100; NOP"]):
        made = expanded(*delays)
        chip = Chip(made)
        chip.call("f2")
        assert chip.cycles == 608 + 500 + 1


@every(
    ("entry", "least", "most"),
    [
        # MOVLW, CALL, ADDLW, BTFSS skipping, RETURN: 8 cycles; 4 for each further turn, 5 may be left over
        (Entry(1), 8, 8 + 4 * 255 + 5),
        # MOVLW, MOVWF and DECFSZ skipping take 4 more; 1026 for each further turn of the outer counter
        (Entry(2), 12, 12 + 4 * 255 + 1026 * 255 + 5),
        # CLRF, BSF for each bit and GOTO instead of MOVLW and MOVWF; bit 8 of 256 is none
        (Entry(2, 2), 12 + 1026 + 2, 12 + 1026 + 2 + 4 * 255 + 5),
        (Entry(2, 3), 12 + 2052 + 3, 12 + 2052 + 3 + 4 * 255 + 5),
        (Entry(2, 256), 12 + 255 * 1026 + 1, 12 + 255 * 1026 + 1 + 4 * 255 + 5),
    ],
)
def test_a_shared_loop_reaches_every_delay_of_its_range(entry: Entry, least: int, most: int) -> None:
    assert entry.fit(least - 1) is None and entry.fit(most + 1) is None
    setting = len(entry.bits) + 1 if entry.turns else 0
    ends = [*range(least, least + 1100), *range(most - 1100, most + 1)]
    for cycles in {each for each in ends if least <= each <= most}:
        fitted = entry.fit(cycles)
        assert fitted is not None, cycles
        inner, outer, rest = fitted
        assert 1 <= inner <= 256 and 1 <= outer <= 256 and 0 <= rest <= 5
        alone = 4 * (inner - 1) + (8 if entry.counters == 1 else 12)
        assert alone + 1026 * (outer - 1) + setting + rest == cycles


def test_without_a_level_of_the_stack_every_delay_is_in_place() -> None:
    made = expanded(separate(*(100,) * 5), room=False)
    assert set(made) == {"f0"} and words(made) == 5 * 4 + 5


def test_the_interrupt_has_routines_of_its_own() -> None:
    made = expanded(separate(100, 104, 108), interrupt=True)
    assert set(made) == {"f0", "__delay_loop1$isr"}
    made = expanded(separate(*(1500,) * 9), interrupt=True)
    assert all(name.endswith("$isr") for name in made if name != "f0") and len(made) > 1
    both = {
        "f0": function(separate(100, 104, 108), name="f0"),
        "f1": function(separate(100, 104, 108), name="f1"),
    }
    expand_delays(both, dict.fromkeys(both, True), {"f1"})
    assert set(both) == {"f0", "f1", "__delay_loop1", "__delay_loop1$isr"}


def test_a_shared_loop_is_entered_as_many_nops_early_as_cycles_are_left_over() -> None:
    made = expanded(separate(100, 102, 105, 109))
    assert texts(made["__delay_loop1"]) == [
        *(
            "*__delay_loop1.2:", "*NOP", "*__delay_loop1.1:", "*NOP", "*__delay_loop1:",
            "*__delay_loop1.loop:",
        ),
        *("*ADDLW 255", "*BTFSS Z", "*GOTO __delay_loop1.loop", "*RETURN"),
    ]  # fmt: skip
    assert texts(made["f0"])[:5] == [
        "*MOVLW 24", "*CALL __delay_loop1", "NOP", "*MOVLW 24", "*CALL __delay_loop1.2",
    ]  # fmt: skip
    assert made["f0"].also_calls == ("__delay_loop1",) * 4
    assert made["f0"].calls() == [
        "__delay_loop1",
        "__delay_loop1.2",
        "__delay_loop1.1",
        *["__delay_loop1"] * 4,
    ]


def test_a_routine_that_sets_the_outer_counter() -> None:
    made = expanded(separate(1500, 1540, 1580, 1620))
    assert texts(made["__delay_turns2"]) == [
        *("*__delay_turns2:", "*CLRF count", "*BSF count,1", "*GOTO __delay_loop2"),
    ]
    # 1500 = MOVLW, CALL, CLRF, BSF, GOTO, 1026 of the outer turn, 4 of each inner one, DECFSZ, RETURN
    assert texts(made["f0"])[:2] == ["*MOVLW 116", "*CALL __delay_turns2"]


@every("length", [*range(1024, 1048), 2046, 2047, 2064, 2065, 2070, 2080])
def test_shared_loops_are_exact_at_the_ends_of_their_ranges(length: int) -> None:
    lengths = (length, length + 4, length + 8, length + 9, 500, 504, 508, 3000, 3026)
    made = expanded(separate(*lengths))
    chip = Chip(made)
    chip.call("f0")
    assert chip.cycles == sum(lengths) + len(lengths)


def test_the_ends_of_a_delay_are_noted_where_it_is_longer_than_two_words() -> None:
    made = expanded("NOP; DELAY 4; NOP; DELAY 5; NOP; DELAY 50", room=False)["f0"]
    code = list(made.instructions())
    assert [(code.index(one), code.index(two)) for one, two in made.delays] == [(4, 6), (8, 12)]


def test_the_delays_of_a_function_use_the_same_counters() -> None:
    made = expanded(separate(770, 5000, 90_000_000), room=False)["f0"]
    assert [symbol.name for symbol in made.own] == ["delay_counter1", "delay_counter2", "delay_counter3"]
    assert counters(made, 2) == counters(made, 3)[:2]
    assert len(made.own) == 3
