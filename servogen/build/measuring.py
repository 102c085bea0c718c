"""The checks of planned pulses, held against measured ones.

In: a `Measurement` and the servos' models by pin. Out: warnings, pin by pin.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from servogen.edges import PINS
from servogen.errors import Diagnostic, InputError, Location, did_you_mean
from servogen.pulse.lint import check_measured, check_periods, check_unknown
from servogen.robot.servo import ServoModel, servo
from servogen.robot.servo_models import servo_model
from servogen.verify import Measurement, PinMeasurement


def servos_named(texts: Sequence[str]) -> dict[str, ServoModel]:
    """ "RB0=futaba-s3001" as a model of that pin, "futaba-s3001" as that of every pin. Raises InputError."""
    models: dict[str, ServoModel] = {}
    for text in texts:
        pin, _, name = text.rpartition("=")
        if pin and pin not in PINS:
            raise InputError(
                "unknown-pin", f"unknown pin '{pin}'", Location(key="--servo"), did_you_mean(pin, PINS)
            )
        model = servo_model(name, place=Location(key="--servo"))
        models |= dict.fromkeys((pin,) if pin else PINS, model)
    return models


def measured_warnings(measurement: Measurement, models: Mapping[str, ServoModel]) -> tuple[Diagnostic, ...]:
    """Return the warnings; a pin without a model is judged by what every servo takes."""
    found: list[Diagnostic] = []
    for pin in measurement.pins:
        model = models.get(PINS[pin.pin])
        found += _of_pin(measurement, pin, model)
    return tuple(found)


def _of_pin(
    measurement: Measurement, pin: PinMeasurement, model: ServoModel | None
) -> tuple[Diagnostic, ...]:
    name = PINS[pin.pin]
    periods = [float(measurement.us(each)) for each in _periods(pin)]
    if model is None:
        widths = [float(measurement.us(width)) for width in pin.widths]
        return (*check_unknown(name, widths), *check_periods(periods, name))
    widths = [float(measurement.us(width)) for width in pin.widths_in_order()]
    return check_measured(servo(name, name, model), widths, periods)


def _periods(pin: PinMeasurement) -> list[int]:
    """The period of each kind of frame, not of the changes from one kind to the next.

    A pin with one pulse or two has no kind: all its periods.
    """
    return [kind.period for kind in pin.kinds] or list(pin.periods)
