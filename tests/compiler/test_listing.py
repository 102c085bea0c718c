"""The listing tells of each function the stack and the shortest and longest time; the chip agrees."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.compiler.driver import LEVELS
from servogen.edges import PINS
from servogen.pic.listing import ListedFunction, listing_text
from servogen.simulator import Machine
from servogen.units import Clock

PROGRAM = """
unsigned char list[4], x, y;
unsigned int average(void) {{
  unsigned char i;
  unsigned int sum = 0;
  for (i = 0; i < 4; i++) sum += list[i];
  return sum / 4;
}}
void choose(void) {{
  if (x) y = 1;
  else {{ _delay(50); y = 2; }}
}}
void wait(void) {{ while (x) x--; }}
void main(void) {{
  TRISB = 0;
  x = {x};
  PORTB = 1;
  {call};
  RB0 = 0;
}}
"""


def build(call: str, x: int) -> tuple[dict[str, ListedFunction], int]:
    """The functions of the listing, and the cycles from the write of PORTB to the clearing of RB0."""
    found = compile_sources([Source(PROGRAM.format(call=call, x=x), "main.c")], Options(dialect="xc8"))
    edges = Machine(found.image, Clock(4_000_000)).run(20_000)
    times = [int(cycle) for cycle, pin in zip(edges.cycle, edges.pin, strict=True) if PINS[pin] == "RB0"]
    return {each.name: each for each in found.listing.functions}, times[-1] - times[-2]


CALL = 2
WRITE = 1


def test_a_loop_with_constant_bounds_is_counted() -> None:
    functions, measured = build("average()", 0)
    listed = functions["average"]
    assert listed.minimum_cycles == listed.maximum_cycles == measured - CALL - WRITE


@pytest.mark.parametrize(("x", "which"), [(1, "minimum_cycles"), (0, "maximum_cycles")])
def test_the_shortest_and_the_longest_way_are_those_of_the_two_branches(x: int, which: str) -> None:
    functions, measured = build("choose()", x)
    assert getattr(functions["choose"], which) == measured - CALL - WRITE


def test_a_loop_whose_bound_is_not_known_has_no_longest_time() -> None:
    functions, measured = build("wait()", 0)
    assert functions["wait"].minimum_cycles == measured - CALL - WRITE
    assert functions["wait"].maximum_cycles is None


def test_main_never_returns_and_has_no_times() -> None:
    functions, _ = build("wait()", 0)
    assert functions["main"].minimum_cycles is None
    assert functions["main"].deepest_calls == 1


LOOPS = """
unsigned char i, n;
unsigned int a, b, product;
void step(void) { PORTB = n; }
void global(void) { for (i = 0; i < 8; i++) step(); }
void down(void) { unsigned char left = 10; do { n++; } while (--left); }
void nested(void) { unsigned char x, y; for (x = 0; x < 5; x++) for (y = x; y < 5; y++) n++; }
void wide(void) { for (a = 0; a < 300; a++) PORTB = a; }
void multiply(void) { product = a * b; }
void divide(void) { product = a / b; }
void wait(void) {
  while (!RB1)
    ;
}
void waits(void) {
  do {
    for (i = 0; i < 3; i++) n++;
    if (n) wait();
  } while (RB2);
}
void jumps(void) {
again:
  if (RB3) goto again;
}
void store(void) { eeprom_write(1, 2); }
void main(void) {
  TRISB = 0;
  a = A;
  b = B;
  PORTB = 1;
  CALL();
  RB0 = 0;
  wait(); waits(); jumps(); store(); global(); down(); nested(); wide(); multiply(); divide();
  while (1) {
    n = 1;
  }
}
"""


def loops(call: str = "step", a: int = 0, b: int = 0) -> tuple[dict[str, ListedFunction], int]:
    text = LOOPS.replace("CALL", call).replace("= A;", f"= {a};").replace("= B;", f"= {b};")
    found = compile_sources([Source(text, "main.c")], Options(dialect="xc8"))
    edges = Machine(found.image, Clock(4_000_000)).run(20_000)
    times = [int(cycle) for cycle, pin in zip(edges.cycle, edges.pin, strict=True) if PINS[pin] == "RB0"]
    after = next((two - one for one, two in pairwise(times[1:])), 0)
    return {each.name: each for each in found.listing.functions}, after


@pytest.mark.parametrize("name", ["down", "nested"])
def test_loops_over_locals_and_inside_loops_are_counted(name: str) -> None:
    functions, measured = loops(name)
    assert functions[name].minimum_cycles == functions[name].maximum_cycles == measured - CALL - WRITE


def test_a_loop_over_a_global_variable_is_counted_over_calls_that_leave_it_alone() -> None:
    functions, _ = loops()
    step = functions["step"].maximum_cycles
    assert functions["global"].maximum_cycles == functions["global"].minimum_cycles
    assert functions["global"].maximum_cycles > 8 * (step + CALL)  # type: ignore[operator]
    assert functions["wide"].maximum_cycles == functions["wide"].minimum_cycles > 300 * 3  # type: ignore[operator]


@pytest.mark.parametrize("name", ["multiply", "divide"])
@pytest.mark.parametrize(("a", "b"), [(0, 1), (65535, 65535), (65535, 1), (1, 65535), (12345, 678)])
def test_multiplication_and_division_take_no_longer_than_listed(name: str, a: int, b: int) -> None:
    functions, measured = loops(name, a, b)
    listed = functions[name]
    assert listed.minimum_cycles <= measured - CALL - WRITE <= listed.maximum_cycles  # type: ignore[operator]


def test_the_longest_multiplication_is_nearly_reached() -> None:
    functions, measured = loops("multiply", 65535, 65535)
    assert functions["multiply"].maximum_cycles - (measured - CALL - WRITE) < 4 * 16  # type: ignore[operator]


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("wait", ("while at line 12",)),
        ("waits", ("call of wait at line 18", "do at line 16")),
        ("jumps", ("loop at line 23",)),
        ("store", ("call of __eeprom_write at line 25",)),
        ("__eeprom_write", ("waits for the EEPROM",)),
        ("step", ()),
    ],
)
def test_what_has_no_known_end_is_named(name: str, why: tuple[str, ...]) -> None:
    functions, _ = loops()
    assert functions[name].unbounded == why
    assert (functions[name].maximum_cycles is None) == bool(why)


def test_the_loop_of_main_is_named_and_the_text_shows_it() -> None:
    text = LOOPS.replace("CALL", "step").replace("= A", "= 1").replace("= B", "= 1")
    found = compile_sources([Source(text, "main.c")], Options(dialect="xc8"))
    listing = listing_text(found.listing)
    assert "main            unbounded: call of wait at line 33, " in listing
    assert "call of store at line 33, while at line 34\n" in listing
    assert "wait            unbounded: while at line 12\n" in listing
    assert next(line for line in listing.splitlines() if line.startswith("main ")).endswith("never returns")


def test_a_loop_of_too_many_turns_is_named() -> None:
    text = "void main(void) {\n  unsigned int n;\n  for (n = 0; n < 60000; n++)\n    if (RA0) PORTB = 1;\n}"
    found = compile_sources([Source(text, "main.c")], Options(dialect="xc8"))
    main = next(each for each in found.listing.functions if each.name == "main")
    assert main.unbounded == ("for at line 3, too long to be counted",)


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("body", ["if (d) while (1);", "if (d) for (;;);", "if (d) { stay: goto stay; }"])
def test_a_function_that_returns_or_stands_still_is_unbounded(body: str, level: str) -> None:
    text = f"unsigned char d;\nvoid t(void) {{ {body} }}\nvoid main(void) {{ t(); PORTB = 1; }}"
    found = compile_sources([Source(text, "main.c")], Options(dialect="xc8", optimise=level))
    listed = next(each for each in found.listing.functions if each.name == "t")
    (why,) = listed.unbounded
    assert why.endswith("at line 2") and listed.maximum_cycles is None
    assert listed.minimum_cycles  # the way past the loop


@pytest.mark.parametrize(("unit_us", "call"), [(1000, "delay_ms"), (10, "delay_10us")])
def test_a_variable_delay_is_longest_with_255(unit_us: int, call: str) -> None:
    text = f"char n;\nvoid main() {{ n = PORTB; {call}(n); }}"
    found = compile_sources([Source(text, "main.c")], Options(clock_hz=4_000_000))
    routine = next(each for each in found.listing.functions if each.name.startswith("__delay"))
    load_of_n = 1
    assert routine.maximum_cycles == 255 * unit_us - load_of_n - CALL


def test_a_loop_that_delays_share_is_timed_with_the_counters_of_all_its_calls() -> None:
    """MOVLW and CALL are the callers', and take three cycles of each delay."""
    first, second = (
        " PORTB = 1; ".join(f"_delay({cycles});" for cycles in delays)
        for delays in ((104, 108, 112), (100, 116, 120))
    )
    text = f"void f(void) {{ {second} PORTB = 2; }}\nvoid main(void) {{ {first} PORTB = 2; f(); }}"
    found = compile_sources([Source(text, "main.c")], Options(dialect="xc8"))
    shared = next(each for each in found.listing.functions if each.name == "__delay_loop1")
    assert (shared.minimum_cycles, shared.maximum_cycles) == (100 - 3, 120 - 3)


