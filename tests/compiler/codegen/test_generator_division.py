"""When the quotient and the remainder of the latest division are still there."""

from __future__ import annotations

from servogen.compiler.ast.nodes import AddressByte
from servogen.compiler.codegen.generator import Division
from servogen.compiler.ir.instruction import Imm, Instruction
from tests.compiler.cases import every
from tests.compiler.ir.assembly import Names, function


def holds(behind: str, dividend: str = "ga", divisor: str | int = "gb", *, index: str = "") -> bool:
    """Whether the results of `CALL divide` hold behind other instructions."""
    names = Names()
    made = list(function(f"MOVWF gq; CALL divide; {behind}", names).instructions())
    if index:
        made.insert(3, Instruction("ADDLW", k=AddressByte(names[index], 0, 0)))
    right = Imm(divisor) if isinstance(divisor, int) else names.loc(divisor)
    return Division(made[1], [names.loc(dividend)], [right]).holds_behind(made)


@every(
    ("behind", "kept"),
    [
        ("NOP", True), ("MOVF gc,W; MOVWF gd; INCF gd,F", True), ("MOVF ga,W; ADDWF gb,W", True),
        # a write to an operand
        ("MOVWF ga", False), ("INCF gb,F", False), ("MOVWF gc; MOVWF ga; MOVWF gd", False),
        ("MOVWF ga+1", True),
        # a call, a delay, assembly
        ("CALL g", False), ("DELAY 9", False), ("*NOP", False),
        # through a pointer, which may lead anywhere
        ("MOVWF FSR; MOVF INDF,W", True), ("MOVWF FSR; MOVWF INDF", False), ("MOVWF INDF", False),
    ],
)  # fmt: skip
def test_what_ends_a_division(behind: str, kept: bool) -> None:
    assert holds(behind) == kept
    assert holds(behind, divisor=7) == (kept or behind == "INCF gb,F")


@every(
    ("array", "kept"),
    [("gx", True), ("ga", False), ("gb", False), ("fx", False)],
)
def test_a_write_to_an_element_of_an_array_changes_that_array_alone(array: str, kept: bool) -> None:
    assert holds("MOVF gi,W; MOVWF FSR; MOVWF INDF", index=array) == kept


def test_volatile_operands_and_registers_are_divided_again() -> None:
    assert not holds("NOP", dividend="va") and not holds("NOP", divisor="vb")
    assert not holds("NOP", dividend="fa") and not holds("NOP", dividend="PORTB")


def test_a_division_in_another_block_is_not_seen() -> None:
    made = list(function("MOVWF ga; NOP").instructions())
    assert not Division(Instruction("CALL", target="divide"), [], []).holds_behind(made)
