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
    const i64 *tape;               /* the bytes of the tape */
    i64 (*memo)[2];                /* results of unknown operands, behind their keys */
} Memory;

typedef struct {
    i64 count;
    const i64 *at;  /* the cycle of each edge in the frame, */
    const i64 *out; /* and the pins after it */
} Edges;

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
static i64 ratio(const i64 *s) { return s[OPTION] & PSA ? 1 : 2 << (s[OPTION] & PS); }

/* Returns the enabled flags; GIE is another matter (section 6.8). */
static i64 enabled(const i64 *s) { return s[INTCON] >> 3 & EVERY_FLAG; }

/* Returns the enabled flags that are set; they end SLEEP, and interrupt if GIE is set. */
static i64 certain(const i64 *s)
{
    return enabled(s) & ((s[INTCON] & FLAGS_OF_INTCON) | (s[EECON1] & EEIF ? WRITE_OVER : 0));
}

/* Returns the enabled flags that may be set in any cycle, by a pin, TMR0 or the end of a write. */
static i64 doubtful(const i64 *s)
{
    i64 flags = s[INTCON] >> 8 | (s[EECON1] & WR ? WRITE_OVER : 0) | (s[TMR0] >> 8 ? T0IF : 0);
    return enabled(s) & flags & ~certain(s);
}

/* Samples the flags in this cycle; what was sampled before stays so. */
static void sample(i64 *s)
{
    if (!s[SAMPLED] && s[INTCON] & GIE && certain(s))
        s[SAMPLED] = 1;
}

/* Lets a flag be set now. */
static void happen(i64 *s, i64 flag)
{
    if (flag == WRITE_OVER) { /* section 3.2 */
        s[EECON1] = (s[EECON1] & ~WR) | EEIF;
        s[WRITE_LEFT] = 0;
    } else {
        s[INTCON] = (s[INTCON] & ~(flag << 8)) | flag;
    }
}

/* Makes TMR0 known where it was not: T0IF was set so many cycles ago, one before TMR0 is read as 00h, and was
   clear until then, because GIE and T0IE were set since it was cleared. */
static void overflow(i64 *s, i64 cycles)
{
    bool late = s[INTCON] >> 8 & T0IF || s[STILL] || s[OPTION] & T0CS;
    if (s[STAGE] != WATCHES || !(s[TMR0] & UNKNOWN) || late)
        return;
    s[TMR0] = (cycles - 1) / ratio(s);
    s[PRESCALER] = (cycles - 1) % ratio(s);
}

/* Lets one cycle pass. */
void tick(i64 *s)
{
    s[CYCLE]++;
    s[AGE]++;
    s[TIME] += s[STAGE] == RUNS || s[STAGE] == AWAITS;
    s[DARK] += s[DARK] > 0;
    s[SCL_AGE] += s[TAKES] && s[SCL_AGE] < SETTLED;
    s[SDA_AGE] += s[TAKES] && s[SDA_AGE] < SETTLED;
    s[KEY_1] -= s[KEY_1] > 0;
    s[KEY_2] -= s[KEY_2] > 0;
    if (s[STILL]) {
        s[STILL]--;
    } else if (!(s[TMR0] & UNKNOWN) && ++s[PRESCALER] >= ratio(s)) {
        s[PRESCALER] = 0;
        s[TMR0] = (s[TMR0] & 1 << 16) | ((s[TMR0] + 1) & 0xFF);
    }
    if (s[TMR0] == 0xFF && s[PRESCALER] == ratio(s) - 1 && !s[STILL])
        happen(s, T0IF); /* one cycle before TMR0 is read as 00h (section 5.3) */
    if (s[STAGE] == WATCHES && s[TMR0] & UNKNOWN && !(s[INTCON] & T0IF) && ~s[INTCON] & (GIE | T0IE))
        s[INTCON] |= T0IF << 8; /* nothing asks whether it is set */
    if (s[EECON1] & WR && --s[WRITE_LEFT] <= 0)
        happen(s, WRITE_OVER);
    s[SAMPLED] += s[SAMPLED] > 0;
    sample(s);
}

