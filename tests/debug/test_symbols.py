"""Variables, routines and lines by name."""

from __future__ import annotations

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.debug.symbols import Variable, current_line, line_at, routine, variable
from servogen.debug.time_machine import TimeMachine
from servogen.errors import InputError
from servogen.pic.device import device
from servogen.units import Clock

C = """\
#pragma CLOCK_FREQ 4000000
long total;
void main(void)
{
    total = -2;
    while (1) {
        total = total - 256;
        delay_ms(5);
    }
}
"""
DONE = compile_sources([Source(C, "sum.c")], Options(dialect="c2c", device=device("PIC16F84")))


def test_a_variable_is_all_of_its_bytes_the_lowest_first() -> None:
    total = variable("total", DONE.listing)
    assert total.size == 2
    ram = bytearray(68)
    ram[total.address - 0x0C : total.address - 0x0C + 2] = b"\xfe\xff"
    assert total.number(bytes(ram)) == 0xFFFE
    assert total.number(bytes(ram), signed=True) == -2


def test_an_address_names_a_byte_of_ram() -> None:
    assert variable("0x4F", None) == Variable(0x4F, 1)
    with pytest.raises(InputError, match="0x50 is not in RAM"):
        variable("0x50", None)


def test_an_unknown_name_says_which_are_known() -> None:
    with pytest.raises(InputError, match="did you mean 'total'"):
        variable("totl", DONE.listing)
    with pytest.raises(InputError, match="this program has no names"):
        variable("total", None)
    with pytest.raises(InputError, match="did you mean 'main'"):
        routine("man", DONE.listing)
    with pytest.raises(InputError, match="this program has no names"):
        routine("main", None)


def test_the_line_that_runs_is_the_one_that_called_the_compilers_routine() -> None:
    """Most of the time passes in the delay, whose instructions belong to line 8 or to a routine it calls."""
    chip = TimeMachine(DONE.image, Clock(4_000_000), listing=DONE.listing)
    assert line_at(chip, chip.machine.pc) is None  # the start-up code has no line
    chip.seek(3000)
    found = current_line(chip)
    assert found is not None and str(found) == "sum.c:8: delay_ms(5);"
