"""The words for each kind of error of a checked value, its place, and values as TOML writes them."""

from __future__ import annotations

from typing import Literal

import pytest
from pydantic import Field, field_validator

from servogen.errors import InputError
from servogen.toml.edit import append_element, move_element, remove_element, set_in_element
from servogen.toml.file import Table, key_text, parse, shown, split_unit, unknown_key, validate


class Point(Table):
    at_deg: float = Field(gt=0, lt=10)
    width_us: float = 1.0


class Arm(Table):
    length_mm: float


class Robot(Table):
    name: str = Field(default="a", pattern="^[a-z]+$")
    point: tuple[Point, ...] = Field(default=(), min_length=0, max_length=2)
    pair: tuple[int, ...] = Field(default=(1, 2), min_length=2, max_length=3)
    kind: Literal["x"] = "x"


class Whole(Table):
    robot: Robot
    legs: tuple[Arm, ...] = ()
    labels: dict[str, int] = {}  # noqa: RUF012 - pydantic copies it


class Even(Table):
    number: int

    @field_validator("number")
    @classmethod
    def _even(cls, value: int) -> int:
        if value % 2:
            raise ValueError("is odd")
        return value


def refused(text: str, model: type[Table] = Whole) -> str:
    with pytest.raises(InputError) as caught:
        validate(parse(text, "r.toml"), model)
    return str(caught.value).removeprefix("r.toml:").replace("\n  ", " | ")


ROBOT = "[robot]\n"


NOT_WHOLE = "is not a whole number [wrong-type]"
AS_WHOLE = " | without a point and an exponent: "
RANGE = "is out of range"


@pytest.mark.parametrize(
    ("line", "column", "key", "says"),
    [
        ("point = [{ at_deg = 0 }]", 12, "point[1].at_deg",
         f"0 {RANGE}: more than 0 is allowed [out-of-range]"),
        ("point = [{ at_deg = 10.0 }]", 12, "point[1].at_deg",
         f"10.0 {RANGE}: less than 10 is allowed [out-of-range]"),
        ("point = [{ at_deg = 1 }, { at_deg = 1 }, { at_deg = 1 }]", 1, "point",
         "has 3 values [wrong-type] | at most 2"),
        ("pair = [1]", 1, "pair", "has 1 value [wrong-type] | at least 2"),
        ("pair = []", 1, "pair", "has 0 values [wrong-type] | at least 2"),
        ("pair = [1, 1.5]", 12, "pair[2]", f"1.5 {NOT_WHOLE}"),
        ("pair = [1, 2e15]", 12, "pair[2]", f"2000000000000000.0 {NOT_WHOLE}"),
        ("pair = [1, 1e15]", 12, "pair[2]", f"1000000000000000.0 {NOT_WHOLE}"),
        ("pair = [1, 9e14]", 12, "pair[2]", f"900000000000000.0 {NOT_WHOLE}{AS_WHOLE}900_000_000_000_000"),
        ("pair = [1, -2e3]", 12, "pair[2]", f"-2000.0 {NOT_WHOLE}{AS_WHOLE}-2_000"),
        ('name = "A"', 1, "name",
         '"A" is not a name [wrong-type] | a letter, then letters, digits, _ or -'),
        ("name = 4", 1, "name", '4 is not a text in "quotes" [wrong-type]'),
        ("point = [5]", 10, "point[1]", "5 is not a table { … } [wrong-type]"),
        ("point = [{}]", 10, "point[1]",
         "'at_deg' is missing [missing-key] | add robot.point[1].at_deg = …"),
        ("point = [{ at = 1 }]", 12, "point[1].at", "'at' has no unit: write at_deg [wrong-unit]"),
        ("point = [{ at_mm = 1 }]", 12, "point[1].at_mm",
         "'at_mm' is not given in mm: write at_deg [wrong-unit]"),
        ("colour = 1", 1, "colour",
         "unknown key 'colour' [unknown-key] | known: kind, name, pair, point"),
    ],
)  # fmt: skip
def test_each_kind_of_error_has_its_words_and_place(line: str, column: int, key: str, says: str) -> None:
    assert refused(f"{ROBOT}{line}\n") == f"2:{column}: error: robot.{key}: {says}"


