"""Options and start values at their limits, and the state at power-up that follows from them."""

from __future__ import annotations

import numpy as np
import pytest

from servogen.errors import InputError
from servogen.simulator import Machine, SimulatorOptions
from servogen.simulator.options import START_VALUES, start_value
from servogen.simulator.reset_state import power_up
from servogen.units import Clock
from tests.simulator.helpers import CLOCK, image


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [
        ("watchdog_us", 1, 1_000_000),
        ("eeprom_write_us", 1, 1_000_000),
        ("tmr0_phase", 0, 3),
        ("power_up_us", 0, 1_000_000),
        ("floating", 0, 1),
    ],
)
def test_a_number_is_within_its_limits(name: str, least: int, most: int) -> None:
    for value in (least, most):
        assert getattr(SimulatorOptions(**{name: value}), name) == value  # type: ignore[arg-type]
    for value in (least - 1, most + 1):
        with pytest.raises(InputError) as refused:
            SimulatorOptions(**{name: value})  # type: ignore[arg-type]
        assert f": {name} = {value} is not between {least} and {most} [" in str(refused.value)
        assert refused.value.code == "out-of-range"


def test_the_defaults_are_the_data_sheets_typical_values() -> None:
    """DS35007 and DS30430, section 9: parameters 31 (watchdog), 33 (power-up timer) and D122 (EEPROM)."""
    options = SimulatorOptions()
    assert (options.watchdog_us, options.power_up_us) == (18_000, 72_000)
    assert SimulatorOptions(device="PIC16F84").eeprom_us == 10_000
    assert SimulatorOptions(device="PIC16F84A").eeprom_us == 4_000
    assert SimulatorOptions(device="PIC16F84A", eeprom_write_us=7).eeprom_us == 7
    assert (options.ra4_pull_up, options.power_up, options.oscillator_start_up) == (False, False, True)
    assert (options.tmr0_phase, options.floating, options.start_seed, options.start) == (0, 0, None, ())


def test_a_start_value_of_the_ram_is_that_of_its_68_bytes_alone() -> None:
    """DS35007 figure 2-2: 0x0C to 0x4F."""
    nothing = image("GOTO $")
    filled = SimulatorOptions(start=(("ram", 0xAA),))
    states = [power_up(nothing, CLOCK, options, tracked=False) for options in (SimulatorOptions(), filled)]
    assert np.flatnonzero(states[0] != states[1]).tolist() == list(range(0x0C, 0x50))


LARGEST = {"ram": 0xFF, "w": 0xFF, "flags": 7, "fsr": 0xFF, "tmr0": 0xFF, "eedata": 0xFF, "eeadr": 0xFF,
           "wrerr": 1, "rbif": 1, "latches": 0x1FFF, "rb-old": 0xF, "0x0C": 0xFF, "0x4F": 0xFF}  # fmt: skip


@pytest.mark.parametrize("name", LARGEST)
def test_a_start_value_has_as_many_bits_as_its_place(name: str) -> None:
    most = LARGEST[name]
    for value in (0, most):
        SimulatorOptions(start=((name, value),))
    for value in (-1, most + 1):
        with pytest.raises(InputError, match=f"start value {name} = {value} is not between 0 and {most}"):
            SimulatorOptions(start=((name, value),))


def test_the_start_values_are_those_and_each_byte_of_ram() -> None:
    assert START_VALUES.keys() == LARGEST.keys() | {f"0x{address:02X}" for address in range(0x0C, 0x50)}
    with pytest.raises(InputError, match="no start value 'latch'") as refused:
        SimulatorOptions(start=(("latch", 0),))
    assert refused.value.hint is not None
    assert "latches" in refused.value.hint


@pytest.mark.parametrize(
    ("text", "found"),
    [("w=0x12", ("w", 18)), ("W=7", ("w", 7)), ("0x2f=255", ("0x2F", 255)), ("0X0c=0b11", ("0x0C", 3)),
     ("rb-old=0", ("rb-old", 0)), ("Latches=0x1fff", ("latches", 0x1FFF))],
)  # fmt: skip
def test_a_start_value_is_read(text: str, found: tuple[str, int]) -> None:
    assert start_value(text) == found


@pytest.mark.parametrize("text", ["w", "w=", "w=x", "=", "0xzz=1", "w 1", "w=1.5"])
def test_a_text_without_a_value_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="is not NAME=VALUE") as refused:
        start_value(text)
    assert f"'{text}'" in str(refused.value)


def powered(**options: object) -> Machine:
    return Machine(image(" nop\n"), CLOCK, SimulatorOptions(**options))  # type: ignore[arg-type]


