"""Equal runs become one subroutine: which runs, what they save, and what is never moved."""

from __future__ import annotations

from servogen.compiler.ir.function import Function
from servogen.compiler.passes.outlining import outline
from tests.compiler.cases import every
from tests.compiler.ir.assembly import Names, function, texts

RUN = "INCF ga,F; DECF gb,F; COMF gc,F; SWAPF gd,F; RLF ge,F"


def run(length: int) -> str:
    return "; ".join(RUN.split("; ")[:length])


def program(names: Names | None = None, **functions: str) -> dict[str, Function]:
    names = names or Names()
    main = "".join(f"CALL {name}; " for name in functions) + "RETURN"
    made = {"main": function(main, names, name="main")}
    return made | {name: function(text, names, name=name) for name, text in functions.items()}


def shared(made: dict[str, Function]) -> dict[str, list[str]]:
    return {name: texts(each) for name, each in made.items() if name.startswith("__shared")}


def between(text: str, number: int) -> str:
    return f"CLRF p{number}; {text}; CLRF q{number}; RETURN".replace("p", "gp").replace("q", "gq")


@every(("places", "length", "saved"), [(2, 3, 0), (2, 4, 1), (2, 5, 2), (3, 3, 2), (4, 2, 1)])
def test_the_words_saved(places: int, length: int, saved: int) -> None:
    """Each place keeps one word of the run, and the subroutine has the run and a RETURN."""
    made = program(**{f"f{at}": between(run(length), at) for at in range(places)})
    before = sum(each.size for each in made.values())
    assert places * (length - 1) - length - 1 == saved or saved == 0
    assert outline(made, ["main"]) == saved
    assert before - sum(each.size for each in made.values()) == saved
    assert shared(made) == ({"__shared_1": [*run(length).split("; "), "RETURN"]} if saved else {})
    if saved:
        assert texts(made["f1"]) == ["CLRF gp1", "CALL __shared_1", "CLRF gq1", "RETURN"]


def test_a_run_that_ends_its_function_needs_no_call() -> None:
    made = program(f0=f"CLRF gp; {run(2)}; RETURN", f1=f"CLRF gq; {run(2)}; RETURN")
    assert outline(made, ["main"]) == 1
    assert shared(made) == {"__shared_1": [*run(2).split("; "), "RETURN"]}
    assert texts(made["f0"]) == ["CLRF gp", "GOTO __shared_1"]


def test_a_run_that_ends_in_a_call_jumps_there() -> None:
    made = program(f0=between(f"{run(2)}; CALL h", 0), f1=between(f"{run(2)}; CALL h", 1), h="RETURN")
    assert outline(made, ["main"]) == 1
    assert shared(made) == {"__shared_1": [*run(2).split("; "), "GOTO h"]}
    assert texts(made["f0"]) == ["CLRF gp0", "CALL __shared_1", "CLRF gq0", "RETURN"]


def test_a_call_that_may_be_skipped_and_one_that_reads_a_table_return() -> None:
    skipped = program(
        f0=between(f"{run(3)}; BTFSC gx,1; CALL h", 0),
        f1=between(f"{run(3)}; BTFSC gx,1; CALL h", 1),
        h="NOP; RETURN",
    )
    assert outline(skipped, ["main"]) == 2
    assert shared(skipped)["__shared_1"][-2:] == ["CALL h", "RETURN"]
    table = program(f0=between(f"{run(3)}; CALL h", 0), f1=between(f"{run(3)}; CALL h", 1), h="NOP; RETURN")
    for name in ("f0", "f1"):
        next(ins for ins in table[name].instructions() if ins.op == "CALL").table = Names()["g"]
    assert outline(table, ["main"]) == 1
    assert shared(table)["__shared_1"][-2:] == ["CALL h", "RETURN"]


FIRST, SECOND = "INCF ga,F; DECF gb,F", "COMF gc,F; SWAPF gd,F"


@every(
    "text",
    [
        f"CLRF gp{{0}}; {run(4).replace('DECF gb,F', '*DECF gb,F')}; RETLW {{0}}",
        f"CLRF gp{{0}}; DELAY 9; {run(4)}; RETLW {{0}}",
        f"CLRF gp{{0}}; DELAY 9; a: {run(4)}; b: RETLW {{0}}",
        f"CALL __delay_5; {run(4)}; RETLW {{0}}",
        f"CLRF gp{{0}}; GOTO a; a: {run(4)}; b: DELAY {{0}}; RETURN",
        f"CLRF gp{{0}}; {FIRST}; a: {SECOND}; RETLW {{0}}",
        f"CLRF gp{{0}}; {FIRST}; GOTO a; a: {SECOND}; RETLW {{0}}",
        f"BTFSC gx,{{0}}; {run(4)}; RETLW {{0}}",
        f"CLRF gp{{0}}; {run(3)}; BTFSC gx,1; RETLW {{0}}; RETLW {{0}}",
        f"CLRF gp{{0}}; {run(2)}; BTFSC gx,1; RETURN; RETLW {{0}}",
        f"CLRF gp{{0}}; {run(4)}; RETFIE".replace("SWAPF gd,F; ", ""),
    ],
)
def test_what_is_not_shared(text: str) -> None:
    """Assembly, what is near a delay, what a label divides, what stands behind a skip, a skip at the end."""
    made = program(f0=text.format(1), f1=text.format(2))
    assert outline(made, ["main"]) == 0


