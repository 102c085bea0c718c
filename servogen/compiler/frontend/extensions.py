"""Rewrites, token by token, the extensions of these compilers that a C parser does not accept.

In: preprocessing tokens. Out: tokens of plain C, and what was extracted from them: fixed addresses, interrupt
functions, assembly at file level. `__CONFIG(…)` and `__EEPROM_DATA(…)` become declarations.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from servogen.compiler.diagnostics import Reporter
from servogen.compiler.frontend.asm_blocks import MARKER, AsmBlock
from servogen.compiler.frontend.preprocessor import PToken
from servogen.errors import Location

EEPROM_NAME = "__servogen_eeprom"
CONFIG_NAME = "__servogen_config"
BIT_MEMBER = "__servogen_bit"
_DROPPED = frozenset(
    [
        "near",
        "far",
        "__near",
        "__far",
        "persistent",
        "__persistent",
        "__reentrant",
        "reentrant",
        "__ram",
        "rom",
        "__rom",
    ]
)
_TYPE_WORDS = frozenset(["void", "int", "char", "unsigned", "signed", "long", "short", "static"])


@dataclass(slots=True)
class Rewritten:
    tokens: list[PToken] = field(default_factory=list)
    addresses: dict[tuple[str | None, int | None, int | None], int] = field(default_factory=dict)
    """Fixed addresses by the (file, line, column) of the declared name."""
    interrupts: set[str] = field(default_factory=set)
    file_asm: list[tuple[int, Location]] = field(default_factory=list)
    """Blocks of assembly outside functions, by number."""


class _Rewriter:
    def __init__(self, tokens: list[PToken], blocks: list[AsmBlock], reporter: Reporter, serial: int) -> None:
        self.tokens = tokens
        self.blocks = blocks
        self.reporter = reporter
        self.out = Rewritten()
        self.depth = 0
        self.at = 0
        self.serial = serial
        self.pending_address: int | None = None
        self.pending_interrupt = False

    def text(self, ahead: int = 0) -> str:
        index = self.at + ahead
        return self.tokens[index].text if index < len(self.tokens) else ""

    def emit(self, text: str, place: Location) -> None:
        self.out.tokens.append(PToken(text, place))

    def run(self) -> Rewritten:
        while self.at < len(self.tokens):
            token = self.tokens[self.at]
            handler = _HANDLERS.get(token.text)
            if handler is None or not handler(self, token):
                self.plain(token)
        return self.out

    def plain(self, token: PToken) -> None:
        if token.text == "{":
            self.depth += 1
        elif token.text == "}":
            self.depth -= 1
        is_name = re.match(r"[A-Za-z_]", token.text) is not None
        if self.pending_interrupt and is_name and self.text(1) == "(":
            self.out.interrupts.add(token.text)
            self.pending_interrupt = False
        if self.pending_address is not None and is_name and self.text(1) in (";", "=", "[", ","):
            self.out.addresses[(token.place.file, token.place.line, token.place.column)] = (
                self.pending_address
            )
            self.pending_address = None
        self.out.tokens.append(token)
        self.at += 1

    def arguments(self) -> list[PToken]:
        """Return the tokens in the parentheses at `at`, and advance past them."""
        depth, found = 0, []
        while self.at < len(self.tokens):
            token = self.tokens[self.at]
            self.at += 1
            depth += {"(": 1, ")": -1}.get(token.text, 0)
            if depth == 0:
                break
            found.append(token)
        return found[1:]

    def constant(self, tokens: list[PToken], place: Location) -> int:
        words = [re.sub(r"(?<=\w)[uUlL]+$", "", token.text) for token in tokens if token.text not in "()"]
        total, sign = 0, 1
        try:
            for word in words:
                if word in "+-":
                    sign = 1 if word == "+" else -1
                else:
                    total, sign = total + sign * int(word, 8 if re.fullmatch("0[0-7]+", word) else 0), 1
        except ValueError:
            self.reporter.error("c-address", "a fixed address must be a number", place)
            return 0
        return total


def _declared_name(tokens: list[PToken]) -> PToken | None:
    """Return the name at the end of a declarator, before any array lengths."""
    depth = 0
    for token in reversed(tokens):
        depth += {"]": 1, "[": -1}.get(token.text, 0)
        if depth == 0 and token.text != "[":
            return token
    return None


def _at_sign(self: _Rewriter, token: PToken) -> bool:
    """Rewrite `name @ address`."""
    name = _declared_name(self.out.tokens)
    self.at += 1
    found = []
    while self.at < len(self.tokens) and self.text() not in (";", ",", "="):
        found.append(self.tokens[self.at])
        self.at += 1
    place = name.place if name is not None else token.place
    self.out.addresses[(place.file, place.line, place.column)] = self.constant(found, token.place)
    return True


def _at_word(self: _Rewriter, token: PToken) -> bool:
    """Rewrite `__at(address)` before or after the name."""
    if self.text(1) != "(":
        return False
    self.at += 1
    value = self.constant(self.arguments(), token.place)
    before = _declared_name(self.out.tokens)
    if self.text() in (";", "=", ",") and before is not None:
        self.out.addresses[(before.place.file, before.place.line, before.place.column)] = value
    else:
        self.pending_address = value
    return True


def _interrupt(self: _Rewriter, token: PToken) -> bool:
    """Rewrite `interrupt` and `__interrupt()` as qualifiers before the name, or after the parameters as in
    SDCC; a function named interrupt is kept.
    """
    if token.text == "interrupt" and self.text(1) == "(":
        self.out.interrupts.add("interrupt")
        return False
    if self.depth:
        return False
    self.at += 1
    if self.text() == "(":
        self.arguments()
    if self.out.tokens and self.out.tokens[-1].text == ")":
        self.out.interrupts.add(_name_before_parameters(self.out.tokens))
    else:
        self.pending_interrupt = True
    return True


def _name_before_parameters(tokens: list[PToken]) -> str:
    depth = 0
    for index in reversed(range(1, len(tokens))):
        depth += {")": 1, "(": -1}.get(tokens[index].text, 0)
        if depth == 0:
            return tokens[index - 1].text
    return ""


def _code(self: _Rewriter, token: PToken) -> bool:
    """Rewrite SDCC's `__code` as const, because everything in flash is constant."""
    self.emit("const", token.place)
    self.at += 1
    return True


