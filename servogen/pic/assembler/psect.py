"""Sources for Microchip's pic-as: what they say otherwise than MPASM's (pic-as User's Guide, DS50002974).

A source that includes `xc.inc` is one. Numbers are decimal, comments are those of C too, PSECT opens
sections, and a name that is `global` may be defined in another source.
"""

from __future__ import annotations

import re

from servogen.errors import did_you_mean
from servogen.pic.assembler.layout import LAYOUT, counted, reserve
from servogen.pic.assembler.messages import SourceError
from servogen.pic.assembler.sections import Kind
from servogen.pic.assembler.settings import SETTINGS
from servogen.pic.assembler.source import Statement
from servogen.pic.assembler.source import statement as parsed
from servogen.pic.assembler.state import Directive, Pass
from servogen.pic.assembler.text import IDENTIFIER, Text

_INCLUDES = re.compile(r"^[ \t]*#?include[ \t]+[<\"]xc\.inc[>\"]", re.IGNORECASE | re.MULTILINE)
_COMMENT = re.compile(
    r";[^\n]*|\"(?:\\[^\n]|[^\"\\\n])*\"?|'(?:\\.|[^'\\\n])'|(?P<comment>/\*.*?\*/|//[^\n]*)|/\*.*", re.DOTALL
)
"""What is not closed is matched, too, to its end: nothing is read twice."""
RADIX = 10
NOT_SAID = frozenset(("asm-opcode-column", "asm-label-column", "asm-no-end", "asm-bank", "asm-page"))
"""Remarks about what is usual here."""

CLASSES: dict[str, tuple[Kind, str | None]] = {
    **dict.fromkeys(("CODE", "CONST", "ENTRY", "STRCODE", "STRING"), ("code", None)),
    **dict.fromkeys(("RAM", "BANK0", "COMMON", "ABS1"), ("udata", None)),
    "EEDATA": ("code", "eedata"),
    "IDLOC": ("code", ".idlocs"),
}
"""What a class of the linker stands for here, and the block of memory that it names."""
OF_HEADER = {"code": "CODE", "data": "STRCODE", "edata": "EEDATA"} | dict.fromkeys(
    ("udata", "udata_bank0", "udata_shr"), "RAM"
)
"""The sections that xc.inc opens, and their classes."""
FLAGS = frozenset(
    (
        *("abs", "bit", "class", "delta", "global", "inline", "keep", "limit", "local", "merge", "noexec"),
        *("optim", "ovrld", "pure", "reloc", "size", "space", "split", "with"),
    )
)


def is_pic_as(text: str) -> bool:
    """Return whether a source is one for pic-as."""
    return _INCLUDES.search(text) is not None


def without_comments(text: str) -> str:
    """Return a text with blanks in place of the comments of C; every character keeps its line and column."""
    return _COMMENT.sub(
        lambda found: re.sub(r"[^\r\n]", " ", found[0]) if found["comment"] else found[0], text
    )


def begin(state: Pass) -> None:
    """Go on as pic-as."""
    state.pic_as = True
    state.radix = RADIX
    state.directives = {**state.directives, **PIC_AS}
    state.log.muted |= NOT_SAID


def _psect(state: Pass, statement: Statement) -> None:
    """Process `PSECT name,class=CODE,delta=2`; flags are needed only the first time."""
    name, *flags = statement.rest.split(",")
    if not name:
        raise SourceError("asm-missing-argument", "PSECT needs a name", statement.column)
    known = state.sections.named(name.chars)
    values = dict(_flag(flag) for flag in flags)
    if known is not None:
        state.open_section(name.chars, known.kind, 0 if "abs" in values else known.origin, statement)
        return
    class_ = values.get("class", OF_HEADER.get(name.chars, "RAM" if values.get("space") == "1" else ""))
    if class_.upper() not in CLASSES:
        raise SourceError(
            "asm-section",
            f"section '{name.chars}' has {f'the class {class_!r}' if class_ else 'no class'}",
            name.column(0),
            did_you_mean(class_, CLASSES),
        )
    kind, block = CLASSES[class_.upper()]
    if kind == "code" and "class" in values and values.get("delta") != "2":
        raise SourceError(
            "asm-section", f"section '{name.chars}' is of words: delta=2", name.column(0), "add delta=2"
        )
    if kind == "udata" and "ovrld" in values:
        kind = "udata_ovr"
    state.open_section(name.chars, kind, 0 if "abs" in values else None, statement).block = block


def _flag(flag: Text) -> tuple[str, str]:
    key, _, value = (part.strip() for part in flag.chars.partition("="))
    if key.lower() not in FLAGS:
        raise SourceError(
            "asm-bad-argument", f"'{key}' is no flag of PSECT", flag.column(0), did_you_mean(key, FLAGS)
        )
    return key.lower(), value


def _org(state: Pass, statement: Statement) -> None:
    """Go on at a place in the section, which for one that is `abs` is an address."""
    section = state.sections.current
    if section is None:
        raise SourceError("asm-section", "ORG stands in no section", statement.column, "PSECT opens one")
    if state.is_initial_data:
        raise SourceError("asm-section", "ORG stands in IDATA", statement.column, "RES places bytes of 0")
    state.close_section()
    state.location = section.base + counted(state.one(statement), statement)


def _ds(state: Pass, statement: Statement) -> None:
    """Reserve bytes, or words of code; their name may stand in the line before."""
    reserve(state, statement, statement.label or state.lone_label)


def _rept(state: Pass, statement: Statement) -> None:
    """Repeat the lines up to ENDM as often as its operand says."""
    body = state.macro_body(statement)
    for turn in range(1, 1 + counted(state.one(statement), statement, "turns")):
        state.spend()
        state.expand(body, {}, f"in turn {turn} of REPT at", statement)


def _irp(state: Pass, statement: Statement) -> None:
    """Repeat the lines up to ENDM with a name for each text of a list, or, IRPC, each character of one."""
    body = state.macro_body(statement)
    name, *values = (part.chars for part in statement.rest.split(","))
    if not IDENTIFIER.fullmatch(name):
        raise SourceError(
            "asm-bad-argument", f"'{name}' is not a name for a parameter", statement.rest.column(0)
        )
    for value in values if statement.operation == "irp" else "".join(values[:1]):
        state.spend()
        state.expand(body, {name: value}, f"with '{value}' for '{name}' of {statement.word} at", statement)


def _elsif(state: Pass, statement: Statement) -> None:
    """Go on with another condition where none before it held."""
    if not state.conditions or state.conditions[-1].seen_else:
        raise SourceError(
            "asm-unexpected-directive", f"{statement.word} without IF, or behind ELSE", statement.column
        )
    condition = state.conditions[-1]
    condition.active = False  # also after an error
    if not condition.taken:
        asked = parsed(state.substituted(statement.line), state)  # in lines that are left out it is not yet
        condition.active = condition.taken = state.one(asked) != 0


_nothing = SETTINGS["page"]

PIC_AS: dict[str, Directive] = {
    "psect": _psect,
    "org": _org,
    "ds": _ds,
    "db": LAYOUT["de"],  # one byte in each word
    "extrn": LAYOUT["extern"],
    "rept": _rept,
    **dict.fromkeys(("irp", "irpc"), _irp),
    **dict.fromkeys(("elsif", "#elif"), _elsif),
    **dict.fromkeys(("pagewidth", "xref", "signat", "fncall", "fnroot", "fnsize", "fnarg"), _nothing),
}
"""The directives that MPASM does not have, or has with another meaning."""
