"""The state of the semantic analysis, and the table through which its modules recurse.

A declarator contains expressions (the length of an array), an expression contains types (`sizeof`, casts). A
module calls the modules below it directly, and those above it through `Dispatch`, which
`sema.translation_unit` fills in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from servogen.compiler.ast import nodes as tree
from servogen.compiler.ast.types import (
    C2C_INT,
    C2C_SIGNED,
    S16,
    S32,
    U16,
    U32,
    ArrayType,
    CType,
    FloatType,
    FuncType,
    IntType,
)
from servogen.compiler.diagnostics import Fatal, Reporter
from servogen.compiler.frontend.assembly import AsmBlock
from servogen.compiler.frontend.dialects import C2C, named_types
from servogen.compiler.frontend.extensions import Position, Rewritten
from servogen.compiler.frontend.preprocessor import Preprocessed
from servogen.compiler.frontend.syntax_errors import place_of
from servogen.compiler.sema.scopes import Scopes
from servogen.errors import Location
from servogen.units import Clock

U8_CONST = IntType("unsigned char", 1, False, const=True)


ReadFile = Callable[[str], tuple[Preprocessed, Rewritten]]
"""Reads a file of the library by its name."""


@dataclass(frozen=True, slots=True)
class Dispatch:
    """The functions of higher modules that the lower modules of the analysis call."""

    expressions: Mapping[type, Callable[[Analyser, Any], tree.Expr]]
    """The analysis of each kind of expression."""
    declared_type: Callable[[Analyser, Any], CType]
    """The type of a declarator or type name."""
    builtin: Callable[[Analyser, str, Any, list[Any]], tree.Expr | None]
    """The meaning of a call of a built-in function; None when there is none of that name."""
    builtin_names: Callable[[Analyser], list[str]]
    library: Callable[[Analyser, str], tree.FunctionDefinition]
    """A function of the library, whose file is read the first time."""


@dataclass(slots=True)
class Body:
    """What is collected while a function's body is analysed."""

    labels: dict[str, Location] = field(default_factory=dict)
    gotos: list[tuple[str, Any]] = field(default_factory=list)
    loops: int = 0
    breakable: int = 0
    switches: list[tuple[tree.Switch, IntType]] = field(default_factory=list)
    critical: list[tree.Symbol] = field(default_factory=list)
    """What INTCON was before each of the critical blocks that are open, the outermost first."""


class Analyser:
    """The state of one program's analysis: scopes, symbols, the current function."""

    def __init__(
        self,
        dialect: str,
        reporter: Reporter,
        dispatch: Dispatch,
        *,
        clock: Clock | None,
        serial_settings: dict[str, str],
        asm_blocks: list[AsmBlock],
        read_library: ReadFile,
        float_type: FloatType,
    ) -> None:
        self.dialect = dialect
        self.c2c = dialect == C2C
        self.reporter = reporter
        self.dispatch = dispatch
        self.clock = clock
        self.serial_settings = serial_settings
        self.asm_blocks = asm_blocks
        self.read_library = read_library
        self.float_type = float_type
        """The one floating-point type: `float`, `double` and `long double`."""
        self.parenthesised: set[int] = set()
        """The identities of the expressions of the syntax tree that are in parentheses."""
        self.enumerated: dict[str, list[str]] = {}
        """The enumerators of the variables that are declared with an `enum`, by name."""
        self.declared_locals: list[tree.Symbol] = []
        """The variables that the program declares in the present function."""
        self.library_files: set[str] = set()
        """The files of the library that have been read."""
        self.library_bodies: dict[str, tuple[tree.FunctionDefinition, Any, Scopes]] = {}
        """The bodies of its functions that nothing has called yet."""
        self.called: set[str] = set()
        """The functions that a call names."""
        self.function_numbers: dict[str, int] = {}
        """The functions whose addresses are taken, numbered from 1."""
        self.dispatchers: list[tuple[FuncType, tree.FunctionDefinition]] = []
        self.bodies: list[tuple[tree.FunctionDefinition, Any, Scopes]] = []
        """The functions whose bodies remain to be analysed, with the scopes of their files."""
        self.file_scopes: list[Scopes] = []
        self.scopes = Scopes(Rewritten())
        self.program = tree.ProgramTree({}, [], [], {})
        self.function: tree.FunctionDefinition | None = None
        self.body = Body()
        self.strings: dict[tuple[int, ...], tree.Symbol] = {}
        self.types = dict(named_types())
        self.asm_symbols: dict[str, tree.Symbol] = {}
        self.accessing = True
        """Whether the object that an expression names is read or written; not by `&` and `sizeof`."""
        self.variables: set[Position] = set()
        self.heads: set[Position] = set()
        """Where variables and functions are declared: only to these names may words such as `__at` belong."""
        self.eeprom_used = 0
        """The bytes of the EEPROM that declarations have taken so far."""
        self.reading_config = False
        """Inside __CONFIG(…), where the names of the masks are known."""
        self.externals: dict[str, tree.Symbol | tree.FunctionDefinition] = {}
        self.types_read: dict[Any, CType] = {}
        self.defined: set[tree.FunctionDefinition] = set()
        self.pending: list[tree.ExprStmt] = []
        """Initialisations of the locals being declared."""

    @property
    def int_type(self) -> IntType:
        """Return the type of comparisons, enumerations and small literals."""
        return C2C_SIGNED if self.c2c else S16

    @contextmanager
    def access(self, accessing: bool) -> Iterator[None]:
        """Set `accessing` while an operand is analysed."""
        before, self.accessing = self.accessing, accessing
        try:
            yield
        finally:
            self.accessing = before

    def fail(self, code: str, message: str, node: Any, hint: str | None = None) -> Fatal:
        """Report an error at a node; the caller raises the exception that is returned."""
        return self.reporter.fatal(code, message, self.place(node), hint)

    def place(self, node: Any) -> Location:
        """Return the location of a node of either tree."""
        if isinstance(node, Location):
            return node
        return getattr(node, "place", None) or place_of(getattr(node, "coord", None))

    def number(self, value: int, kind: CType, place: Location) -> tree.Num:
        return tree.Num(kind.wrap(value) if isinstance(kind, IntType) else value, kind, place)

    def new_local(self, name: str, kind: CType, place: Location) -> tree.Symbol:
        """Return a new variable of the current function, which the program itself does not name."""
        assert self.function is not None
        number = len(self.function.locals)
        symbol = tree.Symbol(f"{name}{number}", kind, "local", place, function=self.function.name)
        self.function.locals.append(symbol)
        return symbol

    # constants

    def literal_type(self, value: int, suffix: str, decimal: bool) -> IntType:
        """Return the type of an integer literal (ISO C 6.4.4.1 with these sizes)."""
        unsigned = "u" in suffix
        if "l" not in suffix:
            if value <= 32767 and not unsigned:
                return self.int_type
            if value <= 65535 and (unsigned or self.c2c or not decimal):
                return C2C_INT if self.c2c else U16
        return S32 if value <= 0x7FFFFFFF and not unsigned else U32

    def string(self, values: list[int], place: Location) -> tree.Ref:
        """Return a string literal in flash; equal literals share one copy."""
        key = tuple(values)
        if key not in self.strings:
            kind = ArrayType(U8_CONST, len(values))
            symbol = tree.Symbol(f"string{len(self.strings)}", kind, "flash", place, pinned=True)
            symbol.initial = dict[int, tree.Data](enumerate(values))
            self.strings[key] = symbol
            self.program.symbols.append(symbol)
        symbol = self.strings[key]
        return tree.Ref(symbol, 0, None, symbol.type, place)
