"""The first use of what has no value at power-up: the instruction and the cycle, the kind, what was unknown.

And the other warnings of a run, each with its place. Programs are straight: instruction n is in cycle n.
"""

from __future__ import annotations

import pytest

from servogen.edges import PINS
from servogen.pic.image import Image
from servogen.pic.isa import encode
from servogen.simulator import LevelChange, Machine, Recorded, SimulatorOptions, Stimuli
from servogen.simulator import layout as at
from tests.simulator.helpers import CLOCK, image
from tests.simulator.test_unknown import OUTPUTS, USES

SET_UP = len(OUTPUTS.strip("\n").splitlines())
USED_BY = {
    "ram": 0, "ram, copied": 2, "ram, counted down": 0,
    "ram, counted down to 0 in its known bits": 4, "ram, compared": 2, "ram, tested for zero": 1,
    "ram, through FSR": 2, "ram, out of a port": 1, "one bit, out of a port": 2, "ram, to a direction": 1,
    "ram, to OPTION": 1, "ram, to an enable bit": 1, "ram, to PCLATH": 1, "ram, to PCL": 2, "ram, to RP0": 1,
    "w": 0, "fsr": 0, "carry": 0, "carry, rotated in": 2, "tmr0": 0, "t0if, polled": 5, "t0 interrupt": 1,
    "floating input": 0, "rbif": 0, "rbif, cleared before port B was read": 6, "int on a floating RB0": 5,
    "sleep until RB0 rises": 4, "eedata": 0, "eeadr": 3, "wrerr": 1, "eeprom beyond its end": 5,
    "eeprom, written with an unknown byte": 7,
}  # fmt: skip
"""By the names of `test_unknown`: how many of its instructions come before the one that uses it."""


def tracked(source: str | Image, cycles: int = 60, **options: object) -> Machine:
    program = source if isinstance(source, Image) else image(f"{source}\nstand goto stand\n")
    chip = Machine(program, CLOCK, SimulatorOptions(**options), tracked=True)  # type: ignore[arg-type]
    chip.run(cycles)
    return chip


def use(chip: Machine) -> tuple[str, int, int]:
    """Return the message, the address and the cycle of the only thing that depends on the chip."""
    (found,) = chip.chip_dependent
    assert found.code == "unknown-start"
    assert found.location is not None
    assert found.location.address is not None and found.location.cycle is not None
    return found.message, found.location.address, found.location.cycle


def test_every_use_has_its_place() -> None:
    assert USED_BY.keys() == USES.keys()


@pytest.mark.parametrize("name", USES)
def test_a_use_is_at_its_instruction(name: str) -> None:
    place = SET_UP + USED_BY[name]
    _, address, cycle = use(tracked(OUTPUTS + USES[name][0]))
    assert (address, cycle) == (place, place)


def test_a_wait_for_tmr0_ends_where_an_unknown_bit_may_end_it() -> None:
    """The byte is 0x10 or 0x11: that it is not 0x0F is known, but 0x10 depends on the chip, whatever it has.

    TMR0 counts every 8 cycles, so that the wait of 5 sees each of its values.
    """
    timer = " bsf STATUS, RP0\n movlw 0x82\n movwf 0x81\n bcf STATUS, RP0\n"
    byte = " movf 0x30, w\n andlw 1\n iorlw 0x10\n movwf 0x20\n clrf TMR0\n"
    wait = "l movf TMR0, w\n xorwf 0x20, w\n btfss STATUS, Z\n goto l\n"
    uses = {use(tracked(OUTPUTS + timer + byte + wait, 400, start_seed=seed)) for seed in range(6)}
    ((_, address, cycle),) = uses
    begin = SET_UP + 9
    assert address == begin + 2
    assert 16 * 8 <= cycle - begin < 16 * 8 + 2 + 5 + 3


LOAD = {"w": " movf 0x30, w\n"}
"""An instruction that makes W unknown."""


@pytest.mark.parametrize(
    ("instruction", "how"),
    [
        ("movwf INTCON", "it is written to INTCON"),
        ("movwf PCLATH", "it is written to PCLATH"),
        ("option", "it is written to OPTION_REG"),
        ("tris PORTA", "a port's direction depends on it"),
        ("tris PORTB", "a port's direction depends on it"),
        ("movwf PCL", "a jump by PCL depends on it"),
        ("movwf STATUS", "the bank of registers depends on it"),
    ],
)
def test_what_is_done_with_it_is_said(instruction: str, how: str) -> None:
    chip = tracked(OUTPUTS + LOAD["w"] + f" {instruction}\n")
    message, address, cycle = use(chip)
    assert message == f"RAM 0x30 was not written since power-up, and {how}"
    assert (address, cycle) == (SET_UP + 1, SET_UP + 1)
    kinds = {"tris PORTA": 0, "tris PORTB": 1}
    if instruction in kinds:
        assert chip.numbers[at.USE_SUBJECT] == kinds[instruction]


