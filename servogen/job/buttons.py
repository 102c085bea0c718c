"""The buttons of [firmware] -> `Buttons`: pins that exist, that no servo has, for the engine that reads them.

In: the checked table and the servos. Out: the buttons; InputError for a pin that cannot be one.
"""

from __future__ import annotations

from collections.abc import Sequence

from servogen.edges import PINS
from servogen.engines.player.buttons import Button, Buttons
from servogen.engines.registry import ENGINES
from servogen.errors import did_you_mean
from servogen.job.schema import FirmwareTable
from servogen.robot.servo import Servo
from servogen.toml.file import Document


def buttons_of(document: Document, table: FirmwareTable, servos: Sequence[Servo]) -> Buttons:
    """The start button and the emergency stop. Raises InputError."""
    found: dict[str, Button] = {}
    for name in ("start", "stop"):
        pin = getattr(table, f"{name}_pin")
        if pin is None:
            for beside in (f"{name}_level", f"{name}_pulses"):
                if beside in document.data.get("firmware", {}):
                    raise document.error(
                        "missing-key", ("firmware", beside), f"there is no {name}_pin", "add it"
                    )
            continue
        key = ("firmware", f"{name}_pin")
        if table.engine != "auto" and not ENGINES[table.engine].buttons:
            raise document.error(
                "engine-unsupported",
                key,
                f"the {table.engine} engine reads no buttons",
                'write engine = "player"',
            )
        if pin not in PINS:
            raise document.error("unknown-pin", key, f"unknown pin '{pin}'", did_you_mean(pin, PINS))
        taken = {servo.pin: servo.name for servo in servos} | {each.pin: "start" for each in found.values()}
        if pin in taken:
            raise document.error(
                "pin-in-use", key, f"{pin} is in use: {taken[pin]}", "a button has a pin of its own"
            )
        level = int(getattr(table, f"{name}_level") == "high")
        found[name] = Button(pin, level, document.place(*key))
    return Buttons(found.get("start"), found.get("stop"), table.stop_pulses != "hold")
