"""VCD: as pyvcd would write it, and as other programs write it."""

import io
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from vcd import VCDWriter
from vcd.reader import TokenKind, tokenize

from servogen.edges import HIGH, LOW, PINS, UNDRIVEN, EdgeTrace, edge_chunk
from servogen.errors import InputError, Location
from servogen.traces import read_edges, write_edges
from servogen.traces.vcd import VcdWriter, wire_name
from servogen.units import Clock, Cycles
from tests.edges.rows import rows_of

MHZ4 = Clock(4_000_000)
RB0, RB1 = PINS.index("RB0"), PINS.index("RB1")
HEADER = """\
$timescale 1 us $end
$scope module top $end
$var wire 1 ! RB0 $end
$upscope $end
$enddefinitions $end
"""


def read(tmp_path: Path, text: str, clock: Clock = MHZ4, **options: object) -> EdgeTrace:
    (tmp_path / "a.vcd").write_text(text)
    return read_edges(tmp_path / "a.vcd", clock, **options)  # type: ignore[arg-type]


@settings(max_examples=80)
@given(st.lists(st.tuples(st.integers(0, 5000), st.integers(0, 12), st.integers(0, 2)), max_size=40))
def test_every_byte_is_as_pyvcd_alone_would_write_it(steps: list[tuple[int, int, int]]) -> None:
    rows = []
    cycle = 0
    for step, pin, level in steps:
        cycle += step
        rows.append((cycle, pin, level))
    ours = io.BytesIO()
    writer = VcdWriter(ours, MHZ4, {"RB0": "arm"})
    if rows:
        writer.add(edge_chunk(*zip(*rows, strict=True)))
    writer.finish(Cycles(cycle + 10))

    theirs = io.StringIO()
    comment = "clock 4000000 Hz: one instruction cycle is exactly 1 us"
    vcd = VCDWriter(theirs, "1 us", date="", comment=comment, version="servogen")
    names = [f"{pin}_arm" if pin == "RB0" else pin for pin in PINS]
    wires = [vcd.register_var("chip", name, "wire", size=1, init="z") for name in names]
    for cycle, pin, level in rows:
        vcd.change(wires[pin], cycle, "01z"[level])
    vcd.close(cycle + 10)
    assert ours.getvalue().decode() == theirs.getvalue()


def test_wires_are_named_by_pin_and_servo_and_start_undriven(tmp_path: Path) -> None:
    trace = EdgeTrace(MHZ4, (edge_chunk([10, 20], [RB0, RB0], [HIGH, LOW]),), Cycles(30))
    write_edges(trace, tmp_path / "a.vcd", servos={"RB0": "arm", "RB1": "left leg/2"})
    tokens = list(tokenize((tmp_path / "a.vcd").open("rb")))
    names = {token.var.reference: token.var for token in tokens if token.kind is TokenKind.VAR}
    assert set(names) == {*PINS, "RB0_arm", "RB1_left_leg_2"} - {"RB0", "RB1"}
    assert {(var.type_.value, var.size) for var in names.values()} == {("wire", 1)}
    start = [token.kind for token in tokens].index(TokenKind.DUMPVARS)
    initial = [token.scalar_change.value for token in tokens[start + 1 : start + 14]]
    assert initial == ["z"] * 13
    assert tokens[-1].time_change == 30
    assert not any(token.kind is TokenKind.DATE for token in tokens)


def test_a_name_that_vcd_cannot_hold_gets_underscores() -> None:
    assert wire_name("RA2", "braț drept") == "RA2_bra__drept"
    assert wire_name("RA2", None) == "RA2"


@pytest.mark.parametrize(
    ("name", "pin"),
    [
        ("RB0", "RB0"), ("rb0", "RB0"), ("RB0_arm", "RB0"), ("servo_RB7", "RB7"), ("PORTB[3]", "RB3"),
        ("PORTA_4", "RA4"), ("RB [5]", "RB5"), ("RB1_ra2", "RB1"),  # the servo is called ra2
    ],
)  # fmt: skip
def test_a_wire_is_found_by_the_pin_in_its_name(tmp_path: Path, name: str, pin: str) -> None:
    trace = read(tmp_path, HEADER.replace("RB0", name) + "#0\n0!\n#7\n1!\n#9\n")
    assert rows_of(trace) == [(0, PINS.index(pin), LOW), (7, PINS.index(pin), HIGH)]


