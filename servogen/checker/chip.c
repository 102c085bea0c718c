/* The PIC16F84 with unknown bits: runs a program from one state to the next event.

   In: the state (a vector of 64-bit integers, whose slots layout.py numbers), the program, the edges that are
   due in this frame. Out: the state later, and the reason why it stopped. A byte is a cell v | m << 8 | p <<
   16: the bits of m are unknown (and 0 in v); if p is 1, the byte is v + phi mod 256, with one phi for all
   such bytes, the unknown phase of TMR0. Section numbers are those of DS35007; the cycles of interrupts are
   those of DS30430 figures 6-4 and 8-17.

   This chip is the second witness of a proof: it shares nothing with the simulator, in which the proof was
   found, and it models less. What it does not model ends a run. */

#include <stdbool.h>
#include <stdint.h>

typedef int64_t i64;

#include "layout.h"

const char sources[] = DIGEST;

typedef struct {
    const i64 (*code)[IS_CUT + 1]; /* the program, decoded: the columns FLOW .. IS_CUT */
    i64 *eeprom;                   /* its cells; then what layout.py says */
    const i64 *slots;              /* of each address, with the bank in bit 7 */
    i64 (*memo)[2];                /* results of unknown operands, behind their keys */
} Memory;

typedef struct {
    i64 count;
    const i64 *at;  /* the cycle of each edge in the frame, */
    const i64 *out; /* and the pins after it */
} Edges;

static i64 min(i64 a, i64 b) { return a < b ? a : b; }
static i64 max(i64 a, i64 b) { return a > b ? a : b; }

/* Instructions on unknown bits ------------------------------------------------------------ */

/* Returns the result of an operation on the register or literal `a`; bit 8 is the carry. `x` is W, the carry,
   or the bit of the instruction. Skips are taken if the result is 0. */
static i64 result(i64 op, i64 a, i64 x)
{
    switch (op) {
    case DO_ADD: return a + x;
    case DO_SUB: return a + (x ^ 0xFF) + 1;
    case DO_AND: return a & x;
    case DO_IOR: return a | x;
    case DO_XOR: return a ^ x;
    case DO_COM: return ~a;
    case DO_DEC: return a - 1;
    case DO_INC: return a + 1;
    case DO_CLR: return 0;
    case DO_MOV: return a;
    case DO_MOVWF: return x;
    case DO_RLF: return a << 1 | x;
    case DO_RRF: return a >> 1 | x << 7 | (a & 1) << 8;
    case DO_SWA: return a >> 4 | a << 4;
    case DO_BCF: return a & ~x;
    case DO_BSF: return a | x;
    case DO_BTFSC: return a & x;
    default: return ~a & x; /* BTFSS */
    }
}

/* Returns the byte that an operation results in, and from bit 8 on the flags. */
static i64 known(i64 op, i64 a, i64 x)
{
    i64 r = result(op, a, x);
    i64 half_carry = ((a ^ x ^ r) >> 4 & 1) ^ (op == DO_SUB); /* it adds the complement of x */
    i64 flags = (r >> 8 & C) | half_carry * DC | ((r & 0xFF) == 0) * Z;
    return (r & 0xFF) | flags << 8;
}

/* Returns what the results have in common over all choices of the unknown bits and phi of cells `a` and `x`:
   a cell, from bit 24 on the flags, and from bit 32 on the unknown flags. */
static i64 joined(i64 op, i64 a, i64 x)
{
    i64 every = -1, some = 0, first = 0, choice;
    i64 mask = (a >> 8 & 0xFF) | (x & UNKNOWN);
    bool moves = (a | x) >> 16 == 1, begun = false;
    choice = mask;
    do {
        choice = (choice - mask) & mask; /* the next of the subsets of `mask`, the empty one first */
        for (i64 phase = 0; phase < ((a | x) >> 16 ? 256 : 1); phase++) {
            i64 low = (a >> 16 ? a + phase : a | choice) & 0xFF;
            i64 word = known(op, low, (x >> 16 ? x + phase : x | choice >> 8) & 0xFF);
            if (!begun)
                first = word & 0xFF;
            begun = true;
            every &= word;
            some |= word;
            moves = moves && ((word - phase) & 0xFF) == first;
        }
    } while (choice != mask);
    i64 doubt = every ^ some;
    i64 r = moves ? first | 1 << 16 : (every & 0xFF) | (doubt & 0xFF) << 8;
    return r | (every >> 8) << 24 | (doubt >> 8) << 32;
}

