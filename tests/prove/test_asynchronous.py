"""What comes in any cycle: interrupts by INT and port B, the end of SLEEP, the end of an EEPROM write."""

from __future__ import annotations

from dataclasses import replace

import pytest

from servogen.checker import Checked, Refused, check_certificate, read_certificate
from servogen.checker.certificate import fingerprint
from servogen.pic.assembler import assemble
from servogen.pic.device import device
from servogen.pic.image import Image
from servogen.prove import Proof, Quantifiers, certificate, prove_for_all
from servogen.pulse import PulseSchedule
from servogen.units import Clock
from tests.checker import certify
from tests.prove.replay import is_wrong
from tests.prove.test_prove_inputs import schedule_of

HEAD = """
        list p=16f84
        include "p16f84.inc"
        radix dec
        __config _XT_OSC & _WDT_{watchdog} & _PWRTE_OFF
        org 0
        goto start
        org 4
{isr}
start   clrf PORTB
        clrf PCLATH
        bsf STATUS, RP0
        movlw 0xFD
        movwf TRISB
        movlw 0xC8
        movwf OPTION_REG
        bcf STATUS, RP0
        clrf INTCON
        clrf TMR0
"""
PULSE = """
        bsf PORTB, 1
        movlw 10
        movwf 0x21
wide    decfsz 0x21, f
        goto wide
        bcf PORTB, 1
"""
WIDTH = 1 + 2 + 29
WINDOW = """
        goto align
frame
{pulse}
        movf PORTB, w
        movlw {enable}
        movwf INTCON
        nop
        nop
        nop
        nop
        nop
        nop
clear   bcf INTCON, GIE
        btfsc INTCON, GIE
        goto clear
align   btfss INTCON, T0IF
        goto align
        bcf INTCON, T0IF
        movf TMR0, w
        andlw 7
{fine}
        goto frame
"""
"""A frame is 256 cycles of TMR0; after the pulse is a window for interrupts; then the frame is aligned."""
FINE = "        addwf PCL, f\n" + "        nop\n" * 8
PERIOD = 256
INT = "        bcf INTCON, INTE\n        bcf INTCON, INTF\n        retfie\n"
RB = "        bcf INTCON, RBIE\n        movf PORTB, w\n        bcf INTCON, RBIF\n        retfie\n"


def assembled(body: str, isr: str = "        retfie\n", watchdog: str = "OFF") -> Image:
    text = HEAD.format(isr=isr, watchdog=watchdog) + body + "        end\n"
    return assemble(text, "test.asm", device("PIC16F84")).image


def once() -> PulseSchedule:
    """One frame with a pulse; then nothing."""
    schedule = schedule_of(PERIOD, WIDTH)
    return replace(schedule, lead_in=schedule.loop, loop=(replace(schedule.loop[0], pulses=(None,)),))


SLOW = Clock(1_000_000)
"""A write that takes 20 ms at most takes 5000 cycles, in each of which it may end; 2000 in a PIC16F84A."""
SLOWER = Clock(250_000)
"""Here it takes 1250 cycles, and 625 typically."""


def shown(image: Image, schedule: PulseSchedule, found: Proof) -> bool:
    """Return whether there is a counterexample that a plain run repeats."""
    assert not found.proven
    assert found.counterexample is not None, found.reason
    return is_wrong(image, schedule, found.counterexample)


def accepted(proof: Proof, image: Image, schedule: PulseSchedule) -> Checked:
    """What the checker says of the certificate of a proof, with a schedule that it reads itself."""
    text = schedule.json_text().encode()
    claim = read_certificate(certificate(proof, image, schedule, text), "certificate")
    return check_certificate(claim, image, text, "schedule.json")


