# ruff: noqa: E501 - a program a line
"""What has no value at power-up: copied it is harmless, its first use is found, and until then every start is
the same.

The law at the end is the definition: up to the first use that the simulator names, no value that a chip may
power up with, and no noise on a floating pin, changes an edge.
"""

from __future__ import annotations

import random

import pytest

from servogen.edges import PINS
from servogen.errors import Diagnostic
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.simulator import LevelChange, Machine, Recorded, SimulatorOptions, Stimuli, layout
from tests.simulator.helpers import CLOCK, image
from tests.simulator.programs import tame_image
from tests.simulator.test_exact import Edges, rows

OUTPUTS = " clrf PORTB\n clrf PORTA\n bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\n"
CYCLES = 3000
IMAGES = 30
PULLED_UP_FOR_A_WHILE = (1201, 2465)
"""Seeds whose programs turn port B's pull-ups on, and off again."""


def found(
    source: str,
    cycles: int = 2000,
    config: str = " __config _XT_OSC & _WDT_OFF & _PWRTE_OFF\n",
    **options: int,
) -> list[Diagnostic]:
    """Return what depends on the chip in the run of a program that then stands still."""
    program = image(f"{source}\nstand goto stand\n", config)
    chip = Machine(program, CLOCK, SimulatorOptions(**options), tracked=True)  # type: ignore[arg-type]
    chip.run(cycles)
    return list(chip.chip_dependent)


HARMLESS = {
    "a byte is copied, and overwritten": " movf 0x30, w\n movwf 0x31\n clrf 0x31\n movf 0x31, w\n movwf PORTB\n",
    "an interrupt's context is saved and restored": """
        movwf 0x30
        swapf STATUS, w
        movwf 0x31
        movf FSR, w
        movwf 0x32
        movf 0x32, w
        movwf FSR
        swapf 0x31, w
        movwf STATUS
        swapf 0x30, f
        swapf 0x30, w
""",
    "a carry rotated in is masked away": " clrf 0x20\n rlf 0x20, w\n andlw 0xFE\n movwf PORTB\n",
    "unknown bits are masked by AND": " movf 0x30, w\n andlw 0\n movwf PORTB\n",
    "unknown bits are covered by OR": " movlw 0xFF\n iorwf 0x30, w\n movwf PORTB\n",
    "another bit of the byte is tested": " clrf 0x30\n btfss 0x30, 0\n bsf PORTB, 0\n",
    "a bit is written, then tested": " bsf 0x30, 3\n btfss 0x30, 3\n bsf PORTB, 0\n",
    "a product is known not to be zero": " movlw 1\n iorwf 0x30, w\n btfsc STATUS, Z\n bsf PORTB, 0\n",
    "a count up has a bit that is 1": " movlw 0xF0\n andwf 0x30, w\n movwf 0x31\n incfsz 0x31, f\n bsf PORTB, 0\n",
    "a count down has a bit that is 1": """
        movlw 0xF0
        andwf 0x30, w
        iorlw 2
        movwf 0x31
        decfsz 0x31, w
        bsf PORTB, 0
""",
    "flags alone are written to STATUS": " movlw 7\n andwf 0x30, w\n movwf STATUS\n bsf PORTB, 0\n",
    "an output is read back": " bsf PORTB, 1\n btfss PORTB, 1\n bsf PORTB, 0\n",
    "an output is written beside a floating input": " bsf PORTA, 0\n bcf PORTA, 0\n",
    "flags of interrupts are not enabled": " bsf INTCON, GIE\n nop\n nop\n",
    "T0IF is cleared, TMR0 written": """
        bsf STATUS, RP0
        movlw 0x87
        movwf OPTION_REG
        bcf STATUS, RP0
        clrf TMR0
        bcf INTCON, T0IF
        btfss INTCON, T0IF
        goto $-1
""",
    "RBIF is cleared after port B was read": """
        bsf STATUS, RP0
        bcf OPTION_REG, 7
        movlw 0xF0
        movwf TRISB
        bcf STATUS, RP0
        movf PORTB, w
        bcf INTCON, RBIF
        btfsc INTCON, RBIF
        bsf PORTB, 0
""",
    "INTF is cleared while RB0 is an output": " bcf INTCON, INTF\n btfsc INTCON, INTF\n bsf PORTB, 0\n",
}

