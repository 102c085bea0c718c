"""The dialect and the chip of a program without --dialect and --device: by the headers that it includes."""

from __future__ import annotations

from pathlib import Path

import pytest

from servogen.errors import InputError
from servogen.programs import device_of, dialect_of, included_names, read_program

CASES = [
    ("#include <xc.h>\n", "xc8", None),
    ('# include "htc.h"\n', "xc8", None),
    ("#include <pic.h>\n#include <pic16f84a.h>\n", "xc8", "PIC16F84A"),
    ("#include <pic14/pic16f84.h>\n", "sdcc", "PIC16F84"),
    ("#include <pic16f84a.h>\n", "sdcc", "PIC16F84A"),
    ("#include <pic14regs.h>\n", "sdcc", None),
    ("#include <system.h>\n", "c2c", None),
    ('char text[] = "#include <xc.h>";\n', "c2c", None),
    ("", "c2c", None),
    ("#include <pic16f84.h>\n#include <builtins.h>\n", "xc8", "PIC16F84"),
    ("#include <pic16f84a.h>\n  # pragma  config FOSC = XT\n", "xc8", "PIC16F84A"),
    ("void main(void) { __delay_us(5); }\n", "xc8", None),
    ("// __delay_us(5);\n/* #pragma config FOSC = XT\n*/\n", "c2c", None),
    ("void __delay_ms(char n) { }\nvoid main(void) { __delay_ms(5); }\n", "c2c", None),
    ("#pragma DATA _CONFIG, 0x3FF1\n", "c2c", None),
]


@pytest.mark.parametrize(("text", "dialect", "chip"), CASES)
def test_a_header_says_the_dialect_and_the_chip(text: str, dialect: str, chip: str | None) -> None:
    names = included_names([("main.c", text)], lambda name, file: None)
    assert (dialect_of(names), device_of(names)) == (dialect, chip)


def test_own_headers_are_looked_through_and_circles_end(tmp_path: Path) -> None:
    (tmp_path / "board.h").write_text('#pragma once\n#include "pins.h"\n#include <pic16f84a.h>\n')
    (tmp_path / "pins.h").write_text('#pragma once\n#include "board.h"\n#include <xc.h>\n#define LED RB0\n')
    main = tmp_path / "main.c"
    main.write_text(
        '#include "board.h"\n#define _XTAL_FREQ 20000000\nvoid main(void) { TRISB0 = 0; LED = 1; }\n'
    )
    program = read_program(main)  # 20 MHz is too fast for a PIC16F84
    assert program.clock is not None
    assert program.clock.hz == 20_000_000


@pytest.mark.parametrize("clock", ["20000000", "20e6", "(20 * 1000000UL)"])
def test_a_clock_above_10_mhz_takes_the_faster_chip(tmp_path: Path, clock: str) -> None:
    main = tmp_path / "main.c"
    main.write_text(f"#include <xc.h>\n#define _XTAL_FREQ {clock}\nvoid main(void) {{ __delay_us(2); }}\n")
    program = read_program(main)
    assert program.clock is not None
    assert program.clock.hz == 20_000_000


def test_a_chip_that_is_asked_for_is_kept(tmp_path: Path) -> None:
    main = tmp_path / "main.c"
    main.write_text("#include <xc.h>\n#define _XTAL_FREQ 20000000\nvoid main(void) { }\n")
    with pytest.raises(InputError, match="too fast: PIC16F84 runs at up to 10000000 Hz"):
        read_program(main, "PIC16F84")


def test_a_clock_above_20_mhz_is_too_fast_for_every_chip(tmp_path: Path) -> None:
    main = tmp_path / "main.c"
    main.write_text("#include <xc.h>\n#define _XTAL_FREQ 20000001\nvoid main(void) { }\n")
    with pytest.raises(InputError, match="too fast: PIC16F84A runs at up to 20000000 Hz"):
        read_program(main)
