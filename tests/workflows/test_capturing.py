"""How long a capture is asked for, and with which settings: the analyser's end is a list of bytes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from servogen.bench.analysers.memory import CaptureNeeds
from servogen.bench.analysers.sigrok import SigrokLook
from servogen.errors import InputError, ToolError
from servogen.pulse import PulseSchedule
from servogen.pulse.schedule import Channel, Pulse, Run
from servogen.units import Clock, Cycles
from servogen.workflows import capture as capturing
from servogen.workflows.capture import CaptureSettings, capture, capture_by_sigrok, capture_needs, check_rate

MHZ4 = Clock(4_000_000)
ARM, HAND = Channel("arm", "RB1", "futaba-s3001"), Channel("hand", "RA0", "futaba-s3001")
SCHEDULE = PulseSchedule(
    clock=MHZ4,
    period=Cycles(20_000),
    channels=(ARM, HAND),
    # Three moments: the one pulse begins where the other ends. Then four, and one frame without pulses.
    lead_in=(Run(2, (Pulse(0, 1000), Pulse(1000, 500))),),
    loop=(Run(3, (Pulse(0, 1000), Pulse(2000, 500))), Run(1, (None, None))),
)
FRAME = Fraction(1, 50)


def needs(edges: Fraction | int, frames: int, fewest: Fraction | int, most: int) -> CaptureNeeds:
    return CaptureNeeds(FRAME, Fraction(edges), frames, Fraction(fewest), most)


@pytest.mark.parametrize(
    ("schedule", "seconds", "wanted"),
    [
        # Nothing is known: thirteen pulses in 20 ms, or a single one.
        (None, None, needs(26, 50, 2, 26)),
        (None, 0.5, needs(26, 25, 2, 26)),
        (None, 0.501, needs(26, 26, 2, 26)),
        # Two frames and four; on average 3 changes in either, and never more than 4.
        (SCHEDULE, None, needs(3, 6, 3, 4)),
        (SCHEDULE, 0.1, needs(4, 5, 3, 4)),
        (SCHEDULE, 0.1001, needs(4, 6, 3, 4)),
        (replace(SCHEDULE, lead_in=()), None, needs(3, 4, 3, 4)),
        (replace(SCHEDULE, lead_in=SCHEDULE.loop[:1]), None, needs(4, 7, 3, 4)),
        # A loop without pulses counts as one change in ten frames.
        (replace(SCHEDULE, loop=SCHEDULE.loop[1:]), None, needs(3, 3, Fraction(1, 10), 3)),
        (
            replace(SCHEDULE, lead_in=(), loop=SCHEDULE.loop[1:]),
            None,
            needs(Fraction(1, 10), 1, Fraction(1, 10), 1),
        ),
    ],
)
def test_a_capture_is_of_the_whole_schedule_or_of_the_asked_time(
    schedule: PulseSchedule | None, seconds: float | None, wanted: CaptureNeeds
) -> None:
    assert capture_needs(schedule, seconds) == wanted


def test_a_sample_may_be_as_long_as_a_glitch() -> None:
    check_rate(100_000)  # 10 µs
    with pytest.raises(InputError, match="at least 100 kHz is needed"):
        check_rate(99_999)


@pytest.mark.parametrize(
    ("driver", "settings", "seconds", "samples", "rle"),
    [
        ("ols:conn=/dev/ttyACM0", CaptureSettings(), None, 160_160, True),  # 8 frames and a thousandth
        ("ols", CaptureSettings(rle=False), None, 160_160, False),
        ("fx2lafw", CaptureSettings(rate=200_000), 0.1, 28_028, False),
        ("fx2lafw", CaptureSettings(rate=100_001), 0.02, 6007, False),  # 6006.06 rounded up
    ],
)
def test_sigrok_captures_two_frames_more_and_what_a_slow_crystal_needs(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    driver: str,
    settings: CaptureSettings,
    seconds: float | None,
    samples: int,
    rle: bool,
) -> None:
    looks: list[tuple[SigrokLook, Path]] = []
    monkeypatch.setattr(capturing, "sigrok_capture", lambda look, path: looks.append((look, path)))
    given = replace(settings, wire=("D0=RB1",))
    session = SimpleNamespace(end=samples, clock=Clock(4 * settings.rate))
    monkeypatch.setattr(capturing, "read_session", lambda path: session)
    done = capture_by_sigrok(tmp_path / "run.sr", driver, SCHEDULE, seconds, given)
    ((look, path),) = looks
    assert (look.driver, look.rate, look.samples, look.rle) == (driver, settings.rate, samples, rle)
    assert look.wires == (("D0", "RB1"),)
    assert done.seconds == samples / settings.rate
    assert done.to_json() == {
        "file": str(path),
        "analyser": driver,
        "samples_per_second": settings.rate,
        "seconds": samples / settings.rate,
        "wanted_seconds": done.wanted_s,
    }
    assert done.shortage is None
    with pytest.raises(InputError, match="too slow to show anything"):
        capture_by_sigrok(tmp_path / "run.sr", driver, SCHEDULE, None, CaptureSettings(rate=99_000))
    capture_by_sigrok(tmp_path / "run.sr", driver, None, 0.02, replace(given, rate=99_000))


class Analyser:
    """The other end of the port: an identity, metadata, then as many samples as are asked for."""

    path = "/dev/ttyACM7"

    def __init__(self, metadata: bytes, first: int | None = None) -> None:
        self.metadata, self.first = metadata, first
        self.written = b""
        self.patience: list[float] = []
        self.sending = b""

    def write(self, data: bytes) -> None:
        self.written += data
        answers = {b"\x02": b"1ALS", b"\x04": self.metadata}
        self.sending = answers.get(data, b"")
        if data == b"\x01":
            counts = self.written[self.written.rindex(b"\x81") + 1 :][:2]
            size = 8 * (int.from_bytes(counts, "little") + 1)
            self.sending = bytes(size if self.first is None else self.first)

    def read(self, most: int, seconds: float) -> bytes:
        self.patience.append(seconds)
        data, self.sending = self.sending[:most], self.sending[most:]
        return data

    read_whole = read

    def clear(self) -> None:
        pass


def captured(monkeypatch: pytest.MonkeyPatch, analyser: Analyser, path: Path, *given: Any) -> Any:
    @contextmanager
    def opened(port: str, baud: int) -> Iterator[Analyser]:
        assert (port, baud) == ("/dev/ttyACM7", 115_200)
        yield analyser

    monkeypatch.setattr(capturing, "open_port", opened)
    return capture(path, "/dev/ttyACM7", *given)


PLAIN = b"\x01OLS\0\0"


def test_the_settings_reach_the_analyser(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """At 1 MHz without RLE a frame has 20000 samples, and the default memory of 24 KiB does not hold one."""
    analyser = Analyser(PLAIN)
    labels: list[tuple[str, int]] = []

    @contextmanager
    def progress(label: str, total: int) -> Iterator[Any]:
        labels.append((label, total))
        yield lambda done: None

    armed: list[bool] = []
    settings = CaptureSettings(rle=False, memory=1 << 19, armed=lambda: armed.append(True))
    done = captured(monkeypatch, analyser, tmp_path / "a.vcd", SCHEDULE, 0.04, settings, progress)
    # Two frames and the one in which it begins, and four to spare: 60004 words.
    assert labels == [("capture", 60_004)]
    assert armed == [True]
    assert done.plan.words == 60_004
    assert (done.captures, done.seconds) == (1, 60_004 / 1e6)
    assert b"\x80" + (99).to_bytes(4, "little") in analyser.written
    # RB1, the pin of the first servo, is channel 1.
    assert b"\xc0\x02\0\0\0" in analyser.written
    assert analyser.patience[3] == pytest.approx(1.25 * 0.060004 + 5)
    assert done.to_json() == {
        "file": str(tmp_path / "a.vcd"),
        "analyser": "OLS",
        "memory_bytes": 24 * 1024,
        "samples_per_second": 1_000_000,
        "rle": False,
        "seconds": 0.060004,
        "captures": 1,
    }


@pytest.mark.parametrize(
    ("schedule", "settings", "mask"),
    [
        (None, CaptureSettings(), 1),  # RB0
        (None, CaptureSettings(trigger="rb3"), 8),
        (SCHEDULE, CaptureSettings(trigger="RA0"), 1 << 8),
        (SCHEDULE, CaptureSettings(wire=("5=RB1",)), 1 << 5),
        (SCHEDULE, CaptureSettings(trigger_channel=14), 1 << 14),
        (SCHEDULE, CaptureSettings(triggered=False), 0),
    ],
)
def test_a_capture_waits_for_the_pin_that_is_asked_for(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    schedule: PulseSchedule | None,
    settings: CaptureSettings,
    mask: int,
) -> None:
    analyser = Analyser(PLAIN)
    captured(monkeypatch, analyser, tmp_path / "a.vcd", schedule, 0.02, settings)
    assert b"\xc0" + mask.to_bytes(4, "little") in analyser.written
    assert (b"\xc4" in analyser.written) == bool(mask)


def test_the_rate_is_the_devices_where_that_is_slower(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    slow = Analyser(b"\x23" + (200_000).to_bytes(4, "big") + b"\0")
    done = captured(monkeypatch, slow, tmp_path / "a.vcd", SCHEDULE, 0.02)
    assert int(done.plan.rate) == 200_000
    useless = Analyser(b"\x23" + (50_000).to_bytes(4, "big") + b"\0")
    with pytest.raises(InputError, match="too slow to show anything"):
        captured(monkeypatch, useless, tmp_path / "b.vcd", SCHEDULE, 0.02)
    assert int(captured(monkeypatch, useless, tmp_path / "b.vcd", None, 0.02).plan.rate) == 50_000
    slower, untouched = CaptureSettings(rate=50_000), Analyser(PLAIN)
    with pytest.raises(InputError, match="too slow to show anything"):
        captured(monkeypatch, untouched, tmp_path / "c.vcd", SCHEDULE, 0.02, slower)
    assert untouched.written == b""
    assert int(captured(monkeypatch, slow, tmp_path / "c.vcd", None, 0.02, slower).plan.rate) == 50_000


def test_what_came_of_a_capture_that_stops_is_kept_beside_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    analyser = Analyser(PLAIN, first=20)
    with pytest.raises(ToolError) as error:
        captured(monkeypatch, analyser, tmp_path / "a.vcd", SCHEDULE, 0.02)
    kept = tmp_path / "a.partial.vcd"
    assert error.value.code == "capture-failed"
    assert error.value.message.startswith("the analyser stopped sending after 20 of ")
    assert error.value.hint == f"the incomplete capture is kept in {kept}"
    assert kept.exists() and not (tmp_path / "a.vcd").exists()


def test_captures_that_are_stitched_are_numbered(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A frame has 2000 samples at 100 kHz, and 4200 hold one and that in which it begins: six of 1 frame."""
    labels: list[str] = []

    @contextmanager
    def progress(label: str, total: int) -> Iterator[Any]:
        labels.append(label)
        if len(labels) == 2:
            raise ToolError("no-answer", "that is enough")
        yield lambda done: None

    settings = CaptureSettings(rate=100_000, rle=False, memory=8400)
    with pytest.raises(ToolError, match="that is enough"):
        captured(monkeypatch, Analyser(PLAIN), tmp_path / "a.vcd", SCHEDULE, None, settings, progress)
    assert labels == ["capture 1 of about 6", "capture 2 of about 6"]
