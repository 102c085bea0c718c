"""Programs as a lab wrote them for XC8: each does on its pins what it says."""

from itertools import pairwise
from pathlib import Path

from servogen.edges import HIGH, LOW
from servogen.simulator.sources import BouncingButton, Levels, Reset
from tests.lab_bench import MS, PORT_A, PORT_B, SECOND, SEGMENTS, Display, Pins, pressed, run, serial_bytes

HERE = Path(__file__).parent


def lab(name: str, cycles: int, *outside: object) -> Pins:
    return run(HERE / name, "xc8", cycles, *outside)  # type: ignore[arg-type]


def steps(found: list[tuple[int, int]]) -> list[int]:
    """The times between changes."""
    return [later - earlier for (earlier, _), (later, _) in pairwise(found)]


def test_the_light_runs_and_the_switch_turns_it_round() -> None:
    shown = lab("chaser.c", 1200 * MS, Levels(pressed("RA0"), [(0, 1), (625 * MS, 0)])).numbers(PORT_B)
    places = [n % 8 for n in (*range(13), *range(11, -1, -1))]
    assert [value for _, value in shown if value][:24] == [1 << place for place in places[:24]]
    assert all(50 * MS <= step < 51 * MS for step in steps(shown[1:]))


def test_two_digits_count_to_59() -> None:
    pins = lab("seven_segment.c", 7 * SECOND)
    read = []
    for rise, length in pins.pulses("RA0"):
        ones = SEGMENTS[pins.number(PORT_B, rise + length // 2)]
        before = rise - 2 * MS
        assert pins.level("RA1", before) == HIGH and pins.level("RA0", before) == LOW
        read.append(10 * SEGMENTS[pins.number(PORT_B, before)] + ones)
    shown = [value for value, following in pairwise(read) if value != following]
    assert shown[:63] == [*range(60), 0, 1, 2]
    assert all(5 * MS <= length < 6 * MS for _, length in pins.pulses("RA1"))


def test_a_bouncing_button_counts_once_a_press() -> None:
    button = BouncingButton(pressed("RB0"), 100 * MS, 300 * MS, bounces=9, bounce=10 * MS)
    light = lab("button.c", 500 * MS, button).edges("RB7")
    assert [level for _, level in light] == [LOW, HIGH]
    assert 100 * MS < light[1][0] < 130 * MS


def test_turns_are_counted_in_16_bits() -> None:
    rises = [5 * MS + n * 400 for n in range(70)]
    barrier = Levels(
        pressed("RB0"), [(0, 0), *((c, v) for rise in rises for c, v in ((rise, 1), (rise + 150, 0)))]
    )
    shown = lab("rb0_interrupt.c", 40 * MS, barrier).numbers(PORT_A)
    assert [value for _, value in shown] == [n % 16 for n in range(18)]
    assert all(0 < cycle - rise < 120 for (cycle, _), rise in zip(shown[1:], rises[3::4], strict=False))


def test_the_encoder_is_followed_in_both_directions() -> None:
    gray = [0b00, 0b01, 0b11, 0b10]
    turns = [*range(11), *range(9, -4, -1)]
    lines: list[list[tuple[int, int]]] = [[], []]
    for number, turn in enumerate(turns):
        for bit in (0, 1):
            lines[bit].append((number * 2 * MS, gray[turn % 4] >> bit & 1))
    pins = lab(
        "port_change.c", 2 * MS * len(turns), *(Levels(pressed(f"RB{4 + bit}"), lines[bit]) for bit in (0, 1))
    )
    shown = [pins.number(PORT_B[:4], (number + 1) * 2 * MS - 1) for number in range(len(turns))]
    assert shown == [turn & 15 for turn in turns] or shown == [-turn & 15 for turn in turns]


def test_midnight_comes_after_two_seconds() -> None:
    pins = lab("timer_clock.c", 5 * SECOND + 200 * MS)
    midnight = pins.pulses("RB1") or [(cycle, 0) for cycle, level in pins.edges("RB1") if level == HIGH]
    assert abs(midnight[0][0] - 2 * SECOND) < 3 * MS
    odd = pins.edges("RB0")
    assert [level for _, level in odd] == [LOW, HIGH, LOW, HIGH, LOW, HIGH]
    assert all(abs(cycle - n * SECOND) < 3 * MS for n, (cycle, _) in enumerate(odd[1:], 1))
    assert [level for _, level in pins.edges("RA0")] == [LOW, HIGH, LOW]  # minute 59 is odd


def test_squares_are_sent_bit_by_bit() -> None:
    pins = lab("serial_hello.c", int(0.4 * SECOND))
    squares = b", ".join(b"%d^2=%d" % (n, n * n) for n in range(98, 103))
    assert serial_bytes(pins, "RA2", 2400) == b"Hello\r\n" + squares + b"\r\n"
    assert pins.state.sleeping


def test_the_meter_does_not_forget() -> None:
    rises = [20 * MS + n * 30 * MS for n in range(6)]
    line = Levels(
        pressed("RB0"), [(0, 0), *((c, v) for rise in rises for c, v in ((rise, 1), (rise + 15 * MS, 0)))]
    )
    pins = lab(
        "eeprom_counter.c", 250 * MS, line, Reset(134 * MS, 136 * MS)
    )  # the two writes of the fourth pulse take until 130 ms
    assert [pins.number(PORT_A, rise + 14 * MS) for rise in rises] == [1, 2, 3, 4, 5, 6]
    assert pins.state.eeprom[:8] == bytes([6, 6, 0xFF, 0xFF, *b"v1", 0, 0])


def test_the_display_shows_a_temperature_below_zero() -> None:
    first, second = Display(lab("lcd.c", 200 * MS)).lines()
    assert (first, second) == ("outside   0.5\xdfC", "  -12.7\xdfC")


def test_the_servo_moves_while_a_button_is_held() -> None:
    buttons = (
        Levels(pressed("RA0"), [(0, 1), (200 * MS, 0), (600 * MS, 1)]),
        Levels(pressed("RA1"), [(0, 1), (900 * MS, 0)]),
    )
    pulses = lab("servo_button.c", 3 * SECOND, *buttons).pulses("RB0")
    widths = [length for _, length in pulses]
    ten = widths[15] - widths[14]
    assert 9 <= ten <= 11
    assert all(1400 <= width <= 1600 for width in widths[:10])
    assert {later - earlier for earlier, later in pairwise(widths)} == {ten, 0, -ten}
    assert max(widths) - widths[0] == ten * sum(
        200 * MS <= rise + 18 * MS + width < 600 * MS for rise, width in pulses
    )
    assert all(19 * MS <= step <= 21 * MS for step in steps(pulses))


def test_the_traffic_light_waits_for_pedestrians() -> None:
    shown = lab("traffic_light.c", 22 * SECOND, Levels(pressed("RA4"), [(0, 1), (6 * SECOND, 0)])).numbers(
        PORT_B
    )
    lights = [value for _, value in shown if value]
    assert lights[:6] == [0b01100, 0b01010, 0b10001, 0b01011, 0b01100, 0b01010]
    times = steps([each for each in shown if each[1]])
    assert abs(shown[-1][0] - shown[0][0]) > 10 * SECOND
    assert 6 * SECOND <= next(cycle for cycle, value in shown if value == 0b01010) < 6 * SECOND + 60
    for found, wanted in zip(times[1:5], (10, 30, 5, 40), strict=True):
        assert wanted * 100 * MS <= found < wanted * 100 * MS + 2000


def test_the_tune_has_its_notes_and_lengths() -> None:
    rising = [cycle for cycle, level in lab("melody.c", int(1.5 * SECOND)).edges("RB3") if level == HIGH]
    notes: list[list[int]] = [[]]
    for before, cycle in pairwise(rising):
        period = cycle - before
        if notes[-1] and abs(period - notes[-1][-1]) > 60:
            notes.append([])
        notes[-1].append(period)
    played = [each for each in notes if len(each) > 3]
    halves = [114, 101, 90, 57]
    assert len(played) == len(halves)
    unit = sorted(played[0])[len(played[0]) // 2] / halves[0]
    for found, half in zip(played, halves, strict=True):
        assert abs(sorted(found)[len(found) // 2] - half * unit) < 0.02 * half * unit + 10
    beat = 2 * 65_536
    assert [round(sum(each) / beat) for each in played] == [2, 1, 1, 3]
