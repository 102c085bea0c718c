"""Each thing that is quantified over has a switch, and a program that is wrong only because of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest

from servogen.errors import InputError
from servogen.pic.assembler import assemble
from servogen.pic.device import device
from servogen.pic.image import Image
from servogen.prove import Quantifiers, certificate, prove_for_all
from servogen.prove.quantifiers import EVERYTHING
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import Input
from servogen.simulator import SimulatorOptions
from tests.prove.replay import is_wrong
from tests.prove.test_prove_inputs import schedule_of

PROGRAM = """
        list p=16f84
        include "p16f84.inc"
        radix dec
        __config _XT_OSC & _WDT_{watchdog} & _PWRTE_OFF
        org 0
{first}
        {clear}
        bsf STATUS, RP0
        movlw {tris}
        movwf TRISB
        movlw 0x88
        movwf OPTION_REG
        bcf STATUS, RP0
{test}
frame   bsf PORTB, 1
        movlw 100
        movwf 0x21
wide    decfsz 0x21, f
        goto wide
        bcf PORTB, 1
        movlw 250
        movwf 0x22
rest    movlw {rest}
        movwf 0x21
inner   decfsz 0x21, f
        goto inner
        decfsz 0x22, f
        goto rest
        {clrwdt}
        goto frame
bad     goto bad
        end
"""
WIDTH, PERIOD = 302, 1 + 2 + 299 + 1 + 2 + 250 * (3 * 2 + 4) - 1 + 1 + 2
"""The inner loop of n turns takes 3 n + 1 cycles with its MOVLW and MOVWF; one outer turn 3 n + 4."""


@dataclass(frozen=True)
class Case:
    """A program that is wrong unless `off` is switched off."""

    off: Quantifiers
    test: str = ""
    first: str = ""
    clear: str = "clrf PORTB"
    tris: str = "0xFD"
    rest: int = 2
    period: int = PERIOD
    watchdog: str = "OFF"
    clrwdt: str = "nop"
    held: tuple[Input, ...] = ()
    on: Quantifiers = EVERYTHING
    """What is quantified over when the fault is found."""

    @property
    def image(self) -> Image:
        text = PROGRAM.format(
            first=self.first,
            test=self.test,
            clear=self.clear,
            tris=self.tris,
            rest=self.rest,
            watchdog=self.watchdog,
            clrwdt=self.clrwdt,
        )
        return assemble(text, "test.asm", device("PIC16F84")).image

    @property
    def schedule(self) -> PulseSchedule:
        return replace(schedule_of(self.period, WIDTH), inputs=self.held)


def start(**values: int) -> tuple[tuple[str, int], ...]:
    return tuple((name.replace("_", "-"), value) for name, value in values.items())


RA4 = (Input("RA4", 0),)
ONCE = Quantifiers(resets=False)
CASES = {
    "ram": Case(Quantifiers(start=start(ram=0)), " btfsc 0x30, 3\n goto bad\n"),
    "a byte of ram": Case(
        Quantifiers(start=(("0x30", 0),)),
        " movf 0x30, w\n xorlw 0x5A\n btfsc STATUS, Z\n goto bad\n",
    ),
    "w": Case(replace(ONCE, start=start(w=0)), " btfsc 0x22, 5\n goto bad\n", first=" movwf 0x22\n", on=ONCE),
    "fsr": Case(replace(ONCE, start=start(fsr=0)), " btfsc FSR, 2\n goto bad\n", on=ONCE),
    "flags": Case(replace(ONCE, start=start(flags=0)), first=" btfsc STATUS, C\n goto bad\n", on=ONCE),
    "tmr0": Case(
        replace(ONCE, start=start(tmr0=0)),
        " movf TMR0, w\n andlw 0xF0\n xorlw 0x40\n btfsc STATUS, Z\n goto bad\n",
        held=RA4,
        on=ONCE,
    ),
    "latches": Case(replace(ONCE, start=start(latches=0)), clear="nop", tris="0xF9", on=ONCE),
    "rbif": Case(
        replace(ONCE, start=start(rbif=0, rb_old=0)),
        " btfsc INTCON, RBIF\n goto bad\n",
        held=tuple(Input(f"RB{n}", 0) for n in range(4, 8)),
        on=ONCE,
    ),
    "resets": Case(
        replace(ONCE, start=start(ram=0)),
        " incf 0x30, f\n btfsc 0x30, 1\n goto bad\n",
        on=Quantifiers(start=start(ram=0)),
    ),
    "watchdog": Case(
        Quantifiers(watchdog=False),
        rest=13,
        period=PERIOD + 250 * 3 * 11,
        watchdog="ON",
        clrwdt="clrwdt",
    ),
    "tmr0 phase": Case(
        Quantifiers(tmr0_phase=False),
        " nop\n movf TMR0, w\n xorlw 2\n btfss STATUS, Z\n goto bad\n",
        first=" clrf TMR0\n",
        held=RA4,
    ),
}


@pytest.mark.parametrize("name", list(CASES))
def test_a_program_that_is_wrong_only_because_of_one_thing(name: str) -> None:
    case = CASES[name]
    without = prove_for_all(case.image, case.schedule, case.off)
    assert without.proven, without.counterexample or without.reason
    found = prove_for_all(case.image, case.schedule, case.on)
    assert found.counterexample is not None, found.reason or "proven"
    assert is_wrong(case.image, case.schedule, found.counterexample)
    assert set(without.assumptions) - set(found.assumptions), "what is switched off is an assumption"


def test_a_counterexample_keeps_to_what_was_switched_off() -> None:
    case = CASES["w"]
    over = Quantifiers(start=start(ram=7), resets=False)
    found = prove_for_all(case.image, case.schedule, over).counterexample
    assert found is not None
    assert ("ram", 7) in found.options.start
    assert found.reset is None


def test_after_a_reset_only_bytes_that_are_never_written_are_what_they_were() -> None:
    known = Quantifiers(start=start(ram=0))
    test = " btfsc 0x30, 0\n goto bad\n"
    assert prove_for_all(Case(known, test).image, Case(known).schedule, known).proven
    later = Case(known, test + " bsf 0x30, 0\n")
    found = prove_for_all(later.image, later.schedule, known).counterexample
    assert found is not None
    assert found.reset is not None
    assert "[[reset]]" in found.stimulus(later.schedule.clock)
    assert is_wrong(later.image, later.schedule, found)


def test_only_a_proof_over_every_start_reset_and_chip_has_a_certificate() -> None:
    case = Case(Quantifiers())
    text = case.schedule.json_text().encode()
    assert certificate(prove_for_all(case.image, case.schedule), case.image, case.schedule, text)
    for over in (
        ONCE,
        Quantifiers(watchdog=False),
        Quantifiers(start=start(w=0)),
        Quantifiers(tmr0_phase=False),
    ):
        proof = prove_for_all(case.image, case.schedule, over)
        assert proof.proven
        with pytest.raises(ValueError, match="only a proof over every"):
            certificate(proof, case.image, case.schedule, text)


@pytest.mark.parametrize(("name", "value"), [("ram", 256), ("flags", 8), ("acc", 1), ("0x50", 0)])
def test_a_start_value_that_no_chip_has_is_refused(name: str, value: int) -> None:
    with pytest.raises(InputError, match=name):
        SimulatorOptions(start=((name, value),))
