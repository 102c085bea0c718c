"""A volatile object is stored once for each assignment and loaded once for each use, as the bus shows.

The values are those of C, worked out by hand from the start values in `NAMES`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.compiler.driver import LEVELS
from servogen.compiler.frontend.dialects import DIALECTS
from servogen.pic.image import Image
from tests.campaigns import sampled
from tests.compiler.bus import Bus

WHERE = [(dialect, level) for dialect in DIALECTS for level in LEVELS][::2]
"""Each dialect and each level, most with two of the other."""
EVERYWHERE = sampled([(where,) for where in WHERE], 2)
PORTA, PORTB, TRISB, MARK = 0x05, 0x06, 0x86, 0x09
HEADS = {"c2c": "", "xc8": "#include <xc.h>\n", "sdcc": "#include <pic14/pic16f84a.h>\n"}
ADDRESSES = {
    "PORTB": PORTB, "TRISB": TRISB, "v": 0x40, "va[i]": 0x4A, "va[1]": 0x4A, "(*pv)": 0x4A,
    "part.first": 0x4E,
}  # fmt: skip
NAMES = """
struct fields { unsigned lo : 3; unsigned hi : 5; };
struct bits { unsigned k : 1; unsigned rest : 7; };
unsigned char a = 0x5A, b = 0x0F, i = 1, zero, c;
signed char s = -3;
unsigned int w = 0x1234;
unsigned long l = 70000;
struct fields f = {5, 19}, *pf, fs[2] = {{1, 6}};
struct bits k = {1, 5};
const struct fields cf = {1, 20};
const struct fields cfs[2] = {{2, 7}, {3, 21}};
const struct fields *pcf;
const unsigned char table[3] = {11, 22, 33};
unsigned char mem[3] = {44, 55, 66};
unsigned char *q;
unsigned char g(unsigned char n) { return n + 2; }
unsigned int wide(void) { return 0x3456; }
"""
VALUES = {
    "0": 0, "a": 0x5A, "b + 1": 0x10, "a - b": 0x4B, "a & b": 0x0A, "a | 0x81": 0xDB, "a ^ b": 0x55,
    "f.lo": 5, "f.hi": 19, "pf->hi": 19, "cf.lo": 1, "cf.hi": 20, "cfs[i].lo": 3, "cfs[i].hi": 21,
    "pcf->hi": 21, "k.k": 1, "k.rest": 5, "table[i]": 22, "mem[i]": 55, "*q": 66, "a << 1": 0xB4,
    "a << 2": 0x68, "a << 5": 0x40, "b << 7": 0x80, "a << i": 0xB4, "a >> 1": 0x2D, "a >> 3": 0x0B,
    "a >> 4": 0x05, "a >> 7": 0x00, "a >> i": 0x2D, "w >> 4": 0x23, "w >> 8": 0x12, "s >> 1": 0xFE, "-s": 3,
    "-a": 0xA6, "~a": 0xA5, "!a": 0, "!zero": 1, "a > b": 1, "a == b": 0, "w >= 0x1234": 1, "a && b": 1,
    "zero || b": 1, "zero || zero": 0, "a ? b : i": 15, "zero ? b : a << 2": 0x68, "a * 2": 0xB4,
    "a * 3": 0x0E, "a * 8": 0xD0, "a * b": 0x46, "a / 4": 0x16, "a / b": 6, "a % 8": 2, "a % b": 0,
    "w / 16": 0x23, "(unsigned char) w": 0x34, "(unsigned char) l": 0x70, "(bool) a": 1, "g(b)": 17,
    "wide()": 0x56, "(c = 1, a)": 0x5A, "c = a": 0x5A, "c += 2": 0x5C, "c++": 0x5C, "--c": 0x5C,
}  # fmt: skip
"""What an expression gives when those before it have been evaluated."""
VOLATILE_NAMES = """
volatile unsigned char v __at(0x40);
volatile unsigned int vw __at(0x41);
volatile unsigned long vl __at(0x43);
volatile struct fields vf __at(0x47);
volatile struct bits vk __at(0x48);
volatile unsigned char va[2] __at(0x49);
volatile signed char vs __at(0x4B);
volatile int vi __at(0x4C);
struct { volatile unsigned char first; unsigned char second; } part __at(0x4E);
volatile unsigned char *pv;
"""


def rotated(targets: Iterable[str]) -> list[Any]:
    """Each target at every level and in every dialect, which changes from target to target."""
    dialects = list(DIALECTS)
    cases = [
        (target, (dialects[(number + shift) % len(dialects)], level))
        for number, target in enumerate(targets)
        for shift, level in enumerate(LEVELS)
    ]
    return sampled(cases, 1 + len(cases) // len(LEVELS))


def shown(value: str | tuple[str, str]) -> str:
    return value if isinstance(value, str) else "-".join(value)


@lru_cache(maxsize=1)
def image_of(text: str, dialect: str, level: str) -> Image:
    """Return the program: a test that watches one address after another compiles it once."""
    return compile_sources([Source(text, "main.c")], Options(dialect=dialect, optimise=level)).image


def seen(
    statements: Iterable[str],
    where: tuple[str, str],
    watched: Iterable[int],
    inputs: Mapping[int, Sequence[int]] | None = None,
) -> list[list[tuple[str, int]]]:
    """What the bus shows of some addresses while each statement runs: loads and stores with their values."""
    dialect, level = where
    marked = "".join(f"  EEADR = {number};\n  {each};\n" for number, each in enumerate(statements, 1))
    start = "  pf = &f; pcf = &cfs[1]; q = &mem[2]; pv = &va[1];\n"
    text = f"{HEADS[dialect]}{NAMES}{VOLATILE_NAMES}void main(void) {{\n{start}{marked}  EEADR = 0;\n}}\n"
    found: list[list[tuple[str, int]]] = [[]]
    for each in Bus(image_of(text, dialect, level), [*watched, MARK], inputs or {}, MARK).run():
        if each.address == MARK:
            found.append([])
        else:
            found[-1].append((each.kind, each.value))
    return found[1:-1]


def stores(accesses: list[tuple[str, int]]) -> list[int]:
    return [value for kind, value in accesses if kind == "store"]


def split(values: Mapping[str, int]) -> list[list[str]]:
    """Programs of a size that the chip holds."""
    names = list(values)
    return [names[: len(names) // 2], names[len(names) // 2 :]]


@pytest.mark.parametrize(
    ("target", "where"), rotated(["PORTB", "TRISB", "v", "va[i]", "(*pv)", "part.first"]), ids=shown
)
def test_a_volatile_byte_is_stored_once_with_the_value(target: str, where: tuple[str, str]) -> None:
    for names in split(VALUES):
        found = seen([f"{target} = {each}" for each in names], where, [ADDRESSES[target]])
        assert found == [[("store", VALUES[each])] for each in names]


@pytest.mark.parametrize("where", EVERYWHERE, ids="-".join)
def test_a_bit_of_a_port_is_stored_once(where: tuple[str, str]) -> None:
    """The bit is the lowest one of the value; its store loads the port first."""
    names = [each for each in VALUES if VALUES[each] in (0, 1)]
    found = seen([f"PORTBbits.RB3 = {each}" for each in names], where, [PORTB])
    assert [stores(each) for each in found] == [[VALUES[each] << 3] for each in names]
    assert all(len(each) == 2 for each in found)


@pytest.mark.parametrize("where", EVERYWHERE, ids="-".join)
def test_a_bit_field_of_a_volatile_object_is_stored_once(where: tuple[str, str]) -> None:
    for names in split(VALUES):
        found = seen([f"vf.hi = {each}" for each in names], where, [0x47])
        assert [stores(each) for each in found] == [[VALUES[each] << 3 & 0xFF] for each in names]
        assert all(len(each) == 2 for each in found)


WIDE_VALUES = {
    "0": 0, "w": 0x1234, "w + 1": 0x1235, "w - b": 0x1225, "w + wide()": 0x468A, "-w": 0xEDCC, "~w": 0xEDCB,
    "w << 1": 0x2468, "w << 3": 0x91A0, "w >> 5": 0x0091, "s": 0xFFFD, "s >> 1": 0xFFFE, "cf.hi": 20,
    "(unsigned int) a * b": 0x546, "w / 7": 0x0299, "w > b": 1, "w ? s : b": 0xFFFD, "f.hi": 19,
}  # fmt: skip


@pytest.mark.parametrize("where", EVERYWHERE, ids="-".join)
def test_each_byte_of_a_wide_volatile_object_is_stored_once(where: tuple[str, str]) -> None:
    low = seen([f"vw = {each}" for each in WIDE_VALUES], where, [0x41])
    high = seen([f"vw = {each}" for each in WIDE_VALUES], where, [0x42])
    assert low == [[("store", value & 0xFF)] for value in WIDE_VALUES.values()]
    assert high == [[("store", value >> 8)] for value in WIDE_VALUES.values()]


LONG_VALUES = {
    "l": 70000, "l + 0x10203": 136051, "l - 4": 69996, "-l": 2**32 - 70000, "l << 2": 280000, "a": 0x5A,
}  # fmt: skip


@pytest.mark.parametrize("where", [each for each in WHERE if each[0] != "c2c"], ids="-".join)
def test_each_byte_of_a_long_volatile_object_is_stored_once(where: tuple[str, str]) -> None:
    for byte in range(4):
        found = seen([f"vl = {each}" for each in LONG_VALUES], where, [0x43 + byte])
        assert found == [[("store", value >> 8 * byte & 0xFF)] for value in LONG_VALUES.values()]


CHANGES = {
    "+= 1": 0x5B, "-= 1": 0x59, "+= b": 0x69, "-= b": 0x4B, "&= 0xF0": 0x50, "&= 0": 0x00, "&= 0xFE": 0x5A,
    "&= 0xFF": 0x5A, "|= b": 0x5F, "|= 4": 0x5E, "|= 0": 0x5A, "|= 0xFF": 0xFF, "^= 0xFF": 0xA5, "^= b": 0x55,
    "+= 0": 0x5A, "*= 1": 0x5A, "*= 3": 0x0E, "/= 4": 0x16, "%= 7": 0x06, "<<= 1": 0xB4, "<<= 3": 0xD0,
    ">>= 1": 0x2D, ">>= 4": 0x05, ">>= i": 0x2D, "<<= 0": 0x5A,
}  # fmt: skip
"""Values of a byte that was 0x5A."""


@pytest.mark.parametrize(
    ("target", "where"), rotated(["PORTB", "v", "va[i]", "(*pv)", "part.first"]), ids=shown
)
def test_a_compound_assignment_loads_once_and_stores_once(target: str, where: tuple[str, str]) -> None:
    for names in split(CHANGES):
        steps = [step for each in names for step in (f"{target} = 0x5A", f"{target} {each}")]
        found = seen(steps, where, [ADDRESSES[target]])[1::2]
        assert found == [[("load", 0x5A), ("store", CHANGES[each])] for each in names]


VALUES_OF_CHANGES = {
    "v = b": (15, 15, 0), "v++": (0x5A, 0x5B, 1), "++v": (0x5B, 0x5B, 1), "v--": (0x5A, 0x59, 1),
    "--v": (0x59, 0x59, 1), "v += b": (0x69, 0x69, 1), "v <<= 2": (0x68, 0x68, 1), "v = v": (0x5A, 0x5A, 1),
    "v ? v : v": (0x5A, None, 2), "v = v + v": (0xB4, 0xB4, 2),
}  # fmt: skip
"""The value of an expression on a byte that was 0x5A, what it stores, how often it loads."""


@pytest.mark.parametrize(
    ("target", "where"), rotated(["PORTB", "v", "va[i]", "(*pv)", "part.first"]), ids=shown
)
def test_the_value_of_an_assignment_is_not_read_back(target: str, where: tuple[str, str]) -> None:
    steps = []
    for expression in VALUES_OF_CHANGES:
        used = expression.replace("v", target)
        start = f"{target} = 0x5A"
        steps += [start, f"c = ({used})", "PORTA = c", start, f"if ({used}) PORTA = 0; else PORTA = 1"]
    half = len(steps) // 2
    found = seen(steps[:half], where, [ADDRESSES[target], PORTA]) + seen(
        steps[half:], where, [ADDRESSES[target], PORTA]
    )
    for number, (value, stored, loads) in enumerate(VALUES_OF_CHANGES.values()):
        expected = [("load", 0x5A)] * loads + ([] if stored is None else [("store", stored)])
        _, change, shown, _, condition = found[5 * number : 5 * number + 5]
        assert change == expected
        assert shown == [("store", value)]
        assert condition == [*expected, ("store", 0)]


@pytest.mark.parametrize("where", EVERYWHERE, ids="-".join)
def test_the_value_of_a_bit_field_that_is_changed(where: tuple[str, str]) -> None:
    steps = [
        "vf.hi = 30", "c = vf.hi++", "PORTA = c", "c = ++vf.hi", "PORTA = c", "c = (vf.lo = 12)", "PORTA = c",
    ]  # fmt: skip
    found = seen(steps, where, [0x47, PORTA])
    assert [stores(each)[-1] for each in found] == [30 << 3, 31 << 3, 30, 0, 0, 4, 4]
    assert [len(stores(each)) for each in found] == [1] * 7


@pytest.mark.parametrize("where", EVERYWHERE, ids="-".join)
def test_a_wide_volatile_object_counts(where: tuple[str, str]) -> None:
    """The byte that does not change may keep its value without a store; none is stored twice."""
    steps = ["vw = 0x1FF", "vw++", "vw--", "vw += 2", "vw -= w", "c = (vw++ == 0xEFCD)", "PORTA = c"]
    for address in (0x41, 0x42):
        found = seen(steps, where, [address])
        assert all(len(stores(each)) <= 1 for each in found)
    assert seen(steps, where, [PORTA])[-1] == [("store", 1)]


LOADS = {
    # PORTA gives 0xF1, 2, 3 … one after the other
    "PORTA + 1": (0xF2, 1), "w + PORTA": (0x25, 1), "w - PORTA": (0x43, 1),
    "w + (signed char) PORTA >> 8": (0x12, 1), "(signed char) PORTA >> 8": (0xFF, 1), "PORTA * 3": (0xD3, 1),
    "PORTA * 0": (0, 1), "PORTA & 0": (0, 1), "PORTA << 7": (0x80, 1), "PORTA >> 7": (1, 1),
    "PORTA % 16": (1, 1), "PORTA == 0xF1": (1, 1), "PORTA > a": (1, 1), "a > PORTA": (0, 1),
    "PORTA >= w": (0, 1), "w > PORTA": (1, 1), "(signed char) PORTA < 0": (1, 1),
    "(signed char) PORTA < s": (1, 1), "PORTA + PORTA": (0xF3, 2), "PORTA * PORTA": (0xE2, 2),
    "PORTA ? PORTA : 9": (2, 2), "PORTA && PORTA": (1, 2), "PORTA || PORTA": (1, 1), "(PORTA, PORTA)": (2, 2),
    "!PORTA": (0, 1), "~PORTA": (0x0E, 1), "-PORTA": (0x0F, 1), "(bool) PORTA": (1, 1),
    "PORTAbits.RA0": (1, 1), "table[PORTA & 1]": (22, 1), "mem[PORTA & 1]": (55, 1), "g(PORTA)": (0xF3, 1),
    "(PORTA & 0x10) != 0": (1, 1), "1 << (PORTA & 3)": (2, 1),
}  # fmt: skip


@pytest.mark.parametrize("where", EVERYWHERE, ids="-".join)
def test_a_volatile_operand_is_loaded_as_often_as_it_is_named(where: tuple[str, str]) -> None:
    for names in split(LOADS):
        found = seen([f"PORTB = {each}" for each in names], where, [PORTA, PORTB], {PORTA: [0xF1, 2, 3, 4]})
        assert [(stores(each), len(each) - 1) for each in found] == [
            ([value], loads) for value, loads in (LOADS[each] for each in names)
        ]


WIDE_LOADS = {
    # the bytes of vw are 0x34 and 0x12 the first time
    "vw + w == 0x2468": 1, "w + vw == 0x2468": 1, "w - vw == 0": 1, "vw - w == 0": 1, "w < vw": 0,
    "vw < w": 0, "w <= vw": 1, "vw == w": 1, "vw > 0x1233": 1, "-vw == 0xEDCC": 1, "vw << 1 == 0x2468": 1,
    "vw >> 2 == 0x48D": 1, "vw * 5 == 0x5B04": 1, "vi < 0": 0,
}  # fmt: skip


@pytest.mark.parametrize("where", EVERYWHERE, ids="-".join)
def test_no_byte_of_a_wide_volatile_operand_is_loaded_twice(where: tuple[str, str]) -> None:
    inputs = {0x41: [0x34, 0xAA], 0x42: [0x12, 0xAA], 0x4C: [0x34, 0xAA], 0x4D: [0x12, 0xAA]}
    found = seen([f"PORTB = {each}" for each in WIDE_LOADS], where, [PORTB, *inputs], inputs)
    assert [stores(each) for each in found] == [[value] for value in WIDE_LOADS.values()]
    assert all(len(each) <= 3 for each in found)


LONG_LOADS = ("l + vl == 135535", "vl + l == 135535", "l - vl == 4465", "l < vl", "vl < l")


@pytest.mark.parametrize("where", [each for each in WHERE if each[0] != "c2c"], ids="-".join)
def test_no_byte_of_a_long_volatile_operand_is_loaded_twice(where: tuple[str, str]) -> None:
    inputs = {0x43: [0xFF, 1], 0x44: [0xFF, 2], 0x45: [0, 3], 0x46: [0, 4]}
    found = seen([f"PORTB = {each}" for each in LONG_LOADS], where, [PORTB, *inputs], inputs)
    assert [stores(each) for each in found] == [[1], [1], [1], [0], [1]]
    assert all(len(each) <= 5 for each in found)


@pytest.mark.parametrize("where", EVERYWHERE, ids="-".join)
def test_a_statement_that_is_only_an_operand_loads_it(where: tuple[str, str]) -> None:
    assert seen(["PORTA", "(void) PORTA", "va[i]", "*pv"], where, [PORTA, 0x4A]) == [[("load", 0)]] * 4


@pytest.mark.parametrize("where", EVERYWHERE, ids="-".join)
def test_the_index_of_a_bit_field_is_evaluated_once(where: tuple[str, str]) -> None:
    found = seen(["i = 0", "fs[i++].hi++", "PORTA = i", "PORTA = fs[0].hi"], where, [PORTA])
    assert found[2:] == [[("store", 1)], [("store", 7)]]


IDENTITIES = [
    "{x}", "{x} & 0xFFFF", "0xFFFF & {x}", "{x} | 0", "{x} ^ 0x0100", "{x} + 256", "0x0200 + {x}",
    "{x} - 256",
]  # fmt: skip
"""Values that are `x` again once they are converted to its type of eight bits."""


@pytest.mark.parametrize(("target", "where"), rotated(["v", "PORTB", "va[1]", "(*pv)"]), ids=shown)
def test_an_assignment_that_changes_nothing_is_a_load_and_a_store(
    target: str, where: tuple[str, str]
) -> None:
    found = seen([f"{target} = {each.format(x=target)}" for each in IDENTITIES], where, [ADDRESSES[target]])
    kinds = [[kind for kind, _ in accesses] for accesses in found]
    assert kinds == [["load", "store"]] * len(IDENTITIES)
    assert all(accesses[0][1] == accesses[1][1] for accesses in found)


@pytest.mark.parametrize("where", EVERYWHERE, ids="-".join)
def test_a_bit_of_a_port_assigned_to_itself_is_written(where: tuple[str, str]) -> None:
    """On a chip the latch takes the level of the pin."""
    (found,) = seen(["PORTBbits.RB3 = PORTBbits.RB3"], where, [PORTB])
    assert len(stores(found)) == 1
