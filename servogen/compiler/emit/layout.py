"""Addresses: variables in RAM, functions in flash, labels; then words, the image and the listing's rows.

In: optimised code, the globals, the contents of the reset and interrupt vectors. Out: words by address. The
variables of a function lie above those of everything it calls, so that calls in progress never share a byte;
within a function, variables that are never live at the same time share one.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field

from servogen.compiler.ast.nodes import AddressByte, Symbol
from servogen.compiler.codegen.startup import RESET
from servogen.compiler.codegen.tables import table_code
from servogen.compiler.diagnostics import WORDS_NEEDED, Reporter
from servogen.compiler.ir.function import Block, Function
from servogen.compiler.ir.instruction import TARGETED, Byte, Instruction, Label, Reg, assembly
from servogen.compiler.passes.copy_coalescing import interference
from servogen.compiler.passes.liveness import Liveness
from servogen.errors import Location
from servogen.pic.device import INTERRUPT_VECTOR, PROGRAM_WORDS, RAM_BYTES, RAM_FIRST, RAM_LAST
from servogen.pic.isa import by_mnemonic, encode

FLASH_FLAG = 0x80
"""Set in the high byte of a pointer to flash."""


@dataclass(slots=True)
class MemoryMap:
    """The addresses of variables, and the number of bytes used."""

    addresses: dict[Symbol, int] = field(default_factory=dict)
    used: int = 0


def allocate(
    roots: list[str], functions: dict[str, Function], statics: list[Symbol], reporter: Reporter
) -> MemoryMap:
    """Return an address for every variable: globals first, then the frames of the functions.

    Calls cannot nest more deeply than the call graph, because there is no recursion. A frame therefore begins
    where the highest frame of its callees ends, and functions that never call one another share their bytes.
    """
    memory = MemoryMap()
    fixed = {
        (symbol.address + index) & 0x7F  # RAM is the same in both banks
        for symbol in statics
        if symbol.kind == "fixed" and symbol.address is not None
        for index in range(symbol.size)
    }
    taken = {address for address in fixed if RAM_FIRST <= address <= RAM_LAST}
    next_free = RAM_FIRST
    occupied = set(taken)

    def place(size: int, start: int) -> int:
        address = start
        while any(address + index in taken for index in range(size)):
            address += 1
        occupied.update(range(address, address + size))
        return address

    for symbol in statics:
        if symbol.kind == "global":
            address = place(symbol.size, next_free)
            memory.addresses[symbol] = address
            next_free = address + symbol.size
        elif symbol.kind == "fixed" and symbol.address is not None:
            memory.addresses[symbol] = symbol.address
    top = next_free
    late_results = results_behind_arguments(functions.values())
    # the interrupt may come at any depth of main's calls: its frames lie above all of main's
    for root in roots:
        base = top
        ends: dict[str, int] = {}

        def reserve(name: str, base: int = base, ends: dict[str, int] = ends) -> int:
            if name not in ends:
                ends[name] = base  # guards against a loop of calls in assembly
                start = max(
                    [base, *(reserve(callee) for callee in functions[name].calls() if callee in functions)]
                )
                offsets, size = frame(functions[name], late_results)
                start = place(size, start)
                for symbol, offset in offsets.items():
                    memory.addresses[symbol] = start + offset
                start += size
                ends[name] = start
            return ends[name]

        reserve(root)
        top = max([top, *ends.values()])
    needed = top - RAM_FIRST + sum(address >= top for address in taken)
    memory.used = needed
    if needed > RAM_BYTES or top > RAM_LAST + 1:
        file = next(iter(reporter.texts), None)
        # Without the gaps that variables at fixed addresses leave.
        size = len(occupied)
        text = (
            f"the program needs {size} bytes of RAM, the chip has {RAM_BYTES}"
            if size > RAM_BYTES
            else f"the program's {size} bytes of RAM do not fit around the variables at fixed addresses"
        )
        raise reporter.fatal("program-too-large", text, Location(file))
    return memory


@dataclass(slots=True)
class PlacedWord:
    """An instruction with its address."""

    address: int
    ins: Instruction
    function: str
    value: int = 0


@dataclass(slots=True)
class CodeLayout:
    """The program in flash: its words, and where labels and functions lie."""

    words: list[PlacedWord]
    labels: dict[str, int]
    starts: dict[str, tuple[int, int]]
    """First and behind-last address of each function."""
    end: int


def lay_out(
    order: list[Function], memory: MemoryMap, reporter: Reporter, tables: dict[Symbol, str], *, small: bool
) -> CodeLayout:
    """Assign each instruction its address and encode it. `tables` gives the label of each flash object.

    With `small`, the program is already as small as the compiler can make it: the error has no hint.
    """
    pointers = any(function.name.startswith("__flash") for function in order)
    layout = None if pointers else _place(order, reporter, only_first_page=True)
    if layout is None:
        layout = _place(order, reporter, only_first_page=False)
    assert layout is not None
    if layout.end > PROGRAM_WORDS:
        file = next(iter(reporter.texts), None)
        size = len(layout.words)
        if any(function.origin not in (None, 0, INTERRUPT_VECTOR) for function in order) and (
            size <= PROGRAM_WORDS
        ):
            text = f"the program's {size} words do not fit around what lies at fixed addresses"
            raise reporter.fatal("program-too-large", text, Location(file))
        reporter.details[WORDS_NEEDED] = layout.end
        raise reporter.fatal(
            "program-too-large",
            f"the program needs {layout.end} words of flash, the chip has {PROGRAM_WORDS}",
            Location(file),
            "optimise for size (-Os): equal code is shared" if not small else None,
        )
    for word in layout.words:
        word.value = _encode(word, layout.labels, memory, tables, reporter)
    return layout


def _place(order: list[Function], reporter: Reporter, *, only_first_page: bool) -> CodeLayout | None:
    """Assign addresses: what has a fixed one first, then the others in order; return None if a table
    misses the first page although all should lie there.
    """
    layout = CodeLayout([], {}, {}, 0)
    fixed = sorted(
        (function for function in order if function.origin is not None),
        key=lambda function: function.origin or 0,
    )
    taken: list[tuple[int, int]] = []
    for number, function in enumerate(fixed):
        begin = function.origin or 0
        if function.table is not None:
            function.replace(table_code(function, begin, only_first_page=False) or [])
        if taken and begin < taken[-1][1]:
            before = fixed[number - 1]
            raise reporter.fatal(
                "c-address",
                f"{_called(function)} at 0x{begin:03X} overlaps {_called(before)}, "
                f"which ends at 0x{taken[-1][1] - 1:03X}",
                function.place or before.place or Location(),
            )
        taken.append((begin, _put(function, begin, layout)))
    address = 0
    for unit in _units(order):
        while True:
            if unit[0].table is not None:
                table = table_code(unit[0], address, only_first_page=only_first_page)
                if table is None:
                    return None
                unit[0].replace(table)
            end = address + sum(function.size for function in unit)
            clash = [behind for begin, behind in taken if begin < end and address < behind]
            if not clash:
                break
            address = clash[0]
        for function in unit:
            address = _put(function, address, layout)
    layout.words.sort(key=lambda word: word.address)
    return layout


def _units(order: list[Function]) -> Iterator[list[Function]]:
    """Yield the functions without a fixed address, those together of which one falls into the next."""
    unit: list[Function] = []
    for function in order:
        if function.origin is None:
            unit.append(function)
            if not function.falls_into:
                yield unit
                unit = []


def _called(function: Function) -> str:
    """Return what messages call a function or a constant."""
    if function.table is not None:
        return f"'{function.table.name}'"
    return "the reset vector" if function.name == RESET else f"'{function.name}'"


def _put(function: Function, address: int, layout: CodeLayout) -> int:
    """Add a function to the program at an address; return the address behind it."""
    layout.labels[function.name] = begin = address
    for line in function.lines():
        if isinstance(line, Label):
            layout.labels[line.name] = address
        else:
            layout.words.append(PlacedWord(address, line, function.name))
            address += 1
    layout.starts[function.name] = (begin, address)
    layout.end = max(layout.end, address)
    return address


def _encode(
    word: PlacedWord, labels: dict[str, int], memory: MemoryMap, tables: dict[Symbol, str], reporter: Reporter
) -> int:
    """Return the word of an instruction."""
    ins = word.ins
    fields: dict[str, int] = {}
    operands = by_mnemonic()[ins.op].operands
    if "f" in operands:
        fields["f"] = file_address(ins, memory) & 0x7F
    if "d" in operands:
        fields["d"] = ins.d
    if "b" in operands:
        fields["b"] = ins.b
    if "k" in operands:
        fields["k"] = _literal(word, labels, memory, tables, reporter)
    return encode(ins.op, **fields)


def file_address(ins: Instruction, memory: MemoryMap) -> int:
    """Return the data memory address of an instruction's file register."""
    match ins.f:
        case Byte(symbol, offset):
            return memory.addresses[symbol] + offset
        case Reg(address):
            return address
    raise ValueError(assembly(ins))


