"""Mutants of every kind of file that servogen reads: each is read or refused, quickly, and never a traceback.

    python -m tests.fuzz_files --kind job --mutants 2000 [--seed 1]
    python -m tests.fuzz_files --kind all --mutants 200

A mutant is one of the kind's good files with one to four changes: bytes changed, dropped, put in; lines
doubled, moved, dropped; numbers replaced by extreme ones; words by other words of the file. The commands that
read the kind run on it in this process. A mutant has MAX_CPU_S of processor time and MAX_BYTES of memory.
Whatever is raised but an error that a user is shown is a failure, and the mutant is kept for a look.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import random
import re
import resource
import signal
import sys
import tempfile
import time
import traceback
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any

import typer

from servogen.cli.app import app
from servogen.errors import ServogenError
from servogen.pic.image import to_hex
from tests.pic import symbol_files

UsageError: type[Exception] = typer.BadParameter.__mro__[1]
"""What typer raises for a wrong command line."""

ROOT = Path(__file__).parent.parent
JOBS = ROOT / "jobs"
FIRMWARE = ROOT / "firmware"
CATALOGUE = ROOT / "servogen" / "robot" / "catalogue"
LABS = ROOT / "servogen" / "grade" / "labs"
PROGRAMS = ROOT / "tests" / "pic" / "programs"

MAX_CPU_S = 20
"""A tenth is what the slowest takes; the rest is for slow machines."""

MAX_BYTES = 1 << 30
"""Beyond what the process has before."""


class OverBudget(BaseException):
    """The mutant took too long. Not an Exception, so that nobody catches it on the way."""


Command = Sequence[str]


@dataclass(frozen=True)
class Kind:
    """A kind of file: its ending, good ones, and what runs on a mutant: `{file}`, in `{folder}`."""

    suffix: str
    seeds: Callable[[], Sequence[bytes]]
    commands: Sequence[Command]
    repair: Callable[[bytes], bytes] = field(default=lambda data: data)
    """Makes what every mutant would be refused for right again; used on half of them."""
    beside: Mapping[str, Callable[[], bytes]] = field(default_factory=dict)
    """Other files that the commands need, by their names."""


# -- good files ---------------------------------------------------------------------------------------


def files(*paths: Path) -> Callable[[], Sequence[bytes]]:
    return lambda: [path.read_bytes() for path in paths]


def texts(*each: str) -> Callable[[], Sequence[bytes]]:
    return lambda: [text.encode() for text in each]


ONE_SERVO = """\
[chip]
device = "PIC16F84"
clock_hz = 4_000_000
[[servo]]
name = "arm"
pin = "RB0"
model = "{model}"
{more}
[motion]
poses = [{{ arm_deg = 30, hold_s = 0.2 }}, {{ arm_deg = 90, hold_s = 0.2, move_s = 0.2 }}]
"""

PIC_AS = """\
        PROCESSOR 16F84A
#include <xc.inc>   // a comment
        CONFIG FOSC = XT, WDTE = OFF
        psect   udata
flags:  ds      1
        psect   reset, class=CODE, delta=2, abs
        org     0
        goto    main
        org     4
        btfss   INTF
        retfie
        psect   code
main:   banksel TRISB
        clrf    BANKMASK(TRISB)
        movlw   0FFh and 3 /* and another */
        movwf   flags
        psect   edata
        db      1, 'A'
        end     main
"""
INITIALISED = """\
        list p=16f84a
VARS    idata
a       db 1, "ab"
more    dw 0x1234
c       res 2
        extern _cinit
RESET   code 0
        movlw low _cinit
MAIN    code
        movf a, w
        end
