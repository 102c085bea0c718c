"""Text of programs: what is taken, and every refusal with its line, its column and its hint."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.errors import InputError
from servogen.movemaster.language import COMMANDS, NOT_HERE
from servogen.movemaster.parser import Bit, ProgramLine, Value, parse, read


def only(text: str) -> ProgramLine:
    (statement,) = parse(text, "a.rvm").statements
    return statement


def refusal(text: str) -> str:
    with pytest.raises(InputError) as caught:
        parse(text, "a.rvm")
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "number", "mnemonic", "arguments"),
    [
        ("NT", None, "NT", ()), ("10 NT", 10, "NT", ()), ("  10   nt  ", 10, "NT", ()),
        ("10MO1,O", 10, "MO", (1, "O")),
        ("10 mo 1 , c ' grip it, then go", 10, "MO", (1, "C")),
        ("PD 1, -12.5, +300, .5, 7., 0", None, "PD", (1, -12.5, 300.0, 0.5, 7.0, 0.0)),
        ("PD 1,, 5,,,", None, "PD", (1, 0.0, 5.0, 0.0, 0.0, 0.0)),
        ("DW ,,20", None, "DW", (0.0, 0.0, 20.0)), ("2048 ED", 2048, "ED", ()), ("10 SC 5", 10, "SC", (5,)),
        ("10 SC 5, -32767", 10, "SC", (5, -32767)), ("10 TB +0, 5", 10, "TB", (Bit(0, True), 5)),
        ("10 TB -0, 5", 10, "TB", (Bit(0, False), 5)),
        ("10 OB 7", 10, "OB", (Bit(7, True),)), ("10 OD &ff", 10, "OD", (255,)),
    ],
)  # fmt: skip
def test_a_line_is_read(text: str, number: int | None, mnemonic: str, arguments: tuple[Value, ...]) -> None:
    statement = only(text)
    assert statement.command is COMMANDS[mnemonic]
    assert (statement.number, statement.arguments) == (number, arguments)


@pytest.mark.parametrize(
    ("text", "value"),
    [("&0", 0), ("&FF", 255), ("&7FFF", 32767), ("&8001", -32767), ("&FFFF", -1), ("-5", -5), ("+5", 5)],
)
def test_hexadecimal_words_are_signed(text: str, value: int) -> None:
    assert only(f"10 EQ {text}, 20").arguments[0] == value


def test_empty_lines_and_comments_are_no_statements() -> None:
    statements = parse("\n ' a comment\n\n10 NT\r\n   \n", "a.rvm").statements
    assert [(each.number, each.place.line) for each in statements] == [(10, 4)]


def test_a_numbered_comment_is_a_line_that_can_be_jumped_to() -> None:
    statement = only("10 ' start")
    assert (statement.number, statement.command) == (10, None)
    assert str(only("  10 ' start").place) == "a.rvm:1:3: program line 10"


def test_a_statement_knows_its_place() -> None:
    place = parse("' x\n  10 MO 1\n", "a.rvm").statements[0].place
    assert str(place) == "a.rvm:2:6: program line 10"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "10 MOVE 1",
            "a.rvm:1:4: error: program line 10: unknown command 'MOVE' [bad-command]\n  did you mean 'MO'?",
        ),
        (
            "MV 1",
            "a.rvm:1:1: error: unknown command 'MV' [bad-command]\n  commands that begin with M: "
            "MA, MC, MJ, MO, MP, MS, MT",
        ),
        (
            "10 RN 5",
            "a.rvm:1:4: error: program line 10: RN is not allowed in a program [program-syntax]\n"
            "  write it without a line number, before the program; it is then executed immediately",
        ),
        (
            "GT 5",
            "a.rvm:1:1: error: GT is allowed in a program only [program-syntax]\n  give it a line "
            "number: 10 GT",
        ),
        (
            "10 MO 630",
            "a.rvm:1:7: error: program line 10: MO: a cannot be 630 [program-argument]\n  allowed: 1 to 629",
        ),
        (
            "10 MO 0",
            "a.rvm:1:7: error: program line 10: MO: a cannot be 0 [program-argument]\n  allowed: 1 to 629",
        ),
        (
            "10 MO x",
            "a.rvm:1:7: error: program line 10: MO: a: 'x' is not a number [program-argument]\n  "
            "allowed: 1 to 629",
        ),
        (
            "10 MO 1 2",
            "a.rvm:1:7: error: program line 10: MO: a: '1 2' is not a number [program-argument]\n  "
            "allowed: 1 to 629",
        ),
        (
            "10 SP 1.5",
            "a.rvm:1:7: error: program line 10: SP: n is not a whole number: 1.5 [program-argument]\n  "
            "allowed: 0 to 9",
        ),
        (
            "10 MO 1, X",
            "a.rvm:1:10: error: program line 10: MO: hand cannot be 'X' [program-argument]\n"
            "  allowed: O (hand open) or C (hand closed)",
        ),
        (
            "10 MS 1",
            "a.rvm:1:4: error: program line 10: MS takes 2 to 3 arguments, not 1 "
            "[program-argument]\n  it is written: MS a, n [, O/C]",
        ),
        (
            "10 MO 1, O, 3",
            "a.rvm:1:13: error: program line 10: MO takes 1 to 2 arguments, not 3 "
            "[program-argument]\n  it is written: MO a [, O/C]",
        ),
        (
            "10 GO 3",
            "a.rvm:1:7: error: program line 10: GO takes no arguments, not 1 [program-argument]\n  "
            "it is written: GO",
        ),
        (
            "10 HE",
            "a.rvm:1:4: error: program line 10: HE takes 1 argument, not 0 [program-argument]\n  it "
            "is written: HE a",
        ),
        (
            "10 MO , O",
            "a.rvm:1:7: error: program line 10: MO: a is missing [program-argument]\n  allowed: 1 to 629",
        ),
        (
            "10 TB -8, 3",
            "a.rvm:1:7: error: program line 10: TB: a cannot be '-8' [program-argument]\n"
            "  allowed: +0 to +7 (bit on) or -0 to -7 (bit off)",
        ),
        (
            "10 EQ &8000, 3",
            "a.rvm:1:7: error: program line 10: EQ: a1 cannot be &8000 [program-argument]\n"
            "  allowed: -32767 to 32767 or &8001 to &7FFF",
        ),
        (
            "10 EQ &12345, 3",
            "a.rvm:1:7: error: program line 10: EQ: a1: '&12345' is not a hexadecimal number "
            "[program-argument]\n"
            "  & and up to four of 0-9 A-F; allowed: -32767 to 32767 or &8001 to &7FFF",
        ),
        (
            "10 OD &100",
            "a.rvm:1:7: error: program line 10: OD: a cannot be &100 [program-argument]\n  allowed: "
            "0 to 255 or &0 to &FF",
        ),
        (
            "10 MO &1",
            "a.rvm:1:7: error: program line 10: MO: a takes no hexadecimal number, not '&1' "
            "[program-argument]\n  allowed: 1 to 629",
        ),
        ("2049 NT", "a.rvm:1:1: error: 2049 is not a line number [program-syntax]\n  1 to 2048"),
        pytest.param(
            "9" * 900 + " NT",
            f"a.rvm:1:1: error: {'9' * 40} is not a line number [program-syntax]\n  1 to 2048",
            id="900 digits",
        ),
        pytest.param(
            "NT " + "9" * 5000,
            "a.rvm:1: error: the line has more than 1000 characters [file-too-large]",
            id="5000 digits",
        ),
        ("0 NT", "a.rvm:1:1: error: 0 is not a line number [program-syntax]\n  1 to 2048"),
        ("-5 NT", "a.rvm:1:1: error: -5 is not a line number [program-syntax]\n  1 to 2048"),
        (
            "20",
            "a.rvm:1:3: error: program line 20: line 20 has no command [program-syntax]\n  write "
            "one, or a comment: 10 ' start",
        ),
        (
            "10 ! 3",
            "a.rvm:1:4: error: program line 10: a command is missing before '!' [program-syntax]\n  "
            "two letters, such as MO 1",
        ),
        (
            "?",
            "a.rvm:1:1: error: a command is missing before '?' [program-syntax]\n  two letters, such as MO 1",
        ),
        (
            "' nothing\n",
            "a.rvm: error: has no command [no-program]\n  a program: 10 NT, 20 ED, each on a line of its own",
        ),
    ],
)
def test_what_is_wrong_is_said_with_its_place(text: str, message: str) -> None:
    assert refusal(text) == message


def test_a_line_has_up_to_a_thousand_characters() -> None:
    longest = "NT '" + 996 * "x"
    assert len(parse(f"10 TI 1\n{longest}", "a.rvm").statements) == 2
    assert refusal(f"10 TI 1\n{longest}x") == (
        "a.rvm:2: error: the line has more than 1000 characters [file-too-large]"
    )


def test_the_line_of_an_error_is_the_file_s() -> None:
    assert refusal("NT\n\n10 MO 1\n20 MO 999\n").startswith("a.rvm:4:7: error: program line 20: ")


# Errata: the source's table prints RV for row 40 and 52 for row 41.
@pytest.mark.parametrize(
    ("text", "right"), [("RV 10, 20", "write RN"), ("100 RV 10", "write RN"), ("100 52", "write RT")]
)
def test_misprints_of_the_source_are_told(text: str, right: str) -> None:
    said = refusal(text)
    assert "a misprint in the source's table" in said
    assert said.endswith(right)


@pytest.mark.parametrize("mnemonic", sorted(NOT_HERE))
def test_commands_of_the_terminal_are_refused_by_name(mnemonic: str) -> None:
    assert f"{mnemonic} is not supported: it " in refusal(f"10 {mnemonic} 1")


def test_a_file_is_read(tmp_path: Path) -> None:
    file = tmp_path / "p.rvm"
    file.write_text("10 NT\n20 ED\n", "utf-8")
    assert len(read(file).statements) == 2


def test_a_missing_file_and_a_binary_one_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read(tmp_path / "none.rvm")
    file = tmp_path / "p.rvm"
    file.write_bytes(b"10 NT\n20 \xff\n")
    with pytest.raises(InputError, match=r"p\.rvm:2: error: is not UTF-8 text"):
        read(file)


@settings(max_examples=300)
@given(st.text(alphabet="0123456789 ,.'&+-MOGSTRCNXPDABE\n", max_size=60))
def test_any_text_is_read_or_refused_with_a_place(text: str) -> None:
    try:
        parse(text, "a.rvm")
    except InputError as error:
        assert error.location is not None
