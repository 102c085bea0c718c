"""One pass over a source: the state at a line, and the effect of a line.

In: the lines of the source, and the `Symbols` of the previous pass. Out: the words in `PlacedWords`, the
diagnostics in `Log` and the listing's rows. The directives themselves are tables in the modules
`definitions`, `layout`, `control` and `settings`; each is a function of the pass and the statement.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches

from servogen.errors import Diagnostic, Severity
from servogen.pic.assembler import instructions
from servogen.pic.assembler.blocks import (
    Condition,
    ExitMacro,
    LineReader,
    Macro,
    OutOfBudget,
    Placed,
    TooManyErrors,
)
from servogen.pic.assembler.expressions import Expression, Parser, evaluate, parse_expression, suggestion
from servogen.pic.assembler.messages import MAX_ERRORS, Log, SourceError
from servogen.pic.assembler.sections import KINDS, Kind, Section, Sections
from servogen.pic.assembler.source import ASSIGNMENTS, SourceLine, Statement, statement
from servogen.pic.assembler.substitution import Definition, parameters, paste, substitute
from servogen.pic.assembler.symbols import Kind as SymbolKind
from servogen.pic.assembler.symbols import Symbols
from servogen.pic.assembler.text import MAX_LINE, Text, line_too_long
from servogen.pic.device import ERASED_WORD, Device, register_bits, registers
from servogen.pic.image import REGIONS, Image, image_of, region_of
from servogen.pic.isa import WORD_MASK
from servogen.units import counted

Include = Callable[[str], str | None]
"""Maps the name of an include file, as the source writes it, to its text; None if there is no such file."""

Directive = Callable[["Pass", Statement], None]

MAX_STEPS = 100_000
"""Lines that a pass reads, words that it places and names that it replaces; a large program has 5000.

