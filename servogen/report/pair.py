"""One page about two chips: how both are wired, drawn and in tables, and what one run of both showed.

In: the jobs of both chips, the verdicts in words. Out: a self-contained HTML page. Lines leave a pin beside
its label; the clock goes over the second chip, the wire under both, the line to MCLR under that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from servogen.engines.inputs import given
from servogen.engines.inputs.wire import FrameWire
from servogen.errors import InputError
from servogen.job import PlannedJob
from servogen.report.html import render_page, wiring_rows
from servogen.report.wiring import PackagePin, open_drain, package, remarks

TEMPLATE = "pair.html.j2"
AT, WIDTH, BELOW = (170, 640), 96, 50
"""Where the bodies of the chips begin, how wide they are, and how far the pins are below those of a package
that is drawn alone.
"""
CLOCK_Y, WIRE_Y, RESTART_Y = 20, 340, 366
LETTER, BESIDE = 7.2, 26
"""The width of a letter of a label, and where the first one is, from the body."""
LEFT, RIGHT = (16, 500), (480, 960)
"""Where a line of each chip goes up or down, beside its labels."""
RESTART, JUMPER = (6, 486), (430, 450)
"""Where the line to MCLR goes down and up, and where its jumper is."""
FIXED = {"VDD": "VDD +5 V", "VSS": "VSS ground", "MCLR": "MCLR 10 kΩ to VDD"}


@dataclass(frozen=True, slots=True)
class PairFacts:
    """Everything on the page: the rows of `programs` are dialect, words of both, the verdict on the runs."""

    title: str
    jobs: tuple[PlannedJob, PlannedJob]
    exact: bool
    runs: str
    """How many runs the verdicts are about."""
    verdicts: Sequence[str]
    programs: Sequence[tuple[str, ...]]
    one_run: str


def pair_page(facts: PairFacts) -> str:
    """Return the page. Raises RenderError if the template is wrong."""
    return render_page(TEMPLATE, _values(facts))


def _values(facts: PairFacts) -> dict[str, object]:
    first, second = facts.jobs
    ends = [_frame_wire(job) for job in facts.jobs]
    pins = [_pins(job, end) for job, end in zip(facts.jobs, ends, strict=True)]
    crystals = [_beside(number, its["OSC1"]) for number, its in enumerate(pins)]
    both = replace(first, servos=(*first.servos, *second.servos))
    return {
        "title": facts.title,
        "exact": facts.exact,
        "chips": [
            {
                "name": f"chip {1 + number}",
                "x": AT[number],
                "pins": pins[number].values(),
                "wiring": tuple(wiring_rows(job)),
            }
            for number, job in enumerate(facts.jobs)
        ],
        "clock": None if ends[1].crystal_ppm else _clock(pins),
        "crystals": [
            {
                "path": f"M{x} {y} h24 v26 h-24",
                "x": x + 24,
                "y": y + 13,
                "text": f"{first.clock.hz / 1e6:g} MHz, 2 × 22 pF",
            }
            for x, y in crystals[: 2 if ends[1].crystal_ppm else 1]
        ],
        "wire": _wire(pins, ends),
        "restart": _restart(pins, ends[1].restart),
        "remarks": [
            *[crystals_text(ends[1])] * bool(ends[1].crystal_ppm),
            "One supply and one ground for both chips, 100 nF at each VDD, the crystal's 22 pF to ground; "
            "the ground is also that of the servos' supply.",
            *restart_text(ends[1]),
            *(line for job in facts.jobs for line in open_drain(job)),
            *remarks(both),
        ],
        "runs": facts.runs,
        "verdicts": facts.verdicts,
        "programs": facts.programs,
        "one_run": facts.one_run,
    }


def crystals_text(end: FrameWire) -> str:
    """Return which crystals the chips have."""
    if end.crystal_ppm:
        return f"Each chip has a crystal of its own, off by {end.crystal_ppm} ppm or less."
    return "One crystal, at chip1; its OSC2 is chip2's OSC1."


def restart_text(end: FrameWire) -> tuple[str, ...]:
    """Return how the second chip resets the first, if it does."""
    if end.restart is None:
        return ()
    return (
        f"{end.restart} of chip2 goes to MCLR of chip1 through a jumper: whichever chip was reset, both "
        "begin anew.",
        "Open the jumper while chip1 is programmed in the circuit: its MCLR then has 13 V, of which "
        f"{end.restart} takes 8.5 V; a diode would not keep them off.",
    )


@dataclass(frozen=True, slots=True)
class _Leg:
    """A pin in the drawing, with all that is written beside it."""

    number: int
    text: str
    servo: str
    colour: str
    y: int
    left: bool


def _frame_wire(job: PlannedJob) -> FrameWire:
    end = given(job.inputs, FrameWire)
    if end is None:
        raise InputError("chip-pair", f"{job.name} has no wire to another chip")
    return end


def _pins(job: PlannedJob, end: FrameWire) -> Mapping[str, _Leg]:
    """Return the pins of a chip by name."""

    def text(pin: PackagePin) -> str:
        if pin.name == end.pin and end.follows:
            return f"{pin.name} wire"
        if pin.name == end.restart and end.follows:
            return f"{pin.name} resets chip 1"
        return f"{pin.name} {pin.servo}" if pin.servo else FIXED.get(pin.name, pin.name)

    return {
        pin.name: _Leg(pin.number, text(pin), pin.servo, pin.colour, pin.y + BELOW, pin.left)
        for pin in package(job.servos)
    }


def _beside(number: int, leg: _Leg) -> tuple[float, float]:
    """Return the point beside a pin's label, from which a line goes on."""
    away = BESIDE + LETTER * len(leg.text)
    return (AT[number] - away if leg.left else AT[number] + WIDTH + away), leg.y


def _clock(pins: Sequence[Mapping[str, _Leg]]) -> dict[str, object]:
    x, y = _beside(0, pins[0]["OSC2"])
    end, down = _beside(1, pins[1]["OSC1"])
    path = f"M{x} {y} H{RIGHT[0]} V{CLOCK_Y} H{RIGHT[1]} V{down} H{end}"
    return {"path": path, "text_x": RIGHT[0] + 8}


def _wire(pins: Sequence[Mapping[str, _Leg]], ends: Sequence[FrameWire]) -> dict[str, object]:
    points = [_beside(number, pins[number][end.pin]) for number, end in enumerate(ends)]
    turns = [
        (LEFT if pins[number][end.pin].left else RIGHT)[number] - (6 if number else 0)
        for number, end in enumerate(ends)
    ]
    (x, y), (finish, up) = points
    path = f"M{x} {y} H{turns[0]} V{WIRE_Y} H{turns[1]} V{up} H{finish}"
    return {
        "path": path,
        "text": f"the wire: {ends[0].pin} of chip 1 to {ends[1].pin} of chip 2",
        "text_x": min(turns) + 8,
        "pull": 560,
    }


def _restart(pins: Sequence[Mapping[str, _Leg]], pin: str | None) -> dict[str, object] | None:
    """Return the line from the second chip's pin to the first one's MCLR, if there is one."""
    if pin is None:
        return None
    (x, y), (end, up) = _beside(0, pins[0]["MCLR"]), _beside(1, pins[1][pin])
    (down, back), (left, right) = RESTART, JUMPER
    return {
        "path": f"M{x} {y} H{down} V{RESTART_Y} H{left} M{right} {RESTART_Y} H{back} V{up} H{end}",
        "jumper": JUMPER,
        "y": RESTART_Y,
        "text": f"{pin} of chip 2 to MCLR of chip 1; a jumper, open while chip 1 is programmed",
    }
