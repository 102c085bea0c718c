"""The state of generating one function's code, and the table through which the generator's modules recurse.

Expressions nest: operands need conditions, and conditions need operands. A module calls the modules below it
directly, and those above it through `Lowering`, which `codegen.program` fills in.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from servogen.compiler.ast import nodes as tree
from servogen.compiler.codegen.routines import Routines
from servogen.compiler.diagnostics import Reporter
from servogen.compiler.ir.builder import InstructionBuilder, Library
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import DELAY, FSR, INDF, Byte, Instruction, Loc, Operand, Reg


@dataclass(frozen=True, slots=True)
class Lowering:
    """The functions of higher modules that the lower modules of the generator call."""

    into: Callable[[FunctionGenerator, tree.Expr, list[Loc]], None]
    """Store the low len(target) bytes of a value, extended where it has fewer."""
    boolean: Callable[[FunctionGenerator, tree.Expr, list[Loc]], None]
    """Store 0 or 1 by a condition."""
    condition_to_w: Callable[[FunctionGenerator, tree.Expr], None]
    """Load 0 or 1 into W by a condition."""
    jump: Callable[[FunctionGenerator, tree.Expr, bool, str], None]
    """Go to the label when the truth of the expression is as given, else fall through."""
    call: Callable[[FunctionGenerator, tree.Call], Function]
    """Call a function; its result is in W or in its result bytes."""
    builtin: Callable[[FunctionGenerator, tree.Builtin], list[Loc]]
    """Execute an operation of the chip or the library; return the bytes of a result that is not in W."""
    multiply: Callable[[FunctionGenerator, tree.Binary, list[Loc]], None]
    divide: Callable[[FunctionGenerator, tree.Binary, list[Loc]], None]
    flash_byte: Callable[[FunctionGenerator, tree.Ref], None]
    """Load one byte of a table into W."""
    from_flash: Callable[[FunctionGenerator, tree.Ref, list[Loc]], None]
    """Store a value that lies in flash."""
    wide_load: Callable[[FunctionGenerator, tree.Deref, list[Loc]], None]
    """Store a value behind a pointer that may lead to flash."""
    one_byte_indirect: Callable[[FunctionGenerator, tree.Ref | tree.Deref], bool]
    """Load one byte through FSR or from flash straight into W, where that is possible."""


@dataclass(frozen=True, slots=True)
class Context:
    """What generating the code of one function needs from the rest of the program."""

    signature: Callable[[str], Function]
    """The parameters and result of a function, before or after its code is generated."""
    symbol_map: Callable[[tree.Symbol], tree.Symbol]
    library: Library
    routines: Routines
    asm_symbols: dict[str, tree.Symbol]
    reporter: Reporter
    isr: bool


@dataclass(frozen=True, slots=True)
class Division:
    """The latest call of a dividing routine, with its operands; its quotient and remainder stay behind."""

    call: Instruction
    dividend: list[Operand]
    divisor: list[Operand]

    def holds_behind(self, instructions: Sequence[Instruction]) -> bool:
        """Return whether the same division at the end of these instructions of a block would add nothing.

        What may change an operand, or the results, ends it: another call, assembly, a write through a
        pointer, a write to an operand. A write to an element of an array changes nothing else.
        """
        operands = [*self.dividend, *self.divisor]
        variables = [operand.symbol for operand in operands if isinstance(operand, Byte)]
        if any(isinstance(operand, Reg) for operand in operands):
            return False
        if any(symbol.volatile or symbol.kind == "fixed" for symbol in variables):
            return False
        element_written = False  # through FSR, further down than `ins`
        for number in range(len(instructions) - 1, -1, -1):
            ins = instructions[number]
            if ins is self.call:
                return not element_written
            if ins.fixed or ins.op in ("CALL", DELAY):
                return False
            if ins.writes_f and ins.f in operands:
                return False
            if ins.writes_f and ins.f == INDF:
                element_written = True
            elif ins.writes_f and ins.f == FSR and element_written:
                array = _indexed(instructions[:number])
                if array is None or array.kind == "fixed" or array in variables:
                    return False
                element_written = False
        return False


def _indexed(before: Sequence[Instruction]) -> tree.Symbol | None:
    """Return the array of whose element W holds the address, if it was added just before."""
    last = before[-1] if before else None
    if last is None or last.op != "ADDLW" or not isinstance(last.k, tree.AddressByte):
        return None
    return last.k.symbol


class FunctionGenerator(InstructionBuilder):
    """An instruction builder that knows the function whose body it translates."""

    def __init__(self, definition: tree.FunctionDefinition, context: Context, lower: Lowering) -> None:
        function = context.signature(definition.name)
        super().__init__(function, place=definition.place, symbol_map=context.symbol_map)
        self.definition = definition
        self.context = context
        self.lower = lower
        self.isr = context.isr
        self.break_labels: list[str] = []
        self.continue_labels: list[str] = []
        self.case_labels: dict[tree.CaseLabel, str] = {}
        self.user_labels: dict[str, str] = {}
        self.division: Division | None = None
        self.end_label = self.new_label("end")

    def signature(self, name: str) -> Function:
        return self.context.signature(name)

    def library(self, kind: str, key: tuple[int, ...]) -> Function:
        return self.context.library(kind, key)
