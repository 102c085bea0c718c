"""The listing tells of each function the stack and the shortest and longest time; the chip agrees."""

from __future__ import annotations

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.edges import PINS
from servogen.pic.listing import ListedFunction
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
    assert listed.least_cycles == listed.most_cycles == measured - CALL - WRITE


@pytest.mark.parametrize(("x", "which"), [(1, "least_cycles"), (0, "most_cycles")])
def test_the_shortest_and_the_longest_way_are_those_of_the_two_branches(x: int, which: str) -> None:
    functions, measured = build("choose()", x)
    assert getattr(functions["choose"], which) == measured - CALL - WRITE


def test_a_loop_whose_bound_is_not_known_has_no_longest_time() -> None:
    functions, measured = build("wait()", 0)
    assert functions["wait"].least_cycles == measured - CALL - WRITE
    assert functions["wait"].most_cycles is None


def test_main_never_returns_and_has_no_times() -> None:
    functions, _ = build("wait()", 0)
    assert functions["main"].least_cycles is None
    assert functions["main"].deepest_calls == 1
