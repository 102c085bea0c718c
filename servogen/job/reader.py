"""A job file -> `Job`. Every error names the line, the key, the value and what is allowed.

In: the path (or the text) of a job file. Out: the frozen `Job`; `plan` plans the motion of its servos. In
[firmware] and [stream], errors are pins that do not exist or are in use, a rate that the chip cannot receive
at its clock, and combinations that no engine supports.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from servogen.edges import PINS
from servogen.engines.inputs import EngineInput, check_free, given
from servogen.engines.inputs.buttons import ButtonPin, ControlButtons
from servogen.engines.inputs.commands import (
    CODES,
    COMMANDS,
    CommandButton,
    CommandButtons,
    Commander,
    CommandLine,
)
from servogen.engines.inputs.tape import Tape
from servogen.engines.registry import ENGINES, sections, suitable
from servogen.errors import InputError, Location, did_you_mean
from servogen.job.chips import check_alone, of_one_chip, read_chips
from servogen.job.job import FirmwareSettings, Job
from servogen.job.rig import read_rig
from servogen.job.schema import (
    MAX_ERROR_US,
    NOT_SEGMENTS,
    SECTIONS,
    CommandsTable,
    DirectionPins,
    ExpectTable,
    FirmwareTable,
    JobTable,
    MotionCommandsTable,
    Section,
    SensorTable,
)
from servogen.motion.gait.commands import STRAIGHT, TURN
from servogen.pic.device import Device, device
from servogen.pulse.slots import Frame
from servogen.robot.model import Robot
from servogen.robot.servo import Servo
from servogen.toml import file as toml_file
from servogen.toml.file import Document, exact
from servogen.toml.locations import Key
from servogen.units import Clock

AUTO = "auto"
OWN_PIN = "commands need a pin of their own"


def read_firmware(
    document: Document, table: JobTable, servos: Sequence[Servo], frame: Frame, clock: Clock
) -> tuple[FirmwareSettings, tuple[EngineInput, ...]]:
    """Return the program that a job requests, and the inputs that it states. Raises InputError."""
    wanted = table.firmware
    stated = _section_inputs(document, table, servos, clock)
    buttons = _buttons(document, wanted, servos, stated)
    commands = _commands(document, table, servos, buttons, stated)
    inputs = (*stated.values(), *([buttons] if buttons.any else []), *([commands] if commands else []))
    if wanted.engine == AUTO:
        # A named engine is checked here, `auto` when the smallest one is chosen; that there is none is known
        # already.
        if not suitable({each.kind for each in inputs}):
            name, own = next(iter(stated.items()))
            raise document.error(
                "engine-unsupported",
                ("firmware", "start_pin" if buttons.start else "stop_pin"),
                f"no engine reads both {own.kind} and {buttons.kind}",
                f"remove [{name}], or start_pin and stop_pin",
            )
    elif check_frame := ENGINES[wanted.engine].check_frame:
        check_frame(servos, frame, clock)
    firmware = FirmwareSettings(
        dialect=wanted.dialect,
        engine=wanted.engine,
        soft_start_s=exact(wanted.soft_start_s),
        max_error_us=MAX_ERROR_US if wanted.max_error_us is None else wanted.max_error_us,
        precise=wanted.max_error_us is None,
        soft_start_place=document.place("firmware", "soft_start_s"),
    )
    return firmware, inputs


def _section_inputs(
    document: Document, table: JobTable, servos: Sequence[Servo], clock: Clock
) -> dict[str, EngineInput]:
    """Return the inputs of the engines' own tables, by the tables' names: of those in the file, and of the
    one that the engine of the job needs. Raises InputError.
    """
    engine, found = table.firmware.engine, {}
    for name, section in sections().items():
        wanted = getattr(table, section.name)
        needed = engine != AUTO and section.kind in ENGINES[engine].needs
        if wanted is None and not needed:
            continue
        if engine != AUTO and section.kind not in ENGINES[engine].accepts:
            raise document.error(
                "engine-unsupported",
                (section.name,),
                f"the {engine} engine does not read {section.kind}",
                f'write engine = "{name}", or omit engine',
            )
        found[section.name] = section.read(document, wanted or section.table(), servos, clock)
    return found


def _buttons(
    document: Document, table: FirmwareTable, servos: Sequence[Servo], stated: Mapping[str, EngineInput]
) -> ControlButtons:
    """Return the start button and the emergency stop. Raises InputError."""
    buttons: dict[str, ButtonPin] = {}
    for name in ("start", "stop"):
        pin = getattr(table, f"{name}_pin")
        if pin is None:
            for key in (f"{name}_level", f"{name}_pulses"):
                if key in document.data.get("firmware", {}):
                    raise document.error(
                        "missing-key", ("firmware", key), f"there is no {name}_pin", "add it"
                    )
            continue
        where = ("firmware", f"{name}_pin")
        if table.engine != AUTO and ControlButtons.kind not in ENGINES[table.engine].accepts:
            raise document.error(
                "engine-unsupported",
                where,
                f"the {table.engine} engine does not read buttons",
                'write engine = "player"',
            )
        in_use = _used_pins(servos, stated) | {button.pin: name for name, button in buttons.items()}
        check_free(document, where, pin, in_use, "a button needs a pin of its own")
        turning = next((servo.name for servo in servos if servo.model.continuous), None)
        if name == "stop" and table.stop_pulses == "hold" and turning is not None:
            raise document.error(
                "wrong-servo-kind",
                ("firmware", "stop_pulses"),
                f"{turning} turns continuously: pulses that are held keep it turning",
                'write stop_pulses = "off"',
            )
        level = int(getattr(table, f"{name}_level") == "high")
        buttons[name] = ButtonPin(pin, level, document.place(*where))
    return ControlButtons(buttons.get("start"), buttons.get("stop"), table.stop_pulses != "hold")


def _commands(
    document: Document,
    table: JobTable,
    servos: Sequence[Servo],
    buttons: ControlButtons,
    stated: Mapping[str, EngineInput],
) -> Commander | None:
    """Return the inputs for commands of a walk, or for segments of a motion. Raises InputError."""
    asked = next((each.commands for each in (table.walk, table.motion) if each and each.commands), None)
    if asked is None:
        return None
    chosen = isinstance(asked, MotionCommandsTable)
    if isinstance(asked, MotionCommandsTable):
        _check_names(document, asked)
    key = ("motion" if chosen else "walk", "commands")
    engine = table.firmware.engine
    own = next((name for name in stated if getattr(table, name) is not None), None)
    if chosen and given(stated.values(), Tape) is None:
        raise document.error(
            "engine-unsupported", key, "only the tape plays segments on command", "add a table [tape]"
        )
    if not suitable({COMMANDS, *(each.kind for each in stated.values())}) or (
        engine != AUTO and COMMANDS not in ENGINES[engine].accepts
    ):
        raise document.error(
            "engine-unsupported",
            key,
            f"{f'the {engine} engine' if own is None else f'a job with [{own}]'} does not read {COMMANDS}",
            'write engine = "player"' if own is None else f"remove [{own}]",
        )
    if buttons.any:
        raise document.error(
            "engine-unsupported",
            key,
            f"a {key[0]} on command has no start_pin and no stop_pin",
            f"remove them: commands start and stop the {key[0]}",
        )
    named = [name for name in ("pin", "buttons", "button") if getattr(asked, name) is not None]
    if len(named) > 1:
        raise document.error(
            "conflicting-keys",
            (*key, named[0]),
            f"a {key[0]} has either {named[0]} or {named[1]}",
            "remove one",
        )
    in_use = _used_pins(servos, stated)
    if asked.button is not None:
        where = (*key, "button")
        check_free(document, where, asked.button, in_use, OWN_PIN)
        return CommandButton(
            ButtonPin(asked.button, int(asked.button_level == "high"), document.place(*where)), key[0]
        )
    if asked.buttons is not None:
        if isinstance(asked, CommandsTable):
            pins = _direction_pins(document, asked)
        else:
            pins = _chosen_pins(document, asked)
        level = int(asked.button_level == "high")
        return CommandButtons(dict(_named_buttons(document, (*key, "buttons"), pins, level, in_use)))
    if "button_level" in document.data[key[0]]["commands"]:
        raise document.error("missing-key", (*key, "button_level"), "there are no buttons")
    pin = "RA4" if asked.pin is None else asked.pin
    check_free(document, (*key, "pin"), pin, in_use, OWN_PIN)
    return CommandLine(pin) if isinstance(asked, CommandsTable) else CommandLine(pin, _codes(document, asked))


def _used_pins(servos: Sequence[Servo], stated: Mapping[str, EngineInput]) -> dict[str, str]:
    """Return what is on the pins of servos and of the EEPROM."""
    tape = given(stated.values(), Tape)
    return {servo.pin: servo.name for servo in servos} | (tape.pins if tape else {})


def _direction_pins(document: Document, asked: CommandsTable) -> dict[str, str]:
    """Return the pins of the buttons of a walk's directions. Raises InputError."""
    key = ("walk", "commands", "buttons")
    pins = {
        name: pin for name, pin in (asked.buttons or DirectionPins()).model_dump().items() if pin is not None
    }
    if not pins:
        raise document.error("missing-key", key, "no direction has a button", 'add forward = "RA4"')
    for names, value, what in (
        (STRAIGHT, asked.forward_mm, "forward_mm = 40"),
        (TURN, asked.turn_deg, "turn_deg = 20"),
    ):
        named = [name for name in names if name in pins]
        if named and value is None:
            raise document.error(
                "missing-key", (*key, named[0]), f"{named[0]} has a button but no step", f"add {what}"
            )
        if value is not None and not named:
            unused = what.split()[0]
            raise document.error(
                "missing-key",
                ("walk", "commands", unused),
                f"neither {names[0]} nor {names[1]} has a button",
                f"remove {unused}, or add a button",
            )
    return pins


