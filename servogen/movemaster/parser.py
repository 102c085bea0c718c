"""Text of an .rvm file -> `ParsedProgram`: checked statements; every error names its line and column.

    [number] COMMAND argument, argument  ' comment

In: the text and its name. Out: direct (unnumbered) and program (numbered) statements in the file's order.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from servogen.errors import InputError, Location, did_you_mean
from servogen.inputs import read_input
from servogen.movemaster.language import (
    COMMANDS,
    LINES,
    MISPRINTS,
    NOT_HERE,
    ArgumentKind,
    Command,
    Parameter,
    Where,
    by_initial,
)

COMMENT = "'"


@dataclass(frozen=True, slots=True)
class Bit:
    """A bit of a port: +3 is bit 3 on, -3 is bit 3 off, and -0 is bit 0 off."""

    number: int
    on: bool


Value = int | float | str | Bit


@dataclass(frozen=True, slots=True)
class ProgramLine:
    """One line: its number (None: direct), its command (None: a comment that can be a jump target), its
    arguments.

    Lengths and angles are as written, in mm and degrees.
    """

    number: int | None
    command: Command | None
    arguments: tuple[Value, ...]
    place: Location
    text: str

    def whole(self, index: int) -> int:
        """Return an argument that the table declares as an integer."""
        value = self.arguments[index]
        if not isinstance(value, int):
            raise TypeError(f"argument {index + 1} of {self.text} is not a whole number")
        return value

    def decimal(self, index: int) -> float:
        """Return an argument that the table declares as a number."""
        value = self.arguments[index]
        if not isinstance(value, int | float):
            raise TypeError(f"argument {index + 1} of {self.text} is not a number")
        return float(value)

    def bit(self, index: int) -> Bit:
        """Return an argument that the table declares as a bit."""
        value = self.arguments[index]
        if not isinstance(value, Bit):
            raise TypeError(f"argument {index + 1} of {self.text} is not a bit")
        return value

    def has(self, index: int) -> bool:
        """Return whether the argument `index` (from 0) is given."""
        return index < len(self.arguments)

    def error(self, code: str, message: str, hint: str | None = None) -> InputError:
        """Return an error at this statement."""
        return InputError(code, message, self.place, hint)


MAX_LINE = 1000
"""Characters of a line; numbers of more digits cannot be read."""


@dataclass(frozen=True, slots=True)
class ParsedProgram:
    """The statements of a file, in order."""

    file: str
    statements: tuple[ProgramLine, ...]


def read(path: str | Path) -> ParsedProgram:
    """Return the file at `path`. Raises InputError."""
    try:
        text = read_input(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise InputError(
            "not-utf8", "is not UTF-8 text", Location(str(path), line), "save the file as UTF-8"
        ) from error
    return parse(text, str(path))


def parse(text: str, file: str) -> ParsedProgram:
    """Return the statements of `text`. Raises InputError for the first error."""
    long = next((index for index, line in enumerate(text.split("\n"), 1) if len(line) > MAX_LINE), None)
    if long is not None:
        raise InputError(
            "file-too-large", f"the line has more than {MAX_LINE} characters", Location(file, long)
        )
    statements = tuple(
        statement
        for index, line in enumerate(text.split("\n"))
        for statement in _statement(line.rstrip("\r"), file, index + 1)
    )
    if not statements:
        raise InputError(
            "no-program",
            "has no command",
            Location(file),
            "a program: 10 NT, 20 ED, each on a line of its own",
        )
    return ParsedProgram(file, statements)


_HEAD = re.compile(r"\s*(?P<number>[+-]?\d+)?\s*(?P<word>[A-Za-z]+)?")


def _statement(line: str, file: str, row: int) -> Iterator[ProgramLine]:
    """Yield the statement of a line, if it has one. Raises InputError."""
    code = line.split(COMMENT, 1)[0].rstrip()
    head = _HEAD.match(code)
    if head is None or (not code and COMMENT not in line) or (not code.strip() and not head["number"]):
        return
    number = _number(head["number"], file, row, head.start("number")) if head["number"] else None
    key = None if number is None else f"program line {number}"
    if head["word"] is None:
        rest = code[head.end() :].strip()
        if rest or COMMENT not in line:
            wrong = rest.split(",")[0].split(" ")[0]
            location = Location(file, row, len(code) - len(rest) + 1, key)
            raise _no_command(wrong, head["number"], location)
        yield ProgramLine(
            number=number,
            command=None,
            arguments=(),
            place=Location(file, row, head.start("number") + 1, key),
            text="",
        )
        return
    place = Location(file, row, head.start("word") + 1, key)
    command = _command(head["word"].upper(), number, place)
    pieces = tuple(_pieces(code, head.end("word")))
    arguments = _arguments(command, pieces, place, row)
    yield ProgramLine(
        number=number,
        command=command,
        arguments=arguments,
        place=place,
        text=code[head.start("word") :].strip(),
    )


def _no_command(wrong: str, number: str, place: Location) -> InputError:
    """Return the error about a line without a command, at which `wrong` was found instead."""
    if not wrong:
        return InputError(
            "program-syntax", f"line {number} has no command", place, "write one, or a comment: 10 ' start"
        )
    if wrong in MISPRINTS:
        real = MISPRINTS[wrong]
        return InputError(
            "bad-command",
            f"unknown command '{wrong}'",
            place,
            f"a misprint in the source's table: write {real}",
        )
    return InputError(
        "program-syntax", f"a command is missing before '{wrong}'", place, "two letters, such as MO 1"
    )


def _number(text: str, file: str, row: int, column: int) -> int:
    place = Location(file, row, column + 1)
    low, high = LINES
    if not re.fullmatch("[0-9]{1,9}", text) or not low <= int(text) <= high:
        raise InputError("program-syntax", f"{text[:40]} is not a line number", place, f"{low} to {high}")
    return int(text)


def _command(word: str, number: int | None, place: Location) -> Command:
    """Return the command of a word, in upper case. Raises InputError where it is not allowed."""
    if word in NOT_HERE:
        raise InputError("bad-command", f"{word} is not supported: {NOT_HERE[word]}", place)
    if word not in COMMANDS:
        raise InputError("bad-command", f"unknown command '{word}'", place, _nearest_command(word))
    command = COMMANDS[word]
    if number is not None and command.where is Where.DIRECT:
        raise InputError(
            "program-syntax",
            f"{word} is not allowed in a program",
            place,
            "write it without a line number, before the program; it is then executed immediately",
        )
    if number is None and command.where is Where.PROGRAM:
        raise InputError(
            "program-syntax",
            f"{word} is allowed in a program only",
            place,
            f"give it a line number: 10 {word}",
        )
    return command


def _nearest_command(word: str) -> str:
    if word in MISPRINTS:
        return f"a misprint in the source's table: write {MISPRINTS[word]}"
    hint = did_you_mean(word, COMMANDS)
    alike = by_initial(word[0])
    if hint.startswith("known") and alike:
        return f"commands that begin with {word[0]}: {', '.join(alike)}"
    return hint


def _pieces(code: str, start: int) -> Iterator[tuple[str, int]]:
    """Yield the arguments between commas, with the column (from 1) of each."""
    if not code[start:].strip():
        return
    offset = start
    for piece in code[start:].split(","):
        lead = len(piece) - len(piece.lstrip())
        yield piece.strip(), offset + lead + 1
        offset += len(piece) + 1


def _arguments(
    command: Command, pieces: tuple[tuple[str, int], ...], place: Location, row: int
) -> tuple[Value, ...]:
    """Return the checked arguments of a command. Raises InputError."""
    maximum = len(command.parameters)
    if not command.min_arguments <= len(pieces) <= maximum:
        wanted = (
            str(maximum or "no")
            if maximum == command.min_arguments
            else f"{command.min_arguments} to {maximum}"
        )
        column = pieces[maximum][1] if len(pieces) > maximum else place.column
        raise InputError(
            "program-argument",
            f"{command.mnemonic} takes {wanted} argument{'' if maximum == 1 else 's'}, not {len(pieces)}",
            Location(place.file, row, column, place.key),
            f"it is written: {command.form}",
        )
    return tuple(
        _value(command, parameter, text, Location(place.file, row, column, place.key))
        for parameter, (text, column) in zip(command.parameters, pieces, strict=False)
    )


_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)", re.ASCII)
_WHOLE = re.compile(r"[+-]?\d+", re.ASCII)
_HEX = re.compile(r"&[0-9A-Fa-f]{1,4}")


def _value(command: Command, parameter: Parameter, text: str, place: Location) -> Value:
    """Return the checked value of an argument. Raises InputError."""
    who = f"{command.mnemonic}: {parameter.name}"
    if not text:
        if parameter.blank is not None:
            return parameter.blank
        raise InputError("program-argument", f"{who} is missing", place, f"allowed: {parameter.allowed}")
    if parameter.kind is ArgumentKind.HAND:
        if text.upper() not in ("O", "C"):
            raise InputError(
                "program-argument", f"{who} cannot be '{text}'", place, f"allowed: {parameter.allowed}"
            )
        return text.upper()
    if parameter.kind is ArgumentKind.BIT:
        # -100 is out of range, so text that is not a number gets the same error.
        number = int(text) if _WHOLE.fullmatch(text) else -100
        if not parameter.low <= abs(number) <= parameter.high:
            raise InputError(
                "program-argument", f"{who} cannot be '{text}'", place, f"allowed: {parameter.allowed}"
            )
        return Bit(abs(number), not text.startswith("-"))
    value = _as_number(who, parameter, text, place)
    if not parameter.low <= value <= parameter.high:
        raise InputError(
            "program-argument", f"{who} cannot be {text}", place, f"allowed: {parameter.allowed}"
        )
    return value


def _as_number(who: str, parameter: Parameter, text: str, place: Location) -> int | float:
    """Return the number that an argument states, decimal or hexadecimal. Raises InputError."""
    if text.startswith("&"):
        if not parameter.hexadecimal:
            raise InputError(
                "program-argument",
                f"{who} takes no hexadecimal number, not '{text}'",
                place,
                f"allowed: {parameter.allowed}",
            )
        if not _HEX.fullmatch(text):
            raise InputError(
                "program-argument",
                f"{who}: '{text}' is not a hexadecimal number",
                place,
                f"& and up to four of 0-9 A-F; allowed: {parameter.allowed}",
            )
        value = int(text[1:], 16)
        # A signed word, in two's complement.
        return value - 0x10000 if parameter.low < 0 and value > 0x7FFF else value
    if not _NUMBER.fullmatch(text):
        raise InputError(
            "program-argument", f"{who}: '{text}' is not a number", place, f"allowed: {parameter.allowed}"
        )
    if parameter.kind is ArgumentKind.WHOLE:
        if not _WHOLE.fullmatch(text):
            raise InputError(
                "program-argument",
                f"{who} is not a whole number: {text}",
                place,
                f"allowed: {parameter.allowed}",
            )
        return int(text)
    return float(text)
