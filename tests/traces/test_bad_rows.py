"""A bad row of CSV or JSON lines is named with file, line, value and what is allowed."""

from pathlib import Path

import pytest

from servogen.edges import EdgeTrace, join
from servogen.errors import InputError
from servogen.traces import read_edges
from servogen.units import Clock

MHZ4 = Clock(4_000_000)
GOOD_CSV = "cycle,pin,level\n5,RB0,1\n10,RB0,0\n"
GOOD_JSONL = '{"cycle":5,"pin":"RB0","level":1}\n{"cycle":10,"pin":"RB0","level":"z"}\n'


def read(tmp_path: Path, name: str, text: str) -> EdgeTrace:
    (tmp_path / name).write_text(text)
    return read_edges(tmp_path / name, MHZ4)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"a\.csv:1: error: is not an edge file.*\n.*cycle,pin,level"),
        (
            "cycle;pin;level\n5;RB0;1\n",
            r"a\.csv:1: error: is not an edge file: its first line is 'cycle;pin;level'",
        ),
        (GOOD_CSV + "12,RB9,1\n", r"a\.csv:4: error: pin 'RB9' is not allowed.*\n.*RA0.*RB7"),
        (GOOD_CSV + "12,RA5,1\n", r"a\.csv:4: error: pin 'RA5'"),
        (GOOD_CSV + "12,RB0,2\n", r"a\.csv:4: error: level '2' is not allowed.*\n.*0, 1"),
        (GOOD_CSV + "12,RB0,z\n", r"a\.csv:4: error: level 'z'"),
        (GOOD_CSV + "-2,RB0,1\n", r"a\.csv:4: error: cycle '-2' is not allowed"),
        (GOOD_CSV + "1.5,RB0,1\n", r"a\.csv:4: error: cycle '1.5'"),
        (GOOD_CSV + "012,RB0,1\n", r"a\.csv:4: error: cycle '012'"),
        (GOOD_CSV + "9999999999999999999,RB0,1\n", r"a\.csv:4: error: cycle '9999999999999999999'"),
        (GOOD_CSV + ",RB0,1\n", r"a\.csv:4: error: cycle ''"),
        (GOOD_CSV + "9,RB0,1\n", r"a\.csv:4: error: cycle 9 comes after cycle 10"),
        (GOOD_CSV + "12,RB0\n", r"a\.csv:4: error: '12,RB0' is not a row"),
        (GOOD_CSV + "12,RB0,1,x\n", r"a\.csv:4: error: '12,RB0,1,x' is not a row"),
        (GOOD_CSV + "\n12,RB0,1\n", r"a\.csv:4: error: '' is not a row"),
    ],
)
def test_csv(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        join(read(tmp_path, "a.csv", text).chunks)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("12,RB0,1", r"a\.jsonl:3: error: is not JSON"),
        ("[12]", r"a\.jsonl:3: error: '\[12\]' is not a JSON object"),
        ('{"cycle":12,"pin":"RB0"}', r"a\.jsonl:3: error: has no 'level'"),
        ('{"cycle":12,"pin":"RB8","level":1}', r"a\.jsonl:3: error: pin 'RB8' is not allowed.*\n.*RB"),
        ('{"cycle":12,"pin":["RB0"],"level":1}', r"a\.jsonl:3: error: pin "),
        ('{"cycle":12,"pin":"RB0","level":"high"}',
            r"a\.jsonl:3: error: level 'high' is not allowed.*\n.*0, 1, \"z\""),
        ('{"cycle":12.0,"pin":"RB0","level":1}', r"a\.jsonl:3: error: cycle 12.0"),
        ('{"cycle":-12,"pin":"RB0","level":1}', r"a\.jsonl:3: error: cycle -12"),
        ('{"cycle":true,"pin":"RB0","level":1}', r"a\.jsonl:3: error: cycle True"),
        ('{"cycle":1000000000000000000,"pin":"RB0","level":1}',
            r"a\.jsonl:3: error: cycle 1000000000000000000"),
        ('{"cycle":9,"pin":"RB0","level":1}', r"a\.jsonl:3: error: cycle 9 comes after cycle 10"),
    ],
)  # fmt: skip
def test_jsonl(tmp_path: Path, line: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        join(read(tmp_path, "a.jsonl", GOOD_JSONL + line + "\n").chunks)


def test_jsonl_that_is_not_utf_8_is_refused_at_its_line(tmp_path: Path) -> None:
    """In a further key as well, which is not looked at."""
    path = tmp_path / "a.jsonl"
    path.write_bytes(GOOD_JSONL.encode() + b'{"cycle":12,"pin":"RB0","level":1,"note":"caf\xe9"}\n')
    with pytest.raises(InputError, match=r"a\.jsonl:3: error: is not UTF-8 text") as refused:
        join(read_edges(path, MHZ4).chunks)
    assert refused.value.code == "not-utf8"


@pytest.mark.parametrize(("letters", "shown"), [(38, "'" + 38 * "x" + "'"), (39, "'" + 36 * "x" + "…")])
def test_a_long_value_is_shown_by_its_first_characters(tmp_path: Path, letters: int, shown: str) -> None:
    """40 at most, the quotes and the ellipsis among them."""
    line = f'{{"cycle":12,"pin":"RB0","level":"{"x" * letters}"}}'
    with pytest.raises(InputError, match=f": error: level {shown} is not allowed"):
        join(read(tmp_path, "a.jsonl", GOOD_JSONL + line + "\n").chunks)


def test_json_of_other_spacing_order_and_further_keys_is_read(tmp_path: Path) -> None:
    text = '{ "level": 1, "pin": "RB0", "cycle": 5, "servo": "arm" }\n\n{"cycle":6,"pin":"RA0","level":"z"}'
    chunk = join(read(tmp_path, "a.jsonl", text).chunks)
    assert [column.tolist() for column in chunk] == [[5, 6], [5, 0], [1, 2]]


@pytest.mark.parametrize("name", ["a.csv", "a.jsonl"])
def test_windows_line_ends_and_a_missing_last_line_feed_are_read(tmp_path: Path, name: str) -> None:
    text = GOOD_CSV if name == "a.csv" else GOOD_JSONL
    (tmp_path / name).write_bytes(text.replace("\n", "\r\n").encode())
    whole = join(read_edges(tmp_path / name, MHZ4).chunks)
    (tmp_path / name).write_bytes(text.rstrip("\n").encode())
    trace = read_edges(tmp_path / name, MHZ4)
    assert whole.cycle.tolist() == join(trace.chunks).cycle.tolist() == [5, 10]
    assert trace.end == 11
