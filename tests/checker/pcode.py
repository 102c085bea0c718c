"""Ghidra's semantics of the PIC16 as vectors: the instruction of a word on many operands at once.

In: a word and vectors of register values. Out: the registers afterwards. The semantics are those of pypcode,
written by other people from the data sheets of the family.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pypcode

LANGUAGES = ("PIC-16:LE:16:PIC-16", "PIC-16:LE:16:PIC-16F")
Vector = npt.NDArray[np.int64]
Place = tuple[str, int]

BINARY: dict[str, Callable[[Vector, Vector], Vector]] = {
    "INT_ADD": lambda a, b: a + b,
    "INT_SUB": lambda a, b: a - b,
    "INT_AND": lambda a, b: a & b,
    "INT_OR": lambda a, b: a | b,
    "INT_XOR": lambda a, b: a ^ b,
    "INT_LEFT": lambda a, b: a << b,
    "INT_RIGHT": lambda a, b: a >> b,
    "INT_EQUAL": lambda a, b: (a == b).astype(np.int64),
    "INT_NOTEQUAL": lambda a, b: (a != b).astype(np.int64),
    "INT_LESS": lambda a, b: (a < b).astype(np.int64),
    "INT_LESSEQUAL": lambda a, b: (a <= b).astype(np.int64),
    "BOOL_AND": lambda a, b: a & b,
    "BOOL_OR": lambda a, b: a | b,
}


class Semantics:
    """One of Ghidra's two languages for the chip's family."""

    def __init__(self, language: str) -> None:
        self._context = pypcode.Context(language)
        registers = {name: (node.space.name, node.offset) for name, node in self._context.registers.items()}
        self.w: Place = registers["W"]
        self.skip: Place = registers["SkipNext"]

    def execute(self, word: int, address: int, values: dict[Place, Vector]) -> dict[Place, Vector]:
        """Return `values` after the instruction; "goto" holds the target of a jump."""
        state = dict(values)
        size = len(next(iter(values.values())))
        code = word.to_bytes(2, "little")
        for op in self._context.translate(code, 2 * address, max_instructions=1).ops:
            name = op.opcode.name
            ins = [self._value(node, state, size) for node in op.inputs]
            if name in ("IMARK", "CALLOTHER"):
                continue
            if name in ("BRANCH", "BRANCHIND", "CALL", "CALLIND", "RETURN"):
                direct = name in ("BRANCH", "CALL")
                state["goto", 0] = np.full(size, op.inputs[0].offset) if direct else ins[0]
                continue
            if name in ("LOAD", "STORE"):
                space = op.inputs[0].getSpaceFromConst().name
                place = (space, int(ins[1][0])) if space == "DATA" else (space, 0)
                assert space != "DATA" or (ins[1] == ins[1][0]).all()
                if name == "STORE":
                    state[place] = ins[2]
                    continue
                result = state.get(place, np.zeros(size, dtype=np.int64))
            else:
                result = self._result(name, ins, op.inputs)
            assert op.output is not None
            state[op.output.space.name, op.output.offset] = result & (1 << 8 * op.output.size) - 1
        return state

    def _value(self, node: pypcode.Varnode, state: dict[Place, Vector], size: int) -> Vector:
        if node.space.name == "const":
            return np.full(size, node.offset & 0xFFFFFFFF, dtype=np.int64)
        value = state.get((node.space.name, node.offset), np.zeros(size, dtype=np.int64))
        return value & (1 << 8 * node.size) - 1

    def _result(self, name: str, ins: list[Vector], nodes: list[pypcode.Varnode]) -> Vector:
        if name in BINARY:
            return BINARY[name](*ins)
        whole, sign = 1 << 8 * nodes[0].size, 1 << 8 * nodes[0].size - 1
        if name in ("COPY", "INT_ZEXT", "CAST"):
            return ins[0]
        if name == "INT_NEGATE":
            return ~ins[0]
        if name == "BOOL_NEGATE":
            return 1 - ins[0]
        if name == "INT_CARRY":
            return (ins[0] + ins[1] >= whole).astype(np.int64)
        if name == "INT_SLESS":
            return ((ins[0] ^ sign) < (ins[1] ^ sign)).astype(np.int64)
        raise AssertionError(f"p-code operation {name} is not handled")
