"""Macros and directives: text whose tokens two preprocessors must agree on."""

from __future__ import annotations

from dataclasses import dataclass, field

from tests.compiler.probes.probe import Dice

_OPERATORS = ["+", "-", "*", "<<", "==", "&&", ".", "->", "!", "~", "?", ":", "++", "%", "|=", ";", "[", "]"]


@dataclass
class Macro:
    name: str
    parameters: list[str] | None
    variadic: bool = False


@dataclass
class Text:
    """Lines of a file, and the files that it includes."""

    lines: list[str] = field(default_factory=list)
    files: dict[str, str] = field(default_factory=dict)


class Writer:
    """Writes one text; a macro uses only those defined before it, or itself."""

    def __init__(self, dice: Dice) -> None:
        self.dice, self.text, self.macros = dice, Text(), list[Macro]()

    def plain(self) -> str:
        """A token that may be joined with another one."""
        return self.dice.choice(["a", "b1", "x_", "7", "42", "if", "_0"])

    def token(self) -> str:
        dice = self.dice
        which = dice.randrange(8)
        if which < 3:
            return self.plain()
        if which == 3:
            return dice.choice(['"s"', "'c'", '"a,b"', '"\\"("', "'\\''", '"\\\\n"', "'\"'", '""'])
        if which == 4:
            return dice.choice(["0x1F", "1u", "10UL", "017", "1.5", "1e3", "0b101"])
        return dice.choice(_OPERATORS)

    def argument(self, depth: int, *, joined: bool) -> str:
        """An argument of a macro; one that may be joined begins and ends with a name or a number."""
        dice = self.dice
        if dice.may(0.12):
            return ""
        if depth and self.macros and not joined and dice.may(0.5):
            return self.use(dice.choice(self.macros), depth - 1)
        if dice.may(0.6):
            return self.plain()
        inner = " ".join(self.token() for _ in range(dice.randint(0, 2)))
        return dice.choice([f"{self.plain()} {inner} {self.plain()}", f"a ({inner} , {self.plain()}) b1"])

    def use(self, macro: Macro, depth: int = 2) -> str:
        """A use of a macro; sometimes its name alone."""
        dice = self.dice
        if macro.parameters is None or dice.may(0.08):
            return macro.name
        count = len(macro.parameters) + (
            dice.randint(0 if macro.parameters else 1, 2) if macro.variadic else 0
        )
        last = len(macro.parameters) - 1
        arguments = [self.argument(depth, joined=at == last) for at in range(count)]
        space = dice.choice(["", "", " ", "\t"])
        joint = dice.choice([",", ", ", " , ", " /* , */ ,"])
        return f"{macro.name}{space}({dice.choice(['', ' '])}{joint.join(arguments)})"

    def body(self, macro: Macro) -> str:
        dice, out = self.dice, list[str]()
        parameters = list(macro.parameters or [])
        if macro.variadic:
            parameters += ["__VA_ARGS__"]
        for _ in range(dice.randint(0, 6)):
            which = dice.randrange(9)
            if which < 3 and parameters:
                out.append(dice.choice(parameters))
            elif which == 3 and parameters:
                out.append(dice.choice(["#", "# "]) + dice.choice(parameters))
            elif which == 4:
                named = (macro.parameters or [])[-1:]
                left = dice.choice([*named, "a", "x_"])
                joint = dice.choice(["##", " ## ", "## "])
                out.append(f"{left}{joint}{dice.choice([*named, 'b', '9', 'c_'])}")
            elif which == 5 and self.macros:
                out.append(self.use(dice.choice(self.macros), 1))
            elif which == 6:
                out.append(dice.choice([macro.name, self.plain()]))
            else:
                out.append(self.token())
        if macro.variadic and dice.may(0.2):
            out.append("f(a , ## __VA_ARGS__)")
        return dice.choice([" ", "  ", " /* c */ "]).join(out)

    def define(self) -> None:
        dice = self.dice
        macro = Macro(dice.name("M"), None)
        if dice.may(0.7):
            macro.parameters = ["p", "q", "r"][: dice.randint(0, 3)]
            macro.variadic = dice.may(0.25)
        inside = (
            ""
            if macro.parameters is None
            else ", ".join([*macro.parameters, *(["..."] if macro.variadic else [])])
        )
        head = macro.name if macro.parameters is None else f"{macro.name}({inside})"
        body = self.body(macro)
        if dice.may(0.15):
            body = body.replace(" ", " \\\n ", 1)
        self.text.lines.append(f"{dice.choice(['#', '# ', '  #'])}define {head} {body}")
        self.macros.append(macro)

    def condition(self, depth: int = 2) -> str:
        """An expression of `#if`."""
        dice = self.dice
        if not depth or dice.may(0.3):
            number = dice.choice(
                ["0", "1", "2", "0x10", "07", "10u", "3L", "'A'", "0xFFFFFFFF", "'\\n'", "32767"]
            )
            known = dice.choice([each.name for each in self.macros if each.parameters is None] or ["no"])
            name = dice.choice([known, "nothing"])
            return dice.choice([number, number, number, f"defined {name}", f"defined({name})", "nothing"])
        op = dice.choice(["+", "-", "*", "<", ">", "<=", "==", "!=", "&&", "||", "&", "|", "^", "<<", ">>"])
        one, two = self.condition(depth - 1), self.condition(depth - 1)
        if op in ("<<", ">>"):
            two = str(dice.randint(0, 20))
        if dice.may(0.15):
            return f"({one} ? {two} : {self.condition(depth - 1)})"
        return f"({dice.choice(['', '', '!', '-', '~'])}{one} {op} {two})"

    def conditional(self) -> None:
        """A group of `#if` with marks in its parts; a part that is left out may hold anything."""
        dice, mark = self.dice, self.dice.name("g")
        self.text.lines.append(f"#if {self.condition()}\n{mark}_1")
        if dice.may(0.4):
            self.text.lines.append(f"#elif {self.condition()}\n{mark}_2")
        if dice.may(0.6):
            self.text.lines.append(f"#else\n{mark}_3")
        self.text.lines.append(f"#endif{dice.choice(['', ' // c', ' /* c */'])}")
        if dice.may(0.3):
            self.text.lines.append("#if 0\n it's \"left out\n#if 1\n#else\n#bad\n#endif\n#endif")

    def include(self, depth: int = 2) -> None:
        """A header, guarded or not, that is included twice and may include another."""
        dice = self.dice
        name, guard = dice.name("h") + ".h", dice.name("G")
        inner = Writer(dice)
        inner.macros = self.macros
        inner.define()
        inner.line()
        if depth and dice.may(0.4):
            inner.include(depth - 1)
        body = "\n".join(inner.text.lines)
        form = dice.randrange(3)
        if form == 0:
            body = f"#ifndef {guard}\n#define {guard}\n{body}\n#endif"
        elif form == 1:
            body = f"#pragma once\n{body}"
        else:
            # without a guard its definitions come twice, and are the same
            pass
        self.text.files |= {**inner.text.files, name: f"{body}\n"}
        written = f'"{name}"'
        if dice.may(0.3):
            macro = dice.name("I")
            self.text.lines.append(f"#define {macro} {written}")
            written = macro
        self.text.lines += [f"#include {written}"] * dice.choice([1, 2])

    def line(self) -> None:
        """A line of text with uses of macros."""
        dice, out = self.dice, list[str]()
        for _ in range(dice.randint(1, 3)):
            if self.macros:
                text = self.use(dice.choice(self.macros))
                out.append(text.replace(",", ",\n", 1) if dice.may(0.1) and '"' not in text else text)
            if dice.may(0.4):
                out.append(self.token())
        self.text.lines.append(" ".join(out) + " ;")

    def undefine(self) -> None:
        if self.macros:
            macro = self.macros.pop(self.dice.randrange(len(self.macros)))
            self.text.lines.append(f"#undef {macro.name}")


def written(dice: Dice) -> Text:
    writer = Writer(dice)
    for _ in range(dice.randint(2, 5)):
        writer.define()
    for _ in range(dice.randint(2, 5)):
        dice.choice(
            [
                writer.line,
                writer.line,
                writer.line,
                writer.conditional,
                writer.include,
                writer.define,
                writer.undefine,
            ]
        )()
    return writer.text