/* Returns the result of cells `a` and `x`, as `joined` does. */
i64 operate(i64 (*memo)[2], i64 op, i64 a, i64 x)
{
    if ((a | x) >> 8 == 0) {
        i64 word = known(op, a, x);
        return (word & 0xFF) | word >> 8 << 24;
    }
    i64 key = (op << 17 | a) << 17 | x;
    i64 *entry = memo[((uint64_t)key * SPREAD >> 40) % MEMO];
    /* A collision replaces the entry; the whole key is compared, so it costs time only. */
    if (entry[0] != key) {
        entry[0] = key;
        entry[1] = joined(op, a, x);
    }
    return entry[1];
}

/* What happens by itself ------------------------------------------------------------ */

/* Returns the cycles in which TMR0 counts one (section 5.2). */
i64 ratio(const i64 *s) { return s[OPTION] & PSA ? 1 : 2 << (s[OPTION] & PS); }

/* Returns what an instruction in `cycle` reads from TMR0. */
i64 timer(const i64 *s, i64 cycle)
{
    if (s[TMR0] & UNKNOWN)
        return UNKNOWN;
    i64 counted = max(cycle, s[TMR0_FROM]) - s[TMR0_ZERO], by = ratio(s);
    i64 ticks = counted / by - (counted % by < 0); /* rounded down */
    return (ticks & 0xFF) | (s[TMR0] & 1 << 16);
}

/* Sets the first cycle in which any chip's watchdog may time out: after CLRWDT, or after PSA or PS have
   `changed`, of which the prescaler may have kept any count (section 6.10). */
void plan_time_out(i64 *s, const Board *board, i64 changed, i64 cycle)
{
    if (!board->watchdog)
        return;
    bool scaled = s[OPTION] & PSA && !changed; /* its prescaler's count is 0 since CLRWDT */
    s[TIME_OUT_AT] = s[CLEARED] + (scaled ? board->watchdog << (s[OPTION] & PS) : board->watchdog);
    if (changed && cycle - s[CLEARED] >= board->watchdog)
        s[TIME_OUT_AT] = cycle;
}

/* Clears the watchdog, before `cycle`, and sets TO and PD (section 6.10, table 6-3). */
static void clear_watchdog(i64 *s, const Board *board, i64 cycle, i64 to_pd)
{
    s[STATUS] = (s[STATUS] & ~(TO_PD << 8 | TO_PD)) | to_pd;
    s[CLEARED] = cycle;
    s[NEXT_EVENT] = 0;
    plan_time_out(s, board, 0, cycle);
}

/* Returns the enabled flags; GIE is another matter (section 6.8). */
i64 enabled(const i64 *s) { return s[INTCON] >> 3 & (FLAGS_OF_INTCON | WRITE_OVER); }

/* Returns the enabled flags that are set; they end SLEEP, and interrupt if GIE is set. */
i64 certain(const i64 *s)
{
    i64 over = s[EECON1] & EEIF ? WRITE_OVER : 0;
    return enabled(s) & ((s[INTCON] & FLAGS_OF_INTCON) | over);
}

/* Returns the enabled flags that may be set in any cycle, by a pin, TMR0 or the end of a write. */
i64 doubtful(const i64 *s)
{
    i64 flags = s[INTCON] >> 8 | (s[EECON1] & WR ? WRITE_OVER : 0);
    return enabled(s) & (flags | (s[TMR0] >> 8 ? T0IF : 0)) & ~certain(s);
}

/* Notes whether an interrupt is sampled from `cycle` on; one that was sampled before comes. */
void request(i64 *s, i64 cycle)
{
    if (s[INTCON] & GIE && certain(s))
        s[REQUESTED] = min(s[REQUESTED], cycle);
    else if (s[REQUESTED] >= cycle)
        s[REQUESTED] = NEVER;
}

