"""An error says where, what, and what to do; its class says how a command ends."""

import pickle

import pytest

from servogen.errors import (
    Diagnostic,
    InputError,
    Location,
    ServogenError,
    ToolError,
    check_known,
    did_you_mean,
)


@pytest.mark.parametrize(
    ("place", "text"),
    [
        (Location("job.toml", 3, 7), "job.toml:3:7"),
        (Location("job.toml", 3), "job.toml:3"),
        (Location("job.toml"), "job.toml"),
        (Location("job.toml", key="frame.period_us"), "job.toml: frame.period_us"),
        (Location(key="frame.period_us"), "frame.period_us"),
        (Location(line=3, column=7), "line 3, column 7"),
        (Location(line=3), "line 3"),
        (Location(line=3, key="frame"), "line 3, frame"),
        (Location("a.hex", cycle=7, address=0x1F), "a.hex: cycle 7, address 0x01F"),
        (Location(cycle=0, address=0), "cycle 0, address 0x000"),
        (Location(), ""),
    ],
)
def test_a_place_reads_as_editors_and_people_read_it(place: Location, text: str) -> None:
    assert str(place) == text


@pytest.mark.parametrize(
    ("diagnostic", "text"),
    [
        (
            Diagnostic("error", "bad-angle", "out of travel", Location("job.toml", 3, 7), "0 to 180"),
            "job.toml:3:7: error: out of travel [bad-angle]\n  0 to 180",
        ),
        (
            Diagnostic("warning", "too-fast", "it is fast", Location("job.toml", 3, 7, "servo[1]")),
            "job.toml:3:7: warning: servo[1]: it is fast [too-fast]",
        ),
        (Diagnostic("note", "cycle", "5 frames"), "servogen: note: 5 frames [cycle]"),
        (
            Diagnostic("error", "bad-angle", "no number", Location(key="--pose")),
            "servogen: error: --pose: no number [bad-angle]",
        ),
    ],
)
def test_a_diagnostic_reads_as_gcc_writes_it(diagnostic: Diagnostic, text: str) -> None:
    assert str(diagnostic) == text


def test_a_source_line_stands_below_with_a_caret_under_the_column() -> None:
    diagnostic = Diagnostic("error", "x-y", "no", Location("a.c", 2, 3), "try")
    assert diagnostic.render({("a.c", 2): "\tx = y;"}).splitlines() == [
        "a.c:2:3: error: no [x-y]",
        "    \tx = y;",
        "    \t ^",
        "  try",
    ]
    no_line = Diagnostic("error", "x-y", "no", Location("a.c"))
    assert no_line.render({("a.c", 1): "x = y;"}) == "a.c: error: no [x-y]"


def test_an_error_carries_all_diagnostics_and_the_first_error_is_its_own() -> None:
    found = (Diagnostic("warning", "w-w", "odd"), Diagnostic("error", "e-e", "bad", Location("f", 2), "mend"))
    error = pickle.loads(pickle.dumps(InputError.of(found)))
    assert error.diagnostics == found
    assert (error.code, error.message, error.location, error.hint) == ("e-e", "bad", Location("f", 2), "mend")


def test_an_error_moved_to_a_location_keeps_its_class_code_and_hint() -> None:
    moved = ToolError("no-port", "it is gone", hint="plug it in").at(Location("job.toml", 4))
    assert isinstance(moved, ToolError)
    assert str(moved) == "job.toml:4: error: it is gone [no-port]\n  plug it in"


def test_an_error_reads_place_message_hint() -> None:
    error = InputError(
        "bad-angle", "the angle is out of travel", Location("job.toml", 3), "allowed: 0 to 180"
    )
    assert str(error) == "job.toml:3: error: the angle is out of travel [bad-angle]\n  allowed: 0 to 180"
    assert str(InputError("no-poses", "no poses")) == "servogen: error: no poses [no-poses]"


def test_bad_input_ends_with_2_and_a_missing_tool_with_3() -> None:
    assert (InputError("x", "y").exit_code, ToolError("x", "y").exit_code) == (2, 3)
    assert issubclass(InputError, ServogenError)
    assert issubclass(ToolError, ServogenError)


def test_the_nearest_known_word_is_offered_whatever_its_case() -> None:
    assert did_you_mean("perod_us", ["period_us", "device"]) == "did you mean 'period_us'?"
    assert did_you_mean("rb0", ["RB0", "RA4"]) == "did you mean 'RB0'?"


def test_where_none_is_near_all_are_named() -> None:
    assert did_you_mean("zzz", ["b", "a"]) == "known: a, b"
    hundred = [f"{number:03}" for number in range(100)]
    assert did_you_mean("zzz", hundred) == f"known: {', '.join(hundred)}"
    assert did_you_mean("zzz", [*hundred, "100"]) == f"known: {', '.join(hundred)}, …"


def test_a_sentence_has_place_and_message_and_json_everything() -> None:
    placed = Diagnostic("warning", "w-w", "odd", Location("a.c", 2, 3, "key", 4, 5), "mend")
    bare = Diagnostic("note", "n-n", "so")
    assert (placed.sentence, bare.sentence) == ("a.c:2:3: key, cycle 4, address 0x005: odd", "so")
    place = {"file": "a.c", "line": 2, "column": 3, "key": "key", "cycle": 4, "address": 5}
    facts: dict[str, object] = {"severity": "warning", "code": "w-w", "message": "odd", "hint": "mend"}
    assert placed.to_json() == facts | place
    facts = {"severity": "note", "code": "n-n", "message": "so", "hint": None}
    assert bare.to_json() == facts | dict.fromkeys(place)


def test_a_word_that_is_not_known_is_refused_with_the_nearest_one_and_its_place() -> None:
    check_known("unknown-pin", "RB0", ("RB0", "RB1"), "never said")
    with pytest.raises(InputError) as caught:
        check_known("unknown-pin", "RBO", ("RB0", "RA4"), "no pin 'RBO'", Location("job.toml", 3))
    (error,) = caught.value.diagnostics
    assert (error.code, error.message, error.hint) == ("unknown-pin", "no pin 'RBO'", "did you mean 'RB0'?")
    assert error.location == Location("job.toml", 3)
