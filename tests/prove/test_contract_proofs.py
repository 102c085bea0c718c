"""Contracts proven for every input and power-up: bounds that are exact to the cycle, and what breaks them.

The latencies are counted by hand from the instructions: BTFSC takes 1 cycle, or 2 where it skips; GOTO 2.
"""

from __future__ import annotations

import pytest

from servogen.contract import judge_contract, parse_contract
from servogen.edges import PINS
from servogen.pic.assembler import assemble
from servogen.pic.image import Image
from servogen.prove.contract import ContractProof, prove_contract
from servogen.prove.quantifiers import Quantifiers
from servogen.simulator import EEPROM24, Levels, SimulatorOptions, Stimuli, on_pins
from servogen.simulator.pin_levels import pin_trace
from servogen.units import Clock, Cycles

CLOCK = Clock(4_000_000)
HEADER = """
        list p=16f84
        include <p16f84.inc>
        __config _XT_OSC & _WDT_OFF & _PWRTE_ON & _CP_OFF
"""


def image(body: str, watchdog: str = "_WDT_OFF") -> Image:
    return assemble(HEADER.replace("_WDT_OFF", watchdog) + body + "\n        end\n", "test.asm").image


def proof(program: Image, contract: str, over: Quantifiers = Quantifiers()) -> ContractProof:  # noqa: B008
    return prove_contract(program, parse_contract(contract, "c.toml").clauses(CLOCK), CLOCK, over)


def replayed(program: Image, contract: str, found: ContractProof) -> str:
    """What one run of the plain simulator shows with the counterexample's inputs."""
    shown = found.counterexample
    assert shown is not None
    levels = [Levels(PINS.index(pin), changes) for pin, changes in shown.levels]
    cycles = Cycles(shown.cycle + 100)
    trace = pin_trace(program, CLOCK, cycles, shown.options, Stimuli(levels) if levels else None)
    verdict = judge_contract(parse_contract(contract, "c.toml").clauses(CLOCK), trace, from_reset=True)
    return next(verdict.lines())


ANSWER = """
        bsf     STATUS, RP0
        movlw   0xEF
        movwf   TRISB
        bcf     STATUS, RP0
        bcf     PORTB, 4
poll    btfsc   PORTB, 0
        goto    poll
        {delay}
        bsf     PORTB, 4
held    btfss   PORTB, 0
        goto    held
        bcf     PORTB, 4
        goto    poll
"""
"""BSF comes 2 cycles after the read that sees RB0 low: the least answer is to a fall in that read's own
cycle. The reads of RB0 lie 3 cycles apart, and 5 from the last of `held` to the first of `poll`: the latest
answer is to a fall in the cycle after that one, 4 + 2 cycles."""


def answer(least: int, most: int) -> str:
    return f'[[response]]\nwhen = "RB0 falls"\nthen = "RB4 rises"\nwithin_us = [{least}, {most}]\n'


def test_a_latency_is_proven_to_the_cycle() -> None:
    program = image(ANSWER.format(delay=""))
    found = proof(program, answer(2, 6))
    assert found.proven, found.reason
    read = "until it was read, other than to write its port; the level of the first read is no cause"
    assert f"RB0 keeps each level {read}" in found.assumptions
    assert "nothing but the program drives RB4" in found.assumptions


@pytest.mark.parametrize(
    ("least", "most", "delay"),
    [(2, 5, ""), (3, 6, ""), (2, 6, "nop")],
    ids=["one cycle less", "one cycle more", "one instruction more"],
)
def test_one_cycle_beside_it_is_a_run_that_can_be_repeated(least: int, most: int, delay: str) -> None:
    program = image(ANSWER.format(delay=delay))
    found = proof(program, answer(least, most), Quantifiers(resets=False))
    assert not found.proven
    assert replayed(program, answer(least, most), found).startswith("violated")


def test_the_level_of_the_first_read_is_no_cause_and_it_is_said() -> None:
    """The judge sees an input rise a cycle after power-up, and none that is high from then on."""
    begins_low = ANSWER.replace("poll ", "        goto    held\npoll ", 1).format(delay="")
    program = image(begins_low.replace("btfsc", "btf").replace("btfss", "btfsc").replace("btf ", "btfss "))
    contract = answer(2, 6).replace("falls", "rises")
    found = proof(program, contract)
    assert found.proven and any("the first read is no cause" in each for each in found.assumptions)
    clauses = parse_contract(contract, "c.toml").clauses(CLOCK)
    for cycle in (0, 1):
        high = Stimuli([Levels(PINS.index("RB0"), [(cycle, 1)])])
        trace = pin_trace(program, CLOCK, Cycles(100), SimulatorOptions(), high)
        assert judge_contract(clauses, trace, from_reset=True).violated == (cycle == 1)


