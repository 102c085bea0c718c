"""Jogging the servos of a stream job by keys: which servo, how far, and what is shown."""

from __future__ import annotations

import math
import os
import subprocess
from collections.abc import Callable

import numpy as np
import pytest

from servogen.drive.steering import Jog, Rates, job_steering
from servogen.errors import InputError
from tests.drive.conftest import ROOT, Serial, planned

JOB = ROOT / "jobs" / "stream-arm.toml"
Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def jog() -> Jog:
    found = job_steering(planned("stream-arm"), Rates())
    assert isinstance(found, Jog)
    return found


def degrees(jog: Jog, seconds: float = 100.0) -> list[float]:
    """Return the angles once all servos have arrived."""
    angles = jog.at(seconds)
    assert angles is not None
    return np.round(np.degrees(angles), 6).tolist()


def test_a_step_beyond_a_servos_limit_is_not_made(jog: Jog) -> None:
    for _ in range(8):
        jog.command("coarser")
    for _ in range(30):
        jog.command("+")
    high = degrees(jog)[0]
    servo = jog.job.servos[0]
    servo.width_us(math.radians(high))
    with pytest.raises(InputError, match="base"):
        servo.width_us(math.radians(high + 10))
    assert "at its limit" in jog.state()
    jog.command("-")
    assert "at its limit" not in jog.state()
    assert degrees(jog, 200.0)[0] == high - 10


def test_an_unknown_command_is_refused(jog: Jog) -> None:
    with pytest.raises(InputError, match="unknown command 'hop'"):
        jog.command("hop")


@pytest.mark.campaign
def test_keys_of_a_terminal_jog_the_robot_and_show_the_servo(start: Start, serial: Serial) -> None:
    master, slave = os.openpty()
    try:
        process = start("drive", JOB, "-p", serial.path, "--keys", stdin=slave)
        serial.wait_for(lambda decoder: {0, 1, 2} <= decoder.positions.keys())
        before = dict(serial.decoder.positions)
        os.write(master, b"\t]]+")
        serial.wait_for(lambda decoder: decoder.positions[1] > before[1])
        os.write(master, b"x")
        _, err = process.communicate(timeout=300)
        assert process.returncode == 0, err
        assert "shoulder: 95.0°, 1528 µs; step 5°" in err
        assert serial.decoder.positions[0] == before[0]
    finally:
        os.close(master)
        os.close(slave)