@pytest.mark.parametrize(("enable", "isr"), [("0x90", INT), ("0x88", RB)])
def test_an_interrupt_at_any_time_in_a_window_is_proven_if_what_follows_is_aligned(
    enable: str, isr: str
) -> None:
    schedule = schedule_of(PERIOD, WIDTH)
    body = WINDOW.format(pulse=PULSE, enable=enable, fine=FINE)
    image = assembled(body, isr)
    proof = prove_for_all(image, schedule)
    assert proof.proven, proof.reason
    accepted(proof, image, schedule)
    # an alignment that is missing, and interrupts without end
    for wrong in (
        assembled(WINDOW.format(pulse=PULSE, enable=enable, fine="        nop\n"), isr),
        assembled(body, isr.split("\n", 1)[1]),
    ):
        assert shown(wrong, schedule, prove_for_all(wrong, schedule, max_states=3000))


@pytest.mark.parametrize(("before", "proven"), [("nop", False), ("goto $+1", False), ("bsf 0x30, 0", True)])
def test_an_interrupt_may_come_between_any_two_instructions_of_a_window(before: str, proven: bool) -> None:
    """The handler hangs between two of them: after the one that clears its flag, or, where it is proven,
    nowhere. One cycle earlier or later it finds the flag set, also where that cycle is the second of a goto.
    """
    clears = "        nop\n" if proven else "        bcf 0x30, 0\n"
    window = WINDOW.format(pulse=PULSE + "        bsf 0x30, 0\n", enable="0x90", fine=FINE)
    pair = f"        {before}\n{clears}        bsf 0x30, 0\n"
    handler = "        btfss 0x30, 0\nhang    goto hang\n" + INT
    image = assembled(window.replace("        nop\n" * 3, pair, 1), handler)
    schedule = schedule_of(PERIOD, WIDTH)
    proof = prove_for_all(image, schedule)
    assert proof.proven == proven, proof.reason
    assert proven or shown(image, schedule, proof)
    if proven:
        accepted(proof, image, schedule)


SLEEPER = PULSE + "again   clrwdt\n        sleep\n        nop\n{after}        goto again\n"
AFTER_INT = "        clrf INTCON\n        bsf INTCON, INTE\n"


@pytest.mark.parametrize("watchdog", ["OFF", "ON"])
@pytest.mark.parametrize("wakes", ["", AFTER_INT])
def test_sleep_after_the_last_pulse_is_proven_whatever_ends_it(watchdog: str, wakes: str) -> None:
    image = assembled(SLEEPER.format(after=wakes), watchdog=watchdog)
    proof = prove_for_all(image, once())
    assert proof.proven, proof.reason
    accepted(proof, image, once())


@pytest.mark.parametrize(("watchdog", "wakes"), [("OFF", AFTER_INT), ("ON", "")])
def test_a_pulse_after_waking_has_a_counterexample(watchdog: str, wakes: str) -> None:
    enable = "        bsf INTCON, INTE\n" if wakes else ""
    image = assembled(enable + SLEEPER.format(after=wakes + "        bsf PORTB, 1\n"), watchdog=watchdog)
    assert shown(image, once(), prove_for_all(image, once()))


TOLD = "        btfss STATUS, NOT_TO\n        bsf PORTB, 1\n"


def test_only_what_the_watchdog_tells_by_status_is_wrong() -> None:
    """TO is 0 after its waking; an interrupt leaves it 1."""
    image = assembled("        bsf INTCON, INTE\n" + SLEEPER.format(after=TOLD + AFTER_INT))
    accepted(prove_for_all(image, once()), image, once())
    assert image.config is not None
    watched = replace(image, config=image.config | 4)
    assert shown(watched, once(), prove_for_all(watched, once()))


def test_sleep_while_pulses_are_due_or_before_the_first_has_a_counterexample() -> None:
    schedule = schedule_of(PERIOD, WIDTH)
    image = assembled(SLEEPER.format(after=""), watchdog="ON")
    assert shown(image, schedule, prove_for_all(image, schedule))
    waiting = assembled("        bsf INTCON, INTE\n        sleep\n        nop\n" + SLEEPER.format(after=""))
    assert shown(waiting, once(), prove_for_all(waiting, once()))


WRITE = """
        movlw 3
        movwf EEADR
        movlw 0x5A
        movwf EEDATA
        bsf STATUS, RP0
        bsf EECON1, WREN
        movlw 0x55
        movwf EECON2
        movlw 0xAA
        movwf EECON2
        bsf EECON1, WR
{meanwhile}
"""
POLL = "poll    btfsc EECON1, WR\n        goto poll\n        bcf STATUS, RP0\n"
ROUND = "        goto frame\n"


