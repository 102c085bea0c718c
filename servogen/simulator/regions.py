"""Finds what the instruction loop can execute in one step: regions that only count, and waits that only poll.

In: an image. Out: its words decoded (`words.py`), and code with these places marked. A region is a strongly
connected set of instructions that access only W, STATUS's flags and a few bytes of RAM. Its effect and its
duration depend on these alone, so the loop memoizes it (`core/memo.h`). A region nested in another one,
without the outer one's heads, is a region of its own. A wait is a GOTO back over NOPs, CLRWDTs and at most
one bit test: it reads the same until an event happens, as does one for TMR0 to equal a byte, of which the
end is known beforehand.

    outer  MOVLW 200        head of region 0: outer .. GOTO outer
           MOVWF a
    inner  DECFSZ a,F       head of region 1: inner .. GOTO inner
           GOTO inner
           DECFSZ b,F
           GOTO outer
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
import numpy.typing as npt

from servogen.errors import InputError
from servogen.graph import components
from servogen.pic.device import PROGRAM_WORDS, masks
from servogen.pic.image import Image
from servogen.pic.isa import INSTRUCTIONS, Opcode, decode
from servogen.simulator.layout import (
    DEEPEST_RECORDING,
    EEDATA_ADDRESS,
    INTCON_ADDRESS,
    PORTA_ADDRESS,
    PORTB_ADDRESS,
    REGION,
    REGION_BYTES,
    STATUS_ADDRESS,
    TMR0_ADDRESS,
)
from servogen.simulator.words import (
    BREAK,
    D_BIT,
    DIRECT_BIT,
    ERASED,
    EXIT,
    F_SHIFT,
    K_SHIFT,
    LOOP,
    MASK_SHIFT,
    OP_MASK,
    OPS,
    SPIN,
    UNDEFINED,
    UNTIL,
    WAITS_BIT,
    pack,
)

LONGEST_WAIT = 64
"""The maximum number of words of a wait."""
PROGRAMS_KEPT = 16
"""The search for a counterexample starts one program thousands of times."""
FLAG_BITS = 0b111
POLLED = (PORTA_ADDRESS, PORTB_ADDRESS, EEDATA_ADDRESS, INTCON_ADDRESS)
"""Registers that stay the same until an event: ports, EECON1 (and, in the other bank, TRIS and EEDATA),
INTCON.
"""

_N = PROGRAM_WORDS
_ROWS = {OPS[row.mnemonic]: row for row in INSTRUCTIONS}
_IDLE = ("NOP", "CLRWDT")
_FOR_TMR0 = ("MOVF", "XORWF", "BTFSS")
"""The body of the wait for TMR0 to equal a byte: MOVF TMR0,W; XORWF byte,W; BTFSS STATUS,Z."""
(Z,) = masks("Z")
_ON_W_ALONE = frozenset(
    OPS[row.mnemonic]
    for row in INSTRUCTIONS
    if "f" not in row.operands and row.flow in ("next", "jump") and not set(row.flags) & set("TP")
)
"""Instructions that access no register and not the watchdog."""

Code = npt.NDArray[np.int64]
Graph = Mapping[int, tuple[int, ...]]


@dataclass(frozen=True, slots=True)
class FastCode:
    """Row 0 of `code` is the program with its places marked; row n + 1 is region n, with EXIT everywhere
    else.

    `regions` holds, for each region, the number of its RAM bytes and their addresses.
    """

    code: Code
    regions: npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class _Region:
    members: frozenset[int]
    heads: frozenset[int]
    ram: tuple[int, ...]


def program_code(image: Image) -> Code:
    """Return the image's program, decoded: 1024 words."""
    code = [ERASED] * _N
    for address, word in image.program.items():
        if address < _N:
            code[address] = _packed_word(word)
    return np.array(code, dtype=np.int64)


@cache
def _packed_word(word: int) -> int:
    decoded = decode(word)
    return UNDEFINED if decoded is None else pack(decoded)


def fast_code(plain: Code) -> FastCode:
    """Return the program with every region and wait marked, in arrays that cannot be written."""
    return _fast_code(plain.tobytes())