UNASKED = """
        bsf     STATUS, RP0
        movlw   0xEF
        movwf   TRISB
        bcf     STATUS, RP0
        clrf    PORTB
loop    bsf     PORTB, 4
        nop
        bcf     PORTB, 4
        {read}
        nop
        movlw   .200
        movwf   0x20
wait    decfsz  0x20, f
        goto    wait
        goto    loop
"""
"""RB4 rises in cycle 6 and every 5 + 1 + 1 + 599 + 2 cycles, whatever is read: also if RB0 just fell."""


@pytest.mark.parametrize(
    ("read", "within"), [("btfss   PORTB, 0", "5, 2000"), ("btfss   PORTB, 0", "5"), ("nop", "5")]
)
def test_a_cause_may_have_come_just_before_an_answer_that_is_made_before_the_next_read(
    read: str, within: str
) -> None:
    program = image(UNASKED.format(read=read))
    contract = f'[[response]]\nwhen = "RB0 falls"\nthen = "RB4 rises"\nwithin_us = [{within}]\n'
    rise = 6 + 608  # of the second turn
    fall = Stimuli([Levels(PINS.index("RB0"), [(0, 1), (rise - 2, 0)])])
    trace = pin_trace(program, CLOCK, Cycles(1000), SimulatorOptions(), fall)
    clauses = parse_contract(contract, "c.toml").clauses(CLOCK)
    assert judge_contract(clauses, trace, from_reset=True).violated
    found = proof(program, contract, Quantifiers(True, False, False, False, False))
    assert not found.proven and "'RB0 falls' may have come just before it" in found.reason


BRIDGE = """
        bsf     STATUS, RP0
        clrf    TRISB
        bcf     STATUS, RP0
        clrf    PORTB
loop    movlw   {first}
        btfsc   PORTA, 0
        movlw   {second}
        movwf   PORTB
        {between}
        goto    loop
"""
NEVER = '[[never]]\ncondition = "RB1 high and RB2 high"\n'


def test_a_bridge_that_an_input_shorts_is_found_and_one_that_it_cannot_is_proven() -> None:
    assert proof(image(BRIDGE.format(first=2, second=4, between="")), NEVER).proven
    shorted = image(BRIDGE.format(first=2, second=6, between=""))
    found = proof(shorted, NEVER)
    assert found.counterexample is not None and "RB1 high and RB2 high" in found.counterexample.message


WAVE = """
        bsf     STATUS, RP0
        clrf    TRISB
        bcf     STATUS, RP0
        clrf    PORTB
loop    bsf     PORTB, 3
        movlw   .{turns}
        movwf   0x20
up      decfsz  0x20, f
        goto    up
        bcf     PORTB, 3
        movlw   .100
        movwf   0x20
down    decfsz  0x20, f
        goto    down
        goto    loop
"""
"""High: 1 + 1 + 3 * turns - 1 + 1 cycles; low: 1 + 1 + 3 * 100 - 1 + 2 + 1."""
PULSE = '[[pulse]]\npin = "RB3"\nhigh_us = [32, 32]\nperiod_us = [336, 336]\n'


def test_a_wave_is_proven_and_one_turn_more_is_not() -> None:
    assert proof(image(WAVE.format(turns=10)), PULSE).proven
    found = proof(image(WAVE.format(turns=11)), PULSE)
    assert found.counterexample is not None
    assert "is high for more than 32 cycles" in found.counterexample.message


TICK = """
        goto    main
        org     4
        movlw   .{reload}
        addwf   TMR0, f
        bcf     INTCON, T0IF
        movlw   1
        xorwf   PORTB, f
        retfie
main    clrf    PORTB
        bsf     STATUS, RP0
        clrf    TRISB
        movlw   0x88
        movwf   OPTION_REG
        bcf     STATUS, RP0
        movlw   0xA0
        movwf   INTCON
        goto    $
"""
"""TMR0 has no value at the start, and stands still for 2 cycles and the write after each ADDWF: a period of
256 - reload + 3 cycles, give or take the cycle by which GOTO delays the interrupt."""