def test_each_start_value_is_in_its_place_at_power_up() -> None:
    given = (("ram", 0x11), ("0x0C", 0x12), ("0x4F", 0x13), ("w", 0x14), ("flags", 5), ("fsr", 0x15),
             ("tmr0", 0x16), ("eedata", 0x17), ("eeadr", 0x18), ("wrerr", 1), ("rbif", 1),
             ("latches", 0x1A5F))  # fmt: skip
    state = powered(start=given).state()
    assert state.ram == bytes([0x12, *[0x11] * 66, 0x13])
    assert (state.w, state.status) == (0x14, 0x18 | 5)
    names = ("FSR", "TMR0", "EEDATA", "EEADR", "EECON1", "INTCON", "LATA", "LATB")
    assert [state.registers[name] for name in names] == [0x15, 0x16, 0x17, 0x18, 0x08, 0x01, 0x1F, 0xD2]
    assert state.ram_written == ()
    again = powered(start=(("w", 1), ("w", 2), ("0x20", 3), ("ram", 4))).state()
    assert (again.w, again.ram[0x14]) == (2, 4)  # the last one of a name, and of a place


def test_without_start_values_everything_is_0_and_with_a_seed_anything() -> None:
    state = powered().state()
    assert (set(state.ram), state.w, state.status, state.registers["FSR"]) == ({0}, 0, 0x18, 0)
    assert (state.registers["LATA"], state.registers["LATB"], state.registers["INTCON"]) == (0, 0, 0)
    seen = [powered(start_seed=seed).state() for seed in range(40)]
    for name, mask in (("FSR", 0xFF), ("TMR0", 0xFF), ("LATA", 0x1F), ("LATB", 0xFF), ("EECON1", 8),
                       ("INTCON", 1), ("EEDATA", 0xFF), ("EEADR", 0xFF), ("STATUS", 7)):  # fmt: skip
        values = [one.registers[name] for one in seen]
        every, some = values[0], 0
        for value in values:
            every, some = every & value, some | value
        fixed = 0x18 if name == "STATUS" else 0
        assert (every, some) == (fixed, mask | fixed), name
    assert len({one.ram for one in seen}) == 40
    assert powered(start_seed=3).state() == powered(start_seed=3).state()
    assert powered(start_seed=3, start=(("w", 9),)).state().w == 9


@pytest.mark.parametrize(("floating", "pull_up", "pins"), [(0, False, 0), (0, True, 0x10), (1, False, 0x1FFF),
                                                           (1, True, 0x1FFF)])  # fmt: skip
def test_pins_that_nothing_drives_have_the_level_that_is_given(
    floating: int, pull_up: bool, pins: int
) -> None:
    chip = powered(floating=floating, ra4_pull_up=pull_up)
    assert chip.pins == pins
    chip.run(1)
    assert chip.pins == pins
    assert chip.state().registers["INTCON"] & 1 == 0  # RB4 to RB7 are as they were at power-up


@pytest.mark.parametrize("oscillator", ["XT", "HS", "LP", "RC"])
@pytest.mark.parametrize("timer", ["ON", "OFF"])
def test_the_timers_before_the_first_instruction(oscillator: str, timer: str) -> None:
    """DS35007 sections 6.5 and 6.6: 72 ms, and 1024 oscillator periods, which RC does not wait for."""
    config = f"        __config _{oscillator}_OSC & _WDT_ON & _PWRTE_{timer}\n"
    chip = Machine(image(" nop\n", config), Clock(8_000_000), SimulatorOptions(power_up=True))
    cycles = (144_000 if timer == "ON" else 0) + (0 if oscillator == "RC" else 256)
    assert chip.cycles == cycles
    assert chip.state().watchdog_at == cycles + 128 * 36_000
    short = Machine(image(" nop\n", config), CLOCK, SimulatorOptions(power_up=True, power_up_us=10))
    assert short.cycles == (10 if timer == "ON" else 0) + (0 if oscillator == "RC" else 256)
    assert Machine(image(" nop\n", config), CLOCK).cycles == 0


@pytest.mark.parametrize("floating", [0, 1])
def test_pins_that_differ_from_the_latches_at_power_up_set_rbif_though_no_pin_changes(
    floating: int,
) -> None:
    """DS35007 section 4.2: the mismatch outputs of RB4 to RB7 set it, whether or not a pin changes."""
    for latches in range(16):
        options = SimulatorOptions(floating=floating, start=(("rb-old", latches), ("rbif", 0)))
        machine = Machine(image("GOTO $"), CLOCK, options)
        machine.run(4)
        assert machine.state().registers["INTCON"] & 1 == int(latches != 0xF * floating)
