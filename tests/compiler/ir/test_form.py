"""The intermediate form: blocks and edges, the text of a function, and what the verifier refuses."""

from __future__ import annotations

import pytest

from servogen.compiler.ast.nodes import Symbol
from servogen.compiler.ast.types import U8
from servogen.compiler.ir.function import Block, Function, Line, is_skipped, text_of
from servogen.compiler.ir.instruction import DELAY, STATUS, Byte, Instruction, Label, Reg, Z
from servogen.compiler.ir.verifier import MalformedIR, faults, verify
from servogen.compiler.passes.manager import PassManager

COUNT = Byte(Symbol("count", U8, "temp"), 0)


def function(*lines: Line) -> Function:
    made = Function("f")
    made.extend(lines)
    return made


def counting_loop() -> Function:
    return function(
        Instruction("MOVLW", k=10),
        Instruction("MOVWF", COUNT),
        Label("f.top"),
        Instruction("DECFSZ", COUNT, 1),
        Instruction("GOTO", target="f.top"),
        Instruction("RETURN"),
    )


def numbers(made: Function) -> list[list[int | None]]:
    """The successors of each block, by number."""
    number = {block: at for at, block in enumerate(made.blocks)}
    return [[None if each is None else number[each] for each in after] for after in made.successors()]


def test_a_skip_is_a_conditional_edge_over_a_block_of_one_instruction() -> None:
    made = counting_loop()
    assert [len(block.instructions) for block in made.blocks] == [2, 1, 1, 1]
    assert numbers(made) == [[1], [2, 3], [1], [None]]
    assert made.skipped() == {made.blocks[2]}


def test_an_instruction_that_may_be_skipped_is_a_block_of_its_own() -> None:
    made = function(
        Instruction("BTFSC", STATUS, b=Z),
        Instruction("NOP"),
        Instruction("NOP"),
        Instruction("RETURN"),
    )
    assert [len(block.instructions) for block in made.blocks] == [1, 1, 2]
    assert numbers(made) == [[1, 2], [2], [None]]


def test_a_skip_over_a_skip_has_three_ways() -> None:
    made = function(
        Instruction("BTFSC", STATUS, b=0),
        Instruction("BTFSS", STATUS, b=1),
        Instruction("NOP"),
        Instruction("RETURN"),
    )
    assert numbers(made) == [[1, 2], [2, 3], [3], [None]]


def test_a_jump_out_of_the_function_leaves_it() -> None:
    made = function(Instruction("GOTO", target="g"))
    assert numbers(made) == [[None]]
    assert made.calls() == ["g"]


def test_lines_make_the_same_blocks_again() -> None:
    made = counting_loop()
    before = [(len(block.labels), len(block.instructions)) for block in made.blocks]
    made.rebuild()
    assert [(len(block.labels), len(block.instructions)) for block in made.blocks] == before


def test_the_text_names_blocks_edges_and_instructions() -> None:
    assert text_of(counting_loop()).splitlines()[1:] == [
        "  block 0 -> 1", "        MOVLW 10", "        MOVWF count", "  block 1 f.top: -> 2 or skip to 3",
        "        DECFSZ count, F", "  block 2 -> 1", "        GOTO f.top", "  block 3 -> exit",
        "        RETURN",
    ]  # fmt: skip


def test_a_well_formed_function_has_no_faults() -> None:
    assert list(faults(counting_loop())) == []


def broken(how: str) -> Function:
    """A function with one fault."""
    made = counting_loop()
    first = made.blocks[0]
    match how:
        case "label twice":
            made.blocks[3].labels.append(Label("f.top"))
        case "skip inside":
            first.instructions.insert(0, Instruction("BTFSC", STATUS, b=Z))
        case "two skipped":
            made.blocks[2].instructions.insert(0, Instruction("NOP"))
        case "empty":
            first.instructions.clear()
        case "divided":
            made.blocks.insert(1, Block([], [Instruction("NOP")]))
        case "ends with a skip":
            del made.blocks[2:]
        case "same object":
            first.instructions.append(first.instructions[0])
        case "no operand":
            first.instructions[1].f = None
        case "bit":
            first.instructions.append(Instruction("BSF", COUNT, b=8))
        case "destination":
            first.instructions.append(Instruction("MOVWF", COUNT, 1))
        case "literal":
            first.instructions[0].k = 256
        case "no target":
            made.blocks[2].instructions[0].target = ""
        case "target":
            first.instructions[0].target = "f.top"
        case "lost label":
            made.blocks[1].labels.clear()
        case "operation":
            first.instructions.append(Instruction("ADDWFC", COUNT))
        case "delay":
            first.instructions.append(Instruction(DELAY, k=-1))
    return made


@pytest.mark.parametrize(
    ("how", "fault"),
    [
        ("label twice", "the label f.top stands 2 times"),
        ("skip inside", "stands inside block 0"),
        ("two skipped", "block 2 is skipped but holds 2 instructions"),
        ("empty", "block 0 is empty"),
        ("divided", "block 1 continues the one before it"),
        ("ends with a skip", "nothing follows the skip"),
        ("same object", "stands twice as the same object"),
        ("no operand", "MOVWF with the file register None"),
        ("bit", "BSF with the bit 8"),
        ("destination", "MOVWF with the destination 1"),
        ("literal", "MOVLW with the literal 256"),
        ("no target", "GOTO without a target"),
        ("target", "MOVLW with the target f.top"),
        ("lost label", "there is no such label"),
        ("operation", "ADDWFC is not an instruction of the chip"),
        ("delay", "a delay of -1 cycles"),
    ],
)
def test_the_verifier_names_each_fault(how: str, fault: str) -> None:
    assert any(fault in each for each in faults(broken(how)))
    with pytest.raises(MalformedIR, match="f, after this pass: "):
        verify(broken(how), after="this pass")


