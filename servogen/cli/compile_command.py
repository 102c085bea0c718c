"""`servogen compile`: C to Intel HEX."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.files import check_outputs, within_limits, write_program
from servogen.cli.options import Dialect, Json, MemoryLimit, Output, TimeLimit
from servogen.cli.show import as_json, next_step, warn_of_all
from servogen.compiler import Options, Source, compile_sources
from servogen.compiler.diagnostics import WARNINGS
from servogen.compiler.passes.manager import PASSES
from servogen.errors import InputError, Location, did_you_mean
from servogen.isolation import COMPILING, WorkLimits
from servogen.programs import beside_c, devices_of, dialect_of, included_names, read_source
from servogen.units import counted

ListingFile = Annotated[Path | None, "Write the listing as well (.lst)."]


@dataclass(frozen=True, slots=True)
class LanguageOptions:
    """The options of the C language and of the chip."""

    dialect: Annotated[
        Dialect | None, "The C dialect (default: xc8 if a file includes <xc.h>, sdcc if <pic14/…>, else c2c)."
    ] = None
    include: Annotated[
        list[Path] | None,
        typer.Option("-I", metavar="DIR", help="Search a folder for include files (repeatable)."),
    ] = None
    define: Annotated[
        list[str] | None,
        typer.Option("-D", metavar="NAME[=VALUE]", help="Define a macro; its value is 1 (repeatable)."),
    ] = None
    device: Annotated[
        str | None,
        "The chip (default: the one that a header names, else PIC16F84, or PIC16F84A above 10 MHz).",
    ] = None
    clock_hz: Annotated[
        int | None, typer.Option(min=1, help="The clock in Hz, if the source does not state it.")
    ] = None
    float_bits: Annotated[
        int | None,
        typer.Option(
            "--float", metavar="24|32", help="Size of float and double in bits (default: 24 in xc8, else 32)."
        ),
    ] = None


@dataclass(frozen=True, slots=True)
class CompilerOptions:
    """The options of the compiler's own work."""

    optimise: Annotated[
        str,
        typer.Option(
            "-O",
            "--optimise",
            metavar="none|speed|size",
            help="-O0: no optimisation; -O1: fewest cycles; -Os: fewest words (equal code as subroutines).",
        ),
    ] = "speed"
    dump: Annotated[
        str | None,
        typer.Option(
            metavar="ir[:PASS]",
            help="Print the compiler's intermediate form after a pass (default: the last one), and what each "
            "pass saved.",
        ),
    ] = None
    no_warning: Annotated[
        list[str] | None, typer.Option(metavar="CODE", help="Suppress warnings with this code (repeatable).")
    ] = None
    verify_ir: Annotated[bool, "Check the intermediate form after every pass."] = False
    timeout: TimeLimit = COMPILING.seconds
    memory_mb: MemoryLimit = COMPILING.memory_mb


def compile(
    sources: Annotated[list[Path], typer.Argument(help="C files of one program.", show_default=False)],
    language: LanguageOptions,
    work: CompilerOptions,
    output: Output = None,
    listing: ListingFile = None,
    json: Json = False,
) -> None:
    """Compile C to Intel HEX (default output: the first file's name with .hex)."""
    texts = [Source(read_source(path), str(path)) for path in sources]
    options = _options(texts, language, work)
    compilation = within_limits(
        lambda: compile_sources(texts, options),
        sources[0],
        WorkLimits.patient(work.timeout, work.memory_mb),
        "--timeout and --memory-mb allow more",
    )
    target = output or sources[0].with_suffix(".hex")
    check_outputs(sources, target, listing)
    write_program(target, compilation.image, listing, compilation.listing)
    spoken, dump = options.dialect, work.dump
    if json:
        as_json(
            {
                "hex": str(target),
                "dialect": spoken,
                "words": compilation.words,
                "ram_bytes": compilation.ram_bytes,
                "clock_hz": compilation.clock.hz if compilation.clock else None,
                "saved_by_pass": dict(compilation.saved),
                **({"ir": compilation.ir} if dump else {}),
            },
            compilation.diagnostics,
        )
    else:
        if dump:
            print(compilation.ir)
            savings = [
                f"; {name} saved {counted(words, 'word')}" for name, words in compilation.saved.items()
            ]
            print("\n".join(savings) or "; no pass saved a word")
        print(f"{target}: {compilation.words} words of 1024, {compilation.ram_bytes} bytes of 68, {spoken}")
        print(next_step("simulate", target))
    warn_of_all(compilation.diagnostics, compilation.source_lines)


def _options(sources: Sequence[Source], language: LanguageOptions, work: CompilerOptions) -> Options:
    """Return the compiler's options for sources. Raises InputError."""
    found = partial(beside_c, folders=_folders(language.include or []))
    names = included_names([(source.file, source.text) for source in sources], found)
    chip, faster = devices_of(language.device, names)
    options = Options(
        dialect=language.dialect.value if language.dialect else dialect_of(names),
        device=chip,
        faster_device=faster,
        clock_hz=language.clock_hz,
        float_bits=language.float_bits,
        optimise={"0": "none", "1": "speed", "s": "size"}.get(work.optimise, work.optimise),
        include=found,
        defines=_macros(language.define or []),
        dump_ir=_pass_to_dump(work.dump),
        unwanted=_known_codes(work.no_warning or []),
    )
    return replace(options, verify_ir=True) if work.verify_ir else options


def _folders(folders: list[Path]) -> list[Path]:
    """Return the folders of `-I`. Raises InputError."""
    for folder in folders:
        if not folder.is_dir():
            raise InputError("bad-option", "-I names no folder", Location(str(folder)))
    return folders


def _macros(definitions: list[str]) -> dict[str, str]:
    """Return the macros of `-D`. Raises InputError."""
    macros = {}
    for text in definitions:
        name, equals, value = text.partition("=")
        if not re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII) or "\n" in value:
            raise InputError("bad-option", f"-D takes NAME or NAME=VALUE, not '{text}'")
        macros[name] = value if equals else "1"
    return macros


def _known_codes(codes: list[str]) -> frozenset[str]:
    """Return the codes of `--no-warning`. Raises InputError."""
    for code in codes:
        if code not in WARNINGS:
            raise InputError(
                "bad-option",
                f"--no-warning: no warning has the code '{code}'",
                hint=did_you_mean(code, sorted(WARNINGS)),
            )
    return frozenset(codes)


def _pass_to_dump(asked: str | None) -> str | None:
    """Return the pass of `--dump ir[:PASS]`. Raises InputError."""
    if asked is None:
        return None
    form, _, name = asked.partition(":")
    if form != "ir":
        raise InputError(
            "bad-option", f"--dump: '{asked}' is not ir or ir:PASS", hint=f"passes: {', '.join(PASSES)}"
        )
    return name or PASSES[-1]