@pytest.mark.parametrize(("register", "name"), [("EECON1", "EECON1"), ("EECON2", "EECON2"),
                                                ("OPTION_REG", "OPTION_REG"), ("INTCON", "INTCON"),
                                                ("PCLATH", "PCLATH")])  # fmt: skip
def test_a_register_in_bank_1_is_named(register: str, name: str) -> None:
    message, address, _ = use(tracked(OUTPUTS + f" bsf STATUS, RP0\n movf 0x30, w\n movwf {register}\n"))
    assert message.endswith(f"and it is written to {name}")
    assert address == SET_UP + 2


@pytest.mark.parametrize(
    ("bits", "register"),
    [(0x07, "INTCON"), (0x08, "EECON1"), (0xE0, "PCLATH"), (0xFF, "EEADR"), (0xFF, "EEDATA"), (0xFF, "FSR"),
     (0xFF, "TMR0"), (0xFF, "0x31")],
)  # fmt: skip
def test_bits_that_nothing_depends_on_may_be_unknown(bits: int, register: str) -> None:
    bank = " bsf STATUS, RP0\n" if register == "EECON1" else ""
    source = OUTPUTS + f" movlw {bits}\n andwf 0x30, w\n{bank} movwf {register}\n"
    assert tracked(source, ra4_pull_up=True).chip_dependent == ()


@pytest.mark.parametrize("bit", range(8))
@pytest.mark.parametrize(
    ("register", "bank", "harmless"), [("INTCON", 0, 0x07), ("EECON1", 1, 0x28 | 0xC0), ("PCLATH", 0, 0xE0)]
)
def test_a_bit_that_matters_must_be_known(register: str, bank: int, harmless: int, bit: int) -> None:
    """INTCON's flags may be anything; EECON1 has bits 0 to 4, of which WRERR (3) may; PCLATH has five."""
    switch = " bsf STATUS, RP0\n" if bank else ""
    chip = tracked(OUTPUTS + f" movlw {1 << bit}\n andwf 0x30, w\n{switch} movwf {register}\n", 20)
    assert bool(chip.chip_dependent) is not bool(harmless >> bit & 1)


@pytest.mark.parametrize("pin", range(13))
def test_a_floating_input_is_named(pin: int) -> None:
    port, bit = ("PORTA", pin) if pin < 5 else ("PORTB", pin - 5)
    message, address, cycle = use(tracked(f" btfsc {port}, {bit}\n nop\n"))
    assert message == f"{PINS[pin]} is an input that nothing drives, and a skip depends on it"
    assert (address, cycle) == (0, 0)
    driven = Machine(
        image(f" btfsc {port}, {bit}\n nop\nstand goto stand\n"),
        CLOCK,
        stimulus=Stimuli([Recorded([LevelChange(0, pin, 1)])]),
        tracked=True,
    )
    driven.run(20)
    assert driven.chip_dependent == ()
    released = Machine(
        image(f" nop\n nop\n btfsc {port}, {bit}\n nop\nstand goto stand\n"),
        CLOCK,
        stimulus=Stimuli([Recorded([LevelChange(0, pin, 1), LevelChange(1, pin, 2)])]),
        tracked=True,
    )
    released.run(20)
    assert use(released)[0].startswith(f"{PINS[pin]} is an input that nothing drives")


@pytest.mark.parametrize("pin", range(13))
def test_the_lowest_of_several_floating_inputs_is_named_unless_one_is_asked_for(pin: int) -> None:
    port, first = ("PORTA", 0) if pin < 5 else ("PORTB", 5)
    mask = 0xFF & ~((1 << pin - first) - 1)
    chip = tracked(f" movf {port}, w\n andlw {mask}\n btfss STATUS, Z\n nop\n")
    assert use(chip)[0].startswith(f"{PINS[first]} is an input")  # the source of the whole byte
    chip = tracked(f" btfss {port}, {pin - first}\n nop\n")
    assert use(chip)[0].startswith(f"{PINS[pin]} is an input")


