"""Programs a chip: the objections beforehand, and the evidence afterwards that it worked."""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

from servogen.bench.ports import held
from servogen.bench.programmers.table import (
    EEPROM,
    ERASED_BYTE,
    Contents,
    InstalledProgrammer,
    Programmer,
    ProgrammingRequest,
    ReadMethod,
    difference,
)
from servogen.errors import Diagnostic, InputError, Location, ServogenError, ToolError
from servogen.pic.device import CONFIG_WATCHDOG_ON, EEPROM_BYTES, Device
from servogen.pic.image import Image
from servogen.pic.isa import decode


def objections(image: Image) -> tuple[Diagnostic, ...]:
    """Return the objections to programming `image`."""
    objections = []
    if not image.words:
        objections.append(Diagnostic("error", "no-program", "the image has no program"))
    if image.config is None:
        text = "the image has no configuration word: oscillator and watchdog would be left to chance"
        objections.append(Diagnostic("error", "no-configuration", text))
    elif image.config & CONFIG_WATCHDOG_ON and not _clears_watchdog(image):
        text = "the watchdog is on, and the program never clears it: the chip would be reset again and again"
        objections.append(Diagnostic("error", "watchdog-on", text))
    return tuple(objections)


def remarks(image: Image, device: Device) -> tuple[Diagnostic, ...]:
    """Return the warnings about programming `image`."""
    warnings = []
    if device.name == "PIC16F84":
        text = "the PIC16F84 has no device ID: no programmer can tell whether this is the chip in the socket"
        warnings.append(Diagnostic("warning", "no-device-id", text))
    if is_protected(image, device):
        text = "code protection is on: the chip cannot be read again, only erased"
        warnings.append(Diagnostic("warning", "code-protected", text))
    return tuple(warnings)


def is_protected(image: Image, device: Device) -> bool:
    mask = device.code_protect_mask
    return image.config is not None and image.config & mask != mask


def _clears_watchdog(image: Image) -> bool:
    """Return whether the program contains CLRWDT or SLEEP, which alone set the flag TO (DS35007 section
    6.10).
    """
    words = (decode(word) for word in image.program.values())
    return any(decoded is not None and "T" in decoded.instruction.flags for decoded in words)


TIMEOUT_S = 120.0
NOT_INSERTED = re.compile(r"waiting for user to insert chip(?![\s\S]*chip detected)", re.IGNORECASE)
LAST_LINES = 3
"""The lines of a programmer's output that an error quotes: why it failed is in the last ones."""
LINE = 120


class Differs(ServogenError):
    """Raised when the chip's contents differ from the file's."""

    exit_code = 1


@dataclass(frozen=True, slots=True)
class Flashed:
    """`output` is the output of the programmer's program; `compared` names the memories that were read
    back.
    """

    output: str
    compared: tuple[str, ...]


def programming_command(tool: InstalledProgrammer, order: ProgrammingRequest) -> tuple[str, ...]:
    """Return the command that programs. Raises InputError if it needs a port and none is given."""
    if tool.programmer.needs_port and order.port is None:
        raise InputError(
            "missing-option",
            f"{tool.programmer.name} needs the programmer's port",
            hint="--port /dev/ttyUSB0, or the like",
        )
    return (*tool.start, *tool.programmer.program(order))


def flash(
    tool: InstalledProgrammer, order: ProgrammingRequest, image: Image, timeout_s: float = TIMEOUT_S
) -> Flashed:
    """Program the chip. Raises ToolError or Differs."""
    command = programming_command(tool, order)
    port = order.port if tool.programmer.needs_port else None
    with nullcontext() if port is None else held(port):
        code, output = _run(command, tool.programmer, order.port, timeout_s)
        try:
            judge(tool.programmer, code, output, order.port)
        except Differs as error:
            raise _with_place(error, tool, order, image, timeout_s) from None
        read = _read(tool, order, image, timeout_s)
    mismatch = difference(read, image)
    if mismatch is not None:
        raise Differs(
            "chip-differs",
            f"{tool.programmer.name} reports success, but the chip differs from the file, first {mismatch}",
            _place(order.port),
            last_lines(output),
        )
    return Flashed(output, tuple(read))