def _check_names(document: Document, asked: MotionCommandsTable) -> None:
    """Raise InputError for two segments of one name, and for one that means something else."""
    names = [row.name for row in asked.segments]
    for index, name in enumerate(names):
        key = ("motion", "commands", "segments", index, "name")
        if name in names[:index]:
            raise document.error("conflicting-keys", key, f"two segments have the name {name}", "rename one")
        if name in NOT_SEGMENTS:
            raise document.error(
                "not-allowed", key, f"{name} is a word of `servogen drive`", "give the segment another name"
            )


def _chosen_pins(document: Document, asked: MotionCommandsTable) -> dict[str, str]:
    """Return the pins of the buttons of segments. Raises InputError."""
    key, pins = ("motion", "commands", "buttons"), asked.buttons or {}
    names = [row.name for row in asked.segments]
    for name in pins:
        document.check_known("unknown-name", (*key, name), name, names, f"no segment is named '{name}'")
    missing = next((name for name in names if name not in pins), None)
    if missing is not None:
        raise document.error("missing-key", key, f"{missing} has no button", f'add {missing} = "RB7"')
    return {name: pins[name] for name in names}


def _codes(document: Document, asked: MotionCommandsTable) -> dict[str, str]:
    """Return the codes of segments, in their order those of a walk's directions. Raises InputError."""
    if len(asked.segments) > len(CODES):
        raise document.error(
            "out-of-range",
            ("motion", "commands", "segments"),
            f"{len(asked.segments)} segments, and the line has {len(CODES)} codes",
            "choose by buttons, or by one button",
        )
    return dict(zip((row.name for row in asked.segments), CODES.values(), strict=False))