/* Goes to the interrupt vector, whose instruction is executed in `cycle` (section 6.8). */
i64 interrupt(i64 *s, i64 cycle)
{
    if (s[DEPTH] == 8)
        return OVERFLOW;
    s[STACK + s[DEPTH]] = s[PC];
    s[DEPTH] += 1;
    s[INTCON] &= ~GIE;
    s[PC] = 4;
    s[CYCLE] = cycle;
    s[REQUESTED] = NEVER;
    s[DOUBTED] = s[NEXT_EVENT] = 0;
    return INTERRUPTED;
}

/* Lets a flag that is doubtful be set now. */
void happen(i64 *s, i64 flag)
{
    if (flag == WRITE_OVER) { /* section 3.2 */
        s[EECON1] = (s[EECON1] & ~WR) | EEIF;
        s[WRITTEN_BY] = NEVER;
        s[UNFINISHED] = -1;
    } else {
        s[INTCON] = (s[INTCON] & ~(flag << 8)) | flag;
    }
}

/* Returns the cycle in which the frame's next edge is missed, or the frame ends; NEVER before the first
   pulse. */
static i64 pending(const i64 *s, const Edges *edges, const Board *board)
{
    if (s[FRAME] == BEFORE)
        return NEVER;
    return s[FRAME] + (s[EDGE] < edges->count ? edges->at[s[EDGE]] + 1 : board->period);
}

/* Processes the events that are due between two instructions; returns the reason to stop. */
i64 events(i64 *s, const Edges *edges, const Board *board)
{
    i64 now = s[CYCLE];
    if (now >= s[OVERFLOW_AT]) { /* one cycle before TMR0 is read as 00h (section 5.3) */
        happen(s, T0IF);
        request(s, s[OVERFLOW_AT]);
        s[OVERFLOW_AT] += 256 * ratio(s);
    }
    if (now >= s[WRITTEN_BY]) {
        i64 by = s[WRITTEN_BY];
        happen(s, WRITE_OVER);
        request(s, by);
    }
    if (now >= s[TIME_OUT_AT])
        return WATCHED;
    if (now > s[DARK_UNTIL])
        return DARK_PIN;
    i64 due = pending(s, edges, board);
    if (s[FRAME] != BEFORE && now >= due)
        return s[EDGE] < edges->count ? MISSING : NEW_FRAME;
    if (s[DOUBTED] && s[DECLINED] != now)
        return MAY_INTERRUPT;
    if (s[REQUESTED] < now)
        return interrupt(s, s[REQUESTED] + 3);
    /* What the next instruction samples may interrupt after it, even if it clears GIE. */
    s[DOUBTED] = s[INTCON] & GIE ? doubtful(s) : 0;
    s[DECLINED] = s[DOUBTED] ? now : -1;
    i64 next = min(min(s[OVERFLOW_AT], s[TIME_OUT_AT]), min(s[DARK_UNTIL] + 1, due));
    next = min(min(next, s[REQUESTED] + 1), min(s[WRITTEN_BY], board->limit));
    s[NEXT_EVENT] = s[DOUBTED] ? min(next, now) : next;
    return now >= board->limit ? TOO_LONG : GOES_ON;
}

/* Goes on after SLEEP, which a flag has ended, or (0) the watchdog; TMR0 stood still, and the watchdog is
   cleared (section 6.11.2). */
void wake(i64 *s, const Board *board, i64 flag)
{
    if (flag)
        happen(s, flag);
    s[PC] = (s[PC] + 1) & 0x3FF;
    s[CYCLE] += 1;
    s[DOUBTED] = 0;
    s[CHOSEN] = UNKNOWN;
    if (s[EECON1] & WR) /* it went on, at least while the oscillator started (1024 periods, section 6.6) */
        s[WRITTEN_BY] = max(s[WRITTEN_BY] - 256, s[CYCLE]);
    clear_watchdog(s, board, s[CYCLE], flag ? TO : 0);
    request(s, s[CYCLE]); /* the instruction after SLEEP is executed before the interrupt */
}

/* Goes on after a SLEEP that is a NOP, because an enabled flag is set (section 6.11.3). */
void do_not_sleep(i64 *s, i64 flag)
{
    happen(s, flag);
    request(s, s[CYCLE]); /* no other comes before it */
    s[PC] = (s[PC] + 1) & 0x3FF;
    s[CYCLE] += 1;
    s[DOUBTED] = 0;
    s[CHOSEN] = UNKNOWN;
    s[NEXT_EVENT] = 0;
}

