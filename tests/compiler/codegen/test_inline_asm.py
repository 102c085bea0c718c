"""Lines of assembly in C programs: names, numbers, labels and what is refused."""

from __future__ import annotations

from servogen.compiler.ast.nodes import Symbol
from servogen.compiler.ast.types import U8, U16
from servogen.compiler.codegen.inline_asm import assemble_line, program_label, source_label
from servogen.compiler.ir.instruction import Instruction, Reg
from servogen.errors import InputError, Location
from tests.compiler.cases import every
from tests.compiler.ir.assembly import texts

PLACE = Location("main.c", 7)


class Program:
    """A program with the variables gx, _port (at PORTB), _ram (at 0x20) and a table in flash."""

    def __init__(self) -> None:
        self.symbols = {
            "_x": Symbol("gx", U16, "global"),
            "_port": Symbol("port", U8, "fixed", address=6),
            "_ram": Symbol("ram", U8, "fixed", address=0x20),
            "_table": Symbol("table", U8, "flash"),
        }

    def shown(self, text: str) -> list[str]:
        found = assemble_line(text, PLACE, self.symbols.get, lambda name: f"f.asm.{name}")
        assert all(each.place is not None and each.place.line == PLACE.line for each in found)
        return texts(found)


@every(
    ("text", "expected"),
    [
        ("movlw 5", ["*MOVLW 5"]), ("  MOVLW 0x1F ; comment", ["*MOVLW 31"]),
        ("movlw 5 // comment", ["*MOVLW 5"]), ("movlw 5 /* comment", ["*MOVLW 5"]), ("", []),
        ("nop", ["*NOP"]), ("return", ["*RETURN"]),
        # literals of eight bits, signed or not
        ("movlw 255", ["*MOVLW 255"]), ("movlw -1", ["*MOVLW 255"]), ("movlw -128", ["*MOVLW 128"]),
        ("movlw 0b101", ["*MOVLW 5"]), ("movlw 1500/4-300", ["*MOVLW 75"]), ("movlw low(300)", ["*MOVLW 44"]),
        ("movlw high(300)", ["*MOVLW 1"]),
        # registers by name or number, the destination, bits by name or number
        ("movwf PORTB", ["*MOVWF PORTB"]), ("movwf portb", ["*MOVWF PORTB"]),
        ("movwf _PORTB", ["*MOVWF PORTB"]), ("movwf 0x86", ["*MOVWF TRISB"]),
        ("movwf OPTION", ["*MOVWF OPTION_REG"]), ("movf PORTB, w", ["*MOVF PORTB,W"]),
        ("movf PORTB, f", ["*MOVF PORTB,F"]), ("movf PORTB, 0", ["*MOVF PORTB,W"]),
        ("incf PORTB, 1", ["*INCF PORTB,F"]), ("incf PORTB", ["*INCF PORTB,F"]),
        ("bsf PORTB, 7", ["*BSF PORTB,7"]), ("bcf STATUS, RP0", ["*BCF RP0"]),
        ("btfss STATUS, Z", ["*BTFSS Z"]), ("bsf INTCON, GIE", ["*BSF INTCON,7"]),
        # variables with an offset, by their address, or without their bank
        ("movwf _x", ["*MOVWF gx"]), ("movwf _x+1", ["*MOVWF gx+1"]), ("movwf 1+_x", ["*MOVWF gx+1"]),
        ("movwf _x+3-2", ["*MOVWF gx+1"]), ("movwf _x & 0x7F", ["*MOVWF gx"]),
        ("movwf BANKMASK(_x)", ["*MOVWF gx"]), ("movwf _port", ["*MOVWF PORTB"]),
        ("movwf _ram", ["*MOVWF ram"]), ("movlw _x", ["*MOVLW gx"]),
        # labels and places relative to the instruction
        ("here: nop", ["here:", "*NOP"]), ("here:", ["here:"]), ("goto there", ["*GOTO f.asm.there"]),
        ("call there", ["*CALL f.asm.there"]), ("goto $", ["*GOTO $"]), ("goto $+2", ["*GOTO $+2"]),
        ("goto $-1", ["*GOTO $-1"]),
        # one page, and two banks
        ("banksel TRISB", ["*BSF RP0"]), ("banksel(TRISB)", ["*BSF RP0"]), ("BANKSEL PORTB", ["*BCF RP0"]),
        ("banksel _x", ["*BCF RP0"]), ("pagesel there", []), ("bankisel _x ; comment", []),
    ],
)  # fmt: skip
def test_a_line_of_assembly(text: str, expected: list[str]) -> None:
    assert [each.replace("f.asm.here", "here") for each in Program().shown(text)] == expected


@every(
    ("text", "message"),
    [
        ("movlw 256", "the literal 256 is outside 0 to 255"),
        ("movlw -129", "the literal -129 is outside 0 to 255"),
        ("movlw 100*3", "the literal 100 * 3 is 300, outside 0 to 255"),
        ("movlw lost", "'lost' is not a number from 0 to 255"),
        ("movwf lost", "'lost' is neither a register nor a variable"),
        ("movwf 256", "the register address 256 is outside 0 to 0xFF"),
        ("movwf _table", "'table' is in flash and has no RAM address"),
        ("movwf $", "'$' is neither a register nor a variable"),
        ("bsf PORTB, 8", "'8' is not a bit number from 0 to 7"),
        ("bsf PORTB, lost", "'lost' is not a bit number from 0 to 7"),
        ("movf PORTB, 2", "the destination is W or F, not '2'"),
        ("movf PORTB, x", "the destination is W or F, not 'x'"),
        ("goto 5", "'5' is not a label"),
        ("goto $*2", "is not a label"),
        ("banksel lost", "'lost' is neither a register nor a variable"),
    ],
)
def test_what_is_refused(text: str, message: str) -> None:
    try:
        Program().shown(text)
    except InputError as error:
        found = error.diagnostics[0]
        assert (
            message.replace(" is,", " is") in found.message.replace("is,", "is") or message in found.message
        )
        assert (found.code, found.location) == ("c-asm", PLACE)
    else:
        raise AssertionError(f"{text} was accepted")


def test_variables_that_assembly_names_stay_where_they_are() -> None:
    program = Program()
    program.shown("movwf _x")
    symbol = program.symbols["_x"]
    assert symbol.pinned and symbol.volatile
    for text, place in (
        ("movlw _x", (0, 0)),
        ("movlw low(_x)", (0, 0)),
        ("movlw high(_x+2)", (2, 1)),
        ("movlw low(_x+3)", (3, 0)),
    ):
        other = Program()
        (made,) = assemble_line(text, PLACE, other.symbols.get, str)
        assert isinstance(made, Instruction)
        assert (made.k.offset, made.k.part) == place  # type: ignore[union-attr]
        assert other.symbols["_x"].volatile


def test_every_address_of_both_banks_is_a_register() -> None:
    for address in (0, 0x7F, 0x80, 0xFF):
        (made,) = assemble_line(f"movwf {address}", PLACE, Program().symbols.get, str)
        assert isinstance(made, Instruction) and made.f == Reg(address)


def test_the_names_of_labels() -> None:
    assert program_label("main", "loop") == "main.asm.loop"
    assert source_label("main.asm.loop") == "loop"
    assert source_label("main.L.3") is None and source_label("main") is None
    assert source_label("__table.c@main.c:1:1.asm.x") is None