def _named_buttons(
    document: Document, key: Key, pins: Mapping[str, str], level: int, in_use: Mapping[str, str]
) -> Iterator[tuple[str, ButtonPin]]:
    """Yield the buttons of directions or segments by name. Raises InputError."""
    used = dict(in_use)
    for name, pin in pins.items():
        check_free(document, (*key, name), pin, used, OWN_PIN)
        used[pin] = f"the button of {name}"
        yield name, ButtonPin(pin, level, document.place(*key, name))


MIN_CLOCK_HZ = 32_000
"""The slowest usual crystals, those of watches, have 32768 Hz (DS35007, table of crystal capacitors, mode
LP).
"""

MIN_PERIOD_US = 1000.0
"""A frame shorter than this cannot contain a servo's pulse."""


def load(path: str | Path) -> Job:
    """Return the job in the file at `path`. Raises InputError."""
    return _job(toml_file.read(path))


def loads(text: str, file: str) -> Job:
    """Return the job in a text; `file` is the name used in errors. Raises InputError."""
    return _job(toml_file.parse(text, file))


def calibrated(job: Job, servo: str, file: str) -> Job:
    """Return the job with the calibration in `file`, beside the job, for one servo. Raises InputError."""
    document = job.document
    rows = [
        {**{key: value for key, value in row.items() if key != "points"}, "calibration": file}
        if row.get("name") == servo
        else row
        for row in document.data["servo"]
    ]
    return _job(replace(document, data={**document.data, "servo": tuple(rows)}))


