"""A file that is wrong is refused with line, key, value and what is allowed."""

from fractions import Fraction
from pathlib import Path
from typing import Literal

import pytest
from pydantic import Field

from servogen.errors import InputError
from servogen.toml.file import Table, exact, key_text, load, parse, split_unit, validate


class Servo(Table):
    name: str
    trim_us: float = Field(default=0.0, ge=-100, le=100)
    count: int = 1
    reverse: bool = False
    kind: Literal["a", "b"] = "a"
    size_mm: tuple[float, float] | None = None


class File(Table):
    servo: tuple[Servo, ...] = Field(min_length=1)


GOOD = '[[servo]]\nname = "arm"\n'


def error_of(text: str) -> InputError:
    with pytest.raises(InputError) as caught:
        validate(parse(text, "x.toml"), File)
    return caught.value


def test_a_good_file_is_its_model() -> None:
    file = validate(parse(GOOD + "trim_us = 3\nsize_mm = [1, 2.5]\n", "x.toml"), File)
    assert file == File(servo=(Servo(name="arm", trim_us=3.0, size_mm=(1.0, 2.5)),))


@pytest.mark.parametrize(
    ("line", "says", "code"),
    [
        ("trim_us = true", "true is not a number", "wrong-type"),
        ('trim_us = "3"', '"3" is not a number', "wrong-type"),
        ("trim_us = nan", "nan is not a finite number", "wrong-type"),
        ("trim_us = -inf", "-inf is not a finite number", "wrong-type"),
        ("trim_us = 101", "101 is out of range: at most 100 is allowed", "out-of-range"),
        ("trim_us = -101", "-101 is out of range: at least -100 is allowed", "out-of-range"),
        ("trim_us = [3]", "[3] is not a number", "wrong-type"),
        ("count = 1.5", "1.5 is not a whole number", "wrong-type"),
        ("count = 4e6", "4000000.0 is not a whole number\n  without a point and an exponent: 4_000_000",
            "wrong-type"),
        ("count = true", "true is not a whole number", "wrong-type"),
        ("reverse = 1", "1 is not true or false", "wrong-type"),
        ('kind = "c"', "\"c\" is not allowed here\n  allowed: 'a' or 'b'", "not-allowed"),
        ("size_mm = 4", "4 is not an array [ … ]", "wrong-type"),
        ("size_mm = [4]", "has too few values: number 2 is missing", "wrong-type"),
        ("size_mm = [4, 5, 6]", "has 3 values\n  at most 2", "wrong-type"),
        ("trim = 3", "'trim' has no unit: write trim_us", "wrong-unit"),
        ("trim_ms = 3", "'trim_ms' is not given in ms: write trim_us = 3000", "wrong-unit"),
        ("revers = true", "unknown key 'revers'\n  did you mean 'reverse'?", "unknown-key"),
        ("colour = 1", "unknown key 'colour'\n  known: count, kind, name, reverse, size_mm, trim_us",
            "unknown-key"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_with_its_line(line: str, says: str, code: str) -> None:
    error = error_of(GOOD + line + "\n")
    message, _, hint = says.partition("\n  ")
    text = f"x.toml:3:1: error: servo[1].{line.split()[0]}: {message} [{code}]"
    assert str(error) == (f"{text}\n  {hint}" if hint else text)


def test_a_missing_key_is_named_at_its_table() -> None:
    error = error_of("[[servo]]\ntrim_us = 1\n")
    assert (
        str(error) == "x.toml:1:1: error: servo[1]: 'name' is missing [missing-key]\n  add servo[1].name = …"
    )


def test_a_missing_table_is_written_with_its_brackets() -> None:
    assert "add [[servo]]" in str(error_of("x = 1\n".replace("x = 1", "")))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('a = "x\n', "this text has no closing quote"),
        ("a = x\n", 'put text in "quotes"'),
        ("a = [1\n", "an array above lacks its ]"),
        ("a = 1\na = 2\n", "this name is given twice"),
        ("[a]\n[a]\n", "this table is given twice; one of several has two brackets"),
        ("a 1\n", "a key, then =, then its value"),
        ("a = True\n", "write true or false, in small letters"),
        ("a = yes # on\n", "write true or false, in small letters"),
        ("a = “RB0”\n", 'the quotes are "straight" ones'),
        ("a = 2,5\n", "a number has a decimal point, not a comma"),
        ("a = [{ b = 2,5, c = 1 }]\n", "a number has a decimal point, not a comma"),
        ("a = 120°\n", "a number has no unit behind it"),
        ("a = [\n { b = 120°, c = 1 },\n]\n", "a number has no unit behind it"),
        ("a = { b = 2 s } # hold\n", "a number has no unit behind it"),
        ("a = [\n { b = 1, c = 5, # frames\n]\n", "an inline table lacks its }"),
        ("a = [\n { b = 1\n]\n", "an inline table lacks its }"),
        ("a = { b = 1 c = 2 }\n", "unclosed inline table"),
        ("a = 1 b = 2\n", "expected newline"),
        ("a = 0x1G\n", "expected newline"),
    ],
)
def test_a_syntax_error_says_what_to_do(text: str, says: str) -> None:
    with pytest.raises(InputError) as caught:
        parse(text, "x.toml")
    assert says in caught.value.message


def test_one_of_several_tables_has_two_brackets() -> None:
    error = error_of('[servo]\nname = "arm"\n')
    assert error.message.endswith("is not an array [ … ]")
    assert error.hint == "one of several has two brackets: [[servo]]"


def test_a_misspelt_key_is_told_rather_than_the_one_that_is_missing_for_it() -> None:
    assert "unknown key 'nam'" in str(error_of('[[servo]]\nnam = "arm"\n'))


def test_the_first_error_of_the_file_is_the_one_that_is_told() -> None:
    error = error_of(GOOD + "trim_us = true\ncount = 1.5\n")
    assert error.location is not None
    assert error.location.line == 3


@pytest.mark.parametrize(
    ("text", "line", "column"),
    [("a = 1\nb = = 2\n", 2, 5), ("[a\n", 1, 3), ("a = 1\na = 2\n", 2, 6), ("a = [1,\n", 2, 1)],
)
def test_a_syntax_error_has_its_line_and_column(text: str, line: int, column: int) -> None:
    with pytest.raises(InputError, match="TOML syntax") as caught:
        parse(text, "x.toml")
    assert caught.value.location is not None
    assert (caught.value.location.line, caught.value.location.column) == (line, column)


def test_a_file_that_is_not_there_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"missing\.toml: error: cannot be read: No such file"):
        load(tmp_path / "missing.toml", File)


