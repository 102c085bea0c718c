"""`attach` to the chip of `servogen rig`: an editor and the devices of the bench at one chip."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

pytest.importorskip("websockets", reason="the server is of the extra watch")

from servogen.bench.inputs.wiring import input_wiring
from servogen.bench.virtual.board import VirtualBoard
from servogen.bench.virtual.chip import VirtualChip
from servogen.bench.virtual.debugger import VirtualDebugger
from servogen.bench.virtual.terminals import terminals
from servogen.cli.page_server import serving
from servogen.edges import PINS
from servogen.programs import read_program
from servogen.units import Clock
from tests.bench.conftest import served
from tests.dap.test_attach import Editor

RA0, RB7 = (PINS.index(name) for name in ("RA0", "RB7"))

SOURCE = """ list p=16f84a
 include "p16f84a.inc"
 cblock 0x0C
turns
 endc
 bsf STATUS, RP0
 bcf TRISA, 0
 bcf STATUS, RP0
 clrf turns
loop movf turns, w
 movwf PORTA
 incf turns, f
 btfss PORTB, 7
 goto loop
 clrf turns
 goto loop
 end
"""
"""RA0 toggles every 6 cycles, in cycles 5, 11, 17, …, with bit 0 of `turns`."""
OF_MOVWF, PERIOD = 5, 6


class Bench:
    """A chip with a debugger, and what its pins did: (cycle of the bench, level of RA0)."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        path = folder / "main.asm"
        path.write_text(SOURCE)
        program = read_program(path)
        self.debugger = VirtualDebugger(path, program)
        self.chip = VirtualChip(program.image, Clock(4_000_000), debugger=self.debugger)
        self.seen: list[tuple[int, int]] = []
        self.chip.listeners.append(
            lambda levels, _: self.seen.extend(
                (cycle, word >> RA0 & 1) for cycle, word in zip(*map(list, levels), strict=True)
            )
        )
        self.url = stack.enter_context(serving(self.debugger.attach))
        board = VirtualBoard(self.chip, input_wiring())
        stack.enter_context(served(stack.enter_context(terminals({"inputs": board}, self.debugger))))

    def edges(self) -> list[int]:
        """The cycles of the bench in which RA0 changed."""
        changes, before = [], 0
        for cycle, level in self.seen:
            if level != before:
                changes.append(int(cycle))
            before = level
        return changes


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with ExitStack() as stack:
        yield Bench(tmp_path, stack)


def test_an_editor_stops_steps_and_takes_back_the_chip_and_the_bench_sees_each_edge(bench: Bench) -> None:
    editor = Editor(bench.url)
    assert editor.attached["success"]
    given = {"source": {"path": "main.asm"}, "breakpoints": [{"line": 12, "condition": "turns == 3"}]}
    assert editor.ask("setBreakpoints", **given)["body"]["breakpoints"][0]["verified"]
    editor.ask("configurationDone")
    assert editor.event("stopped")["reason"] == "entry", "time does not pass by itself on this bench"
    editor.ask("continue", threadId=1)
    assert editor.event("stopped")["text"] == "main.asm:12"
    fourth = OF_MOVWF + 3 * PERIOD
    assert editor.cycle == fourth + 1 == bench.chip.now
    assert bench.edges() == [OF_MOVWF + PERIOD, OF_MOVWF + 2 * PERIOD, fourth]
    assert bench.chip.due(100) == 0, "a device that wants the chip to run waits"
    for _ in range(6):
        editor.ask("next", threadId=1)
        editor.event("stopped")
    assert bench.edges()[-1] == fourth + PERIOD, "what a step makes is seen, too"
    there, of_bench = editor.cycle, bench.chip.now
    editor.ask("reverseContinue", threadId=1)
    assert editor.event("stopped")["text"] == "main.asm:12"
    assert editor.cycle == fourth + 1 and bench.chip.now == of_bench, "the bench's time goes on"
    editor.ask("disconnect")
    while bench.debugger.stands:
        pass
    bench.chip.run(there - fourth - 1)
    assert bench.edges()[-1] - of_bench == PERIOD - 1, "the same edge again, as late after this moment"


def test_what_the_bench_did_to_a_pin_is_done_again_until_it_does_something_else(bench: Bench) -> None:
    """With RB7 high the program counts from 0 again."""
    bench.chip.run(100)
    bench.chip.drive(RB7, 1)
    bench.chip.run(100)
    editor = Editor(bench.url)
    editor.ask("configurationDone")

    def to(name: str, request: str) -> int:
        editor.ask("setFunctionBreakpoints", breakpoints=[{"name": name}])
        editor.ask(request, threadId=1)
        while editor.event("stopped")["text"] != name:
            pass
        return editor.cycle

    fifth = OF_MOVWF + 4 * PERIOD + 2
    assert to("turns == 5", "reverseContinue") == fifth
    assert to("turns == 0", "continue") == 106, "cleared after the first look at RB7 from cycle 100 on"
    assert to("turns == 5", "reverseContinue") == fifth
    bench.chip.drive(RB7, 0)
    assert to("turns == 20", "continue") == fifth + 15 * PERIOD, "RB7 stays low now"


def test_a_chip_that_is_programmed_ends_the_session_and_one_editor_at_a_time_is_let_in(bench: Bench) -> None:
    editor = Editor(bench.url)
    second = Editor(bench.url)
    assert "another editor debugs the chip of this bench" in second.attached["message"]
    assert "of its chip only" in editor.ask("launch", program="main.asm")["message"]
    bench.chip.load(bench.chip.contents())
    assert "attach again" in editor.event("output")["output"]
    editor.event("terminated")
    assert Editor(bench.url).attached["success"]
