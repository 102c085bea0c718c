"""Directives that select which lines are assembled: IF, WHILE, MACRO, INCLUDE, END and related ones."""

from __future__ import annotations

import re

from servogen.errors import Diagnostic, InputError
from servogen.pic.assembler.blocks import Condition, EndOfSource, ExitMacro, Macro
from servogen.pic.assembler.header import HEADERS, header_device, header_text
from servogen.pic.assembler.messages import SourceError
from servogen.pic.assembler.source import Statement, lines_of
from servogen.pic.assembler.state import Directive, Pass
from servogen.pic.assembler.text import IDENTIFIER


def _open(state: Pass, found: Statement, holds: bool) -> None:
    state.conditions.append(Condition(holds, holds, found.place))


def _open_closed(state: Pass, found: Statement) -> bool:
    """Open an IF inside lines that are not assembled: it is not assembled either, whatever its condition."""
    if state.active:
        return False
    state.conditions.append(Condition(False, True, found.place))
    return True


def _if(state: Pass, found: Statement) -> None:
    if not _open_closed(state, found):
        _open(state, found, False)
        holds = state.one(found) != 0
        state.conditions[-1] = Condition(holds, holds, found.place)


def _ifdef(state: Pass, found: Statement) -> None:
    if not _open_closed(state, found):
        _open(state, found, _asks_defined(state, found))


def _ifndef(state: Pass, found: Statement) -> None:
    if not _open_closed(state, found):
        _open(state, found, not _asks_defined(state, found))


def _asks_defined(state: Pass, found: Statement) -> bool:
    """Return whether the name has a value or a replacement.

    As in MPASM and gpasm, the second pass knows every name of the first; if that changes the answer, the
    lines of the two passes differ, which is reported.
    """
    match = IDENTIFIER.match(found.rest.chars)
    if match is None:
        raise SourceError("asm-missing-argument", f"{found.operation.upper()} needs a name", found.column)
    name = match[0]
    symbol = state.symbols.find(name)
    known = name in state.definitions or symbol is not None
    if (
        known
        and name not in state.definitions
        and symbol is not None
        and symbol.in_pass != state.symbols.in_pass
    ):
        state.report(
            "warning",
            "asm-defined-later",
            f"'{name}' is defined further below: in the second pass the answer is another",
            found.line,
            found.rest.column(0),
            "define it before, or with #define",
        )
    return known


def _top(state: Pass, found: Statement) -> Condition:
    if not state.conditions:
        raise SourceError("asm-unexpected-directive", f"{found.operation.upper()} without IF", found.column)
    return state.conditions[-1]


def _else(state: Pass, found: Statement) -> None:
    condition = _top(state, found)
    if condition.seen_else:
        raise SourceError("asm-unexpected-directive", "a second ELSE of the same IF", found.column)
    condition.seen_else = True
    condition.active, condition.taken = not condition.taken, True


def _endif(state: Pass, found: Statement) -> None:
    _top(state, found)
    state.conditions.pop()


MAX_TURNS = 1024
MAX_TOTAL_TURNS = 16384
"""The maximum number of turns of one WHILE, and of all in a pass; more are assumed to be endless."""


def _while(state: Pass, found: Statement) -> None:
    condition = state.expression(found.rest)
    body = state.readers[-1].block("while", "endw", found)
    state.spend(len(body))
    for _ in range(MAX_TURNS):
        if not state.evaluate(condition):
            return
        state.turns += 1
        if state.turns > MAX_TOTAL_TURNS:
            break
        state.turning += 1
        try:
            state.run(body)
        finally:
            state.turning -= 1
    raise SourceError("asm-endless-loop", "this WHILE does not end", found.column)


def _macro(state: Pass, found: Statement) -> None:
    body = state.readers[-1].block("macro", "endm", found)
    state.spend(len(body))
    if found.label is None:
        raise SourceError("asm-missing-name", "MACRO needs a name in front of it", found.column)
    if found.label in state.macros:
        raise SourceError(
            "asm-duplicate-symbol", f"macro '{found.label}' is defined already", found.label_column
        )
    names = tuple(part.chars for part in found.rest.split(",")) if found.rest else ()
    for name in names:
        if not IDENTIFIER.fullmatch(name):
            raise SourceError(
                "asm-bad-argument", f"'{name}' is not a name for a parameter", found.rest.column(0)
            )
    state.macros[found.label] = Macro(found.label, names, tuple(body))


def _exitm(state: Pass, found: Statement) -> None:
    if not found.line.within:
        raise SourceError("asm-unexpected-directive", "EXITM outside a macro", found.column)
    raise ExitMacro


def _unmatched(state: Pass, found: Statement) -> None:
    raise SourceError(
        "asm-unexpected-directive", f"{found.operation.upper()} without its beginning", found.column
    )


_FILE = re.compile(r'<([^>]*)>|"([^"]*)"|(\S+)')


def _include(state: Pass, found: Statement) -> None:
    match = _FILE.match(found.rest.chars)
    if match is None:
        raise SourceError("asm-missing-argument", "INCLUDE needs a file name", found.column)
    name = match[1] or match[2] or match[3]
    try:
        text = state.include(name)
    except InputError as refusal:
        raise SourceError(
            "asm-include", f"include file '{name}' {refusal.message}", found.rest.column(0), refusal.hint
        ) from refusal
    if text is None:
        chip = header_device(name)
        if chip is None:
            raise SourceError(
                "asm-include",
                f"include file '{name}' not found",
                found.rest.column(0),
                f"built in: {', '.join(HEADERS)}; others lie beside the source",
            )
        if state.device is None:
            state.choose(chip)
        state.run(lines_of(header_text(chip), name))
        return
    state.sources[name] = text
    state.run(lines_of(text, name))


def _end(state: Pass, found: Statement) -> None:
    if state.turning:
        raise SourceError("asm-unclosed-block", "END within a WHILE", found.column)
    for condition in state.conditions:
        state.log.add(
            Diagnostic("warning", "asm-unclosed-if", "this IF has no ENDIF before END", condition.place)
        )
    raise EndOfSource


CONTROL: dict[str, Directive] = {
    **{
        f"{mark}{name}": directive
        for mark in ("", "#")
        for name, directive in (
            ("if", _if),
            ("ifdef", _ifdef),
            ("ifndef", _ifndef),
            ("else", _else),
            ("endif", _endif),
            ("include", _include),
        )
    },
    "while": _while,
    "endw": _unmatched,
    "macro": _macro,
    "endm": _unmatched,
    "endc": _unmatched,
    "exitm": _exitm,
    "end": _end,
}
