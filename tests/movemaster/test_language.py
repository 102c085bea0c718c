"""The table of the language against lists typed here from the specification."""

import pytest

from servogen.movemaster.interpreter import ACTIONS
from servogen.movemaster.language import COMMANDS, Where

# Specification: number, mnemonic, least and most arguments, allowed in a program.
TABLE = [
    (1, "DP", 0, 0, True), (2, "DW", 3, 3, True), (3, "HE", 1, 1, True), (4, "HO", 0, 0, True),
    (5, "IP", 0, 0, True), (6, "MA", 2, 3, True), (7, "MC", 2, 2, True), (8, "MJ", 5, 5, False),
    (9, "MO", 1, 2, True), (10, "MP", 5, 5, False), (11, "MS", 2, 3, True), (12, "MT", 2, 3, True),
    (13, "NT", 0, 0, True), (14, "OG", 0, 0, True), (15, "PA", 3, 3, True), (16, "PC", 1, 2, False),
    (17, "PD", 6, 6, False), (35, "LG", 2, 2, True), (36, "NE", 2, 2, True), (37, "NW", 0, 0, False),
    (38, "NX", 0, 0, True), (39, "RC", 1, 1, True), (40, "RN", 1, 2, False), (41, "RT", 0, 0, True),
    (42, "SC", 1, 2, True), (43, "SM", 2, 2, True), (44, "GC", 0, 0, True), (45, "GF", 1, 1, True),
    (46, "GO", 0, 0, True), (47, "GP", 3, 3, True), (48, "ID", 0, 0, True), (49, "IN", 0, 0, True),
]  # fmt: skip
NEEDED = [
    *("SP", "TI", "TL", "PL", "PX", "SF", "PT", "GS", "GT", "EQ", "CP", "IC", "DC", "ED", "RS"),
    *("OB", "OD", "OT", "TB"),
]


@pytest.mark.parametrize(("number", "mnemonic", "least", "most", "in_program"), TABLE)
def test_every_row_of_the_source_s_table_is_there(
    number: int, mnemonic: str, least: int, most: int, in_program: bool
) -> None:
    command = COMMANDS[mnemonic]
    assert command.number == number
    assert (command.min_arguments, len(command.parameters)) == (least, most)
    assert (command.where is not Where.DIRECT) == in_program


def test_what_a_program_needs_beside_the_table_is_there_and_nothing_else() -> None:
    assert set(COMMANDS) == {row[1] for row in TABLE} | set(NEEDED)
    assert all(COMMANDS[mnemonic].number is None for mnemonic in NEEDED)


def test_every_command_has_an_action() -> None:
    assert set(ACTIONS) == set(COMMANDS)


@pytest.mark.parametrize(
    ("mnemonic", "form"),
    [
        ("MO", "MO a [, O/C]"),
        ("PD", "PD a, x, y, z, p, r"),
        ("SC", "SC a [, a2]"),
        ("GO", "GO"),
        ("MS", "MS a, n [, O/C]"),
    ],
)
def test_a_command_says_how_it_is_written(mnemonic: str, form: str) -> None:
    assert COMMANDS[mnemonic].form == form


# Ranges as the specification states them: the ends are taken, what is one beyond is refused.
@pytest.mark.parametrize(
    ("mnemonic", "index", "low", "high"),
    [
        ("HE", 0, 1, 629), ("MO", 0, 1, 629), ("MS", 1, 1, 99), ("PA", 0, 1, 9), ("PA", 1, 1, 255),
        ("PA", 2, 1, 255), ("PC", 0, 0, 629), ("LG", 0, -32767, 32767), ("LG", 1, 1, 2048),
        ("RC", 0, 1, 32767), ("SC", 0, 1, 99), ("SC", 1, -32767, 32767), ("GF", 0, 0, 1), ("GP", 0, 0, 15),
        ("GP", 1, 0, 15), ("GP", 2, 0, 99), ("SP", 0, 0, 9), ("GT", 0, 1, 2048),
    ],
)  # fmt: skip
def test_ranges_are_the_specification_s(mnemonic: str, index: int, low: int, high: int) -> None:
    parameter = COMMANDS[mnemonic].parameters[index]
    assert (parameter.low, parameter.high) == (low, high)