/* Registers ------------------------------------------------------------ */

static bool is_port(i64 slot) { return slot == PORTA || slot == PORTB; }

/* Compares the pins with the expected edges after the instruction of `cycle` wrote a port or TRIS. */
i64 drive(i64 *s, const Edges *edges, const Board *board, i64 cycle)
{
    i64 tris = s[TRISA] | s[TRISB] << 5;
    i64 out = ((s[PORTA] & 0x1F) | (s[PORTB] & 0xFF) << 5) & ~tris;
    i64 dark = (s[PORTA] >> 8 | s[PORTB] >> 8 << 5) & ~tris;
    bool was_dark = s[FRAME] == BEFORE && s[DARK_UNTIL] != NEVER; /* some chip's first pulse may have begun */
    s[DARK_UNTIL] = dark ? min(s[DARK_UNTIL], cycle + GLITCH) : NEVER;
    if (s[FRAME] == BEFORE && out == 0)
        return GOES_ON;
    if (dark || was_dark || tris & board->channels)
        return DARK_PIN;
    if (s[FRAME] == BEFORE) { /* the first rise is the schedule's first edge: the frame's beginning */
        if (edges->count == 0)
            return WRONG_EDGE;
        s[FRAME] = cycle - edges->at[0];
    }
    i64 edge = s[EDGE];
    if (out == (edge ? edges->out[edge - 1] : 0))
        return GOES_ON;
    if (edge == edges->count || cycle != s[FRAME] + edges->at[edge] || out != edges->out[edge])
        return WRONG_EDGE;
    s[EDGE] += 1;
    return GOES_ON;
}

/* Returns what is read from a port: the latch where the chip drives, else what is held, else unknown. */
static i64 read_port(const i64 *s, const Board *board, i64 slot)
{
    i64 driven = ~s[slot + BANK_1], used = slot == PORTA ? 0x1F : 0xFF, shift = slot == PORTA ? 0 : 5;
    if (slot == PORTA && s[PORTA] & ~board->channels & 0x10)
        driven &= ~0x10; /* RA4 is an open drain: something outside may pull it low (section 4.1) */
    i64 held = ~driven & board->held >> shift;
    i64 unknown = ((s[slot] >> 8 & driven) | (~driven & ~held)) & used;
    return (((s[slot] & driven) | (board->levels >> shift & held)) & used & ~unknown) | unknown << 8;
}

/* Returns the byte that an instruction in `cycle` reads from a register. */
i64 read_slot(const i64 *s, const Board *board, i64 slot, i64 cycle)
{
    if (is_port(slot))
        return read_port(s, board, slot);
    if (slot == INTCON && s[TMR0] >> 8 && !(s[INTCON] & T0IF)) /* it may have overflowed */
        return (s[INTCON] & ~T0IF) | T0IF << 8;
    if (slot == TMR0)
        return timer(s, cycle);
    return slot == PCL ? (s[PC] + 1) & 0xFF : s[slot];
}

/* Writes TMR0, which then stands still for two cycles (section 5). */
static void write_timer(i64 *s, i64 cycle, i64 r)
{
    i64 m = r >> 16 ? 0xFF : r >> 8;
    if (s[TMR0] >> 8 && !(s[INTCON] & T0IF)) /* it may have overflowed */
        s[INTCON] = (s[INTCON] & ~T0IF) | T0IF << 8;
    s[TMR0] = (m && !(r >> 16)) || s[OPTION] & T0CS ? UNKNOWN : r & 1 << 16;
    s[TMR0_FROM] = cycle + 3;
    s[TMR0_ZERO] = cycle + 3 - (r & 0xFF) * ratio(s);
    s[OVERFLOW_AT] = s[TMR0] ? NEVER : s[TMR0_ZERO] + 256 * ratio(s) - 1;
}

/* Writes OPTION_REG. When TMR0 begins to count by another clock is not specified (section 5). */
static void write_option(i64 *s, const Board *board, i64 cycle, i64 r)
{
    i64 changed = s[OPTION] ^ r;
    s[OPTION] = r;
    if (changed & (T0CS | PSA | PS)) {
        s[TMR0] = UNKNOWN;
        s[TMR0_FROM] = s[TMR0_ZERO] = 0;
        s[OVERFLOW_AT] = NEVER;
    }
    if (changed & (PSA | PS))
        plan_time_out(s, board, changed, cycle);
}