def _literal(
    word: PlacedWord, labels: dict[str, int], memory: MemoryMap, tables: dict[Symbol, str], reporter: Reporter
) -> int:
    """Return the literal of an instruction: a number, a byte of an address, or the target of a jump."""
    ins = word.ins
    if ins.op in TARGETED:
        if ins.target.startswith("$"):
            return word.address + int(ins.target[1:] or 0)
        if ins.target not in labels:
            name = ins.target.rsplit(".", 1)[-1]
            raise reporter.fatal("c-asm", f"assembly: there is no label '{name}'", ins.place or Location())
        return labels[ins.target]
    if isinstance(ins.k, AddressByte):
        return address_byte(ins.k, labels, memory, tables)
    return ins.k


def address_byte(k: AddressByte, labels: dict[str, int], memory: MemoryMap, tables: dict[Symbol, str]) -> int:
    """Return one byte of the address of a variable or flash object, as pointers hold it."""
    if k.symbol.kind == "flash":
        where = labels[tables[k.symbol]] + k.offset
        return where & 0xFF if k.part == 0 else where >> 8 | FLASH_FLAG
    where = memory.addresses[k.symbol] if k.symbol.address is None else k.symbol.address
    where += k.offset
    return where >> 8 * k.part & 0xFF


def results_behind_arguments(functions: Iterable[Function]) -> set[Symbol]:
    """Return the results that a caller reads when it has stored an argument of the same function's next call.

    Inside that function the result and its parameters may never be needed together; in the caller they are.
    """
    return {result for function in functions for result in _results_behind_arguments(function)}


