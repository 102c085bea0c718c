"""What regions that only count did before, by everything that they depend on. Compiled.

A row of the memory: key (PC, W, STATUS, and what is unknown of the latter two), registers before, cycles
taken, the same of after, registers after. Regions with unknown bytes of RAM are not remembered. A region is
taken in one step only when it ends before anything else can happen, so that the step is what the single
instructions would have done.
"""

from __future__ import annotations

from servogen.simulator.compiled import Vector, compiled
from servogen.simulator.layout import MEMO_COLUMNS, MEMO_ROWS, RECORD, REGION, UNKNOWN


@compiled
def pack_processor(pc: int, w: int, status: int, wu: int, su: int) -> int:
    """PC (13 bits), W, STATUS, and what is unknown of W and STATUS (16 bits each), as one integer."""
    return su << 45 | wu << 29 | pc << 16 | w << 8 | status


@compiled
def pack_registers(s: Vector, regions: Vector, region: int) -> int:
    """The region's bytes of RAM as one integer, or UNKNOWN when a bit of one is unknown."""
    packed = 0
    for i in range(regions[REGION * region]):
        value = s[regions[REGION * region + 1 + i]]
        if value > 0xFF:
            return UNKNOWN
        packed = packed << 8 | value
    return packed


@compiled
def row_of(key: int, registers: int) -> int:
    mixed = key * 0x1E3779B97F4A7C15 ^ registers * 0x2545F4914F6CDD1D
    return ((mixed ^ mixed >> 29) & (MEMO_ROWS - 1)) * MEMO_COLUMNS


@compiled
def lookup(memo: Vector, key: int, registers: int) -> int:
    row = row_of(key, registers)
    if memo[row] == key and memo[row + 1] == registers:
        return row
    return UNKNOWN


@compiled
def recall(s: Vector, memo: Vector, row: int, regions: Vector, region: int) -> None:
    """Put the registers as the region left them."""
    packed = memo[row + 4]
    for i in range(regions[REGION * region] - 1, -1, -1):
        s[regions[REGION * region + 1 + i]] = packed & 0xFF
        packed >>= 8


@compiled
def remember(
    s: Vector,
    memo: Vector,
    recording: Vector,
    depth: int,
    regions: Vector,
    cycle: int,
    processor: int,
) -> None:
    """The region recorded at `depth` is left now, with the processor as `pack_processor` packs it."""
    record = RECORD * depth
    registers = pack_registers(s, regions, recording[record + 3])
    if registers == UNKNOWN:
        return
    row = row_of(recording[record], recording[record + 1])
    memo[row] = recording[record]
    memo[row + 1] = recording[record + 1]
    memo[row + 2] = cycle - recording[record + 2]
    memo[row + 3] = processor
    memo[row + 4] = registers
