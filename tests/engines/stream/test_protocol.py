"""The stream engine's protocol: bytes of commands, what they mean, positions and widths."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.engines.stream.protocol import (
    MAX_VALUE,
    NO_TRIM,
    CommandKind,
    StreamCommand,
    WidthRange,
    command_of,
    group_begins,
    group_goes,
    position_command,
    query_command,
    speed_command,
    trim_byte,
    trim_command,
    trim_cycles,
)
from servogen.errors import InputError
from servogen.units import Cycles


def test_commands_are_the_bytes_of_the_table() -> None:
    assert position_command(3, 254) == bytes.fromhex("FF 03 FE")
    assert speed_command(7, 20) == bytes.fromhex("FF 47 14")
    assert group_begins() == bytes.fromhex("FF 80 00")
    assert group_goes(50) == bytes.fromhex("FF 80 32")
    assert trim_command(2, -127) == bytes.fromhex("FF C2 00")
    assert trim_command(2, 127) == bytes.fromhex("FF C2 FE")
    assert query_command(1) == bytes.fromhex("FF F0 01")
    assert query_command(1, low=True) == bytes.fromhex("FF F0 09")


def test_a_command_is_what_its_bytes_say_and_all_other_bytes_are_none() -> None:
    known = {
        **{n: (CommandKind.POSITION, n) for n in range(8)},
        **{0x40 + n: (CommandKind.SPEED, n) for n in range(8)},
        0x80: (CommandKind.GROUP, 0),
        **{0xC0 + n: (CommandKind.TRIM, n) for n in range(8)},
        0xF0: (CommandKind.QUERY, 0),
    }
    for second in range(256):
        found = command_of(second, 17)
        assert found == (StreamCommand(*known[second], 17) if second in known else None)
        assert command_of(second, 0xFF) is None
    assert command_of(3, 17, servos=3) is None
    assert command_of(0xF0, 1, answers=False) is None
    assert command_of(0xC2, 17, servos=12, trims=False) is None
    assert command_of(0x4B, 17, servos=12, trims=False) == StreamCommand(CommandKind.SPEED, 11, 17)
    assert command_of(0x42, 17, servos=3) == StreamCommand(CommandKind.SPEED, 2, 17)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: position_command(12, 0),
        lambda: trim_command(8, 0),
        lambda: query_command(8),
        lambda: position_command(0, 255),
        lambda: position_command(-1, 0),
        lambda: group_goes(0),
        lambda: trim_command(0, -1),
        lambda: trim_command(0, 128),
        lambda: WidthRange(Cycles(1000), Cycles(2000)).width(255),
    ],
)
def test_what_cannot_be_said_is_refused(wrong: object) -> None:
    with pytest.raises(InputError):
        wrong()  # type: ignore[operator]


def test_a_trim_s_byte_is_two_s_complement_and_the_erased_one_is_none() -> None:
    assert [trim_byte(cycles) for cycles in (0, 1, 127, -2, -127)] == [0, 1, 127, 0xFE, 0x81]
    assert trim_cycles(NO_TRIM) == 0
    for cycles in range(-127, 128):
        assert trim_cycles(trim_byte(cycles)) == (0 if cycles == -1 else cycles)


@settings(max_examples=200)
@given(st.integers(256, 5000), st.integers(1, 10_000))
def test_positions_go_from_end_to_end_and_are_within_a_cycle_of_the_straight_line(
    least: int, span: int
) -> None:
    each = WidthRange(Cycles(least), Cycles(least + span))
    widths = [each.width(p) for p in range(MAX_VALUE + 1)]
    assert widths[0] == least and widths[MAX_VALUE] == least + span
    assert widths == sorted(widths)
    assert all(abs(width - (least + p * span / MAX_VALUE)) < 1 for p, width in enumerate(widths))


@settings(max_examples=100)
@given(st.integers(0, MAX_VALUE), st.integers(300, 10_000))
def test_the_nearest_position_of_a_position_s_width_is_that_position(p: int, span: int) -> None:
    each = WidthRange(Cycles(600), Cycles(600 + span))
    assert each.nearest(each.width(p)) == p
    assert each.nearest(0) == 0 and each.nearest(99_999) == MAX_VALUE
