"""Every pass leaves the meaning of small random functions, and says whether it has changed one.

Two functions mean the same if they leave the same globals and the same result, and access registers and
volatile bytes, wait and call in the same order. Each is executed before and after the pass by the slow chip
of `tests.compiler.ir.assembly`, with what makes passes careful: a pointer that leads to variables, two
variables at one address, a function that is called and changes what it can, delays that count in W.
"""

from __future__ import annotations

from functools import cache
from random import Random

import pytest

from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import FSR, INDF, STATUS, Byte, Loc, Reg
from servogen.compiler.ir.verifier import faults
from servogen.compiler.passes.manager import JUMPS, RETURNS, TAILS, VALUES
from servogen.pic.device import registers
from tests.compiler.ir.assembly import Chip, Names, function, texts

PASSES = {**JUMPS, **VALUES, **TAILS, **RETURNS}
FUNCTIONS = 150
BYTES = ("ga", "gb", "l", "l", "t", "t", "t1", "va", "fa", "fb", "x", "n")
NAMES = (*BYTES, "ga", "l", "t", "PORTB", "INDF", "FSR")
LITERALS = (0, 0, 1, 3, 255)
POINTED = ("ga", "gb", "n", "fa")
"""Where INDF leads, by the two lowest bits of FSR."""


class Writer:
    """Draws the text of a function."""

    def __init__(self, random: Random) -> None:
        self.random = random
        self.labels = 0

    def one(self, *choices: str) -> str:
        return self.random.choice(choices)

    def name(self) -> str:
        return self.random.choice(NAMES if self.random.random() < 0.3 else ("ga", "gb", "l", "t", "t1"))

    def bit(self) -> str:
        return self.one("C", "Z", "Z", "DC", f"{self.name()},{self.one('0', '1', '7')}")

    def instruction(self) -> list[str]:
        """One instruction, or two that passes look for."""
        name, literal = self.name(), self.random.choice(LITERALS)
        single = [
            f"MOVLW {literal}", f"MOVF {name},W", f"MOVWF {name}", f"CLRF {name}",
            f"{self.one('INCF', 'DECF', 'COMF', 'RLF', 'SWAPF')} {name},{self.one('W', 'F')}",
            f"{self.one('ADDWF', 'SUBWF', 'ANDWF', 'IORWF', 'XORWF')} {name},{self.one('W', 'F')}",
            f"{self.one('ADDLW', 'SUBLW', 'ANDLW', 'IORLW')} {literal}",
            f"MOVF {name},F", f"{self.one('BSF', 'BCF')} {self.bit()}",
        ]  # fmt: skip
        chosen = self.random.random()
        if chosen < 0.06:
            return [self.one("NOP", "DELAY 5", "CALL g", "CALL g", "*NOP", "*INCF ga,F")]
        if chosen < 0.25:
            return [self.one(f"MOVF {name},W", f"INCF {name},W", f"MOVLW {literal}"), f"MOVWF {self.name()}"]
        return [self.random.choice(single)]

    def run(self, most: int) -> list[str]:
        """Up to so many instructions, some of them guarded by a skip."""
        lines: list[str] = []
        for _ in range(self.random.randint(1, most)):
            if self.random.random() < 0.2:
                lines += [self.test(), self.instruction()[0]]
            else:
                lines += self.instruction()
        return lines

    def test(self) -> str:
        if self.random.random() < 0.1:
            return f"{self.one('DECFSZ', 'INCFSZ')} {self.name()},{self.one('W', 'F')}"
        return f"{self.one('BTFSC', 'BTFSS')} {self.bit()}"

    def label(self) -> str:
        self.labels += 1
        return f"a{self.labels}"

    def choice(self) -> list[str]:
        """Two arms, which may begin or end alike."""
        other, end = self.label(), self.label()
        yes, no = self.run(self.random.choice((1, 1, 3))), self.run(2)
        like = self.random.random()
        if like < 0.2:
            same = self.run(1)
            yes, no = same + yes, same + no
        elif like < 0.4:
            same = self.run(2)
            yes, no = yes + same, no + same
        leave = self.one(f"GOTO {end}", f"GOTO {end}", "RETURN")
        after = [leave] if self.random.random() < 0.3 else []
        return [self.test(), f"GOTO {other}", *yes, leave, f"{other}:", *no, *after, f"{end}:"]

    def loop(self) -> list[str]:
        """A loop that counts; what is inside may change its count."""
        again, count = self.label(), self.name()
        middle = self.one("", f"MOVF {count},F", f"MOVF {count},W")
        body = [*self.run(2), f"{self.one('DECF', 'INCF')} {count},F", *([middle] if middle else [])]
        return [f"{again}:", *body, self.one("BTFSS Z", "BTFSS Z", "BTFSC Z"), f"GOTO {again}"]

    def jumps(self) -> list[str]:
        """A skip around jumps."""
        near, far = self.label(), self.label()
        lines = [self.test(), f"GOTO {near}", self.one(f"GOTO {far}", "CLRF ga", "RETURN"), f"{near}:"]
        return [*lines, *(self.run(1) if self.random.random() < 0.5 else []), f"{far}:"]

    def text(self) -> str:
        lines: list[str] = []
        for _ in range(self.random.randint(1, 3)):
            part = self.random.random()
            lines += (
                self.choice()
                if part < 0.4
                else self.jumps()
                if part < 0.55
                else self.loop()
                if part < 0.65
                else self.run(4)
            )
        return "; ".join([*lines, self.one("RETURN", "RETURN", "CALL g; RETURN", "RETLW 3")])


