"""The checker's chip, which is C (`chip.c`): its program, what is around it, and its functions.

In: a vector of integers (the state, `layout.py`), the program, the edges that are due in this frame. Out: the
state later, and the reason why it stopped.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from servogen.checker import layout
from servogen.pic.image import Image
from servogen.pic.isa import decode

Ints = npt.NDArray[np.int64]


class ChipMemory(NamedTuple):
    """What the chip holds, and tables; `Memory` in chip.c."""

    code: Ints
    eeprom: Ints
    """The cells of the EEPROM; then whether one was read, and whether a write began."""
    slots: Ints
    """Of each address, with the bank in bit 7."""
    tape: Ints
    """The bytes of a tape."""
    memo: Ints
    """Results of unknown operands, behind their keys."""


def program_code(image: Image, cuts: frozenset[int]) -> Ints:
    """Return the program decoded; runs stop at `cuts`."""
    code = np.zeros((1024, layout.IS_CUT + 1), dtype=np.int64)
    for address, word in image.program.items():
        decoded = decode(word)
        if decoded is None:
            continue
        row = decoded.instruction
        name = layout.SAME_AS.get(row.mnemonic, row.mnemonic)
        name = name if name in layout.OPERATIONS else name[:3] if name[:3] in layout.OPERATIONS else "CLR"
        slot = {"RETFIE": layout.INTCON, "OPTION": layout.OPTION, "TRIS": decoded.f + layout.BANK_1}.get(
            row.mnemonic, layout.NOWHERE
        )
        x = layout.GIE if slot == layout.INTCON else 1 << decoded.b
        x = layout.X_IS_CARRY if "C" in row.reads else layout.X_IS_W if "W" in row.reads else x
        code[address] = (
            layout.FLOWS.index(row.mnemonic if row.mnemonic in layout.FLOWS else row.flow),
            layout.OPERATIONS.index(name),
            decoded.f if "f" in row.operands and not slot else -1,
            slot,
            "f" in row.reads or row.mnemonic == "RETFIE",
            decoded.k,
            x,
            sum(layout.STATUS_BITS.get(flag, 0) for flag in row.flags),
            row.writes_w(decoded.d),
            row.writes_file(decoded.d) or slot,
            address in cuts,
        )
    return code


def slot_table() -> Ints:
    """Return the slot of each address: a register of both banks, or of one; NOWHERE for those without."""
    slots = np.full(256, layout.NOWHERE)
    for slot in (*(row.slot for row in layout.REGISTERS if row.slot != layout.W), layout.EECON2):
        slots[slot if slot < layout.BANK_1 else slot - layout.BANK_1 | 0x80] = slot
    both = [row.slot for row in layout.REGISTERS if row.both_banks]
    for low in (layout.PCL, *both, *range(layout.RAM, layout.RAM_END)):
        slots[[low, low | 0x80]] = low
    return slots


def memory_of(
    image: Image, cuts: frozenset[int], any_eeprom: bool = False, tape: bytes = b"\0"
) -> ChipMemory:
    """Return what the chip holds; with `any_eeprom` every cell of its EEPROM is unknown."""
    cells = [layout.UNKNOWN if any_eeprom else image.eeprom.get(cell, 0xFF) for cell in range(64)]
    recorded = np.frombuffer(tape, dtype=np.uint8).astype(np.int64)
    memo = np.full((layout.MEMO, 2), -1)
    return ChipMemory(program_code(image, cuts), np.array([*cells, 0, 0]), slot_table(), recorded, memo)


def after_reset(stage: int, width: int = layout.SLOTS) -> Ints:
    """Return the state after any reset: what DS35007 table 6-4 does not define is unknown."""
    s = np.zeros(width, dtype=np.int64)
    s[layout.RAM : layout.RAM_END] = s[layout.CHOSEN] = layout.UNKNOWN
    for row in layout.REGISTERS:
        s[row.slot] = row.reset
    s[layout.STAGE] = stage
    return s


@cache
def library() -> ctypes.CDLL:
    return layout.NATIVE.load()


def exported(
    library: Callable[[], ctypes.CDLL], name: str, result: type[ctypes.c_int64] | None = ctypes.c_int64
) -> Callable[..., int]:
    """Return a function of a library, which is loaded when it is first called.

    It takes the arguments of the C: numbers; vectors, boards, edges and memories as pointers.
    """

    @cache
    def function() -> Any:
        found = library()[name]
        found.restype = result
        return found

    def call(*arguments: Any) -> int:
        value: int = function()(*map(_as_c, arguments))
        return value

    return call


def _as_c(argument: Any) -> Any:
    """Return an argument as C takes it: a number, or the address of numbers of 64 bits."""
    if isinstance(argument, np.ndarray):
        return ctypes.c_void_p(_address(argument))
    if isinstance(argument, ChipMemory):
        return _pack(*map(_address, argument))
    return _pack(*argument) if isinstance(argument, tuple) else ctypes.c_int64(int(argument))


def _address(vector: Ints) -> int:
    if vector.dtype != np.int64 or not vector.flags.c_contiguous:
        raise TypeError("a vector of the chip is of 64-bit integers, one beside the other")
    address: int = vector.__array_interface__["data"][0]  # half the time of vector.ctypes.data
    return address


@lru_cache(maxsize=256)
def _pack(*numbers: int) -> Any:
    """Return numbers as a struct of C, which has no others and writes to none: runs share it."""
    return (ctypes.c_int64 * len(numbers))(*map(int, numbers))


def edges(at: Ints, out: Ints) -> tuple[int, ...]:
    """Return the edges of a frame as C takes them."""
    return len(at), _address(at), _address(out)


at_rest, _run = exported(library, "at_rest"), exported(library, "run")


def run(
    s: Ints, used: Ints, edge_at: Ints, edge_out: Ints, memory: ChipMemory, board: layout.ChipSurroundings
) -> int:
    """Run to the next cut, fork, frame or last edge of a frame, and return the reason; the instruction at PC
    is not executed.

    Note in `used` which of W and the RAM were read before they were written, and which were written.
    """
    return _run(s, used, edges(edge_at, edge_out), memory, board)
