"""The assembler at its limits, from both sides; every message with its line, column and hint; and random
expressions against a second evaluation.
"""

from __future__ import annotations

import random

import pytest

from servogen.errors import InputError, Location
from servogen.pic.assembler import assemble
from servogen.pic.assembler.header import HEADERS, header_device, header_text
from servogen.pic.assembler.instructions import parse_line
from servogen.pic.assembler.messages import MAX_ERRORS, muted_by
from servogen.pic.device import ASSEMBLED_DEVICES, DEVICES, PIC16C84, device


def said(source: str) -> list[str]:
    """Return what is said of a source without END: line:column, severity, words and hint."""
    try:
        found = assemble(f"{source}\n end", "t.asm", DEVICES[0]).warnings
    except InputError as error:
        found = error.diagnostics
    lines = []
    for each in found:
        assert each.location is not None and each.location.file == "t.asm"
        hint = "" if each.hint is None else f" | {each.hint}"
        lines.append(
            f"{each.location.line}:{each.location.column} {each.severity} {each.code}: {each.message}{hint}"
        )
    return lines


CUT = "warning asm-argument-truncated"


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        # literals and bytes: 8 bits, with or without sign
        (" movlw .255", []), (" movlw -.255", []), (" sublw 0", []),
        (" movlw .256", [f"1:2 {CUT}: 256 (0x100) does not fit 8 bits: the lowest are used"]),
        (" movlw -.256", [f"1:2 {CUT}: -256 (0xFFFFFF00) does not fit 8 bits: the lowest are used"]),
        (" db .63, .255\n db 1, -.128", []),
        ("  db .256, 0", [f"1:3 {CUT}: 256 does not fit 8 bits: the lowest are used"]),
        (" db 0, -.129", [f"1:2 {CUT}: -129 does not fit 8 bits: the lowest are used"]),
        # bits and destinations
        (" bsf 3, 7", []), (" bsf 3, 0", []),
        (" bsf 3, 8", [f"1:2 {CUT}: there is no bit 8: its least significant bits are used"]),
        (" bsf 3, -1", [f"1:2 {CUT}: there is no bit -1: its least significant bits are used"]),
        (" movf 3, 0\n movf 3, 1", []),
        (" movf 3, 2", [f"1:2 {CUT}: destination 2 is neither 0 (W) nor 1 (F): its lowest bit is used"]),
        (" movf 3, -1", [f"1:2 {CUT}: destination -1 is neither 0 (W) nor 1 (F): its lowest bit is used"]),
        (" movf 3", ["1:2 note asm-no-destination: no destination: the file register (1) is assumed"]),
        # addresses
        (" goto 0x3FF\n goto 0", []),
        (" goto 0x400", ["1:2 warning asm-address-truncated: address 0x400 is beyond the chip's 1024 words"]),
        (" call -1",
         ["1:2 warning asm-address-truncated: address 0xFFFFFFFF is beyond the chip's 1024 words"]),
        (" clrf 0x7F", []),
        (" clrf 0x80", ["1:2 note asm-bank: register 0x80 is not in bank 0: check the bank bits"]),
        (" clrf -1", ["1:2 note asm-bank: register 0xFFFF is not in bank 0: check the bank bits"]),
        (" option", ["1:2 warning asm-deprecated: OPTION is not recommended: write the register in bank 1"]),
        (" tris 7", ["1:2 error asm-argument-range: TRIS takes port 5 (PORTA) or 6 (PORTB), not 7"]),
        # words
        (" dw 0x3FFF, 0", []),
        (" dw 0x4000",
         ["1:2 note asm-word-truncated: 0x4000 does not fit a program word: its lowest 14 bits are used"]),
        (" dw -1",
         ["1:2 note asm-word-truncated: 0xFFFF does not fit a program word: its lowest 14 bits are used"]),
        (" __idlocs 0xFFFF", []),
        (" __idlocs 0x10000",
         ["1:2 note asm-id-truncated: 0x10000 has more than four digits: the last four are used"]),
        (" __config 0x2006, 1", ["1:11 error asm-argument-range: the configuration word is at 0x2007"]),
        (" __config 1, 2, 3", ["1:2 error asm-too-many-arguments: __CONFIG takes at most 2 operands, not 3"]),
        # the ends of the memory
        (" org 0x3FF\n nop", []),
        (" org 0x400\n nop",
         ["2:2 error asm-address-range: address 0x0400 is beyond the chip | words are program 0x0000-0x03FF, "
          "ids 0x2000-0x2003, config 0x2007-0x2007, eeprom 0x2100-0x213F"]),
        (" org 0x213F\n de 1", []), (" org 0x2100\n db 1, 2, 3", []),
        (" org 1\n nop\n org 1\n nop", ["4:2 error asm-overwrite: address 0x0001 holds 0x0000 already"]),
        # counts
        (" res 0\n fill 0, 0", []),
        (" fill 0, 0x2201", ["1:2 error asm-argument-range: FILL of 8705 words | 0 to 8704 words"]),
        (" res -1", ["1:2 error asm-argument-range: RES of -1 words | 0 to 8704 words"]),
        (" fill 1", ["1:8 error asm-missing-argument: FILL lacks an operand"]),
        (" org", ["1:2 error asm-missing-argument: ORG lacks an operand"]),
        (" ifdef\n endif", ["1:2 error asm-missing-argument: IFDEF needs a name"]),
        (" ifndef\n nop\n else\n endif", ["1:2 error asm-missing-argument: IFNDEF needs a name"]),
        (" if\n endif", ["1:2 error asm-missing-argument: IF lacks an operand"]),
        (" dw 1,,2", ["1:9 error asm-missing-argument: DW lacks an operand"]),
        (" org 1, 2", ["1:2 error asm-too-many-arguments: ORG takes at most 1 operand, not 2"]),
        (" udata_acs 1",
         ["1:2 error asm-relocatable: UDATA_ACS is not supported | "
          "it is for another chip: UDATA reserves bytes"]),
        (" pagesel 0", ["1:2 note asm-page: the chip has one page: no page selection is needed"]),
        # RAM
        (" __maxram 0x2F\n clrf 0x2F", []),
        (" __maxram 0x2F\n clrf 0x30",
         ["2:2 warning asm-no-register: there is no register at this address"]),
        (" __badram 0x20-0x22, 0x30\n clrf 0x1F\n clrf 0x23", []),
        (" __maxram 0x4F\n __badram 0x20-0x22, 0x30\n clrf 0x1F\n clrf 0x20\n clrf 0x22\n clrf 0x23\n"
         " clrf 0x30",
         [f"{line}:2 warning asm-no-register: there is no register at this address" for line in (4, 5, 7)]),
        # names
        ("a equ 1\na equ 2", ["2:1 error asm-duplicate-symbol: 'a' is defined already, as 0x1"]),
        ("a equ 1\na set 2", []), ("a set 1\na equ 2", []),
        ("a nop\n org 0x10\na nop", ["3:1 error asm-duplicate-symbol: 'a' is defined already, as 0x0"]),
        (" equ 1", ["1:2 error asm-missing-argument: EQU needs a name in front of it"]),
        (" constant a", ["1:11 error asm-missing-argument: constant 'a' needs a value"]),
        (" variable 5", ["1:11 error asm-missing-argument: a name is missing here"]),
        (" variable a+1", ["1:12 error asm-syntax: '+' is not expected here"]),
        ("a = 1\na++ 1", ["2:5 error asm-syntax: '1' is not expected here"]),
        ("a = 1\na /= 0", ["2:3 error asm-divide-by-zero: divide by zero"]),
        ("a = 1\na %= 0", ["2:3 error asm-divide-by-zero: divide by zero"]),
        (" local a", ["1:2 error asm-unexpected-directive: local is allowed in a macro only"]),
        ("#define a 1\n#define a 2",
         ["2:9 error asm-duplicate-symbol: 'a' is defined already | #undefine it first"]),
        ("#undefine a", ["1:11 warning asm-unknown-symbol: 'a' was not defined by #define"]),
        ("#define 5", ["1:1 error asm-missing-argument: #DEFINE needs a name"]),
        (" cblock 1\n 5\n endc", ["2:2 error asm-syntax: '5' is not a name"]),
        (" cblock 1", ["1:2 error asm-unclosed-block: CBLOCK without ENDC"]),
        (" retrun", ["1:2 error asm-unknown-operation: unknown operation 'retrun' | did you mean 'return'?"]),
        # labels and columns
        ("   lab: nop", ["1:4 warning asm-label-column: label 'lab' after column 1"]),
        ("nop", ["1:1 warning asm-opcode-column: opcode 'nop' in column 1"]),
        ("x endif", ["1:1 error asm-label: a label cannot stand before ENDIF"]),
        (' dt "ab', ["1:5 warning asm-unclosed-quote: the quote is not closed: the string extends to the end "
                     "of the line"]),
        # conditions
        (" else", ["1:2 error asm-unexpected-directive: ELSE without IF"]),
        (" endif", ["1:2 error asm-unexpected-directive: ENDIF without IF"]),
        (" if 1\n else\n else\n endif", ["3:2 error asm-unexpected-directive: a second ELSE of the same IF"]),
        ("   if 1", ["1:4 warning asm-unclosed-if: this IF has no ENDIF before END"]),
        (" ifdef late\n endif\nlate equ 1",
         ["1:8 warning asm-defined-later: 'late' is defined further below: the second pass gives a different "
          "answer | define it before, or with #define"]),
        (" if 1\n elif 2\n endif",
         ["2:2 error asm-unknown-operation: unknown operation 'elif' | as in gpasm; put another IF between "
          "ELSE and ENDIF"]),
        (" if 0\n elif 2\n endif",
         ["2:2 warning asm-else-if: ELIF is not a directive: it is skipped with the lines around it | as in "
          "gpasm; put another IF between ELSE and ENDIF"]),
        (" if 0\n if 0\n elif 2\n endif\n endif", []),
        (" endw", ["1:2 error asm-unexpected-directive: ENDW without its beginning"]),
        (" while 1\n endw", ["1:2 error asm-endless-loop: this WHILE does not end"]),
        ("i = 0\n while i < .1023\ni++\n endw", []),
        ("i = 0\n while i < .1024\ni++\n endw", ["2:2 error asm-endless-loop: this WHILE does not end"]),
        # macros
        (" macro\n endm", ["1:2 error asm-missing-name: MACRO needs a name in front of it"]),
        ("m macro\n endm\nm macro\n endm",
         ["3:1 error asm-duplicate-symbol: macro 'm' is defined already"]),
        ("m macro 5\n endm", ["1:9 error asm-bad-argument: '5' is not a name for a parameter"]),
        ("i = 0\n while i < 1\ni++\n end\n endw", ["4:2 error asm-unclosed-block: END within a WHILE"]),
        (" exitm", ["1:2 error asm-unexpected-directive: EXITM outside a macro"]),
        ("m macro a\n endm\n m", ["3:2 error asm-macro-arguments: macro 'm' takes 1 argument, not 0"]),
        # settings
        (" radix bin", ["1:8 error asm-bad-argument: 'bin' is not a radix | known: dec, hex, oct"]),
        (" errorlevel x",
         ["1:13 error asm-bad-argument: 'x' is not a level or number | 0, 1, 2, -302 or +302"]),
        (" messg", ["1:2 error asm-missing-argument: MESSG needs a string"]),
        (' error "no"', ["1:2 error asm-user-error: no"]),
        (" list p=16f84a",
         ["1:2 warning asm-processor: processor PIC16F84A is overridden by PIC16F84, which was requested"]),
        (" config CP=OFF, CP=OFF", ["1:17 error asm-overwrite: CP is set twice"]),
        (" config FOSC=XTAL",
         ["1:9 error asm-config: unknown value 'XTAL' of FOSC | did you mean 'XT'?"]),
        (" include", ["1:2 error asm-missing-argument: INCLUDE needs a file name"]),
        (" include x.inc",
         ["1:10 error asm-include: include file 'x.inc' not found | built in: p16f84.inc, p16f84a.inc, "
          "p16c84.inc; others lie beside the source"]),
        # expressions
        (" movlw #v(1", ["1:10 error asm-parenthesis: unmatched ("]),
        (" movlw [1)", ["1:8 error asm-parenthesis: unmatched ["]),
        (" movlw 1 +", ["1:11 error asm-missing-argument: an operand is missing here"]),
        (' dt "a" + 1', []),
        # a word in front of a quote is a name where it is no radix, and where the quote is not closed
        (" movlw abc'1'", ["1:11 error asm-syntax: ''1'' is not expected here"]),
        (" movlw d'12", ["1:9 error asm-syntax: the quote ' is not closed"]),
        (" movlw $$", ["1:9 error asm-syntax: '$' is not expected here"]),
    ],
)  # fmt: skip
def test_what_is_said_with_its_place(source: str, expected: list[str]) -> None:
    assert said(source) == expected