def _results_behind_arguments(caller: Function) -> Iterator[Symbol]:
    """Follow the caller's blocks forwards, with the functions that are about to be called; yield the results,
    some more than once.
    """
    following = dict(zip(caller.blocks, caller.successors(), strict=True))
    # for each block, the functions of which an argument has been stored on some path to it
    prepared: dict[Block, set[str | None]] = {block: set() for block in caller.blocks}
    waiting = [*reversed(caller.blocks)]
    while waiting:
        block = waiting.pop()
        names = {*prepared[block]}
        for ins in block.instructions:
            if ins.op == "CALL":
                names.discard(ins.target)
            elif isinstance(ins.f, Byte):
                symbol = ins.f.symbol
                if ins.reads_f and symbol.kind == "result" and symbol.function in names:
                    yield symbol
                if ins.writes_f and symbol.kind == "param" and symbol.function != caller.name:
                    names.add(symbol.function)
        for after in following[block]:
            if after is not None and not names <= prepared[after]:
                prepared[after] |= names
                waiting.append(after)


def frame(function: Function, late_results: Collection[Symbol] = ()) -> tuple[dict[Symbol, int], int]:
    """Return the offsets of a function's variables in its frame, and the frame's size, which is the first
    free offset. A result among `late_results` shares no byte with a parameter.
    """
    conflicts = symbol_conflicts(function, late_results)
    offsets: dict[Symbol, int] = {}
    # the largest first: small ones fit into the gaps that large ones leave
    for symbol in sorted(conflicts, key=lambda symbol: -symbol.size):
        busy = {
            offsets[other] + index
            for other in conflicts[symbol]
            if other in offsets
            for index in range(other.size)
        }
        offset = 0
        while any(offset + index in busy for index in range(symbol.size)):
            offset += 1
        offsets[symbol] = offset
    return offsets, max((offset + symbol.size for symbol, offset in offsets.items()), default=0)


def symbol_conflicts(function: Function, late_results: Collection[Symbol]) -> dict[Symbol, set[Symbol]]:
    """Return, for each used variable of a function, the others that must not share its place."""
    live = Liveness(function)
    used: dict[Symbol, None] = {}
    for parameter in [*function.parameters, function.w_parameter]:
        if parameter is not None and parameter in function.own:
            used[parameter] = None
    if function.result is not None and function.result in function.own:
        used[function.result] = None
    for ins in function.instructions():
        if isinstance(ins.f, Byte) and ins.f.symbol.kind in ("local", "param", "result", "temp"):
            used[ins.f.symbol] = None
        if isinstance(ins.k, AddressByte) and ins.k.symbol.kind in ("local", "param", "result", "temp"):
            used[ins.k.symbol] = None
    own = [symbol for symbol in used if symbol in set(function.own)]
    conflicts: dict[Symbol, set[Symbol]] = {symbol: set() for symbol in own}
    # assembly may use its variables in an order that liveness does not see, and routines are written by hand
    if function.inline_asm or function.name.startswith("__"):
        return {symbol: {other for other in own if other is not symbol} for symbol in own}
    for byte, mask in interference(function, live).items():
        if byte.symbol not in conflicts:
            continue
        for other in live.number:
            if other.symbol is not byte.symbol and other.symbol in conflicts and mask & live.bit(other):
                conflicts[byte.symbol].add(other.symbol)
                conflicts[other.symbol].add(byte.symbol)
    if function.result in conflicts and function.result in late_results:
        for parameter in conflicts.keys() & {*function.parameters}:
            conflicts[function.result].add(parameter)
            conflicts[parameter].add(function.result)
    for variable in own:
        everywhere = variable.pinned or variable.volatile
        for rival in own:
            if rival is not variable and (
                everywhere or (variable in function.parameters and rival in function.parameters)
            ):
                conflicts[variable].add(rival)
                conflicts[rival].add(variable)
    return conflicts