def changed(job: Job, edits: Mapping[Key, object]) -> Job:
    """Return the job with other values for these keys, each a path into the file. Raises InputError."""
    data: Any = job.document.data
    for key, value in edits.items():
        data = _with(data, key, value)
    return _job(replace(job.document, data=data))


def _with(data: Any, key: Key, value: object) -> Any:
    """Return a table or an array in which the value at the path `key` is another."""
    if not key:
        return value
    first, *rest = key
    if isinstance(first, int):
        return (*data[:first], _with(data[first], tuple(rest), value), *data[first + 1 :])
    table = data or {}
    return {**table, first: _with(table.get(first), tuple(rest), value)}


def _job(document: Document) -> Job:
    """Return the job of a document. Raises InputError."""
    table = toml_file.validate(of_one_chip(document), JobTable)
    chips = read_chips(document, table.servo)
    chip, clock = _chip(document, table)
    rig = read_rig(document, table, chips)
    servos = rig.servos
    frame = _frame(document, table, clock)
    firmware, inputs = read_firmware(document, table, servos, frame, clock)
    if chips:
        check_alone(document, inputs, table)
    return Job(
        name=_name(document),
        document=document,
        chips=chips,
        device=chip,
        clock=clock,
        servos=servos,
        bindings=rig.bindings,
        followers=rig.followers,
        robot=rig.robot,
        tip=rig.tip,
        wheels=table.drive.wheels if table.drive else (),
        frame=frame,
        firmware=firmware,
        inputs=inputs,
        section=_section(document, table, needed=not _inputs_move(inputs)),
        supply=table.supply,
        sensors=_sensors(document, table, rig.robot, servos),
        expect=_expect(document, table),
    )


def _inputs_move(inputs: Sequence[EngineInput]) -> bool:
    """Return whether positions come from one of the inputs."""
    moving = {section.kind for section in sections().values() if section.moves}
    return any(each.kind in moving for each in inputs)


def _expect(document: Document, table: JobTable) -> ExpectTable | None:
    """Return [expect]. Raises InputError for the end of a walk that has none."""
    expect, walk = table.expect, table.walk
    if expect is None or walk is None:
        return expect
    endless = bool(walk.route) and walk.route[-1].cycles is None
    for key in ("robot_within_mm", "turn_within_deg"):
        if getattr(expect, key) is not None and (endless or walk.commands is not None):
            raise document.error(
                "endless-motion",
                ("expect", key),
                "an endless walk has no end that could be compared"
                if endless
                else "a walk on command ends where its commands lead",
                f"remove {key}" + (", or add cycles = … to the last segment of its route" if endless else ""),
            )
    return expect


