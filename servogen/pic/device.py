"""Facts of the PIC16F84 and PIC16F84A as data: memory, registers, bits, pins, configuration.

Source: PIC16F84 DS30430D, PIC16F84A DS35007B; the section is named at each table. The PIC16C84 (DS30445) is
known to the assembler only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

from servogen.errors import InputError

PROGRAM_WORDS = 1024  # DS35007 section 2.1
ERASED_WORD = 0x3FFF  # an unprogrammed word: executes as ADDLW 0xFF
STACK_LEVELS = 8  # DS35007 section 2.4.1: a circular buffer
RAM_FIRST, RAM_LAST = 0x0C, 0x4F  # DS35007 section 2.2: 68 bytes, mapped into bank 1 at 0x8C-0xCF
RAM_BYTES = RAM_LAST - RAM_FIRST + 1
EEPROM_BYTES = 64  # DS35007 section 3
RESET_VECTOR, INTERRUPT_VECTOR = 0x000, 0x004  # DS35007 section 2.1

CONFIG_ADDRESS = 0x2007  # DS35007 section 6.1
ID_ADDRESS, ID_WORDS = 0x2000, 4  # DS35007 section 6.13
EEPROM_ADDRESS = 0x2100  # where a HEX file keeps the data EEPROM: DS30262, section 3


@dataclass(frozen=True, slots=True)
class Register:
    """A special function register: its address (bit 7 is the bank) and its bit names, bit 7 first."""

    name: str
    address: int
    bits: str = ""

    def bit_names(self) -> tuple[str | None, ...]:
        """Return the names of bits 0 to 7; None for a bit without a name."""
        names = [None if name == "-" else name for name in self.bits.split()]
        return tuple(reversed(names)) if names else (None,) * 8


REGISTERS = (  # DS35007 section 2.3, table 2-1
    Register("INDF", 0x00),
    Register("TMR0", 0x01),
    Register("PCL", 0x02),
    Register("STATUS", 0x03, "IRP RP1 RP0 TO PD Z DC C"),
    Register("FSR", 0x04),
    Register("PORTA", 0x05, "- - - RA4 RA3 RA2 RA1 RA0"),
    Register("PORTB", 0x06, "RB7 RB6 RB5 RB4 RB3 RB2 RB1 RB0"),
    Register("EEDATA", 0x08),
    Register("EEADR", 0x09),
    Register("PCLATH", 0x0A),
    Register("INTCON", 0x0B, "GIE EEIE T0IE INTE RBIE T0IF INTF RBIF"),
    Register("OPTION_REG", 0x81, "RBPU INTEDG T0CS T0SE PSA PS2 PS1 PS0"),
    Register("TRISA", 0x85, "- - - TRISA4 TRISA3 TRISA2 TRISA1 TRISA0"),
    Register("TRISB", 0x86, "TRISB7 TRISB6 TRISB5 TRISB4 TRISB3 TRISB2 TRISB1 TRISB0"),
    Register("EECON1", 0x88, "- - - EEIF WRERR WREN WR RD"),
    Register("EECON2", 0x89),
)
"""By bank-0 address first; INDF, PCL, STATUS, FSR, PCLATH and INTCON are in both banks."""

LOW_ACTIVE_BITS = ("TO", "PD", "RBPU")
"""Bits whose names the data sheet writes with a bar: 0 is the active state."""

BOTH_BANKS = ("INDF", "PCL", "STATUS", "FSR", "PCLATH", "INTCON")


@cache
def registers() -> Mapping[str, Register]:
    """Return the special function registers by name."""
    return MappingProxyType({register.name: register for register in REGISTERS})


@cache
def register_bits() -> Mapping[str, tuple[Register, int]]:
    """Return each named bit of a register: the register and the bit's number."""
    return MappingProxyType(
        {
            name: (register, bit)
            for register in REGISTERS
            for bit, name in enumerate(register.bit_names())
            if name
        }
    )


def addresses(*names: str) -> tuple[int, ...]:
    """Return the addresses of registers as instructions hold them: seven bits, without the bank."""
    return tuple(registers()[name].address & 0x7F for name in names)


def masks(*names: str) -> tuple[int, ...]:
    """Return each named bit of a register as a mask."""
    return tuple(1 << register_bits()[name][1] for name in names)


def register_at(address: int) -> Register | None:
    """Return the register at an address of eight bits, bit 7 being the bank (DS35007 figure 2-2)."""
    for register in REGISTERS:
        if register.address in (address, address & 0x7F if register.name in BOTH_BANKS else address):
            return register
    return None


def data_byte_exists(address: int) -> bool:
    """Return whether the data memory has a byte of RAM or a register at an address of both banks (DS35007
    figure 2-2).
    """
    return 0 <= address <= 0xFF and (
        RAM_FIRST <= address & 0x7F <= RAM_LAST or register_at(address) is not None
    )


