"""Errors and warnings about a program, with a location, the source line and a caret.

In: messages from every stage. Out: `Diagnostic` values, and one `CompileError` that carries them all.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from servogen.compiler.limits import ERRORS
from servogen.errors import InputError, Location


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One error or warning. `source_line` is the text of the line that it points to, if there is one."""

    severity: str
    """ "error" or "warning"."""
    message: str
    place: Location
    source_line: str | None = None
    hint: str | None = None
    too_large: bool = False
    """An error of a program that is larger than the chip, or than the compiler takes."""

    def __str__(self) -> str:
        where = str(self.place)
        lines = [f"{where}: {self.severity}: {self.message}" if where else f"{self.severity}: {self.message}"]
        if self.source_line is not None:
            lines.append(f"    {self.source_line}")
            if self.place.column is not None:
                before = self.source_line[: self.place.column - 1]
                lines.append("    " + "".join("\t" if sign == "\t" else " " for sign in before) + "^")
        if self.hint:
            lines.append(f"  {self.hint}")
        return "\n".join(lines)


class CompileError(InputError):
    """Raised when the program cannot be compiled; `diagnostics` holds errors and warnings in source order."""

    def __init__(self, diagnostics: tuple[Diagnostic, ...]) -> None:
        errors = [each for each in diagnostics if each.severity == "error"]
        first = errors[0]
        super().__init__(first.message, first.place, first.hint)
        self.diagnostics = diagnostics  # type: ignore[assignment]
        self.too_large = first.too_large
        """Whether the first error is that the program is too large."""

    def __str__(self) -> str:
        return "\n".join(str(each) for each in self.diagnostics)


class Fatal(Exception):
    """Raised inside the compiler to abandon a construct whose error has been reported."""


class Reporter:
    """Collects diagnostics and keeps the text of each source file."""

    def __init__(self) -> None:
        self.texts: dict[str, str] = {}
        self._lines: dict[str, list[str]] = {}
        self._found: dict[Diagnostic, None] = {}
        self._errors = 0
        self.lost: set[str] = set()
        """Names whose declarations have errors: that they are missing is not reported again."""

    def add_source(self, file: str, text: str) -> None:
        self.texts[file] = text
        self._lines[file] = text.splitlines()

    def lines(self, file: str) -> list[str]:
        return self._lines.get(file, [])

    def _line(self, place: Location) -> str | None:
        lines = self._lines.get(place.file or "", [])
        return lines[place.line - 1] if place.line and place.line <= len(lines) else None

    def _add(
        self, severity: str, message: str, place: Location, hint: str | None, *, too_large: bool = False
    ) -> None:
        line = self._line(place)
        if line is not None and place.column is None:  # a directive or a line of assembly: its first word
            place = Location(place.file, place.line, len(line) - len(line.lstrip()) + 1)
        self._found[Diagnostic(severity, message, place, line, hint, too_large)] = None

    def error(self, message: str, place: Location, hint: str | None = None) -> None:
        self._add("error", message, place, hint)
        self._errors += 1
        if self._errors >= ERRORS:
            raise CompileError(self.ordered())

    def warn(self, message: str, place: Location, hint: str | None = None) -> None:
        self._add("warning", message, place, hint)

    def fatal(self, message: str, place: Location, hint: str | None = None) -> Fatal:
        """Report an error; the caller raises the exception that is returned."""
        self.error(message, place, hint)
        return Fatal(message)

    def too_large(self, message: str, place: Location, hint: str | None = None) -> Fatal:
        """Report that the program is too large; the caller raises the exception that is returned."""
        self._add("error", message, place, hint, too_large=True)
        return Fatal(message)

    def too_deep(self, place: Location) -> Fatal:
        """Report nesting deeper than the compiler supports; the caller raises the exception that is
        returned.
        """
        return self.fatal(
            "something in the program is nested too deeply",
            place,
            hint="look for parentheses or braces that are never closed, or divide the expression",
        )

    def ordered(self) -> tuple[Diagnostic, ...]:
        """Return all diagnostics in source order."""
        files: Mapping[str, int] = {file: number for number, file in enumerate(self.texts)}

        def key(each: Diagnostic) -> tuple[int, int, int]:
            place = each.place
            return files.get(place.file or "", len(files)), place.line or 0, place.column or 0

        return tuple(sorted(self._found, key=key))

    def stop_on_error(self) -> None:
        """Raise CompileError if an error was reported."""
        found = self.ordered()
        if any(each.severity == "error" for each in found):
            raise CompileError(found)
