"""The listing of a small program: rows as the data sheet writes them, variables, labels, times."""

from __future__ import annotations

from servogen.compiler import Options, Source, compile_sources
from servogen.compiler.ast.nodes import Symbol
from servogen.compiler.ast.types import U8, ArrayType
from servogen.compiler.diagnostics import Reporter
from servogen.compiler.emit.layout import MemoryMap, lay_out
from servogen.compiler.emit.listing import make_listing
from servogen.compiler.emit.timing import FunctionTimes, function_times
from servogen.compiler.ir.function import Function, LoopLines
from servogen.errors import Location
from servogen.pic.listing import Listing
from tests.compiler.cases import every
from tests.compiler.ir.assembly import Names, function


def listing(texts_: dict[str, str], memory: dict[str, int], names: Names) -> Listing:
    made = {name: function(text, names, name=name) for name, text in texts_.items()}
    where = MemoryMap({names[name]: address for name, address in memory.items()})
    reporter = Reporter()
    reporter.add_source("main.c", "text")
    layout = lay_out(list(made.values()), where, reporter, {}, small=True)
    times = {"main": FunctionTimes(4, None, ("while at line 3",))}
    return make_listing(layout, where, made, times, reporter)


def test_a_row_is_the_instruction_with_addresses_and_cycles() -> None:
    text = "MOVLW 200; MOVWF ga+1; DECFSZ ga,F; BTFSC Z; BSF TRISB,7; MOVF ga,W; CALL g; RETURN"
    found = listing({"main": text, "g": "RETLW 9"}, {"ga": 0x0C}, Names())
    assert [(row.assembly, row.cycles) for row in found.rows] == [
        ("MOVLW 0xC8", "1"), ("MOVWF 0x0D", "1"), ("DECFSZ 0x0C, F", "1(2)"), ("BTFSC STATUS, 2", "1(2)"),
        ("BSF TRISB, 7", "1"), ("MOVF 0x0C, W", "1"), ("CALL 0x008", "2"), ("RETURN", "2"),
        ("RETLW 0x09", "2"),
    ]  # fmt: skip
    assert [row.address for row in found.rows] == list(range(9))
    assert [(each.name, each.start, each.end, each.deepest_calls) for each in found.functions] == [
        ("main", 0, 8, 1),
        ("g", 8, 9, 0),
    ]
    main, g = found.functions
    assert (main.minimum_cycles, main.maximum_cycles, main.unbounded) == (4, None, ("while at line 3",))
    assert (g.minimum_cycles, g.maximum_cycles, g.unbounded) == (None, None, ())
    assert found.sources == (("main.c", "text"),)


def test_rows_name_their_place_and_labels_of_assembly_are_sorted_by_address() -> None:
    made = function("CLRF ga; *main.asm.b: CLRF ga; *main.asm.a: *main.asm.c: NOP; main.L.1: NOP")
    names = Names()
    made = function(
        "CLRF ga; *main.asm.b: CLRF ga; *main.asm.a: *main.asm.c: NOP; main.L.1: NOP", names, name="main"
    )
    next(made.instructions()).place = Location("main.c", 4)
    memory = MemoryMap({names["ga"]: 0x20})
    layout = lay_out([made], memory, Reporter(), {}, small=True)
    found = make_listing(layout, memory, {"main": made}, {}, Reporter())
    assert [(row.file, row.line) for row in found.rows[:2]] == [("main.c", 4), (None, None)]
    assert found.labels == (("b", 1), ("a", 2), ("c", 2))


def test_an_address_without_a_register_is_a_number_within_the_bank() -> None:
    """DS35007 figure 2-2: 0x07 is not implemented in either bank, 0x50 to 0x7F neither. FSR is in both."""
    places = "0x07", "0x87", "0x50", "0x85", "0x84"
    assembly = "".join(f'asm("clrf {place}"); ' for place in places)
    found = compile_sources([Source(f"void main(void) {{ {assembly} }}", "main.c")], Options(dialect="xc8"))
    assert [row.assembly for row in found.listing.rows[:5]] == [
        "CLRF 0x07", "CLRF 0x07", "CLRF 0x50", "CLRF TRISA", "CLRF FSR",
    ]  # fmt: skip


