"""Shapes in which gpasm surprises: ELIF, and sources for the PIC16C84.

The expected words are gpasm 1.4.0's. Where gpasm is installed, a test asks it again.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from servogen.errors import InputError
from servogen.pic.assembler import assemble
from servogen.pic.device import PIC16C84, device
from servogen.pic.image import Image, from_hex
from tests.cli.conftest import Run, run  # noqa: F401 - a fixture
from tests.pic.conftest import MPASM

ELSE_IF: dict[str, tuple[str, list[int] | None]] = {
    # body, and its words; None: an error
    "in lines left out it is left out": (
        " if 0\n movlw 1\n elif 1\n movlw 5\n else\n movlw 6\n endif",
        [0x3006],
    ),
    "without else nothing is left": (" if 0\n movlw 1\n elif 1\n movlw 5\n endif\n movlw 9", [0x3009]),
    "whatever it asks": (" if 0\n nop\n elif 0\n movlw 5\n else\n movlw 6\n endif", [0x3006]),
    "several": (" if 0\n nop\n elif 1\n movlw 5\n elif 1\n movlw 7\n else\n movlw 6\n endif", [0x3006]),
    "elifdef": ("#define X\n if 0\n nop\n elifdef X\n movlw 5\n else\n movlw 6\n endif", [0x3006]),
    "elifndef": (" if 0\n nop\n elifndef X\n movlw 5\n else\n movlw 6\n endif", [0x3006]),
    "within another if": (" if 1\n if 0\n nop\n elif 1\n movlw 5\n endif\n movlw 9\n endif", [0x3009]),
    "within lines left out": (" if 0\n if 0\n nop\n elif 1\n movlw 5\n endif\n movlw 9\n endif\n nop", [0]),
    "in lines that count": (" if 1\n movlw 1\n elif 1\n movlw 5\n else\n movlw 6\n endif", None),
    "in lines that count, unknown name": (" if 1\n movlw 1\n elif later\n movlw 5\n endif", None),
    "elifdef in lines that count": (" if 1\n movlw 1\n elifdef X\n movlw 5\n endif", None),
    "after else": (" if 0\n else\n movlw 1\n elif 1\n movlw 2\n endif", None),
    "without if": (" elif 1\n movlw 1", None),
    "a macro may be called so": ("elif macro a\n movlw a\n endm\n if 1\n elif 7\n endif", [0x3007]),
    "a variable may be called so": ("elif set 5\n if 0\nelif set 3\n endif\n movlw elif", [0x3005]),
}

OLD_CHIP = """
        list p=16c84
        include <p16c84.inc>
        errorlevel -302
        __config _XT_OSC & _WDT_OFF & _PWRTE_OFF & _CP_OFF
        ifdef __16C84
        movlw   5
        endif
        clrf    0x2f
        bsf     EECON1, RD
        retlw   low(_PWRTE_ON)
        retlw   low(_CP_ON)
        org     0x2100
        de      7
        end
"""
OLD_CHIP_IMAGE = Image({0: 0x3005, 1: 0x01AF, 2: 0x1408, 3: 0x34FF, 4: 0x34EF}, config=0x3FF1, eeprom={0: 7})


def source(body: str) -> str:
    return f" list p=16f84\n{body}\n end\n"


def by_gpasm(text: str, folder: Path) -> Image | None:
    """Return what gpasm makes of a source, None where it refuses it."""
    (folder / "t.asm").write_text(text)
    done = subprocess.run(["gpasm", "-q", "t.asm"], cwd=folder, capture_output=True, timeout=60)
    return None if done.returncode else from_hex((folder / "t.hex").read_text())


needs_gpasm = pytest.mark.skipif(shutil.which("gpasm") is None, reason="gpasm is not installed")


@pytest.mark.parametrize("name", ELSE_IF)
def test_elif_is_what_it_is_in_gpasm(name: str) -> None:
    body, words = ELSE_IF[name]
    if words is not None:
        assert list(assemble(source(body)).image.program.values()) == words
        return
    with pytest.raises(InputError) as caught:
        assemble(source(body))
    assert "unknown operation 'elif" in caught.value.diagnostics[0].message
    assert "ELSE and ENDIF" in (caught.value.diagnostics[0].hint or "")


@needs_gpasm
@pytest.mark.parametrize("name", ELSE_IF)
def test_gpasm_has_elif_so(name: str, tmp_path: Path) -> None:
    body, words = ELSE_IF[name]
    found = by_gpasm(source(body), tmp_path)
    assert (None if found is None else list(found.program.values())) == words


def test_an_elif_that_is_left_out_is_warned_of_once_at_the_if_that_it_looks_like_a_part_of() -> None:
    def remarks(name: str) -> list[tuple[int | None, int]]:
        return [
            (each.location.line, MPASM[each.code]) for each in assemble(source(ELSE_IF[name][0])).warnings
        ]

    assert remarks("in lines left out it is left out") == [(4, 122)]
    assert remarks("several") == [(4, 122), (6, 122)]
    assert remarks("within another if") == [(5, 122)]
    assert remarks("within lines left out") == []
    assert remarks("a variable may be called so") == []


def test_a_source_for_the_16c84_has_its_own_include_memory_and_fuses() -> None:
    made = assemble(OLD_CHIP)
    assert (made.image, made.device, made.warnings) == (OLD_CHIP_IMAGE, PIC16C84, ())


def test_beyond_its_36_bytes_of_ram_there_is_no_register() -> None:
    text = OLD_CHIP.replace("0x2f", "0x30")
    assert [each.code for each in assemble(text).warnings] == ["asm-no-register"]
    assert assemble(text.replace("16c84", "16f84")).warnings == ()


def test_its_include_file_alone_names_the_chip() -> None:
    assert assemble(" include <P16C84.INC>\n end\n").device == PIC16C84


def test_config_is_refused_as_gpasm_refuses_it() -> None:
    with pytest.raises(InputError) as caught:
        assemble(" list p=16c84\n config FOSC=XT\n end\n")
    (error,) = caught.value.diagnostics
    assert (error.code, error.location.line) == ("asm-config", 2)
    assert "__config" in (error.hint or "")


@needs_gpasm
def test_gpasm_makes_the_same_of_a_source_for_the_16c84(tmp_path: Path) -> None:
    assert by_gpasm(OLD_CHIP, tmp_path) == OLD_CHIP_IMAGE
    assert by_gpasm(" list p=16c84\n config FOSC=XT\n end\n", tmp_path) is None


@needs_gpasm
def test_every_name_of_gpasms_include_file_has_its_value_here() -> None:
    installed = Path("/usr/share/gputils/header/p16c84.inc")
    if not installed.is_file():
        pytest.skip("gputils' include files are not where Debian has them")
    names = re.findall(r"^(\w+)\s+EQU\s+H'([0-9A-F]+)'", installed.read_text(), re.MULTILINE)
    assert len(names) > 50
    rows = "".join(f' if {name} != 0x{value}\n error "{name}"\n endif\n' for name, value in names)
    assemble(f" list p=16c84\n include <p16c84.inc>\n{rows} end\n")


def test_the_16c84_is_for_the_assembler_only(run: Run, tmp_path: Path) -> None:  # noqa: F811
    program = tmp_path / "old.asm"
    program.write_text(OLD_CHIP)
    assert run("assemble", program).code == 0
    assert run("assemble", program, "--device", "PIC16C84").code == 0
    ran = run("simulate", program, "--device", "PIC16C84")
    assert ran.code == 2
    assert "unknown device 'PIC16C84'" in ran.err
    assert device("16F84").ram_last == 0x4F
