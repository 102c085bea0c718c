"""Z after the tests that conditions are made of, for every kind of operand."""

from __future__ import annotations

from itertools import product

from servogen.compiler.codegen.conditions import differ, zero_test
from servogen.compiler.ir.builder import InstructionBuilder
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import Byte, Imm, Operand
from tests.compiler.cases import every
from tests.compiler.ir.assembly import Chip, Names, texts

VALUES = (0, 1, 0x80, 0xFF)


def zero(function: Function, memory: dict[Byte, int]) -> bool:
    """Whether the instructions set Z, whatever it was before."""
    found = set()
    for z in (False, True):
        chip = Chip({"f": function}, dict(memory))
        chip.w, chip.z = 0x5A, z
        chip.call("f")
        found.add(chip.z)
    (only,) = found
    return only


@every("constants", [(), (0,), (0, 0), (5,), (0, 5), (0x80, 0), (1, 2)])
@every("variables", [0, 1, 2, 3])
@every("first", [False, True])
def test_z_is_set_where_all_bytes_are_0(constants: tuple[int, ...], variables: int, first: bool) -> None:
    places = [Byte(Names()[f"g{at}"], 0) for at in range(variables)]
    fixed: list[Operand] = [Imm(each) for each in constants]
    operands: list[Operand] = [*fixed, *places] if first else [*places, *fixed]
    gen = InstructionBuilder(Function("f"))
    zero_test(gen, operands)  # type: ignore[arg-type]
    for values in product(VALUES[:3], repeat=variables):
        assert zero(gen.function, dict(zip(places, values, strict=True))) == (not any((*constants, *values)))
    # zeros among others need no instruction
    assert gen.function.size <= max(2, variables + 2 * sum(each != 0 for each in constants))


def test_z_is_set_where_two_bytes_are_equal() -> None:
    one, two = (Byte(Names()[name], 0) for name in ("ga", "gb"))
    forms: list[tuple[Operand, Operand]] = [(one, two)]
    forms += [(one, Imm(value)) for value in VALUES] + [(Imm(value), one) for value in VALUES]
    forms += [(Imm(a), Imm(b)) for a, b in product(VALUES, repeat=2)]
    for left, right in forms:
        gen = InstructionBuilder(Function("f"))
        differ(gen, left, right)  # type: ignore[arg-type]
        assert gen.function.size <= 2
        for a, b in product(VALUES, repeat=2):
            memory = {one: a, two: b}
            first, second = (
                each.value if isinstance(each, Imm) else memory[each]  # type: ignore[index]
                for each in (left, right)
            )
            assert zero(gen.function, memory) == (first == second)
    gen = InstructionBuilder(Function("f"))
    differ(gen, Imm(0), one)  # type: ignore[arg-type]
    assert texts(gen.function) == ["MOVF ga,W"]
