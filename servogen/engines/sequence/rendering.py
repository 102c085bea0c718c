"""A `Sequence` as C: `templates/sequence/main.c.j2` is the body, `c2c.j2`, `xc8.j2` and `sdcc.j2` are the
dialects.

In: the program and a dialect. Out: the text of one C file.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import groupby

from servogen.engines.c_text import ChannelText, decimal, header_values, render_template, table_lines
from servogen.engines.parts import place_text, titled_ends
from servogen.engines.protocol import EngineJob
from servogen.engines.sequence.programs import (
    FrameEdges,
    Hold,
    Move,
    RowFunction,
    Sequence,
    SilentStep,
    Step,
    TableDelay,
    WidthTable,
)
from servogen.engines.sequence.tables import FIXED
from servogen.engines.sequence.waits import CALLS
from servogen.pic.device import Device
from servogen.pulse import Pulse, PulseSchedule, Run
from servogen.pulse.plan import PulsePlan
from servogen.units import Clock, Cycles


@dataclass(frozen=True, slots=True)
class Comments:
    """What the comments say beside the widths: the planned angle of a channel with a width (`angles`), and
    where the feet or the tool are (`places`), by the pulses of a frame.
    """

    angles: Mapping[tuple[str, Cycles], str] = field(default_factory=dict)
    places: Mapping[tuple[Pulse | None, ...], str] = field(default_factory=dict)

    def frame(self, schedule: PulseSchedule, run: Run) -> str:
        """Return a frame's angles and widths, and the place to which they lead."""
        texts = []
        for channel, pulse in zip(schedule.channels, run.pulses, strict=True):
            if pulse:
                angle = self.angles.get((channel.name, pulse.width), "")
                texts.append(
                    f"{channel.name}{angle and f' {angle}:'} {decimal(schedule.clock.us(pulse.width))} us"
                )
        return ", ".join(filter(None, (*texts, self.places.get(run.pulses))))

    def way(self, schedule: PulseSchedule, rows: tuple[Run, ...]) -> str:
        """Return the first and the last frame of a movement."""
        return f"from {self.frame(schedule, rows[0])} to {self.frame(schedule, rows[-1])}"

    def part(self, schedule: PulseSchedule, rows: list[Run], channel: int) -> str:
        """Return the angles of one channel, the first and the last, and the place if it stays."""
        name, ends = schedule.channels[channel].name, (rows[0], rows[-1])
        angles = [self.angles.get((name, pulse.width), "") for row in ends if (pulse := row.pulses[channel])]
        place = self.places.get(rows[0].pulses, "") if rows[0] == rows[-1] else ""
        return ", ".join(filter(None, (" to ".join(dict.fromkeys(filter(None, angles))), place)))


NO_COMMENTS = Comments()


def comments_of(job: EngineJob, plan: PulsePlan) -> Comments:
    """Return the comments of a job's program: of several angles with one width, one that is held."""
    unit = {servo.name: "deg/s" if servo.model.continuous else "deg" for servo in job.servos}
    angles = {
        (row.channel, row.cycles): f"{math.degrees(row.angle):z.4g} {unit[row.channel]}"
        for row in sorted(plan.widths, key=lambda row: row.held)
    }
    first: dict[tuple[Pulse | None, ...], int] = {}
    frame = 0
    for run in (*plan.schedule.lead_in, *plan.schedule.loop):
        first.setdefault(run.pulses, frame)
        frame += run.frames
    poses = job.trajectory.angles[list(first.values())]
    places = [
        [place_text(title, point[None]) for point in end.points(poses)] for title, end in titled_ends(job)
    ]
    texts = (", ".join(filter(None, ends)) for ends in zip(*places, strict=True))
    return Comments(angles, dict(zip(first, texts, strict=False)))


