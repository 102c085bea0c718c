/* The memo of regions that only count: their effect for every state that they depend on.

   A row of the memo holds the key (PC, W, STATUS, and the unknown bits of the latter two), the registers
   before, the cycles taken, the key after and the registers after. Regions with unknown bytes of RAM are not
   memoized. A region is executed in one step only if it ends before any event can happen, so that the step
   has the same effect as the single instructions. regions.py finds the regions: `regions` has, for each, the
   number of its RAM bytes and their addresses. */

#ifndef MEMO_H
#define MEMO_H

#include "state.h"

typedef struct {
    i64 key, registers, cycles, after, registers_after;
} Effect;

typedef struct {
    i64 key, registers, begin, region;
} Record; /* of a region that runs word by word and is remembered when it is left */

/* The processor as one integer. */
static inline i64 pack_processor(i64 pc, i64 w, i64 status, i64 wu, i64 su)
{
    return su << 45 | wu << 29 | pc << 16 | w << 8 | status;
}

/* Returns the region's bytes of RAM as one integer, or UNKNOWN if a bit of one is unknown. */
static inline i64 pack_registers(const Chip *s, const i64 *regions, i64 region)
{
    i64 packed = 0;
    for (i64 i = 0; i < regions[REGION * region]; i++) {
        i64 value = s->file[regions[REGION * region + 1 + i]];
        if (value > 0xFF)
            return UNKNOWN;
        packed = packed << 8 | value;
    }
    return packed;
}

/* Returns the only row that can hold the region's effect for this state. */
static inline Effect *effect_of(Effect *memo, i64 key, i64 registers)
{
    /* Two odd multipliers and a fold of the upper bits: neighbouring keys fall into different rows. A
       collision replaces the row, which costs time only, because the whole key is compared. */
    uint64_t mixed = (uint64_t)key * 0x1E3779B97F4A7C15 ^ (uint64_t)registers * 0x2545F4914F6CDD1D;
    return memo + ((mixed ^ mixed >> 29) & (MEMO_ROWS - 1));
}

/* Sets the registers to the values that the region left. */
static inline void recall(Chip *s, const Effect *effect, const i64 *regions, i64 region)
{
    i64 packed = effect->registers_after;
    for (i64 i = regions[REGION * region] - 1; i >= 0; i--, packed >>= 8)
        s->file[regions[REGION * region + 1 + i]] = packed & 0xFF;
}

/* Records that a region is left now, with the processor as `pack_processor` packs it. */
static inline void remember(
    const Chip *s, Effect *memo, const Record *record, const i64 *regions, i64 cycle, i64 processor)
{
    i64 registers = pack_registers(s, regions, record->region);
    if (registers == UNKNOWN)
        return;
    *effect_of(memo, record->key, record->registers) =
        (Effect){record->key, record->registers, cycle - record->begin, processor, registers};
}

#endif
