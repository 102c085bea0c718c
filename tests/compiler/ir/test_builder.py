"""What the instruction builder emits, and the names of what it makes."""

from __future__ import annotations

from itertools import product

import pytest

from servogen.compiler.ast.nodes import AddressByte, Symbol
from servogen.compiler.ast.types import U8, U32
from servogen.compiler.ir.builder import InstructionBuilder
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import Byte, Imm, Loc, Operand, Reg
from servogen.errors import Location
from tests.compiler.cases import every
from tests.compiler.ir.assembly import Chip, Names, texts


def builder() -> tuple[InstructionBuilder, Names]:
    return InstructionBuilder(Function("f")), Names()


def test_an_instruction_has_the_place_and_literals_of_eight_bits() -> None:
    gen, names = builder()
    gen.place = Location("main.c", 3)
    made = gen.emit("ADDLW", k=-1)
    assert (made.k, made.place, made.fixed, made.d, made.b) == (255, Location("main.c", 3), False, 0, 0)
    assert gen.emit("ADDLW", k=256).k == 0
    address = AddressByte(names["g"], 1, 0)
    assert gen.emit("MOVLW", k=address).k is address
    assert gen.emit("BSF", names.loc("g"), b=7, fixed=True).fixed
    gen.label("f.x")
    assert next(iter(gen.function.blocks[-1].labels)).place == Location("main.c", 3)
    gen.delay(7)
    gen.delay(0)
    assert texts(gen.function)[-2:] == ["f.x:", "DELAY 7"]
    assert gen.last is not None and gen.last.place == Location("main.c", 3)


def test_the_last_instruction_and_whether_it_may_be_skipped() -> None:
    gen, names = builder()
    assert gen.last is None and not gen.last_may_be_skipped
    gen.emit("MOVF", names.loc("g"))
    assert gen.last is not None and gen.last.op == "MOVF" and not gen.last_may_be_skipped
    gen.skip_if(2, True)
    assert not gen.last_may_be_skipped
    gen.emit("CLRF", names.loc("g"))
    assert gen.last_may_be_skipped
    gen.emit("CLRF", names.loc("g"))
    assert not gen.last_may_be_skipped
    gen.label("f.x")
    assert gen.last is None and not gen.last_may_be_skipped


def test_only_the_last_two_blocks_say_whether_the_last_instruction_may_be_skipped() -> None:
    gen, names = builder()
    gen.emit("NOP")
    for _ in range(2):
        gen.label(gen.new_label())
        gen.emit("CLRF", names.loc("g"))
        gen.emit("MOVF", names.loc("g"))
        assert not gen.last_may_be_skipped
        gen.skip_if(2, True)
        gen.emit("CLRF", names.loc("g"))
        assert gen.last_may_be_skipped
        gen.emit("CLRF", names.loc("g"))
        assert not gen.last_may_be_skipped


def test_jumps_and_skips() -> None:
    gen, names = builder()
    gen.skip_if(0, True)
    gen.emit("NOP")
    gen.skip_if(7, False, names.loc("g"))
    gen.emit("NOP")
    gen.goto_if(2, True, "f.a")
    gen.goto_if(3, False, "f.b", names.loc("g"))
    assert texts(gen.function) == [
        *("BTFSS C", "NOP", "BTFSC g,7", "NOP"),
        *("BTFSC Z", "GOTO f.a", "BTFSS g,3", "GOTO f.b"),
    ]


def test_labels_and_temporaries_are_numbered() -> None:
    gen, _ = builder()
    assert [gen.new_label(), gen.new_label("end"), gen.new_label()] == ["f.L.1", "f.end.2", "f.L.3"]
    one, two = gen.temp(2)
    (three,) = gen.temp()
    block = gen.block_temp(3)
    assert [(symbol.name, symbol.kind, symbol.size, symbol.pinned) for symbol in gen.function.own] == [
        *(("t1", "temp", 1, False), ("t2", "temp", 1, False), ("t3", "temp", 1, False)),
        ("t4", "temp", 3, True),
    ]
    assert all(symbol.function == "f" for symbol in gen.function.own)
    own = gen.function.own
    assert [one, two, three] == [Byte(own[0], 0), Byte(own[1], 0), Byte(own[2], 0)]
    assert block == [Byte(own[3], at) for at in range(3)]