/* Returns whether any chip's watchdog may time out: since CLRWDT, or since PSA or PS have changed, of which
   the prescaler may have kept any count (section 6.10). */
static bool times_out(const i64 *s, const Board *board)
{
    i64 scale = s[OPTION] & PSA && !s[RESCALED] ? s[OPTION] & PS : 0;
    return board->watchdog && s[AGE] >= board->watchdog << scale;
}

/* Clears the watchdog, and sets TO and PD (section 6.10, table 6-3). */
static void clear_watchdog(i64 *s, i64 to_pd)
{
    s[STATUS] = (s[STATUS] & ~(TO_PD << 8 | TO_PD)) | to_pd;
    s[AGE] = s[RESCALED] = 0;
}

/* Returns the way that was chosen for what happens by itself; 0 if it has to be. */
static i64 choose(i64 *s, i64 ways)
{
    s[ASKED_BITS] = ways;
    return s[WAY] & ways;
}

/* Goes to the interrupt vector, whose instruction is executed after so many cycles (section 6.8). */
static i64 interrupt(i64 *s, i64 cycles)
{
    if (s[DEPTH] == 8)
        return OVERFLOW;
    s[STACK + s[DEPTH]] = s[PC];
    s[DEPTH] += 1;
    s[INTCON] &= ~GIE;
    s[PC] = 4;
    while (cycles-- > 0)
        tick(s);
    s[SAMPLED] = 0;
    return INTERRUPTED;
}

/* Processes what is due between two instructions; returns the reason to stop. */
i64 events(i64 *s, const Edges *edges, const Board *board)
{
    if (times_out(s, board))
        return WATCHED;
    if (s[DARK] > GLITCH + 1)
        return DARK_PIN;
    if (s[STAGE] == RUNS && s[EDGE] < edges->count && s[TIME] > edges->at[s[EDGE]])
        return MISSING;
    if (s[STAGE] == RUNS && s[EDGE] >= edges->count && s[TIME] >= board->period)
        return NEW_FRAME;
    if (s[DOUBTED]) { /* sampled in the first cycle of the latest instruction, or in its last one */
        i64 doubted = s[DOUBTED] & EVERY_FLAG, cleared = s[DOUBTED] >> 16;
        i64 way = choose(s, NOTHING | doubted | doubted << IS_NOP), flag = way & doubted;
        if (!way)
            return MAY_INTERRUPT;
        s[WAY] = s[DOUBTED] = 0;
        if (way != NOTHING) {
            i64 set = (flag ? flag : way >> IS_NOP) & ~cleared;
            if (set == T0IF)
                overflow(s, flag ? 2 : 1);
            happen(s, set);
            return interrupt(s, flag ? 1 : 2);
        }
    }
    if (s[SAMPLED] > 1)
        return interrupt(s, 4 - s[SAMPLED]);
    return s[CYCLE] >= board->limit ? TOO_LONG : GOES_ON;
}

/* SLEEP: a NOP if an enabled flag is set; else such a flag ends it, or the watchdog, or nothing does. TMR0
   stands still (section 6.11). */
static i64 sleep(i64 *s, const Board *board)
{
    i64 set = certain(s), wakers = INTF | RBIF | (s[EECON1] & WR ? WRITE_OVER : 0);
    i64 ways = doubtful(s) << IS_NOP | (enabled(s) & wakers) | (board->watchdog ? NOTHING : 0) | ENDLESS;
    i64 way = choose(s, set ? (set & -set) << IS_NOP : ways), flag = way & EVERY_FLAG;
    if (s[DARK] && !set)
        return DARK_PIN; /* it may stay so for any time */
    if (!way)
        return SLEEPS;
    if (way != NOTHING)
        happen(s, flag ? flag : way >> IS_NOP);
    bool slept = flag || way == NOTHING;
    /* A write went on, at least while the oscillator started (1024 periods, section 6.6). */
    if (slept && s[EECON1] & WR)
        s[WRITE_LEFT] = max(s[WRITE_LEFT] - 256, 1);
    if (!slept)
        sample(s); /* no other flag comes before this one */
    s[PC] = (s[PC] + 1) & 0x3FF;
    s[WAY] = 0;
    s[CHOSEN] = UNKNOWN;
    tick(s);
    if (slept)
        clear_watchdog(s, flag ? TO : 0);
    return GOES_ON;
}

