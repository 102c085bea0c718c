"""Rewrites, token by token, the extensions of these compilers that a C parser does not accept.

In: preprocessing tokens. Out: tokens of plain C, and what was extracted from them: fixed addresses, interrupt
functions, assembly at file level. `__CONFIG(…)` and `__EEPROM_DATA(…)` become declarations.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from servogen.compiler.diagnostics import Reporter
from servogen.compiler.frontend.assembly import MARKER, AsmBlock, assembler_number
from servogen.compiler.frontend.preprocessor import PToken
from servogen.compiler.frontend.settings import number
from servogen.errors import Location

EEPROM = "__eeprom"
"""XC8's qualifier of variables in the EEPROM."""
EEPROM_NAME = "__servogen_eeprom"
CONFIG_NAME = "__servogen_config"
ID_NAME = "__servogen_id"
BIT_MEMBER = "__servogen_bit"
CRITICAL_LABEL = "__servogen_critical"
_DROPPED = frozenset((
    "near", "far", "__near", "__far", "__reentrant", "reentrant", "__ram", "__data", "__idata", "__xdata",
    "__pdata", "bank0", "bank1", "bank2", "bank3",
))  # fmt: skip
"""Qualifiers without a meaning on this chip: RAM is the same in both banks."""
_NOT_TYPES = frozenset(("return", "case", "else", "do", "goto", "sizeof"))
_TYPE_WORDS = frozenset(["void", "int", "char", "unsigned", "signed", "long", "short", "static"])
_SPECIFIERS = _TYPE_WORDS | frozenset((
    "float", "double", "bit", "bool", "const", "volatile", "register", "extern", "auto", "typedef", "inline",
))  # fmt: skip
"""Words that declare no name."""
_WITH_ARGUMENTS = frozenset(("__at", "__interrupt", "__attribute__", "__using", "__bank", "__section"))


Position = tuple[str | None, int | None, int | None, str]
"""Where a name is declared: file, line, column, and the name; all names that a macro makes share the first
three.
"""


@dataclass(frozen=True, slots=True)
class BitAddress:
    """The fixed address of a bit variable: a bit of a register, of another variable, or of a byte."""

    byte: str | int
    bit: int


FixedAddress = int | BitAddress


@dataclass(slots=True)
class Rewritten:
    """The tokens of one file as plain C, and what its extensions said."""

    tokens: list[PToken] = field(default_factory=list)
    addresses: dict[Position, FixedAddress] = field(default_factory=dict)
    """Fixed addresses by the position of the declared name."""
    interrupts: set[Position] = field(default_factory=set)
    naked: set[Position] = field(default_factory=set)
    """Functions declared with `__naked`."""
    persistent: set[Position] = field(default_factory=set)
    """Variables that keep their values through a reset."""
    hoisted: list[PToken] = field(default_factory=list)
    """Declarations at file level that were made from `__CONFIG` and its like inside functions."""
    file_asm: list[tuple[int, Location]] = field(default_factory=list)
    """Blocks of assembly outside functions, by number."""