def written(meanwhile: str, rest: str) -> Image:
    return assembled(WRITE.format(meanwhile=meanwhile) + PULSE + rest)


@pytest.mark.campaign
def test_an_eeprom_write_before_the_first_pulse_may_take_any_time() -> None:
    image = written(POLL, "stop    goto stop\n")
    schedule = replace(once(), period=64, clock=SLOW, device="PIC16F84A")
    proof = prove_for_all(image, schedule)
    assert proof.proven, proof.reason
    assert any("an EEPROM write takes at most 8 ms" in each for each in proof.assumptions)
    accepted(proof, image, schedule)
    short = replace(schedule, period=36)
    slow = prove_for_all(image, short).counterexample
    assert slow is not None, "50 periods are shorter than the longest write"
    assert slow.message == "no pulse comes"
    assert slow.options.eeprom_us > SLOW.us(50 * short.period)


def written_later() -> tuple[Image, PulseSchedule]:
    """A write that nobody waits for: pulses go on while it is under way."""
    pulses = (
        "frame" + PULSE + "        movlw 73\n        movwf 0x21\nrest    decfsz 0x21, f\n        goto rest\n"
    )
    image = assembled(WRITE.format(meanwhile="        bcf STATUS, RP0\n") + pulses + "        goto frame\n")
    return image, schedule_of(WIDTH + 1 + 2 + 3 * 73 - 1 + 2 - 1 + 1, WIDTH)


def test_a_write_that_nobody_waits_for_is_proven() -> None:
    proof = prove_for_all(*written_later())
    assert proof.proven, proof.reason
    found = accepted(proof, *written_later())
    assert "every EEPROM write of at most 20 ms" in found.over
    assert "every content of the EEPROM" in found.over, "it is never read"


def test_a_pulse_as_long_as_a_write_has_a_counterexample() -> None:
    """With the typical duration, 10 ms and the time to notice its end, it is proven; of any it is wrong."""
    body = WRITE.format(
        meanwhile="        bcf STATUS, RP0\n        bsf PORTB, 1\n        bsf STATUS, RP0\n" + POLL
    )
    image = assembled(body + "        bcf PORTB, 1\nstop    goto stop\n")
    schedule = replace(once(), period=once().period * 50, clock=SLOWER)
    for width in range(625, 633):
        run = replace(schedule.lead_in[0], pulses=(replace(schedule.lead_in[0].pulses[0], width=width),))
        exact = replace(schedule, lead_in=(run,))
        if prove_for_all(image, exact, Quantifiers(eeprom_write=False)).proven:
            break
    else:
        pytest.fail("no width is proven")
    assert shown(image, exact, prove_for_all(image, exact))


@pytest.mark.campaign
def test_what_the_program_has_written_to_the_eeprom_is_not_known() -> None:
    image = written(
        POLL + "        bsf STATUS, RP0\n        bsf EECON1, RD\n        bcf STATUS, RP0\n",
        "stop    goto stop\n",
    )
    found = prove_for_all(image, once())
    assert not found.proven
    assert "what the program writes to the EEPROM, it reads" in found.reason


ON_WRITTEN = "        bsf STATUS, RP0\n        bcf EECON1, EEIF\n        bcf STATUS, RP0\n        retfie\n"


ON_ITS_END = WRITE.format(meanwhile="        bcf STATUS, RP0\n        movlw 0xC0\n        movwf INTCON\n")
STOPPED = "stop    goto stop\n"


def interrupted_by_a_write() -> Image:
    """A write after the last pulse, whose end interrupts."""
    return assembled(PULSE + ON_ITS_END + STOPPED, ON_WRITTEN)


