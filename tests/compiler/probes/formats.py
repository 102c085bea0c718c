"""Formats of `sprintf`; the judge is the host's, whose arguments have the chip's widths."""

from __future__ import annotations

from tests.compiler.probes.probe import Dice, Probe

_TYPES = {
    # size and conversion: the type of the argument here, and the range of its values
    "d": ("int", -(1 << 15), (1 << 15) - 1),
    "i": ("int", -(1 << 15), (1 << 15) - 1),
    "u": ("unsigned", 0, (1 << 16) - 1),
    "x": ("unsigned", 0, (1 << 16) - 1),
    "X": ("unsigned", 0, (1 << 16) - 1),
    "o": ("unsigned", 0, (1 << 16) - 1),
    "ld": ("long", -(1 << 31), (1 << 31) - 1),
    "lu": ("unsigned long", 0, (1 << 32) - 1),
    "lx": ("unsigned long", 0, (1 << 32) - 1),
    "hhd": ("int", -(1 << 15), (1 << 15) - 1),
    "hhu": ("unsigned", 0, (1 << 16) - 1),
    "hd": ("int", -(1 << 15), (1 << 15) - 1),
    "hx": ("unsigned", 0, (1 << 16) - 1),
    "c": ("int", 32, 126),
    "s": ("", 0, 0),
}
_HOST = {"int": "int16_t", "unsigned": "uint16_t", "long": "int32_t", "unsigned long": "uint32_t"}
_CAST = {"long": "long", "unsigned long": "unsigned long"}


def conversion(dice: Dice) -> tuple[str, str]:
    """A conversion and its argument."""
    name = dice.choice(list(_TYPES))
    flags = "".join(dice.sample("-+ 0", dice.choice([0, 0, 0, 1, 1, 2])))
    if name[-1] in "cs":
        flags = flags.replace("0", "").replace("+", "").replace(" ", "")
    elif name[-1] not in "di":
        flags = flags.replace("+", "").replace(" ", "")
    width = dice.choice(["", "", "1", "3", "6", "8"])
    precision = dice.choice([".0", ".1", ".4"]) if dice.may(0.03) else ""
    argument, low, high = _TYPES[name]
    if name == "s":
        return f"%{flags}{width}{precision}s", '"' + "abcdefg"[: dice.randint(0, 7)] + '"'
    value = dice.choice([low, high, 0, 1, 9, 10, 255, 256, dice.randint(low, high)])
    value = min(max(value, low), high)
    suffix = ("u" if low == 0 and name != "c" else "") + ("L" if "long" in argument else "")
    text = f"({value}{suffix})" if value > low or low == 0 else f"({value + 1}{suffix} - 1)"
    cast = f"({_CAST.get(argument, _HOST[argument])})" if argument in _HOST else ""
    return f"%{flags}{width}{precision}{name}", f"«({argument}){text}|{cast}{text}»"


def formats(dice: Dice) -> Probe:
    probe = Probe("format")
    length = dice.name("n")
    one, argument = conversion(dice)
    text = dice.choice(["", "a", "%%", " ", "x="]) + one + dice.choice(["", "b", "%%"])
    probe.body = (
        f"  unsigned char {length}, at;\n"
        f'  {length} = (unsigned char)sprintf(buffer, "{text}", {argument});\n'
        f"  for (at = 0; at <= {length}; at++) «out|OUT»(buffer[at]);"
    )
    probe.values = [length]
    return probe