/* The EEPROM of a tape, by DS20001203 ------------------------------------------------------------ */

/* Returns the levels of SCL and SDA. */
static i64 lines(const i64 *s, const Board *board)
{
    i64 tris = s[TRISA] | s[TRISB] << 5, dark = s[PORTA] >> 8 | s[PORTB] >> 8 << 5;
    i64 out = (s[PORTA] & 0xFF) | (s[PORTB] & 0xFF) << 5, scl = board->bus & ~RA4;
    if (tris & scl || dark & ~tris & board->bus)
        return FLOATS;
    return (out & scl ? SCL : 0) | ((out | tris) & RA4 && !s[PULLS] ? SDA : 0);
}

/* Lets the EEPROM be in any state, as it may be after a reset of the chip. */
static void lose(i64 *s)
{
    s[TAKES] = ANYTHING;
    s[POINTER] = -1;
    s[CLOCKS] = s[SHIFT] = s[PULLS] = s[SEEN] = s[LOWS] = 0;
}

/* SCL rises: a bit is taken, or the chip does not acknowledge (section 8.0). */
static void rise(i64 *s, const Board *board, i64 sda)
{
    if (s[SCL_AGE] < board->low_time)
        lose(s);
    else
        s[SEEN] = UNREAD;
    if (s[TAKES] <= START)
        return;
    s[CLOCKS]++;
    if (s[TAKES] == GIVING && s[CLOCKS] == 9 && sda) {
        lose(s);
        s[TAKES] = START;
        s[SEEN] = UNREAD;
    } else if (s[TAKES] != GIVING && s[CLOCKS] <= 8) {
        s[SHIFT] = (s[SHIFT] << 1 | !!sda) & 0xFFFF;
    }
}

/* The chip's byte is complete: it is acknowledged (sections 5.0, 6.1). None is written. */
static void take(i64 *s, const Board *board)
{
    bool reads = s[TAKES] == CONTROL && (s[SHIFT] & 0xFF) == 0xA1 && s[POINTER] >= 0;
    if (s[TAKES] == ADDRESSED || (s[TAKES] == CONTROL && !reads && (s[SHIFT] & 0xFF) != 0xA0)) {
        lose(s);
        return;
    }
    if (s[TAKES] == LOW_BYTE)
        s[POINTER] = s[SHIFT] & (board->size - 1);
    s[TAKES] = reads ? GIVING : s[TAKES] + 1;
    s[PULLS] = 1;
}

/* SCL falls: SDA is let go, or gets the next bit of a byte; the ninth is the chip's (section 8.3). */
static void fall(i64 *s, const Memory *memory, const Board *board)
{
    if (s[SCL_AGE] < board->high_time || s[SDA_AGE] < board->high_time)
        lose(s);
    if (s[SEEN] != READ_LOW)
        s[LOWS] = 0;
    s[SEEN] = UNSURE;
    s[PULLS] = 0;
    s[CLOCKS] %= 9;
    if (s[TAKES] != GIVING) {
        if (s[CLOCKS] == 8)
            take(s, board);
    } else if (s[CLOCKS] == 0 && s[POINTER] >= board->recorded) {
        lose(s);
    } else {
        if (s[CLOCKS] == 0)
            s[SHIFT] = memory->tape[s[POINTER]++];
        s[PULLS] = s[CLOCKS] < 8 && !(s[SHIFT] >> (7 - s[CLOCKS]) & 1);
    }
}