def test_two_stretches_from_a_delay_is_far_enough() -> None:
    text = f"DELAY 9; a: CLRF gp; b: NOP; {run(4)}; RETLW {{}}"
    assert outline(program(f0=text.format(1), f1=text.format(2).replace("NOP", "SLEEP")), ["main"]) == 1
    text = f"CLRF gp; {run(4)}; a: NOP; b: DELAY 9; RETLW {{}}"
    assert outline(program(f0=text.format(1), f1=text.format(2).replace("NOP", "SLEEP")), ["main"]) > 0


def test_behind_a_jump_a_delay_is_far_away() -> None:
    text = f"BTFSC gx,1; GOTO a; DELAY 9; GOTO e; a: {run(4)}; e: RETLW {{}}"
    assert outline(program(f0=text.format(1), f1=text.format(2)), ["main"]) == 1


def test_a_run_may_be_the_last_of_its_function() -> None:
    made = program(f0=f"CLRF gp; {run(4)}", f1=f"CLRF gq; {run(4)}")
    assert outline(made, ["main"]) == 1
    assert texts(made["f0"]) == ["CLRF gp", "CALL __shared_1"]


def test_what_cannot_be_moved_stays_in_front_of_a_run() -> None:
    made = program(f0=f"CLRF gp; *NOP; {run(4)}; RETLW 1", f1=f"CLRF gq; *NOP; {run(4)}; RETLW 2")
    assert outline(made, ["main"]) == 1
    assert texts(made["f0"]) == ["CLRF gp", "*NOP", "CALL __shared_1", "RETLW 1"]
    assert texts(made["__shared_1"]) == [*run(4).split("; "), "RETURN"]


def test_variables_of_the_function_itself_stay() -> None:
    names = Names()
    made = program(names, f0=between(run(4), 0), f1=between(run(4), 1))
    made["f0"].own = [names["gb"]]
    assert outline(made, ["main"]) == 0
    address = program(f0=between(f"{run(3)}; MOVLW ga", 0), f1=between(f"{run(3)}; MOVLW ga", 1))
    again = dict(address)
    symbol = next(ins.k.symbol for ins in again["f0"].instructions() if ins.op == "MOVLW")  # type: ignore[union-attr]
    again["f0"].own = [symbol]
    assert outline(again, ["main"]) == 0


@every("why", ["inline_asm", "library", "table"])
def test_assembly_library_and_tables_are_left_alone(why: str) -> None:
    names = Names()
    made = program(names, f0=between(run(4), 0), f1=between(run(4), 1))
    if why == "library":
        made["__f1"] = made.pop("f1")
        made["main"] = function("CALL f0; CALL __f1; RETURN", name="main")
    elif why == "table":
        made["f1"].table = names["gz"]
    else:
        made["f1"].inline_asm = True
    assert outline(made, ["main"]) == 0


def test_places_that_overlap_count_once() -> None:
    made = program(f0="; ".join(["INCF ga,F"] * 8) + "; RETURN")
    assert outline(made, ["main"]) == 1
    assert texts(made["f0"]) == ["CALL __shared_1", "CALL __shared_1", "RETURN"]
    assert shared(made) == {"__shared_1": ["INCF ga,F"] * 4 + ["RETURN"]}


def test_a_run_has_40_instructions_at_most() -> None:
    long = "; ".join(f"MOVLW {at}" for at in range(45))
    made = program(f0=between(long, 0), f1=between(long, 1))
    # of 45 twice: 40 save 37; the call of these and the other 5 are a run of 6, which saves 3
    assert outline(made, ["main"]) == 40
    assert sorted(len(each) for each in shared(made).values()) == [7, 41]


@every(("short", "saved", "length"), [(1, 4, 4), (2, 6, 3)])
def test_the_run_that_saves_most_is_taken_first(short: int, saved: int, length: int) -> None:
    """Four in three places save 4, as three in four do: the longer run is taken; three in five save 6."""
    places = {f"f{at}": between(run(4), at) for at in range(3)}
    places |= {f"s{at}": between(run(3), at + 3) for at in range(short)}
    made = program(**places)
    assert outline(made, ["main"]) == saved
    assert shared(made) == {"__shared_1": [*run(length).split("; "), "RETURN"]}


@every(("words", "searched"), [(3072, True), (3073, False)])
def test_a_program_that_fits_in_no_case_is_not_searched(words: int, searched: bool) -> None:
    made = program(f0=between(run(4), 0), f1=between(run(4), 1))
    size = sum(each.size for each in made.values())
    made["f2"] = function("; ".join("DELAY 1" for _ in range(words - size)), name="f2")
    assert bool(outline(made, ["main"])) == searched


def test_without_a_level_of_the_stack_nothing_changes() -> None:
    inner = {f"f{at}": f"NOP; CALL f{at + 1}; CLRF gp{at}; RETURN" for at in range(1, 8)}
    made = program(**inner, f8=between(run(4), 0) + "; " + between(run(4), 1))
    made["main"] = function("CALL f1; RETURN", name="main")
    before = {name: texts(each) for name, each in made.items()}
    assert outline(made, ["main"]) == 0
    assert {name: texts(each) for name, each in made.items()} == before


@every(("inside", "saved"), [("NOP", 1), ("DELAY 9", 0)])
def test_a_function_with_delays_keeps_its_level(inside: str, saved: int) -> None:
    """Called from a subroutine, d would be at level 8, where its delays could not call a shared loop."""
    inner = {f"f{at}": f"NOP; CALL f{at + 1}; RETURN" for at in range(1, 6)}
    body = f"CALL d; {run(3)}"
    made = program(**inner, f6=f"NOP; {body}; RETLW 4; c: SLEEP; {body}; RETLW 5", d=f"{inside}; RETURN")
    made["main"] = function("CALL f1; RETURN", name="main")
    assert outline(made, ["main"]) == saved
