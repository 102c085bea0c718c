"""The client of an analyser, byte by byte: its other end is written from the protocol's pages.

"Logic Analyzer: serial port protocol" (sump.org) and the Logic Sniffer's metadata (Dangerous Prototypes).
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from servogen.bench.analysers import sump
from servogen.bench.analysers.memory import CaptureNeeds, CapturePlan, plan
from servogen.bench.analysers.recording import SampleRecord, check_name, cut, edges, partial_name, stitched
from servogen.bench.analysers.sump_client import (
    AnalyserDescription,
    SampleRequest,
    capture,
    identify,
    metadata,
)
from servogen.bench.ports import Port, Unplugged
from servogen.errors import InputError, ToolError
from tests.edges.rows import chunk, rows_of

RESETS = bytes(5)


class Device:
    """The other end of a port: what it sends, piece by piece; b"" is a silence."""

    path = "/dev/ttyACM7"

    def __init__(self, *pieces: bytes | Exception) -> None:
        self.pieces = list(pieces)
        self.written = b""
        self.waits: list[tuple[int, float]] = []
        self.cleared: list[int] = []

    def write(self, data: bytes) -> None:
        self.written += data

    def read(self, most: int, seconds: float) -> bytes:
        self.waits.append((most, seconds))
        piece = self.pieces.pop(0) if self.pieces else b""
        if isinstance(piece, Exception):
            raise piece
        assert len(piece) <= most
        return piece

    read_whole = read

    def clear(self) -> None:
        self.cleared.append(len(self.written))

    @property
    def port(self) -> Port:
        return cast(Port, self)


METADATA = b"\x01OLS\0\x21\0\0\x60\0\x23\x05\xf5\xe1\x00\x40\x10\0"
"""Name, 24576 bytes of memory, 100 MHz, 16 channels, end."""


@pytest.mark.parametrize("identity", [b"1SLO", b"1ALS"])
def test_a_device_is_reset_and_asked_what_it_is(identity: bytes) -> None:
    device = Device(b"old samples", identity, METADATA)
    assert identify(device.port) == AnalyserDescription("OLS", 24_576, 100_000_000, True)
    assert device.written == RESETS + b"\x02" + b"\x04"
    assert device.cleared == [5]
    assert device.waits[1:] == [(4, 0.5), (1 << 10, 0.25)]
    assert device.waits[0][1] == 0.1


def test_a_device_that_is_still_sending_is_asked_a_second_time_and_no_third() -> None:
    device = Device(b"", b"\x05\x06\x07\x08", b"", b"1ALS", METADATA)
    assert identify(device.port).name == "OLS"
    assert device.written == 2 * (RESETS + b"\x02") + b"\x04"
    stranger = Device(b"", b"", b"", b"AVR\n", b"", b"1ALS")
    with pytest.raises(ToolError, match=r"not a SUMP analyser: it answered b'AVR\\n'") as wrong:
        identify(stranger.port)
    assert wrong.value.code == "wrong-device"
    assert stranger.written == 2 * (RESETS + b"\x02")
    silent = Device()
    with pytest.raises(ToolError, match="the device does not answer") as none:
        identify(silent.port)
    assert (none.value.code, str(none.value.location)) == ("no-answer", "/dev/ttyACM7")


@pytest.mark.parametrize(
    ("pieces", "described"),
    [
        ([b""], AnalyserDescription("SUMP analyser", 24 * 1024, None, False)),
        ([b"\0"], AnalyserDescription("SUMP analyser", 24 * 1024, None, False)),
        ([b"\x01\0\x21\0\0\0\0\0"], AnalyserDescription("SUMP analyser", 24 * 1024, None, False)),
        ([b"\x21\0\0\0\x01\0"], AnalyserDescription("SUMP analyser", 1, None, True)),
        ([b"\x23\0\0\1\0", b"\x01A\0", b"\0"], AnalyserDescription("A", 24 * 1024, 256, False)),
        ([b"\x40", b"\0", b"\x01B\0\0"], AnalyserDescription("B", 24 * 1024, None, False)),
        ([b"\x01C", b"C\0", b"\0"], AnalyserDescription("CC", 24 * 1024, None, False)),
        # The zero of a number, of a byte or of a text does not end the metadata.
        ([b"\x21\0\0", b"\0\x02", b"\0"], AnalyserDescription("SUMP analyser", 2, None, True)),
    ],
)
def test_metadata_come_in_pieces_until_their_end(pieces: list[bytes], described: AnalyserDescription) -> None:
    device = Device(b"", b"1ALS", *pieces, b"\xee more")
    assert identify(device.port) == described
    assert len(device.pieces) == 1


def test_metadata_of_every_kind_are_read_up_to_what_is_torn() -> None:
    whole = b"\x02v1\0\x20\0\0\0\x0f\x41\x07\x01N\0"
    items: list[tuple[int, int | str]] = [(0x02, "v1"), (0x20, 15), (0x41, 7), (0x01, "N")]
    ends = [4, 9, 11, 14]
    for size in range(len(whole) + 1):
        assert metadata(whole[:size]) == dict(items[: sum(end <= size for end in ends)]), size
    assert metadata(b"\x41\x07\x60\x01\x42\x08") == {0x41: 7}  # kind 3 is unknown, and so is its length
    assert metadata(b"\x41\x07\0\x42\x08") == {0x41: 7}


def request(**changes: object) -> SampleRequest:
    given = {"rate": Fraction(1_000_000), "words": 12, "rle": False, "channel": None, "patience_s": 7.5}
    return SampleRequest(**{**given, **changes})  # type: ignore[arg-type]


def hexed(text: str) -> bytes:
    return bytes.fromhex(text)


@pytest.mark.parametrize(
    ("changes", "stages", "divider", "counts", "flags"),
    [
        # Without a trigger the first stage starts at once: bit 27.
        ({}, "C0 00000000 C1 00000000 C2 00000008", "63000000", "02000200", "32000000"),
        # Channel 3: stage 0 waits for low; stage 1, armed at level 1 (bit 16), for high, and starts.
        (
            {"channel": 3, "rle": True, "words": 532, "rate": Fraction(10_000_000)},
            "C0 08000000 C1 00000000 C2 00000000 C4 08000000 C5 08000000 C6 00000108",
            "09000000",
            "84008400",
            "32410000",
        ),
        (
            {"words": 4 << 16, "rate": Fraction(1_000)},
            "C0 00000000 C1 00000000 C2 00000008",
            "9F860100",
            "FFFFFFFF",
            "32000000",
        ),
    ],
)
def test_the_settings_are_the_protocols_bytes(
    changes: dict[str, object], stages: str, divider: str, counts: str, flags: str
) -> None:
    """The divider is less one, the counts in fours less one; two groups of channels and a filter are on."""
    device = Device(bytes(2))
    ready: list[bytes] = []
    capture(device.port, request(**changes), armed=lambda: ready.append(device.written))
    asked = hexed(f"{stages} 80 {divider} 81 {counts} 82 {flags} 01")
    assert device.written == asked
    assert ready == [asked]


def test_samples_are_waited_for_patiently_and_their_end_is_made_sure_of() -> None:
    device = Device(bytes(10), bytes(13), bytes(1))
    found = capture(device.port, request())
    assert found.missing is None
    assert found.runs.end == 12
    assert device.waits == [(24, 7.5), (14, 0.5), (1, 0.5), (1, 0.1)]
    assert device.written.endswith(b"\x01")


def test_a_capture_that_stops_says_how_much_came() -> None:
    device = Device(bytes(10), bytes(3))
    found = capture(device.port, request())
    assert found.missing == "the analyser stopped sending after 13 of 24 bytes"
    assert found.runs.end == 6
    assert device.waits[-1] == (11, 0.5)
    gone = Unplugged("port-lost", "gone")
    partly = capture(Device(bytes(10), gone).port, request())
    assert partly.missing == "the analyser disappeared after 10 of 24 bytes"
    with pytest.raises(Unplugged):
        capture(Device(gone).port, request())
    whole = capture(Device(bytes(24), gone).port, request())
    assert whole.missing == "the analyser disappeared after 24 of 24 bytes"


def test_more_than_was_asked_for_is_another_device() -> None:
    with pytest.raises(ToolError, match="sent more than the 24 bytes requested") as error:
        capture(Device(bytes(24), b"x").port, request())
    assert error.value.code == "wrong-device"


@pytest.mark.parametrize(
    ("channel", "text"),
    [
        (None, "the analyser sent nothing for 7.5 s"),
        (0, "nothing rose on channel 0 for 7.5 s, or too little followed to fill the memory"),
    ],
)
def test_a_capture_that_never_begins_is_ended(channel: int | None, text: str) -> None:
    device = Device()
    with pytest.raises(ToolError) as error:
        capture(device.port, request(channel=channel))
    assert (error.value.code, error.value.message) == ("no-answer", text)
    assert device.written.endswith(b"\x01" + RESETS)


def test_the_newest_word_comes_first_and_counts_repeat_the_value_before() -> None:
    """Sent: 7, a count of 2 more, 5, 3; so first 3, then three times 5, then 7."""
    device = Device(b"\x07\x00\x02\x80\x05\x00\x03\x00", b"")
    runs = capture(device.port, request(words=4, rle=True)).runs
    assert (runs.value.tolist(), runs.start.tolist(), runs.end) == ([3, 5, 7], [0, 1, 4], 5)


@pytest.mark.parametrize(
    ("length", "words"),
    [
        (1, [5]),
        (2, [5, 0x8001]),
        (0x8000, [5, 0xFFFF]),  # the value and 32767 more
        (0x8001, [5, 0xFFFF, 5]),
        (0x10000, [5, 0xFFFF, 5, 0xFFFF]),
    ],
)
def test_a_run_longer_than_a_count_is_begun_again(length: int, words: list[int]) -> None:
    runs = sump.Runs(np.array([5], dtype=np.uint32), np.array([0], dtype=np.int64), length)
    assert sump.encode(runs).tolist() == words
    assert sump.decode(np.array(words, dtype=np.uint32), True).end == length
    assert sump.decode(np.array([0x8005], dtype=np.uint32), True).end == 0
    plain = sump.decode(np.array([4, 4, 6], dtype=np.uint32), False)
    assert (plain.value.tolist(), plain.start.tolist(), plain.end) == ([4, 6], [0, 2], 3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("15=RB0", "'15=RB0' is not a channel"),
        ("14=RB0", None),
        ("-1=RB0", "'-1=RB0' is not a channel"),
        (f"{'9' * 5000}=RB0", f"'{'9' * 5000}=RB0' is not a channel"),
        ("0=RB8", "'0=RB8' is not a pin"),
    ],
)
def test_fifteen_channels_can_be_wired(text: str, message: str | None) -> None:
    if message is None:
        assert sump.wires([text, "0 = ra4"]) == {14: 5, 0: 4}
        assert sump.wires([]) == {**{n: 5 + n for n in range(8)}, **{8 + n: n for n in range(5)}}
        return
    with pytest.raises(InputError) as error:
        sump.wires([text])
    assert error.value.message == message
    for twice in (["0=RB0", "0=RB1"], ["0=RB0", "1=RB0"]):
        with pytest.raises(InputError, match="is wired twice"):
            sump.wires(twice)


# Plans and records

NEEDS = CaptureNeeds(Fraction(1, 50), Fraction(2), 3, Fraction(1), 4)


def test_a_plan_holds_the_frames_and_the_one_in_which_it_begins() -> None:
    """At 1 kHz a frame of 20 ms is 20 samples; with four to spare, 3 + 1 frames are 84 words of two bytes."""
    planned = plan(168, 1000, False, NEEDS)
    assert planned == CapturePlan(
        Fraction(1000),
        False,
        84,
        3,
        Fraction(84, 20) / 50,
        Fraction(20),
        Fraction(20),
        Fraction(1, 50),
    )
    with pytest.raises(
        InputError, match="80 words hold 2 frames of 20 words and the one in which it begins, not 3"
    ):
        plan(167, 1000, False, NEEDS)
    assert plan(167, 1000, False, NEEDS, several=True).frames == 2
    assert plan(88, 1000, False, NEEDS, several=True).frames == 1
    with pytest.raises(InputError) as error:
        plan(87, 1000, False, NEEDS, several=True)
    assert error.value.hint == "with RLE (--rle), or with at most 1000 samples a second (--rate)"
    assert error.value.message == (
        "the analyser's memory is too small: 87 bytes are 40 words, and a frame of 20 ms at 1000 samples a "
        "second is 20 samples of a word each; the frame in which it begins and a whole one must fit"
    )


def test_with_rle_the_largest_frame_and_the_fewest_edges_count() -> None:
    """Two words for each edge, and two for each 32768 of the 20000 samples."""
    planned = plan(200, 1_000_000, True, NEEDS)
    per_frame = 4 + Fraction(2 * 20_000, 32_768)
    first = 8 + Fraction(2 * 20_000, 32_768) + 4
    assert planned.words_per_frame == per_frame
    assert planned.words == -(-(3 * per_frame + first) // 4) * 4
    assert planned.fewest == 2
    assert planned.seconds == planned.words / Fraction(2) / 50
    with pytest.raises(InputError) as error:
        plan(34, 1_000_000, True, NEEDS)
    assert error.value.hint == "watch fewer servos at a time, or use an analyser with more memory"
    assert (
        "34 bytes are 16 words, and a frame of 20 ms with 4 edges is 10 words with RLE;"
        in error.value.message
    )


def test_a_shorter_plan_keeps_a_frame_and_asks_in_fours() -> None:
    planned = plan(168, 1000, False, NEEDS)
    for by, frames, words in ((0, 3, 84), (1, 2, 64), (2, 1, 44), (9, 1, 44)):
        shorter = planned.shorter(by)
        assert (shorter.frames, shorter.words) == (frames, words)
        assert shorter.seconds == Fraction(words, 20) / 50
    assert plan(1 << 21, 1000, False, NEEDS, True).words == 84
    with pytest.raises(InputError, match="262144 words hold"):  # all that the protocol can ask for
        plan(1 << 24, 1_000_000, False, CaptureNeeds(Fraction(1, 50), Fraction(2), 99, Fraction(1), 4))


def test_channels_become_edges_of_their_pins_with_the_level_at_the_beginning() -> None:
    runs = sump.Runs(
        np.array([0b101, 0b100, 0b000], dtype=np.uint32), np.array([0, 7, 9], dtype=np.int64), 12
    )
    assert rows_of(edges(runs, {0: 6, 2: 5})) == [(0, 5, 1), (0, 6, 1), (7, 6, 0), (9, 5, 0)]
    assert rows_of(edges(runs, {1: 4})) == [(0, 4, 0)]


def test_a_cut_keeps_the_levels_at_its_beginning() -> None:
    record = SampleRecord(chunk([(0, 5, 0), (0, 6, 1), (4, 5, 1), (8, 6, 0), (9, 5, 0)]), 12)
    shown = cut(record, 4, 9)
    assert (rows_of(shown.chunk), shown.end) == ([(0, 5, 1), (0, 6, 1), (4, 6, 0)], 5)
    assert sorted(rows_of(cut(record, 3, 10).chunk)) == [
        (0, 5, 0),
        (0, 6, 1),
        (1, 5, 1),
        (5, 6, 0),
        (6, 5, 0),
    ]


@pytest.mark.parametrize(("rate", "gap"), [(1000, 1), (1001, 2), (4000, 4)])
def test_stitched_records_are_a_millisecond_without_levels_apart(rate: int, gap: int) -> None:
    one, two = SampleRecord(chunk([(0, 5, 1), (3, 5, 0)]), 10), SampleRecord(chunk([(0, 6, 1)]), 4)
    joined = stitched([one, two], rate)
    assert joined.pieces == ((0, 10), (10 + gap, 14 + gap))
    assert joined.end == 14 + gap
    assert rows_of(joined.chunk) == [(0, 5, 1), (3, 5, 0), (10, 5, 2), (10 + gap, 6, 1)]
    assert stitched([one], rate) is one


def test_a_capture_is_written_as_vcd_into_a_directory_that_is_there(tmp_path: Path) -> None:
    folder = tmp_path
    check_name(folder / "run.VCD")
    assert partial_name(folder / "run.vcd") == folder / "run.partial.vcd"
    checks: list[tuple[Callable[[], None], str]] = [
        (lambda: check_name(folder / "run.csv"), "'.csv' is not a suffix"),
        (lambda: check_name(folder / "none" / "run.vcd"), "there is no such directory"),
    ]
    for check, text in checks:
        with pytest.raises(InputError, match=text):
            check()
