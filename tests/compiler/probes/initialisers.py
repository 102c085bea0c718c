"""Objects of random types with random initialisers: designators, omitted braces, bit-fields, unions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from tests.compiler.probes.probe import Dice, Probe

_SCALARS = {
    "unsigned char": 1,
    "signed char": 1,
    "char": 1,
    "int": 2,
    "unsigned int": 2,
    "long": 4,
    "uint16_t": 2,
}


@dataclass(frozen=True)
class Type:
    """`kind`: a scalar's name, "array", "struct", "union", or "bits"."""

    kind: str
    size: int = 1
    length: int = 0
    members: tuple[tuple[str, Type], ...] = ()
    width: int = 0
    signed: bool = False

    @property
    def aggregate(self) -> bool:
        return self.kind in ("array", "struct", "union")

    @property
    def items(self) -> list[tuple[str, Type]]:
        """What an initialiser without designators begins with, by the designator of each."""
        if self.kind == "array":
            return [(f"[{at}]", self.members[0][1]) for at in range(self.length)]
        named = [(f".{name}", inner) for name, inner in self.members if name]
        return named[:1] if self.kind == "union" else named


def random_type(dice: Dice, depth: int, *, top: bool = True) -> Type:
    which = dice.choice(
        ["array", "struct", "struct", "union"] if top else ["scalar"] * 4 + ["array", "struct", "union"]
    )
    if which == "scalar" or depth == 0:
        name = dice.choice(list(_SCALARS))
        return Type(name, _SCALARS[name])
    if which == "array":
        inner, length = random_type(dice, depth - 1, top=False), dice.randint(1, 3)
        return Type("array", inner.size * length, length, (("", inner),))
    members, used = [], 0
    for at in range(dice.randint(1, 3)):
        if which == "struct" and dice.may(0.35):
            width, name = dice.randint(1, 8), "" if dice.may(0.15) else f"m{at}"
            inner = Type("bits", 2, width=width, signed=bool(name) and width > 1 and dice.may(0.3))
        else:
            inner, name = random_type(dice, depth - 1, top=False), f"m{at}"
        members.append((name, inner))
        used += inner.size
    if not any(name for name, _ in members):
        members.append(("last", Type("int", 2)))
    return Type(which, used, members=tuple(members))


def specifier(kind: Type, name: str) -> str:
    """The declaration of `name`, without its initialiser."""
    if kind.kind == "array":
        return specifier(kind.members[0][1], f"{name}[{kind.length}]")
    if kind.kind == "bits":
        return f"{'signed' if kind.signed else 'unsigned'} {name} : {kind.width}"
    if kind.kind in ("struct", "union"):
        inside = " ".join(f"{specifier(inner, member)};" for member, inner in kind.members)
        return f"{kind.kind} {{ {inside} }} {name}"
    return f"{kind.kind} {name}"


def scalar(dice: Dice, kind: Type) -> str:
    if kind.kind == "bits":
        low = -(1 << kind.width - 1) if kind.signed else 0
        return str(dice.randint(low, low + (1 << kind.width) - 1))
    if dice.may(0.1):
        return dice.choice(["'A'", "'\\xfe'", "'\\0'"])
    low = 0 if kind.kind.startswith(("u", "char")) else -(1 << 8 * kind.size - 1)
    return str(dice.choice([dice.randint(low, low + (1 << 8 * kind.size) - 1), dice.randint(0, 100)]))


def flat(dice: Dice, kind: Type) -> list[str]:
    """Initialisers of the scalars of an object, without braces."""
    if not kind.aggregate:
        return [scalar(dice, kind)]
    return [text for _, inner in kind.items for text in flat(dice, inner)]


def initialiser(dice: Dice, kind: Type) -> str:
    """An initialiser with its braces."""
    if not kind.aggregate:
        return f"{{{scalar(dice, kind)}}}" if dice.may(0.1) and kind.kind != "bits" else scalar(dice, kind)
    items = kind.items
    if kind.kind == "array" and items[0][1].kind in ("char", "unsigned char") and dice.may(0.3):
        text = f'"{"".join(dice.choice("abc019") for _ in range(dice.randint(0, kind.length)))}"'
        return f"{{ {text} }}" if dice.may(0.3) else text
    out, at, designators = list[str](), 0, dice.may(0.5)
    for _ in range(dice.randint(1, len(items) + 1)):
        if designators and dice.may(0.5):
            named = (
                [(f".{name}", inner) for name, inner in kind.members if name]
                if kind.kind == "union"
                else items
            )
            at = dice.randrange(len(named))
            path, inner = named[at]
            while inner.aggregate and dice.may(0.03):
                step, inner = dice.choice(inner.items)
                path += step
            out.append(f"{path} = {initialiser(dice, inner)}")
            if kind.kind == "union" or path != named[at][0]:
                break
        elif at < len(items) and not (kind.kind == "union" and out):
            inner = items[at][1]
            out += flat(dice, inner) if inner.aggregate and dice.may(0.4) else [initialiser(dice, inner)]
        at += 1
    comma = "," if out and dice.may(0.1) else ""
    return f"{{ {', '.join(out) or '0'}{comma} }}"


def leaves(kind: Type, path: str) -> Iterator[tuple[str, Type]]:
    """The scalars of an object; of a union, of its first member."""
    if not kind.aggregate:
        yield path, kind
    elif kind.kind == "union":
        yield from leaves(kind.members[0][1], f"{path}.{kind.members[0][0]}")
    else:
        for step, inner in kind.items:
            yield from leaves(inner, path + step)


def objects(dice: Dice) -> Probe:
    probe = Probe("initialiser")
    kind = random_type(dice, 2)
    while kind.size > 12:
        kind = random_type(dice, 2)
    name = dice.name("o")
    text = specifier(kind, name)
    if kind.kind == "array" and dice.may(0.3):
        text = specifier(kind.members[0][1], f"{name}[]")
        declared = f"{text} = {initialiser(dice, kind)};"
        probe.values.append(f"sizeof {name} / sizeof {name}[0]")
        kept = kind.items[:1]
    else:
        declared = f"{text} = {initialiser(dice, kind)};"
        kept = None
    where = dice.randrange(4)
    if where == 0:
        probe.file = f"static const {declared}\n"
    elif where == 1:
        probe.file = f"static {declared}\n"
    else:
        probe.body = f"  {'static ' if where == 3 else ''}{declared}"
    inside = leaves(kind, name) if kept is None else leaves(kept[0][1], f"{name}[0]")
    for path, inner in inside:
        probe.wide(path, 1 if inner.kind == "bits" else inner.size)
    return probe