def test_a_sum_of_200_operators_is_parsed_and_one_of_201_is_not() -> None:
    assert said(" movlw " + "+".join("1" * 201)) == []
    (found,) = said(" movlw " + "+".join("1" * 202))
    assert found == f"1:{8 + 2 * 200 + 1} error asm-syntax: more than 200 operators in a line"


def test_fifty_levels_of_brackets_are_parsed_and_one_more_is_not() -> None:
    assert said(f" movlw {'(' * 49}1{')' * 49}") == []
    (found,) = said(f" movlw {'(' * 50}1{')' * 50}")
    assert found == f"1:{8 + 50} error asm-syntax: the expression is nested too deeply"


def test_a_line_of_2000_characters_is_read_and_one_of_2001_is_not() -> None:
    line = " movlw 1 ;"
    assert said(line + "x" * (2000 - len(line))) == []
    assert said(line + "x" * (2001 - len(line))) == [
        "1:2001 error asm-syntax: the line has more than 2000 characters"
    ]


def test_a_hundred_errors_are_shown() -> None:
    wrong = " movlw none\n"
    assert len(said(wrong * (MAX_ERRORS - 1))) == MAX_ERRORS - 1
    assert len(said(wrong * (MAX_ERRORS + 5))) == MAX_ERRORS


