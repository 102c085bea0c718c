"""Files that hold programs and schedules: HEX, C or assembly -> `Program`, JSON -> `PulseSchedule`.

In: a path. Out: the program, compiled in a process of its own with limits; InputError names the file.
The compiler and the assembler are imported where they are called: reading a HEX file does not load them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from servogen.errors import Diagnostic, InputError, Location, ToolError
from servogen.inputs import MAX_TEXT_BYTES, read_input
from servogen.isolation import COMPILING, LimitExceeded, ProcessDied, WorkLimits, run
from servogen.notebooks import table_html
from servogen.pic.device import DEVICES, Device, device
from servogen.units import Clock, counted

if TYPE_CHECKING:
    from servogen.grade import Submission
    from servogen.pic.image import Image
    from servogen.pic.listing import Listing
    from servogen.pulse import PulseSchedule

T = TypeVar("T")

DEFAULT_CLOCK_HZ = 4_000_000
DEFAULT_DEVICE = "PIC16F84"
FASTER_DEVICE = "PIC16F84A"
"""The chip of a program whose clock is too fast for the default one."""

LIMITS_HINT = "servogen compile and servogen assemble take --timeout and --memory-mb"

C_SUFFIX = ".c"
ASSEMBLY_SUFFIXES = (".asm", ".s", ".src")
HEX_SUFFIXES = (".hex", ".ihx", ".h8", ".obj")
JOB_SUFFIX = ".toml"
MAX_SCHEDULE_BYTES = 16 << 20
"""The maximum size of a schedule: an hour of frames that all differ, for two servos."""

PROGRAM_SUFFIXES = (C_SUFFIX, *ASSEMBLY_SUFFIXES, *HEX_SUFFIXES)

BUILT_PROGRAM, BUILT_SCHEDULE = "main.hex", "schedule.json"
"""Names in the folder that `servogen build` writes."""
PAIR_FOLDERS = ("chip1", "chip2")
"""The folders of the two builds in the folder of a job of two chips."""

Included = Callable[[str, str], Path | None]
"""(name, including file) -> the included file; None if there is none. Raises InputError."""


@dataclass(frozen=True)
class Program:
    """A program to run; one from a HEX file has a listing if a file beside it has its names, and only C can
    state the clock.
    """

    image: Image
    listing: Listing | None = None
    clock: Clock | None = None
    remarks: tuple[Diagnostic, ...] = ()
    """Warnings about a HEX file that can be read nevertheless, and about the files beside it."""
    warnings: tuple[Diagnostic, ...] = ()
    """The warnings of the compiler or the assembler."""
    device: str | None = None
    """The chip that it was built for, where a job or the schedule of a build says it, or where its C (by a
    header or its clock) or its assembly (`list p=16f84a`) asks for another one than the default.
    """
    names: tuple[str, ...] = ()
    """The files beside a HEX file that its names and lines are from."""

    def __repr__(self) -> str:
        clock = f" at {self.clock.hz / 1e6:g} MHz" if self.clock else ""
        names = f" with names from {' and '.join(self.names)}" if self.names else ""
        return f"<Program of {counted(self.image.words, 'word')}{clock}{names}>"

    def _repr_html_(self) -> str:
        functions = self.listing.functions if self.listing else ()
        rows = [
            (function.name, f"0x{function.start:03X}", function.end - function.start)
            for function in functions
        ]
        return table_html(repr(self).strip("<>"), ("function", "address", "words"), rows)


def is_job(path: Path) -> bool:
    """Return whether a path is that of a job file, whose program `workflows.job_program` builds."""
    return path.suffix.lower() == JOB_SUFFIX and not path.is_dir()


def read_source(path: Path, limit: int = MAX_TEXT_BYTES) -> str:
    """Return the contents of a text file, read as Latin-1 if it is not UTF-8. Raises InputError."""
    raw = read_input(path, limit)
    _refuse_utf16(raw, path)
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def read_assembly(path: Path) -> str:
    """Return an assembly file's text, one character per byte as in old assemblers. Raises InputError."""
    raw = read_input(path)
    _refuse_utf16(raw, path)
    return raw.decode("latin-1")