/* Writes EECON1: RD reads at once; WR begins a write if the keys 55h and AAh were written to EECON2 three and
   one cycles ago, and can be set, but not cleared (section 3). */
static i64 write_eecon1(i64 *s, i64 *eeprom, const Board *board, i64 cycle, i64 r)
{
    bool began = !(s[EECON1] & WR) && r & WR;
    if (began && !(s[KEYS] == 2 && s[KEY_AT] + 1 == cycle && s[EECON1] & WREN))
        return SEQUENCE;
    s[EECON1] = (r & (EEIF | WREN | WRERR | WRERR << 8)) | ((s[EECON1] | r) & WR);
    if (began) {
        s[WRITTEN_BY] = cycle + 1 + board->longest_write;
        eeprom[EEPROM_WRITTEN] = 1;
        s[KEYS] = s[KEY_AT] = 0;
    }
    if (r & RD) {
        s[EEDATA] = s[EEADR] < 64 ? eeprom[s[EEADR]] : UNKNOWN;
        eeprom[EEPROM_READ] = 1;
    }
    request(s, cycle + 1);
    return GOES_ON;
}

/* Writes EECON2: the keys, MOVLW between them (section 3.2). */
static void write_key(i64 *s, i64 cycle, i64 r)
{
    bool second = r == 0xAA && s[KEYS] == 1 && s[KEY_AT] + 2 == cycle;
    s[KEYS] = second ? 2 : r == 0x55;
    s[KEY_AT] = cycle;
}

/* Writes a register other than PCL, STATUS and the ports by an instruction in `cycle`. */
i64 write_slot(i64 *s, i64 *eeprom, const Board *board, i64 slot, i64 cycle, i64 r)
{
    i64 m = r >> 16 ? 0xFF : r >> 8;
    if ((slot == INTCON && m & ~FLAGS_OF_INTCON) || (slot == OPTION && m) || (slot == EECON1 && m & ~WRERR))
        return REGISTER;
    switch (slot) {
    case TMR0:
        write_timer(s, cycle, r);
        break;
    case INTCON: /* INTF and RBIF may be set again at once by the pins (section 6.8) */
        s[INTCON] = (r & 0xFF) | (m | ((INTF | RBIF) & ~r)) << 8;
        request(s, cycle + 1);
        break;
    case OPTION:
        write_option(s, board, cycle, r);
        break;
    case EECON1:
        return write_eecon1(s, eeprom, board, cycle, r);
    case EECON2:
        write_key(s, cycle, r);
        break;
    case PCLATH:
        s[PCLATH] = (r & ~m & 0x1F) | (m & 0x1F) << 8;
        break;
    case NOWHERE:
        break;
    default:
        s[slot] = r;
    }
    return GOES_ON;
}

/* Instructions ------------------------------------------------------------ */

/* Stops before an instruction that depends on unknown `bits` of a slot, the lowest one first. */
i64 ask(i64 *s, i64 slot, i64 bits)
{
    s[ASKED] = slot;
    s[ASKED_BIT] = bits & -bits & 0xFF;
    return bits & 0xFF ? FORK : PHASE;
}

/* Returns the slot of the register at `f` in an instruction, or -1 to stop if it depends on unknown bits:
   those of FSR or RP0 (section 2). */
static i64 locate(i64 *s, i64 f, const i64 *slots)
{
    if (f == 0 && s[FSR] >> 8) {
        ask(s, FSR, s[FSR] >> 8);
        return -1;
    }
    if (f > 0 && slots[f] != slots[f | 0x80] && s[STATUS] >> 8 & RP0) {
        ask(s, STATUS, RP0);
        return -1;
    }
    return slots[f ? f | (s[STATUS] & RP0) << 2 : s[FSR]];
}

/* Returns a register as the next instruction reads it, with the bits that were chosen. */
static i64 chosen_register(const i64 *s, const Board *board, i64 slot)
{
    i64 a = read_slot(s, board, slot, s[CYCLE]);
    i64 chosen = a >> 8 & ~s[CHOSEN] >> 8 & 0xFF;
    return (a & ~(chosen << 8)) | (s[CHOSEN] & chosen);
}

