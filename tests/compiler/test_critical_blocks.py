"""Critical blocks of SDCC: no interrupt comes inside, and behind them what was allowed before is allowed."""

from __future__ import annotations

from tests.compiler.test_library import memory

PROGRAM = """
unsigned char n, seen[40];
void see(void) { seen[n] = INTCON >> 7; n++; }
void keep(unsigned char x) { seen[n] = x; n++; }
unsigned char constant(void) { __critical { see(); return 5; } }
unsigned char computed(unsigned char x) { __critical { see(); return x + 1; } }
void nothing(void) { __critical { see(); return; } }
void whole(void) __critical { see(); }
unsigned char inner(unsigned char x) {
  __critical {
    __critical { see(); if (x) return x; }
    see();
  }
  see();
  return 9;
}
void main(void) {
  unsigned char allowed;
  for (allowed = 0; allowed < 2; allowed++) {
    INTCON = allowed << 7;
    keep(constant()); see();
    keep(computed(6)); see();
    nothing(); see();
    whole(); see();
    keep(inner(3)); see();
    keep(inner(0)); see();
  }
  while (1);
}
"""


def test_a_critical_block_leaves_interrupts_as_they_were() -> None:
    found = memory(PROGRAM, "sdcc")
    expected = []
    for allowed in (0, 1):
        # inside, the value that is returned, afterwards
        expected += [0, 5, allowed, 0, 7, allowed, 0, allowed, 0, allowed]
        # the inner block gives back what the outer one had: still none
        expected += [0, 3, allowed, 0, 0, allowed, 9, allowed]
    assert list(found["seen"][: len(expected)]) == expected
    assert found["n"][0] == len(expected)
