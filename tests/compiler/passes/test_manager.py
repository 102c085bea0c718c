"""Which passes are run over which functions, and how long."""

from __future__ import annotations

import pytest

from servogen.compiler.ir.function import Function
from servogen.compiler.ir.verifier import MalformedIR
from servogen.compiler.passes.manager import JUMPS, PASSES, RETURNS, TAILS, VALUES, PassManager
from tests.compiler.cases import every
from tests.compiler.ir.assembly import Names, function, lines, texts

TEXT = "MOVLW 1; MOVLW 2; MOVWF ga; GOTO a; a: CALL g; RETURN"


@every(
    ("name", "text", "after"),
    [
        ("f", TEXT, "MOVLW 2; MOVWF ga; GOTO g"),
        # main never returns, so that nothing jumps in its place
        ("main", TEXT, "MOVLW 2; MOVWF ga; CALL g; RETURN"),
        # routines of the library are written by hand: only jumps change
        ("__f", TEXT, "MOVLW 1; MOVLW 2; MOVWF ga; CALL g; RETURN"),
    ],
)
def test_which_passes_a_function_goes_through(name: str, text: str, after: str) -> None:
    made = function(text, name=name)
    PassManager(verify_ir=True).optimise(made)
    assert texts(made) == lines(after)


@every(("jump", "kept"), [("*GOTO a", True), ("*CALL g", True), ("*BTFSC Z", True), ("*NOP", False)])
def test_assembly_that_jumps_hides_where_control_goes(jump: str, kept: bool) -> None:
    text = f"MOVLW 1; {jump}; MOVLW 1; MOVWF ga; *a: RETURN"
    made = function(text)
    made.inline_asm = True
    PassManager().optimise(made)
    assert (texts(made) == lines(text)) == kept


def test_a_pass_that_changed_nothing_waits_until_another_has_changed_something() -> None:
    calls: list[str] = []

    def named(name: str, changes: int) -> object:
        left = [changes]

        def run(made: Function) -> bool:
            calls.append(name)
            left[0] -= 1
            return left[0] >= 0

        return run

    manager, settled = PassManager(), set[str]()
    passes = {"one": named("one", 0), "two": named("two", 1)}
    assert manager.run(passes, function("RETURN"), settled)  # type: ignore[arg-type]
    assert settled == set() and calls == ["one", "two"]
    assert not manager.run(passes, function("RETURN"), settled)  # type: ignore[arg-type]
    assert settled == {"one", "two"} and calls == ["one", "two"] * 2
    assert not manager.run(passes, function("RETURN"), settled)  # type: ignore[arg-type]
    assert calls == ["one", "two"] * 2 and manager.runs == {"one": 2, "two": 2}


def test_instructions_that_a_pass_adds_count_against_it() -> None:
    def longer(made: Function) -> bool:
        made.replace([*function("NOP; NOP").lines(), *made.lines()])
        return True

    manager = PassManager()
    manager.run({"longer": longer}, function("RETURN"), set())
    assert manager.saved == {"longer": -2}


def test_the_observer_sees_every_function_but_tables() -> None:
    seen: list[tuple[str, str]] = []
    manager = PassManager(after_pass=lambda name, made: seen.append((name, made.name)))
    table = function("RETURN", name="t")
    table.table = Names()["g"]
    manager.finished_all("bank-select", {"f": function("RETURN"), "t": table})
    assert seen == [("bank-select", "f")]
    manager.run({"nothing": lambda made: False}, function("RETURN"), set())
    assert seen[1:] == [("nothing", "f")]
    broken = function("NOP; a: RETURN")
    broken.blocks[0].instructions.clear()
    with pytest.raises(MalformedIR, match="f, after outlining: "):
        PassManager(verify_ir=True).finished("outlining", broken)


def test_the_names_of_the_passes_are_in_the_order_in_which_they_run() -> None:
    """As docs/compiler.md lists them for `--dump ir:pass`."""
    assert PASSES[:2] == ("codegen", "startup")
    assert PASSES[-3:] == ("bank-select", "outlining", "delays")
    assert PASSES[2:-3] == tuple(dict.fromkeys((*JUMPS, *VALUES, *TAILS, *RETURNS)))
    assert len(set(PASSES)) == len(PASSES)