class _Rewriter:
    """The state of rewriting one file: the next token and the depth of braces.

    No word waits for the name that it belongs to: `declared` looks for the name at once.
    """

    def __init__(self, tokens: list[PToken], blocks: list[AsmBlock], reporter: Reporter, serial: int) -> None:
        self.tokens = tokens
        self.blocks = blocks
        self.reporter = reporter
        self.out = Rewritten()
        self.depth = 0
        self.index = 0
        self.serial = serial

    def text(self, ahead: int = 0) -> str:
        """Return the text of the token so many places ahead; empty behind the end."""
        index = self.index + ahead
        return self.tokens[index].text if index < len(self.tokens) else ""

    def is_name(self) -> bool:
        """Return whether the word at `index`, which some compilers take for a qualifier, is a name of the
        program here. A qualifier stands before another word, between a type and its `*`, or behind the
        parameters of a function.
        """
        if self.text().startswith("__"):
            return False
        before, after = self.out.tokens[-1].text if self.out.tokens else "", self.text(1)
        if before in ("struct", "union", "enum"):
            return True
        behind_type = re.match(r"[A-Za-z_]", before) and before not in _NOT_TYPES
        qualifies = (
            re.match(r"[A-Za-z_]", after)
            or (after == "*" and behind_type)
            or (before == ")" and self.depth == 0)
        )
        return not qualifies

    def emit(self, text: str, place: Location) -> None:
        self.out.tokens.append(PToken(text, place))

    def run(self) -> Rewritten:
        """Rewrite all tokens; what was moved out of functions follows at the end."""
        while self.index < len(self.tokens):
            token = self.tokens[self.index]
            handler = _HANDLERS.get(token.text)
            if handler is None or not handler(self, token):
                self.plain(token)
        self.out.tokens += self.out.hoisted
        return self.out

    def plain(self, token: PToken) -> None:
        """Copy a token."""
        self.depth += {"{": 1, "}": -1}.get(token.text, 0)
        self.out.tokens.append(token)
        self.index += 1

    def declared(self, word: PToken, *, function: bool = False) -> Position | None:
        """Return the name that a word such as `__at` at its declaration is for: the one that the declaration
        goes on to declare, else the one in front of the word. Reports an error if there is none.
        """
        ahead = _name_ahead(self.tokens, self.index)
        name = self.tokens[ahead] if ahead is not None else _declared_name(self.out.tokens)
        called = name is not None and (
            self.tokens[_behind_words(self.tokens, ahead + 1)].text == "("
            if ahead is not None
            else self.out.tokens[-1].text == ")"
        )
        if name is None or not _is_free(name.text) or (function and not called):
            kind = "function" if function else "name"
            self.reporter.error("c-syntax", f"'{word.text}' stands where no {kind} is declared", word.place)
            return None
        return position(name.place, name.text)

    def arguments(self) -> list[PToken]:
        """Return the tokens in the parentheses at `index`, and advance past them."""
        depth, inside = 0, []
        while self.index < len(self.tokens):
            token = self.tokens[self.index]
            self.index += 1
            depth += {"(": 1, ")": -1}.get(token.text, 0)
            if depth == 0:
                break
            inside.append(token)
        return inside[1:]

    def address(self, tokens: list[PToken], place: Location) -> FixedAddress:
        """Return a fixed address: a number, `name.bit`, or XC8's `&name * 8 + bit`."""
        text = "".join(token.text for token in tokens if token.text not in ("(", ")", "unsigned", "int"))
        if match := re.fullmatch(r"&([A-Za-z_]\w*)\*8(?:\+(\d+))?", text):
            return BitAddress(match[1], int(match[2] or 0))
        if match := re.fullmatch(r"([A-Za-z_]\w*)\.(\d+)", text):
            return BitAddress(match[1], int(match[2]))
        if match := re.fullmatch(r"(\w+)\.(\d+)", text):
            byte = number(match[1])
            if byte is not None:
                return BitAddress(byte, int(match[2]))
        value = assembler_number("".join(_assembler_spelling(token.text) for token in tokens))
        if value is None:
            self.reporter.error("c-address", "a fixed address must be a number", place)
            return 0
        return value


def position(place: Location, name: str) -> Position:
    return place.file, place.line, place.column, name


_TAGGED = frozenset(("struct", "union", "enum"))


def _is_free(text: str) -> bool:
    """Return whether a word can be a name that is declared."""
    return re.match(r"[A-Za-z_]", text) is not None and text not in _SPECIFIERS | _NOT_TYPES | _TAGGED


def _behind_words(tokens: list[PToken], index: int) -> int:
    """Return the first index from there on at which no word such as `__at(0x20)` stands; the last token at
    the end.
    """
    while index < len(tokens) and tokens[index].text in _WITH_ARGUMENTS:
        index += 1
        if index < len(tokens) and tokens[index].text == "(":
            index = _closing(tokens, index)
            index += 1
        elif index < len(tokens) and tokens[index].text[0].isdigit():
            index += 1
    return min(index, len(tokens) - 1)


def _name_ahead(tokens: list[PToken], index: int) -> int | None:
    """Return the index of the name that a declaration declares from there on; None if it declares none before
    its end.
    """
    while index < len(tokens):
        index = _behind_words(tokens, index)
        text = tokens[index].text
        after = _behind_words(tokens, index + 1) if index + 1 < len(tokens) else index
        if text in _TAGGED:
            index += 1 + (re.match(r"[A-Za-z_]", tokens[after].text) is not None)
            if index < len(tokens) and tokens[index].text == "{":
                index = _closing(tokens, index) + 1
        elif text in _SPECIFIERS or text in ("*", "("):
            index += 1
        elif not _is_free(text):
            return None
        elif re.match(r"[A-Za-z_*]", tokens[after].text) or (
            tokens[after].text == "(" and tokens[min(after + 1, len(tokens) - 1)].text == "*"
        ):
            index += 1  # the name of a type, or a qualifier
        else:
            return index
    return None