@pytest.mark.parametrize("name", ["RB8", "ARB0", "RB01", "RA5", "D0", "RC0"])
def test_other_names_are_no_pins_and_the_error_lists_them(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=f"no wire that is named by a pin.*\n.*{name}"):
        read(tmp_path, HEADER.replace("RB0", name) + "#0\n0!\n#9\n")


def test_wires_of_other_names_are_given_their_pins(tmp_path: Path) -> None:
    text = HEADER.replace("RB0", "D0") + "#0\n0!\n#7\n1!\n#9\n"
    assert rows_of(read(tmp_path, text, wires={"D0": "RB4"}))[-1] == (7, PINS.index("RB4"), HIGH)
    with pytest.raises(InputError, match=r"no 1-bit wire 'D1'.*\n.*D0"):
        read(tmp_path, text, wires={"D1": "RB4"})
    with pytest.raises(InputError, match="'RB9' is not a pin"):
        read(tmp_path, text, wires={"D0": "RB9"})


def test_the_first_twenty_wires_are_named_where_none_is_a_pins(tmp_path: Path) -> None:
    names = [f"D{number}" for number in range(22)]
    wires = "".join(f"$var wire 1 {chr(48 + number)} {name} $end\n" for number, name in enumerate(names))
    with pytest.raises(InputError, match="has no wire that is named by a pin") as refused:
        read(tmp_path, f"$timescale 1 us $end\n{wires}$enddefinitions $end\n#0\n")
    assert str(refused.value.hint).startswith(f"its 1-bit wires: {', '.join(names[:20])}; ")


def test_two_wires_of_one_pin_are_an_error_but_two_names_of_one_wire_are_not(tmp_path: Path) -> None:
    second = '$var wire 1 " RB0_again $end\n$upscope'
    with pytest.raises(InputError, match="'RB0' and 'RB0_again' are both RB0"):
        read(tmp_path, HEADER.replace("$upscope", second) + "#0\n")
    trace = read(tmp_path, HEADER.replace("$upscope", second.replace('"', "!")) + "#0\n0!\n#3\n1!\n#4\n")
    assert rows_of(trace) == [(0, RB0, LOW), (3, RB0, HIGH)]


def test_any_timescale_is_read_in_the_clock_that_the_caller_states(tmp_path: Path) -> None:
    text = HEADER.replace("1 us", "10ns") + "#0\n0!\n#100\n1!\n#149\n0!\n#150\n1!\n#400\n"
    trace = read(tmp_path, text)  # 10 ns: a hundredth of a cycle; 1.49 and 1.50 cycles
    assert rows_of(trace) == [(0, RB0, LOW), (1, RB0, HIGH), (1, RB0, LOW), (2, RB0, HIGH)]
    assert trace.end == 4
    faster = read(tmp_path, text, Clock(20_000_000))  # 200 ns: 20 steps
    assert rows_of(faster)[1:] == [(5, RB0, HIGH), (7, RB0, LOW), (8, RB0, HIGH)]


def test_the_end_is_always_after_the_last_change(tmp_path: Path) -> None:
    assert read(tmp_path, HEADER + "#5\n1!\n").end == 6
    assert read(tmp_path, HEADER + "#5 1!\n").end == 6  # as sigrok writes it
    assert read(tmp_path, HEADER + "#5\n1!\n#9\n").end == 9
    assert read(tmp_path, HEADER.replace("1 us", "1 ns") + "#4900\n1!\n#5100\n").end == 6


def test_states_of_other_programs_have_their_meaning(tmp_path: Path) -> None:
    trace = read(tmp_path, HEADER + "#0\nl!\n#1\n1!\n#2\nZ!\n#3\nH!\n#4\nL!\n#5\nz!\n#6\n")
    levels = [level for _, _, level in rows_of(trace)]
    assert levels == [LOW, HIGH, UNDRIVEN, HIGH, LOW, UNDRIVEN]


