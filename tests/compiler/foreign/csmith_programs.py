"""python -m tests.compiler.foreign.csmith_programs: csmith's programs, compiled by avr-gcc and by servogen.

Needs csmith, gcc-avr, avr-libc, simavr and libsimavr-dev (Debian's names). The AVR has what the chip has: an
`int` of 16 bits, little endian, no padding. Every program is small, and says every value of its globals at
the end: on the AVR through simavr's console, on the chip on port B. A program that does not end on the AVR,
or says something else there at another level of optimisation, is not compared; nor is one whose variables the
chip cannot hold.
"""

from __future__ import annotations

import argparse
import random
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from tests.compiler.foreign.__main__ import shape
from tests.compiler.foreign.headers import harness, prelude
from tests.compiler.foreign.judge import Verdict, judge
from tests.compiler.foreign.suites import Program

DIALECTS = ("xc8", "sdcc", "c2c")
LEVELS = ("none", "speed", "size")
MAX_CYCLES = 40_000_000
AVR_SECONDS = 1
"""Of processor time: simavr runs some 20 million cycles; the chip gets about as many."""
MAX_BYTES = 100
"""Of variables on the AVR, whose pointers have two bytes: with more the chip's 68 bytes are too few."""

_TARGETS = "integer size = 2\npointer size = 2\n"
_ALWAYS = ("quiet", "no-longlong", "no-math64", "no-argc", "no-packed-struct", "no-inline-function")
_SWITCHES = ("pointers", "arrays", "structs", "volatiles", "jumps", "consts", "const-pointers", "divs")
_FIELDS = (("bitfields", "no-unions"), ("no-bitfields", "unions"), ("no-bitfields", "no-unions"))
"""What a union holds over bit-fields differs: the chip's do not cross the limits of bytes."""
_PROBABILITIES = """
pointer_as_ltype_prob={pointers}

(simple_types_prob,void_prob=0,char_prob=1,int_prob={wide},short_prob=1,long_prob=0,long_long_prob=0,uchar_prob=1,\
uint_prob={wide},ushort_prob=1,ulong_prob=0,ulong_long_prob=0,float_prob=0)

(safe_ops_size_prob,safe_ops_size_int8=1,safe_ops_size_int16=1,safe_ops_size_int32={wide},safe_ops_size_int64=0)
"""
"""csmith's own weights, but variables of 32 bits, which fill the chip's RAM, in few programs."""
_WRAPPER = re.compile(r"\bsafe_(\w+?)_func_(u?int\d+)_t_([su])(?:_([su]))?\b")
_OPERATORS = {"add": "+", "sub": "-", "mul": "*", "div": "/", "mod": "%", "lshift": "<<", "rshift": ">>"}
_LEFT_OUT = re.compile(
    r"^#(?:include|define).*\n|/\*(?s:.)*?\*/\n?|^static long __undefined;\n|^.*\bprint_hash_value = 0;\n"
    r"|^\s*(?:platform_main_\w+|crc32_gentab)\(.*\n|^\s*if \(print_hash_value\).*\n",
    re.MULTILINE,
)
_AVR = r"""
#include <avr/io.h>
#include <avr/interrupt.h>
#include <avr/sleep.h>
#include <stdint.h>
#include "/usr/include/simavr/avr/avr_mcu_section.h"
AVR_MCU(8000000, "atmega1284");
AVR_MCU_SIMAVR_CONSOLE(&GPIOR0);
static void say(uint8_t byte) { GPIOR0 = 'a' + (byte >> 4); GPIOR0 = 'a' + (byte & 15); GPIOR0 = '\r'; }
"""
_CHIP = """
#include <stdint.h>
static void say(unsigned char byte) { PORTB = byte; PORTA = 1; PORTA = 0; }
"""
_SAYING = """
static void say_all(uint32_t value) { say(value); say(value >> 8); say(value >> 16); say(value >> 24); }
#define transparent_crc(value, name, flag) say_all(value)
"""
_AVR_MAIN = """
#undef main
int main(void) { csmith_main(); GPIOR0 = 'z'; GPIOR0 = '\\r'; cli(); sleep_cpu(); }
"""
_GCC = ("avr-gcc", "-mmcu=atmega1284", "-fwrapv", "-fno-strict-aliasing", "-std=gnu99", "-w")
_LINK = ("-Wl,--undefined=_mmcu,--section-start=.mmcu=0x910000",)