def render(
    program: Sequence, dialect: str, device: Device, title: str, comments: Comments = NO_COMMENTS
) -> str:
    """Return the C file of `program` in `dialect`; with its `comments`.

    Raises RenderError, and InputError for a delay that the dialect cannot express.
    """
    clock = program.schedule.clock
    return render_template(
        "sequence/main.c.j2",
        **header_values(dialect, title, device, program.schedule),
        cycle_us=decimal(clock.cycle_us),
        channels=list(_channels(program.schedule)),
        start=_calls(program.start, dialect, clock),
        positions=[
            _PositionText(
                f"position_{position.number}",
                comments.frame(program.schedule, position.frame.run),
                _lines(position.frame, program.schedule, dialect),
                _calls(position.gap, dialect, clock),
                _calls(position.again, dialect, clock),
            )
            for position in program.positions
        ],
        moves=[_move(move, program, dialect, comments) for move in program.moves],
        wait_turns=list(_wait_turns(program, dialect)),
        lead_in=[_step(step, program.schedule, dialect, comments) for step in program.lead_in],
        counts_turns=any(
            isinstance(step, Hold) and step.turns > 1 for step in (*program.lead_in, *program.loop)
        ),
        loop=[_step(step, program.schedule, dialect, comments) for step in program.loop],
        long_waits=any(isinstance(step, SilentStep) for step in (*program.lead_in, *program.loop)),
    )


@dataclass(frozen=True, slots=True)
class _LineText:
    """A port write, its comment, the delay after it and that delay's comment."""

    write: str
    comment: str
    calls: str


@dataclass(frozen=True, slots=True)
class _PositionText:
    name: str
    comment: str
    lines: tuple[_LineText, ...]
    gap: str
    again: str


@dataclass(frozen=True, slots=True)
class _TableText:
    """The table of a channel's widths: its name and its lines."""

    name: str
    channel: str
    lines: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _MoveText:
    name: str
    tables: tuple[_TableText, ...]
    lines: tuple[_LineText, ...]
    fixed: int
    gap: str
    next: str


@dataclass(frozen=True, slots=True)
class _WaitTurnsText:
    """The loop for widths of tables: its name, the cycles of a turn (2 to the power of `shift`), delays in
    a turn of the two loops.
    """

    name: str
    turn: int
    shift: int
    shorter: str
    longer: str


@dataclass(frozen=True, slots=True)
class _StepText:
    """A call of a position (`turns` times, if that is not 0), a frame of its own (`lines`) or a pause."""

    call: str
    lines: tuple[_LineText, ...]
    comment: str
    after: str
    turns: int = 0
    turn: str = ""


FEW_WIDTHS = 12
"""So many widths of a channel are named one by one."""


def _channels(schedule: PulseSchedule) -> Iterator[ChannelText]:
    for number, channel in enumerate(schedule.channels):
        widths = sorted(
            {pulse.width for run in (*schedule.lead_in, *schedule.loop) if (pulse := run.pulses[number])}
        )
        texts = [decimal(schedule.clock.us(width)) for width in widths]
        few = len(texts) <= FEW_WIDTHS
        yield ChannelText(
            channel.name, channel.pin, ", ".join(texts) if few else f"{texts[0]} to {texts[-1]}"
        )


LOOP = 3
"""Cycles of `do … while (--turns)` around the statements in it: DECFSZ and GOTO."""


def _wait_turns(program: Sequence, dialect: str) -> Iterator[_WaitTurnsText]:
    clock = program.schedule.clock
    for turn in sorted({move.table.turn for move in program.moves}):
        shorter, longer = (_calls(Cycles(turn + more - LOOP), dialect, clock) for more in (0, 1))
        yield _WaitTurnsText(f"wait_{turn}", turn, turn.bit_length() - 1, shorter, longer)


def _move(move: RowFunction, program: Sequence, dialect: str, comments: Comments) -> _MoveText:
    schedule, table = program.schedule, move.table
    names = {channel: _table_name(schedule, table, channel) for channel in table.channels}
    tables = tuple(
        _TableText(
            name,
            schedule.channels[channel].name,
            tuple(table_lines(_table_groups(_played(move, program), channel, schedule, comments))),
        )
        for channel, name in names.items()
    )
    calls = (_calls(each, dialect, schedule.clock) for each in (move.gap, move.next))
    return _MoveText(
        f"move_{table.number}", tables, _lines(move.frame, schedule, dialect, table), FIXED, *calls
    )


def _played(move: RowFunction, program: Sequence) -> list[tuple[Run, ...]]:
    """Return the rows of a table by the steps that play them."""
    steps = (*program.lead_in, *program.loop)
    firsts = sorted({step.first for step in steps if isinstance(step, Move) and step.function == move})
    ends = (*firsts[1:], len(move.table.rows))
    return [move.table.rows[first:end] for first, end in zip(firsts, ends, strict=True)]


