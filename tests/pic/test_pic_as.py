"""Sources for pic-as: the words are those of an MPASM source that says the same."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from servogen.cli.app import app
from servogen.errors import InputError
from servogen.pic.assembler.assembly import AssemblySource, assemble, link
from servogen.pic.image import from_hex

PIC_AS = """\
        PROCESSOR 16F84A
        PAGEWIDTH 132
#include <xc.inc>
        CONFIG FOSC = XT, WDTE = OFF    // the others stay erased
        config "CP" = OFF
#define TURNS 3
skpnz   MACRO                           /* a macro may have the name
        btfsc   STATUS, STATUS_Z_POSITION  of a special mnemonic */
        btfsc   STATUS, STATUS_Z_POSITION
        ENDM
        PSECT   udata
flags:
        ds      1
time:   DS      2
        PSECT   reset, class = CODE, delta = 2, abs
        ORG     0
        goto    main
        ORG     4
isr:    btfss   INTF
        retfie
        bcf     INTCON, INTCON_INTF_MASK shr 1
        retfie
        PSECT   code
main:   BANKSEL TRISB
        clrf    BANKMASK(TRISB)
        bcf     STATUS, 5
        movlw   10
        movlw   0FFh and (TURNS or 4)
        movlw   01010101B
        movwf   time + 1
        rrf     flags
        skpnz
        goto    $ - 1
        movlw   low(main)
        PSECT   edata
        db      1, 'A'
        END     isr
"""
MPASM = """\
        list p=16f84a, r=dec
        include <p16f84a.inc>
        __config _XT_OSC & _WDT_OFF
        org 0
        goto main
        org 4
        btfss INTCON, INTF
        retfie
        bcf INTCON, 1
        retfie
        org 0x3F5
main    bsf STATUS, RP0
        clrf TRISB
        bcf STATUS, RP0
        movlw 10
        movlw 7
        movlw 0x55
        movwf 0x0E
        rrf 0x0C, f
        btfsc STATUS, Z
        goto $ - 1
        movlw low(main)
        org 0x2100
        de 1, "A"
        end
"""


def test_the_words_are_those_of_the_same_program_for_mpasm() -> None:
    """`code` has eleven words, and lies at the end of the memory."""
    ours = assemble(PIC_AS)
    assert ours.image == assemble(MPASM).image
    assert ours.listing.variables == ((0x0C, "flags", 1), (0x0D, "time", 2))
    assert [each.code for each in ours.warnings] == ["asm-no-destination"]


REPEATED = """\
#include <xc.inc>
#define TURNS 2
        PSECT   code, abs
twice   MACRO   what
        REPT    TURNS
        LOCAL   on
        irp     file, 0x0C, 0x0D
        what    file, f
        ENDM
        goto    on
on:
        ENDM
        ENDM
        twice   incf
        IRPC    sign, A 1
        if      'sign' <> ' '
        addlw   'sign'
        endif
        ENDM
        IRPC    digit, 17
        movlw   0&digit&h & 0Fh
        ENDM
        REPT    0
        nop
        ENDM
"""
BY_HAND = """\
        list p=16f84a
        incf 0x0C, f
        incf 0x0D, f
        goto $ + 1
        incf 0x0C, f
        incf 0x0D, f
        goto $ + 1
        addlw 'A'
        addlw '1'
        movlw 1
        movlw 7
        end