@pytest.mark.campaign
def test_the_interrupt_at_the_end_of_a_write_comes_in_any_cycle() -> None:
    image = assembled(ON_ITS_END + PULSE + STOPPED, ON_WRITTEN)
    schedule = replace(once(), clock=SLOWER)
    assert shown(image, schedule, prove_for_all(image, schedule))
    late = interrupted_by_a_write()
    proof = prove_for_all(late, schedule)
    assert proof.proven, proof.reason
    accepted(proof, late, schedule)


FLAGGED = "        bsf 0x33, 0\n" + INT
GOING_ON = """
        bcf STATUS, RP0
{enable}
        bsf STATUS, RP0
        btfss EECON1, WR
        goto over
        bcf STATUS, RP0
back    bcf INTCON, GIE
        btfsc INTCON, GIE
        goto back
        goto pulse
over    bcf STATUS, RP0
        bcf INTCON, GIE
        btfsc INTCON, GIE
        goto over
        btfss 0x33, 0
hang    goto hang
pulse
"""
"""Hangs if the write is over, and no interrupt has come."""


@pytest.mark.parametrize("enable", ["0x00", "0x90"])
def test_a_write_may_be_over_also_where_an_interrupt_may_come(enable: str) -> None:
    going_on = GOING_ON.format(enable=f"        movlw {enable}\n        movwf INTCON\n")
    body = "        clrf 0x33\n" + WRITE.format(meanwhile=going_on) + PULSE + "stop    goto stop\n"
    image, schedule = assembled(body, FLAGGED), replace(once(), clock=SLOWER)
    assert shown(image, schedule, prove_for_all(image, schedule))


def sleeping_in_a_write(enable: str) -> Image:
    """Hangs if PD says that the chip has not slept."""
    sleeps = f"""
        bcf STATUS, RP0
        movlw {enable}
        movwf INTCON
        clrwdt
        sleep
        nop
        btfsc STATUS, NOT_PD
hang    goto hang
"""
    stop = "stop    clrwdt\n        goto stop\n"
    return assembled(WRITE.format(meanwhile=sleeps) + PULSE + stop, watchdog="ON")


@pytest.mark.parametrize("enable", ["0x00", "0x40"])
def test_sleep_is_a_nop_if_the_write_that_would_end_it_is_over(enable: str) -> None:
    """Without EEIE it has always slept."""
    image = sleeping_in_a_write(enable)
    schedule = replace(once(), clock=SLOWER)
    proof = prove_for_all(image, schedule)
    assert proof.proven == (enable == "0x00"), proof.reason
    assert proof.proven or shown(image, schedule, proof)
    if proof.proven:
        accepted(proof, image, schedule)


INTERRUPTS_ON = "        bsf INTCON, INTE\n        bsf INTCON, GIE\n        nop\n"
RESTS = "rests   sleep\n        nop\n"
WRITES_ON = WRITE.format(
    meanwhile=f"        bcf STATUS, RP0\n{INTERRUPTS_ON}        bsf STATUS, RP0\n"
    "        btfsc EECON1, WR\n        nop\n        bcf STATUS, RP0\n        clrf INTCON\n"
)
NEITHER_WAY = ("        nop\n", "        bsf PORTB, 1\n")
ONLY_ONCE = "        bcf INTCON, INTE\n        retfie\n"


@pytest.mark.parametrize("body", [INTERRUPTS_ON + RESTS + "{after}", WRITES_ON + "{after}" + RESTS])
def test_the_checker_follows_a_state_that_stops_for_two_reasons(body: str) -> None:
    """No interrupt comes before the instruction, and then SLEEP or the write ends in several ways."""
    text = PULSE + body + "        goto rests\n"
    good, bad = (assembled(text.format(after=after), ONLY_ONCE) for after in NEITHER_WAY)
    schedule = replace(once(), clock=SLOWER)
    proof = prove_for_all(good, schedule)
    assert proof.proven, proof.reason
    accepted(proof, good, schedule)
    plan = schedule.json_text().encode()
    forged = certify.unpack(certificate(proof, good, schedule, plan)) | {"image": fingerprint(bad)}
    with pytest.raises(Refused, match="an edge that is not expected"):
        check_certificate(read_certificate(certify.pack(forged), "forged"), bad, plan, "schedule.json")