def test_a_timer_that_begins_anywhere_is_told_apart_where_it_interrupts() -> None:
    ticks = '[[pulse]]\npin = "RB0"\nhigh_us = [249, 251]\nperiod_us = [498, 502]\n'
    assert proof(image(TICK.format(reload=9)), ticks).proven
    later = image(TICK.format(reload=7))
    assert replayed(later, ticks, proof(later, ticks, Quantifiers(resets=False))).startswith("violated")


READING = """
        bsf     STATUS, RP0
        clrf    TRISB
        bcf     STATUS, RP0
        clrf    PORTB
loop    movlw   8
        xorwf   PORTB, f
        movlw   .50
        movwf   0x20
wait    btfsc   PORTA, 0
        nop
        decfsz  0x20, f
        goto    wait
        goto    loop
"""
"""Levels of 1 + 1 + 1 + 1 + 50 * 5 - 1 + 2 cycles, or 50 more if RA0 is low at each read."""


def test_a_low_level_is_timed_whatever_is_read_meanwhile_and_however_long_the_pulse_was() -> None:
    program = image(READING)
    bounds = '[[pulse]]\npin = "RB3"\nhigh_us = [10]\nlow_us = [0, {}]\n'
    assert proof(program, bounds.format(310)).proven
    found = proof(program, bounds.format(210))
    assert found.counterexample is not None and "low for more than 210" in found.counterexample.message


POLLED = """
        bsf     STATUS, RP0
        clrf    TRISB
        movlw   0x81
        movwf   OPTION_REG
        bcf     STATUS, RP0
        clrf    PORTB
loop    btfss   INTCON, T0IF
        goto    loop
        bcf     INTCON, T0IF
        movlw   2
        xorwf   PORTB, f
        goto    loop
"""
"""TMR0, which counts four cycles, overflows for the first time within 1024 of them: RB1 changes 3 to 5 cycles
later, where the loop comes to it."""


def test_a_timer_that_is_polled_and_begins_anywhere_is_told_apart() -> None:
    ticks = '[[every]]\nevent = "RB1 changes"\nfirst_us = [0, {}]\ngap_us = [0, 1028]\n'
    assert proof(image(POLLED), ticks.format(1040)).proven
    found = proof(image(POLLED), ticks.format(1020), Quantifiers(resets=False))
    assert replayed(image(POLLED), ticks.format(1020), found).startswith("violated")


WAITS = """
        bsf     STATUS, RP0
        clrf    TRISB
        bcf     STATUS, RP0
        clrf    PORTB
loop    btfsc   PORTA, 0
        goto    loop
        bsf     PORTB, 3
        goto    $+1
        goto    $+1
        bcf     PORTB, 3
        goto    loop
"""
"""High: 5 cycles; from a fall to the next rise at least 1 + 2 + 2 cycles, however long RA0 is high."""


def test_a_wait_of_any_length_is_one_state_where_only_what_is_too_early_counts() -> None:
    contract = '[[pulse]]\npin = "RB3"\nhigh_us = [5, 5]\nperiod_us = [{}]\n'
    found = proof(image(WAITS), contract.format(10))
    assert found.proven and found.states < 20
    assert proof(image(WAITS), contract.format(11)).counterexample is not None


UNWRITTEN = """
        bsf     STATUS, RP0
        clrf    TRISB
        bcf     STATUS, RP0
loop    movlw   .50
        movwf   0x20
wait    decfsz  0x20, f
        goto    wait
        movlw   8
        xorwf   PORTB, f
        goto    loop
"""
"""Levels of 1 + 1 + 3 * 50 - 1 + 1 + 1 + 2 cycles, whichever the latch had at power-up."""
EITHER = '[[pulse]]\npin = "RB3"\nhigh_us = [155, 155]\n'
BOTH = '[[never]]\ncondition = "RB0 high and RB1 high"\n'


def test_an_output_that_is_not_written_at_first_has_either_level() -> None:
    program = image(UNWRITTEN)
    found = proof(program, EITHER, Quantifiers(resets=False))
    assert found.counterexample is not None  # from a high latch on the first pulse has no whole turn
    assert replayed(program, EITHER, found).startswith("violated")


def first_written_at_once() -> Image:
    """RB0 and RB1 are outputs for 3 cycles before the write, and a chip may begin with both latches set."""
    return image(UNWRITTEN.replace("loop ", "        movlw   1\n        movwf   PORTB\nloop "))


@pytest.mark.campaign
def test_what_an_output_shows_before_its_first_write_counts_where_that_write_is_not_low() -> None:
    program = first_written_at_once()
    found = proof(program, BOTH, Quantifiers(resets=False))
    assert replayed(program, BOTH, found).startswith("violated")