def _refuse_utf16(raw: bytes, path: Path) -> None:
    """Raise InputError for UTF-16, which has a mark, or a zero in every second byte."""
    start = raw[:256]
    zeros = [start[first::2].count(0) for first in (0, 1)]
    if start[:2] in (b"\xff\xfe", b"\xfe\xff") or (len(start) > 3 and max(zeros) > len(start) // 3):
        raise InputError("not-utf8", "is UTF-16 text", Location(str(path)), "save the file as UTF-8")


def is_built_pair(path: Path) -> bool:
    """Return whether `path` is the folder of a job of two chips that was built."""
    return all((path / name / BUILT_SCHEDULE).is_file() for name in PAIR_FOLDERS)


def one_build(path: Path) -> Path:
    """Return the folder of a build. Raises InputError for that of two chips."""
    if is_built_pair(path):
        parts = " or ".join(str(path / name) for name in PAIR_FOLDERS)
        raise InputError("chip-pair", "is the build of two chips", Location(str(path)), f"name one: {parts}")
    return path


def program_file(path: Path) -> Path:
    """Return the file with the program: in a folder that `servogen build` wrote, its main.hex.

    Raises InputError for another folder.
    """
    if not path.is_dir():
        return path
    one_build(path)
    file = path / BUILT_PROGRAM
    if not file.is_file():
        problem = f"is a folder without a {BUILT_PROGRAM}"
        raise InputError("no-program", problem, Location(str(path)), "servogen build writes one")
    return file


def read_program(path: Path, device_name: str | None = None) -> Program:
    """Return the program in a HEX file, in a C or assembly file, compiled within limits, or in the folder of
    a build, which has the clock and the chip of the schedule beside it. Raises InputError.
    """
    if path.is_dir():
        program = read_program(program_file(path), device_name)
        if not (path / BUILT_SCHEDULE).is_file():
            return program
        schedule = read_schedule(path / BUILT_SCHEDULE)
        return replace(program, clock=schedule.clock, device=schedule.device)
    if path.suffix.lower() not in (C_SUFFIX, *ASSEMBLY_SUFFIXES):
        return compile_program(path, device_name)
    return within_limits(lambda: compile_program(path, device_name), path)


def within_limits(
    work: Callable[[], T],
    file: Path,
    limits: WorkLimits = COMPILING,
    hint: str = LIMITS_HINT,
) -> T:
    """Return what `work`, which compiles `file`, returns. Raises InputError if it exceeds the limits."""
    try:
        return run(work, limits)
    except LimitExceeded as error:
        raise InputError("compile-failed", f"compiling it {error}", Location(str(file)), hint) from error
    except ProcessDied as error:
        raise ToolError(
            "compile-failed",
            f"servogen failed while compiling it: {error}",
            Location(str(file)),
            "please report this file",
        ) from error


def compile_program(path: Path, device_name: str | None = None, included: Included | None = None) -> Program:
    """Return the program in a HEX, C or assembly file; that of a HEX has the names that files beside it give.

    `included` finds the include files of a student. The device defaults to the one that the source names,
    else to the PIC16F84. Time and memory are not limited here: see `read_program`. Raises InputError.
    """
    if path.suffix.lower() == C_SUFFIX:
        from servogen.compiler import Options, Source, compile_sources

        text = read_source(path)
        include = beside_c if included is None else _c_includes(included)
        names = included_names([(str(path), text)], include)
        chip, faster = devices_of(device_name, names)
        options = Options(dialect=dialect_of(names), device=chip, faster_device=faster, include=include)
        compilation = compile_sources([Source(text, str(path))], options)
        return Program(
            compilation.image,
            compilation.listing,
            compilation.clock,
            warnings=compilation.diagnostics,
            device=_unusual(compilation.device),
        )
    if path.suffix.lower() in ASSEMBLY_SUFFIXES:
        from servogen.pic.assembler import assemble, beside

        files = beside(path.parent) if included is None else _assembly_includes(included, path)
        named = device(device_name) if device_name else None
        assembly = assemble(read_assembly(path), str(path), named, files)
        built_for = _unusual(assembly.device)
        return Program(assembly.image, assembly.listing, warnings=assembly.warnings, device=built_for)
    from servogen.pic.image import read_hex

    file = read_hex(read_source(path), str(path))
    if included is not None:  # a student's: only the file itself
        return Program(file.image, remarks=file.remarks)
    from servogen.pic.symbols import names_beside

    found = names_beside(path, file.image)
    return Program(file.image, found.listing, remarks=(*file.remarks, *found.warnings), names=found.files)


def _unusual(built_for: Device) -> str | None:
    """Return the name of a chip other than the default that can be simulated."""
    return built_for.name if built_for in DEVICES and built_for.name != DEFAULT_DEVICE else None


def chip_of(program: Program | None, device_name: str | None) -> str:
    """Return the requested chip, else the one that the program was built for, else the default."""
    return device_name or (program.device if program else None) or DEFAULT_DEVICE


def read_submission(submission: Submission) -> Program:
    """Return a student's program, which can include only the student's own files. Raises InputError.

    The caller limits time and memory.
    """
    in_any_case = submission.file.suffix.lower() in ASSEMBLY_SUFFIXES
    return compile_program(submission.file, included=partial(submission.included, in_any_case=in_any_case))


def _c_includes(included: Included) -> CInclude:
    def read(name: str, including: str) -> tuple[str, str] | None:
        path = included(name, including)
        return None if path is None else (str(path), read_source(path))

    return read


def _assembly_includes(included: Included, source: Path) -> Callable[[str], str | None]:
    def read(name: str) -> str | None:
        path = included(name.replace("\\", "/"), str(source))
        return None if path is None else read_assembly(path)

    return read


def beside_c(name: str, including: str, folders: Sequence[Path] = ()) -> tuple[str, str] | None:
    """Return (file name, text) of an include file beside the file that includes it, else in the first of the
    folders that has it; None if it is missing.
    """
    for folder in (Path(including).parent, *folders):
        if (folder / name).is_file():
            return str(folder / name), read_source(folder / name)
    return None


XC8_HEADERS = frozenset(["xc.h", "pic.h", "htc.h", "builtins.h", "language_support.h", "xc8debug.h"])
SDCC_HEADERS = frozenset(["pic16f84.h", "pic16f84a.h", "pic14regs.h", "pic16regs.h"])
"""The headers that identify a dialect, besides the folder `pic14/`; XC8 if a source has both."""
DEVICE_HEADERS = {"pic16f84.h": "PIC16F84", "pic16f84a.h": "PIC16F84A", "p16f84a.h": "PIC16F84A"}
MAX_HEADERS = 200
"""The maximum number of the program's own headers that are searched."""
_XC8_WORD = re.compile(r"^[ \t]*#[ \t]*pragma[ \t]+config\b|\b__delay_[mu]s\b", re.MULTILINE)
_OWN_DELAY = re.compile(r"\b(?:void|define)\s+__delay_[mu]s\b")
_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
_INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*[<"]([^>"\n]+)[>"]', re.MULTILINE)

CInclude = Callable[[str, str], tuple[str, str] | None]
"""(name, including file) -> the file's name and text; None where there is none."""


def included_names(sources: Iterable[tuple[str, str]], include: CInclude) -> set[str]:
    """Return the names of all headers that sources, as (file, text), include directly or through their own
    headers. One with `#pragma config` or `__delay_us`, which only XC8 has, counts as including <xc.h>.
    """
    names: set[str] = set()
    waiting = list(sources)
    seen: set[str] = set()
    while waiting and len(seen) < MAX_HEADERS:
        file, text = waiting.pop()
        seen.add(file)
        code = _COMMENT.sub(" ", text)
        if _XC8_WORD.search(code) and not _OWN_DELAY.search(code):
            names.add("xc.h")
        for name in _INCLUDE.findall(text):
            names.add(name.lower())
            try:
                own = None if is_system_header(name) else include(name, file)
            except InputError:
                own = None  # the compiler reports it, with its place
            if own is not None and own[0] not in seen:
                waiting.append(own)
    return names


def is_system_header(name: str) -> bool:
    return name.lower().rpartition("/")[2] in XC8_HEADERS | SDCC_HEADERS


def dialect_of(names: set[str]) -> str:
    """Return the dialect that the names of headers belong to: XC8, SDCC, else C2C."""
    if names & XC8_HEADERS:
        return "xc8"
    if names & SDCC_HEADERS or any(name.startswith("pic14/") for name in names):
        return "sdcc"
    return "c2c"


def device_of(names: set[str]) -> str | None:
    """Return the chip that the names of headers imply; None if they imply none."""
    devices = [
        DEVICE_HEADERS[header] for name in names if (header := name.rpartition("/")[2]) in DEVICE_HEADERS
    ]
    return max(devices, default=None)


def devices_of(asked: str | None, names: set[str]) -> tuple[Device, Device | None]:
    """Return the chip that is requested or implied by the names of headers; without either, the default chip
    and the one to use instead if the program's clock is too fast for it. Raises InputError.
    """
    name = asked or device_of(names)
    if name is not None:
        return device(name), None
    return device(DEFAULT_DEVICE), device(FASTER_DEVICE)


def clock_of(program: Program | None, clock_hz: int | None = None) -> Clock:
    """Return the requested clock, else that of the program's C, else 4 MHz. Raises InputError."""
    if clock_hz is not None:
        if not isinstance(clock_hz, int) or clock_hz < 1:
            raise InputError("wrong-clock", f"clock_hz = {clock_hz!r} is not a whole number of at least 1")
        return Clock(clock_hz)
    return program.clock if program and program.clock else Clock(DEFAULT_CLOCK_HZ)


def read_schedule(path: Path) -> PulseSchedule:
    """Return the schedule in a schedule.json, with the tape beside it. Raises InputError."""
    from servogen.pulse import from_json
    from servogen.pulse.schedule import TAPE_FILE

    schedule = from_json(read_source(path, MAX_SCHEDULE_BYTES), str(path))
    if schedule.tape is None:
        return schedule
    content = read_input(path.with_name(TAPE_FILE))
    return replace(schedule, tape=replace(schedule.tape, content=content))


def pair_texts(folder: Path) -> tuple[bytes, bytes]:
    """Return the contents of the schedules of a built pair. Raises InputError."""
    first, second = (read_input(folder / name / BUILT_SCHEDULE, MAX_SCHEDULE_BYTES) for name in PAIR_FOLDERS)
    return first, second


def read_pair(folder: Path) -> tuple[tuple[PulseSchedule, PulseSchedule], tuple[Image, Image]]:
    """Return the schedules and the programs of a built pair. Raises InputError."""
    parts = [folder / name for name in PAIR_FOLDERS]
    first, second = (read_schedule(part / BUILT_SCHEDULE) for part in parts)
    images = [read_program(part / BUILT_PROGRAM).image for part in parts]
    if second.wire is None or first.period != second.period:
        raise InputError("chip-pair", "chip2 does not follow chip1: build both again", Location(str(folder)))
    return (first, second), (images[0], images[1])
