"""The C of the tape engine, compiled, with the worst-case time between its pulses."""

from __future__ import annotations

from dataclasses import asdict

from servogen.compiler import Options
from servogen.engines.c_text import (
    ChannelText,
    PortText,
    assembly,
    channel_text,
    decimal,
    header_values,
    render_template,
    table_lines,
)
from servogen.engines.firmware import Firmware
from servogen.engines.fitting import compiled_to_fit
from servogen.engines.inputs.commands import CommandLine, hearing_table
from servogen.engines.inputs.tape import HOLD, SDA
from servogen.engines.player.firmware import cautions, timing_budgets
from servogen.engines.player.layout import TICKS
from servogen.engines.player.rendering import OVERRUN, PRESCALER, Constants, Slots, kernel, listening, looking
from servogen.engines.protocol import EngineJob
from servogen.engines.tape.bus import Waits
from servogen.engines.tape.content import END, FIRST, SEED
from servogen.engines.tape.taping import Taped
from servogen.pic.device import Device

HINT = "fewer servos"
BYTE, SUM = "pulse_a_lo", "pulse_a_hi"
"""The kernel's variables that are the reader's between two frames."""
SDA_BIT = 1 << int(SDA[2])


def compiled(job: EngineJob, made: Taped, dialect: str) -> Firmware:
    """Return the firmware in `dialect`. Raises ResourceError if the chip is too small."""
    file, text = f"main.{dialect}.c", render_tape(made, dialect, job.device, job.name)
    options = Options(dialect=dialect, device=job.device)
    built = compiled_to_fit(text, file, options, job.name, "the tape engine", HINT)
    budgets = timing_budgets(built.listing, made.layout)
    overrun = built.listing.variable(OVERRUN)
    return Firmware(dialect, file, text, built, budgets, overrun, tuple(cautions(budgets)))


def render_tape(made: Taped, dialect: str, device: Device, title: str) -> str:
    """Return the C file of the tape's reader in `dialect`. Raises RenderError."""
    schedule, tape, tick = made.plan.schedule, made.tape, made.layout.tick
    slots = Slots.of(made)
    scl, error = 1 << int(tape.scl[2]), tape.error_pin
    asm = {
        "byte": f"_{BYTE}",
        "sum": f"_{SUM}",
        "scl": f"0x{scl:02X}",
        "sda": f"0x{SDA_BIT:02X}",
        "free": f"0x{scl | SDA_BIT:02X}",
        "wait": _wait,
        **asdict(Waits.at(schedule.clock)),
    }
    constants = Constants()
    constants.add_slots(slots, 2)
    values = header_values(dialect, title, device, schedule) | {
        "ports": list(_ports(made)),
        "port_b": any(name == "B" for name in _used(made)),
        "port_a_servos": any(channel.pin[1] == "A" for channel in schedule.channels),
        "tick": tick,
        "tick_us": decimal(schedule.clock.us(tick)),
        "prescaler": f"0x{PRESCALER + TICKS.index(tick):02X}",
        "overrun": OVERRUN,
        "channels": [_channel(made, channel) for channel in made.order],
        "eeprom": tape.eeprom,
        "scl_pin": tape.scl,
        "sda": asm["sda"],
        "hold": tape.on_error == HOLD,
        "error_pin": error,
        "error_port": error and error[1],
        "error_mask": error and f"0x{1 << int(error[2]):02X}",
        "byte": BYTE,
        "sum": SUM,
        "seed": f"0x{SEED:02X}",
        "end": f"0x{END:02X}",
        "loop_high": made.content.places[0] >> 8,
        "loop_low": made.content.places[0] & 0xFF,
        "first": FIRST,
        "chain": False,
        **_steered(made, constants),
        "identity": made.content.identity,
        "slots": slots,
        "places": constants.named,
        "constants": table_lines(constants.groups),
        "kernel": list(assembly(kernel(tick, made.layout.stagger))),
    }
    for part in ("start", "give", "take"):
        values[f"bus_{part}"] = list(assembly(render_template(f"tape/{part}.asm", **asm)))
    return render_template("tape/main.c.j2", **values)


def _steered(made: Taped, constants: Constants) -> dict[str, object]:
    """Return the template's values for buttons and commands; what they take goes into the table."""
    values, read, rule = looking(made.buttons), made.read, made.plan.schedule.commands
    values["inputs_text"] = [*made.buttons.text(), *(read.text() if read else ())]
    if read is None or rule is None:
        return values
    # One button counts the numbers down, so the last one is that of the first direction.
    names = [direction.name for direction in rule.directions][::-1]
    rest, *others = made.content.places
    parts = [(rest,) * 3, *[*zip(*[iter(others)] * 3, strict=True)][::-1]]
    if isinstance(read, CommandLine):
        heard = hearing_table(names, read.codes)
        constants.add("HEARING", heard, "for each state the line low, and high")
    data = b"".join(place.to_bytes(2, "big") for part in parts for place in part)
    constants.add(
        "PLACES", data, "on the tape: the rest, thrice, and of each direction start, cycle and stop"
    )
    return values | {"chain": True, **listening(read, names, len(names))}


def _wait(cycles: int) -> str:
    """Return lines of assembly that take so many cycles."""
    return "    goto    $+1\n" * (cycles // 2) + "    nop\n" * (cycles % 2)


def _used(made: Taped) -> set[str]:
    """Return the ports with outputs."""
    pins = [channel.pin for channel in made.plan.schedule.channels]
    return {pin[1] for pin in (*pins, made.tape.scl, made.tape.error_pin or made.tape.scl)}


def _ports(made: Taped) -> list[PortText]:
    """Return the ports in use; of port A every pin but inputs is an output, so that its reading has as few
    unknown bits as possible.
    """
    pins = [channel.pin for channel in made.plan.schedule.channels]
    pins += [made.tape.error_pin] if made.tape.error_pin else []
    inputs = sum(1 << int(each.pin[2]) for each in made.plan.schedule.inputs if each.pin[1] == "A")
    outputs = sum(1 << int(pin[2]) for pin in pins if pin[1] == "B")
    # Port B first: once RA4 is high no servo's pin may be an input.
    ports = [PortText("B", f"0x{0xFF & ~outputs:02X}")] if "B" in _used(made) else []
    return [*ports, PortText("A", f"0x{inputs:02X}")]


def _channel(made: Taped, channel: int) -> ChannelText:
    schedule = made.plan.schedule
    runs = (*schedule.lead_in, *schedule.loop)
    widths = [pulse.width for run in runs if (pulse := run.pulses[channel]) is not None]
    return channel_text(schedule, channel, widths)