@pytest.mark.parametrize("pin", range(13))
def test_an_output_whose_latch_was_never_written_is_named_when_it_is_read(pin: int) -> None:
    port, tris, bit = ("PORTA", "TRISA", pin) if pin < 5 else ("PORTB", "TRISB", pin - 5)
    source = f" bsf STATUS, RP0\n bcf {tris}, {bit}\n bcf STATUS, RP0\n btfsc {port}, {bit}\n nop\n"
    found = [each for each in tracked(source).chip_dependent if each.code == "unknown-start"]
    (warning,) = found
    assert warning.message.startswith(f"the latch of {PINS[pin]} holds no known value yet, and a skip")
    assert warning.location is not None
    assert (warning.location.address, warning.location.cycle) == (3, 3)
    written = source.replace(" bsf STATUS", f" clrf {port}\n bsf STATUS", 1)
    assert tracked(written).chip_dependent == ()


@pytest.mark.parametrize("write", ["clrf STATUS", "andwf STATUS, f", "xorwf STATUS, f", "movf STATUS, f"])
def test_a_carry_that_a_write_of_status_keeps_is_still_that_of_the_byte_it_came_from(write: str) -> None:
    """An instruction that sets flags writes the other bits only (DS35007 section 2.3.1)."""
    source = f" movf 0x30, w\n addlw 1\n movlw 0\n {write}\n btfsc STATUS, C\n nop\n"
    message, address, _ = use(tracked(source))
    assert message.startswith("RAM 0x30 ") and address == 4


@pytest.mark.parametrize("pin", [pin for pin in range(13) if pin != 4])  # RA4 is an open drain
def test_the_output_that_is_written_with_an_unknown_bit_is_named(pin: int) -> None:
    port, bit = ("PORTA", pin) if pin < 5 else ("PORTB", pin - 5)
    chip = tracked(OUTPUTS + f" movlw {1 << bit}\n andwf 0x30, w\n movwf {port}\n", 20)
    if pin < 5:  # `OUTPUTS` leaves port A as inputs
        assert chip.chip_dependent == ()
        chip = tracked(
            OUTPUTS + f" movlw 0\n tris PORTA\n movlw {1 << bit}\n andwf 0x30, w\n movwf {port}\n", 20
        )
    assert use(chip)[0].endswith(f"and it is driven out of {PINS[pin]}")


@pytest.mark.parametrize("address", [0x0C, 0x0D, 0x2F, 0x4E, 0x4F])
def test_a_byte_of_ram_is_named(address: int) -> None:
    assert use(tracked(f" btfss {address}, 7\n nop\n"))[0].startswith(f"RAM 0x{address:02X} was not written")


@pytest.mark.parametrize(
    ("register", "bank", "what"),
    [("FSR", 0, "FSR"), ("EEDATA", 0, "EEDATA"), ("EEADR", 0, "EEADR"), ("TMR0", 0, "TMR0"),
     ("EECON1", 1, "WRERR"), ("STATUS", 0, "C, DC or Z")],
)  # fmt: skip
def test_a_register_without_a_value_at_power_up_is_named(register: str, bank: int, what: str) -> None:
    source = (" bsf STATUS, RP0\n" if bank else "") + f" movf {register}, w\n movwf 0x20\n"
    test = " btfsc 0x20, 3\n nop\n" if register == "EECON1" else " btfsc 0x20, 0\n nop\n"
    message, address, _ = use(tracked(source + test, ra4_pull_up=True))
    assert message == f"{what} has no value at power-up, and a skip depends on it"
    assert address == 2 + bank


@pytest.mark.parametrize(
    ("enable", "flag", "source"),
    [(5, 2, "RA4 is an input"), (4, 1, "RB0 is an input"), (3, 0, "RBIF compares RB4 to RB7")],
)
def test_an_enabled_flag_that_noise_may_set_is_a_use(enable: int, flag: int, source: str) -> None:
    """T0IE is bit 5 and T0IF 2, INTE 4 and INTF 1, RBIE 3 and RBIF 0: DS35007 register 2-3."""
    for intcon, how in ((0x80 | 1 << enable, "an interrupt depends on it"), (1 << enable, None)):
        chip = tracked(f" movlw {intcon}\n movwf INTCON\n", 20)
        if how:
            message, address, cycle = use(chip)
            assert message.startswith(source)
            assert message.endswith(how)
            assert (address, cycle) == (1, 1)
            assert chip.numbers[at.USE_SUBJECT] == 1 << flag
        else:
            assert chip.chip_dependent == ()
    message, address, cycle = use(tracked(f" movlw {1 << enable}\n movwf INTCON\n sleep\n nop\n", 20))
    assert message.startswith(source)
    assert message.endswith("the end of SLEEP depends on it")
    assert (address, cycle) == (2, 2)
    certain = tracked(f" movlw {1 << enable | 1 << flag}\n movwf INTCON\n sleep\n nop\n", 20)
    assert certain.chip_dependent == ()  # the flag is set: SLEEP is a NOP
    certain = tracked(f" movlw {0x80 | 1 << enable | 1 << flag}\n movwf INTCON\n nop\n", 4)
    assert certain.chip_dependent == ()  # the interrupt comes