def test_the_programs_own_variables_come_before_what_the_compiler_needs() -> None:
    functions = "int f(int x, int y) { int z = x * y; return z / (x + 1); }"
    found = compile_sources([Source(f"int a;\n{functions}\nvoid main(void) {{ a = f(a, 3); }}", "main.c")])
    names = [name for _, name, _ in found.listing.variables]
    own = [name for name in names if "temporary" not in name]
    assert names[: len(own)] == own == sorted(own, key=names.index)
    assert {"a", "f.x", "f.y"} <= set(own) and not any(name.startswith("__") for name in own)


@pytest.mark.parametrize("level", LEVELS)
def test_the_labels_of_assembly_are_listed_with_their_addresses(level: str) -> None:
    text = """void main(void) {
      PORTB = 3;
      asm("spin: incf PORTB, F");
      asm("nop");
      asm("turn: goto spin");
      while (1) PORTB = 1;
    }"""
    made = compile_sources([Source(text, "main.c")], Options(dialect="xc8", optimise=level))
    words = {row.address: row.assembly for row in made.listing.rows}
    spin, turn = made.listing.label("spin"), made.listing.label("turn")
    assert [name for name, _ in made.listing.labels] == ["spin", "turn"]
    assert (words[spin], words[spin + 1]) == ("INCF PORTB, F", "NOP")
    assert turn == spin + 2
    assert words[turn] == f"GOTO 0x{spin:03X}"


def test_the_rows_name_their_file_as_the_sources_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where the file is given by its absolute path and is below the working directory."""
    monkeypatch.chdir(tmp_path)
    name = str(tmp_path / "main.c")
    made = compile_sources([Source("void main(void) { while (1) PORTB = 1; }", name)], Options())
    files = {row.file for row in made.listing.rows} - {None}
    assert files == {name}
    assert name in dict(made.listing.sources)