def _sensors(
    document: Document, table: JobTable, robot: Robot | None, servos: Sequence[Servo]
) -> tuple[SensorTable, ...]:
    """Return the sensors. Raises InputError for a pin in use and for a quantity that a sensor cannot
    sense.
    """
    legs = [limb.name for limb in robot.limbs] if robot else []
    joints = [name for limb in robot.limbs for name in limb.joints] if robot else []
    in_use = {servo.pin: servo.name for servo in servos}
    for index, row in enumerate(table.sensor):
        key = ("sensor", index)
        document.check_known("unknown-pin", (*key, "pin"), row.pin, PINS, f"unknown pin '{row.pin}'")
        if row.pin in in_use:
            raise document.error(
                "pin-in-use", (*key, "pin"), f"{row.pin} is in use: {in_use[row.pin]}", "use another pin"
            )
        in_use[row.pin] = f"sensor[{index + 1}]"
        names = {"foot": legs, "end-stop": joints, "stall": []}[row.kind]
        if row.kind != "stall" and row.of not in names:
            part = "leg" if row.kind == "foot" else "joint"
            raise document.error(
                "unknown-name",
                (*key, "of"),
                f"the robot has no {part} '{row.of}'"
                if row.of
                else f"it does not state which {part} it watches",
                did_you_mean(row.of or "", names),
            )
        if row.kind == "end-stop" and (row.at_deg is None) == (row.at_mm is None):
            raise document.error(
                "missing-key", key, "an end stop needs its position", "add at_deg = … or at_mm = …"
            )
        if row.kind == "stall" and row.above_a is None:
            raise document.error(
                "missing-key", key, "a stall comparator needs its current", "add above_a = …"
            )
    return table.sensor


def _section(document: Document, table: JobTable, needed: bool) -> Section | None:
    """Return the section that moves the servos; None if there is none and none is needed."""
    given = [part for part in SECTIONS if getattr(table, part) is not None]
    if not given and not needed:
        return None
    if len(given) != 1:
        raise document.error(
            "job-sections",
            (given[1],) if given else (),
            "a job has one of " + ", ".join(f"[{part}]" for part in SECTIONS),
            None if given else "add [motion] poses = [ … ]",
        )
    part = given[0]
    if document.data[part].get("repeat", True) and "end" in document.data[part]:
        raise document.error(
            "endless-motion",
            (part, "end"),
            "a motion that repeats has no end",
            "write repeat = false, or omit end",
        )
    section: Section = getattr(table, part)
    return section


def _name(document: Document) -> str:
    """Return the job's name, which names a folder in `build/` and appears in comments of the C."""
    name = Path(document.file).stem
    if name in (".", "..") or any(ord(sign) < ord(" ") for sign in name):
        raise InputError(
            "unwritable-file",
            f"the file name makes the job's name {name!r}, which cannot be a folder",
            Location(document.file),
            "name the file after the job, such as arm.toml",
        )
    return name


def _chip(document: Document, table: JobTable) -> tuple[Device, Clock]:
    """Return the device and its clock. Raises InputError."""
    try:
        chip = device(table.chip.device)
    except InputError as error:
        raise error.at(document.place("chip", "device")) from error
    if table.chip.clock_hz > chip.max_clock_hz:
        raise document.error(
            "wrong-clock",
            ("chip", "clock_hz"),
            f"{table.chip.clock_hz} Hz is above the {chip.name}'s limit of {chip.max_clock_hz} Hz",
            "the PIC16F84 runs at up to 10 MHz, the PIC16F84A at up to 20 MHz",
        )
    if table.chip.clock_hz < MIN_CLOCK_HZ:
        raise document.error(
            "wrong-clock",
            ("chip", "clock_hz"),
            f"{table.chip.clock_hz} Hz is slower than any crystal: at least {MIN_CLOCK_HZ} Hz",
            "4 MHz is 4_000_000",
        )
    return chip, Clock(table.chip.clock_hz)


def _frame(document: Document, table: JobTable, clock: Clock) -> Frame:
    """Return the frame, its period in whole cycles. Raises InputError."""
    if table.frame.period_us < MIN_PERIOD_US:
        raise document.error(
            "out-of-range",
            ("frame", "period_us"),
            f"{table.frame.period_us:g} µs is not longer than a pulse",
            "20 ms is 20_000 µs",
        )
    return Frame(
        period=clock.round_us(exact(table.frame.period_us)),
        gap_us=exact(table.frame.gap_us),
        slot_us=None if table.frame.slot_us is None else exact(table.frame.slot_us),
        per_slot=table.frame.per_slot,
        max_together=table.frame.max_together,
        place=document.place("frame", "period_us"),
    )
