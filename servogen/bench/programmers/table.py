"""The programmers of a PIC16F84 as a table: how each is called, how it tells success from failure, and how
the chip is read back.

Sources: picpro 0.3.0, run and read (it exits 0 on most failures); the published return codes of PK2CMD and
the success line of IPECMD. No documentation was found of IPECMD failing, or of what usbpicprog and picprog
print: their patterns are assumptions, and whatever does not match them is a failure.
"""

from __future__ import annotations

import importlib.util
import re
import shutil
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import ne
from pathlib import Path

from servogen.errors import InputError, ToolError, did_you_mean
from servogen.pic.device import EEPROM_BYTES, Device
from servogen.pic.image import Image, from_hex
from servogen.pic.isa import WORD_MASK

PROGRAM, EEPROM, CONFIG = "program memory", "data EEPROM", "configuration word"
ERASED_BYTE = 0xFF

Contents = Mapping[str, Sequence[int]]
"""All words or bytes of each memory that was read, from address 0."""


@dataclass(frozen=True, slots=True)
class ReadMethod:
    """One way to read: `arguments` for the programmer's program, and the contents of the file that it
    writes. Raises ValueError for a file that it did not write so.
    """

    arguments: tuple[str, ...]
    contents: Callable[[Path, Image], Contents]
    of_protected: bool = False
    """Whether code protection does not change what it reads."""
    of_eeprom: bool = False
    """Whether it reads the data EEPROM."""


def wanted(image: Image) -> Contents:
    """Return the contents of a chip programmed with `image`."""
    contents: dict[str, Sequence[int]] = {
        PROGRAM: image.flash(),
        EEPROM: [image.eeprom.get(address, ERASED_BYTE) for address in range(EEPROM_BYTES)],
    }
    if image.config is not None:
        contents[CONFIG] = [image.config & WORD_MASK]
    return contents


def difference(read: Contents, image: Image) -> str | None:
    """Return where `read` first differs from `image`, in words; None if it does not."""
    for memory, right in wanted(image).items():
        for address, (word, got) in enumerate(zip(right, read.get(memory, right), strict=True)):
            if word != got:
                place = "" if memory == CONFIG else f" at address 0x{address:03X}"
                digits = 2 if memory == EEPROM else 4
                return f"in the {memory}{place}: 0x{got:0{digits}X} where the file has 0x{word:0{digits}X}"
    return None


def program_of(file: Path, image: Image) -> Contents:
    """Return the contents of a HEX file of the program memory alone."""
    return {PROGRAM: _image(file).flash()}


def whole_of(file: Path, image: Image) -> Contents:
    """Return the contents of a HEX file of all memories; missing parts were not read."""
    read = _image(file)
    contents = wanted(read)
    return contents if read.eeprom else {name: words for name, words in contents.items() if name != EEPROM}


def picpro_eeprom(file: Path, image: Image) -> Contents:
    """Return picpro's bytes from address 0. Version 0.3.0 swaps the bytes of each pair, so the order in which
    fewer bytes differ is used.
    """
    data, right = _bytes(file), wanted(image)[EEPROM]
    if len(data) != EEPROM_BYTES:
        raise ValueError(f"{len(data)} bytes of data EEPROM instead of {EEPROM_BYTES}")
    swapped = [byte for pair in zip(data[1::2], data[::2], strict=True) for byte in pair]
    return {EEPROM: min(swapped, data, key=lambda order: sum(map(ne, order, right)))}


def picpro_config(file: Path, image: Image) -> Contents:
    """Return the configuration word in a K150's answer, as `programmers.picpro` writes it: device ID, eight
    ID bytes, words, low byte first.
    """
    data = _bytes(file)
    if len(data) < _CONFIG_AT + 2:
        raise ValueError(f"{len(data)} bytes of configuration")
    return {CONFIG: [int.from_bytes(data[_CONFIG_AT : _CONFIG_AT + 2], "little") & WORD_MASK]}


_CONFIG_AT = 10


def _image(file: Path) -> Image:
    try:
        return from_hex(file.read_text(encoding="ascii"), str(file))
    except InputError as error:
        raise ValueError(error.message) from error


def _bytes(file: Path) -> list[int]:
    from intelhex import IntelHex, IntelHexError

    try:
        return list(IntelHex(str(file)).tobinarray())
    except IntelHexError as error:
        raise ValueError(str(error)) from error


@dataclass(frozen=True, slots=True)
class ProgrammingRequest:
    """What to program, and where; `file` is read from or written to."""

    file: Path
    device: Device
    port: str | None