def test_what_is_missing_at_the_top_is_written_as_a_heading() -> None:
    class Some(Table):
        legs: tuple[Arm, ...]

    class Size(Table):
        size_mm: float

    assert "'robot' is missing [missing-key] | add [robot]" in refused("", Whole)
    assert "'legs' is missing [missing-key] | add [[legs]]" in refused("", Some)
    assert "'size_mm' is missing [missing-key] | add size_mm = …" in refused("", Size)


def test_what_a_check_of_the_model_says_is_said() -> None:
    assert refused("number = 3\n", Even) == "1:1: error: number: is odd [not-allowed]"
    assert validate(parse("number = 4\n", "r.toml"), Even).number == 4


def test_a_rule_without_words_of_its_own_is_said_in_those_of_pydantic() -> None:
    class Fives(Table):
        number: int = Field(multiple_of=5)

    assert refused("number = 7\n", Fives) == (
        "1:1: error: number: 7: Input should be a multiple of 5 [not-allowed]"
    )
    assert validate(parse("number = 10\n", "r.toml"), Fives).number == 10


def test_a_dictionary_takes_any_names_and_checks_their_values() -> None:
    assert (
        refused("[robot]\n[labels]\na = 1.5\n")
        == "3:1: error: labels.a: 1.5 is not a whole number [wrong-type]"
    )
    assert refused("labels = 3\n[robot]\n") == "1:1: error: labels: 3 is not a table { … } [wrong-type]"


def test_the_first_error_in_the_file_counts_but_what_is_missing_comes_last() -> None:
    text = "[robot]\npoint = [{ width_us = 2 }]\npair = [1]\nname = 5\n"
    assert refused(text).startswith("3:1: error: robot.pair")
    assert refused("[robot]\nname = 5\npair = [1]\n").startswith("2:1: error: robot.name")
    assert refused("[robot]\npair = [1, true]\n").startswith("2:12: error: robot.pair[2]: true is not")


def test_a_part_of_a_document_is_checked_by_itself() -> None:
    document = parse('[a]\n[[a.b]]\nlength_mm = 2\n[[a.b]]\nlength_mm = "x"\n', "r.toml")
    assert validate(document, Arm, ("a", "b", 0)).length_mm == 2
    with pytest.raises(InputError, match=r'^r\.toml:5:1: error: a\.b\[2\]\.length_mm: "x" is not a number'):
        validate(document, Arm, ("a", "b", 1))


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (True, "true"), (1.0, "1.0"), (4_000_000, "4000000"), ("a", '"a"'),
        ((1, "b", False), '[1, "b", false]'),
        ({"a": 1, "b": (2,)}, "{ a = 1, b = [2] }"), ("x" * 38, f'"{"x" * 38}"'), ("x" * 39, f'"{"x" * 36}…'),
        ((), "[]"),
    ],
)  # fmt: skip
def test_a_value_is_shown_as_toml_up_to_40_characters(value: object, text: str) -> None:
    assert shown(value) == text
    assert len(shown(value)) <= 40


@pytest.mark.parametrize("number", [2**63, -(2**63) - 1])
def test_a_number_of_more_than_64_bits_is_refused_wherever_it_is(number: int) -> None:
    for text, key in (("a = {}", "a"), ("[t]\nb = [1, {}]", "t.b[2]"), ("t = {{ b = [[{}]] }}", "t.b[1][1]")):
        with pytest.raises(InputError) as caught:
            parse(text.format(number), "r.toml")
        assert caught.value.message == f"{number} is too large"
        assert caught.value.location is not None and caught.value.location.key == key
        inside = number - 1 if number > 0 else number + 1
        parse(text.format(inside), "r.toml")