/* SDA changes while SCL is high: a start, or a stop (section 4). The address stays if the start comes before
   the first bit behind it. */
static void condition(i64 *s, const Board *board, i64 sda)
{
    bool known = s[TAKES] != ANYTHING || s[SEEN] == READ_HIGH, in_time = s[SCL_AGE] >= board->high_time;
    bool free = s[SDA_AGE] >= s[SCL_AGE] || s[SDA_AGE] >= board->low_time; /* after a stop */
    i64 next = s[TAKES] == ADDRESSED && s[CLOCKS] == 1 && !sda ? s[POINTER] : -1;
    lose(s);
    if (known && in_time && free) {
        s[TAKES] = sda ? START : CONTROL;
        s[POINTER] = next;
        s[SEEN] = UNREAD;
    }
}

/* Tells the EEPROM what the lines are now, after they were `before`. */
static void listen(i64 *s, const Memory *memory, const Board *board, i64 before)
{
    i64 now = lines(s, board), changed = before & FLOATS ? FLOATS : now ^ before;
    if (changed & FLOATS || changed == (SCL | SDA)) /* which is first is not certain */
        lose(s);
    else if (changed == SCL && now & SCL)
        rise(s, board, now & SDA);
    else if (changed == SCL)
        fall(s, memory, board);
    else if (changed && now & SCL)
        condition(s, board, now & SDA);
    if (changed & (SCL | FLOATS))
        s[SCL_AGE] = 0;
    if (changed & (SDA | FLOATS))
        s[SDA_AGE] = 0;
    if (!(now & SDA))
        s[LOWS] = 0;
}

/* Returns the cell of SDA that the chip reads where it lets go of it. While SCL is low the EEPROM may take up
   to 900 ns (parameter 13) to change it. */
static i64 sda_level(const i64 *s, const Board *board)
{
    bool known = s[TAKES] != ANYTHING, high = s[SEEN] == UNREAD && s[LOWS] == MOST_LOW;
    if (!(lines(s, board) & SCL) || !(known || high || s[SEEN] >= READ_LOW))
        return RA4 << 8;
    return (known ? !s[PULLS] : high || s[SEEN] == READ_HIGH) ? RA4 : 0;
}

/* Notes the level of SDA, if it was chosen, that PORTA was read with: until SCL falls it stays so. */
static void see(i64 *s, const Board *board, i64 porta)
{
    if (s[TAKES] != ANYTHING || s[SEEN] != UNREAD || !(lines(s, board) & SDA) || porta & RA4 << 8)
        return;
    s[SEEN] = porta & RA4 ? READ_HIGH : READ_LOW;
    s[LOWS] += !(porta & RA4);
}

/* Registers ------------------------------------------------------------ */

static bool is_port(i64 slot) { return slot == PORTA || slot == PORTB; }

/* Compares the pins with the expected edges after an instruction wrote a port or TRIS. */
i64 drive(i64 *s, const Edges *edges, const Board *board)
{
    i64 tris = s[TRISA] | s[TRISB] << 5, edge = s[EDGE];
    i64 judged = ~tris & ~board->bus;
    i64 out = ((s[PORTA] & 0x1F) | (s[PORTB] & 0xFF) << 5) & judged;
    i64 dark = (s[PORTA] >> 8 | s[PORTB] >> 8 << 5) & judged;
    bool was_dark = s[STAGE] == BEFORE && s[DARK]; /* some chip's first pulse may have begun */
    s[DARK] = dark ? max(s[DARK], 1) : 0;
    if (board->restart & ~tris & ~(out | dark)) {
        if (s[STAGE] != BEFORE || s[RESETS] < 0)
            return PULLED;
        s[RESETS] = s[RESETS] ? s[RESETS] : s[CYCLE];
    } else if (s[RESETS] > 0) {
        if (s[CYCLE] - s[RESETS] < board->pulled)
            return PULLED;
        s[RESETS] = -1;
    }
    if (s[STAGE] == BEFORE && out == 0)
        return GOES_ON;
    if (dark || was_dark || tris & board->channels)
        return DARK_PIN;
    if (s[STAGE] == BEFORE) { /* the first rise is the schedule's first edge: the frame's beginning */
        if (edges->count == 0)
            return WRONG_EDGE;
        s[STAGE] = RUNS;
        s[TIME] = edges->at[0];
    }
    if (out == (edge ? edges->out[edge - 1] : 0))
        return GOES_ON;
    if (edge == edges->count || s[TIME] != edges->at[edge] || out != edges->out[edge])
        return WRONG_EDGE;
    s[EDGE] += 1;
    return GOES_ON;
}