@dataclass(frozen=True, slots=True)
class Pin:
    """A pin of the DIP-18 package."""

    number: int
    name: str
    role: str


PACKAGE = (  # DS35007 table 1-1; DIP-18
    Pin(1, "RA2", "I/O"),
    Pin(2, "RA3", "I/O"),
    Pin(3, "RA4", "I/O, open drain, Schmitt input; T0CKI"),
    Pin(4, "MCLR", "reset, active low; 13 V while programming"),
    Pin(5, "VSS", "ground"),
    Pin(6, "RB0", "I/O; INT"),
    Pin(7, "RB1", "I/O"),
    Pin(8, "RB2", "I/O"),
    Pin(9, "RB3", "I/O"),
    Pin(10, "RB4", "I/O; interrupt on change"),
    Pin(11, "RB5", "I/O; interrupt on change"),
    Pin(12, "RB6", "I/O; interrupt on change; programming clock"),
    Pin(13, "RB7", "I/O; interrupt on change; programming data"),
    Pin(14, "VDD", "supply"),
    Pin(15, "OSC2", "crystal"),
    Pin(16, "OSC1", "crystal, or clock in"),
    Pin(17, "RA0", "I/O"),
    Pin(18, "RA1", "I/O"),
)

OPEN_DRAIN_PIN = "RA4"  # DS35007 section 4.1


WATCHDOG_US = (7_000, 33_000)
"""The shortest and the longest period of any chip without postscaler (DS35007 section 9, parameter 31)."""


@dataclass(frozen=True, slots=True)
class Device:
    """One member of the family: the facts in which the chips differ."""

    name: str
    max_clock_hz: int
    code_protect_mask: int
    """The configuration word's code protection bits, low when protected."""
    eeprom_write_us: int
    """Typical time of one EEPROM write."""
    max_eeprom_write_us: int
    ram_last: int = RAM_LAST
    power_up_timer_on_is_1: bool = False
    """Whether a 1 in PWRTE, bit 3 of the configuration word, enables the power-up timer."""

    @property
    def short_name(self) -> str:
        """Return the name used in assembly sources: "16F84"."""
        return self.name.removeprefix("PIC")


DEVICES = (
    Device("PIC16F84", 10_000_000, 0x3FF0, 10_000, 20_000),  # DS30430 section 8.1, D122, identification
    Device("PIC16F84A", 20_000_000, 0x3FF0, 4_000, 8_000),  # DS35007 section 6.1, D122, identification
)

PIC16C84 = Device("PIC16C84", 10_000_000, 0x0010, 10_000, 20_000, ram_last=0x2F, power_up_timer_on_is_1=True)
"""DS30445 sections 4.2 and 8.1, D122: 36 bytes of RAM, and PWRTE inverted."""
ASSEMBLED_DEVICES = (*DEVICES, PIC16C84)
"""The devices whose sources are assembled; firmware is made, and simulated, for `DEVICES`."""


def device(name: str, known: Sequence[Device] = DEVICES) -> Device:
    """Return the device by name, with "PIC", "P" or nothing in front, in any case. Raises InputError."""
    wanted = name.upper().removeprefix("PIC").removeprefix("P")
    for candidate in known:
        if candidate.short_name == wanted:
            return candidate
    raise InputError(
        "unknown-device",
        f"unknown device '{name}'",
        hint=f"known: {', '.join(device.name for device in known)}",  # a similar name is another chip
    )


# Configuration word: DS35007 section 6.1, register 6-1.
OSCILLATORS = MappingProxyType({"LP": 0b00, "XT": 0b01, "HS": 0b10, "RC": 0b11})
CONFIG_OSCILLATOR_MASK = 0b11
CONFIG_WATCHDOG_ON = 1 << 2
CONFIG_POWER_UP_TIMER_OFF = 1 << 3
LP_MAX_HZ = 200_000  # DS35007 section 6.2, table 6-1
XT_MAX_HZ = 4_000_000  # the same; above, HS


def config_word(
    oscillator: str, *, watchdog: bool = False, power_up_timer: bool = True, code_protect: bool = False
) -> int:
    """Return the configuration word for these choices.

    Both chips carry code protection in bits 4 to 13 (0 protects).
    """
    word = OSCILLATORS[oscillator]
    word |= CONFIG_WATCHDOG_ON if watchdog else 0
    word |= 0 if power_up_timer else CONFIG_POWER_UP_TIMER_OFF
    return word if code_protect else word | 0x3FF0


def oscillator_for(clock_hz: int) -> str:
    """Return the crystal setting for a clock: XT up to 4 MHz, HS above, LP up to 200 kHz."""
    if clock_hz <= LP_MAX_HZ:
        return "LP"
    return "XT" if clock_hz <= XT_MAX_HZ else "HS"