USES = {
    "ram": (" btfsc 0x30, 0\n nop\n", "RAM 0x30", "a skip"),
    "ram, copied": (" movf 0x30, w\n movwf 0x31\n btfsc 0x31, 7\n nop\n", "RAM 0x30", "a skip"),
    "ram, counted down": (" decfsz 0x30, f\n nop\n", "RAM 0x30", "a skip"),
    "ram, counted down to 0 in its known bits": (
        " movlw 0xF0\n andwf 0x30, w\n iorlw 1\n movwf 0x31\n decfsz 0x31, f\n nop\n", "RAM 0x30", "a skip"),
    "ram, compared": (" movlw 5\n subwf 0x30, w\n btfsc STATUS, C\n nop\n", "RAM 0x30", "a skip"),
    "ram, tested for zero": (" movf 0x30, f\n btfsc STATUS, Z\n nop\n", "RAM 0x30", "a skip"),
    "ram, through FSR": (" movlw 0x30\n movwf FSR\n btfsc INDF, 0\n nop\n", "RAM 0x30", "a skip"),
    "ram, out of a port": (" movf 0x30, w\n movwf PORTB\n", "RAM 0x30", "driven out of RB0"),
    "one bit, out of a port": (" movlw 8\n andwf 0x30, w\n movwf PORTB\n", "RAM 0x30", "driven out of RB3"),
    "ram, to a direction": (" movf 0x30, w\n tris PORTB\n", "RAM 0x30", "direction"),
    "ram, to OPTION": (" movf 0x30, w\n option\n", "RAM 0x30", "OPTION_REG"),
    "ram, to an enable bit": (" movf 0x30, w\n movwf INTCON\n", "RAM 0x30", "INTCON"),
    "ram, to PCLATH": (" movf 0x30, w\n movwf PCLATH\n", "RAM 0x30", "PCLATH"),
    "ram, to PCL": (" movf 0x30, w\n andlw 1\n addwf PCL, f\n nop\n nop\n", "RAM 0x30", "PCL"),
    "ram, to RP0": (" movf 0x30, w\n movwf STATUS\n", "RAM 0x30", "bank"),
    "w": (" movwf PORTB\n", "W has no value", "RB0"),
    "fsr": (" clrf INDF\n", "FSR has no value", "FSR points"),
    "carry": (" btfsc STATUS, C\n nop\n", "C, DC or Z", "a skip"),
    "carry, rotated in": (" clrf 0x20\n rlf 0x20, w\n movwf PORTB\n", "C, DC or Z", "RB0"),
    "tmr0": (" btfsc TMR0, 0\n nop\n", "RA4", "a skip"),
    "t0if, polled": (" bcf INTCON, T0IF\n bsf STATUS, RP0\n movlw 0x88\n movwf OPTION_REG\n bcf STATUS, RP0\n"
                     " btfss INTCON, T0IF\n goto $-1\n", "nothing drives", "a skip"),
    "t0 interrupt": (" movlw 0xA0\n movwf INTCON\n", "RA4", "an interrupt"),
    "floating input": (" btfsc PORTA, 2\n nop\n", "RA2 is an input that nothing drives", "a skip"),
    "rbif": (" btfsc INTCON, RBIF\n nop\n", "RBIF", "a skip"),
    "rbif, cleared before port B was read": (
        " bsf STATUS, RP0\n bcf OPTION_REG, 7\n movlw 0xF0\n movwf TRISB\n bcf STATUS, RP0\n"
        " bcf INTCON, RBIF\n btfsc INTCON, RBIF\n nop\n", "RBIF", "a skip"),
    "int on a floating RB0": (
        " bsf STATUS, RP0\n bsf TRISB, 0\n bcf STATUS, RP0\n bcf INTCON, INTF\n bsf INTCON, INTE\n"
        " bsf INTCON, GIE\n", "RB0", "an interrupt"),
    "sleep until RB0 rises": (
        " bsf STATUS, RP0\n bsf TRISB, 0\n bcf STATUS, RP0\n bsf INTCON, INTE\n sleep\n nop\n", "RB0", "SLEEP"),
    "eedata": (" btfsc EEDATA, 0\n nop\n", "EEDATA", "a skip"),
    "eeadr": (" bsf STATUS, RP0\n bsf EECON1, RD\n bcf STATUS, RP0\n btfsc EEDATA, 0\n nop\n", "EEADR", "a skip"),
    "wrerr": (" bsf STATUS, RP0\n btfsc EECON1, WRERR\n nop\n", "WRERR", "a skip"),
    "eeprom beyond its end": (
        " movlw 0x40\n movwf EEADR\n bsf STATUS, RP0\n bsf EECON1, RD\n bcf STATUS, RP0\n btfsc EEDATA, 0\n nop\n",
        "EEPROM's end", "a skip"),
    "eeprom, written with an unknown byte": (
        " clrf EEADR\n bsf STATUS, RP0\n bsf EECON1, WREN\n movlw 0x55\n movwf EECON2\n movlw 0xAA\n movwf EECON2\n"
        " bsf EECON1, WR\n bcf STATUS, RP0\n", "EEDATA", "written to the EEPROM"),
}  # fmt: skip


@pytest.mark.parametrize("name", HARMLESS)
def test_what_is_copied_or_masked_is_no_use(name: str) -> None:
    assert found(OUTPUTS + HARMLESS[name]) == []