@pytest.mark.campaign
def test_turns_of_all_loops_together_have_a_limit() -> None:
    """16384 turns: sixteen loops of 1023 and 16 more."""
    loops = "i = 0\n while i < .1023\ni++\n endw\n" * 16
    assert said(loops + "i = 0\n while i < .16\ni++\n endw") == []
    more = said(loops + "i = 0\n while i < .17\ni++\n endw")
    assert [each.split(": ", 1)[1] for each in more] == ["this WHILE does not end"]


def test_levels_and_numbers_mute_what_they_name() -> None:
    """Warnings are 2xx, messages 3xx; level 1 drops messages, level 2 both."""
    loud = " movf 3\n bsf 3, 8"
    both = ["asm-no-destination", "asm-argument-truncated"]

    def codes(setting: str) -> list[str]:
        return [each.split(" ")[2].rstrip(":") for each in said(f"{setting}\n{loud}")]

    assert codes(" errorlevel 0") == both
    assert codes(" errorlevel 1") == both[1:]
    assert codes(" errorlevel 2") == []
    assert codes(" errorlevel 2, 0") == both
    assert codes(" errorlevel -305") == both[1:]
    assert codes(" errorlevel -202") == both[:1]
    assert codes(" errorlevel -202, -305, +202") == both[1:]
    assert muted_by(302) == {"asm-bank"}
    assert muted_by(999) == frozenset()


