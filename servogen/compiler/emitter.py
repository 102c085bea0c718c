"""The base of the code generator: emits instructions of one function, makes labels and temporaries.

In: a function of the typed tree. Out: `Code`, its list of instructions. Arithmetic, expressions and
statements are added by the modules that build on this one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from servogen.compiler.ctypes import U8, ArrayType
from servogen.compiler.machine import DELAY, LABEL, STATUS, Byte, Imm, Ins, Loc, Operand, Reg, exposed
from servogen.compiler.program import Function
from servogen.compiler.tree import AddressByte, Symbol
from servogen.errors import Place
from servogen.pic.device import RAM_FIRST, RAM_LAST

ISR_SUFFIX = "$isr"
"""Functions that main and the interrupt both call exist twice; the interrupt's copy has this suffix."""


@dataclass(frozen=True, slots=True)
class LoopLines:
    """A loop of the source: "while", "for" or "do"; (line, column) of its first and its last part."""

    kind: str
    first: tuple[int, int]
    last: tuple[int, int]


@dataclass(slots=True)
class Code:
    """The instructions of one function, its own variables, and what it calls."""

    name: str
    ins: list[Ins] = field(default_factory=list)
    own: list[Symbol] = field(default_factory=list)
    """Parameters, results, locals and temporaries."""
    place: Place | None = None
    parameters: list[Symbol] = field(default_factory=list)
    result: Symbol | None = None
    w_parameter: Symbol | None = None
    returns_w: bool = False
    inline_asm: bool = False
    table: Symbol | None = None
    """The flash object whose bytes it holds; its instructions depend on where it comes to lie."""
    also_calls: tuple[str, ...] = ()
    """Functions that it enters elsewhere than at their first instruction."""
    loops: list[LoopLines] = field(default_factory=list)
    bounds: dict[str, int] = field(default_factory=dict)
    """How often a library loop's label can be passed in one call."""
    waits_for: str = ""
    """What a library routine waits for without a known end."""
    falls_into: str = ""
    """The function that stands right behind and is entered without a jump."""

    def calls(self) -> list[str]:
        """Names of the functions that it calls or jumps to, in order, each once."""
        labels = {ins.target for ins in self.ins if ins.op == LABEL}
        found = {
            ins.target: None
            for ins in self.ins
            if ins.op in ("CALL", "GOTO") and ins.target and ins.target not in labels
        }
        more = [*self.also_calls, *([self.falls_into] if self.falls_into else [])]
        return [*found, *more]


class Emitter:
    """Holds the code being made. `request` asks for a library routine and gives back its Code."""

    def __init__(self, function: Function, signature: Callable[[str], Code], isr: bool) -> None:
        self.function = function
        self.isr = isr
        self.signature = signature
        self.code = signature(function.name)
        self.place: Place | None = function.place
        self._labels = 0
        self._temps = 0

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
    ) -> None:
        if isinstance(k, int):
            k &= 0xFF
        self.code.ins.append(Ins(op, f, d, b, k, target, self.place))

    def delay(self, cycles: int) -> None:
        if cycles:
            self.code.ins.append(Ins(DELAY, k=cycles, place=self.place))

    def label(self, name: str) -> None:
        self.code.ins.append(Ins(LABEL, target=name, place=self.place))

    def new_label(self, hint: str = "L") -> str:
        self._labels += 1
        return f"{self.code.name}.{hint}.{self._labels}"

    def goto(self, label: str) -> None:
        self.emit("GOTO", target=label)

    def skip_if(self, bit: int, value: bool, f: Loc = STATUS) -> None:
        self.emit("BTFSS" if value else "BTFSC", f, b=bit)

    def goto_if(self, bit: int, value: bool, label: str, f: Loc = STATUS) -> None:
        """Jump when a bit has a value."""
        self.skip_if(bit, not value, f)
        self.goto(label)

    # operands

    def temp(self, size: int = 1) -> list[Loc]:
        """Bytes of a new temporary; each can be placed by itself."""
        found: list[Loc] = []
        for _ in range(size):
            self._temps += 1
            symbol = Symbol(f"t{self._temps}", U8, "temp", function=self.code.name)
            self.code.own.append(symbol)
            found.append(Byte(symbol, 0))
        return found

    def block_temp(self, size: int) -> list[Loc]:
        """A temporary whose bytes lie together."""
        self._temps += 1
        symbol = Symbol(f"t{self._temps}", ArrayType(U8, size), "temp", function=self.code.name, pinned=True)
        self.code.own.append(symbol)
        return [Byte(symbol, number) for number in range(size)]

    def symbol(self, symbol: Symbol) -> Symbol:
        """The symbol in this function's copy."""
        return symbol

    def loc(self, symbol: Symbol, offset: int) -> Loc:
        symbol = self.symbol(symbol)
        if symbol.kind == "fixed" and symbol.address is not None:
            address = symbol.address + offset
            if not RAM_FIRST <= address & 0x7F <= RAM_LAST:
                return Reg(address & 0xFF)
        return Byte(symbol, offset)

    def locs(self, symbol: Symbol, offset: int, size: int) -> list[Loc]:
        return [self.loc(symbol, offset + each) for each in range(size)]

    # bytes

    def load(self, operand: Operand) -> None:
        """W = operand."""
        if isinstance(operand, Imm):
            self.emit("MOVLW", k=operand.value)
        else:
            self.emit("MOVF", operand, 0)

    def store(self, target: Loc) -> None:
        self.emit("MOVWF", target)

    def move(self, target: Loc, operand: Operand) -> None:
        if operand == target:
            return
        if operand == Imm(0):
            self.emit("CLRF", target)
            return
        self.load(operand)
        self.store(target)

    def steady(self, operand: Operand) -> Operand:
        """Return an operand that can be read several times: of a volatile object a copy."""
        if not exposed(operand):
            return operand
        held = self.temp()[0]
        self.move(held, operand)
        return held

    def read_unused(self, operands: list[Operand]) -> None:
        """Read the bytes of volatile objects on which the value does not depend."""
        for each in operands:
            if exposed(each):
                self.load(each)

    def move_all(self, targets: list[Loc], operands: list[Operand]) -> None:
        """Copy bytes that may overlap, and never load the same constant twice in a row."""
        pending = [(t, o) for t, o in zip(targets, operands, strict=True) if t != o]
        while pending:
            free = [
                pair
                for pair in pending
                if not any(pair[0] == other for t, other in pending if (t, other) != pair)
            ]
            if not free:
                held = self.temp()[0]
                target, operand = pending[0]
                self.move(held, operand)
                pending[0] = (target, held)
                continue
            free.sort(key=lambda pair: repr(pair[1]) if isinstance(pair[1], Imm) else "")
            for target, operand in free:
                self.move(target, operand)
            pending = [pair for pair in pending if pair not in free]
