"""Emits the instructions of one function: labels, skips, temporaries, and moves of bytes.

In: calls of the code generator. Out: the instructions of a `Function`, in order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from servogen.compiler.ast.nodes import AddressByte, Symbol
from servogen.compiler.ast.types import U8, ArrayType
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import (
    DELAY,
    STATUS,
    Byte,
    Imm,
    Instruction,
    Label,
    Loc,
    Operand,
    Reg,
    exposed,
)
from servogen.errors import Location
from servogen.pic.device import RAM_FIRST, RAM_LAST

Library = Callable[[str, tuple[int, ...]], Function]
"""Returns a library routine by its kind and its sizes, generated when it is first asked for."""


def _same(symbol: Symbol) -> Symbol:
    return symbol


class InstructionBuilder:
    """Appends instructions to a function.

    `symbol_map` maps a variable to the function's own copy of it: the interrupt's copy of a function has
    variables of its own.
    """

    def __init__(
        self,
        function: Function,
        *,
        place: Location | None = None,
        symbol_map: Callable[[Symbol], Symbol] = _same,
    ) -> None:
        self.function = function
        self.place = place
        self.symbol_map = symbol_map
        self._labels = 0
        self._temps = 0

    def symbol(self, symbol: Symbol) -> Symbol:
        """Return the function's own copy of a variable."""
        return self.symbol_map(symbol)

    # instructions

    def emit(
        self,
        op: str,
        f: Loc | None = None,
        d: int = 0,
        *,
        b: int = 0,
        k: int | AddressByte = 0,
        target: str = "",
        fixed: bool = False,
    ) -> Instruction:
        """Append an instruction and return it."""
        if isinstance(k, int):
            k &= 0xFF
        ins = Instruction(op, f, d, b, k, target, self.place, fixed)
        self.function.append(ins)
        return ins

    @property
    def last(self) -> Instruction | None:
        """Return the last emitted instruction; None directly after a label."""
        return self.function.blocks[-1].last if self.function.blocks else None

    @property
    def last_may_be_skipped(self) -> bool:
        """Return whether the last instruction is skipped on one path, where its flags do not hold."""
        blocks = self.function.blocks
        return len(blocks) > 1 and len(blocks[-1].instructions) == 1 and blocks[-2].skips

    def delay(self, cycles: int) -> None:
        if cycles:
            self.function.append(Instruction(DELAY, k=cycles, place=self.place))

    def label(self, name: str, bound: int | None = None) -> None:
        """Put a label here; `bound` is how often it is passed at most where it begins a loop."""
        if bound is not None:
            self.function.bounds[name] = bound
        self.function.append(Label(name, self.place))

    def new_label(self, hint: str = "L") -> str:
        """Return the name of a new label of the function; `hint` says in the listing what it is for."""
        self._labels += 1
        return f"{self.function.name}.{hint}.{self._labels}"

    def new_labels(self, *hints: str) -> list[str]:
        return [self.new_label(hint) for hint in hints]

    def goto(self, label: str) -> None:
        self.emit("GOTO", target=label)

    def skip_if(self, bit: int, value: bool, f: Loc = STATUS) -> None:
        """Skip the next instruction if a bit has a value; the default register is STATUS."""
        self.emit("BTFSS" if value else "BTFSC", f, b=bit)

    def goto_if(self, bit: int, value: bool, label: str, f: Loc = STATUS) -> None:
        """Jump if a bit has a value."""
        self.skip_if(bit, not value, f)
        self.goto(label)

    # operands

    def temp(self, size: int = 1) -> list[Loc]:
        """Return the bytes of a new temporary; each can be allocated independently."""
        locations: list[Loc] = []
        for _ in range(size):
            self._temps += 1
            symbol = Symbol(f"t{self._temps}", U8, "temp", function=self.function.name)
            self.function.own.append(symbol)
            locations.append(Byte(symbol, 0))
        return locations

    def block_temp(self, size: int) -> list[Loc]:
        """Return the bytes of a new temporary that are contiguous in memory."""
        self._temps += 1
        symbol = Symbol(
            f"t{self._temps}", ArrayType(U8, size), "temp", function=self.function.name, pinned=True
        )
        self.function.own.append(symbol)
        return [Byte(symbol, number) for number in range(size)]

    def loc(self, symbol: Symbol, offset: int) -> Loc:
        """Return a byte of a variable; a variable at the address of a special function register is that
        register.
        """
        symbol = self.symbol(symbol)
        if symbol.kind == "fixed" and symbol.address is not None:
            address = symbol.address + offset
            if not RAM_FIRST <= address & 0x7F <= RAM_LAST:
                return Reg(address & 0xFF)
        return Byte(symbol, offset)

    def locs(self, symbol: Symbol, offset: int, size: int) -> list[Loc]:
        return [self.loc(symbol, offset + index) for index in range(size)]

    # bytes

    def load(self, operand: Operand) -> Instruction:
        """Load an operand into W."""
        if isinstance(operand, Imm):
            return self.emit("MOVLW", k=operand.value)
        return self.emit("MOVF", operand, 0)

    def store(self, target: Loc) -> None:
        self.emit("MOVWF", target)

    def move(self, target: Loc, operand: Operand) -> None:
        """Copy one byte; nothing is emitted for a copy to itself."""
        if operand == target:
            return
        if operand == Imm(0):
            self.emit("CLRF", target)
            return
        self.load(operand)
        self.store(target)

    def steady(self, operand: Operand) -> Operand:
        """Return an operand that can be read several times; for a volatile object, a copy."""
        if not exposed(operand):
            return operand
        copy = self.temp()[0]
        self.move(copy, operand)
        return copy

    def read_unused(self, operands: list[Operand]) -> None:
        """Read the bytes of volatile objects on which the value does not depend."""
        for operand in operands:
            if exposed(operand):
                self.load(operand)

    def clear(self, targets: Iterable[Loc]) -> None:
        for target in targets:
            self.emit("CLRF", target)

    def move_all(self, targets: list[Loc], operands: list[Operand]) -> None:
        """Copy bytes that may overlap, without loading the same constant twice in a row."""
        pending = [(t, o) for t, o in zip(targets, operands, strict=True) if t != o]
        while pending:
            # a target may be written once no other copy still reads it
            free = [
                pair
                for pair in pending
                if not any(pair[0] == other for t, other in pending if (t, other) != pair)
            ]
            # only cycles are left, as of two bytes exchanged: one of them goes through a temporary
            if not free:
                copy = self.temp()[0]
                target, operand = pending[0]
                self.move(copy, operand)
                pending[0] = (target, copy)
                continue
            # equal constants side by side are loaded once: a later pass drops the second load
            free.sort(key=lambda pair: repr(pair[1]) if isinstance(pair[1], Imm) else "")
            for target, operand in free:
                self.move(target, operand)
            pending = [pair for pair in pending if pair not in free]