def _closing(tokens: list[PToken], opening: int) -> int:
    """Return the index of the bracket that closes the one at `opening`; the number of tokens if none does."""
    depth = 0
    for index in range(opening, len(tokens)):
        depth += {"(": 1, "[": 1, "{": 1, ")": -1, "]": -1, "}": -1}.get(tokens[index].text, 0)
        if depth == 0:
            return index
    return len(tokens)


def _assembler_spelling(text: str) -> str:
    """Return a token of a constant expression as the assembler spells it: without suffixes, octal as
    decimal.
    """
    text = re.sub(r"(?<=\w)[uUlL]+$", "", text)
    return str(int(text, 8)) if re.fullmatch("0[0-7]+", text) else text


def _declared_name(tokens: list[PToken]) -> PToken | None:
    """Return the name in the declarator that the tokens end with: before array lengths and parameters, and
    inside the parentheses of `(*name)`.
    """
    index = len(tokens) - 1
    while index >= 0 and tokens[index].text in ("]", ")"):
        opening = _opening(tokens, index)
        nested = opening >= 0 and tokens[opening + 1].text in ("*", "(")
        index = index - 1 if nested else opening - 1
    return tokens[index] if index >= 0 else None


def _opening(tokens: list[PToken], closing: int) -> int:
    """Return the index of the bracket that the one at `closing` closes; -1 if it is not there."""
    depth = 0
    for index in range(closing, -1, -1):
        depth += {")": 1, "]": 1, "(": -1, "[": -1}.get(tokens[index].text, 0)
        if depth == 0:
            return index
    return -1


def _at_sign(self: _Rewriter, token: PToken) -> bool:
    """Rewrite `name @ address`."""
    self.index += 1
    after_sign: list[PToken] = []
    depth = 0
    while self.index < len(self.tokens) and self.text() not in (";", ",", "=", "{"):
        depth += {"(": 1, ")": -1}.get(self.text(), 0)
        if depth < 0:
            break  # the end of the parameters, or of parentheses around a declarator
        after_sign.append(self.tokens[self.index])
        self.index += 1
    _fix(self, token, after_sign)
    return True


def _at_word(self: _Rewriter, token: PToken) -> bool:
    """Rewrite `__at(address)` or `__at address`, before or after the name."""
    if self.text(1) in ("", ";", "=", ","):
        return False
    self.index += 1
    if self.text() == "(":
        tokens = self.arguments()
    else:
        tokens = [self.tokens[self.index]]
        self.index += 1
    _fix(self, token, tokens)
    return True


def _fix(self: _Rewriter, word: PToken, address: list[PToken]) -> None:
    """Note the address of the name that it is for."""
    value, name = self.address(address, word.place), self.declared(word)
    if name is not None:
        self.out.addresses[name] = value


def _interrupt(self: _Rewriter, token: PToken) -> bool:
    """Rewrite `interrupt` and `__interrupt()` as qualifiers before the name, or after the parameters as in
    SDCC; a function named interrupt is kept.
    """
    if token.text == "interrupt" and self.text(1) == "(":
        self.out.interrupts |= {position(token.place, token.text)} if not self.depth else set()
        return False
    # inside a function the word is an ordinary name
    if self.depth or self.is_name():
        return False
    self.index += 1
    if self.text() == "(":
        self.arguments()
    elif self.text().isdigit():
        self.index += 1
    name = self.declared(token, function=True)
    self.out.interrupts |= {name} if name is not None else set()
    return True


def _persistent(self: _Rewriter, token: PToken) -> bool:
    """Rewrite XC8's `persistent` and `__persistent`."""
    if self.is_name():
        return False
    self.index += 1
    name = self.declared(token)
    self.out.persistent |= {name} if name is not None else set()
    return True


def _code(self: _Rewriter, token: PToken) -> bool:
    """Rewrite SDCC's `__code` as const, because everything in flash is constant; a `volatile` beside it
    would put the object into RAM.
    """
    if self.out.tokens and self.out.tokens[-1].text == "volatile":
        self.out.tokens.pop()
    self.emit("const", token.place)
    self.index += 1 + (self.text(1) == "volatile")
    return True


def _rom(self: _Rewriter, token: PToken) -> bool:
    """Rewrite BoostC's `rom char *name = …` as a constant array, and `rom` elsewhere as const."""
    if self.is_name():
        return False
    words = [self.text(ahead) for ahead in range(1, 5)]
    star = words.index("*") if "*" in words else None
    self.emit("const", token.place)
    self.index += 1
    if star is not None and all(word in _TYPE_WORDS for word in words[:star]) and self.text(star + 2) == "=":
        self.out.tokens += self.tokens[self.index : self.index + star]
        name = self.tokens[self.index + star + 1]
        self.out.tokens.append(name)
        self.emit("[", name.place)
        self.emit("]", name.place)
        self.index += star + 2
    return True