/* Returns the watched pins that the chip drives to a level that is not known. */
static i64 dark_pins(const i64 *s, const Board *board)
{
    return board->channels & ~(s[TRISA] | s[TRISB] << 5) & (s[PORTA] >> 8 | s[PORTB] >> 8 << 5);
}

/* Notes the levels of the watched pins after an instruction wrote a port or TRIS; `dark` were unknown before it.
   When a pin becomes an output for the first time, its unknown level counts as low until a low one is written. */
static i64 watch(i64 *s, const Board *board, i64 dark)
{
    i64 driven = ~(s[TRISA] | s[TRISB] << 5) & (board->channels | board->buttons);
    i64 out = driven & board->channels & ((s[PORTA] & 0xFF) | (s[PORTB] & 0xFF) << 5);
    bool was_known = dark_pins(s, board) & s[DRIVEN] & ~dark;
    s[DRIVEN] |= driven;
    if (was_known || (s[DARK] && out & ~s[EDGE]))
        return DARK_PIN;
    s[DARK] = dark_pins(s, board) ? max(s[DARK], 1) : 0;
    if (out != s[EDGE])
        s[TIME] = s[CYCLE];
    s[EDGE] = out;
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
    i64 cell = (((s[slot] & driven) | (board->levels >> shift & held)) & used & ~unknown) | unknown << 8;
    return slot == PORTA && s[TAKES] && unknown & RA4 ? (cell & ~(RA4 << 8)) | sda_level(s, board) : cell;
}

/* Returns INTCON with T0IF unknown if TMR0 is, and may have overflowed. */
static i64 intcon(const i64 *s)
{
    return s[TMR0] >> 8 && !(s[INTCON] & T0IF) ? s[INTCON] | T0IF << 8 : s[INTCON];
}

/* Returns the byte that an instruction reads from a register. */
i64 read_slot(const i64 *s, const Board *board, i64 slot)
{
    if (is_port(slot))
        return read_port(s, board, slot);
    if (slot == TMR0 && s[TMR0] & UNKNOWN)
        return UNKNOWN;
    return slot == INTCON ? intcon(s) : slot == PCL ? (s[PC] + 1) & 0xFF : s[slot];
}

/* Makes TMR0 a cell from which it counts after so many cycles. */
static void set_timer(i64 *s, i64 r, i64 still)
{
    s[TMR0] = (r & UNKNOWN) || s[OPTION] & T0CS ? UNKNOWN : r;
    s[PRESCALER] = 0;
    s[STILL] = still;
}

/* Writes EECON1: RD reads at once; WR begins a write if the keys 55h and AAh were written to EECON2 three and
   one cycles ago, and can be set, but not cleared (section 3). */
static i64 write_eecon1(i64 *s, i64 *eeprom, const Board *board, i64 r)
{
    bool began = !(s[EECON1] & WR) && r & WR;
    if (began && !(s[KEY_2] == 1 && s[EECON1] & WREN))
        return SEQUENCE;
    s[EECON1] = (r & (EEIF | WREN | WRERR | WRERR << 8)) | ((s[EECON1] | r) & WR);
    if (began) {
        s[WRITE_LEFT] = board->longest_write + 1;
        eeprom[EEPROM_WRITTEN] = 1;
    }
    if (r & RD) {
        s[EEDATA] = s[EEADR] < 64 ? eeprom[s[EEADR]] : UNKNOWN;
        eeprom[EEPROM_READ] = 1;
    }
    return GOES_ON;
}

