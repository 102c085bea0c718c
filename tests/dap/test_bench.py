"""`attach` to the chip of `servogen rig`: an editor and the devices of the bench at one chip."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

pytest.importorskip("websockets", reason="the server is of the extra watch")

from servogen.bench.inputs.wiring import input_wiring
from servogen.bench.virtual.board import VirtualBoard
from servogen.bench.virtual.chip import SecondChip, VirtualChip
from servogen.bench.virtual.debugger import VirtualDebugger
from servogen.bench.virtual.terminals import terminals
from servogen.cli.page_server import serving
from servogen.edges import OTHER_PINS, PINS
from servogen.pic.image import Image
from servogen.programs import read_program
from servogen.simulator import FirstChip, Machine, PairedMachine, SimulatorOptions, Stimulus
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
CLOCK = Clock(4_000_000)


class Bench:
    """A chip with a debugger, and what its pins did: (cycle of the bench, level of RA0)."""

    def __init__(self, folder: Path, stack: ExitStack, second: SecondChip | None = None) -> None:
        path = folder / "main.asm"
        path.write_text(SOURCE)
        program = read_program(path)
        self.debugger = VirtualDebugger(path, program)
        self.chip = VirtualChip(program.image, CLOCK, debugger=self.debugger, second=second)
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


def test_of_two_chips_the_first_is_debugged_which_the_editor_is_told_and_the_edges_of_both_are_seen(
    tmp_path: Path,
) -> None:
    """The second one has the same program, a cycle later. Connected pins are followed edge by edge."""

    def beside(first: Image, second: Image, stimulus: Stimulus | None) -> PairedMachine:
        other = Machine(second, CLOCK)
        leading = FirstChip(lambda: Machine(first, CLOCK), RB7, RB7)
        return PairedMachine(first, CLOCK, SimulatorOptions(), stimulus, other, (RB7, RB7), leading)

    (tmp_path / "second.asm").write_text(SOURCE.replace("loop movf", " nop\nloop movf"))
    second = SecondChip(read_program(tmp_path / "second.asm").image, beside)
    with ExitStack() as stack:
        bench = Bench(tmp_path, stack, second)
        seen: dict[int, int] = {}
        bench.chip.listeners.append(lambda levels, _: seen.update(zip(*map(list, levels), strict=True)))
        bench.chip.connect(frozenset({RB7 - 1, RB7 - 2}), closed=True)
        editor = Editor(bench.url)
        assert "of the two chips the first is debugged" in editor.event("output")["output"]
        editor.ask("setFunctionBreakpoints", breakpoints=[{"name": "turns == 5"}])
        editor.ask("configurationDone")
        editor.ask("continue", threadId=1)
        while editor.event("stopped")["text"] != "turns == 5":
            pass
        machine = bench.chip.machine
        assert isinstance(machine, PairedMachine)
        assert editor.cycle == machine.cycles == machine.other.cycles == OF_MOVWF + 4 * PERIOD + 2
    for number in (2, 3, 4):
        edge = OF_MOVWF + (number - 1) * PERIOD
        levels = [[seen[edge + late] >> pin & 1 for pin in (RA0, OTHER_PINS + RA0)] for late in (0, 1)]
        turned = (number - 1) % 2
        assert levels == [[turned, 1 - turned], [turned, turned]]