@pytest.mark.parametrize("name", USES)
def test_a_use_is_found_with_its_source(name: str) -> None:
    source, what, how = USES[name]
    (use,) = found(OUTPUTS + source)
    assert use.code == "unknown-start"
    assert what in use.message
    assert how in use.message


def test_the_first_use_is_named_by_address_and_cycle() -> None:
    (use,) = found(OUTPUTS + " btfsc 0x30, 0\n nop\n btfsc 0x31, 0\n nop\n")
    assert (use.location.address, use.location.cycle) == (5, 5)
    assert "0x30" in use.message


def test_a_pin_that_the_board_holds_is_known() -> None:
    source = OUTPUTS + " btfsc PORTA, 4\n nop\n"
    assert found(source)
    assert found(source, ra4_pull_up=True) == []


def test_tmr0_has_no_value_until_it_is_written() -> None:
    (use,) = found(OUTPUTS + " btfsc TMR0, 0\n nop\n", ra4_pull_up=True)
    assert use.message.startswith("TMR0 has no value at power-up")
    assert found(OUTPUTS + " clrf TMR0\n btfsc TMR0, 0\n nop\n", ra4_pull_up=True) == []


def test_a_pin_driven_before_it_was_written_is_forgiven_ten_cycles_if_then_written_low() -> None:
    drive = " bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\n"
    assert found(drive + " clrf PORTB\n") == []
    assert found(drive + " nop\n" * 8 + " clrf PORTB\n") == []  # CLRF in cycle 11, TRIS in cycle 1
    (late,) = found(drive + " nop\n" * 9 + " clrf PORTB\n")
    assert (late.code, late.location.cycle, late.location.address) == ("driven-before-written", 1, 1)
    (high,) = found(drive + " movlw 4\n movwf PORTB\n")
    assert high.message.startswith("RB2:")
    (never,) = found(drive)
    assert never.message.startswith("RB0, RB1, RB2, RB3, RB4, RB5, RB6, RB7:")


def test_a_port_that_is_only_read_and_modified_is_never_written() -> None:
    (never,) = found(" bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\n bcf PORTB, 0\n")
    assert never.message.startswith("RB1, RB2,")


def test_an_empty_stack_has_nothing_to_return_to() -> None:
    assert "stack-underflow" in {warning.code for warning in found(" return\n")}


WATCHDOG = " __config _XT_OSC & _WDT_ON & _PWRTE_OFF\n"


def held_for(milliseconds: float, option: int) -> str:
    """Return a program that clears the watchdog, counts so long in steps of 1000 cycles, and clears it."""
    return f"""
        clrwdt
        bsf STATUS, RP0
        movlw {option}
        movwf OPTION_REG
        bcf STATUS, RP0
        movlw {int(milliseconds)}
        movwf 0x20
again   movlw 249
        movwf 0x21
one     nop
        decfsz 0x21, f
        goto one
        decfsz 0x20, f
        goto again
        clrwdt
        nop
        nop
        goto $-3
"""


@pytest.mark.parametrize(
    ("milliseconds", "option", "certain"),
    [(6, 0x00, True), (8, 0x00, False), (12, 0x09, True), (15, 0x09, False), (100, 0x0C, True)],
)
def test_the_watchdog_must_hold_on_the_chip_with_the_shortest_period(
    milliseconds: int, option: int, certain: bool
) -> None:
    """7 ms (DS35007 parameter 31), times the postscaler: option 0x09 is 1:2, 0x0C is 1:16."""
    warnings = found(held_for(milliseconds, option), 200_000, WATCHDOG)
    assert [warning.code for warning in warnings] == ([] if certain else ["watchdog-margin"])
    if not certain:
        assert abs(warnings[0].location.cycle - 7000 * (2 if option & 8 else 1)) < 10


@pytest.mark.parametrize(("option", "certain"), [(0x28, True), (0x29, False), (0x2F, False), (0x20, True)])
def test_an_unknown_count_of_the_prescaler_matters_where_it_divides_the_watchdog(
    option: int, certain: bool
) -> None:
    """Noise on RA4 is counted by TMR0's prescaler, which the watchdog then takes over (DS35007 section 5.2.1).

    Assigned to the watchdog (bit 3) with 1:1 (PS 0) it is not in the way.
    """
    source = f"""
        bsf STATUS, RP0
        movlw 0x27
        movwf OPTION_REG
        movlw {option}
        movwf OPTION_REG
        bcf STATUS, RP0
    """
    warnings = found(source, 1000, WATCHDOG)
    assert [warning.code for warning in warnings] == ([] if certain else ["watchdog-margin"])


