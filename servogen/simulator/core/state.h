/* The state of the chip, and how functions are compiled: inlined, called, or rarely called.

   All of it is one struct of 64-bit integers, which Python sees as a vector: layout.py has its table, with
   what each field means, and layout.h is made from that table. Times are cycles; a port is 13 bits wide, bit
   n being pin n of `edges.PINS`. */

#ifndef STATE_H
#define STATE_H

#include <stdbool.h>
#include <stdint.h>

typedef int64_t i64;

#include "layout.h"

#define RARE __attribute__((cold, noinline)) static
#define CALLED __attribute__((noinline)) static
#define INLINED __attribute__((always_inline)) static inline

static inline i64 min(i64 a, i64 b) { return a < b ? a : b; }
static inline i64 max(i64 a, i64 b) { return a > b ? a : b; }

#endif
