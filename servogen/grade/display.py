"""Names and messages of strangers as text that is safe to show: on a terminal, in JSON, Markdown and HTML.

In: file names, which may hold any byte, and messages that quote a program. Out: text of one meaning that
neither moves the cursor nor becomes a heading, a link or a tag.
"""

from __future__ import annotations

import hashlib
import os
import re
import shlex
import unicodedata
from collections import Counter
from collections.abc import Sequence

MAX_LINES = 60
MAX_COLUMNS = 500
"""The maximum size of a message: a compiler may report thousands of errors, each with a source line."""

MAX_NAME_BYTES = 200
"""The maximum length of a page's file name; file systems allow 255."""


def visible(text: str) -> str:
    """Return `text` with what cannot be printed, except line ends and tabs, as `\\x1b` or `\\u202e`."""
    return "".join(sign if sign.isprintable() or sign in "\n\t" else _escape(sign) for sign in text)


def shown_name(name: str) -> str:
    """Return a file name so that two names never look alike: `\\xff` is a byte that is not UTF-8."""
    return visible(name.replace("\\", "\\\\")).replace("\n", "\\x0a").replace("\t", "\\x09")


def shell_word(path: str) -> str:
    """Return a path as one argument of a command line, which a shell takes for nothing else.

    Bytes that cannot be printed are written as bash and zsh read them, `$'\\xff'`.
    """
    path = path if not path.startswith("-") else f"./{path}"
    if path.isprintable():
        return shlex.quote(path)
    signs = (f"\\{sign}" if sign in "\\'" else sign if sign.isprintable() else _bytes(sign) for sign in path)
    return f"$'{''.join(signs)}'"


def message(text: str) -> str:
    """Return a message that is visible throughout and not longer than a page."""
    lines = text.splitlines()
    shown = [line if len(line) <= MAX_COLUMNS else f"{line[:MAX_COLUMNS]} …" for line in lines[:MAX_LINES]]
    if len(lines) > MAX_LINES:
        shown.append(f"… and {len(lines) - MAX_LINES} more lines")
    return visible("\n".join(shown))


def markdown(text: str) -> str:
    """Return `text` as it reads in Markdown, and in the HTML that is made of it."""
    text = text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    text = re.sub(r"([\\`*\[\]|~#])", r"\\\1", text)
    text = re.sub(r"(?<![A-Za-z0-9])_|_(?![A-Za-z0-9])", r"\\_", text)  # within a word it is not emphasis
    return re.sub(r"(?i)(?<=www)\.|:(?=//)|@", lambda match: f"&#{ord(match[0])};", text)


def page_names(names: Sequence[str]) -> list[str]:
    """Return a file name for the page of each of the different `names`; no two are the same.

    `ana/main.c` becomes `ana+main.c.md`. Other characters than letters, digits, `.`, `_` and `-` become
    `%` and their bytes. A digest keeps apart what a file system takes for the same, and shortens.
    """
    plain = [_page_name(name) for name in names]
    count = Counter(unicodedata.normalize("NFKC", page).casefold() for page in plain)
    return [
        f"{page}.md"
        if count[unicodedata.normalize("NFKC", page).casefold()] == 1
        and len(os.fsencode(page)) <= MAX_NAME_BYTES
        else f"{_shorten(page)}~{hashlib.sha256(os.fsencode(name)).hexdigest()[:32]}.md"
        for name, page in zip(names, plain, strict=True)
    ]


def _page_name(name: str) -> str:
    return "".join(
        "+" if sign == "/" else sign if sign.isalnum() or sign in "._-" else _percent(sign) for sign in name
    )


def _shorten(name: str) -> str:
    return os.fsencode(name)[: MAX_NAME_BYTES // 2].decode("utf-8", "ignore")


def _bytes(sign: str) -> str:
    return "".join(f"\\x{byte:02x}" for byte in os.fsencode(sign))


def _percent(sign: str) -> str:
    return "".join(f"%{byte:02X}" for byte in os.fsencode(sign))


def _escape(sign: str) -> str:
    number = ord(sign)
    if 0xDC80 <= number <= 0xDCFF:  # a byte of a file name that is not UTF-8
        return f"\\x{number - 0xDC00:02x}"
    if number < 0x100:
        return f"\\x{number:02x}"
    return f"\\u{number:04x}" if number < 0x10000 else f"\\U{number:08x}"