def _table_name(schedule: PulseSchedule, table: WidthTable, channel: int) -> str:
    names = [each.name.replace("-", "_") for each in schedule.channels]
    name = names[channel] if names.count(names[channel]) == 1 else schedule.channels[channel].pin
    return f"{name}_width" if table.number == 1 else f"{name}_width_{table.number}"


def _table_groups(
    rows: list[tuple[Run, ...]], channel: int, schedule: PulseSchedule, comments: Comments
) -> Iterator[tuple[list[Cycles], str]]:
    """Yield the widths of holds and of movements, with a comment: the angle of a hold, or the ends."""
    for piece in (piece for played in rows for piece in _pieces(played)):
        widths = [pulse.width for row in piece if (pulse := row.pulses[channel])]
        yield widths, comments.part(schedule, piece, channel)


HOLD = 4
"""Rows that are equal and stand in lines of their own: a hold."""


def _pieces(rows: tuple[Run, ...]) -> Iterator[list[Run]]:
    """Yield the rows of holds, and those of the movements between them."""
    moving: list[Run] = []
    for _, equal in groupby(rows, lambda row: row.pulses):
        same = list(equal)
        if len(same) < HOLD:
            moving += same
            continue
        if moving:
            yield moving
        moving = []
        yield same
    if moving:
        yield moving


def _lines(
    frame: FrameEdges, schedule: PulseSchedule, dialect: str, table: WidthTable | None = None
) -> tuple[_LineText, ...]:
    lines = []
    for edge in frame.edges:
        words = []
        for channel, level in edge.changes:
            name, pulse = schedule.channels[channel].name, frame.run.pulses[channel]
            fixed = level and pulse and not (table and channel in table.channels)
            width = f" for {decimal(schedule.clock.us(pulse.width))} us" if fixed and pulse else ""
            words.append(f"{name} {'high' if level else 'low'}{width}")
        delays = (_table_call(edge.table, table, schedule), _calls(edge.wait, dialect, schedule.clock))
        lines.append(
            _LineText(
                f"PORT{edge.port} = 0x{edge.value:02X};", ", ".join(words), " ".join(filter(None, delays))
            )
        )
    return tuple(lines)


def _table_call(delay: TableDelay | None, table: WidthTable | None, schedule: PulseSchedule) -> str:
    """Return the call that waits as long as the table says; empty if none does."""
    if delay is None or table is None:
        return ""
    width = f"{_table_name(schedule, table, delay.channel)}[row]"
    cycles = f"{width} - {-delay.offset}" if delay.sign > 0 else f"{delay.offset} - {width}"
    return f"wait_{table.turn}({cycles});"


def _step(step: Step, schedule: PulseSchedule, dialect: str, comments: Comments) -> _StepText:
    clock = schedule.clock
    if isinstance(step, SilentStep):
        seconds = decimal(clock.seconds(step.wait))
        return _StepText("", (), f"{seconds} s without pulses", _calls(step.wait, dialect, clock))
    after = _calls(step.after, dialect, clock)
    if isinstance(step, Move):
        seconds = decimal(clock.seconds(step.rows * schedule.period))
        call = f"move_{step.function.table.number}({step.first}, {step.rows});"
        moves = len(list(_pieces(step.played))) == 1
        way = comments.way(schedule, step.played) if moves else f"{step.rows} frames of the table"
        return _StepText(call, (), f"{way}, in {seconds} s", after)
    comment = comments.frame(schedule, step.frame.run)
    if step.position:
        seconds = decimal(clock.seconds(step.all_frames * schedule.period))
        call = f"position_{step.position.number}({step.frames});"
        turns, turn = (step.turns, _calls(step.turn, dialect, clock)) if step.turns > 1 else (0, "")
        return _StepText(call, (), f"{comment}, for {seconds} s", after, turns, turn)
    return _StepText("", _lines(step.frame, schedule, dialect), comment, after)


def _calls(cycles: Cycles, dialect: str, clock: Clock) -> str:
    return " ".join(str(call) for call in CALLS[dialect](cycles, clock))
