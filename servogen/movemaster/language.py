"""The arm command language as one table: mnemonic, parameters with their ranges, where it is allowed,
meaning.

Out: `COMMANDS`. Parser, interpreter and documentation take everything from these rows.

Source of a row: its number in the table of robot theory (000), or "manufacturer" for the Movemaster EX
commands that the table's gap (18–34) and its end leave out and that a program needs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from functools import cache
from types import MappingProxyType

POSITIONS = (1, 629)
LINES = (1, 2048)
COUNTERS = (1, 99)
WORD = (-32767, 32767)
PALLETS = (1, 9)
"""The ranges of position numbers, line numbers, counter numbers, values and pallet numbers (the source's)."""

MAX_DEPTH = 9
"""Loops within loops, and subroutines within subroutines (the manufacturer's limit)."""

MAX_MM = 9999.9
"""Coordinates and angles have four digits before the point (the manufacturer's display)."""


class ArgumentKind(Enum):
    """The notation of an argument."""

    WHOLE = "a whole number"
    DECIMAL = "a number"
    BIT = "a bit with its sign"
    HAND = "O or C"


class Where(Enum):
    """Where a command is allowed: on a numbered line, on an unnumbered (direct) one, or on both."""

    BOTH = "everywhere"
    PROGRAM = "in a program only"
    DIRECT = "not in a program"


@dataclass(frozen=True, slots=True)
class Parameter:
    """One argument: `low` to `high`; `hexadecimal` also allows &-numbers; `optional` may be omitted at the
    end.

    `blank` is the value of an empty place between two commas; None if it must be given.
    """

    name: str
    kind: ArgumentKind
    low: float = 0
    high: float = 0
    hexadecimal: bool = False
    optional: bool = False
    blank: float | None = None

    @property
    def allowed(self) -> str:
        """Return the range in the wording of an error message."""
        if self.kind is ArgumentKind.HAND:
            return "O (hand open) or C (hand closed)"
        if self.kind is ArgumentKind.BIT:
            return f"+{self.low:g} to +{self.high:g} (bit on) or -{self.low:g} to -{self.high:g} (bit off)"
        text = f"{self.low:g} to {self.high:g}"
        if not self.hexadecimal:
            return text
        return text + (" or &8001 to &7FFF" if self.low < 0 else f" or &0 to &{int(self.high):X}")


@dataclass(frozen=True, slots=True)
class Command:
    """A row of the language. `number` is the row in the source's table; None: the manufacturer's manual."""

    mnemonic: str
    parameters: tuple[Parameter, ...]
    where: Where
    meaning: str
    number: int | None = None

    @property
    def form(self) -> str:
        """Return the notation of the command: "MO a [, O/C]"."""
        text = ""
        for index, parameter in enumerate(self.parameters):
            name = "O/C" if parameter.kind is ArgumentKind.HAND else parameter.name
            comma = ", " if index else ""
            text += f" [{comma}{name}]" if parameter.optional else f"{comma or ' '}{name}"
        return self.mnemonic + text

    @property
    def min_arguments(self) -> int:
        """Return the number of arguments that must be given."""
        return sum(not parameter.optional for parameter in self.parameters)


def _whole(name: str, span: tuple[int, int], hexadecimal: bool = False) -> Parameter:
    return Parameter(name, ArgumentKind.WHOLE, *span, hexadecimal=hexadecimal)


def _optional(name: str, span: tuple[int, int]) -> Parameter:
    return Parameter(name, ArgumentKind.WHOLE, *span, optional=True)


def _decimals(names: str) -> tuple[Parameter, ...]:
    return tuple(Parameter(name, ArgumentKind.DECIMAL, -MAX_MM, MAX_MM, blank=0.0) for name in names.split())


_HAND = Parameter("hand", ArgumentKind.HAND, optional=True)
_POSITION = _whole("a", POSITIONS)
_TWO_POSITIONS = (_whole("a1", POSITIONS), _whole("a2", POSITIONS))
_POSE = _decimals("x y z p r")
_LINE = _whole("a", LINES)
_COUNTER = _whole("a", COUNTERS)
_COMPARED = (_whole("a1", WORD, hexadecimal=True), _whole("a2", LINES))
_PORT = _whole("a", (0, 255), hexadecimal=True)
_BIT = Parameter("a", ArgumentKind.BIT, 0, 7)
_BOTH, _PROGRAM, _DIRECT = Where.BOTH, Where.PROGRAM, Where.DIRECT

_ROWS = (
    Command("DP", (), _BOTH, "go to the next lower defined position number", 1),
    Command("DW", _decimals("x y z"), _BOTH, "move the hand by x, y, z mm", 2),
    Command("HE", (_POSITION,), _BOTH, "store the current pose and hand state as position a", 3),
    Command("HO", (), _BOTH, "take the current pose as the reference position", 4),
    Command("IP", (), _BOTH, "go to the next higher defined position number", 5),
    Command(
        "MA", (*_TWO_POSITIONS, _HAND), _BOTH, "go to position a1 displaced by the increments stored in a2", 6
    ),
    Command("MC", _TWO_POSITIONS, _BOTH, "go through the positions a1 to a2 without stopping", 7),
    Command("MJ", _decimals("w s e p r"), _DIRECT, "turn each joint by the given degrees", 8),
    Command("MO", (_POSITION, _HAND), _BOTH, "go to position a", 9),
    Command("MP", _POSE, _DIRECT, "go to a pose given in mm and degrees", 10),
    Command(
        "MS",
        (_POSITION, _whole("n", (1, 99)), _HAND),
        _BOTH,
        "go to position a on a straight line through n intermediate points",
        11,
    ),
    Command(
        "MT",
        (_POSITION, Parameter("b", ArgumentKind.DECIMAL, -3276.7, 3276.7), _HAND),
        _BOTH,
        "go to the point b mm from position a along the tool",
        12,
    ),
    Command("NT", (), _BOTH, "return to the mechanical origin, the robot's home", 13),
    Command("OG", (), _BOTH, "go to the reference position", 14),
    Command(
        "PA",
        (_whole("i", PALLETS), _whole("j", (1, 255)), _whole("k", (1, 255))),
        _BOTH,
        "pallet i has j columns and k rows",
        15,
    ),
    Command(
        "PC", (_whole("a1", (0, 629)), _optional("a2", POSITIONS)), _DIRECT, "clear positions; PC 0: all", 16
    ),
    Command("PD", (_POSITION, *_POSE), _DIRECT, "define position a", 17),
    Command("PL", _TWO_POSITIONS, _BOTH, "copy position a2 to position a1"),
    Command("PT", (_whole("a", PALLETS),), _BOTH, "make position a the grid point of pallet a"),
    Command("PX", _TWO_POSITIONS, _BOTH, "exchange the positions a1 and a2"),
    Command("SF", _TWO_POSITIONS, _BOTH, "add the coordinates of position a2 to position a1"),
    Command("SP", (_whole("n", (0, 9)),), _BOTH, "speed: (n + 1) tenths of the joints' top speeds"),
    Command("TI", (_whole("n", (0, 32767)),), _BOTH, "wait n tenths of a second"),
    Command("TL", (Parameter("n", ArgumentKind.DECIMAL, 0, 300),), _BOTH, "length of the tool in mm"),
    Command("CP", (_COUNTER,), _BOTH, "take counter a as the comparison value"),
    Command("DC", (_COUNTER,), _BOTH, "decrement counter a"),
    Command("ED", (), _PROGRAM, "end of the program"),
    Command("EQ", _COMPARED, _PROGRAM, "jump to line a2 if the comparison value is a1"),
    Command("GS", (_LINE,), _PROGRAM, "call the subroutine at line a"),
    Command("GT", (_LINE,), _PROGRAM, "continue at line a"),
    Command("IC", (_COUNTER,), _BOTH, "increment counter a"),
    Command("LG", _COMPARED, _PROGRAM, "jump to line a2 if the comparison value is larger than a1", 35),
    Command("NE", _COMPARED, _PROGRAM, "jump to line a2 if the comparison value is not a1", 36),
    Command("NW", (), _DIRECT, "delete program and positions", 37),
    Command("NX", (), _PROGRAM, "end of the loop that RC opened", 38),
    Command("RC", (_whole("a", (1, 32767)),), _PROGRAM, "run the lines up to NX a times", 39),
    Command(
        "RN",
        (_whole("a1", LINES), _optional("a2", LINES)),
        _DIRECT,
        "run the program from line a1 up to, not including, a2",
        40,
    ),
    Command("RT", (), _PROGRAM, "return from a subroutine", 41),
    Command("SC", (_COUNTER, _optional("a2", WORD)), _BOTH, "set counter a to a2, or to 0", 42),
    Command("SM", _COMPARED, _PROGRAM, "jump to line a2 if the comparison value is smaller than a1", 43),
    Command("GC", (), _BOTH, "close the hand", 44),
    Command("GF", (_whole("a", (0, 1)),), _BOTH, "the hand state that PD stores: 0 open, 1 closed", 45),
    Command("GO", (), _BOTH, "open the hand", 46),
    Command(
        "GP",
        (_whole("a1", (0, 15)), _whole("a2", (0, 15)), _whole("a3", (0, 99))),
        _BOTH,
        "grip force, holding force, and the tenths of a second that the hand takes",
        47,
    ),
    Command("ID", (), _BOTH, "read the input port immediately as the comparison value", 48),
    Command("IN", (), _BOTH, "wait for the input port's next strobe and read it", 49),
    Command("OB", (_BIT,), _BOTH, "set (+) or clear (-) one bit of the output port"),
    Command("OD", (_PORT,), _BOTH, "write the output port immediately"),
    Command("OT", (_PORT,), _BOTH, "write the output port with a strobe"),
    Command("TB", (_BIT, _whole("a2", LINES)), _PROGRAM, "jump to line a2 if a bit is on (+) or off (-)"),
    Command("RS", (), _DIRECT, "reset: an error would be cleared; there is none to clear here"),
)

COMMANDS: Mapping[str, Command] = MappingProxyType({row.mnemonic: row for row in _ROWS})
"""The language by mnemonic, in the order of the source's table and then the manufacturer's."""

NOT_HERE: Mapping[str, str] = MappingProxyType(
    {
        "CR": "it reads a counter over the serial line",
        "DA": "it ends an interrupt by an input bit: test the bit with ID and TB",
        "DL": "it deletes program lines: omit them from the file",
        "DR": "it reads the input port over the serial line",
        "EA": "it arms an interrupt by an input bit: test the bit with ID and TB",
        "ER": "it reads the error state over the serial line",
        "LR": "it reads program lines over the serial line",
        "PR": "it reads a position over the serial line",
        "TR": "it copies an EPROM",
        "WH": "it reads the current pose over the serial line",
        "WR": "it writes an EPROM",
    }
)
"""Commands of the manufacturer's controller for its terminal, its EPROM and its interrupts."""

MISPRINTS: Mapping[str, str] = MappingProxyType({"RV": "RN", "52": "RT"})
"""What the source's table prints for the mnemonic of rows 40 and 41."""


@cache
def by_initial(letter: str) -> tuple[str, ...]:
    """Return the mnemonics that start with a letter, sorted."""
    return tuple(sorted(name for name in COMMANDS if name.startswith(letter.upper())))