"""


def test_rept_irp_and_irpc_are_their_lines_written_again_with_labels_of_their_own() -> None:
    assert assemble(REPEATED).image == assemble(BY_HAND).image


@pytest.mark.parametrize(("case", "word"), [(1, 0x3001), (2, 0x3002), (3, 0x3003), (4, 0x3004)])
def test_of_if_elsif_and_else_the_first_that_holds_is_assembled(case: int, word: int) -> None:
    lines = ("if KIND == 1", "elsif KIND le 2 and KIND ge 2", "ELSIF KIND < 4", "else")
    body = "".join(f" {line}\n movlw {number}\n" for number, line in enumerate(lines, 1))
    head = f"#include <xc.inc>\n#define KIND {case}\n psect code,abs\n"
    nested = " if 0\n if 1\n nop\n elsif 1\n nop\n endif\n elsif 0\n nop\n endif\n"
    assert assemble(f"{head}{body} endif\n{nested} end\n").image.program == {0: word}
    with pytest.raises(InputError, match=r"ELSIF without IF, or behind ELSE"):
        assemble(f"{head}{body} ELSIF 1\n endif\n end\n")


def test_what_repeats_without_end_or_lines_is_refused_and_an_error_says_in_which_turn() -> None:
    head = "#include <xc.inc>\n psect code,abs\n"
    for text, said in (
        (" rept 8000\n rept 8000\n rept 8000\n endm\n endm\n endm\n", "a macro, a WHILE"),
        (" IRP x, 1\n nop\n endm\n", r"unknown operation 'STATUS'[^']+'IRP' is defined as 'STATUS, 7'"),
        (" S x\n", r"unknown operation 'S' .asm-unknown-operation.(?![^$]*IRP)"),
        (" rept -1\n nop\n endm\n", "REPT of -1 turns"),
        (" irp 7, a, b\n nop\n endm\n", "'7' is not a name"),
        (" rept 2\n nop\n", "REPT without ENDM"),
        (" irp x, 12, y\n movlw x\n endm\n", "with 'y' for 'x' of irp at source.asm:3"),
    ):
        with pytest.raises(InputError, match=said):
            assemble(f"{head}{text} end\n")


def test_an_error_has_its_line_and_column_below_comments_of_c() -> None:
    with pytest.raises(InputError) as refused:
        assemble(PIC_AS.replace("movlw   10\n", "movlw   ten\n"))
    (error,) = refused.value.diagnostics
    assert error.location is not None
    assert (error.location.line, error.location.column) == (27, 17)
    assert PIC_AS.splitlines()[26] == "        movlw   10"


@pytest.mark.parametrize("text", ["/* " * 300_000, '"' + '\\"' * 300_000])
def test_what_is_never_closed_is_read_once(text: str) -> None:
    """Reading on to the end from each of its beginnings would take hours."""
    with pytest.raises(InputError, match="more than 2000 characters"):
        assemble(f"#include <xc.inc>\n psect code\n nop {text}\n")


def test_a_global_name_may_be_defined_in_another_source() -> None:
    head = "#include <xc.inc>\n global step, count\n"
    main = head + " psect reset,class=CODE,delta=2,abs\n call step\n movwf count\n end\n"
    step = head + " psect udata\ncount: ds 1\n psect code\nstep: return\n end\n"
    words = link([AssemblySource(main), AssemblySource(step)]).image.program
    assert words == {0: 0x23FF, 1: 0x008C, 0x3FF: 0x0008}
    with pytest.raises(InputError, match="not previously defined: 'count'"):
        link([AssemblySource(main.replace("count\n psect", "other\n psect")), AssemblySource(step)])


def test_a_section_whose_org_goes_back_keeps_what_is_behind_it() -> None:
    """Five bytes, then three: of 0x0C to 0x10 the last has a name, and 0x11 is free."""
    made = assemble(
        "#include <xc.inc>\n psect udata\n org 4\nlast: ds 1\n org 0\nfirst: ds 1\n"
        " psect more,class=RAM,space=1\nother: ds 3\n psect code\n nop\n"
    )
    assert made.listing.variables == ((0x0C, "first", 1), (0x10, "last", 1), (0x11, "other", 3))


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("psect mine", "has no class"),
        ("psect mine,class=CODES,delta=2", "did you mean 'CODE'"),
        ("psect mine,class=CODE", "delta=2"),
        ("psect mine,klass=CODE", "did you mean 'class'"),
        ("nop", "no section is open"),
        ("org 4", "stands in no section"),
        ("idata\n org 4", "ORG stands in IDATA"),
        ("psect code\n org 0x7FFFFFFF", "0 to 8704 words"),
        ("bcf STATUS, RP0", "at most 2"),
    ],
)
def test_what_the_linker_could_not_place_is_refused(line: str, problem: str) -> None:
    """RP0 is a register and a bit, so that the last has three operands."""
    with pytest.raises(InputError) as refused:
        assemble(f"#include <xc.inc>\n {line}\n psect code\n {line}\n")
    assert any(problem in f"{each.message} {each.hint}" for each in refused.value.diagnostics)


def test_a_section_goes_where_the_command_says(tmp_path: Path) -> None:
    source = tmp_path / "it.s"
    source.write_text(
        "#include <xc.inc>\n psect go,class=CODE,delta=2\n nop\n psect isr,class=CODE,delta=2\n retfie\n"
    )
    arguments = ["assemble", str(source), "--place", "go=0", "--place", "isr=4h"]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    words = from_hex((tmp_path / "it.hex").read_text(), "it.hex").program
    assert words == {0: 0x0000, 4: 0x0009}
    for wrong in ("run=4h", "isr", "isr=4k"):
        done = CliRunner().invoke(app, ["assemble", str(source), "--place", wrong])
        assert isinstance(done.exception, InputError) and wrong.partition("=")[0] in str(done.exception)


def test_an_error_is_said_rather_than_that_its_section_is_missing(tmp_path: Path) -> None:
    source = tmp_path / "it.s"
    source.write_text("#include <xc.inc>\n psetc go,class=CODE,delta=2\n nop\n")
    done = CliRunner().invoke(app, ["assemble", str(source), "--place", "go=0"])
    assert isinstance(done.exception, InputError) and "unknown operation 'psetc'" in str(done.exception)