/* Returns the reason to stop before the instruction `row` if unknown bits decide where it leads, or it reads
   buttons; `r` is the cell of its result. */
static i64 undecided(i64 *s, const i64 *row, const Board *board, i64 slot, i64 a, i64 x, i64 r)
{
    i64 m = r >> 8;
    if (a >> 8 && is_port(slot) && !row[TO_F]) {
        i64 buttons = board->buttons >> (slot == PORTB ? 5 : 0);
        i64 asked = a >> 8 & buttons & (row[FLOW] == SKIP ? x : 0xFF);
        if (asked) {
            ask(s, slot, asked);
            return BUTTON;
        }
    }
    if (row[FLOW] == SKIP && m && (m >> 8 || (r & 0xFF) == 0)) {
        i64 bits = m & a >> 8;
        /* What pins and an unknown timer say is chosen for one instruction, a bit of a register for good. */
        bool passes = is_port(slot) || slot == TMR0
            || (slot == INTCON && (s[TMR0] >> 8 || bits & (INTF | RBIF)));
        return ask(s, passes ? CHOSEN : slot, bits);
    }
    if (row[TO_F] && slot == PCL) {
        if (m)
            return s[W] >> 8 ? ask(s, W, s[W] >> 8) : ask(s, STATUS, s[STATUS] >> 8 & 1);
        if (s[PCLATH] >> 8 & 3)
            return ask(s, PCLATH, s[PCLATH] >> 8 & 3);
    }
    return GOES_ON;
}

/* Writes the result of an instruction that affects `flags` to a register. */
static i64 store(
    i64 *s, const Edges *edges, const Memory *memory, const Board *board, i64 slot, i64 r, i64 flags)
{
    if (slot == STATUS) { /* TO and PD cannot be written, nor can the flags that it affects (section 2.3.1) */
        i64 keep = (TO_PD | (flags ? 7 : 0)) * 0x101;
        s[STATUS] = (s[STATUS] & keep) | ((r >> 16 ? UNKNOWN : r) & ~keep);
        return GOES_ON;
    }
    if (slot == PCL)
        return GOES_ON;
    s[NEXT_EVENT] = 0;
    if (!is_port(slot) && slot != TRISA && slot != TRISB)
        return write_slot(s, memory->eeprom, board, slot, s[CYCLE], r);
    if (r >> 8 && (r >> 16 || slot >= TRISA))
        return REGISTER;
    s[slot] = slot == PORTA || slot == TRISA ? r & 0x1F1F : r;
    return drive(s, edges, board, s[CYCLE]);
}

/* Pushes the address of the next instruction, and goes to another (section 2.4). */
static i64 call(i64 *s, i64 address)
{
    if (s[DEPTH] == 8)
        return OVERFLOW;
    s[STACK + s[DEPTH]] = (s[PC] + 1) & 0x3FF;
    s[DEPTH] += 1;
    s[PC] = address;
    return GOES_ON;
}

/* Returns from a subroutine, or from the interrupt, in whose second cycle a flag may be sampled. */
static i64 leave(i64 *s, bool retfie)
{
    if (s[DEPTH] == 0)
        return EMPTY;
    s[DEPTH] -= 1;
    s[PC] = s[STACK + s[DEPTH]];
    s[STACK + s[DEPTH]] = 0;
    if (retfie)
        s[DOUBTED] = doubtful(s);
    return GOES_ON;
}

/* Returns whether a listed state can describe this one: it has no time of a timer that stands still, no
   interrupt under way, and no keys in EECON2. */
i64 at_rest(const i64 *s)
{
    bool keys = s[KEYS] > 0 && s[CYCLE] <= s[KEY_AT] + 2;
    return !keys && s[CYCLE] >= s[TMR0_FROM] && s[REQUESTED] == NEVER;
}

/* Notes that a slot is read. */
static void note_read(i64 *used, i64 slot)
{
    if (used[slot] == 0)
        used[slot] = READ;
}

/* Sets PC and the cycle after the instruction `row`, whose result `r` went to `slot`; returns `reason`, or
   why the stack ends the run. */