def test_a_file_that_is_not_text_is_an_input_error_with_its_line(tmp_path: Path) -> None:
    file = tmp_path / "x.toml"
    file.write_bytes(b"a = 1\nb = '\xff'\n")
    with pytest.raises(InputError, match=r"x\.toml:2: error: is not UTF-8"):
        load(file, File)


def test_a_byte_order_mark_is_no_error(tmp_path: Path) -> None:
    file = tmp_path / "x.toml"
    file.write_bytes(b"\xef\xbb\xbf" + GOOD.encode())
    assert load(file, File)[1].servo[0].name == "arm"


def test_models_are_frozen() -> None:
    with pytest.raises(ValueError, match="frozen"):
        Servo(name="arm").name = "leg"  # type: ignore[misc]


def test_a_key_is_its_name_and_its_unit() -> None:
    assert split_unit("period_us") == ("period", "us")
    assert split_unit("speed_deg_s") == ("speed", "deg_s")
    assert split_unit("open_drain") == ("open_drain", "")


def test_numbers_are_what_is_written() -> None:
    assert exact(0.1) == Fraction(1, 10)
    assert exact(20_000) == 20_000


def test_array_elements_count_from_one() -> None:
    assert key_text(("motion", "poses", 0, "hold_s")) == "motion.poses[1].hold_s"