/* Writes a register other than PCL, STATUS and the ports. */
i64 write_slot(i64 *s, i64 *eeprom, const Board *board, i64 slot, i64 r)
{
    i64 m = r >> 16 ? 0xFF : r >> 8;
    if ((slot == INTCON && m & ~FLAGS_OF_INTCON) || (slot == OPTION && m) || (slot == EECON1 && m & ~WRERR))
        return REGISTER;
    switch (slot) {
    case TMR0: /* it stands still for two cycles (section 5) */
        s[INTCON] = intcon(s);
        set_timer(s, r, 3);
        break;
    case INTCON: /* INTF and RBIF may be set again at once by the pins (section 6.8) */
        s[INTCON] = (r & 0xFF) | (m | ((INTF | RBIF) & ~r)) << 8;
        break;
    case OPTION: { /* when TMR0 begins to count by another clock is not specified (section 5) */
        i64 changed = s[OPTION] ^ r;
        s[OPTION] = r;
        if (changed & (T0CS | PSA | PS))
            set_timer(s, UNKNOWN, s[STAGE] == WATCHES ? 3 : 0); /* its overflow may have been on its way */
        if (changed & (PSA | PS))
            s[RESCALED] = board->watchdog && r & PSA;
        break;
    }
    case EECON1:
        return write_eecon1(s, eeprom, board, r);
    case EECON2: /* the keys, MOVLW between them (section 3.2) */
        s[KEY_2] = r == 0xAA && s[KEY_1] == 1 ? 2 : 0;
        s[KEY_1] = r == 0x55 ? 3 : 0;
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
    s[ASKED_BITS] = bits & -bits & 0xFF;
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
    i64 a = read_slot(s, board, slot);
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
        i64 asked = a >> 8 & buttons & (row[OP] >= DO_BTFSC ? x : 0xFF);
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
    if (s[STAGE] == WATCHES && row[TO_F] && is_port(slot) && row[X] == X_IS_W) {
        i64 bits = m & s[W] >> 8 & ~s[slot + BANK_1] & board->channels >> (slot == PORTB ? 5 : 0) & 0xFF;
        if (bits)
            return ask(s, W, bits);
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
    if (!is_port(slot) && slot != TRISA && slot != TRISB)
        return write_slot(s, memory->eeprom, board, slot, r);
    if (r >> 8 && (r >> 16 || slot >= TRISA))
        return REGISTER;
    i64 before = lines(s, board), dark = dark_pins(s, board);
    s[slot] = slot == PORTA || slot == TRISA ? r & 0x1F1F : r;
    if (s[TAKES])
        listen(s, memory, board, before);
    return s[STAGE] == WATCHES ? watch(s, board, dark) : drive(s, edges, board);
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

/* Returns from a subroutine, or from the interrupt. */
static i64 leave(i64 *s)
{
    if (s[DEPTH] == 0)
        return EMPTY;
    s[DEPTH] -= 1;
    s[PC] = s[STACK + s[DEPTH]];
    s[STACK + s[DEPTH]] = 0;
    return GOES_ON;
}

/* Returns whether a listed state can describe this one: it has no time of a timer that stands still, no
   interrupt under way, no keys in EECON2, no prescaler that has kept a count, and of a tape no other EEPROM than
   one that gives a byte, with SCL low. */
i64 at_rest(const i64 *s)
{
    bool reads = s[TAKES] == GIVING && s[SEEN] == UNSURE && s[CLOCKS] + s[PULLS] < 9;
    bool settled = s[SCL_AGE] == SETTLED && s[SDA_AGE] == SETTLED;
    return !s[KEY_1] && !s[KEY_2] && !s[STILL] && !s[SAMPLED] && !s[RESCALED]
        && (!s[TAKES] || (reads && settled));
}

/* Notes that a slot is read. */
static void note_read(i64 *used, i64 slot)
{
    if (used[slot] == 0)
        used[slot] = READ;
}

/* Goes on after the instruction `row`, whose result `r` went to `slot`; returns why the stack ends the run. */
static i64 go_on(i64 *s, const i64 *row, i64 slot, i64 r)
{
    i64 flow = row[FLOW], after = (s[PC] + 1) & 0x3FF, reason = GOES_ON;
    i64 cycles = flow == NEXT || flow == SKIP || flow == CLRWDT ? 1 : 2;
    if (flow == SKIP && r == 0) {
        after = (s[PC] + 2) & 0x3FF;
        cycles = 2;
    } else if (row[TO_F] && slot == PCL) {
        after = (s[PCLATH] << 8 | r) & 0x3FF;
        cycles = 2;
    } else if (flow == JUMP) {
        after = row[K] & 0x3FF;
    } else if (flow == CALL || flow == RETURN) {
        reason = flow == CALL ? call(s, row[K] & 0x3FF) : leave(s);
        after = s[PC];
    }
    if (reason != GOES_ON)
        return reason;
    s[WAY] = 0;
    s[CHOSEN] = UNKNOWN;
    s[PC] = after;
    while (cycles-- > 0)
        tick(s);
    if (flow == CLRWDT)
        clear_watchdog(s, TO_PD);
    return GOES_ON;
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
            return s[ASKED_BITS] ? FORK : PHASE;
    }
    if (slot == EECON1 && s[EECON1] & WR) {
        i64 way = choose(s, NOTHING | WRITE_OVER);
        if (!way)
            return MAY_BE_WRITTEN;
        if (way == WRITE_OVER) {
            happen(s, WRITE_OVER);
            sample(s);
        }
    }
    /* What the instruction samples may interrupt after it, even if it clears GIE; RETFIE has set GIE then. */
    i64 doubted = s[INTCON] & GIE || (row[FLOW] == RETURN && slot == INTCON) ? doubtful(s) : 0;
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
    if (slot == PORTA && row[READS_F])
        see(s, board, a);
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
    i64 cleared = row[TO_F] && slot == INTCON ? doubted & ~(r | r >> 8) & FLAGS_OF_INTCON : 0;
    s[DOUBTED] = doubted | cleared << 16;
    return reason == GOES_ON ? go_on(s, row, slot, r) : reason;
}

/* Runs to the next cut, fork, frame, last edge of a frame or change of watched pins, and returns the reason;
   the instruction at PC is not executed.

   Notes in `used` which of W and the RAM were read before they were written, and which were written. The run
   depends on no others of these bytes, and changes none but the written ones. */
i64 run(i64 *s, i64 *used, const Edges *edges, const Memory *memory, const Board *board)
{
    bool pulses = s[EDGE] < edges->count;
    i64 levels = s[EDGE];
    for (;;) {
        i64 reason = events(s, edges, board);
        if (reason == INTERRUPTED)
            continue;
        if (reason == GOES_ON && pulses && s[EDGE] == edges->count)
            return LAST_EDGE;
        if (reason == GOES_ON && s[STAGE] == WATCHES && s[EDGE] != levels)
            return PIN_CHANGE;
        if (reason != GOES_ON)
            return reason;
        const i64 *row = memory->code[s[PC]];
        bool may_come = s[INTCON] & GIE && doubtful(s);
        bool begun = s[CYCLE] > 0 && s[STAGE] != BEFORE && s[CHOSEN] == UNKNOWN;
        if (row[IS_CUT] && begun && at_rest(s) && !may_come)
            return CUT;
        reason = row[FLOW] == NO_FLOW ? NO_WORD
            : row[FLOW] == SLEEP      ? sleep(s, board)
                                      : execute(s, used, edges, memory, board);
        if (reason != GOES_ON)
            return reason;
    }
}