class Watched(Chip):
    """The chip with pointers and overlapping variables, noting every access that can be seen."""

    def __init__(self, made: Function, names: Names, random: Random) -> None:
        super().__init__({"f": made, "g": Function("g")})
        self.names = names
        self.seen: list[tuple[str, int]] = []
        self.most = 400
        for register in registers().values():
            self.memory[Reg(register.address)] = random.choice((0, 1, 2, 3, 255))
        unwritten = random.choice((0, 1, 2, 3, 255))
        for name in BYTES:
            for offset in range(4):
                own = name in ("l", "t", "t1", "x")  # two of them that were never written may become one
                value = unwritten if own else random.choice((0, 1, 2, 3, 255))
                self.memory[Byte(names[name], offset)] = value
        self.w = random.choice((0, 1, 255))
        self.c, self.dc, self.z = (random.random() < 0.5 for _ in range(3))

    def place(self, loc: Loc) -> Loc:
        """Where a byte is: INDF leads on, and both variables at the fixed address are one."""
        if loc == INDF:
            loc = Byte(self.names[POINTED[self.memory[FSR] & 3]], 0)
        if isinstance(loc, Byte) and loc.symbol.kind == "fixed":
            return Byte(self.names["fa"], loc.offset)
        return loc

    def watch(self, what: str, loc: Loc, value: int) -> None:
        if isinstance(loc, Reg) and loc not in (FSR, STATUS):
            self.seen.append((f"{what} {loc.address}", value))
        elif isinstance(loc, Byte) and loc.symbol.volatile:
            self.seen.append((f"{what} {loc.symbol.name}", value))

    def read(self, loc: Loc | None) -> int:
        assert loc is not None
        value = super().read(self.place(loc))
        self.watch("read", loc, value)
        return value

    def _write(self, ins, value, *, to_file):  # type: ignore[no-untyped-def]
        if to_file:
            ins = ins.copy()
            ins.f = self.place(ins.f)
            self.watch("write", ins.f, value)
        super()._write(ins, value, to_file=to_file)
        if ins.f == INDF and to_file:
            self.seen.append(("pointer", value))

    def waited(self, cycles: int) -> None:
        self.seen.append(("delay", cycles))
        self.scramble(cycles)

    def scramble(self, value: int) -> None:
        self.w = value * 37 & 0xFF
        self.c, self.dc, self.z = (bool(value >> bit & 1) for bit in range(3))

    def call(self, name: str) -> None:
        if name != "g":
            super().call(name)
            return
        argument = Byte(self.names["x"], 0)
        self.seen.append(("call", self.w << 8 | self.memory[argument]))
        for changed in ("ga", "fa", "n", "x"):
            self.memory[Byte(self.names[changed], 0)] ^= self.w + 1 & 0xFF
        self.memory[FSR] ^= 1
        self.scramble(self.w ^ self.memory[argument])


def left(text: str, made: Function, names: Names, seed: int, result: str) -> object:
    """What a function leaves for a start value; None if it does not end."""
    chip = Watched(made, names, Random(seed))
    try:
        chip.call("f")
    except AssertionError:
        return None
    kept = ("ga", "gb", "va", "fa")
    memory = [chip.memory[Byte(names[name], offset)] for name in kept for offset in range(4)]
    value = chip.w if result == "W" else chip.number(names["l"], 4) if result == "l" else None
    return memory, chip.memory[FSR], value, chip.seen


@cache
def examples() -> list[tuple[str, str]]:
    """Texts of functions, and where each has its result."""
    found = []
    for seed in range(FUNCTIONS):
        random = Random(seed)
        found.append((Writer(random).text(), random.choice(("", "W", "l"))))
    return found


@pytest.mark.parametrize("name", PASSES)
def test_a_pass_keeps_the_meaning(name: str) -> None:
    rewritten = 0
    for text, result in examples():
        names = Names()
        for each in BYTES:
            names[each]
        before, made = function(text, names), function(text, names)
        made.returns_w = result == "W"
        made.result = names["l"] if result == "l" else None
        changed = PASSES[name](made)
        assert changed is (texts(made) != texts(before)), text
        assert not list(faults(made)), text
        rewritten += changed
        for seed in range(3 if changed else 0):
            expected = left(text, before, names, seed, result)
            if expected is not None:
                assert left(text, made, names, seed, result) == expected, f"{text}\n{'; '.join(texts(made))}"
    assert rewritten > 0