def test_routines_of_a_listing_end_at_the_next_or_at_a_gap() -> None:
    listing = assemble(
        " goto main\n org 4\n retfie\nmain call sub\nstay goto stay\nsub nop\n return\n dw 1\n org 0x20\n"
        " nop\n end",
        "t.asm",
        DEVICES[0],
    ).listing
    assert [(each.name, each.start, each.end) for each in listing.functions] == [
        ("reset", 0, 1), ("interrupt", 4, 5), ("main", 5, 7), ("sub", 7, 9)
    ]  # fmt: skip
    assert [(row.address, row.line, row.cycles) for row in listing.rows] == [
        (0, 1, "2"), (4, 3, "2"), (5, 4, "2"), (6, 5, "2"), (7, 6, "1"), (8, 7, "2"), (9, 8, ""),
        (0x20, 10, "1"),
    ]  # fmt: skip


# -- the built-in headers: names of Microchip's P16F84.INC, P16F84A.INC, P16C84.INC ------------------------


@pytest.mark.parametrize("chip", ASSEMBLED_DEVICES, ids=lambda chip: chip.short_name)
def test_the_header_of_each_chip_says_its_ram_and_fuses(chip: object) -> None:
    found = next(each for each in ASSEMBLED_DEVICES if each == chip)
    name = f"p{found.short_name.lower()}.inc"
    assert name in HEADERS
    assert header_device(name.upper()) is found
    lines = header_text(found).splitlines()
    old = found is PIC16C84
    assert "  __MAXRAM H'AF'" in lines if old else "  __MAXRAM H'CF'" in lines
    assert (
        "  __BADRAM H'07', H'30'-H'7F', H'87'" if old else "  __BADRAM H'07', H'50'-H'7F', H'87'"
    ) in lines
    values = {line.split()[0]: int(line.split("'")[1], 16) for line in lines if " EQU " in line}
    assert values["_PWRTE_ON"] == (0x3FFF if old else 0x3FF7)
    assert values["_PWRTE_OFF"] == (0x3FF7 if old else 0x3FFF)
    assert values["_CP_ON"] == (0x3FEF if old else 0x000F)
    assert values["_CONFIG1" if old else "_CONFIG"] == 0x2007
    assert [values[f"_IDLOC{number}"] for number in range(4)] == [0x2000, 0x2001, 0x2002, 0x2003]
    assert "_IDLOC4" not in values
    assert (values["_FOSC_LP"], values["_FOSC_XT"], values["_FOSC_HS"], values["_FOSC_EXTRC"]) == (
        0x3FFC, 0x3FFD, 0x3FFE, 0x3FFF
    )  # fmt: skip
    assert (values["W"], values["F"], values["_WDTE_ON"], values["_WDTE_OFF"]) == (0, 1, 0x3FFF, 0x3FFB)