# Other warnings -------------------------------------------------------------------------------------------


def plain(source: str, cycles: int) -> Machine:
    chip = Machine(image(source), CLOCK)
    chip.run(cycles)
    return chip


def warnings(chip: Machine) -> list[tuple[str, str, int | None, int | None]]:
    found = []
    for each in chip.state().warnings:
        assert each.location is not None
        found.append((each.code, each.message, each.location.address, each.location.cycle))
    return found


def test_pins_that_one_instruction_drives_against_the_board_share_a_warning() -> None:
    """RB1 and RB3 are held high from cycle 0; TRISB is cleared in cycle 2, RB3 released and held low in 9."""
    changes = [(0, 6, 1), (0, 8, 1), (0, 7, 0), (9, 8, 0)]
    source = " clrf PORTB\n bsf STATUS, RP0\n clrf TRISB\n bcf STATUS, RP0\n nop\n nop\n bsf PORTB, 2\n"
    stimulus = Stimuli([Recorded([LevelChange(*change) for change in changes])])
    chip = Machine(image(f"{source}stand goto stand\n"), CLOCK, stimulus=stimulus)
    chip.run(20)
    text = "an output, and driven the other way from outside"
    assert warnings(chip) == [
        ("contention", f"RB1, RB3: {text}", 2, 2),
        ("contention", f"RB2: {text}", 6, 6),
    ]


def test_words_stack_and_eeprom_warn_at_their_instruction() -> None:
    words = {0: encode("CALL", k=2), 1: 0x0001, 2: encode("RETURN")}
    chip = Machine(Image(words, 0x3FF1), CLOCK)
    chip.run(6)
    assert [(code, address, cycle) for code, _, address, cycle in warnings(chip)] == [
        ("undefined-word", 1, 4),
        ("stack-underflow", 2, 5),
    ]
    erased = Machine(Image({0: encode("GOTO", k=0x155)}, 0x3FF1), CLOCK)
    erased.run(4)
    assert [(code, address, cycle) for code, _, address, cycle in warnings(erased)] == [
        ("erased-word", 0x155, 2), ("erased-word", 0x156, 3),
    ]  # fmt: skip
    assert "the unprogrammed word at 0x155 " in warnings(erased)[0][1]
    nine = Machine(image("".join(f" call n{i}\nn{i}\n" for i in range(9)) + " goto $\n"), CLOCK)
    nine.run(30)
    assert [(code, address, cycle) for code, _, address, cycle in warnings(nine)] == [
        ("stack-overflow", 8, 16)
    ]
    sequence = " bsf STATUS, RP0\n nop\n bsf EECON1, WR\n goto $\n"
    assert warnings(tracked(sequence))[0][::2] == ("eeprom-sequence", 2)
    beyond = " movlw 0x41\n movwf EEADR\n bsf STATUS, RP0\n bsf EECON1, RD\n goto $\n"
    assert ("eeprom-address", "EEADR is 0x041; the EEPROM ends at 0x03F", 3, 3) in warnings(plain(beyond, 10))
    last = beyond.replace("0x41", "0x3F")
    assert warnings(plain(last, 10)) == []


@pytest.mark.parametrize("after", [8, 9, 10, 11])
@pytest.mark.parametrize("end", ["clrf PORTB", "movwf TRISB"])
def test_an_output_with_an_unknown_latch_is_a_glitch_for_ten_cycles(end: str, after: int) -> None:
    """TRISB is cleared in cycle 2, and its latch is cleared, or the pins are inputs again, so much later."""
    bank = " bcf STATUS, RP0\n" if end.startswith("clrf") else " nop\n"
    source = " movlw 0xFF\n bsf STATUS, RP0\n clrf TRISB\n" + bank + " nop\n" * (after - 2) + f" {end}\n"
    found = warnings(tracked(source, 40))
    if after <= 10:
        assert found == []
    else:
        assert [(code, address, cycle) for code, _, address, cycle in found] == [
            ("driven-before-written", 2, 2)
        ]
        assert found[0][1].startswith("RB0, RB1, RB2, RB3, RB4, RB5, RB6, RB7: an output while its latch")