def test_the_programs_variables_come_first_then_runs_of_others() -> None:
    memory = MemoryMap(
        {
            Symbol("z", U8, "global"): 0x20,
            Symbol("a", ArrayType(U8, 3), "global"): 0x0C,
            Symbol("x", U8, "param", function="f"): 0x10,
            Symbol("t1", U8, "temp", function="f"): 0x11,
            Symbol("t2", U8, "temp", function="f"): 0x12,
            Symbol("t3", U8, "temp", function="f"): 0x12,
            Symbol("t4", U8, "temp", function="f"): 0x14,
            Symbol("result", ArrayType(U8, 2), "result", function="g"): 0x0F,
            Symbol("a", U8, "param", function="__mul"): 0x13,
        }
    )
    layout = lay_out([function("NOP", name="main")], memory, Reporter(), {}, small=True)
    found = make_listing(layout, memory, {"main": function("NOP", name="main")}, {}, Reporter())
    assert found.variables == (
        *((0x0C, "a", 3), (0x10, "f.x", 1), (0x20, "z", 1)),
        *((0x0F, "g (temporary)", 2), (0x11, "f (temporary)", 2)),
        *((0x13, "__mul (temporary)", 1), (0x14, "f (temporary)", 1)),
    )


def times(
    text: str, *, loops: list[LoopLines] | None = None, waits_for: str = "", **others: str
) -> FunctionTimes:
    names = Names()
    made = {"f": function(text, names)} | {
        name: function(each, names, name=name) for name, each in others.items()
    }
    for line, ins in enumerate(made["f"].instructions(), 1):
        ins.place = Location("main.c", line)
    made["f"].loops, made["f"].waits_for = loops or [], waits_for
    memory = MemoryMap({symbol: 0x20 + 4 * at for at, symbol in enumerate(names.symbols.values())})
    layout = lay_out(list(made.values()), memory, Reporter(), {}, small=True)
    return function_times(layout, made, main=made, interrupt=())["f"]


LOOP = "a: BTFSC PORTA,1; GOTO a; RETURN"


@every(
    ("text", "expected"),
    [
        ("NOP; RETURN", FunctionTimes(3, 3)),
        ("BTFSC PORTA,1; CLRF ga; RETURN", FunctionTimes(4, 4)),
        ("BTFSC PORTA,1; GOTO e; NOP; NOP; e: RETURN", FunctionTimes(5, 6)),
        (LOOP, FunctionTimes(4, None, ("loop at line 1",))),
        ("a: NOP; GOTO a", FunctionTimes(None, None, ("stands still at its end",))),
    ],
)
def test_the_times_of_a_function(text: str, expected: FunctionTimes) -> None:
    found = times(text)
    assert (found.shortest, found.longest) == (expected.shortest, expected.longest)
    if expected.unbounded and "stands" not in expected.unbounded[0]:
        assert found.unbounded == expected.unbounded
    assert bool(found.unbounded) == bool(expected.unbounded)


def test_a_loop_has_the_name_of_the_innermost_around_it() -> None:
    outer, inner = LoopLines("while", (1, 0), (9, 0)), LoopLines("for", (1, 0), (2, 0))
    beside = LoopLines("do", (5, 0), (9, 0))
    later = LoopLines("do", (2, 0), (9, 0))
    assert times(LOOP, loops=[outer]).unbounded == ("while at line 1",)
    assert times("NOP; NOP; " + LOOP, loops=[outer, LoopLines("for", (3, 0), (4, 0))]).unbounded == (
        "for at line 3",
    )
    assert times("NOP; NOP; " + LOOP, loops=[LoopLines("for", (3, 0), (4, 0)), outer]).unbounded == (
        "for at line 3",
    )
    assert times(LOOP, loops=[beside, later]).unbounded == ("loop at line 1",)
    assert times("NOP; " + LOOP, loops=[inner]).unbounded == ("loop at line 2",)
    assert times(LOOP, waits_for="the EEPROM").unbounded == ("waits for the EEPROM",)


def test_a_call_of_what_has_no_bound_is_named() -> None:
    found = times("NOP; CALL g; RETURN", g=LOOP)
    assert (found.shortest, found.longest) == (1 + 2 + 4 + 2, None)
    assert found.unbounded == ("call of g at line 2",)


def test_sleep_has_no_bound() -> None:
    assert times("NOP; SLEEP; RETURN").unbounded == ("SLEEP at line 2",)


def test_a_computed_jump_is_named() -> None:
    text = (
        '#include <xc.h>\nvoid f(void) {\n  asm("addwf PCL, f");\n  asm("nop");\n}\nvoid main(void) { f(); }'
    )
    made = compile_sources([Source(text, "main.c")], Options(dialect="xc8"))
    found = next(each for each in made.listing.functions if each.name == "f")
    assert any("a computed jump at line 3" in why for why in found.unbounded)


def test_only_what_is_reached_has_times() -> None:
    made = {"f": function("RETURN"), "g": function("RETURN", name="g")}
    layout = lay_out(list(made.values()), MemoryMap(), Reporter(), {}, small=True)
    assert function_times(layout, made, main=["f"], interrupt=()).keys() == {"f"}
    assert isinstance(made["f"], Function)
