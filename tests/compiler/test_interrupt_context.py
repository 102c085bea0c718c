"""What an interrupt keeps of FSR and PCLATH: all that its assembly may change, and no more."""

import pytest

from servogen.compiler import Compilation, Options, Source, compile_sources
from servogen.simulator import Machine
from servogen.units import Clock

PROGRAM = """
#pragma CLOCK_FREQ 4000000
unsigned char list[8], i, wrong, count;
%s
void interrupt(void) { asm { %s } clear_bit(INTCON, T0IF); }
void main(void)
{
    wrong = 0; count = 0;
    set_bit(STATUS, RP0); OPTION_REG = 0x88; clear_bit(STATUS, RP0);
    INTCON = 0xA0;
    while (1) {
        for (i = 0; i < 8; i++) list[i] = i ^ count;
        for (i = 0; i < 8; i++) if (list[i] != (i ^ count)) wrong = 1;
        count++;
    }
}
"""


def made(assembly: str, more: str = "") -> Compilation:
    text = PROGRAM % (more, "\n".join(["", *assembly.split("; "), ""]))
    return compile_sources([Source(text, "context.c")], Options(dialect="c2c"))


def context(found: Compilation) -> int:
    return next(each.ram_bytes for each in found.listing.functions if each.name == "interrupt")


def test_assembly_that_leaves_fsr_and_pclath_alone_costs_two_bytes() -> None:
    assert context(made("nop")) == 2


@pytest.mark.parametrize(
    ("assembly", "more", "size"),
    [
        ("movlw 0x4F; movwf FSR", "", 3),
        ("movlw 0x4F; movwf 4; movf INDF, W", "", 3),
        ("movlw 3; movwf PCLATH", "", 3),
        ("call _other", "void other(void) { asm {\n movlw 0x4F\n movwf FSR\n } }", 4),
    ],
)
def test_what_assembly_changes_is_kept(assembly: str, more: str, size: int) -> None:
    found = made(assembly, more)
    assert context(found) == size
    machine = Machine(found.image, Clock(4_000_000))
    machine.run(200_000)
    ram = {name: machine.state().ram[address - 0x0C] for address, name, _ in found.listing.variables}
    assert ram["wrong"] == 0
    assert machine.state().interrupts > 500
