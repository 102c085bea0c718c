"""Errors and warnings about a program, and the source lines that they point to.

In: messages from every stage. Out: `Diagnostic` values, and one `InputError` that carries them all.
"""

from __future__ import annotations

from collections.abc import Mapping

from servogen.compiler.limits import ERRORS
from servogen.errors import Diagnostic, InputError, Location, Severity, SourceLines

WARNINGS = frozenset(
    (
        "c-assignment-condition",
        "c-attribute",
        "c-case-missing",
        "c-case-range",
        "c-comment",
        "c-comparison",
        "c-conversion",
        "c-dangling-else",
        "c-empty-body",
        "c-indentation",
        "c-index",
        "c-initialiser",
        "c-input-pin",
        "c-interrupt-enable",
        "c-interrupt-flag",
        "c-local-address",
        "c-logical-constant",
        "c-loop-condition",
        "c-missing-return",
        "c-no-effect",
        "c-number",
        "c-open-drain",
        "c-overflow",
        "c-port-direction",
        "c-pragma",
        "c-precedence",
        "c-preprocessor",
        "c-return",
        "c-shared-variable",
        "c-shift",
        "c-sign-compare",
        "c-sizeof",
        "c-string-comparison",
        "c-uninitialised",
        "c-unreachable",
        "c-unsequenced",
        "c-unused",
        "c-unused-result",
        "c-user-message",
        "c-watchdog",
        "c-xor-power",
        "delay-rounded",
    )
)
"""The codes that a warning can have, which `unwanted` leaves out; some are also codes of errors."""


WORDS_NEEDED = "needed_words"
"""The key, among the details of the error, of the words that a program too large for flash needs."""


class Fatal(Exception):
    """Raised inside the compiler to abandon a construct whose error has been reported."""


def is_own_file(place: Location) -> bool:
    """Return whether a location is in a file of the compiler's own, such as `<string.h>`."""
    return place.file is not None and place.file.startswith("<")


class Reporter:
    """Collects diagnostics and keeps the text of each source file."""

    def __init__(self, unwanted: frozenset[str] = frozenset()) -> None:
        self.unwanted = unwanted
        """The codes of warnings that are left out."""
        self.texts: dict[str, str] = {}
        self._lines: dict[str, list[str]] = {}
        self._diagnostics: dict[Diagnostic, None] = {}
        self._errors = 0
        self.details: dict[str, object] = {}
        """What the error states beside its diagnostics."""
        self.lost: set[str] = set()
        """Names whose declarations have errors: that they are missing is not reported again."""

    def add_source(self, file: str, text: str) -> None:
        """Register the text of a file, so that diagnostics can quote its lines."""
        self.texts[file] = text
        self._lines[file] = text.splitlines()

    def lines(self, file: str) -> list[str]:
        return self._lines.get(file, [])

    def _line(self, place: Location) -> str | None:
        lines = self._lines.get(place.file or "", [])
        return lines[place.line - 1] if place.line and place.line <= len(lines) else None

    def _add(self, severity: Severity, code: str, message: str, place: Location, hint: str | None) -> None:
        line = self._line(place)
        if line is not None and place.column is None:  # a directive or a line of assembly: its first word
            place = Location(place.file, place.line, len(line) - len(line.lstrip()) + 1)
        self._diagnostics[Diagnostic(severity, code, message, place, hint)] = None

    def error(self, code: str, message: str, place: Location, hint: str | None = None) -> None:
        """Report an error; raise InputError once there are too many to be useful."""
        self._add("error", code, message, place, hint)
        self._errors += 1
        if self._errors >= ERRORS:
            raise self.failure()

    def warn(self, code: str, message: str, place: Location, hint: str | None = None) -> None:
        """Report a warning, unless it is unwanted or about the compiler's own files."""
        if not is_own_file(place) and code not in self.unwanted:
            self._add("warning", code, message, place, hint)

    @property
    def errors(self) -> int:
        """Return the number of errors so far."""
        return self._errors

    def fatal(self, code: str, message: str, place: Location, hint: str | None = None) -> Fatal:
        """Report an error; the caller raises the exception that is returned."""
        self.error(code, message, place, hint)
        return Fatal(message)

    def too_deep(self, place: Location) -> Fatal:
        """Report nesting deeper than the compiler supports; the caller raises the exception that is
        returned.
        """
        return self.fatal(
            "nested-too-deeply",
            "something in the program is nested too deeply",
            place,
            hint="look for parentheses or braces that are never closed, or divide the expression",
        )

    def ordered(self) -> tuple[Diagnostic, ...]:
        """Return all diagnostics in source order."""
        files: Mapping[str, int] = {file: number for number, file in enumerate(self.texts)}

        def key(diagnostic: Diagnostic) -> tuple[int, int, int]:
            place = diagnostic.location or Location()
            return files.get(place.file or "", len(files)), place.line or 0, place.column or 0

        return tuple(sorted(self._diagnostics, key=key))

    def source_lines(self) -> SourceLines:
        """Return the source lines that the diagnostics point to."""
        quoted = {}
        for diagnostic in self._diagnostics:
            place = diagnostic.location or Location()
            line = self._line(place)
            if line is not None:
                quoted[place.file or "", place.line or 0] = line
        return quoted

    def failure(self) -> InputError:
        """Return the error that carries everything reported."""
        error = InputError.of(self.ordered(), self.source_lines())
        error.details = self.details
        return error

    def stop_on_error(self) -> None:
        """Raise InputError if an error was reported."""
        if any(diagnostic.severity == "error" for diagnostic in self._diagnostics):
            raise self.failure()