def options(drawn: random.Random) -> list[str]:
    """Return options for csmith: small programs of all kinds."""
    limits = {
        "max-funcs": drawn.choice((1, 1, 2, 2, 3)),
        "max-block-size": drawn.randint(1, 4),
        "max-block-depth": drawn.randint(1, 3),
        "max-expr-complexity": drawn.randint(1, 8),
        "max-array-dim": drawn.randint(1, 2),
        "max-array-len-per-dim": drawn.randint(1, 5),
        "max-struct-fields": drawn.randint(1, 4),
        "max-union-fields": drawn.randint(1, 3),
        "max-pointer-depth": drawn.randint(1, 2),
    }
    switches = [each if drawn.random() < 0.75 else f"no-{each}" for each in _SWITCHES]
    sizes = [part for name, value in limits.items() for part in (f"--{name}", f"{value}")]
    return [*sizes, *(f"--{each}" for each in (*_ALWAYS, *switches, *drawn.choice(_FIELDS)))]


def generated(seed: int, folder: Path) -> str:
    """Return csmith's program of a seed."""
    drawn = random.Random(seed)
    (folder / "platform.info").write_text(_TARGETS)
    probabilities = folder / "probabilities"
    probabilities.write_text(
        _PROBABILITIES.format(pointers=drawn.choice((10, 25, 50)), wide=int(drawn.random() < 0.3))
    )
    command = ["csmith", "--seed", f"{seed}", *options(drawn), "--probability-configuration", probabilities]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout


def body(text: str, dialect: str, *, functions: bool) -> str:
    """Return a program without csmith's headers: its operations are macros or functions that guard the
    divisor and the count of a shift; everything else wraps around.

    In C2C `int` and what promotes to it are unsigned, so that a program uses signed types of 8 bits only.
    """
    text = _LEFT_OUT.sub("", text)
    if dialect == "c2c":
        text = re.sub(r"\buint8_t\b", "uint16_t", re.sub(r"\bunsigned (?=f\d+ :)", "signed ", text))
        text = re.sub(r"(?<!signed )\bint\b(?! main)", "signed int", text)
        text = _WRAPPER.sub(lambda found: found[0].replace("_uint8_t", "_uint16_t"), text)
    used = dict.fromkeys(found[0] for found in _WRAPPER.finditer(text))
    define = function if functions else macro
    return "".join(map(define, used)) + _SAYING + text


def _parts(name: str) -> tuple[str, str, str, str]:
    """Return the operator of one of csmith's wrappers, its type, and its right operand's type and form."""
    found = _WRAPPER.fullmatch(name)
    assert found is not None
    kind = f"{found[2]}_t"
    if found[1] in ("lshift", "rshift"):
        right = "signed int" if found[4] == "s" else "unsigned int"
        return _OPERATORS[found[1]], kind, right, f"{{}} & {31 if '32' in kind else 15}"
    return _OPERATORS.get(found[1], ""), kind, kind, "{} | 1" if found[1] in ("div", "mod") else "{}"


def macro(name: str) -> str:
    operator, kind, right, form = _parts(name)
    if not operator:
        return f"#define {name}(a) (({kind})-({kind})(a))\n"
    return f"#define {name}(a, b) (({kind})(({kind})(a) {operator} ({form.format(f'({right})(b)')})))\n"


def function(name: str) -> str:
    operator, kind, right, form = _parts(name)
    if not operator:
        return f"static {kind} {name}({kind} a) {{ return -a; }}\n"
    return f"static {kind} {name}({kind} a, {right} b) {{ return a {operator} ({form.format('b')}); }}\n"


