"""Integer and character constants, escapes, strings and their concatenation."""

from __future__ import annotations

from tests.compiler.probes.probe import Dice, Probe

_EDGES = [
    0,
    1,
    7,
    8,
    9,
    10,
    63,
    64,
    127,
    128,
    255,
    256,
    32767,
    32768,
    65535,
    65536,
    2**31 - 1,
    2**31,
    2**32 - 1,
]
_SIMPLE = ["\\n", "\\t", "\\r", "\\a", "\\b", "\\f", "\\v", "\\\\", "\\'", '\\"', "\\?", "\\0"]


def number(dice: Dice) -> str:
    value = dice.choice([*_EDGES, *_EDGES, dice.getrandbits(dice.randint(1, 32))])
    suffix = dice.choice(["", "", "u", "U", "l", "L", "ul", "UL", "lu", "Lu", "uL"])
    form = dice.choice(["d", "d", "x", "X", "o", "b"])
    # a decimal constant without u that needs 64 bits has no type here
    if form == "d" and value >= 2**31 and "u" not in suffix.lower():
        form = "x"
    text = {
        "d": f"{value}",
        "x": f"0x{value:x}",
        "X": f"0X{value:0{dice.randint(1, 8)}X}",
        "o": f"0{value:o}",
    }
    return text.get(form, f"0{dice.choice('bB')}{value:b}") + suffix


def integers(dice: Dice) -> Probe:
    """Sizes, bytes, signedness, and arithmetic of constants."""
    probe = Probe("number")
    one, two = number(dice), number(dice)
    probe.values.append(f"sizeof({one})")
    probe.wide(one, 4 if dice.may(0.5) else 1)
    probe.values.append(f"({one}) * 0 - 1 < 0")
    op = dice.choice(["+", "-", "*", "&", "|", "^", "<", ">=", "=="])
    expression = f"({one}) {op} ({dice.choice(['', '-', '~'])}{two})"
    if dice.may(0.3):
        expression = f"({one}) {dice.choice(['/', '%'])} (({two}) | 1)"
    elif dice.may(0.3):
        expression = f"({one}) {dice.choice(['<<', '>>'])} {dice.randint(0, 15)}"
    probe.values += [f"sizeof({expression})", f"sizeof({dice.choice('01')} ? {one} : {two})"]
    probe.wide(f"(unsigned long)({expression})", 4)
    return probe


def escape(dice: Dice, *, last: bool) -> str:
    """An escape sequence; one in hexadecimal only where no digit can follow."""
    which = dice.randrange(4)
    if which == 0:
        return dice.choice(_SIMPLE[:-1])
    if which == 1 and last:
        return f"\\x{dice.randrange(256):{dice.choice(['x', 'X', '02x', '02X', '04x'])}}"
    value = dice.randrange(256)
    return f"\\{value:03o}" if not last or dice.may(0.5) else f"\\{value:o}"


def character(dice: Dice) -> str:
    return dice.choice('aZ09 _~%/*#?,;({["') if dice.may(0.5) else escape(dice, last=True)


def characters(dice: Dice) -> Probe:
    probe = Probe("character")
    for _ in range(3):
        one = f"'{character(dice)}'"
        probe.values += [one, f"sizeof {one}", f"({one} + 0) >> 8", f"{one} < 0"]
    if dice.may(0.03):
        two = "".join(dice.choice("abcXYZ019") for _ in range(2))
        probe.wide(f"'{two}'", 2)
    return probe


def piece(dice: Dice) -> str:
    """One string literal."""
    out = []
    for at in range(length := dice.randint(0, 4)):
        if dice.may(0.4):
            out.append(escape(dice, last=at == length - 1))
        else:
            out.append(dice.choice("abcdefABCDEF0123456789xXn ?/*'%,\t").replace("\t", "\\t"))
        if dice.may(0.03):
            out.append("\\\n")
    return f'"{"".join(out)}"'


def pieces(dice: Dice, probe: Probe) -> str:
    """Adjacent literals, of which some come from macros."""
    found = []
    for _ in range(dice.choice([1, 2, 2, 3, 4])):
        text = piece(dice)
        if dice.may(0.25):
            name = dice.name("M")
            probe.file += f"#define {name} {text}\n"
            text = name
        elif dice.may(0.1):
            name = dice.name("M")
            probe.file += f"#define {name}(x) #x\n"
            inside = ["a  b", "1+ 2", piece(dice), "x" + piece(dice), f"'{character(dice)}'"]
            text = f"{name}({dice.choice(inside)})"
        found.append(text)
    return dice.choice([" ", " ", "\n", ' /* " */ ', " // '\n"]).join(found)


def strings(dice: Dice) -> Probe:
    probe = Probe("string")
    text, name = pieces(dice, probe), dice.name("s")
    storage = dice.choice(["static const ", "const ", "static "])
    form = dice.randrange(6)
    if form == 0:
        probe.values += [f"sizeof({text})", f"(({text}))[0]", f"*({text})"]
        return probe
    if form == 1:
        probe.body = f"  const char *{name} = {text};"
        probe.values += [f"{name}[0]"] if dice.may(0.5) else [f"*{name}"]
        return probe
    if form == 2:
        rows = f"{text}, {{ {piece(dice)} }}, {pieces(dice, probe)}"
        probe.file += f"static const char {name}[][24] = {{ {rows} }};\n"
        probe.values += [
            f"sizeof {name}",
            *(f"{name}[{row}][{at}]" for row in range(3) for at in range(0, 12, 2)),
        ]
        return probe
    brace = ("{ ", dice.choice([" }", ", }"])) if form == 3 else ("", "")
    bound = dice.choice(["", "", "16", "20"])
    probe.file += f"{storage}char {name}[{bound}] = {brace[0]}{text}{brace[1]};\n"
    probe.values += [f"sizeof {name}"]
    # every byte of the object, whatever its length: an index beyond it stays at the last
    probe.values += [f"{name}[{at} < sizeof {name} ? {at} : sizeof {name} - 1]" for at in range(14)]
    return probe