@pytest.mark.parametrize("pulsed", [0, 1])
def test_after_the_first_pulse_an_output_with_an_unknown_latch_is_not_a_glitch(pulsed: int) -> None:
    """RA0 is driven to the level `pulsed`; then RB1 is an output for two cycles before it is written low."""
    first = " clrf PORTA\n bsf STATUS, RP0\n bcf TRISA, 0\n bcf STATUS, RP0\n"
    later = " bsf STATUS, RP0\n bcf TRISB, 1\n bcf STATUS, RP0\n bcf PORTB, 1\n"
    source = f"{first} movlw {pulsed}\n movwf PORTA\n{later}"
    found = [(code, address, cycle) for code, _, address, cycle in warnings(tracked(source, 30))]
    assert found == [("driven-before-written", 7, 7)] * pulsed


PULSES = """
        clrf    PORTA
        clrf    PORTB
        bsf     STATUS, RP0
        {option}
        bcf     {tris}, {bit}
        bcf     STATUS, RP0
        bsf     {port}, {bit}
        bcf     {port}, {bit}
        bsf     STATUS, RP0
        {after} {tris}, {bit}
"""
"""RAx or RBx is pulsed, and made an input at address 9."""


@pytest.mark.parametrize("pin", range(13))
@pytest.mark.parametrize("pull_up", [False, True])
def test_a_pin_with_pulses_that_becomes_an_input_is_named_also_if_a_pull_up_makes_it_high(
    pin: int, pull_up: bool
) -> None:
    """DS35007 section 4.2: RBPU turns on the pull-ups of port B; RA4 has one on the board."""
    port, bit = ("A", pin) if pin < 5 else ("B", pin - 5)
    option = "bcf OPTION_REG, 7" if pull_up else "nop"
    fields = {"port": f"PORT{port}", "tris": f"TRIS{port}", "bit": bit, "option": option}
    chip = tracked(PULSES.format(after="bsf", **fields), 20, ra4_pull_up=pull_up or pin == 4)
    found = [(code, address) for code, message, address, _ in warnings(chip) if PINS[pin] in message]
    high = pin == 4 or (pull_up and port == "B")
    assert found == [("released", 9), ("pulled-up", 9)][: 1 + high]
    assert [each.code for each in chip.chip_dependent] == ["pulled-up"] * high
    assert warnings(tracked(PULSES.format(after="bcf", **fields), 20, ra4_pull_up=True)) == []


def test_a_pin_that_is_not_yet_an_output_at_the_first_pulse_of_another_one_is_named_at_its_own() -> None:
    source = PULSES.format(port="PORTB", tris="TRISB", bit=1, option="nop", after="bcf") + (
        " bcf TRISA, 2\n bcf STATUS, RP0\n bsf PORTA, 2\n"
    )
    assert [(code, address) for code, _, address, _ in warnings(tracked(source, 30))] == [("released", 12)]


@pytest.mark.parametrize(
    ("fault", "code"),
    [
        ({0x155: 0x0001}, "undefined-word"),
        ({0x155: encode("RETURN")}, "stack-underflow"),
        ({n: encode("CALL", k=n + 1) for n in range(0x155, 0x15E)}, "stack-overflow"),
    ],
)
def test_a_warning_is_not_crowded_out_by_those_of_erased_words(fault: dict[int, int], code: str) -> None:
    """Of 256 unprogrammed words some are named."""
    words = {0: encode("GOTO", k=0x55)} | fault | {0x15E: encode("GOTO", k=0x15E)}
    found = [each for each, *_ in warnings(tracked(Image(words, 0x3FF1), 400))]
    assert code in found
    assert found.count("erased-word") > 20


@pytest.mark.parametrize("pin", range(13))
def test_an_output_that_is_written_high_is_a_pulse_at_once(pin: int) -> None:
    port, tris, bit = ("PORTA", "TRISA", pin) if pin < 5 else ("PORTB", "TRISB", pin - 5)
    source = f" movlw {1 << bit}\n bsf STATUS, RP0\n bcf {tris}, {bit}\n bcf STATUS, RP0\n movwf {port}\n"
    (found,) = warnings(tracked(source, 9))
    assert found[0] == "driven-before-written"
    assert found[1].startswith(f"{PINS[pin]}: ")
    assert found[2:] == (2, 2)
    assert warnings(tracked(f" clrf {port}\n{source}", 9)) == []


@pytest.mark.parametrize(("cycles", "warned"), [(12, False), (13, True)])
def test_an_output_that_stays_unwritten_is_noted_after_ten_cycles(cycles: int, warned: bool) -> None:
    """TRISB is cleared in cycle 2."""
    chip = tracked(" nop\n bsf STATUS, RP0\n bcf TRISB, 3\n bcf STATUS, RP0\n" + " nop\n" * 30, 0)
    while chip.cycles < cycles:
        chip.step()
    assert bool(warnings(chip)) is warned
