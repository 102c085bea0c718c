/* The checker's chip for every operand: loops that Python would be slow for. */

#include "../../../servogen/checker/chip.c"

/* Computes the result of an operation, and its flags from bit 8 on, for each `x` and `a`. */
void results(i64 op, i64 (*table)[256])
{
    for (i64 x = 0; x < 256; x++)
        for (i64 a = 0; a < 256; a++)
            table[x][a] = known(op, a, x);
}

/* Executes one instruction from `start` for each row (W, the byte at 0x20, STATUS) of `inputs`; in `out` are
   these three, PC, the cycle and GIE. */
void execute_each(
    const i64 *start, const Memory *memory, const Board *board, i64 count, const i64 (*inputs)[3],
    i64 (*out)[6])
{
    const Edges none = {0, start, start};
    for (i64 i = 0; i < count; i++) {
        i64 s[SLOTS], used[SLOTS] = {0};
        for (i64 slot = 0; slot < SLOTS; slot++)
            s[slot] = start[slot];
        s[W] = inputs[i][0];
        s[0x20] = inputs[i][1];
        s[STATUS] = inputs[i][2];
        run(s, used, &none, memory, board);
        i64 row[6] = {s[W], s[0x20], s[STATUS], s[PC], s[CYCLE], s[INTCON] & GIE};
        for (i64 n = 0; n < 6; n++)
            out[i][n] = row[n];
    }
}
