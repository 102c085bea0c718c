"""An attack on the verdict on recordings: one that differs from the schedule must not agree.

    python -m tests.verify.capture_attack --mutants 1000 --seed 1

A schedule of two servos is recorded twice round its loop, by a chip whose crystal is off and from any moment
on, in each format. Then one thing is changed, by at least 3 samples where the tolerance is one and 0.5 µs: an
edge, a pulse, a block of samples, the rate, the wires, a level or the order of the times. What is expected is
known from the change alone, without a verdict. Exit code 1 if any of them is said to agree, or the unchanged
one is not.
"""

from __future__ import annotations

import argparse
import random
import sys
import zipfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from servogen.errors import InputError
from servogen.pulse.schedule import Channel, Pulse, PulseSchedule, Run
from servogen.traces import read_edges
from servogen.traces.captures import read_capture
from servogen.units import Clock, Cycles
from servogen.workflows.verification import judge_capture, judge_file

PERIOD = 20_000
WIDTHS = ((1167, 1500), (1200, 1467), (1500, 1167), (1667, 900), (1400, 1401), (1000, 2000))
SLOTS = (0, 5000)
PINS = ("RB0", "RB3")
SCHEDULE = PulseSchedule(
    clock=Clock(4_000_000),
    period=Cycles(PERIOD),
    channels=tuple(Channel(pin, pin, "unknown") for pin in PINS),
    lead_in=(),
    loop=tuple(
        Run(1, tuple(Pulse(Cycles(at), Cycles(width)) for at, width in zip(SLOTS, row, strict=True)))
        for row in WIDTHS
    ),
)
FRAMES = 2 * len(WIDTHS) + 1
SEAM = 4 * (FRAMES // 2)
"""The edge before which a stitched recording has its seam."""
Edges = list[tuple[int, int, int]]
"""(sample, wire, level) in order, each at a sample of a microsecond."""


def recorded(rng: random.Random) -> tuple[Edges, int]:
    """Return what an analyser at 1 MHz sees, and its number of samples."""
    begin, speed = rng.uniform(100, PERIOD - SLOTS[1] - 3000), 1 + rng.uniform(-100e-6, 100e-6)
    edges = [
        (int(begin + (frame * PERIOD + at + late) * speed) + 1, wire, level)
        for frame in range(FRAMES)
        for wire, (at, width) in enumerate(zip(SLOTS, WIDTHS[frame % len(WIDTHS)], strict=True))
        for late, level in ((0, 1), (width, 0))
    ]
    return sorted(edges), int(begin + FRAMES * PERIOD * speed)


def exact() -> tuple[Edges, int]:
    """Return the edges in cycles from reset, as a simulator writes them."""
    edges = [
        (100 + frame * PERIOD + at + late, wire, level)
        for frame in range(FRAMES)
        for wire, (at, width) in enumerate(zip(SLOTS, WIDTHS[frame % len(WIDTHS)], strict=True))
        for late, level in ((0, 1), (width, 0))
    ]
    return sorted(edges), 100 + FRAMES * PERIOD


# -- what is changed, by kind; one line may turn out as impossible, then nothing is returned


def edge_moved(edges: Edges, end: int, rng: random.Random) -> tuple[Edges, int]:
    row = rng.randrange(2, len(edges) - 2)
    time, wire, level = edges[row]
    edges[row] = (time + rng.choice((-1, 1)) * rng.randint(3, 40), wire, level)
    return sorted(edges), end


def pulse_moved(edges: Edges, end: int, rng: random.Random) -> tuple[Edges, int]:
    row, late = 2 * rng.randrange(1, len(edges) // 2 - 1), rng.choice((-1, 1)) * rng.randint(3, 400)
    for which in (row, row + 1):
        edges[which] = (edges[which][0] + late, *edges[which][1:])
    return sorted(edges), end


def pulse_lost(edges: Edges, end: int, rng: random.Random) -> tuple[Edges, int]:
    row = 2 * rng.randrange(1, len(edges) // 2 - 1)
    return edges[:row] + edges[row + 2 :], end


def pulse_added(edges: Edges, end: int, rng: random.Random) -> tuple[Edges, int]:
    frame, wire = rng.randrange(1, FRAMES - 1), rng.randrange(2)
    at = edges[4 * frame][0] + rng.randint(9000, 15_000)
    return sorted([*edges, (at, wire, 1), (at + rng.randint(3, 300), wire, 0)]), end


def block_lost(edges: Edges, end: int, rng: random.Random) -> tuple[Edges, int]:
    size = rng.randint(4, PERIOD // 2)
    at = rng.randint(edges[4][0], edges[-8][0] - size)
    kept = [(time - size * (time >= at), *rest) for time, *rest in edges if not at <= time < at + size]
    level, out = [0, 0], []
    for time, wire, high in kept:  # a wire whose change is lost changes at the next one that differs
        if level[wire] != high:
            level[wire] = high
            out.append((time, wire, high))
    return out, end - size


def block_repeated(edges: Edges, end: int, rng: random.Random) -> tuple[Edges, int]:
    """Samples that come twice, between two edges or with them."""
    size = rng.randint(4, PERIOD // 2)
    at = rng.randint(edges[4][0] + size, edges[-8][0])
    again = [(time + size, *rest) for time, *rest in edges if at - size <= time < at]
    later = [(time + size * (time >= at), *rest) for time, *rest in edges]
    level, out = [0, 0], []
    for time, wire, high in sorted([*later, *again]):
        if level[wire] != high:
            level[wire] = high
            out.append((time, wire, high))
    return out, end + size


def clock_changed(edges: Edges, end: int, rng: random.Random) -> tuple[Edges, int]:
    factor = rng.choice((0.1, 0.5, 0.9, 0.99, 0.998, 1.002, 1.01, 1.1, 2.0, 10.0))
    return [(round(time * factor), *rest) for time, *rest in edges], round(end * factor)


def wires_swapped(edges: Edges, end: int, rng: random.Random) -> tuple[Edges, int]:
    return [(time, 1 - wire, level) for time, wire, level in edges], end


def inverted(edges: Edges, end: int, rng: random.Random) -> tuple[Edges, int]:
    lost = rng.randrange(2)
    return [(time, wire, 1 - level if wire == lost else level) for time, wire, level in edges], end


def cut(edges: Edges, end: int, rng: random.Random) -> tuple[Edges, int]:
    """Less than the loop: what is left may agree, but not all of it was seen."""
    end = edges[4 * rng.randint(1, len(WIDTHS) - 2)][0] - rng.randint(100, 1000)
    return [edge for edge in edges if edge[0] < end], end


def wire_dead(edges: Edges, end: int, rng: random.Random) -> tuple[Edges, int]:
    dead = rng.randrange(2)
    return [edge for edge in edges if edge[1] != dead], end


Change = Callable[[Edges, int, random.Random], tuple[Edges, int]]
CHANGES: tuple[Change, ...] = (
    edge_moved, pulse_moved, pulse_lost, pulse_added, block_lost, block_repeated, clock_changed,
    wires_swapped, inverted, cut, wire_dead,
)  # fmt: skip

# -- the formats, each written by itself


def session(folder: Path, edges: Edges, end: int) -> Path:
    level = bytearray(end)
    for wire in range(2):
        own = [(time, high) for time, which, high in edges if which == wire]
        before = 1 - own[0][1] if own else 0
        for (time, high), (until, _) in zip([(0, before), *own], [*own, (end, 0)], strict=True):
            if high:
                for sample in range(time, min(until, end)):
                    level[sample] |= 1 << wire
    with zipfile.ZipFile(path := folder / "a.sr", "w", zipfile.ZIP_STORED) as archive:
        probes = "".join(f"probe{number}={pin}\n" for number, pin in enumerate(PINS, 1))
        archive.writestr("metadata", f"[device 1]\nsamplerate=1 MHz\nunitsize=1\n{probes}")
        archive.writestr("logic-1-1", bytes(level))
    return path


def _initial(edges: Edges) -> list[int]:
    firsts = [next((level for _, which, level in edges if which == wire), 1) for wire in range(2)]
    return [1 - first for first in firsts]


def _vcd(folder: Path, edges: Edges, end: int, comment: str) -> Path:
    wires = "".join(f"$var wire 1 {code} {pin} $end\n" for code, pin in zip("!#", PINS, strict=True))
    text = f"$comment {comment} $end\n$timescale 1 us $end\n{wires}$enddefinitions $end\n#0\n"
    text += "".join(f"{level}{code}\n" for level, code in zip(_initial(edges), "!#", strict=True))
    text += "".join(f"#{time}\n{level}{'!#'[wire]}\n" for time, wire, level in edges)
    (path := folder / "a.vcd").write_text(f"{text}#{end}\n")
    return path


def vcd(folder: Path, edges: Edges, end: int) -> Path:
    return _vcd(folder, edges, end, "Acquisition with 2/8 channels at 1 MHz")


def coarse_vcd(folder: Path, edges: Edges, end: int) -> Path:
    """States a rate that its edges contradict."""
    return _vcd(folder, edges, end, "Acquisition with 2/8 channels at 200 kHz")


def silent_vcd(folder: Path, edges: Edges, end: int) -> Path:
    return _vcd(folder, edges, end, "of a program that states no rate")


def saleae(folder: Path, edges: Edges, end: int) -> Path:
    level, rows = _initial(edges), []
    rows.append(f"0,{level[0]},{level[1]}")
    for time, wire, high in edges:
        level[wire] = high
        rows.append(f"{time / 1e6:.9f},{level[0]},{level[1]}")
    rows.append(f"{end / 1e6:.9f},{level[0]},{level[1]}")
    (path := folder / "a.csv").write_text("\n".join([f"Time [s],{','.join(PINS)}", *rows, ""]))
    return path


def stitched(folder: Path, edges: Edges, end: int) -> Path:
    """Two captures: the second begins in the middle of the pause after a frame."""
    seam, gap = edges[min(len(edges) - 1, SEAM)][0] - 1500, 1000
    if not 0 < seam < end:
        seam = end // 2
    text = [f"#{seam}\nz!\nz#\n#{seam + gap}\n"]
    level = _initial(edges)
    before = []
    for time, wire, high in edges:
        if time < seam:
            level[wire] = high
            before.append(f"#{time}\n{high}{'!#'[wire]}\n")
    text.append("".join(f"{high}{code}\n" for high, code in zip(level, "!#", strict=True)))
    after = [f"#{time + gap}\n{high}{'!#'[wire]}\n" for time, wire, high in edges if time >= seam]
    wires = "".join(f"$var wire 1 {code} {pin} $end\n" for code, pin in zip("!#", PINS, strict=True))
    head = (
        "$comment captured on all channels at 1000000 Hz; several captures, the time between them not known, "
        f"of samples: 0-{seam} {seam + gap}-{end + gap} $end\n"
        f"$timescale 1 us $end\n{wires}$enddefinitions $end\n"
    )
    initial = "".join(f"{high}{code}\n" for high, code in zip(_initial(edges), "!#", strict=True))
    (path := folder / "a.vcd").write_text(
        f"{head}#0\n{initial}{''.join(before)}{text[0]}{text[1]}{''.join(after)}#{end + gap}\n"
    )
    return path


def edge_csv(folder: Path, edges: Edges, end: int) -> Path:
    rows = [f"{time},{PINS[wire]},{level}" for time, wire, level in edges]
    (path := folder / "e.csv").write_text("\n".join(["cycle,pin,level", *rows, ""]))
    return path


def edge_jsonl(folder: Path, edges: Edges, end: int) -> Path:
    rows = [f'{{"cycle":{time},"pin":"{PINS[wire]}","level":{level}}}\n' for time, wire, level in edges]
    (path := folder / "e.jsonl").write_text("".join(rows))
    return path


FORMATS = (session, vcd, coarse_vcd, silent_vcd, saleae, stitched, edge_csv, edge_jsonl)
EXACT = (edge_csv, edge_jsonl)


def spoiled(path: Path, rng: random.Random) -> str | None:
    """Change the text of a file so that it is not a recording of all levels in order; say how."""
    if path.suffix == ".sr":
        data = path.read_bytes()
        path.write_bytes(data[: rng.randrange(len(data) // 2, len(data) - 30)])
        return "truncated"
    lines = path.read_text().split("\n")
    times = [
        row for row, line in enumerate(lines[:-1]) if line[:1] in "#0123456789{" and line[1:2] not in "!#"
    ]
    row = rng.choice(times[4:-4])
    how = rng.choice(("order", "unknown"))
    if how == "order":
        lines[row], lines[times[-2]] = lines[times[-2]], lines[row]
    elif path.suffix == ".vcd":
        lines.insert(row, f"x{rng.choice('!#')}")
    else:
        lines[row] = lines[row][:-1] + "X"
    path.write_text("\n".join(lines))
    return how


def agrees(path: Path) -> bool:
    """Return whether servogen says that the whole schedule is in the recording."""
    try:
        if path.stem == "e":
            trace = read_edges(path, SCHEDULE.clock)
            return judge_file(SCHEDULE, trace, tells_end=False).passed
        return judge_capture(SCHEDULE, read_capture(path)).passed
    except InputError:
        return False


def attack(mutants: int, seed: int, folder: Path) -> tuple[Counter[str], list[str]]:
    """Return how many mutants of each kind were tried, and what was wrong."""
    rng, counts, wrong = random.Random(seed), Counter[str](), []
    for number in range(mutants):
        write = FORMATS[number % len(FORMATS)]
        edges, end = exact() if write in EXACT else recorded(rng)
        if number < 2 * len(FORMATS) and not agrees(write(folder, list(edges), end)):
            wrong.append(f"mutant {number}: the unchanged {write.__name__} does not agree")
        if rng.random() < 0.1:
            path = write(folder, edges, end)
            kind = spoiled(path, rng)
        else:
            change = rng.choice(CHANGES)
            changed = change(list(edges), end, rng)
            if (
                write is stitched
                and changed[0][:SEAM] == edges[:SEAM]
                and change in (block_lost, block_repeated)
            ):
                changed = edge_moved(list(edges), end, rng)  # what is lost at the seam is not known anyway
            path, kind = write(folder, *changed), change.__name__
        counts[f"{write.__name__}: {kind}"] += 1
        if agrees(path):
            wrong.append(f"mutant {number} agrees: {write.__name__}, {kind}")
    return counts, wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    with TemporaryDirectory() as folder:
        counts, wrong = attack(options.mutants, options.seed, Path(folder))
    for kind, count in sorted(counts.items()):
        print(f"{count:5} {kind}")
    print(f"{sum(counts.values())} mutants, {len(wrong)} wrong")
    print("\n".join(wrong))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