@lru_cache(maxsize=PROGRAMS_KEPT)
def _fast_code(plain: bytes) -> FastCode:
    words: list[int] = np.frombuffer(plain, dtype=np.int64).tolist()
    waits = _waits(words)
    pure = {address for address in range(_N) if _is_pure(words[address])} - set(waits)
    graph = {address: _successors(words, address) for address in range(_N)}
    entered = _entries(graph, pure)
    regions = list(_regions(words, graph, pure, entered))
    marks = {head: LOOP | n << F_SHIFT for n, region in enumerate(regions) for head in region.heads}
    rows = [[waits.get(a, marks.get(a, words[a])) for a in range(_N)]]
    # A region is recorded while its own row runs: its heads are plain words there, or it would enter itself,
    # the regions nested in it keep their marks, and every other address ends the recording.
    for region in regions:
        inner = {a: words[a] if a in region.heads else marks.get(a, words[a]) for a in region.members}
        rows.append([inner.get(a, EXIT) for a in range(_N)])
    table = np.zeros((max(1, len(regions)), REGION), dtype=np.int64)
    for n, region in enumerate(regions):
        table[n, 0] = len(region.ram)
        table[n, 1 : 1 + len(region.ram)] = region.ram
    fast = FastCode(np.array(rows, dtype=np.int64).reshape(-1), table.reshape(-1))
    for shared in (fast.code, fast.regions):
        shared.setflags(write=False)
    return fast


def marked_code(code: Code, plain: Code, breakpoints: Set[int]) -> Code:
    """Return `code` with `breakpoints`; a region or wait that contains one is not executed in one step."""
    if not breakpoints:
        return code
    code = code.copy()
    rows = code.reshape(-1, _N)
    for wait in np.flatnonzero(is_wait(rows[0])).tolist():
        if not breakpoints.isdisjoint(_span(int(rows[0, wait]), wait)):
            rows[0, wait] = plain[wait]
    for address in breakpoints:
        if not 0 <= address < _N:
            raise InputError("out-of-range", f"breakpoint at 0x{address:04X}: the program has {_N} words")
        # A region that contains the address runs word by word, from wherever it is entered.
        for region in np.flatnonzero(rows[1:, address] != EXIT):
            heads = rows == (LOOP | region << F_SHIFT)
            rows[heads] = np.broadcast_to(plain, rows.shape)[heads]
    for address in breakpoints:
        rows[0, address] = BREAK
    return code


def is_wait(row: Code) -> npt.NDArray[np.bool_]:
    """Return which words of a row are those at which a wait turns."""
    marked: npt.NDArray[np.bool_] = np.isin(row & OP_MASK, (SPIN, UNTIL)) | (row >> WAITS_BIT != 0)
    return marked


def _span(word: int, address: int) -> range:
    """Return the addresses of the wait that turns at `address`, by its marked word."""
    if word & OP_MASK == UNTIL:
        return range(address - len(_FOR_TMR0), address + 1)
    spins = word & OP_MASK == SPIN
    end = address if spins else address + 1
    period = word >> (F_SHIFT if spins else WAITS_BIT + 1) & 0xFF
    return range(end - (period - 2), end + 1)


def _row(word: int) -> Opcode | None:
    """Return the instruction of a word; None for OPTION, TRIS, marks and words that are not instructions."""
    return _ROWS.get(word & OP_MASK)


def _name(word: int) -> str:
    row = _row(word)
    return row.mnemonic if row else ""


def _file(word: int) -> int:
    return word >> F_SHIFT & 0x7F


def _target(word: int) -> int:
    return (word >> K_SHIFT & 0x7FF) % _N


def _is_pure(word: int) -> bool:
    """Return whether an instruction depends on, and changes, only W, flags and directly addressed RAM."""
    row = _row(word)
    if row is None or "f" not in row.operands:
        return word & OP_MASK in _ON_W_ALONE
    if word >> DIRECT_BIT & 1:
        return True
    if _file(word) != STATUS_ADDRESS:
        return False
    if row.changes_bit:
        return bool(word >> MASK_SHIFT & 0xFF & FLAG_BITS)
    return row.tests_bit or (row.mnemonic == "MOVF" and not word >> D_BIT & 1)