def _sfr(self: _Rewriter, token: PToken) -> bool:
    """Rewrite SDCC's `__sfr` and `__sbit` as the types of a register and of a bit."""
    words = ["volatile", "unsigned", "char"] if token.text == "__sfr" else ["bit"]
    for word in words:
        self.emit(word, token.place)
    self.index += 1
    return True


def _eeprom(self: _Rewriter, token: PToken) -> bool:
    """Rewrite XC8's `__eeprom` and `eeprom` as the parser's qualifier."""
    if self.is_name():
        return False
    self.emit(EEPROM, token.place)
    self.index += 1
    return True


def _naked(self: _Rewriter, token: PToken) -> bool:
    """Rewrite SDCC's `__naked` behind the parameters of a function."""
    if self.depth or not self.out.tokens or self.out.tokens[-1].text != ")":
        return False
    self.index += 1
    name = self.declared(token, function=True)
    self.out.naked |= {name} if name is not None else set()
    return True


def _critical(self: _Rewriter, token: PToken) -> bool:
    """Rewrite SDCC's `__critical { … }`, and a function's body declared with it, as a labelled block."""
    opening = self.index + 1
    if not self.depth and (not self.out.tokens or self.out.tokens[-1].text != ")"):
        return False
    if not self.depth:  # other words may stand before the body
        opening = _behind_words(self.tokens, opening)
        while opening < len(self.tokens) - 1 and self.tokens[opening].text in _BEHIND_PARAMETERS:
            opening = _behind_words(self.tokens, opening + 1)
    if opening >= len(self.tokens) or (self.depth and self.tokens[opening].text != "{"):
        return False
    self.index += 1
    if self.tokens[opening].text != "{":
        return True  # a prototype
    self.serial += 1
    label = f"{CRITICAL_LABEL}{self.serial}"
    if self.depth:
        self.emit(label, token.place)
        self.emit(":", token.place)
        return True
    # of a function declared so, the whole body becomes the labelled block
    closing = _closing(self.tokens, opening)
    if closing == len(self.tokens):
        return True  # the parser reports that the file ends too early
    self.tokens.insert(closing, PToken("}", self.tokens[closing].place))
    self.tokens[opening + 1 : opening + 1] = [PToken(text, token.place) for text in (label, ":", "{")]
    return True


_BEHIND_PARAMETERS = frozenset(("__naked", "__reentrant", "reentrant"))


def _drop(self: _Rewriter, token: PToken) -> bool:
    """Drop a qualifier that has no meaning on this chip, unless the program uses the word as a name."""
    if self.is_name():
        return False
    self.index += 1
    return True


_ADVICE = frozenset((
    "always_inline", "cold", "const", "deprecated", "externally_visible", "fallthrough", "format", "hot",
    "leaf", "malloc", "may_alias", "noclone", "noinline", "noipa", "nonnull", "noreturn", "nothrow",
    "optimize", "packed", "pure", "returns_nonnull", "unused", "used", "visibility", "warn_unused_result",
))  # fmt: skip
"""The attributes without which a program means the same; structures are packed anyway."""


def _attribute(self: _Rewriter, token: PToken) -> bool:
    """Drop `__attribute__((…))`, with a warning about each attribute that is more than advice."""
    if self.text(1) != "(":
        return False
    self.index += 1
    depth, before = 0, ""
    for inside in self.arguments():
        name = inside.text.removeprefix("__").removesuffix("__")
        if depth == 1 and before in ("(", ",") and inside.text != ")" and name not in _ADVICE:
            self.reporter.warn("c-attribute", f"the attribute '{name}' is ignored", inside.place)
        depth += {"(": 1, ")": -1}.get(inside.text, 0)
        before = inside.text
    return True


def _drop_call(self: _Rewriter, token: PToken) -> bool:
    """Drop SDCC's `__using(…)` and XC8's `__bank(…)`, which mean nothing on this chip, and, with a warning,
    `__section(…)`.
    """
    if self.text(1) != "(":
        return False
    self.index += 1
    self.arguments()
    if token.text == "__section":
        self.reporter.warn("c-attribute", "the section is ignored", token.place)
    return True


