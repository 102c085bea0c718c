"""Functions of the intermediate form as assembly text, and a slow chip that executes them.

In: text such as `BTFSC Z; GOTO end; INCF t,F; end: RETURN`. The first letter of a variable says what it is:

    t temporary   l local   p parameter   n local whose address is taken, all of the function itself
    x, y parameters of other functions (g and h)   g global   v volatile global   f global at a fixed address

`*` before a line marks it as fixed, `a+1` is the second byte of `a`, C, DC, Z and RP0 are bits of STATUS, and
`DELAY 10` waits. Out: a `Function`; the text of one; what a function leaves in memory, W and the flags.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from servogen.compiler.ast.nodes import AddressByte, Symbol
from servogen.compiler.ast.types import U32
from servogen.compiler.ir.function import Function, Line
from servogen.compiler.ir.instruction import DELAY, STATUS, Byte, Instruction, Label, Loc, Reg
from servogen.pic.device import registers
from servogen.pic.isa import by_mnemonic

KINDS = {"t": "temp", "l": "local", "p": "param", "n": "local", "g": "global", "v": "global"}
OTHERS = {"x": "g", "y": "h"}
"""The functions of the others' parameters."""
BITS = {"C": 0, "DC": 1, "Z": 2, "RP0": 5}
"""Of STATUS: DS35007 register 2-1."""


@dataclass
class Names:
    """The variables that texts name, each made once."""

    symbols: dict[str, Symbol] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Symbol:
        if name not in self.symbols:
            letter = name[0]
            kind = "param" if letter in OTHERS else KINDS.get(letter, "fixed")
            owner = None if kind in ("global", "fixed") else OTHERS.get(letter, "f")
            self.symbols[name] = Symbol(
                name,
                U32,
                kind,
                function=owner,
                volatile=letter == "v",
                pinned=letter == "n",
                address=0x40 if kind == "fixed" else None,
            )
        return self.symbols[name]

    def loc(self, text: str) -> Loc:
        """The register or byte that a text names."""
        if text in registers():
            return Reg(registers()[text].address)
        name, _, offset = text.partition("+")
        return Byte(self[name], int(offset or 0))


def line(text: str, names: Names) -> Line:
    """A label or an instruction."""
    fixed = text.startswith("*")
    text = text.removeprefix("*").strip()
    if text.endswith(":"):
        return Label(text[:-1], fixed=fixed)
    op, *operands = re.split(r"[ ,]+", text)
    if op == DELAY:
        return Instruction(DELAY, k=int(operands[0]), fixed=fixed)
    row = by_mnemonic()[op]
    if "b" in row.operands:
        if operands[0] in BITS:
            return Instruction(op, STATUS, b=BITS[operands[0]], fixed=fixed)
        return Instruction(op, names.loc(operands[0]), b=int(operands[1]), fixed=fixed)
    if "f" in row.operands:
        d = int(operands[1] == "F") if "d" in row.operands else 0
        return Instruction(op, names.loc(operands[0]), d, fixed=fixed)
    if row.has_target:
        return Instruction(op, target=operands[0], fixed=fixed)
    if row.operands:
        k: int | AddressByte
        k = int(operands[0], 0) if operands[0][0] in "0123456789" else AddressByte(names[operands[0]], 0, 0)
        return Instruction(op, k=k, fixed=fixed)
    return Instruction(op, fixed=fixed)


def function(text: str, names: Names | None = None, *, name: str = "f") -> Function:
    """The function of a text; lines end with `;` or the end of a line."""
    names = Names() if names is None else names
    made = Function(name)
    parts = re.sub(r"(\w+:)", r"\1;", text.replace("\n", ";")).split(";")
    made.extend([line(part.strip(), names) for part in parts if part.strip()])
    made.own = [symbol for symbol in names.symbols.values() if symbol.function == name]
    return made