def _successors(words: list[int], address: int) -> tuple[int, ...]:
    """Return the addresses where execution can continue, as far as the word itself determines them."""
    word = words[address]
    following = (address + 1) % _N
    row = _row(word)
    match row.flow if row else "next":
        case "jump":
            return (_target(word),)
        case "call":
            return (following, _target(word))
        case "return":
            return ()
        case "skip":
            return (following, (address + 2) % _N)
    return (following,)


def _waits(words: list[int]) -> dict[int, int]:
    """Return the marked word of each place where a wait turns: its test, or its GOTO."""
    marked: dict[int, int] = {}
    for address in range(_N):
        if _name(words[address]) != "GOTO":
            continue
        target = _target(words[address])
        length = address - target
        if not 0 <= length < LONGEST_WAIT:
            continue
        body = [_name(words[a]) for a in range(target, address)]
        period = length + 2  # each word of the body takes one cycle, GOTO two
        # The cycle of a turn in which the last CLRWDT executes, counted from 1; 0: there is none.
        clears = max((n + 1 for n, name in enumerate(body) if name == "CLRWDT"), default=0)
        tested = words[address - 1]
        if all(name in _IDLE for name in body):
            marked[address] = SPIN | period << F_SHIFT | clears << (F_SHIFT + 8)
        elif _tests_bit(tested) and all(name in _IDLE for name in body[:-1]) and _is_polled(tested):
            marked[address - 1] = (
                tested | 1 << WAITS_BIT | period << (WAITS_BIT + 1) | clears << (WAITS_BIT + 9)
            )
        elif tuple(body) == _FOR_TMR0 and _compares_tmr0(*words[target:address]):
            marked[address] = UNTIL | _file(words[target + 1]) << F_SHIFT
    return marked


def _compares_tmr0(load: int, compare: int, test: int) -> bool:
    """Return whether the three words test, with Z, whether TMR0 equals a byte of RAM."""
    to_w = not (load | compare) >> D_BIT & 1
    equal = _file(test) == STATUS_ADDRESS and test >> MASK_SHIFT & 0xFF == Z
    return to_w and equal and _file(load) == TMR0_ADDRESS and bool(compare >> DIRECT_BIT & 1)


def _tests_bit(word: int) -> bool:
    row = _row(word)
    return row is not None and row.tests_bit


def _is_polled(word: int) -> bool:
    return bool(word >> DIRECT_BIT & 1) or _file(word) in POLLED


def _entries(graph: Graph, pure: set[int]) -> dict[int, set[int]]:
    """Return the predecessors of each pure instruction."""
    before: dict[int, set[int]] = {address: set() for address in pure}
    for address, following in graph.items():
        for successor in following:
            if successor in before:
                before[successor].add(address)
    return before


def _regions(
    words: list[int], graph: Graph, nodes: set[int], before: dict[int, set[int]], level: int = 0
) -> Iterable[_Region]:
    """Yield the regions among `nodes`, outer ones before those nested in them."""
    if level == DEEPEST_RECORDING:
        return
    for members in _components(graph, nodes):
        # Without a way in, a region is dead code, or a reset, an interrupt or a computed jump enters it.
        # Then any head will do: until execution comes to it, the words run one by one.
        heads = frozenset(a for a in members if before[a] - members) or frozenset({min(members)})
        ram = tuple(
            sorted({_file(words[a]) for a in members if words[a] >> DIRECT_BIT & 1 and _uses_file(words[a])})
        )
        if len(ram) <= REGION_BYTES:
            yield _Region(members, heads, ram)
        yield from _regions(words, graph, set(members - heads), before, level + 1)


def _uses_file(word: int) -> bool:
    row = _row(word)
    return row is not None and "f" in row.operands


def _components(graph: Graph, nodes: set[int]) -> list[frozenset[int]]:
    """Return the strongly connected sets of `nodes` that contain a cycle."""
    within = {node: [follower for follower in graph[node] if follower in nodes] for node in sorted(nodes)}
    return [frozenset(component) for component in components(within)]
