"""Every key of a TOML document has a line and a column."""

from servogen.toml.file import parse


def where(text: str, *key: str | int) -> tuple[int | None, int | None]:
    place = parse(text, "x.toml").place(*key)
    return place.line, place.column


def test_a_key_of_a_table_stands_where_it_is_written() -> None:
    assert where("[chip]\n  clock_hz = 4\n", "chip", "clock_hz") == (2, 3)


def test_a_table_stands_at_its_header() -> None:
    assert where("a = 1\n\n[chip]\nb = 2\n", "chip") == (3, 1)


def test_each_element_of_an_array_of_tables_has_its_own_place() -> None:
    text = '[[servo]]\nname = "a"\n[[servo]]\nname = "b"\n'
    assert where(text, "servo", 0, "name") == (2, 1)
    assert where(text, "servo", 1) == (3, 1)
    assert where(text, "servo", 1, "name") == (4, 1)


def test_a_table_below_an_array_of_tables_belongs_to_its_newest_element() -> None:
    text = "[[servo]]\n[[servo]]\n[servo.fact]\nmass = 1\n[[servo.point]]\nw = 1\n[[servo.point]]\nw = 2\n"
    assert where(text, "servo", 1, "fact", "mass") == (4, 1)
    assert where(text, "servo", 1, "point", 1, "w") == (8, 1)


def test_elements_of_an_array_over_several_lines_are_found_past_comments() -> None:
    text = (
        "[motion]\nposes = [\n  { arm_deg = 30 }, # first\n  # between\n  { arm_deg = 90, hold_s = 2 },\n]\n"
    )
    assert where(text, "motion", "poses", 1) == (5, 3)
    assert where(text, "motion", "poses", 1, "hold_s") == (5, 19)


def test_dotted_and_quoted_keys_are_the_keys_they_spell() -> None:
    text = 'a.b."c d".e = 1\n'
    assert where(text, "a", "b", "c d", "e") == (1, 1)


def test_columns_count_characters_not_bytes() -> None:
    assert where('t = { "µ°" = 1, x = 2 }\n', "t", "x") == (1, 17)


def test_windows_line_ends_change_nothing() -> None:
    assert where("a = 1\r\nb = 2\r\n", "b") == (2, 1)


def test_a_key_that_is_not_written_is_placed_at_its_table() -> None:
    place = parse("[frame]\nperiod_us = 1\n", "x.toml").place("frame", "gap_us")
    assert (place.line, place.column, place.key) == (1, 1, "frame.gap_us")
    assert str(place) == "x.toml:1:1: frame.gap_us"