def read_eeprom(
    tool: InstalledProgrammer, order: ProgrammingRequest, image: Image, timeout_s: float = TIMEOUT_S
) -> bytes:
    """Return the data EEPROM of a chip that was programmed with `image`. Raises InputError, ToolError."""
    if not any(look.of_eeprom for look in tool.programmer.looks(order)):
        raise InputError(
            "not-allowed", f"reading the data EEPROM with {tool.programmer.name} is not supported"
        )
    if is_protected(image, order.device):
        raise InputError("not-allowed", "the chip is code protected: its data EEPROM cannot be read")
    with nullcontext() if order.port is None else held(order.port):
        read = _read(tool, order, image, timeout_s, lambda look: look.of_eeprom)
    return bytes(read.get(EEPROM, [ERASED_BYTE] * EEPROM_BYTES))


def judge(programmer: Programmer, code: int, output: str, port: str | None) -> None:
    """Raise the error that the exit code and the output indicate."""
    for failure in programmer.failures:
        if isinstance(failure.sign, int):
            hit = code == failure.sign
        else:
            hit = re.search(failure.sign, output, re.IGNORECASE) is not None
        if hit:
            if failure.differs:
                raise Differs("chip-differs", failure.sentence, _place(port), last_lines(output))
            raise ToolError("tool-failed", failure.sentence, _place(port), last_lines(output))
    missing = [text for text in programmer.success_texts if text not in output]
    if code != 0:
        raise ToolError(
            "tool-failed", f"{programmer.name} failed with exit code {code}", _place(port), last_lines(output)
        )
    if missing:
        raise ToolError(
            "tool-failed",
            f"{programmer.name} did not print '{missing[0]}': the chip may not be programmed",
            _place(port),
            last_lines(output),
        )


def _with_place(
    error: Differs, tool: InstalledProgrammer, order: ProgrammingRequest, image: Image, timeout_s: float
) -> Differs:
    """Return the same error with the first differing address, if the programmer can read it."""
    try:
        mismatch = difference(_read(tool, order, image, timeout_s), image)
    except ToolError:
        return error
    return (
        error
        if mismatch is None
        else Differs("chip-differs", f"{error.message}, first {mismatch}", error.location, error.hint)
    )


def _read(
    tool: InstalledProgrammer,
    order: ProgrammingRequest,
    image: Image,
    timeout_s: float,
    wanted: Callable[[ReadMethod], bool] = lambda look: True,
) -> Contents:
    """Return everything that can be read back; for a code-protected chip, what it still reveals."""
    contents: dict[str, Sequence[int]] = {}
    closed = is_protected(image, order.device)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "read.hex"
        for look in tool.programmer.looks(replace(order, file=file)):
            if (closed and not look.of_protected) or not wanted(look):
                continue
            file.unlink(missing_ok=True)
            command = (*tool.start, *look.arguments)
            code, output = _run(command, tool.programmer, order.port, timeout_s)
            if code != 0 or not file.exists():
                raise ToolError(
                    "tool-failed",
                    f"{tool.programmer.name} could not read the chip back",
                    _place(order.port),
                    last_lines(output),
                )
            try:
                contents.update(look.contents(file, image))
            except ValueError as error:
                raise ToolError(
                    "tool-failed",
                    f"{tool.programmer.name} read the chip back into a file that is not understood: {error}",
                    _place(order.port),
                    last_lines(output),
                ) from error
    return contents


def _run(
    command: tuple[str, ...], programmer: Programmer, port: str | None, timeout_s: float
) -> tuple[int, str]:
    """Return exit code and output; the program is terminated if it takes too long."""
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        env=environment,
    ) as process:
        try:
            output, _ = process.communicate(timeout=timeout_s)
        except subprocess.TimeoutExpired:
            process.kill()
            output, _ = process.communicate()
            sentence = f"{programmer.name} did not end within {timeout_s:g} s"
            if not output.strip():
                sentence += " and printed nothing: does the programmer answer?"
            if NOT_INSERTED.search(output):
                sentence = "there is no chip in the programmer's socket"
            raise ToolError("tool-failed", sentence, _place(port), last_lines(output)) from None
        except BaseException:
            process.kill()
            raise
        return process.returncode, output


def _place(port: str | None) -> Location | None:
    return Location(port) if port else None


def last_lines(output: str) -> str | None:
    """Return the last lines of a program's output, without the ends of very long ones."""
    lines = [line for line in output.splitlines() if line.strip()][-LAST_LINES:]
    return "\n  ".join(line if len(line) <= LINE else f"{line[:LINE]} …" for line in lines) or None