ASLEEP = """
        clrf    {written}
        bsf     STATUS, RP0
        clrf    TRISB
        sleep
        clrf    PORTB
        goto    $
"""


BEGINS_HIGH = """
        bsf     PORTB, 1
        bsf     STATUS, RP0
        bcf     TRISB, 1
        bcf     STATUS, RP0
        nop
        bcf     PORTB, 1
        goto    $
"""


def test_the_clause_that_is_named_is_broken_by_the_run_that_is_printed() -> None:
    """BCF TRISB is in cycle 2: every chip rises there, and falls 3 cycles later."""
    program = image(BEGINS_HIGH)
    rises = '[[every]]\nevent = "RB1 rises"\nfirst_us = [2, 2]\n'
    assert proof(program, rises).proven
    contract = rises + '[[pulse]]\npin = "RB1"\nhigh_us = [4]\n'
    found = proof(program, contract)
    assert found.counterexample is not None and found.counterexample.message.startswith("pulse of RB1")
    assert replayed(program, contract, found).startswith("violated")


def test_an_output_that_is_not_written_before_sleep_has_either_level() -> None:
    """SLEEP lasts as long as it may, not the ten cycles for which such a level counts as low."""
    both = NEVER.replace("RB2", "RB3")
    assert proof(image(ASLEEP.format(written="PORTB")), both).proven
    unwritten = image(ASLEEP.format(written="0x20"))
    found = proof(unwritten, both, Quantifiers(resets=False))
    assert replayed(unwritten, both, found).startswith("violated")


def test_what_no_read_tells_is_not_decided() -> None:
    program = image(ANSWER.format(delay=""))
    pattern = '[[response]]\nwhen = ["RB0 falls", "RB0 rises"]\nthen = "RB4 rises"\nwithin_us = [0, 9]\n'
    never = '[[never]]\ncondition = "RB0 low and RB4 low"\nlonger_us = 100\n'
    for contract, why in ((pattern, "a pattern of several events"), (never, "a clause about RB0")):
        found = proof(program, contract)
        assert not found.proven and found.counterexample is None and why in found.reason


def test_a_cause_at_a_pin_that_is_an_input_of_some_chips_only_is_not_decided() -> None:
    """A plain run begins with W = 0 and drives all of port B; on another chip RB0 is an input."""
    found = proof(image(ANSWER.format(delay="").replace("movlw   0xEF", "nop")), answer(2, 6))
    assert not found.proven and found.counterexample is None
    assert found.reason.startswith("RB0 is read, and was driven in a plain run")


def test_what_a_device_answers_is_any_level() -> None:
    program = image(WAVE.format(turns=10).replace("clrf    TRISB", "clrf    TRISB\n        bcf     TRISA, 0"))
    board = SimulatorOptions(devices=(on_pins(EEPROM24(), scl="RA0", sda="RA1"),))
    clauses = parse_contract(PULSE, "c.toml").clauses(CLOCK)
    assert prove_contract(program, clauses, CLOCK, options=board).proven


def test_a_program_that_depends_on_its_ram_is_shown_with_the_power_up() -> None:
    """A byte of 0 counts 256 turns, as in a plain run: about 770 cycles; one of 5 counts 5."""
    program = image(WAVE.replace("movlw   .{turns}\n        movwf   0x20\n", ""))
    contract = '[[pulse]]\npin = "RB3"\nhigh_us = [700, 800]\n'
    found = proof(program, contract, Quantifiers(resets=False))
    assert found.counterexample is not None
    assert found.counterexample.options.start != ()


def test_a_chip_without_a_crystal_has_no_proven_times() -> None:
    wave = WAVE.format(turns=10)
    rc = assemble(HEADER.replace("_XT_OSC", "_RC_OSC") + wave + "\n        end\n", "rc.asm").image
    found = proof(rc, PULSE)
    assert not found.proven and "oscillator" in found.reason


def test_what_is_not_quantified_over_is_assumed() -> None:
    program = image(WAVE.format(turns=10))
    over = Quantifiers(resets=False, tmr0_phase=False, start=(("0x20", 7),))
    assumed = proof(program, PULSE, over).assumptions
    for each in (
        "there is no reset after power-on",
        "at power-up 0x20 is 0x07",
        "TMR0 counts from the cycle after",
    ):
        assert any(each in said for said in assumed), each
