"""The facts of a slot of the state vector, and the builder of the table of slots (`layout`)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

from servogen.pic.device import Register, registers

ALL_PINS = 0x1FFF
"""A bit for each pin: port A in bits 0 to 4, port B in 5 to 12."""


class Future(Enum):
    """How the later behaviour of the chip depends on a slot."""

    NONE = auto()
    """Not at all: the slot serves reports, or keeps its value during a run."""
    VALUE = auto()
    """On its value."""
    STIMULUS = auto()
    """On its value, which only a stimulus changes."""
    MOMENT = auto()
    """On how many cycles it lies ahead, or that it is NEVER."""
    UNTIL = auto()
    """On how many cycles it lies ahead, if it does."""
    SINCE = auto()
    """On how many cycles ago it was, if the watchdog is on."""
    SPECIAL = auto()
    """In another way, for which fingerprint.py and prove/chip.py have code."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SlotFacts:
    """The facts of one slot."""

    name: str
    number: int
    future: Future
    register: str = ""
    """The special function register that it holds, a name of `pic.device`."""
    port: str = ""
    """The name without A or B if it holds both ports: PORT, TRIS, or LAT, which this chip does not show."""
    bits: int = 0xFF
    """The bits that exist."""
    power_up: int = 0
    """The value at power-up, apart from the bits that are undefined; for other resets see events.h."""
    timed: bool = False
    """Whether time alone changes it."""
    merged: bool = False
    """Whether the prover may take chips together that differ here, and regard the difference as unknown."""
    other_chips: bool = False
    """Whether only warnings about other chips depend on it."""
    unknown: int | None = None
    """The slot that holds its unknown bits."""
    undefined: int = 0
    """The bits that a power-on reset leaves undefined: "x" in DS35007 table 6-4."""
    start: str = ""
    """The name of the undefined bits as a start value (`--start`)."""
    source: int = 0
    """The source that its unknown bits have at power-up (unknown.h), 0 for none."""
    source_name: str = ""
    """What warnings call the undefined bits."""

    @property
    def shift(self) -> int:
        """Return the number of the lowest undefined bit, with which the start value begins."""
        return _lowest(self.undefined)

    @property
    def first_bit(self) -> int:
        """Return the number of the lowest bit."""
        return _lowest(self.bits)

    @property
    def unknown_name(self) -> str:
        """Return the name of the slot that holds its unknown bits."""
        return f"{self.name}_UNKNOWN"

    @property
    def registers(self) -> tuple[Register, ...]:
        """Return the special function registers that programs find in it."""
        names = (self.register, f"{self.port}A", f"{self.port}B")
        return tuple(registers()[name] for name in names if name in registers())

    @property
    def is_free(self) -> bool:
        """Return whether it is a byte of which any bit may be unknown, and which may be PHASED."""
        return self.undefined == self.bits == 0xFF


def _lowest(bits: int) -> int:
    return (bits & -bits).bit_length() - 1


class SlotTable:
    """Numbers slots one after the other and keeps their rows."""

    def __init__(self) -> None:
        self._next = 0
        self._rows: list[SlotFacts] = []
        self._fields: list[tuple[str, int]] = []

    def rows(self) -> tuple[SlotFacts, ...]:
        """Return the rows so far."""
        return tuple(self._rows)

    def fields(self) -> tuple[tuple[str, int], ...]:
        """Return the name and the number of slots of each field of the state so far, in their order."""
        return tuple(self._fields)

    @property
    def length(self) -> int:
        """Return the number of slots so far."""
        return self._next

    def block(self, name: str, length: int) -> int:
        """Return the first of `length` slots without a row."""
        first, self._next = self._next, self._next + length
        self._fields.append((name, length))
        return first

    def add(
        self,
        name: str,
        future: Future = Future.NONE,
        *,
        register: str = "",
        port: str = "",
        bits: int | None = None,
        power_up: int = 0,
        timed: bool = False,
        other_chips: bool = False,
    ) -> int:
        """Add a slot whose bits are always known; return its number."""
        number = self.block(name, 1)
        self._rows.append(
            SlotFacts(
                name=name,
                number=number,
                future=future,
                register=register,
                port=port,
                bits=_bits(register, port) if bits is None else bits,
                power_up=power_up,
                timed=timed,
                other_chips=other_chips,
            )
        )
        return number

    def add_uncertain(
        self,
        name: str,
        *,
        register: str = "",
        port: str = "",
        bits: int | None = None,
        power_up: int = 0,
        timed: bool = False,
        merged: bool = False,
        undefined: int = 0,
        start: str = "",
        source: str = "",
    ) -> tuple[int, int]:
        """Add a slot whose bits may be unknown; return its number and that of the slot for these bits."""
        number = self.block(name, 1)
        self.block(f"{name}_UNKNOWN", 1)
        self._rows.append(
            SlotFacts(
                name=name,
                number=number,
                future=Future.VALUE,
                register=register,
                port=port,
                bits=_bits(register, port) if bits is None else bits,
                power_up=power_up,
                timed=timed,
                merged=merged,
                unknown=number + 1,
                undefined=undefined,
                start=start,
                source=1 + max((row.source for row in self._rows), default=0) if source else 0,
                source_name=source,
            )
        )
        return number, number + 1


def _bits(register: str, port: str) -> int:
    """Return the bits that a register has in pic/device.py; all eight if none has a name there."""
    if port:
        return ALL_PINS
    names = registers()[register].bit_names() if register else ()
    return sum(1 << bit for bit, name in enumerate(names) if name) or 0xFF