def test_a_file_that_is_no_header_has_no_chip() -> None:
    assert header_device("p16f877.inc") is None
    assert assemble(" list p=16c84\n end").device == PIC16C84
    assert device("16f84a").name == "PIC16F84A"


# -- expressions ---------------------------------------------------------------------------------------------

# DS33014, "Arithmetic operators and precedence": the tightest level last.
LEVELS = (
    ("||",), ("&&",), ("&", "|", "^"), ("<", ">", "<=", ">=", "==", "!="), ("<<", ">>"), ("+", "-"),
    ("*", "/", "%"),
)  # fmt: skip
SIGNS = ("-", "+", "~", "!", "high ", "low ", "upper ")


def wrapped(value: int) -> int:
    """Return the lowest 32 bits as a signed number."""
    low = value % 2**32
    return low - 2**32 if low >= 2**31 else low


def computed(sign: str, left: int, right: int) -> int | None:
    """Return the value of an operation, as in C with 32 bits; None where there is none."""
    if sign in "/%" and right == 0:
        return None
    if sign in ("<<", ">>") and not 0 <= right < 32:
        return -1 if left < 0 else 0
    quotient = 0 if right == 0 else int(abs(left) // abs(right)) * (1 if (left < 0) == (right < 0) else -1)
    values = {
        "||": int(left != 0 or right != 0), "&&": int(left != 0 and right != 0), "&": left & right,
        "|": left | right, "^": left ^ right, "<": int(left < right), ">": int(left > right),
        "<=": int(left <= right), ">=": int(left >= right), "==": int(left == right),
        "!=": int(left != right), "+": left + right, "-": left - right, "*": left * right, "/": quotient,
        "%": left - right * quotient,
    }  # fmt: skip
    if sign == "<<":
        return wrapped(left * 2**right)
    return wrapped(left // 2**right if sign == ">>" else values[sign])


def unary(sign: str, value: int) -> int:
    low = value % 2**32
    return wrapped(
        {
            "-": -value, "+": value, "~": -value - 1, "!": int(value == 0), "high ": low // 256 % 256,
            "low ": low % 256, "upper ": low // 65536 % 256,
        }[sign]
    )  # fmt: skip


def drawn(rng: random.Random, level: int) -> tuple[str, int | None]:
    """Return an expression whose operators bind at least as tightly as a level, and its value."""
    if level == len(LEVELS) or rng.random() < 0.15:
        if rng.random() < 0.2 and level < len(LEVELS):
            text, value = drawn(rng, 0)
            return f"({text})", value
        number = rng.choice((0, 1, 2, 3, 7, 31, 32, 255, 256, 0x7FFFFFFF, rng.randrange(2**31)))
        if rng.random() < 0.3:
            sign = rng.choice(SIGNS)
            return f"{sign}{number}", unary(sign, number)
        return str(number), number
    text, value = drawn(rng, level + 1)
    while rng.random() < 0.35:
        sign = rng.choice(LEVELS[level])
        more, right = drawn(rng, level + 1)
        text = f"{text} {sign} {more}"
        value = None if value is None or right is None else computed(sign, value, right)
    return text, value


class Nothing:
    here = 0

    def value(self, name: str) -> int | None:
        return None

    def hint(self, name: str) -> str | None:
        return None


def test_random_expressions_have_the_value_of_a_second_evaluation() -> None:
    from servogen.pic.assembler.expressions import evaluate

    rng = random.Random(84)
    decided = 0
    for _ in range(600):
        text, value = drawn(rng, 0)
        if value is None or len(text) > 300:
            continue
        (instruction,) = parse_line(f" movlw {text}", Location("e.asm", 1), radix=10).instructions
        assert instruction.k is not None
        assert evaluate(instruction.k, Nothing()) == value, text
        decided += len(text) > 4
    assert decided > 250
