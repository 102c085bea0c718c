"""Where RP0 is set and cleared, and the bank in which a function returns."""

from __future__ import annotations

from random import Random

from servogen.compiler.ir.function import Function
from servogen.compiler.ir.instruction import RP0, STATUS, Instruction, Loc, Reg
from servogen.compiler.ir.verifier import faults
from servogen.compiler.passes.bank_select import UNKNOWN, bank_needed, banked, exit_banks, switch_banks
from servogen.errors import Location
from tests.compiler.cases import every
from tests.compiler.ir.assembly import Chip, Names, function, lines, texts


@every(
    ("address", "bank"),
    [
        # in both banks: INDF, PCL, STATUS, FSR, PCLATH, INTCON and RAM (DS35007 figure 2-2)
        *((address, None) for low in (0x00, 0x02, 0x03, 0x04, 0x0A, 0x0B) for address in (low, low | 0x80)),
        *((address, None) for low in (0x0C, 0x4F) for address in (low, low | 0x80)),
        *((low, 0) for low in (0x01, 0x05, 0x06, 0x08, 0x09, 0x50, 0x7F)),
        *((low | 0x80, 1) for low in (0x01, 0x05, 0x06, 0x08, 0x09, 0x50, 0x7F)),
    ],
)
def test_the_bank_of_each_address(address: int, bank: int | None) -> None:
    assert bank_needed(Instruction("CLRF", Reg(address))) == bank


def test_variables_and_literals_need_no_bank() -> None:
    assert bank_needed(Instruction("CLRF", Names().loc("ga"))) is None
    assert bank_needed(Instruction("MOVLW", k=0x86)) is None


@every(
    ("before", "after"),
    [
        ("MOVWF TRISB; RETURN", "BSF RP0; MOVWF TRISB; BCF RP0; RETURN"),
        ("MOVWF PORTB; CLRF ga; MOVWF FSR; RETURN", None),
        # at the end of the lines nothing follows that would switch back instead
        ("MOVWF TRISB", "BSF RP0; MOVWF TRISB; BCF RP0"),
        ("MOVWF TRISB; CLRF ga", "BSF RP0; MOVWF TRISB; BCF RP0; CLRF ga"),
        # one pair for several accesses, with what needs no bank between them
        ("MOVWF TRISB; MOVWF TRISA; RETURN", "BSF RP0; MOVWF TRISB; MOVWF TRISA; BCF RP0; RETURN"),
        ("MOVWF TRISB; MOVLW 1; MOVWF ga; MOVWF TRISA; MOVLW 3; CLRF gb; RETURN",
            "BSF RP0; MOVWF TRISB; MOVLW 1; MOVWF ga; MOVWF TRISA; BCF RP0; MOVLW 3; CLRF gb; RETURN"),
        ("MOVWF TRISB; MOVWF PORTB; MOVWF TRISA; RETURN",
            "BSF RP0; MOVWF TRISB; BCF RP0; MOVWF PORTB; BSF RP0; MOVWF TRISA; BCF RP0; RETURN"),
        # what ends a pair: a call, a delay, a label, a jump
        ("MOVWF TRISB; CALL g; MOVWF TRISA; RETURN",
            "BSF RP0; MOVWF TRISB; BCF RP0; CALL g; BSF RP0; MOVWF TRISA; BCF RP0; RETURN"),
        ("MOVWF TRISB; DELAY 9; MOVWF TRISA; RETURN",
            "BSF RP0; MOVWF TRISB; BCF RP0; DELAY 9; BSF RP0; MOVWF TRISA; BCF RP0; RETURN"),
        ("MOVWF TRISB; a: MOVWF TRISA; GOTO a",
            "BSF RP0; MOVWF TRISB; BCF RP0; a: BSF RP0; MOVWF TRISA; BCF RP0; GOTO a"),
        # a write to the whole of STATUS changes the bank, one to its flags does not
        ("CLRF TRISA; CLRF STATUS; CLRF TRISB; RETURN",
            "BSF RP0; CLRF TRISA; BCF RP0; CLRF STATUS; BSF RP0; CLRF TRISB; BCF RP0; RETURN"),
        ("CLRF TRISA; MOVLW 7; ANDWF STATUS,F; CLRF TRISB; RETURN",
            "BSF RP0; CLRF TRISA; BCF RP0; MOVLW 7; ANDWF STATUS,F; BSF RP0; CLRF TRISB; BCF RP0; RETURN"),
        ("CLRF TRISA; BSF C; MOVF STATUS,W; CLRF TRISB; RETURN",
            "BSF RP0; CLRF TRISA; BSF C; MOVF STATUS,W; CLRF TRISB; BCF RP0; RETURN"),
        # assembly between two accesses stays where it is, in the bank of its neighbours
        ("MOVWF TRISB; *NOP; MOVWF TRISA; RETURN",
            "BSF RP0; MOVWF TRISB; *NOP; MOVWF TRISA; BCF RP0; RETURN"),
        ("*MOVWF TRISB; RETURN", None),
        # both switches stand outside a skip and what it guards
        ("BTFSC ga,1; MOVWF TRISB; RETURN", "BSF RP0; BTFSC ga,1; MOVWF TRISB; BCF RP0; RETURN"),
        ("DECFSZ ga,F; CLRF TRISB; RETURN", "BSF RP0; DECFSZ ga,F; CLRF TRISB; BCF RP0; RETURN"),
        ("BTFSC ga,1; MOVWF TRISB; BTFSC ga,2; MOVWF TRISA; RETURN",
            "BSF RP0; BTFSC ga,1; MOVWF TRISB; BSF RP0; BTFSC ga,2; MOVWF TRISA; BCF RP0; RETURN"),
        ("BTFSC EECON1,1; CLRF ga; RETURN", "BSF RP0; BTFSC EECON1,1; CLRF ga; BCF RP0; RETURN"),
        # a jump between the switches goes through a place that switches back
        ("a: BTFSC EECON1,1; GOTO a; CLRF ga; RETURN",
            "a: BSF RP0; BTFSC EECON1,1; GOTO f.bank0; BCF RP0; CLRF ga; RETURN; f.bank0: BCF RP0; GOTO a"),
        ("BTFSC EECON1,1; GOTO a; BTFSS TRISA,1; GOTO a; a: RETURN",
            "BSF RP0; BTFSC EECON1,1; GOTO f.bank0; BSF RP0; BTFSS TRISA,1; GOTO f.bank3; BCF RP0; a: RETURN;"
            "f.bank0: BCF RP0; GOTO a; f.bank3: BCF RP0; GOTO a"),
    ],
)  # fmt: skip
def test_switches_stand_around_accesses_to_bank_1(before: str, after: str | None) -> None:
    made = function(before)
    assert switch_banks(made, set(), {}) == (after is not None)
    assert texts(made) == lines(before if after is None else after)