@dataclass(frozen=True, slots=True)
class Failure:
    """A sentence for a pattern of the output (searched without regard to case) or an exit code."""

    sign: str | int
    sentence: str
    differs: bool = False
    """Whether the chip was programmed and does not hold what it should: exit code 1."""


@dataclass(frozen=True, slots=True)
class Programmer:
    """A programmer; it succeeded if the exit code is 0 and its output contains all `success_texts`."""

    name: str
    hardware: str
    program: Callable[[ProgrammingRequest], tuple[str, ...]]
    failures: tuple[Failure, ...]
    success_texts: tuple[str, ...] = ()
    needs_port: bool = False
    looks: Callable[[ProgrammingRequest], tuple[ReadMethod, ...]] = lambda order: ()
    """How it reads the chip back into HEX files."""
    verifies: bool = True
    """Whether success means that it compared the chip with the file."""
    executable: str | None = None
    """The program's name, if it is not the programmer's."""


_AWAY = "the programmer disappeared while it worked: the chip's contents are unknown, program it again"


def _dump(memory: str, order: ProgrammingRequest) -> tuple[str, ...]:
    """Return picpro's arguments for reading a memory."""
    return (
        *("dump", memory, "-p", str(order.port), "-o", str(order.file)),
        *("-t", order.device.short_name),
    )


PICPRO = Programmer(
    "picpro",
    "K128, K149, K150, K182 on a serial port (P18A)",
    lambda order: (
        *("program", "-p", str(order.port), "-i", str(order.file)),
        *("-t", order.device.short_name),
    ),
    (
        Failure("unable to open serial port", "picpro cannot open the port"),
        Failure(r"read failed|write failed|reports readiness|input/output error", _AWAY),
        Failure(
            r"invalid response received|unable to initialize connection",
            "no programmer that speaks P18A answers on the port: is it powered, is it the right port?",
        ),
        Failure("unable to find chip type", "picpro's chip data lacks the device"),
        Failure(r"chipdata\.cid was not found|unable to locate chip", "picpro's chip data is not installed"),
        Failure(
            r"out of range", "this picpro refuses a HEX file that fills the EEPROM: use version 0.3 or newer"
        ),
        Failure("erasure failed", "the chip could not be erased: is it in the socket, the right way round?"),
        Failure("(?<!eep)rom programming failed", "the program memory could not be programmed"),
        Failure("eeprom programming failed", "the data EEPROM could not be programmed"),
        Failure("fuses failed", "the configuration word could not be programmed"),
        Failure(
            "maybe rom is locked",
            "the program memory reads as zeros: the chip is code protected",
            differs=True,
        ),
        Failure("(?<!eep)rom verification failed", "the program memory differs from the file", differs=True),
        Failure("eeprom verification failed", "the data EEPROM differs from the file", differs=True),
        Failure("communication failure", "the programmer does not answer as it should"),
        Failure(r"chip detected(?![\s\S]*erasing)", "the programmer stopped before it erased the chip"),
    ),
    success_texts=("ROM verified.", "EEPROM verified."),
    needs_port=True,
    looks=lambda order: (
        ReadMethod(_dump("rom", order), program_of),
        ReadMethod(_dump("eeprom", order), picpro_eeprom, of_eeprom=True),
        ReadMethod(_dump("config", order), picpro_config, of_protected=True),
    ),
)

PK2CMD = Programmer(
    "pk2cmd",
    "PICkit 2",
    lambda order: (f"-P{order.device.name}", f"-F{order.file}", "-M", "-R", "-T"),
    (
        Failure(5, "wrong voltage at the chip: is it connected, is something else driving the supply?"),
        Failure(10, "no PICkit 2 is connected"),
        Failure(11, "the PICkit 2's firmware is too old for this pk2cmd"),
        Failure(24, "pk2cmd cannot find PK2DeviceFile.dat: put it beside pk2cmd"),
        Failure(36, "pk2cmd rejected one of its arguments"),
        Failure(37, "pk2cmd cannot read the HEX file"),
        Failure(39, "pk2cmd found no known chip"),
        Failure(34, "programming or its verification failed", differs=True),
        Failure(7, "the operation failed"),
    ),
    looks=lambda order: (
        ReadMethod((f"-P{order.device.name}", f"-GF{order.file}", "-R", "-T"), whole_of, of_eeprom=True),
    ),
)

