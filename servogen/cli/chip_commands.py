"""Commands of the chip's languages: compile, assemble, disassemble."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from servogen.cli.files import keep_apart, read_image, within_limits
from servogen.cli.options import DeviceName, Dialect, Json, MemoryLimit, Output, TimeLimit
from servogen.cli.show import as_json, warn_of_all
from servogen.errors import InputError, Location
from servogen.isolation import COMPILING, WorkLimits
from servogen.programs import (
    beside_c,
    devices_of,
    dialect_of,
    included_names,
    read_assembly,
    read_source,
)
from servogen.units import counted

if TYPE_CHECKING:
    from servogen.pic.image import Image
    from servogen.pic.listing import Listing

ListingFile = Annotated[Path | None, typer.Option("--listing", help="Write the listing as well (.lst).")]


def register(app: typer.Typer) -> None:
    app.command("compile")(compile_c)
    app.command()(assemble)
    app.command()(disassemble)


def compile_c(
    sources: Annotated[list[Path], typer.Argument(help="C files of one program.", show_default=False)],
    output: Output = None,
    dialect: Annotated[
        Dialect | None,
        typer.Option(
            "--dialect",
            help="The C dialect (default: xc8 if a file includes <xc.h>, sdcc if <pic14/…>, else c2c).",
        ),
    ] = None,
    listing: ListingFile = None,
    optimise: Annotated[
        str,
        typer.Option(
            "-O",
            "--optimise",
            metavar="none|speed|size",
            help="-O0: no optimisation; -O1: fewest cycles; -Os: fewest words (equal code as subroutines).",
        ),
    ] = "speed",
    include: Annotated[
        list[Path],
        typer.Option("-I", metavar="DIR", help="Search a folder for include files (repeatable)."),
    ] = [],  # noqa: B006
    define: Annotated[
        list[str],
        typer.Option("-D", metavar="NAME[=VALUE]", help="Define a macro; its value is 1 (repeatable)."),
    ] = [],  # noqa: B006
    device: Annotated[
        str | None,
        typer.Option(
            "--device",
            help="The chip (default: the one that a header names, else PIC16F84, or PIC16F84A above 10 MHz).",
        ),
    ] = None,
    clock_hz: Annotated[
        int | None,
        typer.Option("--clock-hz", min=1, help="The clock in Hz, if the source does not state it."),
    ] = None,
    float_bits: Annotated[
        int | None,
        typer.Option(
            "--float", metavar="24|32", help="Size of float and double in bits (default: 24 in xc8, else 32)."
        ),
    ] = None,
    dump: Annotated[
        str | None,
        typer.Option(
            "--dump",
            metavar="ir[:PASS]",
            help="Print the compiler's intermediate form after a pass (default: the last one), and what each "
            "pass saved.",
        ),
    ] = None,
    no_warning: Annotated[
        list[str],
        typer.Option("--no-warning", metavar="CODE", help="Suppress warnings with this code (repeatable)."),
    ] = [],  # noqa: B006
    verify_ir: Annotated[
        bool, typer.Option("--verify-ir", help="Check the intermediate form after every pass.")
    ] = False,
    timeout: TimeLimit = COMPILING.seconds,
    memory_mb: MemoryLimit = COMPILING.memory_mb,
    json: Json = False,
) -> None:
    """Compile C to Intel HEX (default output: the first file's name with .hex)."""
    from servogen.compiler import Options, Source, compile_sources

    texts = [Source(read_source(path), str(path)) for path in sources]
    found = partial(beside_c, folders=_folders(include))
    names = included_names([(source.file, source.text) for source in texts], found)
    spoken = dialect.value if dialect else dialect_of(names)
    chip, faster = devices_of(device, names)
    options = Options(
        dialect=spoken,
        device=chip,
        faster_device=faster,
        clock_hz=clock_hz,
        float_bits=float_bits,
        optimise={"0": "none", "1": "speed", "s": "size"}.get(optimise, optimise),
        include=found,
        defines=_macros(define),
        dump_ir=_pass_to_dump(dump),
        unwanted=_unwanted(no_warning),
    )
    if verify_ir:
        options = replace(options, verify_ir=True)
    compilation = within_limits(
        lambda: compile_sources(texts, options),
        sources[0],
        WorkLimits(timeout, memory_mb),
        "--timeout and --memory-mb allow more",
    )
    target = output or sources[0].with_suffix(".hex")
    keep_apart(sources, target, listing)
    _write(target, compilation.image, listing, compilation.listing)
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
    warn_of_all(compilation.diagnostics, compilation.source_lines)


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


def _unwanted(codes: list[str]) -> frozenset[str]:
    """Return the codes of `--no-warning`. Raises InputError."""
    from servogen.compiler.diagnostics import WARNINGS
    from servogen.errors import did_you_mean

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
    from servogen.compiler.passes.manager import PASSES

    if asked is None:
        return None
    form, _, name = asked.partition(":")
    if form != "ir":
        raise InputError(
            "bad-option", f"--dump: '{asked}' is not ir or ir:PASS", hint=f"passes: {', '.join(PASSES)}"
        )
    return name or PASSES[-1]


def assemble(
    source: Annotated[Path, typer.Argument(help="An assembly file.", show_default=False)],
    output: Output = None,
    listing: ListingFile = None,
    device: Annotated[
        str | None,
        typer.Option("--device", help="The chip (default: the one that the source names, else PIC16F84)."),
    ] = None,
    timeout: TimeLimit = COMPILING.seconds,
    memory_mb: MemoryLimit = COMPILING.memory_mb,
) -> None:
    """Assemble MPASM source to Intel HEX (default output: the file's name with .hex)."""
    from servogen.pic.assembler import assemble as assembled
    from servogen.pic.assembler import beside
    from servogen.pic.device import ASSEMBLED_DEVICES
    from servogen.pic.device import device as device_named

    chip = device_named(device, ASSEMBLED_DEVICES) if device else None
    text = read_assembly(source)
    assembly = within_limits(
        lambda: assembled(text, str(source), chip, beside(source.parent)),
        source,
        WorkLimits(timeout, memory_mb),
        "--timeout and --memory-mb allow more",
    )
    target = output or source.with_suffix(".hex")
    keep_apart([source], target, listing)
    _write(target, assembly.image, listing, assembly.listing)
    print(f"{target}: {assembly.image.words} words of 1024")
    warn_of_all(assembly.warnings, assembly.source_lines)


def disassemble(
    file: Annotated[Path, typer.Argument(help="An Intel HEX file, a job or its build.", show_default=False)],
    output: Output = None,
    device: DeviceName = "PIC16F84",
) -> None:
    """Write a HEX file as assembly that assembles to the same image (default: to standard output)."""
    from servogen.outputs import write_text
    from servogen.pic.device import device as device_named
    from servogen.pic.disassembler import disassemble as disassembled

    keep_apart([file], output)
    text = disassembled(read_image(file), device_named(device))
    if output:
        write_text(output, text)
    else:
        print(text, end="")


def _write(target: Path, image: Image, listing: Path | None, rows: Listing) -> None:
    from servogen.outputs import write_text
    from servogen.pic.image import to_hex
    from servogen.pic.listing import listing_text

    write_text(target, to_hex(image))
    if listing:
        write_text(listing, listing_text(rows))
