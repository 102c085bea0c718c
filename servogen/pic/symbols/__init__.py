"""The names, lines and variables that the makers' tools write beside a HEX.

In: the path of a HEX file and its image. Out: a `Listing` from the files of the same stem that fit its words,
the names of these files, and a warning for each file that is damaged or belongs to another program.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PureWindowsPath

from servogen.errors import Diagnostic, InputError, Location
from servogen.inputs import read_input
from servogen.pic.image import Image
from servogen.pic.listing import ListedFunction, Listing, ListingRow, routines
from servogen.pic.spelling import assembly_text, cycles_text
from servogen.pic.symbols.cod import read_cod
from servogen.pic.symbols.coff import read_coff
from servogen.pic.symbols.gpasm_lst import read_gpasm_lst
from servogen.pic.symbols.gplink_map import read_gplink_map
from servogen.pic.symbols.names import ProgramNames
from servogen.pic.symbols.xc8_cmf import read_xc8_cmf
from servogen.pic.symbols.xc8_elf import read_xc8_elf
from servogen.pic.symbols.xc8_sym import read_xc8_sym

SOURCE_SUFFIXES = (".c", ".h", ".asm", ".inc", ".s", ".as", ".src", ".lst")
OUTPUT_FOLDERS = frozenset(["production", "debug", "default", "dist", "build"])
"""Where MPLAB X writes a HEX: the sources are above these folders."""


@dataclass(frozen=True, slots=True)
class Beside:
    """What the files beside a HEX say."""

    listing: Listing | None = None
    """None if no file beside it fits."""
    files: tuple[str, ...] = ()
    warnings: tuple[Diagnostic, ...] = ()


def names_beside(path: Path, image: Image) -> Beside:
    """Return what the files beside a HEX file say of its program. Errors in them become warnings."""
    known, files, warnings = [], [], []
    for suffix, read in READERS.items():
        if (file := _existing(path, suffix)) is None:
            continue
        try:
            names = read(read_input(file), str(file))
        except InputError as error:
            warnings += [_warning(each) for each in error.diagnostics]
            continue
        if names is None:
            continue
        if (other := _difference(names.words, image)) is None:
            known.append(names)
            files.append(file.name)
        else:
            text = f"is of another program than {path.name}: {other}"
            hint = "the program is used without it; build both again"
            warnings.append(Diagnostic("warning", "names-other-program", text, Location(str(file)), hint))
    listing = _listing(known, image, path.parent) if known else None
    return Beside(listing, tuple(files), tuple(warnings))


def _text(read: Callable[[str, str], ProgramNames | None]) -> Callable[[bytes, str], ProgramNames | None]:
    return lambda raw, file: read(raw.decode("latin-1"), file)


READERS: Mapping[str, Callable[[bytes, str], ProgramNames | None]] = {
    ".elf": read_xc8_elf,
    ".cof": read_coff,
    ".cmf": _text(read_xc8_cmf),
    ".sym": _text(read_xc8_sym),
    ".map": _text(read_gplink_map),
    ".cod": read_cod,
    ".lst": _text(read_gpasm_lst),
}
"""The readers, by the suffix of their files; None from a file of another tool. The first that gives a size or
lines is believed.
"""


def _existing(path: Path, suffix: str) -> Path | None:
    """Return the file of the same stem, whose suffix may be in capitals, as old tools write it."""
    files = (path.with_suffix(suffix), path.with_suffix(suffix.upper()))
    return next((file for file in files if file.is_file()), None)


def _warning(error: Diagnostic) -> Diagnostic:
    hint = error.hint or "the program is used without it"
    return Diagnostic("warning", error.code, error.message, error.location, hint)


def _difference(words: Mapping[int, int | None], image: Image) -> str | None:
    """Return the first difference between the words of a file and those of the HEX; None without one."""
    for address in sorted(set(words) | set(image.program)):
        said, is_said = words.get(address), address in words
        word = image.program.get(address)
        if word is None:
            return f"it has a word at 0x{address:03X}, where the HEX has none"
        if is_said and said is not None and said != word:
            return f"word 0x{address:03X} is 0x{said:04X} there and 0x{word:04X} in the HEX"
        if not is_said and word:
            return f"it has no word at 0x{address:03X}, where the HEX has 0x{word:04X}"
    return None


def _listing(known: Sequence[ProgramNames], image: Image, folder: Path) -> Listing:
    """Return one listing of what several files say of the same words."""
    labels = {label for names in known for label in names.labels}
    prefix = "_" if any(name == "_main" for name, _ in labels) else ""
    sizes: dict[tuple[int, str], int] = {}
    for address, name, size in (each for names in known for each in names.variables):
        sizes.setdefault((address, name), size)
    places, sources = _sources(next((names.lines for names in known if names.lines), {}), folder)
    rows = tuple(_rows(image, places))
    placed = sorted(((name.removeprefix(prefix), at) for name, at in labels), key=lambda each: each[::-1])
    stated = next((names.functions for names in known if names.functions), ())
    return Listing(
        rows,
        tuple(ListedFunction(name.removeprefix(prefix), start, end) for name, start, end in stated)
        or routines(rows, {at: name for name, at in reversed(placed)}),
        tuple((at, name.removeprefix(prefix), size) for (at, name), size in sorted(sizes.items())),
        sources,
        tuple(placed),
    )


def _rows(image: Image, places: Mapping[int, tuple[str, int]]) -> Iterator[ListingRow]:
    """Yield a row for each word. A line goes on until the next one begins, or to a gap in the program."""
    place: tuple[str | None, int | None] = (None, None)
    last = -1
    for address, word in image.program.items():
        if address != last + 1:
            place = (None, None)
        place = places.get(address, place)
        last = address
        yield ListingRow(address, word, assembly_text(word), cycles_text(word), *place)


def _sources(
    lines: Mapping[int, tuple[str, int]], folder: Path
) -> tuple[dict[int, tuple[str, int]], tuple[tuple[str, str], ...]]:
    """Return the lines with the paths of the source files that are found, and the texts of these."""
    paths: dict[str, str] = {}
    texts = []
    for name in sorted({name for name, _ in lines.values()}):
        file = _source(PureWindowsPath(name), folder)
        paths[name] = PureWindowsPath(name).name if file is None else str(file)
        if file is not None:
            with suppress(InputError):  # otherwise it has its lines by number only
                texts.append((str(file), read_input(file).decode("latin-1")))
    return {at: (paths[name], line) for at, (name, line) in lines.items()}, tuple(texts)


def _source(name: PureWindowsPath, folder: Path) -> Path | None:
    """Return the source file: beside the HEX, or above the folders that MPLAB X writes it to."""
    if name.suffix.lower() not in SOURCE_SUFFIXES:
        return None
    while True:
        for path in (folder.joinpath(*name.parts), folder / name.name):
            inside = not name.is_absolute() and not name.root and ".." not in name.parts
            if (inside or path == folder / name.name) and path.is_file():
                return path
        if folder.resolve().name not in OUTPUT_FOLDERS:
            return None
        folder = folder.resolve().parent