def on_avr(text: str, folder: Path) -> str | None:
    """Return what a program says on the AVR; None where it does not end, is too large, or levels differ."""
    said = _on_avr(text, folder, "-O0")
    return said if said is not None and said == _on_avr(text, folder, "-Os") else None


def _on_avr(text: str, folder: Path, level: str) -> str | None:
    source, binary = folder / "avr.c", folder / "avr.elf"
    source.write_text(f"#define main csmith_main\n{_AVR}{text}{_AVR_MAIN}")
    subprocess.run([*_GCC, level, *_LINK, source, "-o", binary], check=True, capture_output=True, text=True)
    sizes = subprocess.run(["avr-size", binary], capture_output=True, text=True, check=True).stdout.split()
    if int(sizes[7]) + int(sizes[8]) > MAX_BYTES:
        return None
    command = ["prlimit", f"--cpu={AVR_SECONDS}", "simavr", binary]
    ran = subprocess.run(command, capture_output=True, check=False)
    printed = [line.partition(b"O:")[2].decode() for line in ran.stderr.splitlines() if b"O:" in line]
    if not printed or printed[-1] != "z":
        return None
    return "".join(chr(16 * (ord(each[0]) - 97) + ord(each[1]) - 97) for each in printed[:-1])


def chip_program(seed: int, dialect: str, folder: Path) -> Program | None:
    """Return the program of a seed with what it says on the AVR; None where that is not known."""
    text = body(generated(seed, folder), dialect, functions=seed % 4 == 0)
    output = on_avr(text, folder)
    if output is None:
        return None
    whole = f"{prelude('', dialect)}{_CHIP}{text}{harness('csmith_main();')}"
    return Program(
        f"seed {seed} {dialect}", folder / "chip.c", whole, {"main": "csmith_main"}, output, dialect=dialect
    )


def main(given: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tests.compiler.foreign.csmith_programs", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--first", type=int, default=1, help="the first seed")
    parser.add_argument("--dialect", choices=DIALECTS, help="only this one, not each in turn")
    parser.add_argument("--keep", type=Path, help="a folder for programs that are not right")
    parser.add_argument("--verbose", action="store_true", help="print every verdict")
    arguments = parser.parse_args(given)
    kinds: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    programs: Counter[str] = Counter()
    started = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(arguments.first, arguments.first + arguments.seeds):
            dialect = arguments.dialect or DIALECTS[seed % len(DIALECTS)]
            program = chip_program(seed, dialect, Path(folder))
            compared = False
            for level in LEVELS if program is not None else ():
                verdict = judge(program, level, cycles=MAX_CYCLES)
                kind = "does not fit" if verdict.does_not_fit else verdict.kind
                kinds[kind] += 1
                compared |= kind == "right" or verdict.bad
                if kind == "refused":
                    reasons[shape(verdict.reason)] += 1
                if verdict.bad or arguments.verbose:
                    print(f"{kind.upper()} {program.name} {level}: {verdict.reason}", flush=True)
                if arguments.keep and kind not in ("right", "does not fit"):
                    name = f"{program.name} {level}.c".replace(" ", "-")
                    (arguments.keep / name).write_text(f"// {verdict.reason}\n{program.text}")
            programs[f"{dialect} {'' if compared else 'not '}compared"] += 1
            if seed % 100 == 0:
                print(f"{dict(programs)}, {time.monotonic() - started:.0f} s: {dict(kinds)}", flush=True)
    for reason, count in reasons.most_common():
        print(f"{count:6} refused: {reason}")
    print(f"{dict(programs)}, {time.monotonic() - started:.0f} s: {dict(kinds)}")
    return int(any(Verdict(kind).bad for kind in kinds if kind != "does not fit") or not kinds["right"])


if __name__ == "__main__":
    sys.exit(main())
