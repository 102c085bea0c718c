"""Declarations with the compilers' attributes in every position."""

from __future__ import annotations

from tests.compiler.probes.probe import Dice, Probe

_TYPES = {
    # the words of a type, in any order, and its bytes
    ("unsigned", "char"): 1,
    ("signed", "char"): 1,
    ("char",): 1,
    ("int",): 2,
    ("unsigned", "int"): 2,
    ("unsigned",): 2,
    ("short",): 2,
    ("short", "int", "unsigned"): 2,
    ("long",): 4,
    ("long", "int"): 4,
    ("unsigned", "long"): 4,
    ("unsigned", "long", "int"): 4,
    ("uint8_t",): 1,
    ("int16_t",): 2,
}
_WORDS = {
    "xc8": ["near", "far", "bank1", "bank0", "bank2", "bank3", "persistent", "__near", "__far",
            "__persistent", '__section("s")', "__attribute__((unused))"],
    "sdcc": ["__data", "__near", "__idata", "__xdata", "__far", "__attribute__((unused))"],
}  # fmt: skip


class Declaration:
    """One declaration with what a judge sees of it."""

    def __init__(self, dice: Dice, dialect: str) -> None:
        self.dice, self.dialect = dice, dialect
        self.address = dice.choice([0, 0, dice.randint(0x10, 0x18)])

    def extra(self, chance: float = 0.12) -> str:
        """Perhaps a word of these compilers that changes no value."""
        return f"«{self.dice.choice(_WORDS[self.dialect])}» " if self.dice.may(chance) else ""

    def at(self) -> str:
        if self.dialect == "xc8" and self.dice.may(0.5):
            return f"« @ {self.address:#x}»"
        return f"« __at({self.address:#x})»" if self.dice.may(0.8) else f"« __at {self.address:#x}»"


def variables(dice: Dice, dialect: str) -> Probe:
    """A variable, perhaps at an address, one beside it, and what was stored in both."""
    probe, made = Probe("declarator"), Declaration(dice, dialect)
    words = dice.choice(list(_TYPES))
    size, name, beside = _TYPES[words], dice.name(), dice.name()
    words = list(words)
    dice.shuffle(words)
    before = dice.sample(["static", "volatile"], dice.randint(0, 2))
    position = dice.choice(["before", "type", "name"]) if made.address else ""
    if position == "before":
        before.append(f"«__at({made.address:#x})»")
    specifiers = [*before, *words]
    if dice.may(0.3):
        # a storage class and a qualifier may stand anywhere among the words of a type
        dice.shuffle(specifiers)
    text = (
        made.extra()
        + " ".join(word + (" " + made.extra() if dice.may(0.3) else "") for word in specifiers)
        + " "
    )
    if position == "type":
        text += f"« __at({made.address:#x})» "
    length = dice.choice(["", "", "[2]", "[1][2]"]) if size < 4 else ""
    text += made.extra() + name + length + " " + made.extra(0.08)
    text += made.at() if position == "name" else ""
    shape = dice.randrange(4)
    value = dice.randint(0, 127)
    element = name + length.replace("2", "1").replace("[1][", "[0][")
    start = f" = {value}" if not length and dice.may(0.3) else ""
    text += start
    if shape == 0:
        text += f", {beside}"
    elif shape == 1:
        text += f", *{beside}_p, {beside} = 3"
    text += ";"
    if shape > 1:
        text += f"\nstatic unsigned char {beside};"
    probe.file = text + "\n"
    if not start:
        probe.body = f"  {element} = {value};"
    probe.body += f" {beside} = {value ^ 0x55};"
    probe.wide(element, size)
    probe.values += [beside, f"sizeof {name}", f"sizeof {beside}"]
    if made.address:
        probe.values.append(f"«(unsigned)&{name} == {made.address:#x}|1»")
        probe.values.append(f"«(unsigned)&{beside} == {made.address:#x}|0»")
    return probe