def test_the_manager_checks_after_each_pass() -> None:
    def breaks_it(made: Function) -> bool:
        made.blocks[2].instructions.insert(0, Instruction("NOP"))
        return True

    PassManager(verify_ir=False).run({"bad": breaks_it}, counting_loop(), set())
    with pytest.raises(MalformedIR, match="f, after bad: block 2 is skipped"):
        PassManager(verify_ir=True).run({"bad": breaks_it}, counting_loop(), set())


def test_the_manager_says_what_each_pass_saved() -> None:
    made = function(
        Instruction("MOVLW", k=1),
        Instruction("MOVLW", k=2),
        Instruction("GOTO", target="f.next"),
        Label("f.next"),
        Instruction("RETURN"),
    )
    manager = PassManager()
    manager.optimise(made)
    assert [str(each) for each in made.instructions()] == ["RETURN"]
    assert +manager.saved == {"drop-unreachable": 1, "dead-code": 2}
    assert manager.runs["dead-code"] == 2  # the second time it finds nothing
    assert manager.runs["peephole"] == 1  # nothing changes after it


def test_a_function_says_what_it_calls() -> None:
    made = function(
        Instruction("CALL", target="b"),
        Instruction("CALL", target="a"),
        Instruction("CALL", target="b"),
        Instruction("GOTO", target="f.here"),
        Label("f.here"),
        Instruction("GOTO", target="c"),
    )
    assert made.calls() == ["b", "a", "c"]
    made.also_calls, made.also_jumps_to, made.falls_into = ("d",), ("e",), "g"
    assert made.calls() == ["b", "a", "c", "d", "e", "g"]
    assert made.size == 5


def test_lines_are_appended_one_by_one_as_at_once() -> None:
    at_once = counting_loop()
    single = Function("f")
    for each in at_once.lines():
        single.append(each)
    assert [(len(b.labels), len(b.instructions)) for b in single.blocks] == [(0, 2), (1, 1), (0, 1), (0, 1)]
    # behind a skip a block is complete as soon as it has an instruction, even if it is filled later
    skip = function(Instruction("BTFSC", STATUS, b=Z))
    skip.append(Label("f.x"))
    skip.append(Instruction("NOP"))
    skip.append(Instruction("NOP"))
    assert [len(block.instructions) for block in skip.blocks] == [1, 1, 1]


def test_what_a_write_to_pcl_may_lead_to() -> None:
    made = function(Instruction("ADDWF", Reg(2), 1), Instruction("NOP"), Instruction("RETURN"))
    assert numbers(made) == [[None, 1], [None]]
    assert numbers(function(Instruction("NOP"))) == [[None]]
    assert numbers(function(Instruction("BTFSC", STATUS, b=Z), Instruction("NOP"))) == [[1, None], [None]]


def test_whether_a_line_is_behind_a_skip() -> None:
    lines = [Instruction("BTFSC", STATUS, b=Z), Instruction("NOP"), Label("f.x"), Instruction("NOP")]
    assert [is_skipped(lines, index) for index in range(4)] == [False, True, False, False]


def test_the_head_of_the_text_counts_blocks_and_instructions() -> None:
    head = text_of(counting_loop()).splitlines()[0]
    assert head == "f:" + " " * 34 + "; 4 blocks, 5 instructions"
    assert text_of(function(Instruction("NOP"))).splitlines()[0].endswith("; 1 block, 1 instruction")
    both = function(Instruction("ADDWF", Reg(2), 1), Instruction("NOP", fixed=True))
    assert text_of(both).splitlines()[1:] == [
        "  block 0 -> exit, 1",
        "        ADDWF PCL, F",
        "  block 1 -> exit",
        "        NOP  ; fixed",
    ]


@pytest.mark.parametrize(
    ("ins", "fault"),
    [
        (Instruction("BSF", COUNT, b=7), None),
        (Instruction("BSF", COUNT, b=-1), "BSF with the bit -1"),
        (Instruction("MOVLW", b=1), "MOVLW with the bit 1"),
        (Instruction("ADDWF", COUNT, 1), None),
        (Instruction("ADDWF", COUNT, 2), "ADDWF with the destination 2"),
        (Instruction("MOVLW", k=255), None),
        (Instruction("MOVLW", k=0), None),
        (Instruction("MOVLW", k=-1), "MOVLW with the literal -1"),
        (Instruction("MOVLW", COUNT), "MOVLW with the file register count"),
        (Instruction(DELAY, k=0), None),
        (Instruction("CALL", target="g"), None),
        (Instruction("CALL"), "CALL without a target"),
    ],
)
def test_the_verifier_accepts_exactly_the_range_of_an_operand(ins: Instruction, fault: str | None) -> None:
    found = list(faults(function(ins, Instruction("RETURN"))))
    if fault is None:
        assert found == []
    else:
        assert len(found) == 1 and fault.split(" with the file")[0] in found[0]


def test_jumps_of_assembly_and_to_other_functions_may_lead_anywhere() -> None:
    assert not list(faults(function(Instruction("GOTO", target="g.x"))))
    assert not list(faults(function(Instruction("GOTO", target="f.x", fixed=True))))
    assert list(faults(function(Instruction("GOTO", target="f.x")))) == ["GOTO f.x: there is no such label"]
    skip = function(Instruction("BTFSC", STATUS, b=Z))
    assert list(faults(skip)) == ["nothing follows the skip BTFSC STATUS, 2"]
    skip.inline_asm = True
    assert not list(faults(skip))