static i64 go_on(i64 *s, const i64 *row, const Board *board, i64 slot, i64 r, i64 reason)
{
    i64 flow = row[FLOW], after = (s[PC] + 1) & 0x3FF;
    i64 cycles = flow == NEXT || flow == SKIP || flow == CLRWDT ? 1 : 2;
    if (flow == SKIP && r == 0) {
        after = (s[PC] + 2) & 0x3FF;
        cycles = 2;
    } else if (row[TO_F] && slot == PCL) {
        after = (s[PCLATH] << 8 | r) & 0x3FF;
        cycles = 2;
    } else if (flow == JUMP) {
        after = row[K] & 0x3FF;
    } else if ((flow == CALL || flow == RETURN) && reason == GOES_ON) {
        reason = flow == CALL ? call(s, row[K] & 0x3FF) : leave(s, slot == INTCON);
        after = s[PC];
    } else if (flow == CLRWDT) {
        clear_watchdog(s, board, s[CYCLE] + 1, TO_PD);
    }
    if (reason == GOES_ON) {
        s[CHOSEN] = UNKNOWN;
        s[PC] = after;
        s[CYCLE] += cycles;
    }
    return reason;
}

/* Executes the instruction at PC; returns the reason to stop. */
static i64 execute(i64 *s, i64 *used, const Edges *edges, const Memory *memory, const Board *board)
{
    const i64 *row = memory->code[s[PC]];
    /* 1: the operands: a register or literal, and W, the carry or the instruction's bit */
    i64 slot = row[SLOT], a = row[K] & 0xFF, x = row[X], reason = GOES_ON;
    if (row[ADDRESS] >= 0) {
        slot = locate(s, row[ADDRESS], memory->slots);
        if (slot < 0)
            return s[ASKED_BIT] ? FORK : PHASE;
    }
    if (slot == EECON1 && s[EECON1] & WR && s[UNFINISHED] != s[CYCLE])
        return MAY_BE_WRITTEN;
    if (row[READS_F]) {
        a = slot < RAM ? chosen_register(s, board, slot) : s[slot];
        note_read(used, slot);
    }
    if (x == X_IS_W) {
        x = s[W];
        note_read(used, W);
    } else if (x == X_IS_CARRY) {
        x = s[STATUS] & 0x101;
    }
    /* 2: the result */
    i64 both = operate(memory->memo, row[OP], a, x), r = both & 0x1FFFF;
    if ((a | r) >> 8 || slot == PCL) {
        reason = undecided(s, row, board, slot, a, x, r);
        if (reason != GOES_ON)
            return reason;
    }
    /* 3: its effects */
    i64 flags = row[FLAGS] << 8 | row[FLAGS];
    s[STATUS] = (s[STATUS] & ~flags) | (both >> 24 & flags);
    if (row[TO_W]) {
        s[W] = r;
        used[W] |= CHANGED;
    } else if (row[TO_F] && RAM <= slot && slot < RAM_END) {
        s[slot] = r;
        used[slot] |= CHANGED;
    } else if (row[TO_F]) {
        reason = store(s, edges, memory, board, slot, r, flags);
    }
    /* 4: where it goes on */
    return go_on(s, row, board, slot, r, reason);
}

/* Runs to the next cut, fork, frame or last edge of a frame, and returns the reason; the instruction at PC is
   not executed.

   Notes in `used` which of W and the RAM were read before they were written, and which were written. The run
   depends on no others of these bytes, and changes none but the written ones. */
i64 run(i64 *s, i64 *used, const Edges *edges, const Memory *memory, const Board *board)
{
    s[NEXT_EVENT] = 0;
    bool pulses = s[EDGE] < edges->count;
    for (;;) {
        if (s[CYCLE] >= s[NEXT_EVENT]) {
            i64 reason = events(s, edges, board);
            if (reason == INTERRUPTED)
                continue;
            if (reason == GOES_ON && pulses && s[EDGE] == edges->count)
                return LAST_EDGE;
            if (reason != GOES_ON)
                return reason;
        }
        const i64 *row = memory->code[s[PC]];
        if (row[IS_CUT] && s[CYCLE] > 0 && s[FRAME] != BEFORE && at_rest(s) && !s[DOUBTED])
            return CUT;
        if (row[FLOW] == SLEEP)
            return SLEEPS;
        if (row[FLOW] == NO_FLOW)
            return NO_WORD;
        i64 reason = execute(s, used, edges, memory, board);
        if (reason != GOES_ON)
            return reason;
    }
}
