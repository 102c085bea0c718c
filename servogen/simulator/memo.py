"""The memo of regions that only count: their effect for every state that they depend on. Compiled.

A row of the memo holds the key (PC, W, STATUS, and the unknown bits of the latter two), the registers before,
the cycles taken, the key after and the registers after. Regions with unknown bytes of RAM are not memoized. A
region is executed in one step only if it ends before any event can happen, so that the step has the same
effect as the single instructions.
"""

from __future__ import annotations

from servogen.simulator.compiled import Vector, compiled
from servogen.simulator.layout import MEMO_COLUMNS, MEMO_ROWS, RECORD, REGION, UNKNOWN


@compiled
def pack_processor(pc: int, w: int, status: int, wu: int, su: int) -> int:
    """Return PC (13 bits), W, STATUS, and the unknown bits of W and STATUS (16 bits each) as one integer."""
    return su << 45 | wu << 29 | pc << 16 | w << 8 | status


@compiled
def pack_registers(s: Vector, regions: Vector, region: int) -> int:
    """Return the region's bytes of RAM as one integer, or UNKNOWN if a bit of one is unknown."""
    packed = 0
    for i in range(regions[REGION * region]):
        value = s[regions[REGION * region + 1 + i]]
        if value > 0xFF:
            return UNKNOWN
        packed = packed << 8 | value
    return packed


@compiled
def row_of(key: int, registers: int) -> int:
    """Return the index of the only row that can hold the region's effect for this state."""
    # Two odd multipliers and a fold of the upper bits: neighbouring keys fall into different rows. A
    # collision replaces the row, which costs time only, because `lookup` compares the whole key.
    mixed = key * 0x1E3779B97F4A7C15 ^ registers * 0x2545F4914F6CDD1D
    return ((mixed ^ mixed >> 29) & (MEMO_ROWS - 1)) * MEMO_COLUMNS


@compiled
def lookup(memo: Vector, key: int, registers: int) -> int:
    """Return the index of the row with the region's effect, or UNKNOWN."""
    row = row_of(key, registers)
    if memo[row] == key and memo[row + 1] == registers:
        return row
    return UNKNOWN


@compiled
def recall(s: Vector, memo: Vector, row: int, regions: Vector, region: int) -> None:
    """Set the registers to the values that the region left."""
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
    """Record that the region at `depth` is left now, with the processor as `pack_processor` packs it."""
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
