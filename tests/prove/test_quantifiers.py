"""Each thing that is quantified over has a switch, and a program that is wrong only because of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

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


WRITES = " movlw 0x55\n movwf EEADR\n bsf STATUS, RP0\n bsf EECON1, WR\n bcf STATUS, RP0\n"
PLAIN, WATCHED = Case(EVERYTHING), Case(EVERYTHING, watchdog="ON", clrwdt="clrwdt")
QUIET = (
    "the instruction set's table, servogen/pic/isa.py",
    "timers, ports and resets as docs/simulator.md lists them, with the data sheet's sections",
    "no servo responds to a pulse of at most 10 cycles before the first frame",
    "a reset cuts the current pulse short; after it the same holds from the first pulse on",
    "levels of inputs change between instruction cycles; the crystal is exact",
    "the EEPROM holds what the file says",
)


@pytest.mark.parametrize(
    ("case", "over", "options", "more"),
    [
        (PLAIN, EVERYTHING, {}, ()),
        (WATCHED, EVERYTHING, {}, ("no chip's watchdog is faster than 7 ms (DS35007, parameter 31)",)),
        (
            WATCHED,
            Quantifiers(watchdog=False),
            {"watchdog_us": 18_500},
            ("the watchdog's period is 18.5 ms",),
        ),
        (PLAIN, Quantifiers(watchdog=False), {}, ()),
        (Case(EVERYTHING, WRITES), EVERYTHING, {}, ("an EEPROM write takes at most 20 ms",)),
        (
            Case(EVERYTHING, WRITES),
            Quantifiers(eeprom_write=False),
            {"eeprom_write_us": 4500},
            ("an EEPROM write takes 4.5 ms",),
        ),
        (
            PLAIN,
            Quantifiers(start=(("w", 10), ("0x0C", 255))),
            {},
            ("at power-up w is 0x0A", "at power-up 0x0C is 0xFF"),
        ),
        (
            replace(PLAIN, held=(Input("RA4", 1),)),
            EVERYTHING,
            {},
            ("RA4 is held at 1, as the schedule says: it does not say what another level does",),
        ),
        (
            PLAIN,
            Quantifiers(tmr0_phase=False),
            {},
            ("TMR0 counts from the cycle after OPTION_REG is written",),
        ),
    ],
)
def test_a_proof_says_what_it_rests_on(
    case: Case, over: Quantifiers, options: dict[str, Any], more: tuple[str, ...]
) -> None:
    found = prove_for_all(case.image, case.schedule, over, SimulatorOptions(**options))
    assert found.proven and found.assumptions == (*QUIET, *more)


def test_without_resets_that_there_are_none_is_assumed() -> None:
    found = prove_for_all(PLAIN.image, PLAIN.schedule, ONCE)
    assert found.proven and found.assumptions[3] == "there is no reset after power-on"
    assert found.assumptions[:3] + found.assumptions[4:] == QUIET[:3] + QUIET[4:]


def test_a_proof_counts_its_states_and_runs() -> None:
    """A frame's state after power-up and in the loop; its runs are at least a frame long, all together."""
    found = prove_for_all(PLAIN.image, PLAIN.schedule)
    assert (found.states, len(found.cuts), found.asynchronous) == (2, 1, False)
    assert sum(node.parent >= 0 for node in found.nodes) == 2
    assert found.runs > found.states and found.cycles > PERIOD


def test_a_program_that_waits_endlessly_makes_no_pulse() -> None:
    waiting = Case(EVERYTHING, " goto bad\n")
    found = prove_for_all(waiting.image, waiting.schedule)
    assert not found.proven and found.counterexample is not None
    assert found.counterexample.message == "no pulse comes"


def test_too_few_states_are_not_enough_and_the_answer_says_where_it_stopped() -> None:
    found = prove_for_all(PLAIN.image, PLAIN.schedule, max_states=1)
    assert (found.proven, found.counterexample) == (False, None)
    assert found.reason == "more than 1 states (address 0x000, 2 states seen, 1 open)"
