"""The format strings of `printf` and `sprintf`, taken apart at compile time.

In: the bytes of a format. Out: its parts, each with the library function that writes it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

_CONVERSION = re.compile(
    rb"%(?P<flags>[-0+ #]*)(?P<width>\d+|\*)?(?P<precision>\.[\d*]*)?(?P<size>hh?|ll?)?(?P<kind>.?)",
    re.DOTALL,
)
LEFT, ZEROS, PLUS, SPACE, SIGNED, CAPITALS = 1, 2, 4, 8, 16, 32
"""The bits of the flags that the library's `format.c` takes."""
_FLAGS = {ord("-"): LEFT, ord("0"): ZEROS, ord("+"): PLUS, ord(" "): SPACE}
_NUMBERS = {
    # conversion: base, flags
    b"d": (10, SIGNED),
    b"i": (10, SIGNED),
    b"u": (10, 0),
    b"x": (16, 0),
    b"X": (16, CAPITALS),
    b"o": (8, 0),
}


@dataclass(frozen=True, slots=True)
class FormatPart:
    """Text, or one conversion. `function` is the last word of the library function's name, `numbers` are its
    further arguments.
    """

    function: str
    text: bytes = b""
    numbers: tuple[int, ...] = ()
    spelling: str = ""
    problem: str | None = None

    @property
    def takes_value(self) -> bool:
        return bool(self.spelling)


def parts(text: bytes) -> Iterator[FormatPart]:
    """Yield the parts of a format. A part with a `problem` says what is not supported."""
    position, plain = 0, b""
    while position < len(text):
        match = _CONVERSION.match(text, position)
        if match is None:
            plain += text[position : position + 1]
            position += 1
            continue
        position = match.end()
        if match.group() == b"%%":
            plain += b"%"
            continue
        part = _conversion(match)
        spaces = b" " * (int(match["width"] or 1) - 1) if part.function == "char" else b""
        before, after = (b"", spaces) if b"-" in match["flags"] else (spaces, b"")
        yield from _plain(plain + before)
        plain = after
        yield part
    yield from _plain(plain)


def _plain(text: bytes) -> Iterator[FormatPart]:
    if len(text) == 1:
        yield FormatPart("char", numbers=(text[0],))
    elif text:
        yield FormatPart("text", text)


def _conversion(match: re.Match[bytes]) -> FormatPart:
    """Return the part for one conversion specification (ISO C 7.21.6.1)."""
    kind, spelling = match["kind"], match.group().decode("latin-1")
    width, flags = int(match["width"] or 0) if match["width"] != b"*" else 0, 0
    for flag in match["flags"]:
        flags |= _FLAGS.get(flag, 0)
    unsupported = b"#" in match["flags"] or match["width"] == b"*" or match["precision"]
    unsupported = unsupported or match["size"] == b"ll" or (match["size"] and kind not in _NUMBERS)
    if unsupported or width > 255 or kind not in (b"c", b"s", *_NUMBERS):
        allowed = "%d %i %u %x %X %o %c %s, flags - 0 + and space, a width up to 255, hh h l"
        return FormatPart(
            "", spelling=spelling, problem=f"'{spelling}' is not supported; there are {allowed}"
        )
    if kind == b"c":
        return FormatPart("char", spelling=spelling)
    if kind == b"s":
        if not width:
            return FormatPart("text", spelling=spelling)
        return FormatPart("string", numbers=(width, flags & LEFT), spelling=spelling)
    base, more = _NUMBERS[kind]
    if match["size"] == b"l":
        return FormatPart("long", numbers=(base, width, flags | more), spelling=spelling)
    if base == 10 and not width and not flags:
        return FormatPart("signed" if more else "unsigned", spelling=spelling)
    return FormatPart("int", numbers=(base, width, flags | more), spelling=spelling)