"""
CALIBRATED = ONE_SERVO.format(model="futaba-s3001", more='calibration = "mutant.toml"')
OWN_MODEL = ONE_SERVO.format(model="mutant.toml", more="")
RVM_JOB = (JOBS / "rvm1-program.toml").read_text().replace("rvm1-program.rvm", "mutant.rvm")

CALIBRATION = """\
servo = "arm"
model = "futaba-s3001"
points = [
    { angle_deg = 0.0, width_us = 1010.5 },
    { angle_deg = 180.0, width_us = 1990.25 },
]
[fit]
readings = 3
us_per_deg = 5.44
zero_us = 1010.5
rms_deg = 0.2
worst_deg = 0.3
[[reading]]
angle_deg = 45
width_us = 1250.0
residual_deg = 0.1
"""

READINGS = "width_us,angle_deg\n1000,1\n1250.5,44.5\n1500,90\n1750,136\n2000,179.25\n"

STIMULUS = """\
[[level]]
pin = "RB0"
at_us = [0, 500, 900.5]
level = [1, 0, "free"]
[[periodic]]
pin = "RA4"
period_us = 100
high_us = 50
from_us = 10
times = 10
[[button]]
pin = "RB1"
pressed_us = 1_000
released_us = 9_000
bounces = 5
bounce_us = 500
[[serial]]
pin = "RB2"
baud = 9600
text = "go"
from_us = 0
baud_error_percent = 1.5
inverted = false
[[reset]]
pressed_us = 1000
released_us = 2000
"""

JSONL = "".join(
    f'{{"cycle":{cycle},"pin":"RB0","level":{level}}}\n'
    for frame in range(6)
    for cycle, level in ((20_000 * frame + 100, 1), (20_000 * frame + 1600, 0))
)
EDGES = "cycle,pin,level\n" + "".join(
    f"{20_000 * frame + at},{pin},{level}\n"
    for frame in range(6)
    for at, pin, level in ((100, "RB0", 1), (1600, "RB0", 0), (1700, "RB1", 1), (3100, "RB1", 0))
)
VCD = (
    "$date today $end\n$version other $end\n$comment captured on all channels at 1000000 Hz $end\n"
    "$timescale 1 us $end\n$scope module top $end\n$var wire 1 ! RB0_arm $end\n$var wire 8 # bus $end\n"
    "$upscope $end\n$enddefinitions $end\n#0\n$dumpvars\n0!\nb0000 #\n$end\n"
    + "".join(
        f"#{20_000 * frame + at}\n{level}!\n" for frame in range(6) for at, level in ((9, 1), (1509, 0))
    )
    + "#130000\n"
)
SALEAE = "Time [s],RB0,RB1\n-0.000001000,0,1\n" + "".join(
    f"{0.02 * frame + at:.9f},{level},1\n" for frame in range(6) for at, level in ((0.001, 1), (0.0025, 0))
)
METADATA = (
    "[global]\nsigrok version=0.5.2\n\n[device 1]\ncapturefile=logic-1\ntotal probes=2\n"
    "samplerate=100 kHz\nprobe1=RB0\nprobe2=RB1\nunitsize=1\n"
)
TRANSFORMS = ("Ry(30) Tx(50) Rz(60)", "Rx(-1e1)Ty(2.5) Rz(+90) Tz(.3)", "Tx(10) Rx(45.0) Ty(-1e2)")


def with_checksums(data: bytes) -> bytes:
    """HEX records with the lengths and checksums that belong to their bytes."""
    lines = []
    for line in data.splitlines():
        with contextlib.suppress(ValueError):
            record = bytes.fromhex(line.decode("latin-1").removeprefix(":"))[1:-1]
            record = bytes([(len(record) - 3) & 0xFF]) + record
            lines.append(b":" + (record + bytes([-sum(record) & 0xFF])).hex().upper().encode())
            continue
        lines.append(line)
    return b"\n".join(lines)


def session() -> bytes:
    """A sigrok session of a hundred frames, stored."""
    file = io.BytesIO()
    frame = b"\1" * 150 + b"\0" * 1850
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("version", "2")
        archive.writestr("metadata", METADATA)
        archive.writestr("logic-1-1", frame * 3)
        archive.writestr("logic-1-2", frame * 3, zipfile.ZIP_DEFLATED)
    return file.getvalue()


def urdfs() -> Sequence[bytes]:
    from servogen.kinematics.catalogue import arm
    from servogen.kinematics.urdf import to_urdf

    return [to_urdf(arm(name)).encode() for name in ("anthropomorphic", "wrist-arm")]


def schedule() -> bytes:
    """The schedule of a lab, as this version writes it."""
    return (FIRMWARE / "lab9-program" / "schedule.json").read_bytes()


AGAINST = ("verify", "{file}", "--against", "{folder}/schedule.json")
BESIDE_SCHEDULE = {"schedule.json": schedule}
HEX = FIRMWARE / "lab9-program" / "main.hex"

KINDS: Mapping[str, Kind] = {
    "job": Kind(
        ".toml",
        lambda: [
            *(path.read_bytes() for path in sorted(JOBS.glob("lab*.toml"))),
            *(
                (JOBS / name).read_bytes()
                for name in ("stream-arm.toml", "omni-square.toml", "scara-pick.toml")
            ),
            ONE_SERVO.format(model="futaba-s3001", more="trim_us = 5\nreverse = true").encode(),
        ],
        [("check", "{file}")],
    ),
    "robot": Kind(
        ".toml",
        files(*sorted(CATALOGUE.glob("robots/*.toml"))),
        [("robots", "{file}", "--json"), ("fk", "{file}", "10", "20", "30"), ("mobility", "{file}")],
    ),
    "servo": Kind(
        ".toml",
        files(*(CATALOGUE / "servos" / f"{name}.toml" for name in ("futaba-s3001", "mpx-tiny-s"))),
        [("check", "{folder}/job.toml")],
        beside={"job.toml": lambda: OWN_MODEL.encode()},
    ),
    "lab": Kind(
        ".toml",
        files(*sorted(LABS.glob("*.toml"))),
        [("grade", "{file}", "{folder}/no program.hex")],
    ),
    "hex": Kind(
        ".hex",
        files(HEX, *sorted(PROGRAMS.glob("*.hex"))),
        [("disassemble", "{file}"), ("simulate", "{file}", "--cycles", "2000", "--json")],
        with_checksums,
    ),
    "asm": Kind(
        ".asm",
        lambda: [
            *(path.read_bytes() for path in sorted(PROGRAMS.glob("*.asm"))),
            *(source.encode() for source in (PIC_AS, INITIALISED)),
        ],
        [("assemble", "{file}", "-o", "{folder}/made.hex", "--listing", "{folder}/made.lst")],
    ),
    "stimulus": Kind(
        ".toml",
        texts(STIMULUS),
        [("simulate", str(HEX), "--cycles", "20000", "--stimulus", "{file}", "--json")],
    ),
    "schedule": Kind(
        ".json",
        files(FIRMWARE / "lab9-program" / "schedule.json", FIRMWARE / "lab8-exercise" / "schedule.json"),
        [("verify", "{folder}/edges.csv", "--against", "{file}")],
        beside={"edges.csv": lambda: EDGES.encode()},
    ),
    "csv": Kind(".csv", texts(EDGES), [AGAINST, ("measure", "{file}", "--json")], beside=BESIDE_SCHEDULE),
    "jsonl": Kind(".jsonl", texts(JSONL), [AGAINST, ("measure", "{file}", "--json")], beside=BESIDE_SCHEDULE),
    "vcd": Kind(
        ".vcd",
        texts(VCD, VCD.replace("$version other", "$version servogen")),
        [AGAINST, ("measure", "{file}", "--json")],
        beside=BESIDE_SCHEDULE,
    ),
    "saleae": Kind(".csv", texts(SALEAE), [AGAINST], beside=BESIDE_SCHEDULE),
    "sr": Kind(".sr", lambda: [session()], [AGAINST], beside=BESIDE_SCHEDULE),
    "urdf": Kind(
        ".urdf", urdfs, [("fk", "{file}", "10", "20", "30", "--json"), ("robots", "{file}", "--json")]
    ),
    "rvm": Kind(
        ".rvm",
        files(JOBS / "rvm1-program.rvm"),
        [("run-program", "{file}", "--max-s", "60", "--max-commands", "1000", "--json")],
    ),
    "calibration": Kind(
        ".toml",
        texts(CALIBRATION),
        [("check", "{folder}/job.toml")],
        beside={"job.toml": lambda: CALIBRATED.encode()},
    ),
    "readings": Kind(
        ".csv",
        texts(READINGS),
        [("calibrate", str(JOBS / "lab8-program.toml"), "--readings", "{file}", "-o", "{folder}/made.toml")],
    ),
    **{
        suffix: Kind(
            suffix,
            lambda raw=raw: [raw],
            [("simulate", "{folder}/mutant.hex", "--cycles", "100", "--json")],
            beside={"mutant.hex": lambda: to_hex(symbol_files.image_of()).encode()},
        )
        for suffix, raw in symbol_files.BESIDE.items()
    },
    "transform": Kind(".txt", texts(*TRANSFORMS), [("transform", "{text}", "1", "2", "3")]),
}


# -- mutants ------------------------------------------------------------------------------------------

NUMBER = re.compile(rb"-?\d[\d_]*(?:\.\d+)?(?:[eE][-+]?\d+)?")
WORD = re.compile(rb"[A-Za-z_][A-Za-z_0-9]*")
EXTREME = (
    *(b"0", b"-1", b"1", b"2", b"0.5", b"-0.0", b"255", b"65536", b"2147483648", b"4294967296", b"1e9"),
    *(b"9223372036854775807", b"9223372036854775808", b"1000000000000000000", b"123456789012", b"1e-9"),
    *(b"1e308", b"1e-308", b"1e400", b"nan", b"inf", b"-inf", b"1e15", b"-1e15", b"9" * 5000, b"0x7FFFFF"),
)
ODD = (
    b"\0",
    b"\xff",
    b"\xed\xb0\x80",
    b"\xf0\x9f\xa6\xbe",
    b"\r",
    b"\x1a",
    b"\\",
    b"'",
    b'"',
    b"{",
    b"[",
    b"(",
)


def mutant(seeds: Sequence[bytes], dice: random.Random) -> bytes:
    """One of `seeds` with one to four changes."""
    data = dice.choice(seeds)
    for _ in range(dice.choice((1, 1, 1, 2, 2, 3, 4))):
        data = dice.choice(CHANGES)(data, dice, seeds)
    return data


def change_byte(data: bytes, dice: random.Random, seeds: Sequence[bytes]) -> bytes:
    at = dice.randrange(len(data) + 1)
    return data[:at] + bytes([dice.randrange(256)]) + data[at + 1 :]


def put_in(data: bytes, dice: random.Random, seeds: Sequence[bytes]) -> bytes:
    at = dice.randrange(len(data) + 1)
    return (
        data[:at] + dice.choice((dice.randbytes(3), dice.choice(ODD))) * dice.choice((1, 1, 300)) + data[at:]
    )


def cut_out(data: bytes, dice: random.Random, seeds: Sequence[bytes]) -> bytes:
    at = dice.randrange(len(data) + 1)
    return data[:at] + data[at + dice.choice((1, 3, 20, len(data))) :]


def change_number(data: bytes, dice: random.Random, seeds: Sequence[bytes]) -> bytes:
    found = list(NUMBER.finditer(data))
    if not found:
        return data
    number = dice.choice(found)
    return data[: number.start()] + dice.choice(EXTREME) + data[number.end() :]


def change_word(data: bytes, dice: random.Random, seeds: Sequence[bytes]) -> bytes:
    found, others = list(WORD.finditer(data)), WORD.findall(dice.choice(seeds))
    if not found or not others:
        return data
    word = dice.choice(found)
    return data[: word.start()] + dice.choice(others) + data[word.end() :]


def change_lines(data: bytes, dice: random.Random, seeds: Sequence[bytes]) -> bytes:
    """Lines doubled, dropped, moved, repeated a thousand times, or taken from another file."""
    lines = data.splitlines(keepends=True) or [b""]
    first = dice.randrange(len(lines))
    piece = lines[first : first + dice.choice((1, 1, 2, 5))]
    rest = lines[:first] + lines[first + len(piece) :]
    where = dice.randrange(len(rest) + 1)
    other = dice.choice(seeds).splitlines(keepends=True) or [b""]
    new = dice.choice(([], piece, piece * 2, piece * 1000, [dice.choice(other)]))
    kept = lines if dice.random() < 0.5 else rest
    return b"".join([*kept[:where], *new, *kept[where:]])


CHANGES = (change_byte, put_in, cut_out, change_number, change_number, change_word, change_word, change_lines)


# -- running ------------------------------------------------------------------------------------------


@contextmanager
def budget() -> Iterator[None]:
    """Raises OverBudget in the block after MAX_CPU_S of processor time; memory is limited by the system."""

    def over(number: int, frame: FrameType | None) -> None:
        raise OverBudget(f"more than {MAX_CPU_S} s")

    before = signal.signal(signal.SIGPROF, over)
    signal.setitimer(signal.ITIMER_PROF, MAX_CPU_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


@cache
def commands() -> Any:
    """The command line, put together once: that takes longer than most commands."""
    return typer.main.get_command(app)


def outcome(command: Command) -> str:
    """Runs a command of servogen: "done", "refused", or what it raised in place of that."""
    try:
        with budget(), contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            commands().main(list(command), prog_name="servogen", standalone_mode=False)
    except (ServogenError, UsageError, OSError) as error:
        return "refused" if str(error) else traceback.format_exc()
    except SystemExit:
        return "done"
    except (Exception, OverBudget):
        return traceback.format_exc()
    return "done"


def run_kind(
    name: str, mutants: int, seed: int, keep: Path, report: Callable[[str], None] = print
) -> Counter[str]:
    """Runs `mutants` mutants of a kind; counts what became of them. Failures are kept in `keep`."""
    kind = KINDS[name]
    seeds = kind.seeds()
    dice = random.Random(f"{name} {seed}")
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for other, contents in kind.beside.items():
            Path(folder, other).write_bytes(contents())
        file = Path(folder, f"mutant{kind.suffix}")
        for number in range(mutants):
            data = mutant(seeds, dice)
            if dice.random() < 0.5:
                data = kind.repair(data)
            file.write_bytes(data)
            text = data.decode("utf-8", "replace").replace("\0", " ")
            results = [
                outcome([word.format(file=file, folder=folder, text=text) for word in command])
                for command in kind.commands
            ]
            bad = next((each for each in results if each not in ("done", "refused")), None)
            counts["failed" if bad else "refused" if "refused" in results else "done"] += 1
            if bad:
                kept = keep / f"{name}-{seed}-{number}{kind.suffix}"
                kept.write_bytes(data)
                report(f"{kept}:\n{bad}")
    return counts


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kind", choices=[*KINDS, "all"], default=["all"], nargs="+")
    parser.add_argument("--mutants", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    keep = Path(tempfile.mkdtemp(prefix="mutants-"))
    failed = 0
    for name in KINDS if "all" in given.kind else given.kind:
        for command in KINDS[name].commands:  # what is loaded once is not the first mutant's
            with contextlib.suppress(KeyError):
                outcome([word.format(file=keep / "none", folder=keep, text="Rx(1)") for word in command])
        used = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGESIZE")
        resource.setrlimit(resource.RLIMIT_AS, (used + MAX_BYTES, resource.RLIM_INFINITY))
        begun = time.monotonic()
        counts = run_kind(name, given.mutants, given.seed, keep)
        failed += counts["failed"]
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10
        print(
            f"{name}: {given.mutants} mutants, {counts['done']} done, {counts['refused']} refused, "
            f"{counts['failed']} failed, {time.monotonic() - begun:.0f} s, at most {peak} MiB",
            flush=True,
        )
        resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