@every(
    ("address", "offset", "register"),
    [(0x0B, 0, 0x0B), (0x0C, 0, None), (0x4F, 0, None), (0x50, 0, 0x50), (0x4F, 1, 0x50), (0x86, 0, 0x86),
     (0x8C, 0, None), (0xCF, 0, None), (0xD0, 0, 0xD0), (0x05, 1, 0x06)],
)  # fmt: skip
def test_a_variable_at_the_address_of_a_register_is_the_register(
    address: int, offset: int, register: int | None
) -> None:
    gen, _ = builder()
    symbol = Symbol("x", U8, "fixed", address=address)
    assert gen.loc(symbol, offset) == (Byte(symbol, offset) if register is None else Reg(register))
    plain = Symbol("y", U32, "global", address=address)
    assert gen.locs(plain, 1, 2) == [Byte(plain, 1), Byte(plain, 2)]


def test_a_function_has_its_own_copies_of_variables() -> None:
    one, two = Symbol("x", U8, "local"), Symbol("x", U8, "local")
    gen = InstructionBuilder(Function("f"), symbol_map=lambda symbol: two if symbol is one else symbol)
    assert gen.symbol(one) is two
    assert gen.loc(one, 0) == Byte(two, 0)


def test_moves_of_one_byte() -> None:
    gen, names = builder()
    g, h = names.loc("g"), names.loc("gh")
    for operand in (g, h, Imm(0), Imm(3)):
        gen.move(g, operand)
    assert texts(gen.function) == ["MOVF gh,W", "MOVWF g", "CLRF g", "MOVLW 3", "MOVWF g"]


def test_volatile_bytes_are_read_once_and_where_nothing_depends_on_them() -> None:
    gen, names = builder()
    v, g = names.loc("v"), names.loc("g")
    assert gen.steady(g) == g and gen.steady(Imm(3)) == Imm(3)
    assert gen.function.size == 0
    copy = gen.steady(v)
    assert isinstance(copy, Byte) and copy.symbol.kind == "temp"
    port = gen.steady(names.loc("PORTB"))
    assert isinstance(port, Byte)
    gen.read_unused([g, v, Imm(1), names.loc("PORTA")])
    assert texts(gen.function) == [
        *("MOVF v,W", "MOVWF t1", "MOVF PORTB,W", "MOVWF t2"),
        *("MOVF v,W", "MOVF PORTA,W"),
    ]


@every("sources", [*product(range(3), repeat=3), (3, 3, 1), (0, 3, 3), (4, 1, 3)])
def test_bytes_that_overlap_are_all_copied(sources: tuple[int, ...]) -> None:
    """Byte n of three becomes what byte sources[n] was; 3 and 4 are constants."""
    gen, names = builder()
    bytes_: list[Loc] = [names.loc(f"g{at}") for at in range(3)]
    operands: list[Operand] = [*bytes_, Imm(0xA5), Imm(0)]
    gen.move_all(bytes_, [operands[source] for source in sources])
    chip = Chip({"f": gen.function}, {byte: 10 + at for at, byte in enumerate(bytes_)})
    chip.call("f")
    before = [10, 11, 12, 0xA5, 0]
    assert [chip.memory[byte] for byte in bytes_] == [before[source] for source in sources]
    # two words for each byte that changes, and two more for each circle; a zero is one word
    moved = [source for at, source in enumerate(sources) if source != at]
    circles = (
        sum(sources[at] != at and sources[sources[at] % 3] == at and sources[at] < 3 for at in range(3)) // 2
    )
    circles += sources in ((1, 2, 0), (2, 0, 1))
    assert gen.function.size == sum(1 if source == 4 else 2 for source in moved) + 2 * circles


def test_equal_constants_are_stored_one_after_the_other() -> None:
    gen, names = builder()
    targets: list[Loc] = [names.loc(f"g{at}") for at in range(4)]
    gen.move_all(targets, [Imm(7), names.loc("gx"), Imm(7), Imm(9)])
    found = texts(gen.function)
    first = found.index("MOVLW 7")
    assert found[first : first + 4] == ["MOVLW 7", "MOVWF g0", "MOVLW 7", "MOVWF g2"]
    with pytest.raises(ValueError, match="zip"):
        gen.move_all(targets, [Imm(1)])