@pytest.mark.parametrize(
    ("word", "parts"),
    [
        ("period_us", ("period", "us")), ("clock_kHz", ("clock", "kHz")), ("a_b_rad_s", ("a_b", "rad_s")),
        ("pin", ("pin", "")), ("us", ("us", "")), ("a_x", ("a_x", "")), ("speed_mm_s2", ("speed", "mm_s2")),
    ],
)  # fmt: skip
def test_a_unit_is_what_follows_an_underscore(word: str, parts: tuple[str, str]) -> None:
    assert split_unit(word) == parts


def test_an_unknown_key_is_compared_with_those_that_are_known() -> None:
    document = parse("a_ms = 1\n", "r.toml")
    assert (
        unknown_key(document, ("a_ms",), ["a_us"]).message == "'a_ms' is not given in ms: write a_us = 1000"
    )
    assert unknown_key(document, ("a",), ["a_us"]).message == "'a' has no unit: write a_us"
    assert unknown_key(document, ("a_ms",), ["a"]).message == "unknown key 'a_ms'"
    assert unknown_key(document, ("a_ms",), ["b_us", "a_s", "c"]).code == "wrong-unit"
    assert key_text((0, "a", 1, "b")) == "[1].a[2].b"


def test_a_syntax_error_shows_its_line() -> None:
    for text, line, column, hint in (
        ("a = 1\n  b = = 2\n", 2, 7, "in: b = = 2"),
        ("a = [1,", 1, 8, "in: a = [1,"),
        ("a = [1,\n", 2, 1, None),
    ):
        with pytest.raises(InputError) as caught:
            parse(text, "r.toml")
        place = caught.value.location
        assert place is not None
        assert (place.line, place.column, caught.value.hint) == (line, column, hint)


# -- edits ---------------------------------------------------------------------------------------------------


def array(text: str) -> str:
    return f"[m]\nposes = {text}\n"


KEY = ("m", "poses")


@pytest.mark.parametrize(
    ("before", "index", "to", "after"),
    [
        ("[1, 2,  3]", 0, 2, "[2, 3,  1]"),
        ("[1, 2,  3]", 2, 0, "[3, 1,  2]"),
        ("[1, 2,  3,]", 1, 1, "[1, 2,  3,]"),
        ("[ # all\n  1,\n  2\n]", 0, 1, "[ # all\n  2,\n  1\n]"),
        ("[\n  1, # one\n  2 # two\n]", 1, 0, "[\n  2, # two\n  1 # one\n]"),
        ("[1, # one\n 2]", 0, 1, "[\n 2,1 # one\n]"),
    ],
)
def test_elements_move(before: str, index: int, to: int, after: str) -> None:
    made = move_element(array(before), KEY, index, to)
    assert parse(made, "m.toml").data["m"]["poses"] == parse(array(after), "m.toml").data["m"]["poses"]
    if "one\n 2" not in before:
        assert made == array(after)


@pytest.mark.parametrize(
    ("before", "index", "after"),
    [
        ("[1]", 0, "[]"), ("[1, 2]", 1, "[1]"), ("[1, 2]", 0, "[2]"), ("[1, 2,]", 0, "[2,]"),
        ("[\n  1, # one\n  2, # two\n]", 0, "[\n  2, # two\n]"),
        ("[\n  1,\n  # of 2\n  2,\n]", 1, "[\n  1,\n]"),
    ],
)  # fmt: skip
def test_elements_are_removed(before: str, index: int, after: str) -> None:
    assert remove_element(array(before), KEY, index) == array(after)
    for wrong in (-1, before.count(",") + 2):
        with pytest.raises(IndexError):
            remove_element(array(before), KEY, wrong)


def test_an_element_of_a_table_is_named_by_its_written_key() -> None:
    text = array('[{ "a b" = 1, c.d = 2, e = 3 }]')
    assert set_in_element(text, KEY, 0, "a b", "5") == array('[{ "a b" = 5, c.d = 2, e = 3 }]')
    assert set_in_element(text, KEY, 0, "c.d", None) == array('[{ "a b" = 1, e = 3 }]')
    assert set_in_element(text, KEY, 0, "e", None) == array('[{ "a b" = 1, c.d = 2 }]')
    assert append_element(array("[\n  1\n]"), KEY, "2") == array("[\n  1,\n  2,\n]")
