"""Compilers other than servogen's: its own made another one by a seed, and the real SDCC where it is found.

In: C of a dialect. Out: an `Image`.
"""

import random
import re
import shutil
import subprocess
from functools import cache
from pathlib import Path

from servogen.compiler import Options, Source, compile_sources
from servogen.pic.device import Device
from servogen.pic.image import Image, from_hex

NOP = {"c2c": "nop();", "xc8": "NOP();", "sdcc": "nop();"}
LEVELS = ("none", "speed", "size")
MOST = 9
"""NOPs behind a statement."""


def other_compiler(text: str, dialect: str, device: Device, seed: int) -> Image:
    """As a compiler that needs more cycles for each statement, start-up and loop: 0 to `MOST`, by the seed.

    How many does not depend on the delays: the same statement costs the same in every rendering.
    """
    draw = random.Random(seed)
    lines = []
    inside = False
    for line in text.splitlines():
        inside = inside or line.startswith(("void position_", "void main"))
        nops = " ".join([NOP[dialect]] * draw.randint(0, MOST)) if inside and _costs(line) else ""
        lines += [f"{nops} {line}"] if line.lstrip().startswith("if (") else [f"{line} {nops}"]
    options = Options(dialect=dialect, device=device, optimise=draw.choice(LEVELS))
    return compile_sources([Source("\n".join(lines), "other.c")], options).image


def _costs(line: str) -> bool:
    code = line.split("/*")[0].strip()
    return bool(re.match(r"PORT|TRIS|position_\d+\(|turns|if \(--frames|while \(1\) \{$", code))


@cache
def sdcc() -> Path | None:
    """SDCC with its pic14 port, headers and libraries; None where this machine has none."""
    found = shutil.which("sdcc")
    return Path(found) if found and _makes_a_hex(Path(found)) else None


def _makes_a_hex(compiler: Path) -> bool:
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        start = 'void _sdcc_gsinit_startup(void)\n{\n    __asm__("goto _main");\n}\n'
        text = f"#include <pic14/pic16f84.h>\nvoid main(void)\n{{\n    PORTB = 0;\n}}\n{start}"
        return sdcc_compiled(text, "PIC16F84", Path(folder), compiler) is not None


def sdcc_compiled(text: str, device: str, folder: Path, compiler: Path) -> Image | None:
    """What SDCC makes of `text`; None where it makes nothing."""
    (folder / "main.c").write_text(text)
    chip = device.removeprefix("PIC").lower()
    command = [str(compiler), "-mpic14", f"-p{chip}", "--use-non-free", "--stack-size", "5", "main.c"]
    subprocess.run(command, cwd=folder, capture_output=True, check=False)
    made = folder / "main.hex"
    return from_hex(made.read_text(), str(made)) if made.is_file() else None
