"""A TOML file of any contents is refused or read in a bounded time: size, entries, depth, digits."""

import pytest

from servogen.errors import InputError
from servogen.toml import locations
from servogen.toml.file import Table, parse, validate
from servogen.toml.locations import MAX_DEPTH, MAX_ENTRIES


@pytest.mark.parametrize(
    ("text", "says"),
    [
        pytest.param("a = " + "[" * 5000, "nested too deeply", id="unclosed brackets"),
        pytest.param(f"a = {'[' * 200}{']' * 200}", "nested too deeply", id="brackets"),
        pytest.param(".".join("a" * 3000) + " = 1", "nested too deeply", id="a dotted key"),
        pytest.param(f"a = {'9' * 5000}", "thousands of digits", id="5000 digits"),
        pytest.param(f"a = [1, {2**63}]", "too large.*\n  whole numbers are those of 64 bits", id="2^63"),
    ],
)
def test_what_is_too_much_is_refused_with_its_line(text: str, says: str) -> None:
    with pytest.raises(InputError, match=says) as caught:
        parse(f"# a comment\n{text}\n", "big.toml")
    assert caught.value.location is not None
    assert caught.value.location.file == "big.toml"


@pytest.mark.campaign
def test_the_largest_that_is_allowed_is_read() -> None:
    parse(f"a = [{'1, ' * (MAX_ENTRIES - 1)}]", "big.toml")
    parse(".".join("a" * MAX_DEPTH) + f" = {2**63 - 1}", "deep.toml")


def test_tables_and_keys_of_tables_are_entries(monkeypatch: pytest.MonkeyPatch) -> None:
    """The array of tables, its 30 tables, and a key in each of these and in a table inside of it; numbers."""
    text = "[[t]]\na = 1\nb = { c = 1 }\n" * 30
    for most, fits in ((121, True), (120, False)):
        monkeypatch.setattr(locations, "MAX_ENTRIES", most)
        if fits:
            parse(text, "big.toml")
        else:
            with pytest.raises(InputError, match=r"big\.toml:90: error: has too many values"):
                parse(text, "big.toml")
    for count, fits in ((119, True), (120, False)):
        numbers = f"# a comment\na = [{'1, ' * count}]\n"
        if fits:
            parse(numbers, "big.toml")
        else:
            with pytest.raises(InputError, match=r"big\.toml:2: error: has too many values"):
                parse(numbers, "big.toml")


def test_places_of_a_long_line_count_letters() -> None:
    document = parse('a = ["µ", "µ", 3]', "a.toml")
    assert [document.place("a", index).column for index in range(3)] == [6, 11, 16]


class Empty(Table):
    pass


def test_of_many_unknown_keys_the_first_is_named() -> None:
    document = parse("".join(f"k{number} = 1\n" for number in range(5_000)), "many.toml")
    with pytest.raises(InputError, match=r"many\.toml:1:1: error: k0: unknown key 'k0'"):
        validate(document, Empty)