def test_an_oscillator_that_is_not_for_the_clock_is_named() -> None:
    def kinds(oscillator: str) -> list[str]:
        return [each.code for each in found("", 10, f" __config _{oscillator}_OSC & _WDT_OFF\n")]

    assert kinds("XT") == kinds("HS") == []
    assert kinds("RC") == kinds("LP") == ["oscillator"]
    assert [each.code for each in found("", 10, "")] == ["no-configuration"]


def prepared_image(seed: int) -> Image:
    """Return a random program before which most of what is unknown is written; some of it is left out."""
    rng = random.Random(seed)
    body = tame_image(seed).program
    first = [encode("CLRF", f=f) for f in (5, 6)]
    rest = [encode("CLRF", f=f) for f in (1, 4, 8, 9, 0x0C, 0x0D, 0x20, 0x21, 0x22, 0x4F)]
    rest += [encode("MOVLW", k=0), encode("ADDLW", k=0), encode("MOVF", f=6, d=0), encode("CLRF", f=0x0B)]
    kept = [word for word in rest if rng.random() < 0.93]
    start = len(body)
    extra = [*kept, encode("GOTO", k=12)]
    words = dict(body) | {start + i: word for i, word in enumerate(extra)}
    words |= {0: first[0], 1: first[1], 2: encode("GOTO", k=start)}
    return Image(words, 0x3FF1 | rng.choice((0, 4)), {i: rng.randrange(256) for i in range(64)})


def edges_before(
    program: Image, end: int, options: SimulatorOptions, noise: list[LevelChange] | None = None
) -> Edges:
    stimulus = Stimuli([Recorded(noise)]) if noise else None
    chip = Machine(program, CLOCK, options, stimulus)
    return [edge for edge in rows(chip.run(CYCLES)) if edge[0] < end]


def pulls_up(program: Image, end: int) -> bool:
    """Return whether port B has its pull-ups at any time before `end`: then it does not float."""
    chip = Machine(program, CLOCK)
    return chip.run_until(predicate=lambda now: not now.numbers[layout.OPTION] & 0x80, limit=end)


def test_until_the_first_use_every_start_makes_the_same_edges() -> None:
    undisturbed, changed = 0, 0
    for seed in range(IMAGES):
        program = prepared_image(seed)
        tracked = Machine(program, CLOCK, tracked=True)
        edges = rows(tracked.run(CYCLES))
        uses = [warning.location.cycle for warning in tracked.chip_dependent]
        end = min(uses, default=CYCLES)
        undisturbed += not uses
        same = [edge for edge in edges if edge[0] < end]
        rng = random.Random(seed)
        for start in range(6):
            floating = rng.randrange(2)
            options = SimulatorOptions(start_seed=1000 * seed + start, floating=floating)
            assert edges_before(program, end, options) == same, (seed, start)
            changed += bool(uses) and edges_before(program, CYCLES, options) != edges
    assert undisturbed > IMAGES // 10
    assert changed  # after a use the starts do differ


def test_noise_on_floating_pins_changes_nothing_before_the_first_use() -> None:
    """Noise is a pin driven at random while the tracked chip believes that it floats; outputs win."""
    for seed in (*range(IMAGES), *PULLED_UP_FOR_A_WHILE):
        program = prepared_image(seed)
        tracked = Machine(program, CLOCK, tracked=True)
        edges = rows(tracked.run(CYCLES))
        end = min((warning.location.cycle for warning in tracked.chip_dependent), default=CYCLES)
        rng = random.Random(seed)
        cycles = sorted(rng.randrange(CYCLES) for _ in range(300))
        pins = 5 if pulls_up(program, end) else len(PINS)
        noise = [LevelChange(cycle, rng.randrange(pins), rng.randrange(2)) for cycle in cycles]
        same = [edge for edge in edges if edge[0] < end]
        assert edges_before(program, end, SimulatorOptions(), noise) == same, seed


@pytest.mark.campaign
def test_taking_regions_in_one_step_finds_the_same_first_use() -> None:
    for seed in range(IMAGES):
        for program in (prepared_image(seed), tame_image(seed)):
            fast, slow = (Machine(program, CLOCK, tracked=True) for _ in range(2))
            fast.run(CYCLES)
            while slow.cycles < CYCLES:
                slow.step()
            assert fast.chip_dependent == slow.chip_dependent, seed
            assert fast.fingerprint() == slow.fingerprint(), seed
            assert fast.chip_dependent or fast.unknown() == slow.unknown(), seed


def test_tracking_changes_nothing_that_the_chip_does() -> None:
    for seed in range(IMAGES):
        for program in (prepared_image(seed), tame_image(seed)):
            tracked, plain = Machine(program, CLOCK, tracked=True), Machine(program, CLOCK)
            assert rows(tracked.run(CYCLES)) == rows(plain.run(CYCLES))
            assert tracked.fingerprint() == plain.fingerprint()
