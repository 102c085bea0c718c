"""Addresses of variables, functions and tables, worked out by hand."""

from __future__ import annotations

import pytest

from servogen.compiler.ast.nodes import AddressByte, Symbol
from servogen.compiler.ast.types import U8, U16, U32, ArrayType
from servogen.compiler.codegen.tables import table_code
from servogen.compiler.diagnostics import Reporter
from servogen.compiler.emit.layout import (
    MemoryMap,
    address_byte,
    allocate,
    file_address,
    frame,
    lay_out,
    symbol_conflicts,
)
from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import Instruction, Reg
from servogen.errors import InputError
from tests.compiler.cases import every
from tests.compiler.ir.assembly import Names, function, texts

FIRST, LAST = 0x0C, 0x4F
"""RAM of the chip: 68 bytes (DS35007 figure 2-2)."""


def variable(name: str, size: int = 1, address: int | None = None) -> Symbol:
    kind = U8 if size == 1 else ArrayType(U8, size)
    return Symbol(name, kind, "global" if address is None else "fixed", address=address)


def placed(statics: list[Symbol], **texts_: str) -> dict[str, int]:
    """The addresses of all variables, by name."""
    made = {name: function(text, name=name) for name, text in texts_.items()}
    for each in made.values():
        for ins in each.instructions():
            symbol = getattr(ins.f, "symbol", None)
            if symbol is not None and symbol.kind != "global" and symbol not in each.own:
                each.own.append(symbol)
    roots = [name for name in ("main", "isr") if name in made]
    memory = allocate(roots, made, statics, Reporter())
    return {symbol.name: address for symbol, address in memory.addresses.items()}


def test_globals_lie_one_behind_the_other_around_fixed_ones() -> None:
    assert placed([variable("a", 2), variable("b"), variable("c", 3)], main="NOP") == {
        "a": FIRST,
        "b": FIRST + 2,
        "c": FIRST + 3,
    }
    fixed = [variable("x", 1, FIRST + 1), variable("a"), variable("b", 2), variable("port", 1, 6)]
    assert placed(fixed, main="NOP") == {"x": FIRST + 1, "a": FIRST, "b": FIRST + 2, "port": 6}
    assert placed([variable("x", 2, FIRST + 2), variable("a", 3)], main="NOP")["a"] == FIRST + 4


USE = "MOVWF {0}; MOVF {0},W; MOVWF PORTB; RETURN"


def test_a_frame_lies_above_those_of_what_it_calls() -> None:
    found = placed(
        [variable("g", 4)],
        main="CALL a; CALL b; MOVWF lm; MOVF lm,W; MOVWF PORTB; RETURN",
        a="CALL c; MOVWF la; MOVF la,W; MOVWF PORTB; RETURN",
        b=USE.format("lb"),
        c=USE.format("lc"),
    )
    base = FIRST + 4
    # each variable here has four bytes, of which the frame holds all
    assert found == {"g": FIRST, "lc": base, "la": base + 4, "lb": base, "lm": base + 8}


def test_the_interrupts_frames_lie_above_all_of_mains() -> None:
    found = placed([], main="CALL a; RETURN", a=USE.format("la"), isr="CALL i; RETURN", i=USE.format("li"))
    assert found == {"la": FIRST, "li": FIRST + 4}
    assert placed([variable("g", 2)], main="NOP", isr=USE.format("li")) == {"g": FIRST, "li": FIRST + 2}


@every("size", [67, 68])
def test_all_68_bytes_can_be_used(size: int) -> None:
    memory = allocate(["main"], {"main": function("NOP", name="main")}, [variable("a", size)], Reporter())
    assert memory.used == size


TOO_MANY = "the program needs 69 bytes of RAM, the chip has 68"
NO_ROOM = "the program's {} bytes of RAM do not fit around the variables at fixed addresses"