IPECMD = Programmer(
    "ipecmd",
    "PICkit 4",
    lambda order: ("-TPPK4", f"-P{order.device.short_name}", f"-F{order.file}", "-M", "-OL"),
    (
        Failure(r"no .*tool|could not connect to tool|programmer not found", "no PICkit 4 is connected"),
        Failure(
            r"target device id .*does not match|invalid device id|target device was not found",
            "another chip, or none, is in the socket",
        ),
        Failure(r"verif\w* failed|failed to verify", "the chip differs from the file", differs=True),
        Failure(r"failed to program|programming failed", "programming failed"),
    ),
    success_texts=("Program Succeeded.",),
)

PICKIT3 = replace(
    IPECMD,
    name="pickit3",
    hardware="PICkit 3",
    executable="ipecmd",
    program=lambda order: ("-TPPK3", *IPECMD.program(order)[1:]),
)

USBPICPROG = Programmer(
    "usbpicprog",
    "usbpicprog",
    lambda order: (f"-p={order.device.short_name}", "-e", "-w", "-v", f"-f={order.file}"),
    (
        Failure(r"not (found|detected|connected)|no programmer", "no usbpicprog is connected"),
        Failure(r"verif\w* .*(fail|error)|differ", "the chip differs from the file", differs=True),
        Failure(r"fail|error|unable|cannot", "usbpicprog failed"),
    ),
    verifies=False,
)

PICPROG = Programmer(
    "picprog",
    "JDM on a serial port",
    lambda order: (
        *(f"--device=pic{order.device.short_name.lower()}", f"--pic-serial-port={order.port}"),
        *(f"--input-hexfile={order.file}", "--erase", "--burn"),
    ),
    (
        Failure(64, "picprog rejected one of its arguments"),
        Failure(65, "picprog cannot read the HEX file"),
        Failure(66, "picprog cannot open the HEX file"),
        Failure(69, "no JDM programmer answers on the port"),
        Failure(74, _AWAY),
        Failure(77, "picprog has no permission to use the port"),
        Failure(r"verif\w* .*(fail|error)|verify error", "the chip differs from the file", differs=True),
    ),
    needs_port=True,
)

PROGRAMMERS = (PICPRO, PK2CMD, IPECMD, PICKIT3, USBPICPROG, PICPROG)


@dataclass(frozen=True, slots=True)
class InstalledProgrammer:
    """A programmer and how its program is started."""

    programmer: Programmer
    start: tuple[str, ...]


def find(named: str | None) -> InstalledProgrammer:
    """Return the programmer with a name or the path of its program; by default the first that is installed.

    A picpro of its own Python cannot read the configuration word back: its `dump config` fails (0.3.0).
    Raises InputError for one that is not in the table, ToolError if it is not installed.
    """
    if named is None:
        for programmer in PROGRAMMERS:
            start = _start(programmer, programmer.name)
            if start:
                return InstalledProgrammer(programmer, start)
        raise ToolError(
            "tool-missing",
            "no program for a programmer is installed",
            hint="one of: "
            + ", ".join(f"{programmer.name} ({programmer.hardware})" for programmer in PROGRAMMERS),
        )
    stem = Path(named).stem.lower()
    known = {programmer.name: programmer for programmer in PROGRAMMERS}
    if stem not in known:
        device = stem.upper()
        users = [each.name for each in PROGRAMMERS if device in re.findall(r"\w+", each.hardware.upper())]
        hint = f"a {device} is used by {', '.join(users)}" if users else did_you_mean(stem, known)
        raise InputError("unknown-name", f"'{named}' is not a known programmer", hint=hint)
    start = _start(known[stem], named)
    if not start:
        raise ToolError(
            "tool-missing", f"'{named}' is not installed", hint=f"it programs with {known[stem].hardware}"
        )
    programmer = known[stem]
    if programmer is PICPRO and start[0] != sys.executable:
        programmer = replace(programmer, looks=lambda order: PICPRO.looks(order)[:-1])
    return InstalledProgrammer(programmer, start)


def installed(programmer: Programmer) -> str | None:
    """Return what `find` would start for the programmer, as doctor shows it; None if it is not installed."""
    start = _start(programmer, programmer.name)
    if not start:
        return None
    return start[0] if len(start) == 1 else f"{programmer.name} of {start[0]}"


def _start(programmer: Programmer, named: str) -> tuple[str, ...]:
    if named == PICPRO.name and importlib.util.find_spec("picpro"):
        return (sys.executable, "-u", "-m", "servogen.bench.programmers.picpro")
    path = shutil.which(programmer.executable or named if named == programmer.name else named)
    return (path,) if path else ()