def shown(ins: Line) -> str:
    """The text of a label or an instruction."""
    star = "*" if ins.fixed else ""
    if isinstance(ins, Label):
        return f"{star}{ins.name}:"
    if ins.op == DELAY:
        return f"{star}DELAY {ins.k}"
    row = by_mnemonic()[ins.op]
    parts = []
    if "f" in row.operands:
        bits = {bit: name for name, bit in BITS.items()}
        if ins.f == STATUS and "b" in row.operands and ins.b in bits:
            return f"{star}{ins.op} {bits[ins.b]}"
        parts.append(_place(ins.f))
    if "d" in row.operands:
        parts.append("WF"[ins.d])
    if "b" in row.operands:
        parts.append(str(ins.b))
    if row.has_target:
        parts.append(ins.target)
    elif "k" in row.operands:
        parts.append(ins.k.symbol.name if isinstance(ins.k, AddressByte) else str(ins.k))
    return f"{star}{ins.op} {','.join(parts)}".strip()


def _place(loc: Loc | None) -> str:
    if isinstance(loc, Byte):
        return loc.symbol.name + (f"+{loc.offset}" if loc.offset else "")
    assert loc is not None
    return next(row.name for row in registers().values() if row.address == loc.address)


def texts(made: Function | Iterable[Line]) -> list[str]:
    """The lines of a function as text, in the form that `function` reads."""
    return [shown(each) for each in (made.lines() if isinstance(made, Function) else made)]


def lines(text: str) -> list[str]:
    """The same lines of a text."""
    return texts(function(text))


_LITERAL = {"ADDLW": "+", "SUBLW": "-", "ANDLW": "&", "IORLW": "|", "XORLW": "^", "MOVLW": "="}
_FILE = {"ADDWF": "+", "SUBWF": "-", "ANDWF": "&", "IORWF": "|", "XORWF": "^"}