@every(
    ("statics", "message"),
    [
        ([variable("a", 69)], TOO_MANY),
        ([variable("a", 68), variable("x", 1, LAST)], TOO_MANY),
        ([variable("a", 67), variable("x", 2, LAST - 1)], TOO_MANY),
        ([variable("a", 67), variable("x", 2, (LAST - 1) | 0x80)], TOO_MANY),
        # 30 bytes before the fixed one and 37 behind it
        ([variable("a", 38), variable("x", 1, FIRST + 30)], NO_ROOM.format(39)),
        ([variable("a", 29), variable("b", 38), variable("x", 1, FIRST + 30)], NO_ROOM.format(68)),
    ],
)
def test_variables_without_room_are_refused(statics: list[Symbol], message: str) -> None:
    reporter = Reporter()
    reporter.add_source("main.c", "")
    with pytest.raises(Exception, match=f"{message}$"):
        allocate(["main"], {"main": function("NOP", name="main")}, statics, reporter)
    (found,) = reporter.failure().diagnostics
    assert (found.code, found.location and found.location.file) == ("program-too-large", "main.c")


def test_a_variable_in_bank_1_is_the_byte_of_bank_0() -> None:
    """RAM of bank 1 is that of bank 0 (DS35007 2.2.1)."""
    main = {"main": function("NOP", name="main")}
    here, there = variable("a", 2), variable("x", 1, (FIRST + 1) | 0x80)
    memory = allocate(["main"], main, [here, there], Reporter())
    assert (memory.addresses[here], memory.addresses[there]) == (FIRST + 2, (FIRST + 1) | 0x80)


def test_fixed_variables_beyond_the_others_count_once() -> None:
    main = {"main": function("NOP", name="main")}
    memory = allocate(["main"], main, [variable("x", 2, LAST - 1), variable("a", 3)], Reporter())
    assert memory.used == 5
    memory = allocate(["main"], main, [variable("x", 1, FIRST), variable("a", 3)], Reporter())
    assert memory.used == 4
    memory = allocate(["main"], main, [variable("x", 1, FIRST + 3), variable("a", 3)], Reporter())
    assert memory.used == 4
    # in bank 1 the same bytes appear once more
    memory = allocate(["main"], main, [variable("x", 1, LAST | 0x80), variable("port", 1, 0x86)], Reporter())
    assert memory.used == 1


def offsets(text: str, **kinds: object) -> dict[str, int]:
    names = Names()
    made = function(text, names)
    for symbol in made.own:
        symbol.type = U16 if symbol.name.startswith("lw") else U8
    found, size = frame(made)
    assert size == max([found[symbol] + symbol.size for symbol in found], default=0)
    return {symbol.name: offset for symbol, offset in found.items()}


def test_variables_that_are_never_needed_together_share_a_byte() -> None:
    assert offsets("MOVWF t; MOVF t,W; MOVWF ga; MOVWF t1; MOVF t1,W; MOVWF ga; RETURN") == {"t": 0, "t1": 0}
    assert offsets("CLRF t; CLRF t1; MOVF t,W; ADDWF t1,W; MOVWF ga; RETURN") == {"t": 0, "t1": 1}
    # the largest first: the small one goes behind it, or into its place where both never meet
    assert offsets("CLRF t; CLRF lw; CLRF lw+1; MOVF t,W; ADDWF lw,W; ADDWF lw+1,W; MOVWF ga; RETURN") == {
        "lw": 0,
        "t": 2,
    }
    # a pointer may lead to n at any time; a volatile variable is always needed
    assert offsets("CLRF n; CLRF t; MOVF t,W; MOVWF ga; RETURN") == {"n": 0, "t": 1}
    assert offsets("RETURN") == {}


def test_parameters_lie_apart_and_so_do_the_variables_of_assembly() -> None:
    names = Names()
    made = function("MOVF p,W; MOVWF ga; MOVF p1,W; MOVWF ga; RETURN", names)
    made.parameters = [names["p"], names["p1"]]
    assert sorted(frame(made)[0].values()) == [0, 4]
    text = "MOVWF t; MOVF t,W; MOVWF ga; MOVWF t1; MOVF t1,W; MOVWF ga; RETURN"
    plain, assembly, library = function(text), function(text), function(text)
    assembly.inline_asm = True
    library.name = "__f"
    assert [frame(made)[1] for made in (plain, assembly, library)] == [4, 8, 8]


