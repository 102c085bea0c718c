"""The depth of calls on the chip's stack of eight levels (DS35007 section 2.3)."""

from __future__ import annotations

from servogen.compiler.diagnostics import Reporter
from servogen.compiler.ir.function import Function
from servogen.compiler.passes.call_depth import check_stack, depths, room_for_calls
from servogen.errors import Location
from tests.compiler.cases import every
from tests.compiler.ir.assembly import function


def program(**texts: str) -> dict[str, Function]:
    made = {name: function(text, name=name) for name, text in texts.items()}
    made["start"] = Function("start", falls_into="main")
    return made


def chain(levels: int, prefix: str = "f") -> dict[str, str]:
    """Functions each of which calls the next one."""
    made = {f"{prefix}{at}": f"NOP; CALL {prefix}{at + 1}; RETURN" for at in range(1, levels)}
    return {**made, f"{prefix}{levels}": "RETURN"}


def test_the_longest_chain_below_each_function() -> None:
    made = program(
        main="CALL a; CALL b; GOTO c", a="RETURN", b="CALL d; RETURN", c="CALL b; RETURN", d="RETURN"
    )
    assert depths(made) == {
        "main": ["b", "d"], "a": [], "b": ["d"], "c": ["b", "d"], "d": [], "start": ["b", "d"],
    }  # fmt: skip


def test_a_jump_into_a_function_takes_no_level() -> None:
    made = program(main="CALL a; RETURN", a="GOTO b", b="GOTO c", c="CALL d; RETURN", d="RETURN")
    assert depths(made)["main"] == ["a", "d"]
    made["d"].also_calls = ("e",)
    made["e"] = function("RETURN", name="e")
    assert depths(made)["main"] == ["a", "d", "e"]
    made["d"].also_calls, made["d"].also_jumps_to = (), ("e",)
    assert depths(made)["main"] == ["a", "d"]
    made["e"] = function("CALL f; RETURN", name="e")
    made["f"] = function("RETURN", name="f")
    assert depths(made)["main"] == ["a", "d", "f"]
    assert depths(program(main="CALL elsewhere; GOTO main"))["main"] == []


def test_calls_in_a_circle_end() -> None:
    made = program(main="CALL a; RETURN", a="CALL b; RETURN", b="CALL a; RETURN")
    assert len(depths(made)["main"]) <= 3


@every("levels", [7, 8])
def test_there_is_room_up_to_eight_levels(levels: int) -> None:
    made = program(main="CALL f1; RETURN", **chain(levels))
    room = room_for_calls(made, ["start"])
    # a call from the function at depth n goes to depth n + 1
    assert room == {"start": True, "main": True} | {f"f{at}": at < 8 for at in range(1, levels + 1)}


def test_nine_levels_are_reported_with_their_path() -> None:
    made = program(main="CALL f1; RETURN", **chain(9))
    made["main"].place = Location("main.c", 7)
    reporter = Reporter()
    assert room_for_calls(made, ["start"]) is None
    assert check_stack(made, ["start"], reporter) == {}
    (found,) = reporter.failure().diagnostics
    path = " → ".join(["main", *(f"f{at}" for at in range(1, 10))])
    assert found.code == "c-call-depth"
    assert found.message == f"calls are nested 9 levels deep, the chip's stack has 8: {path}"
    assert found.location == Location("main.c", 7)


def test_the_interrupt_takes_a_level_and_what_it_calls() -> None:
    made = program(main="CALL f1; RETURN", isr="CALL i1; RETFIE", **chain(5), **chain(2, "i"))
    room = room_for_calls(made, ["start", "isr"])
    assert room is not None
    # 5 levels of main, one of the interrupt, 2 below it: all eight
    assert room["f5"] is False and room["f4"] is True
    assert room["i2"] is False and room["i1"] is True
    made["i2"] = function("CALL i3; RETURN", name="i2")
    made["i3"] = function("RETURN", name="i3")
    assert room_for_calls(made, ["start", "isr"]) is None
    reporter = Reporter()
    check_stack(made, ["start", "isr"], reporter)
    (found,) = reporter.failure().diagnostics
    assert found.message == (
        "calls are nested 9 levels deep, the chip's stack has 8: main → f1 → f2 → f3 → f4 → f5, "
        "and the interrupt's i1 → i2 → i3"
    )
    made["isr"] = function("RETFIE", name="isr")
    made["f5"] = function("CALL f6; RETURN", name="f5")
    made |= {each.name: each for each in (function("CALL f7; RETURN", name="f6"),)}
    made["f7"] = function("CALL f8; RETURN", name="f7")
    made["f8"] = function("RETURN", name="f8")
    reporter = Reporter()
    check_stack(made, ["start", "isr"], reporter)
    assert reporter.failure().diagnostics[0].message.endswith("f8, and the interrupt's own level")


def test_a_function_has_room_only_if_it_has_on_every_path() -> None:
    texts = {**chain(7), "f1": "CALL f2; CALL deep; RETURN", "f7": "CALL deep; RETURN", "deep": "RETURN"}
    made = program(main="CALL deep; CALL f1; RETURN", **texts)
    room = room_for_calls(made, ["start"])
    assert room is not None and room["deep"] is False and room["f7"] is True
    assert "elsewhere" not in room


def test_a_jump_into_a_function_leaves_the_level() -> None:
    made = program(main="GOTO f1", **chain(8))
    assert room_for_calls(made, ["start"]) is not None
    made["f8"] = function("GOTO f9", name="f8")
    made["f9"] = function("RETURN", name="f9")
    room = room_for_calls(made, ["start"])
    # main jumps to f1 at depth 0: f8 and f9 are at depth 7
    assert room is not None and room["f9"] is True