@every(
    ("before", "after"),
    [
        # the program's own switches stay; what needs the other bank is switched to and back
        ("*BSF RP0; MOVWF TRISB; *BCF RP0; RETURN", None),
        ("*BSF RP0; MOVWF TRISB; MOVWF PORTB; *BCF RP0; RETURN",
            "*BSF RP0; MOVWF TRISB; BCF RP0; MOVWF PORTB; *BCF RP0; RETURN"),
        ("*BSF RP0; MOVWF PORTB; MOVWF TRISB; RETURN",
            "*BSF RP0; BCF RP0; MOVWF PORTB; BSF RP0; MOVWF TRISB; RETURN"),
        ("BSF RP0; MOVWF TRISB; BCF RP0; MOVWF PORTB; RETURN", None),
        ("MOVLW 32; MOVWF STATUS; MOVWF TRISB; RETURN", None),
        ("MOVLW 96; MOVWF STATUS; MOVWF TRISB; RETURN", None),
        ("MOVLW 64; MOVWF STATUS; MOVWF PORTB; RETURN", None),
        ("MOVLW 32; MOVWF STATUS; CLRF STATUS; MOVWF PORTB; RETURN", None),
        # one bank or the other: what is certain is only behind a switch
        ("BTFSC ga,1; *BSF RP0; MOVWF TRISB; RETURN",
            "BTFSC ga,1; *BSF RP0; BSF RP0; MOVWF TRISB; BCF RP0; RETURN"),
        ("BTFSC ga,1; *BSF RP0; MOVWF PORTB; RETURN", "BTFSC ga,1; *BSF RP0; BCF RP0; MOVWF PORTB; RETURN"),
        ("*BSF RP0; BTFSC ga,1; GOTO a; *BCF RP0; a: MOVWF PORTB; RETURN",
            "*BSF RP0; BTFSC ga,1; GOTO a; *BCF RP0; a: BCF RP0; MOVWF PORTB; RETURN"),
        # a loop in which the bank changes
        ("a: MOVWF PORTB; *BSF RP0; BTFSC ga,1; GOTO a; RETURN",
            "a: BCF RP0; MOVWF PORTB; *BSF RP0; BTFSC ga,1; GOTO a; RETURN"),
        # bits of STATUS other than RP0, and the same bit of a variable
        ("BSF C; MOVWF PORTB; RETURN", None), ("BSF ga,5; MOVWF PORTB; RETURN", None),
        ("BTFSC RP0; CLRF ga; MOVWF PORTB; RETURN", None),
    ],
)  # fmt: skip
def test_what_the_program_selects_itself_counts(before: str, after: str | None) -> None:
    made = function(before)
    assert switch_banks(made, set(), {}) == (after is not None)
    assert texts(made) == lines(before if after is None else after)