def _drop(self: _Rewriter, token: PToken) -> bool:
    if self.depth and self.text(1) in ("=", ";", "(", ")", ","):
        return False
    self.at += 1
    return True


def _asm_call(self: _Rewriter, token: PToken) -> bool:
    """Rewrite `asm("…")`; adjacent strings are joined, as everywhere in C."""
    if self.text(1) == "volatile":
        self.at += 1
    if self.text(1) != "(":
        return False
    self.at += 1
    strings = self.arguments()
    if (other := next((each for each in strings if each.text[0] != '"'), None)) is not None:
        self.reporter.error(
            "c-unsupported",
            "assembly with operands is not supported: only strings stand in the parentheses",
            other.place,
            hint="the global variable v is _v in assembly",
        )
        strings = []
    text = "".join(each.text[1:-1] for each in strings)
    body = text.replace("\\n", "\n").replace("\\t", "\t").replace('\\"', '"')
    lines = [(token.place.line or 0, line) for line in body.split("\n") if line.strip()]
    self.blocks.append(AsmBlock(token.place.file or "", tuple(lines)))
    _asm_marker(self, token, len(self.blocks) - 1)
    return True


def _asm_block(self: _Rewriter, token: PToken) -> bool:
    self.at += 1
    number = int(self.arguments()[0].text)
    _asm_marker(self, token, number)
    return True


def _asm_marker(self: _Rewriter, token: PToken, number: int) -> None:
    if self.depth == 0:
        self.out.file_asm.append((number, token.place))
        if self.text() == ";":
            self.at += 1
        return
    for text in (MARKER, "(", str(number), ")"):
        self.emit(text, token.place)
    if self.text() != ";":
        self.emit(";", token.place)


def _declaration_call(self: _Rewriter, token: PToken) -> bool:
    """Rewrite `__EEPROM_DATA(…)` and `__CONFIG(…)` as declarations that the semantic analysis evaluates."""
    if self.text(1) != "(" or self.depth:
        return False
    self.at += 1
    inside = self.arguments()
    self.serial += 1
    if token.text == "__EEPROM_DATA":
        words = ["const", "unsigned", "char", f"{EEPROM_NAME}{self.serial}", "[", "]", "=", "{"]
        closing = ["}"]
    else:
        words = ["enum", "{", f"{CONFIG_NAME}{self.serial}", "=", "("]
        closing = [")", "}"]
    for word in words:
        self.emit(word, token.place)
    self.out.tokens += inside
    for word in closing:
        self.emit(word, token.place)
    if self.text() != ";":
        self.emit(";", token.place)
    return True


def _bit_number(self: _Rewriter, token: PToken) -> bool:
    """Rewrite `portb.7`, a member that is a number."""
    if self.text(1) == self.text(2) == ".":
        self.emit("...", token.place)
        self.at += 3
        return True
    if not re.fullmatch(r"\d\d?", self.text(1)):
        return False
    self.out.tokens.append(token)
    self.emit(BIT_MEMBER + self.text(1), self.tokens[self.at + 1].place)
    self.at += 2
    return True


_HANDLERS = {
    "@": _at_sign,
    "__at": _at_word,
    "interrupt": _interrupt,
    "__interrupt": _interrupt,
    "__code": _code,
    "asm": _asm_call,
    "__asm": _asm_call,
    "__asm__": _asm_call,
    MARKER: _asm_block,
    "__EEPROM_DATA": _declaration_call,
    "__CONFIG": _declaration_call,
    ".": _bit_number,
    **dict.fromkeys(_DROPPED, _drop),
}


def rewrite_tokens(
    tokens: list[PToken], blocks: list[AsmBlock], reporter: Reporter, serial: int
) -> Rewritten:
    """Return plain C for the tokens of one file; `serial` keeps generated names distinct between files."""
    return _Rewriter(tokens, blocks, reporter, serial).run()