@pytest.mark.parametrize("state", "xXuUwW-")
@pytest.mark.parametrize("change", ["{}!", "b{} !"])
def test_a_level_that_is_unknown_for_any_time_is_an_error_with_its_place(
    tmp_path: Path, state: str, change: str
) -> None:
    """Taken for low it would prove what nobody saw: a pulse, or its end, at any time of it."""
    unknown = change.format(state)
    for body, line, words in (
        (f"#0\n0!\n#5\n{unknown}\n#6\n#7\n1!\n#9\n", 10, "of RB0 is not known from #5 to #6"),
        (f"#0\n{unknown}\n#6\n1!\n#9\n", 8, "of RB0 is not known from #0 to #6"),
        (f"#0\n0!\n#6\n1!\n#9\n{unknown}\n", None, "of RB0 is not known from #9 to the end"),
        (f"#0\n{unknown}\n#4\n{unknown}\n#5\n0!\n#9\n", 8, "of RB0 is not known from #0 to #4"),
    ):
        with pytest.raises(InputError, match=words) as caught:
            rows_of(read(tmp_path, HEADER + body))
        assert caught.value.location == Location(str(tmp_path / "a.vcd"), line)
    for body in (f"#0\n{unknown}\n0!\n#6\n1!\n#9\n", f"#0\n0!\n#6\n{unknown}\n1!\n#9\n"):
        assert rows_of(read(tmp_path, HEADER + body)) == [(0, RB0, LOW), (6, RB0, HIGH)]


def test_only_the_levels_of_pins_must_be_known(tmp_path: Path) -> None:
    header = HEADER.replace("$upscope", "$var wire 1 % D1 $end\n$upscope")
    text = header + "#0\n0!\nx%\n#6\n1!\nb- %\n#9\n"
    assert rows_of(read(tmp_path, text)) == [(0, RB0, LOW), (6, RB0, HIGH)]


def test_a_pin_without_a_value_at_the_beginning_is_not_known_there(tmp_path: Path) -> None:
    """IEEE 1364, 18.2: a file holds changes, and $dumpvars the values from which they begin."""
    for body, words in (
        ("#0\n#5\n1!\n#9\n", "of RB0 is not known from #0 to #5"),
        ("#5\n0!\n#9\n", "of RB0 is not known from #0 to #5"),
        ("#0\n#5\n#9\n", "of RB0 is not known from #0 to #5"),
    ):
        with pytest.raises(InputError, match=words):
            rows_of(read(tmp_path, HEADER + body))
    assert rows_of(read(tmp_path, HEADER + "$dumpvars 0! $end\n#5\n1!\n#9\n"))[1:] == [(5, RB0, HIGH)]


def test_what_happens_while_the_recording_is_off_is_not_known(tmp_path: Path) -> None:
    """Whether or not $dumpoff sets the pins to X, as IEEE 1364, 18.1.4 requires."""
    for values in ("x!\n", ""):
        off = f"#0\n0!\n#5\n1!\n#6\n$dumpoff\n{values}$end\n"
        with pytest.raises(InputError, match="of RB0 is not known from #6 to #20") as caught:
            rows_of(read(tmp_path, HEADER + off + "#20\n$dumpon\n1!\n$end\n#25\n0!\n#30\n"))
        assert caught.value.location.line == HEADER.count("\n") + 8 + values.count("\n")
        on_again = read(tmp_path, HEADER + off + "$dumpon\n1!\n$end\n#25\n0!\n#30\n")
        assert rows_of(on_again) == [(0, RB0, LOW), (5, RB0, HIGH), (25, RB0, LOW)]
        ended = read(tmp_path, HEADER + off)
        assert (rows_of(ended), ended.end) == ([(0, RB0, LOW), (5, RB0, HIGH)], 6)