@every(
    ("before", "exits", "after"),
    [
        ("CALL g; RETURN", {}, None),
        ("MOVWF PORTB; CALL g; MOVWF PORTB; RETURN", {"g": 0}, None),
        # bank 0 for the call, and back
        ("*BSF RP0; CALL g; MOVWF TRISB; RETURN", {},
            "*BSF RP0; BCF RP0; CALL g; BSF RP0; MOVWF TRISB; RETURN"),
        ("*BSF RP0; CALL g; MOVWF TRISB; RETURN", {"g": 0},
            "*BSF RP0; BCF RP0; CALL g; BSF RP0; MOVWF TRISB; BCF RP0; RETURN"),
        ("*BSF RP0; CALL g; MOVWF TRISB; RETURN", {"g": 1}, "*BSF RP0; BCF RP0; CALL g; MOVWF TRISB; RETURN"),
        ("CALL g; MOVWF PORTB; RETURN", {"g": UNKNOWN}, "CALL g; BCF RP0; MOVWF PORTB; RETURN"),
        ("*BSF RP0; CALL h; MOVWF TRISB; RETURN", {}, None),
        ("*BSF RP0; GOTO g", {}, "*BSF RP0; BCF RP0; GOTO g"),
        ("*BSF RP0; GOTO h", {}, None),
        ("*BSF RP0; BTFSC ga,1; GOTO g; MOVWF TRISB; RETURN", {},
            "*BSF RP0; BCF RP0; BTFSC ga,1; GOTO g; BSF RP0; MOVWF TRISB; RETURN"),
        ("*BSF RP0; BTFSC ga,1; CALL g; MOVWF TRISB; RETURN", {},
            "*BSF RP0; BCF RP0; BTFSC ga,1; CALL g; BSF RP0; MOVWF TRISB; RETURN"),
        # a call of what needs bank 0 is not put between two switches
        ("MOVWF TRISB; CALL g; CLRF ga; MOVWF TRISA; RETURN", {},
            "BSF RP0; MOVWF TRISB; BCF RP0; CALL g; CLRF ga; BSF RP0; MOVWF TRISA; BCF RP0; RETURN"),
    ],
)  # fmt: skip
def test_functions_that_need_a_bank_are_called_in_bank_0(
    before: str, exits: dict[str, int], after: str | None
) -> None:
    made = function(before)
    assert switch_banks(made, {"g"}, exits) == (after is not None)
    assert texts(made) == lines(before if after is None else after)


@every(
    ("text", "bank"),
    [
        ("*BSF RP0; RETURN", 1), ("*BSF RP0; RETLW 3", 1), ("*BSF RP0; *BCF RP0; RETURN", 0),
        ("*BSF RP0; RETFIE", 0),
        ("BTFSC ga,1; RETURN; *BSF RP0; RETURN", UNKNOWN),
        ("MOVLW 32; MOVWF STATUS; RETURN", 1), ("MOVLW 33; MOVWF STATUS; RETURN", 1),
        ("MOVLW 64; MOVWF STATUS; RETURN", 0),
        ("*BSF RP0; MOVF ga,W; MOVWF STATUS; RETURN", 0),
        ("*BSF RP0; MOVLW 32; CLRF STATUS; RETURN", 0),
        ("MOVLW 32; a: MOVWF STATUS; BTFSC ga,1; GOTO a; RETURN", 0),
        ("CLRF STATUS; *BSF RP0; ADDWF STATUS,F; RETURN", 1),
        ("*BSF RP0; GOTO h", 1), ("*BSF RP0; GOTO g", 0), ("*BSF RP0; a: CLRF ga; GOTO a", 0), ("GOTO s", 1),
        ("*BCF RP0; CALL s; RETURN", 1), ("CALL s; *BCF RP0; RETURN", 0),
        ("BTFSC ga,1; CALL s; RETURN", UNKNOWN), ("*BSF RP0; CALL h; RETURN", 1),
        ("CALL f; *BSF RP0; RETURN", 1),
    ],
)  # fmt: skip
def test_the_bank_that_a_call_leaves_selected(text: str, bank: int) -> None:
    """g needs bank 0, h no bank at all, and s leaves bank 1 selected."""
    found = {
        "f": function(text),
        "g": function("MOVWF PORTB; RETURN", name="g"),
        "h": function("CLRF ga; RETURN", name="h"),
        "s": function("*BSF RP0; RETURN", name="s"),
    }
    assert exit_banks(found, {"g"}) == {"f": bank, "s": 1}