def _asm_call(self: _Rewriter, token: PToken) -> bool:
    """Rewrite `asm("…")`; adjacent strings are joined, as everywhere in C."""
    if self.text(1) in ("volatile", "__volatile__"):
        self.index += 1
    if self.text(1) != "(":
        return False
    self.index += 1
    strings = self.arguments()
    if (other := next((string for string in strings if string.text[0] != '"'), None)) is not None:
        self.reporter.error(
            "c-unsupported",
            "assembly with operands is not supported: asm() takes only strings",
            other.place,
            hint="in assembly, the global variable v is called _v",
        )
        strings = []
    body = "".join(
        string.text[1:-1].replace("\\n", "\n").replace("\\t", "\t").replace('\\"', '"') for string in strings
    )
    lines = [(token.place.line or 0, line) for line in body.split("\n") if line.strip()]
    self.blocks.append(AsmBlock(token.place.file or "", tuple(lines)))
    _asm_marker(self, token, len(self.blocks) - 1)
    return True


def _asm_block(self: _Rewriter, token: PToken) -> bool:
    """Rewrite the marker of a block of assembly."""
    self.index += 1
    number = int(self.arguments()[0].text)
    _asm_marker(self, token, number)
    return True


def _asm_marker(self: _Rewriter, token: PToken, number: int) -> None:
    """Emit the marker of a block as a statement, or note it if it stands outside functions."""
    if self.depth == 0:
        self.out.file_asm.append((number, token.place))
        if self.text() == ";":
            self.index += 1
        return
    for text in (MARKER, "(", str(number), ")"):
        self.emit(text, token.place)
    if self.text() != ";":
        self.emit(";", token.place)


def _declaration_call(self: _Rewriter, token: PToken) -> bool:
    """Rewrite `__EEPROM_DATA(…)`, `__CONFIG(…)` and `__IDLOC(…)`, inside functions too, as declarations at
    file level that the semantic analysis evaluates.
    """
    if self.text(1) != "(":
        return False
    self.index += 1
    inside = self.arguments()
    self.serial += 1
    closing = ["}", ";"]
    if token.text == "__EEPROM_DATA":
        words = ["const", "unsigned", "char", f"{EEPROM_NAME}{self.serial}", "[", "]", "=", "{"]
    elif token.text == "__IDLOC":
        digits = "".join(inner.text for inner in inside)
        if not re.fullmatch("[0-9A-Fa-f]{1,4}", digits):
            self.reporter.error(
                "c-configuration", f"__IDLOC takes up to four hexadecimal digits, not '{digits}'", token.place
            )
            digits = "0"
        words, inside = ["enum", "{", f"{ID_NAME}{self.serial}", "="], [PToken(f"0x{digits}", token.place)]
    else:
        words = ["enum", "{", f"{CONFIG_NAME}{self.serial}", "=", "("]
        closing = [")", *closing]
    target = self.out.hoisted if self.depth else self.out.tokens
    target += [PToken(word, token.place) for word in words]
    target += inside
    target += [PToken(word, token.place) for word in closing]
    if self.text() == ";" and not self.depth:
        self.index += 1
    return True


def _bit_number(self: _Rewriter, token: PToken) -> bool:
    """Rewrite `portb.7`, a member that is a number."""
    # pcpp splits an ellipsis into three tokens
    if self.text(1) == self.text(2) == ".":
        self.emit("...", token.place)
        self.index += 3
        return True
    if not re.fullmatch(r"\d\d?", self.text(1)):
        return False
    self.out.tokens.append(token)
    self.emit(BIT_MEMBER + self.text(1), self.tokens[self.index + 1].place)
    self.index += 2
    return True


_HANDLERS = {
    "@": _at_sign,
    "__at": _at_word,
    "interrupt": _interrupt,
    "__interrupt": _interrupt,
    "__code": _code,
    "rom": _rom,
    "__rom": _rom,
    "__sfr": _sfr,
    "__sbit": _sfr,
    "__eeprom": _eeprom,
    "eeprom": _eeprom,
    "__naked": _naked,
    "__critical": _critical,
    "__attribute__": _attribute,
    "persistent": _persistent,
    "__persistent": _persistent,
    "__using": _drop_call,
    "__bank": _drop_call,
    "__section": _drop_call,
    "asm": _asm_call,
    "__asm": _asm_call,
    "__asm__": _asm_call,
    MARKER: _asm_block,
    "__EEPROM_DATA": _declaration_call,
    "__CONFIG": _declaration_call,
    "__IDLOC": _declaration_call,
    ".": _bit_number,
    **dict.fromkeys(_DROPPED, _drop),
}


def rewrite_tokens(
    tokens: list[PToken], blocks: list[AsmBlock], reporter: Reporter, serial: int
) -> Rewritten:
    """Return plain C for the tokens of one file; `serial` keeps generated names distinct between files."""
    return _Rewriter(tokens, blocks, reporter, serial).run()
