"""Each argument of each command takes the ends of its range in docs/movemaster.md and nothing beyond them."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

import pytest

from servogen.errors import InputError
from servogen.movemaster.language import COMMANDS, by_initial
from servogen.movemaster.memory import InputPort, Memory, PortInput, StoredPosition, ToolPose, input_of
from servogen.movemaster.parser import Bit, ProgramLine, parse

TEXT = (Path(__file__).parents[2] / "docs" / "movemaster.md").read_text("utf-8")

POSITION, LINE, COUNTER, WORD, MM = "1 to 629", "1 to 2048", "1 to 99", "-32767 to 32767", "-9999.9 to 9999.9"
HEX_WORD, HEX_BYTE = f"{WORD} or &8001 to &7FFF", "0 to 255 or &0 to &FF"
BIT = "+0 to +7 (bit on) or -0 to -7 (bit off)"
COMPARED = [HEX_WORD, LINE]

# The column "arguments" of the page's table.
RANGES = {
    "DW": [MM] * 3, "HE": [POSITION], "MA": [POSITION] * 2, "MC": [POSITION] * 2, "MJ": [MM] * 5,
    "MO": [POSITION], "MP": [MM] * 5, "MS": [POSITION, "1 to 99"], "MT": [POSITION, "-3276.7 to 3276.7"],
    "PA": ["1 to 9", "1 to 255", "1 to 255"], "PC": ["0 to 629", POSITION], "PD": [POSITION, *[MM] * 5],
    "PL": [POSITION] * 2, "PT": ["1 to 9"], "PX": [POSITION] * 2, "SF": [POSITION] * 2, "SP": ["0 to 9"],
    "TI": ["0 to 32767"], "TL": ["0 to 300"], "CP": [COUNTER], "DC": [COUNTER], "EQ": COMPARED, "GS": [LINE],
    "GT": [LINE], "IC": [COUNTER], "LG": COMPARED, "NE": COMPARED, "RC": ["1 to 32767"], "RN": [LINE] * 2,
    "SC": [COUNTER, WORD], "SM": COMPARED, "GF": ["0 to 1"], "GP": ["0 to 15", "0 to 15", "0 to 99"],
    "OB": [BIT], "OD": [HEX_BYTE], "OT": [HEX_BYTE], "TB": [BIT, LINE],
}  # fmt: skip
DECIMALS = {"DW", "MJ", "MP", "PD", "MT", "TL"}
CASES = [(name, index, each) for name, ranges in RANGES.items() for index, each in enumerate(ranges)]


def line_of(mnemonic: str, index: int, value: str) -> str:
    """Return the command with `value` as one argument, and 1 as the others that must be given."""
    count = max(COMMANDS[mnemonic].min_arguments, index + 1)
    arguments = ["1"] * count
    arguments[index] = value
    number = "" if COMMANDS[mnemonic].where.name == "DIRECT" else "10 "
    return f"{number}{mnemonic} {', '.join(arguments)}"


def value_of(mnemonic: str, index: int, value: str) -> object:
    return parse(line_of(mnemonic, index, value), "a.rvm").statements[0].arguments[index]


def refusal(text: str) -> InputError:
    with pytest.raises(InputError) as caught:
        parse(text, "a.rvm")
    return caught.value


def test_the_ranges_here_are_those_of_all_arguments_but_the_hand() -> None:
    found = {
        name: sum(parameter.kind.name != "HAND" for parameter in command.parameters)
        for name, command in COMMANDS.items()
    }
    assert {name: count for name, count in found.items() if count} == {
        name: len(ranges) for name, ranges in RANGES.items()
    }


def test_the_ranges_here_are_those_of_the_page() -> None:
    rows = re.findall(r"^\| (?:\d+|–) \| `(\w+)[^`]*` \| \w+ \| [^|]+ \| ([^|]*) ?\|$", TEXT, re.M)
    pages = {name: cell.strip() for name, cell in rows}
    assert set(pages) == set(COMMANDS)
    for name, cell in pages.items():
        numbers = set(re.findall(r"[\d.]+", re.sub(r"&\w+|\ba\d", "", cell)))
        if cell != "as LG":
            here = " ".join(re.sub(r"&\w+", "", each) for each in RANGES.get(name, []))
            assert numbers == set(re.findall(r"[\d.]+", here))


def test_the_ends_of_a_range_are_taken_and_what_is_beyond_is_refused() -> None:
    for case in CASES:
        check_range(*case)


def check_range(mnemonic: str, index: int, allowed: str) -> None:
    if allowed == BIT:
        for text, bit in (
            ("+0", Bit(0, True)),
            ("-0", Bit(0, False)),
            ("7", Bit(7, True)),
            ("-7", Bit(7, False)),
        ):
            assert value_of(mnemonic, index, text) == bit
        beyond = ["+8", "-8", "x", "1.0"]
    else:
        low, high = (float(each) for each in re.findall(r"-?[\d.]+", allowed.partition(" or ")[0]))
        for end in (low, high):
            assert value_of(mnemonic, index, f"{end:g}") == end
        step = 0.1 if mnemonic in DECIMALS and allowed != POSITION else 1
        beyond = [f"{low - step:.1f}".removesuffix(".0"), f"{high + step:.1f}".removesuffix(".0")]
    for text in beyond:
        error = refusal(line_of(mnemonic, index, text))
        name = COMMANDS[mnemonic].parameters[index].name
        assert (error.code, error.hint) == ("program-argument", f"allowed: {allowed}")
        assert f"{mnemonic}: {name} cannot be" in error.message
        assert error.location is not None
        assert error.location.column == line_of(mnemonic, index, text).index(text) + 1 or text in "10 1"


def test_only_some_arguments_are_hexadecimal() -> None:
    for case in CASES:
        check_hexadecimal(*case)


def check_hexadecimal(mnemonic: str, index: int, allowed: str) -> None:
    line = line_of(mnemonic, index, "&1")
    if " or &" in allowed:
        assert value_of(mnemonic, index, "&1") == 1
        assert "is not a hexadecimal number" in refusal(line_of(mnemonic, index, "&00001")).message
    elif allowed == BIT:
        assert "cannot be '&1'" in refusal(line).message
    else:
        assert "takes no hexadecimal number, not '&1'" in refusal(line).message


def test_only_coordinates_may_be_left_blank_and_have_fractions() -> None:
    for case in CASES:
        check_blank_and_fraction(*case)


def check_blank_and_fraction(mnemonic: str, index: int, allowed: str) -> None:
    blank, fraction = line_of(mnemonic, index, " "), line_of(mnemonic, index, "1.5")
    if allowed == MM:
        assert value_of(mnemonic, index, " ") == 0.0
    elif "," in blank:  # a single blank argument is none
        assert f"{mnemonic}: {COMMANDS[mnemonic].parameters[index].name} is missing" in refusal(blank).message
    if "." in allowed or mnemonic == "TL":
        assert value_of(mnemonic, index, "1.5") == 1.5
    else:
        assert refusal(fraction).code == "program-argument"


def test_a_command_takes_as_many_arguments_as_its_form_shows() -> None:
    for mnemonic in COMMANDS:
        check_count(mnemonic)


def check_count(mnemonic: str) -> None:
    form = next(
        row
        for row in re.findall(r"`([A-Z]{2}[^`]*)` \| (?:both|direct|program)", TEXT)
        if row[:2] == mnemonic
    )
    most = len([part for part in re.split(r"[,\s\[\]]+", form[2:]) if part])
    least = len([part for part in re.split(r"[,\s]+", re.sub(r"\[.*\]", "", form[2:])) if part])
    number = "" if COMMANDS[mnemonic].where.name == "DIRECT" else "10 "
    for count in range(most + 2):
        arguments = ["1"] * count
        if "O/C" in form and count == most:
            arguments[-1] = "c"
        line = f"{number}{mnemonic} {', '.join(arguments)}"
        if least <= count <= most:
            assert len(parse(line, "a.rvm").statements[0].arguments) == count
        else:
            wanted = f"{least} to {most}" if least < most else str(most or "no")
            plural = "" if most == 1 else "s"
            error = refusal(line)
            assert error.message == f"{mnemonic} takes {wanted} argument{plural}, not {count}"
            assert error.hint == f"it is written: {form}"


def test_commands_that_begin_with_a_letter_are_listed_in_order() -> None:
    assert by_initial("g") == ("GC", "GF", "GO", "GP", "GS", "GT")
    assert by_initial("Z") == ()


def test_a_line_has_up_to_a_thousand_characters() -> None:
    assert len(parse("NT" + " " * 998, "a.rvm").statements) == 1
    error = refusal("NT\nNT" + " " * 999)
    assert error.location is not None
    assert (error.code, error.location.line) == ("file-too-large", 2)


def test_an_argument_of_another_kind_is_an_error_of_the_program_that_asks_for_it() -> None:
    line = parse("10 TB +3, 5", "a.rvm").statements[0]
    assert (line.bit(0), line.whole(1), line.decimal(1)) == (Bit(3, True), 5, 5.0)
    assert [line.has(index) for index in (0, 1, 2)] == [True, True, False]
    with pytest.raises(TypeError, match=r"argument 1 of TB \+3, 5 is not a whole number"):
        line.whole(0)
    with pytest.raises(TypeError, match=r"argument 1 of TB \+3, 5 is not a number"):
        line.decimal(0)
    with pytest.raises(TypeError, match=r"argument 2 of TB \+3, 5 is not a bit"):
        line.bit(1)
    assert isinstance(line, ProgramLine)


# ---- the memory -----------------------------------------------------------------------------------------

POSE = ToolPose(1.0, 2.0, 3.0, 4.0, 5.0)


def stored(*numbers: int) -> Memory:
    memory = Memory()
    memory.positions = {number: StoredPosition(replaced(number)) for number in numbers}
    return memory


def replaced(number: int) -> ToolPose:
    return ToolPose(float(number), 0.0, 0.0, 0.0, 0.0)


def test_poses_add_and_scale_by_component() -> None:
    assert POSE.plus(ToolPose(10.0, 20.0, 30.0, 40.0, 50.0), 0.5).values == (6, 12, 18, 24, 30)
    assert POSE.plus(POSE) == POSE.times(2.0)
    assert str(ToolPose(1.26, -0.04, 3.0, -90.0, 5.55)) == "(1.3, 0.0, 3.0) mm, pitch -90.0°, roll 5.5°"
    assert ToolPose(100.0, -200.0, 300.0, 180.0, -90.0).to_json() == {
        "position_m": [0.1, -0.2, 0.3],
        "pitch_deg": 180.0,
        "roll_deg": -90.0,
    }


def test_positions_between_two_are_in_their_order() -> None:
    memory = stored(1, 4, 9, 20)
    assert memory.between(4, 20) == [4, 9, 20]
    assert memory.between(20, 4) == [20, 9, 4]
    assert memory.between(9, 9) == [9]
    with pytest.raises(InputError, match="position 5 is not defined"):
        memory.between(1, 5)


def test_neighbours_are_the_nearest_defined_numbers() -> None:
    memory = stored(1, 4, 9)
    assert [memory.neighbour(number, 1) for number in (0, 1, 3, 4, 8)] == [1, 4, 4, 9, 9]
    assert [memory.neighbour(number, -1) for number in (10, 9, 5, 4, 2)] == [9, 4, 4, 1, 1]
    for number, step in ((9, 1), (1, -1)):
        with pytest.raises(InputError, match="no position"):
            memory.neighbour(number, step)


def test_clearing_and_shifting() -> None:
    memory = stored(1, 4, 9, 20)
    memory.clear(4, 9)
    assert list(memory.positions) == [1, 20]
    memory.shift(20, 1)
    assert (memory.position(20).pose.x, memory.position(1).pose.x) == (21, 1)


def test_a_counter_stays_within_a_signed_word() -> None:
    memory = Memory()
    memory.count(5, 32767)
    memory.count(6, -32767)
    for number, step in ((5, 1), (6, -1)):
        with pytest.raises(InputError, match=f"counter {number} would be"):
            memory.count(number, step)
    assert memory.counters == {5: 32767, 6: -32767}


def test_grid_points_lie_between_the_corners_in_both_directions() -> None:
    """Corners at x = 10i, ...: 20, 21, 22, 23, so that column adds 1 of the way and row 2."""
    memory = stored(20, 21, 22, 23)
    memory.pallets[2] = (5, 3)
    for column, row in ((1, 1), (5, 1), (1, 3), (5, 3), (2, 2), (4, 3)):
        memory.counters = {21: column, 22: row}
        assert memory.grid_point(2).pose.x == pytest.approx(20 + (column - 1) / 4 + 2 * (row - 1) / 2)
    memory.pallets[2] = (1, 1)
    memory.counters = {21: 1, 22: 1}
    assert memory.grid_point(2).pose.x == 20
    with pytest.raises(InputError, match="pallet 3 has no grid"):
        memory.grid_point(3)


def test_what_is_kept_is_all_that_decides_what_happens_next() -> None:
    def changed(**values: object) -> tuple[object, ...]:
        memory = stored(1, 2)
        for name, value in values.items():
            setattr(memory, name, value)
        return memory.kept()

    same = changed()
    assert changed(counters={7: 0}) == same, "a counter at 0 is one that was never set"
    others = [
        changed(counters={7: 1}),
        changed(pallets={1: (2, 3)}),
        changed(comparison=1),
        changed(positions={1: StoredPosition(replaced(1))}),
        changed(positions={1: StoredPosition(replaced(1)), 2: StoredPosition(replaced(2), "C")}),
    ]
    assert len({*others, same}) == 6


# ---- the input port -------------------------------------------------------------------------------------


def test_an_input_is_seen_in_the_first_frame_that_begins_after_it() -> None:
    """Frames of 20 ms; the inputs may come in any order."""
    inputs = (PortInput(Fraction(41, 1000), 9), PortInput(Fraction(20, 1000), 4))
    port = InputPort(inputs, Fraction(1, 50))
    assert [port.value(frame) for frame in range(5)] == [0, 4, 4, 9, 9]
    assert [port.strobe(), port.strobe(), port.strobe(), port.strobe()] == [(1, 4), (3, 9), None, None]


@pytest.mark.parametrize(("text", "value"), [("0=0", 0), ("0=255", 255), ("0=&0", 0), ("0=&ff", 255)])
def test_values_of_the_port_have_eight_bits(text: str, value: int) -> None:
    assert input_of(text).value == value
    for beyond in ("0=256", "0=999", "0=&100"):
        with pytest.raises(InputError, match="is not an input"):
            input_of(beyond)
