"""An error says where, what, and what to do; its class says how a command ends."""

import pytest

from servogen.errors import InputError, Place, ServogenError, ToolError, nearest


@pytest.mark.parametrize(
    ("place", "text"),
    [
        (Place("job.toml", 3, 7), "job.toml:3:7"),
        (Place("job.toml", 3), "job.toml:3"),
        (Place("job.toml"), "job.toml"),
        (Place("job.toml", key="frame.period_us"), "job.toml: frame.period_us"),
        (Place(key="frame.period_us"), "frame.period_us"),
        (Place(line=3, column=7), "line 3, column 7"),
        (Place(line=3), "line 3"),
        (Place(), ""),
    ],
)
def test_a_place_reads_as_editors_and_people_read_it(place: Place, text: str) -> None:
    assert str(place) == text


def test_an_error_reads_place_message_hint() -> None:
    error = InputError("the angle is out of travel", Place("job.toml", 3), "allowed: 0 to 180")
    assert str(error) == "job.toml:3: the angle is out of travel\n  allowed: 0 to 180"
    assert str(InputError("no poses")) == "no poses"


def test_bad_input_ends_with_2_and_a_missing_tool_with_3() -> None:
    assert (InputError("x").exit_code, ToolError("x").exit_code) == (2, 3)
    assert issubclass(InputError, ServogenError)
    assert issubclass(ToolError, ServogenError)


def test_the_nearest_known_word_is_offered_whatever_its_case() -> None:
    assert nearest("perod_us", ["period_us", "device"]) == "did you mean 'period_us'?"
    assert nearest("rb0", ["RB0", "RA4"]) == "did you mean 'RB0'?"


def test_where_none_is_near_all_are_named() -> None:
    assert nearest("zzz", ["b", "a"]) == "known: a, b"
