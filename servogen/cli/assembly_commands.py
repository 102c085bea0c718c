"""Commands of assembly: assemble, disassemble."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from servogen.cli.files import check_outputs, read_image, within_limits, write_program
from servogen.cli.options import DeviceName, MemoryLimit, Output, TimeLimit
from servogen.cli.show import next_step, warn_of_all
from servogen.isolation import COMPILING, WorkLimits
from servogen.outputs import write_text
from servogen.pic.assembler.assembly import AssemblySource, beside, link
from servogen.pic.assembler.sections import EVERY_CHIP, read_place, read_script
from servogen.pic.device import ASSEMBLED_DEVICES
from servogen.pic.device import device as device_named
from servogen.pic.disassembler import disassemble as disassembled
from servogen.programs import read_assembly

ListingFile = Annotated[Path | None, "Write the listing as well (.lst)."]


def assemble(
    sources: Annotated[
        list[Path],
        typer.Argument(help="Assembly files: all sources of one program, in order.", show_default=False),
    ],
    output: Output = None,
    listing: ListingFile = None,
    script: Annotated[
        Path | None,
        typer.Option(help="A linker script (.lkr), instead of gplink's for the chip.", show_default=False),
    ] = None,
    place: Annotated[
        list[str] | None, "A section's address: ISR=4h, as pic-as's -Wl,-pISR=4h (repeatable)."
    ] = None,
    device: Annotated[str | None, "The chip (default: the one that the source names, else PIC16F84)."] = None,
    timeout: TimeLimit = COMPILING.seconds,
    memory_mb: MemoryLimit = COMPILING.memory_mb,
) -> None:
    """Assemble MPASM sources to Intel HEX (default output: the first file's name with .hex)."""
    chip = device_named(device, ASSEMBLED_DEVICES) if device else None
    modules = [AssemblySource(read_assembly(each), str(each), beside(each.parent)) for each in sources]
    memory = read_script(read_assembly(script), str(script)) if script else EVERY_CHIP
    memory = replace(memory, at=dict(read_place(each) for each in place or ()))
    assembly = within_limits(
        lambda: link(modules, chip, memory),
        sources[0],
        WorkLimits.patient(timeout, memory_mb),
        "--timeout and --memory-mb allow more",
    )
    target = output or sources[0].with_suffix(".hex")
    check_outputs([*sources, *([script] if script else [])], target, listing)
    write_program(target, assembly.image, listing, assembly.listing)
    print(f"{target}: {assembly.image.words} words of 1024")
    print(next_step("simulate", target))
    warn_of_all(assembly.warnings, assembly.source_lines)


def disassemble(
    file: Annotated[Path, typer.Argument(help="An Intel HEX file, a job or its build.", show_default=False)],
    output: Output = None,
    device: DeviceName = "PIC16F84",
) -> None:
    """Write a HEX file as assembly that assembles to the same image (default: to standard output)."""
    check_outputs([file], output)
    text = disassembled(read_image(file), device_named(device))
    if output:
        write_text(output, text)
        print(next_step("assemble", output))
    else:
        print(text, end="")