def functions(dice: Dice, dialect: str) -> Probe:
    """Functions with attributes; a variable behind their declarations; a pointer to one."""
    probe, made = Probe("function"), Declaration(dice, dialect)
    name, behind, argument = dice.name("f"), dice.name(), dice.name("a")
    words = list(dice.choice([key for key, size in _TYPES.items() if size < 4]))
    dice.shuffle(words)
    kind = " ".join(words)
    quiet = ["__reentrant", "inline", "__attribute__((noinline))"]
    before = f"«{dice.choice(quiet)}» " if dice.may(0.3) else ""
    after = f" «{quiet[0]}»" if dice.may(0.15) else ""
    head = f"{'static ' if 'inline' in before or dice.may(0.5) else ''}{before}{kind} {name}"
    if dice.may(0.6):
        parameter = dice.choice([kind, f"{kind} {argument}", f"const {kind} {argument}"])
        probe.file += f"{head}({parameter}){after};\n"
    probe.file += f"static unsigned char {behind};\n"
    register = dice.choice(["", "const ", "register ", "volatile ", made.extra()])
    probe.file += (
        f"{head}({register}{kind} {argument}){after} {{ return {argument} + {dice.randint(1, 9)}; }}\n"
    )
    value = dice.randint(0, 100)
    probe.body = f"  {behind} = {value};"
    if dice.may(0.4):
        pointer = dice.name("q")
        probe.body += (
            f" {kind} (*{dice.choice(['', 'const '])}{pointer})({kind}) = {dice.choice(['', '&'])}{name};"
        )
        probe.values += [f"{dice.choice([pointer, '(*' + pointer + ')'])}({value})"]
    probe.values += [f"{name}({value})", behind, f"sizeof {name}({value})"]
    return probe


def shapes(dice: Dice, dialect: str) -> Probe:
    """Typedefs, pointers, parenthesised declarators, tags and enumerators, with scopes that hide names."""
    probe, made = Probe("shape"), Declaration(dice, dialect)
    tag, kind, name, pointer = (dice.name(letter) for letter in "tkvp")
    which = dice.randrange(6)
    number = dice.randint(0, 100)
    if which == 0:
        probe.file = f"typedef {made.extra()}struct {tag} {{ char a; int b[2]; }} {kind};\n"
        probe.file += (
            f"static {dice.choice([kind, 'struct ' + tag])} {name}{dice.choice(['', ' = { 1 }'])};\n"
        )
        probe.body = (
            f"  struct {tag} *{made.extra()}{pointer} = &{name}; {pointer}->b[1] = {number}; {name}.a += 2;"
        )
        probe.values = [f"{name}.b[1]", f"(*{pointer}).b[1]", f"sizeof({kind})", f"sizeof(struct {tag})"]
    elif which == 1:
        probe.file = f"enum {tag} {{ A{tag}, B{tag} = {number}, C{tag}, D{tag} = A{tag} + 2 }};\n"
        probe.body = f"  enum {tag} {name} = C{tag}; {{ char C{tag} = 7; {name} += C{tag}; }}"
        probe.values = [name, f"D{tag}", f"A{tag}", f"sizeof(char[C{tag}])"]
    elif which == 2:
        probe.file = f"static unsigned char {name}[2][3] = {{ {{1, 2, 3}}, {{4, 5, {number}}} }};\n"
        probe.body = f"  unsigned char (*{made.extra()}{pointer})[3] = {name} + 1;"
        probe.values = [f"(*{pointer})[2]", f"{pointer}[-1][1]", f"sizeof *{pointer}", f"*({name}[1] + 1)"]
    elif which == 3:
        probe.file = f"static const char {name}[] = {{ 5, {number}, 7 }};\n"
        qualified = dice.choice(
            ["const char *", "char const *", "const char *const ", "char const *volatile "]
        )
        probe.body = f"  {qualified}{pointer} = {name} + 1;"
        probe.values = [f"*{pointer}", f"{pointer}[1]", f"1[{name}]", f"sizeof({name})"]
    elif which == 4:
        probe.file = f"static int ({name}), (({pointer})) = {number}; typedef int {kind}[2];\n"
        probe.file += f"static const {kind} z{name} = {{ 3 }}, *const y{name} = &z{name};\n"
        probe.body = f"  {name} = (*y{name})[0] + 1;"
        probe.values = [name, pointer, f"sizeof({kind})", f"z{name}[1]"]
    else:
        probe.file = (
            f"extern volatile unsigned char {name}; {made.extra()}volatile unsigned char {name} = {number};\n"
        )
        probe.file += f"static int {pointer}(void); typedef int {kind}(void); static {kind} {pointer};\n"
        probe.file += (
            f"static int {pointer}(void) {{ static int x = 3; {{ int x = 9; (void)x; }} return x; }}\n"
        )
        probe.body = f"  {name} += 1;" if dice.may(0.5) else f"  {name} = 9;"
        probe.values = [name, f"{pointer}()"]
    return probe
