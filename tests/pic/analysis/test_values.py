"""What is known of a byte, against sets of numbers: exact up to 64 members, by bits beyond."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable

import pytest

from servogen.pic.analysis import values
from servogen.pic.analysis.values import ANY, BIT, MAX_MEMBERS, Value

EVERY = frozenset(range(256))


def by_bits(members: Iterable[int]) -> frozenset[int]:
    """Return the bytes each of whose bits some member has."""
    chosen = frozenset(members)
    levels = [{member >> bit & 1 for member in chosen} for bit in range(8)]
    fixed = sum(1 << bit for bit in range(8) if len(levels[bit]) == 1)
    example = next(iter(chosen))
    return frozenset(byte for byte in EVERY if not (byte ^ example) & fixed)


def kept(members: Iterable[int]) -> frozenset[int]:
    """Return what is kept of a set."""
    chosen = frozenset(members)
    return chosen if len(chosen) <= MAX_MEMBERS else by_bits(chosen)


def some_sets() -> list[frozenset[int]]:
    """Return sets of all sizes, some of which only a few bits tell apart."""
    rng = random.Random(1)
    sets = [frozenset(rng.sample(range(256), size)) for size in (1, 1, 2, 3, 5, 8, 13, 63, 64, 65, 66, 200)]
    for free in (0x00, 0x81, 0x3F, 0xFC, 0x7F, 0xFE, 0xFF):
        base = rng.randrange(256) & ~free
        sets.append(frozenset(byte for byte in EVERY if byte & ~free == base))
    return [*sets, frozenset({0}), frozenset({0, 1}), EVERY - {0}, frozenset(range(192, 256))]


SETS = some_sets()
PAIRS = [
    *((one, other) for one in SETS for other in SETS[::2] if len(one) * len(other) < 100),
    *((EVERY, frozenset({7})), (frozenset({7, 8}), EVERY), (SETS[8], SETS[8])),
]


def assert_is(value: Value | None, members: Iterable[int]) -> None:
    """Compare everything that a value says with the set that it stands for."""
    expected = frozenset(members)
    assert value is not None
    assert list(value) == sorted(expected)
    assert value.size == len(expected)
    assert {byte for byte in EVERY if byte in value} == expected
    assert value.may_be_0 == sum(1 << bit for bit in range(8) if any(not e >> bit & 1 for e in expected))
    assert value.may_be_1 == sum(1 << bit for bit in range(8) if any(e >> bit & 1 for e in expected))
    assert value.constant == (min(expected) if len(expected) == 1 else None)
    assert (value.members is not None) == (len(expected) <= MAX_MEMBERS)


@pytest.mark.parametrize("members", SETS, ids=len)
def test_a_value_is_its_set_up_to_64_members_and_the_bits_of_its_members_beyond(
    members: frozenset[int],
) -> None:
    assert_is(values.of(members), kept(members))
    assert values.of(sorted(members)) is values.of(sorted(members, reverse=True)), (
        "equal values are one object"
    )


def test_the_constants_are_the_bytes_and_an_unknown_flag_is_0_or_1() -> None:
    for byte in EVERY:
        assert_is(values.constant(byte), {byte})
        assert values.constant(byte) is values.of([byte])
    assert_is(BIT, {0, 1})
    assert_is(ANY, EVERY)


def test_masks_of_bits_stand_for_every_byte_that_they_allow() -> None:
    rng = random.Random(2)
    for _ in range(300):
        member, free = rng.randrange(256), rng.choice((0, 1, 0x80, 0x3F, 0x7E, 0xFE, rng.randrange(256)))
        expected = {byte for byte in EVERY if (byte ^ member) & ~free == 0}
        assert_is(values.of_bits(~member & 0xFF | free, member | free), expected)


def test_a_union_is_that_of_the_sets() -> None:
    for one in SETS:
        for other in SETS:
            union = values.of(one) | values.of(other)
            assert_is(union, kept(kept(one) | kept(other)))


@pytest.mark.parametrize(
    ("operation", "expected"),
    [
        (values.conjunction, lambda a, b: a & b),
        (values.disjunction, lambda a, b: a | b),
        (lambda a, b: values.combined(a, b, lambda x, y: x + 3 * y), lambda a, b: (a + 3 * b) & 0xFF),
    ],
)
def test_an_operation_on_two_values_is_that_on_every_pair(
    operation: Callable[[Value, Value], Value], expected: Callable[[int, int], int]
) -> None:
    bitwise = expected(3, 1) in (1, 3)
    for one, other in PAIRS:
        result = operation(values.of(one), values.of(other))
        if len(one) <= MAX_MEMBERS and len(other) <= MAX_MEMBERS:
            exact = {expected(a, b) for a in one for b in other}
            assert_is(result, exact if len(one) * len(other) <= 64 else EVERY)
        elif bitwise:
            assert_is(result, by_bits(expected(a, b) for a in by_bits(one) for b in by_bits(other)))
        else:
            assert result is ANY


def test_sixty_four_pairs_are_combined_and_sixty_five_are_not() -> None:
    eight, five, thirteen = (values.of(range(0, 4 * count, 4)) for count in (8, 5, 13))
    assert_is(values.conjunction(eight, eight), {a & b for a in eight for b in eight})
    assert values.conjunction(five, thirteen) is ANY
    assert values.disjunction(five, thirteen) is ANY


def test_a_value_is_mapped_and_chosen_from_member_by_member() -> None:
    for members in SETS:
        value = values.of(members)
        assert_is(
            values.mapped(value, lambda byte: 3 * byte + 1), kept((3 * m + 1) & 0xFF for m in kept(members))
        )
        odd = {member for member in kept(members) if member % 2}
        if odd:
            assert_is(values.where(value, lambda byte: byte % 2 == 1), kept(odd))
        else:
            assert values.where(value, lambda byte: byte % 2 == 1) is None


def test_the_zero_flag_is_1_0_or_unknown() -> None:
    assert values.zero_flag(values.constant(0)) is values.constant(1)
    assert values.zero_flag(values.of({0, 5})) is BIT
    assert values.zero_flag(values.of({1, 5})) is values.constant(0)
    assert values.zero_flag(ANY) is BIT
    assert values.zero_flag(values.of_bits(0xFE, 0xFF)) is values.constant(0), "bit 0 is 1 in every member"