def test_who_needs_or_switches_a_bank() -> None:
    found = {
        name: function(text, name=name)
        for name, text in {
            "plain": "CLRF ga; CLRF INTCON; RETURN", "port": "MOVWF PORTB; RETURN",
            "tris": "MOVWF TRISB; RETURN", "switch": "BSF RP0; RETURN", "status": "CLRF STATUS; RETURN",
            "carry": "BSF C; RLF ga,F; ADDWF STATUS,F; RETURN",
            "caller": "CALL port; RETURN", "above": "GOTO caller", "apart": "CALL plain; RETURN",
        }.items()
    }  # fmt: skip
    assert banked(found) == {"port", "tris", "switch", "status", "caller", "above"}


OF_BANK = {"TMR0": False, "PORTB": False, "EEDATA": False, "TRISA": True, "TRISB": True, "EECON1": True}
BANKS: dict[Loc | None, bool] = {Names().loc(name): bank for name, bank in OF_BANK.items()}


class Banked(Chip):
    """The chip with RP0, on which an access to a register in the other bank is an error."""

    def __init__(self, made: Function, names: Names, *, checked: bool) -> None:
        memory = {names.loc(name): 0 for name in ("ga", "gb", "FSR", *OF_BANK)}
        super().__init__({"f": made}, memory)
        self.rp0 = False
        self.checked = checked

    def look(self, loc: Loc | None) -> None:
        assert not self.checked or BANKS.get(loc, self.rp0) == self.rp0, f"{loc} in the wrong bank"

    def read(self, loc: Loc | None) -> int:
        self.look(loc)
        return super().read(loc) | (self.rp0 << RP0 if loc == STATUS else 0)

    def _write(self, ins: Instruction, value: int, *, to_file: bool) -> None:
        super()._write(ins, value, to_file=to_file)
        if to_file:
            self.look(ins.f)
            self.rp0 = bool(value >> RP0 & 1) if ins.f == STATUS else self.rp0


def banked_text(random: Random) -> str:
    """A function with accesses to both banks, skips, jumps and switches of its own."""
    parts = []
    for number in range(random.randint(3, 9)):
        register, bit = random.choice((*OF_BANK, "ga", "FSR")), random.randrange(3)
        access = random.choice((f"MOVWF {register}", f"INCF {register},F", f"MOVF {register},W"))
        parts.append(
            random.choice(
                (
                    access,
                    access,
                    f"BTFSC ga,{bit}; {access}",
                    f"BTFSS {register},{bit}; {random.choice(('INCF ga,F', f'GOTO a{number}'))}",
                    f"BTFSS ga,{bit}; GOTO a{number}; {access}",
                    random.choice(("DELAY 3", "INCF gb,F", "BSF C", "ADDLW 1")),
                    random.choice(
                        ("BSF RP0", "BCF RP0", "*BSF RP0", "CLRF STATUS", "MOVLW 32; MOVWF STATUS")
                    ),
                )
            )
        )
        parts.append(random.choice(("INCF ga,F", "INCF gb,F", access)))
        parts.append(f"a{number}: INCF ga,F")
    return "; ".join([*parts, "RETURN"])


def test_every_register_is_accessed_in_its_bank() -> None:
    random = Random(6)
    for _ in range(120):
        names, text = Names(), banked_text(random)
        before, after = function(text, names), function(text, names)
        switch_banks(after, set(), {})
        assert list(faults(after)) == []
        start = random.getrandbits(3)
        chips = [Banked(before, names, checked=False), Banked(after, names, checked=True)]
        for chip in chips:
            chip.memory[names.loc("ga")] = start
            chip.call("f")
        stores = [[store[1:] for store in chip.stores] for chip in chips]
        assert stores[0] == stores[1], text
        assert chips[0].memory == chips[1].memory, text


def test_a_switch_belongs_to_the_line_of_its_access() -> None:
    made = function("CLRF ga; MOVWF TRISB; MOVWF TRISA; RETURN")
    for line, ins in enumerate(made.instructions(), 1):
        ins.place = Location("main.c", line)
    switch_banks(made, set(), {})
    assert [ins.place.line for ins in made.instructions() if ins.place] == [1, 2, 2, 3, 3, 4]