@pytest.mark.parametrize(
    "tail",
    [
        "$comment no end\n",
        "$comment no end\n#2\n",
        "$comment\n#90\n$end\n",
        "#7\nb1\n",
    ],
)
def test_a_file_ends_with_what_its_last_time_stamp_says(tmp_path: Path, tail: str) -> None:
    """One that stands in a comment is none: nothing was recorded up to it."""
    with pytest.raises(InputError, match=r"a\.vcd: error: ends within a comment or a value after #[57]"):
        rows_of(read(tmp_path, HEADER + "#0\n0!\n#5\n1!\n" + tail))
    trace = read(tmp_path, HEADER + "#0\n0!\n#5\n1!\n#9\n$comment with an end $end\n")
    assert (rows_of(trace), trace.end) == ([(0, RB0, LOW), (5, RB0, HIGH)], 10)


def test_a_value_that_is_not_of_one_bit_is_an_error(tmp_path: Path) -> None:
    for value in ("r0.5", "b2", "s?"):
        with pytest.raises(InputError, match="'!' is not a value change"):
            rows_of(read(tmp_path, HEADER + f"#0\n0!\n#5\n{value} !\n#9\n"))


def test_what_is_not_a_pin_is_passed_over(tmp_path: Path) -> None:
    header = HEADER.replace("$upscope", "$var reg 8 # bus $end\n$var real 64 % volts $end\n$upscope")
    body = "#0\n$dumpvars\n0!\nb00000000 #\nr0 %\n$end\n#5 b1010 # 1! r1.5 %\n"
    body += "$comment #9 1! 0! $end\n#8\n0!\nbx #\n#9\n"
    assert rows_of(read(tmp_path, header + body)) == [(0, RB0, LOW), (5, RB0, HIGH), (8, RB0, LOW)]


def test_a_one_bit_vector_is_a_wire(tmp_path: Path) -> None:
    assert rows_of(read(tmp_path, HEADER + "#0\nb0 !\n#5\nb1 !\n#6\nbz !\n#7\n"))[1:] == [
        (5, RB0, HIGH),
        (6, RB0, UNDRIVEN),
    ]


def test_a_line_that_sigrok_puts_in_front_is_passed_over(tmp_path: Path) -> None:
    trace = read(tmp_path, "META samplerate: 1000000\n" + HEADER + "#0 0!\n#10 1!\n#20\n")
    assert (rows_of(trace), trace.end) == ([(0, RB0, LOW), (10, RB0, HIGH)], 20)


def test_windows_line_ends_are_line_ends(tmp_path: Path) -> None:
    (tmp_path / "a.vcd").write_bytes((HEADER + "#0\n0!\n#5\n1!\n#9\n").replace("\n", "\r\n").encode())
    trace = read_edges(tmp_path / "a.vcd", MHZ4)
    assert (rows_of(trace), trace.end) == ([(0, RB0, LOW), (5, RB0, HIGH)], 9)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("hello\n", r"a\.vcd: error: is not a VCD file"),
        ("", r"a\.vcd: error: is not a VCD file"),
        (HEADER.replace("$timescale 1 us $end\n", "") + "#0\n", r"a\.vcd: error: has no \$timescale"),
        (HEADER.replace("1 us", "1 min") + "#0\n", r"a\.vcd:1: error: .*min"),
        (HEADER.replace("wire 1", "wire one") + "#0\n", r"a\.vcd:3: error: "),
        (HEADER, r"a\.vcd: error: is not a whole VCD file"),
        (HEADER + "#0\n0!\n#9\n1!\n#8\n0!\n#10\n", r"a\.vcd:10: error: time '#8' is not allowed here"),
        (HEADER + "#0\n0!\n#9z\n1!\n#10\n", r"a\.vcd:8: error: time '#9z'"),
        (HEADER + "#0\n0!\n?!\n#10\n", r"a\.vcd:8: error: '\?!' is not a value change"),
        (HEADER + f"#0\n0!\n#{10**19}\n", r"a\.vcd: error: time #10000000000000000000 is too late"),
        (
            HEADER.replace("1 us", "1 s") + f"#0\n0!\n#{10**15}\n",
            r"a\.vcd: error: time #1000000000000000 is too late.*\n.* a step of this file is 1e\+06",
        ),
    ],
)
def test_each_defect_of_a_file_has_its_place_and_message(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        rows_of(read(tmp_path, text))