def test_a_result_that_is_read_late_lies_apart_from_the_parameters_only() -> None:
    names = Names()
    made = function("MOVF p,W; MOVWF ga; MOVWF l; MOVF l,W; MOVWF ga; CLRF t; RETURN", names)
    made.parameters, made.result = [names["p"]], names["t"]
    result, parameter = names["t"], names["p"]
    result.type = U8  # it is written as a whole
    alone, late = symbol_conflicts(made, []), symbol_conflicts(made, [result])
    assert alone == {names[name]: set() for name in "plt"}
    assert late == {**alone, result: {parameter}, parameter: {result}}


def test_the_bytes_of_addresses() -> None:
    names = Names()
    memory = MemoryMap({names["g"]: 0x2A})
    fixed, flash = Symbol("x", U8, "fixed", address=0x86), Symbol("c", U32, "flash")
    labels, tables = {"c.data": 0x2FE}, {flash: "c.data"}

    def bytes_of(symbol: Symbol, offset: int) -> list[int]:
        return [address_byte(AddressByte(symbol, offset, part), labels, memory, tables) for part in (0, 1)]

    assert bytes_of(names["g"], 0) == [0x2A, 0] and bytes_of(names["g"], 3) == [0x2D, 0]
    assert bytes_of(fixed, 1) == [0x87, 0]
    # bit 7 of the high byte says that a pointer leads to flash
    assert bytes_of(flash, 0) == [0xFE, 0x82] and bytes_of(flash, 3) == [0x01, 0x83]
    assert file_address(Instruction("CLRF", names.loc("g+2")), memory) == 0x2C
    assert file_address(Instruction("CLRF", Reg(0x86)), memory) == 0x86
    with pytest.raises(ValueError, match="NOP"):
        file_address(Instruction("NOP"), memory)


def test_words_and_labels() -> None:
    """MOVWF 0x0C is 0x008C, GOTO 0x2800 + address, CALL 0x2000 + address (DS35007 table 7-2)."""
    names = Names()
    order = [
        function("MOVLW 5; MOVWF ga; a: BSF TRISB,3; GOTO a", names, name="main"),
        function("ADDWF ga,F; CALL g; RETURN", names, name="g"),
    ]
    memory = MemoryMap({names["ga"]: 0x0C})
    made = lay_out(order, memory, Reporter(), {}, small=True)
    assert [word.value for word in made.words] == [0x3005, 0x008C, 0x1586, 0x2802, 0x078C, 0x2004, 0x0008]
    assert [word.address for word in made.words] == list(range(7)) and made.end == 7
    assert made.starts == {"main": (0, 4), "g": (4, 7)}
    assert made.labels == {"main": 0, "a": 2, "g": 4}
    assert {word.function for word in made.words} == {"main", "g"}


def test_a_function_with_an_address_lies_there_and_jumps_may_be_relative() -> None:
    first, handler = function("GOTO h", name="r"), function("*GOTO $+2; NOP; *GOTO $-1; *GOTO $", name="h")
    handler.origin = 4
    made = lay_out([first, handler], MemoryMap(), Reporter(), {}, small=True)
    assert [(word.address, word.value) for word in made.words] == [
        *((0, 0x2804), (4, 0x2806), (5, 0x0000), (6, 0x2805), (7, 0x2807)),
    ]


def test_a_label_that_is_missing_is_named() -> None:
    reporter = Reporter()
    with pytest.raises(Exception, match="assembly: there is no label 'lost'"):
        lay_out([function("*GOTO f.asm.lost")], MemoryMap(), reporter, {}, small=True)
    assert reporter.failure().diagnostics[0].code == "c-asm"


