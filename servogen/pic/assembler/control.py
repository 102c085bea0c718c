"""Directives that select which lines are assembled: IF, WHILE, MACRO, INCLUDE, END and related ones."""

from __future__ import annotations

import re
from collections.abc import Callable

from servogen.errors import Diagnostic, InputError
from servogen.pic.assembler.blocks import Condition, EndOfSource, ExitMacro, Macro
from servogen.pic.assembler.header import HEADERS, PIC_AS_HEADER, header_device, header_text, pic_as_header
from servogen.pic.assembler.messages import SourceError
from servogen.pic.assembler.psect import begin, without_comments
from servogen.pic.assembler.source import Statement, lines_of
from servogen.pic.assembler.state import Directive, Pass
from servogen.pic.assembler.text import IDENTIFIER


def _decide(state: Pass, statement: Statement, holds: Callable[[], bool]) -> None:
    """Open an IF; inside lines that are not assembled, it is not assembled either, whatever its condition."""
    if not state.active:
        state.conditions.append(Condition(False, True, statement.place))
        return
    # Opened before its condition is evaluated: after an error in it, the ENDIF still has its IF.
    condition = Condition(False, False, statement.place)
    state.conditions.append(condition)
    condition.active = condition.taken = holds()


def _if(state: Pass, statement: Statement) -> None:
    _decide(state, statement, lambda: state.one(statement) != 0)


def _ifdef(state: Pass, statement: Statement) -> None:
    _decide(state, statement, lambda: _asks_defined(state, statement))


def _ifndef(state: Pass, statement: Statement) -> None:
    _decide(state, statement, lambda: not _asks_defined(state, statement))


def _asks_defined(state: Pass, statement: Statement) -> bool:
    """Return whether the name has a value or a replacement.

    As in MPASM and gpasm, the second pass knows every name of the first; if that changes the answer, the
    lines of the two passes differ, which is reported.
    """
    match = IDENTIFIER.match(statement.rest.chars)
    if match is None:
        raise SourceError(
            "asm-missing-argument", f"{statement.operation.upper()} needs a name", statement.column
        )
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
            f"'{name}' is defined further below: the second pass gives a different answer",
            statement.line,
            statement.rest.column(0),
            "define it before, or with #define",
        )
    return known


def _top(state: Pass, statement: Statement) -> Condition:
    if not state.conditions:
        raise SourceError(
            "asm-unexpected-directive", f"{statement.operation.upper()} without IF", statement.column
        )
    return state.conditions[-1]


def _else(state: Pass, statement: Statement) -> None:
    condition = _top(state, statement)
    if condition.seen_else:
        raise SourceError("asm-unexpected-directive", "a second ELSE of the same IF", statement.column)
    condition.seen_else = True
    condition.active, condition.taken = not condition.taken, True


def _endif(state: Pass, statement: Statement) -> None:
    _top(state, statement)
    state.conditions.pop()


MAX_TURNS = 1024
MAX_TOTAL_TURNS = 16384
"""The maximum number of turns of one WHILE, and of all in a pass; more are assumed to be endless."""


def _while(state: Pass, statement: Statement) -> None:
    condition = state.expression(statement.rest)
    body = state.readers[-1].block("while", "endw", statement)
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
    raise SourceError("asm-endless-loop", "this WHILE does not end", statement.column)


def _macro(state: Pass, statement: Statement) -> None:
    body = state.macro_body(statement)
    if statement.label is None:
        raise SourceError("asm-missing-name", "MACRO needs a name in front of it", statement.column)
    if statement.label in state.macros:
        raise SourceError(
            "asm-duplicate-symbol", f"macro '{statement.label}' is defined already", statement.label_column
        )
    names = tuple(part.chars for part in statement.rest.split(",")) if statement.rest else ()
    for name in names:
        if not IDENTIFIER.fullmatch(name):
            raise SourceError(
                "asm-bad-argument", f"'{name}' is not a name for a parameter", statement.rest.column(0)
            )
    state.macros[statement.label] = Macro(statement.label, names, tuple(body))


def _exitm(state: Pass, statement: Statement) -> None:
    if not statement.line.within:
        raise SourceError("asm-unexpected-directive", "EXITM outside a macro", statement.column)
    raise ExitMacro


def _unmatched(state: Pass, statement: Statement) -> None:
    raise SourceError(
        "asm-unexpected-directive", f"{statement.operation.upper()} without its beginning", statement.column
    )


_FILE = re.compile(r'<([^>]*)>|"([^"]*)"|(\S+)')


def _include(state: Pass, statement: Statement) -> None:
    match = _FILE.match(statement.rest.chars)
    if match is None:
        raise SourceError("asm-missing-argument", "INCLUDE needs a file name", statement.column)
    name = match[1] or match[2] or match[3]
    try:
        text = state.include(name)
    except InputError as refusal:
        raise SourceError(
            "asm-include", f"include file '{name}' {refusal.message}", statement.rest.column(0), refusal.hint
        ) from refusal
    if text is None and name.lower() == PIC_AS_HEADER:
        if not state.pic_as:
            begin(state)
        if not state.symbols.in_this_pass("STATUS"):
            state.run(lines_of(pic_as_header(), name))
        return
    if text is None:
        chip = header_device(name)
        if chip is None:
            raise SourceError(
                "asm-include",
                f"include file '{name}' not found",
                statement.rest.column(0),
                f"built in: {', '.join(HEADERS)}; others lie beside the source",
            )
        if state.device is None:
            state.choose(chip)
        if not state.pic_as:
            state.run(lines_of(header_text(chip), name))
        return
    state.sources[name] = text
    state.run(lines_of(without_comments(text) if state.pic_as else text, name))


def _end(state: Pass, statement: Statement) -> None:
    if state.turning:
        raise SourceError("asm-unclosed-block", "END within a WHILE", statement.column)
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