class Chip:
    """W, the flags and memory, and what instructions do to them (DS35007B table 7-2)."""

    def __init__(self, functions: Mapping[str, Function], memory: Mapping[Loc, int] | None = None) -> None:
        self.functions = functions
        self.memory: dict[Loc, int] = dict(memory or {})
        self.w = 0
        self.c = self.dc = self.z = False
        self.cycles = 0
        self.most = 2_000_000
        self.passed: Counter[str] = Counter()
        """How often each label was passed."""
        self.stores: list[tuple[int, str, int]] = []
        """(cycles, register, value) of each store to a register."""

    def number(self, symbol: Symbol, size: int) -> int:
        """The value of a variable, low byte first."""
        return sum(self.memory[Byte(symbol, at)] << 8 * at for at in range(size))

    def store(self, symbol: Symbol, value: int, size: int) -> None:
        self.memory.update({Byte(symbol, at): value >> 8 * at & 0xFF for at in range(size)})

    def waited(self, cycles: int) -> None:
        """Called after each delay, which leaves anything in W and the flags."""

    def call(self, name: str) -> None:
        """Execute a function, or what stands at a label of one, up to its return or its end."""
        entry = name
        if name not in self.functions:
            name = next(each for each, made in self.functions.items() if entry in made.by_label())
        code = list(self.functions[name].lines())
        labels = {each.name: at for at, each in enumerate(code) if isinstance(each, Label)}
        at = labels.get(entry, 0)
        while at < len(code):
            ins = code[at]
            at += 1
            if isinstance(ins, Label):
                self.passed[ins.name] += 1
                continue
            self.cycles += 1
            assert self.cycles < self.most, "it does not end"
            assert ins.d in (0, 1) and ins.b in range(8), shown(ins)
            if ins.op == DELAY:
                assert isinstance(ins.k, int) and ins.k >= 0
                self.cycles += ins.k - 1
                self.waited(ins.k)
            elif ins.op == "GOTO":
                self.cycles += 1
                if ins.target not in labels:
                    self.call(ins.target)
                    return
                at = labels[ins.target]
            elif ins.op == "CALL":
                self.cycles += 1
                self.call(ins.target)
            elif ins.op in ("RETURN", "RETLW", "RETFIE"):
                self.cycles += 1
                self.w = ins.k if ins.op == "RETLW" else self.w  # type: ignore[assignment]
                return
            elif self._skips(ins):
                self.cycles += 1
                at += 1
                while isinstance(code[at - 1], Label):
                    at += 1

    def read(self, loc: Loc | None) -> int:
        assert loc is not None
        if loc == STATUS:
            return self.c | self.dc << 1 | self.z << 2
        return self.memory[loc]

    def _write(self, ins: Instruction, value: int, *, to_file: bool) -> None:
        if not to_file:
            self.w = value
        elif ins.f == STATUS:
            self.c, self.dc, self.z = bool(value & 1), bool(value & 2), bool(value & 4)
        else:
            assert ins.f is not None
            self.memory[ins.f] = value
            if isinstance(ins.f, Reg):
                self.stores.append((self.cycles, _place(ins.f), value))

    def _skips(self, ins: Instruction) -> bool:
        """Execute one instruction that neither jumps nor returns; return whether it skips the next one."""
        op = ins.op
        if op in ("NOP", "CLRWDT", "SLEEP"):
            return False
        if op in _LITERAL:
            assert isinstance(ins.k, int) and 0 <= ins.k <= 0xFF
            self._combine(ins, _LITERAL[op], ins.k, to_file=False)
            return False
        if op in _FILE:
            self._combine(ins, _FILE[op], self.read(ins.f), to_file=ins.d == 1)
            return False
        if op in ("BTFSC", "BTFSS"):
            return bool(self.read(ins.f) >> ins.b & 1) == (op == "BTFSS")
        if op in ("BSF", "BCF"):
            value = self.read(ins.f) & ~(1 << ins.b) | int(op == "BSF") << ins.b
            self._write(ins, value, to_file=True)
            return False
        if op in ("CLRF", "CLRW"):
            self._write(ins, 0, to_file=op == "CLRF")
            self.z = True
            return False
        if op == "MOVWF":
            self._write(ins, self.w, to_file=True)
            return False
        old, carry = self.read(ins.f), int(self.c)
        new = {
            "MOVF": old,
            "COMF": old ^ 0xFF,
            "INCF": old + 1 & 0xFF,
            "DECF": old - 1 & 0xFF,
            "INCFSZ": old + 1 & 0xFF,
            "DECFSZ": old - 1 & 0xFF,
            "RLF": old << 1 & 0xFF | carry,
            "RRF": old >> 1 | carry << 7,
            "SWAPF": old >> 4 | old << 4 & 0xF0,
        }[op]
        self._write(ins, new, to_file=ins.d == 1)
        if op in ("MOVF", "COMF", "INCF", "DECF"):
            self.z = new == 0
        if op in ("RLF", "RRF"):
            self.c = bool(old >> 7 if op == "RLF" else old & 1)
        return op.endswith("FSZ") and new == 0

    def _combine(self, ins: Instruction, sign: str, other: int, *, to_file: bool) -> None:
        """Combine W with a literal or a byte; C is the inverted borrow of a difference `other - W`."""
        w = self.w
        if sign == "=":
            self.w = other
            return
        if sign == "-":
            new = other - w & 0xFF
            carry, digit = other >= w, (other & 15) >= (w & 15)
        else:
            new = {"+": other + w & 0xFF, "&": other & w, "|": other | w, "^": other ^ w}[sign]
            carry, digit = other + w > 0xFF, (other & 15) + (w & 15) > 15
        self._write(ins, new, to_file=to_file)
        if sign in "+-":
            self.c, self.dc = carry, digit
        self.z = new == 0


def check(transform: Callable[[Function], bool], before: str, after: str | None) -> None:
    """Assert what a pass makes of a function: `after`, or nothing else where that is None.

    What it leaves is divided into blocks as the same lines are anew.
    """
    made = function(before)
    assert transform(made) is (after is not None)
    assert texts(made) == lines(before if after is None else after)
    assert _blocks(made) == _blocks(function(before if after is None else after))


def _blocks(made: Function) -> list[tuple[list[str], list[str]]]:
    return [(texts(block.labels), texts(block.instructions)) for block in made.blocks]