@every(("words", "small"), [(1024, True), (1025, True), (1025, False), (2000, False)])
def test_a_program_of_1024_words_fits(words: int, small: bool) -> None:
    reporter = Reporter()
    made = Function("main")
    made.extend([Instruction("NOP") for _ in range(words)])
    if words == 1024:
        assert lay_out([made], MemoryMap(), reporter, {}, small=small).end == 1024
        return
    with pytest.raises(Exception, match=f"the program needs {words} words of flash, the chip has 1024"):
        lay_out([made], MemoryMap(), reporter, {}, small=small)
    (found,) = reporter.failure().diagnostics
    assert found.hint == (None if small else "optimise for size (-Os): equal code is shared")
    assert words in reporter.details.values()


def flash(size: int, *, read: bool = True) -> Function:
    symbol = Symbol("c", ArrayType(U8, size), "flash", initial={at: at + 1 for at in range(size) if at != 1})
    index = Symbol("index", U8, "temp", function="c")
    return Function("c", own=[index], table=symbol, w_parameter=index if read else None)


def code(size: int, address: int, *, first_page: bool = False, read: bool = True) -> list[str] | None:
    found = table_code(flash(size, read=read), address, only_first_page=first_page)
    return None if found is None else texts(found)


def test_a_table_in_the_first_256_words_adds_to_pcl() -> None:
    data = ["*c.data:", "*RETLW 1", "*RETLW 0", "*RETLW 3"]
    assert code(3, 0x10, first_page=True) == ["ADDWF PCL,F", *data]
    assert code(3, 0x10, read=False) == data
    # ADDWF at 251, the last byte at 255
    assert code(4, 251, first_page=True) is not None
    assert code(4, 252, first_page=True) is None


@every(
    ("address", "page", "crosses"),
    [
        (0x100, 1, False), (0x2F7, 2, False), (0x2F8, 2, False), (0x2F9, 3, True), (0x2FA, 3, True),
        (0x2FB, 3, False), (0x2F0, 2, False),
    ],
)  # fmt: skip
def test_a_table_elsewhere_sets_pclath_and_carries_where_it_crosses_a_page(
    address: int, page: int, crosses: bool
) -> None:
    """Three words set PCLATH; the jump takes two words, or five where a carry is added to PCLATH."""
    found = code(3, address)
    assert found is not None
    front = ["MOVWF index", f"MOVLW {page}", "MOVWF PCLATH"]
    if crosses:
        start = (address + 8) % 256
        front += [f"MOVLW {start}", "ADDWF index,W", "BTFSC C", "INCF PCLATH,F", "MOVWF PCL"]
        assert (address + 8) // 256 == page
    else:
        front += ["MOVF index,W", "ADDWF PCL,F"]
        assert (address + 5) // 256 == (address + 7) // 256 == page
    assert found == [*front, "*c.data:", "*RETLW 1", "*RETLW 0", "*RETLW 3"]


def test_one_table_beyond_the_first_page_makes_all_of_them_set_pclath() -> None:
    def laid(words: int, *, pointer: bool = False) -> int:
        filler = Function("__flash" if pointer else "main")
        filler.extend([Instruction("NOP") for _ in range(words)])
        one, two = flash(4), flash(4)
        one.name, two.name = "one", "two"
        memory = MemoryMap({symbol: 0x20 for each in (one, two) for symbol in each.own})
        return lay_out([filler, one, two], memory, Reporter(), {}, small=True).end - words

    # ADDWF PCL and four bytes each: 246 words before them fit
    assert laid(246) == 2 * 5
    assert laid(247) == 2 * (5 + 4)
    assert laid(10, pointer=True) == 2 * (5 + 4)


def test_an_input_error_is_raised() -> None:
    reporter = Reporter()
    with pytest.raises(Exception) as caught:
        allocate(["main"], {"main": function("NOP", name="main")}, [variable("a", 100)], reporter)
    assert isinstance(reporter.failure(), InputError) and "100 bytes" in str(caught.value)