Macros and `#define` that use each other twice double the work at each level.
"""

_STEPS_OF_A_GUESS = 20
"""The cost, in lines, of comparing a word with all operations."""

DEEPEST_NESTING = 100
"""The maximum nesting of macro calls and include files; deeper nesting is assumed to be endless."""


class PlacedWords:
    """The words that a source places, by word address: program, ID words, configuration word, data EEPROM."""

    def __init__(self) -> None:
        self._words: dict[int, int] = {}

    def put(self, address: int, word: int) -> None:
        """Place a word. Raises SourceError if the chip has no such address, or it is already used."""
        part = region_of(address)
        if part is None:
            raise SourceError(
                "asm-address-range",
                f"address 0x{address & 0xFFFFFFFF:04X} is beyond the chip",
                hint="words are " + ", ".join(f"{region.name} {region.span}" for region in REGIONS),
            )
        if address in self._words:
            raise SourceError(
                "asm-overwrite", f"address 0x{address:04X} holds 0x{self._words[address]:04X} already"
            )
        self._words[address] = word & part.largest

    def change(self, address: int, mask: int, bits: int) -> None:
        """Set some bits of a word that is initially erased."""
        self._words[address] = self._words.get(address, ERASED_WORD) & ~mask | bits

    def image(self) -> Image:
        return image_of(self._words)


@dataclass(slots=True)
class Pass:
    """The state of one pass. It is the `SymbolScope` of its expressions and the `Vocabulary` of its lines."""

    symbols: Symbols
    include: Include
    directives: dict[str, Directive]
    sections: Sections = field(default_factory=Sections)
    exports: dict[str, int] = field(default_factory=dict)
    """What the sources make `global`."""
    device: Device | None = None
    definitions: dict[str, Definition] = field(default_factory=dict)
    memory: PlacedWords = field(default_factory=PlacedWords)
    log: Log = field(default_factory=Log)
    placed: list[Placed] = field(default_factory=list)
    blocks: list[tuple[int, str, int]] = field(default_factory=list)
    """(first, name, size) of each entry of a CBLOCK."""
    sources: dict[str, str] = field(default_factory=dict)
    macros: dict[str, Macro] = field(default_factory=dict)
    conditions: list[Condition] = field(default_factory=list)
    externs: set[str] = field(default_factory=set)
    globals: dict[str, SourceLine] = field(default_factory=dict)
    radix: int = instructions.DEFAULT_RADIX
    location: int = 0
    cblock: int = 0
    ram_last: int | None = None
    bad_ram: set[int] = field(default_factory=set)
    settings: list[str] = field(default_factory=list)
    """The settings made by CONFIG."""
    readers: list[LineReader] = field(default_factory=list)
    pic_as: bool = False
    """Whether the source is one for pic-as, see `psect`."""
    lone_label: str | None = None
    """The label of the line before, if it has nothing else."""
    turning: int = 0
    """The number of WHILEs around the current line."""
    turns: int = 0
    steps: int = 0
    line: SourceLine | None = None
    """The current line."""

    # -- names for expressions -----------------------------------------------------------------------

    @property
    def here(self) -> int:
        return self.location

    def value(self, name: str) -> int | None:
        symbol = self.symbols.find(name)
        if symbol is not None:
            return symbol.value
        if (name in self.externs or name in self.globals) and name in self.exports:
            return self.exports[name]
        return 0 if self.first or self.symbols.is_local(name) else None

    def hint(self, name: str) -> str | None:
        if name in self.externs:
            return f"no source makes {name} global: name all of the program's sources"
        if not self.symbols.defined("STATUS") and name.upper() in (*registers(), *register_bits(), "W", "F"):
            return "the names of the chip's registers and bits come with: include <p16f84.inc>"
        return suggestion(name, self.symbols.names())

    @property
    def first(self) -> bool:
        return self.symbols.in_pass == 1

    # -- sections -------------------------------------------------------------------------------------

    def open_section(self, name: str, kind: Kind, origin: int | None, statement: Statement) -> Section:
        """Go on in a section: what follows has its addresses."""
        self.close_section()
        section = self.sections.open(name, kind, origin, statement.place)
        self.location = section.base + section.used
        return section

    def close_section(self) -> None:
        """Note how far the current section goes."""
        section = self.sections.current
        if section is not None:
            section.used = self.location - section.base
            section.furthest = max(section.furthest, section.used)

    # -- the lines ------------------------------------------------------------------------------------

    def run(self, lines: Sequence[SourceLine]) -> None:
        """Process the lines one by one; a block (macro, while, cblock) consumes its own lines."""
        if len(self.readers) > DEEPEST_NESTING:
            raise SourceError("asm-too-complex", "macro calls or include files are nested without end")
        reader = LineReader(lines)
        self.readers.append(reader)
        opened = len(self.conditions)
        try:
            while (line := reader.next()) is not None:
                self._guarded(line)
            for condition in self.conditions[opened:]:
                self.log.add(
                    Diagnostic("error", "asm-unclosed-block", "this IF has no ENDIF", condition.place)
                )
        finally:
            del self.conditions[opened:]
            self.readers.pop()

    def spend(self, steps: int = 1) -> None:
        """Count work. Raises OutOfBudget, with an error at the current line, after MAX_STEPS."""
        self.steps += steps
        if self.steps > MAX_STEPS and self.line is not None:
            text = f"the source takes more than {MAX_STEPS} steps to assemble"
            hint = "a macro, a WHILE or a #define that grows without end?"
            self.report("error", "asm-too-complex", text, self.line, hint=hint)
            raise OutOfBudget

    def _guarded(self, line: SourceLine) -> None:
        self.line = line
        self.spend()
        try:
            if len(line.text.chars) > MAX_LINE:
                raise line_too_long(MAX_LINE + 1)
            self._line(line)
        except SourceError as error:
            column = error.column or line.text.strip().column(0)
            self.report("error", error.code, error.text, line, column, error.hint)

    def _line(self, line: SourceLine) -> None:
        if self.active:
            self._statement(statement(self.substituted(line), self))
            return
        parsed = statement(line, self)
        if parsed.operation in CONDITIONAL and parsed.operation in self.directives:
            self.directives[parsed.operation](self, parsed)
        # In lines that are left out only conditions are read, so that each ENDIF finds its IF.
        elif parsed.operation in ELSE_IF and all(condition.active for condition in self.conditions[:-1]):
            text = f"{parsed.word.upper()} is not a directive: it is skipped with the lines around it"
            self.report("warning", "asm-else-if", text, line, parsed.column, ELSE_IF_HINT)

    def substituted(self, line: SourceLine) -> SourceLine:
        """Return the line after expansion of `#define` and `#v`."""
        text = substitute(line.text, self.definitions, self.spend)
        return replace(line, text=paste(text, lambda part: self.evaluate(self.expression(part))))

    def _statement(self, statement: Statement) -> None:
        operation = statement.operation
        unclosed = statement.rest.unclosed()
        if unclosed is not None:
            self.report(
                "warning",
                "asm-unclosed-quote",
                "the quote is not closed: the string extends to the end of the line",
                statement.line,
                unclosed,
            )
        if statement.label is not None:
            if statement.label_column > 1 and operation not in OWN_LABEL:
                self.report(
                    "warning",
                    "asm-label-column",
                    f"label '{statement.label}' after column 1",
                    statement.line,
                    statement.label_column,
                )
            if operation in CONDITIONAL and operation in self.directives:
                raise SourceError(
                    "asm-label", f"a label cannot stand before {operation.upper()}", statement.label_column
                )
            if operation not in OWN_LABEL:
                section = self.sections.current
                kind: SymbolKind = "label" if section is None or section.is_code else "constant"
                self.symbols.define(statement.label, self.location, kind, statement.label_column)
        elif statement.column == 1 and operation.upper() in instructions.mnemonics():
            self.report(
                "warning", "asm-opcode-column", f"opcode '{statement.word}' in column 1", statement.line, 1
            )
        if operation in self.directives:
            self.directives[operation](self, statement)
        elif self.pic_as and statement.word in self.macros:
            self._call(self.macros[statement.word], statement)
        elif operation.upper() in instructions.mnemonics():
            self._instruction(statement)
        elif statement.word in self.macros:
            self._call(self.macros[statement.word], statement)
        elif operation:
            known = (*self.directives, *(name.lower() for name in instructions.mnemonics()), *self.macros)
            hint = ELSE_IF_HINT if operation in ELSE_IF else suggestion(statement.word, known)
            # xc.inc defines IRP, a bit of STATUS, which is then no directive.
            for name, made in self.definitions.items():
                if name.lower() in self.directives and made.body.partition(",")[0] == statement.word:
                    hint = f"'{name}' is defined as '{made.body}': write {name.lower()} in small letters"
            raise SourceError(
                "asm-unknown-operation", f"unknown operation '{statement.word}'", statement.column, hint
            )
        self.lone_label = None if operation else statement.label

    @property
    def active(self) -> bool:
        return not self.conditions or self.conditions[-1].active

    def is_operation(self, word: str) -> bool:
        """Return whether a word in column 1 is an operation rather than a label."""
        known = word.lower() in self.directives or word.upper() in instructions.mnemonics()
        return known or word in self.macros

    def is_almost_operation(self, word: str) -> bool:
        """Return whether a word is so similar to an operation that it is probably a typing error."""
        self.spend(_STEPS_OF_A_GUESS)
        known = (*self.directives, *(name.lower() for name in instructions.mnemonics()), *self.macros)
        return bool(get_close_matches(word.lower(), known, n=1, cutoff=0.8))

    # -- instructions and macro calls -----------------------------------------------------------------

    def _instruction(self, statement: Statement) -> None:
        for instruction in instructions.instructions(
            statement.word, self.parser(statement.rest).fields(), statement.place
        ):
            self.encode(instruction, statement)

    def encode(self, instruction: instructions.ParsedInstruction, statement: Statement) -> None:
        """Place an instruction; the first pass only reserves its words, because operands may still be
        unknown.
        """
        if self.first:
            self.check_section(statement)
            self.spend()
            self.location += 1
            return
        try:
            word, remarks = instructions.encode_instruction(instruction, self)
            for remark in remarks:
                self.report(remark.severity, remark.code, remark.message, statement.line, statement.column)
            if instruction.f is not None and not self._is_ram(self.evaluate(instruction.f)):
                self.report(
                    "warning",
                    "asm-no-register",
                    "there is no register at this address",
                    statement.line,
                    statement.column,
                )
        except SourceError:
            self.location += 1
            raise
        self.emit(word, statement, is_code=True)

    def _is_ram(self, address: int) -> bool:
        return self.ram_last is None or (address <= self.ram_last and address not in self.bad_ram)

    def _call(self, macro: Macro, statement: Statement) -> None:
        arguments = [part.chars for part in statement.rest.split(",")] if statement.rest else []
        if len(arguments) != len(macro.parameters):
            raise SourceError(
                "asm-macro-arguments",
                f"macro '{macro.name}' takes {counted(len(macro.parameters), 'argument')}, "
                f"not {len(arguments)}",
                statement.column,
            )
        values = dict(zip(macro.parameters, arguments, strict=True))
        self.expand(macro.body, values, f"in macro '{macro.name}', called at", statement)

    def macro_body(self, statement: Statement) -> list[SourceLine]:
        """Return the lines up to the ENDM of a macro, or of what else ends with one."""
        body = self.readers[-1].block("macro|rept|irpc?" if self.pic_as else "macro", "endm", statement)
        self.spend(len(body))
        return body

    def expand(
        self, body: Sequence[SourceLine], values: Mapping[str, str], what: str, statement: Statement
    ) -> None:
        """Process the lines of a macro, with `values` for its parameters and local names of their own."""
        within = (f"{what} {statement.line.file}:{statement.line.number}", *statement.line.within)
        opened = len(self.conditions)
        self.symbols.enter()
        try:
            self.run(
                [
                    replace(row, text=parameters(row.text, values, joined=self.pic_as), within=within)
                    for row in body
                ]
            )
        except ExitMacro:
            del self.conditions[opened:]
        finally:
            self.symbols.leave()

    # -- what directives use --------------------------------------------------------------------------

    def choose(self, device: Device) -> None:
        """Select the chip from here on; sources test for it with `ifdef __16F84`."""
        self.device = device
        self.symbols.define(f"__{device.short_name}", 1, "variable", 1)

    def parser(self, text: Text) -> Parser:
        return Parser.of(text, self.radix)

    def expression(self, text: Text) -> Expression:
        return parse_expression(text, self.radix)

    def evaluate(self, expression: Expression) -> int:
        return evaluate(expression, self)

    def fields(self, statement: Statement, minimum: int = 0, maximum: int | None = None) -> list[Expression]:
        """Return the operands of a directive, checked for number; none may be empty."""
        fields = self.parser(statement.rest).fields()
        name = statement.operation.upper()
        if len(fields) < minimum or None in fields:
            raise SourceError(
                "asm-missing-argument",
                f"{name} lacks an operand",
                statement.rest.column(len(statement.rest.chars)) if statement.rest else statement.column,
            )
        if maximum is not None and len(fields) > maximum:
            raise SourceError(
                "asm-too-many-arguments",
                f"{name} takes at most {counted(maximum, 'operand')}, not {len(fields)}",
                statement.column,
            )
        return [field for field in fields if field is not None]

    def one(self, statement: Statement) -> int:
        """Return the value of a directive's only operand."""
        return self.evaluate(self.fields(statement, 1, 1)[0])

    def emit(self, word: int, statement: Statement, *, is_code: bool = False) -> None:
        """Place a word at the current location and advance it."""
        if self.is_initial_data and not is_code:
            self.initialise(word & 0xFF, statement)
            self.initialise(word >> 8 & 0xFF, statement)
            return
        self.check_section(statement)
        self.spend()
        address = self.location
        self.location += 1
        self.put(address, word, statement, is_code=is_code)

    @property
    def is_initial_data(self) -> bool:
        return self.sections.current is not None and self.sections.current.kind == "idata"

    def initialise(self, byte: int, statement: Statement) -> None:
        """Place a byte of IDATA at the current location and advance it."""
        self.spend()
        self.location += 1
        if self.sections.current is not None:
            self.sections.current.data.append((byte, statement.line))

    def check_section(self, statement: Statement) -> None:
        """Raise SourceError for a word in a section of data, or, in a relocatable source, in none."""
        section = self.sections.current
        if section.is_code if section is not None else not self.sections:
            return
        where = f"{section.kind.upper()} reserves bytes with RES" if section else "no section is open here"
        raise SourceError(
            "asm-section", f"a word cannot be placed: {where}", statement.column, "CODE opens one"
        )

    def put(self, address: int, word: int, statement: Statement, *, is_code: bool = False) -> None:
        """Place a word at any address of the chip, in the second pass."""
        if self.first:
            return
        if word & ~WORD_MASK:
            word &= 0xFFFF
            text = f"0x{word:04X} does not fit a program word: its lowest 14 bits are used"
            self.report("note", "asm-word-truncated", text, statement.line, statement.column)
        self.memory.put(address, word & WORD_MASK)
        self.placed.append(Placed(address, word & WORD_MASK, statement.line, is_code))

    def report(
        self,
        severity: Severity,
        code: str,
        text: str,
        line: SourceLine,
        column: int | None = None,
        hint: str | None = None,
    ) -> None:
        notes = "; ".join(([hint] if hint else []) + list(line.within))
        self.log.add(
            Diagnostic(
                severity=severity, code=code, message=text, location=line.place(column), hint=notes or None
            )
        )
        if severity == "error" and len(self.log.errors) >= MAX_ERRORS:
            raise TooManyErrors


_CONDITIONS = ("if", "ifdef", "ifndef", "else", "endif")
CONDITIONAL = frozenset((*(mark + name for mark in ("", "#") for name in _CONDITIONS), "elsif", "#elif"))
"""The directives that count in the lines of an IF that does not hold; the last two are pic-as's."""

ELSE_IF = frozenset(mark + name for mark in ("", "#") for name in ("elif", "elifdef", "elifndef"))
"""What sources take for directives: gpasm 1.4 leaves them out where an IF does not hold, like any
line there, and does not know them where it does."""
ELSE_IF_HINT = "as in gpasm; put another IF between ELSE and ENDIF"

OWN_LABEL = frozenset(("equ", "set", ".set", "=", "macro", "org", *KINDS, *ASSIGNMENTS))
"""Directives that give the label in front of them a meaning of their own."""
