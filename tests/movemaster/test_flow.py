"""Counters, jumps, loops, subroutines, pallets and ports: each program leaves its answer in the counters."""

from collections.abc import Callable
from fractions import Fraction

import pytest

from servogen.errors import InputError
from servogen.kinematics.catalogue import arm
from servogen.movemaster import Budget, PortInput, ProgramRun, input_of, manipulator
from servogen.movemaster.arm import Mover
from servogen.movemaster.interpreter import Controller
from servogen.movemaster.memory import InputPort

Ran = Callable[..., ProgramRun]
Refused = Callable[..., str]


def counters(run: ProgramRun) -> dict[int, int]:
    return {number: value for number, value in run.counters.items() if value}


def test_counters_are_set_and_counted(ran: Ran) -> None:
    assert counters(ran("10 SC 1, 5\n20 IC 1\n30 DC 2\n40 SC 3, 9\n50 SC 3")) == {1: 6, 2: -1}


@pytest.mark.parametrize(("value", "command", "result"), [(32767, "IC", 32768), (-32767, "DC", -32768)])
def test_a_counter_does_not_overflow(refused: Refused, value: int, command: str, result: int) -> None:
    assert refused(f"10 SC 1, {value}\n20 {command} 1") == (
        f"a.rvm:2:4: error: program line 20: counter 1 would be {result} [program-argument]\n  "
        f"-32767 to 32767"
    )


@pytest.mark.parametrize("command", ["EQ", "NE", "LG", "SM"])
@pytest.mark.parametrize("value", [-3, 4, 5, 6])
@pytest.mark.parametrize("written", ["5", "&5"])
def test_comparisons_jump_if_the_comparison_value_is_equal_not_equal_larger_smaller(
    ran: Ran, command: str, value: int, written: str
) -> None:
    holds = {"EQ": value == 5, "NE": value != 5, "LG": value > 5, "SM": value < 5}[command]
    run = ran(f"10 SC 1, {value}\n20 CP 1\n30 {command} {written}, 60\n40 SC 2, 1\n50 ED\n60 SC 2, 2")
    assert run.counters[2] == (2 if holds else 1)


def test_a_negative_hexadecimal_word_is_compared_as_such(ran: Ran) -> None:
    assert ran("10 DC 1\n20 CP 1\n30 EQ &FFFF, 50\n40 ED\n50 SC 2, 1").counters[2] == 1


def test_cp_takes_the_counter_as_it_is_then(ran: Ran) -> None:
    assert ran("10 SC 1, 5\n20 CP 1\n30 IC 1\n40 EQ 5, 60\n50 ED\n60 SC 2, 1").counters[2] == 1


@pytest.mark.parametrize(
    ("value", "bit", "jumps"),
    [(4, "+2", True), (4, "-2", False), (4, "-0", True), (5, "-0", False), (5, "0", True)],
)
def test_tb_jumps_if_a_bit_is_on_or_off(ran: Ran, value: int, bit: str, jumps: bool) -> None:
    run = ran(f"10 SC 1, {value}\n20 CP 1\n30 TB {bit}, 50\n40 ED\n50 SC 2, 1")
    assert (2 in run.counters) == jumps


def test_lines_run_in_the_order_of_their_numbers_not_of_the_file(ran: Ran) -> None:
    assert ran("20 SC 1, 7\n10 SC 1, 3").counters[1] == 7


def test_rc_repeats_the_lines_up_to_nx(ran: Ran) -> None:
    assert ran("10 RC 4\n20 IC 1\n30 NX\n40 IC 2").counters == {1: 4, 2: 1}


def test_loops_nest(ran: Ran) -> None:
    assert ran("10 RC 3\n20 RC 5\n30 IC 1\n40 NX\n50 IC 2\n60 NX").counters == {1: 15, 2: 3}


def test_a_loop_that_is_jumped_back_to_begins_anew(ran: Ran) -> None:
    text = "10 RC 3\n20 IC 1\n30 CP 1\n40 EQ 2, 10\n50 NX"
    assert ran(text).counters == {1: 5}


def test_gs_calls_and_rt_returns_behind_it(ran: Ran) -> None:
    text = "10 GS 100\n20 GS 100\n30 ED\n100 IC 1\n110 GS 200\n120 RT\n200 IC 2\n210 RT"
    assert ran(text).counters == {1: 2, 2: 2}


def test_a_loop_left_open_in_a_subroutine_ends_with_it(ran: Ran) -> None:
    text = "10 RC 2\n20 GS 100\n30 NX\n40 ED\n100 RC 9\n110 IC 1\n120 CP 1\n130 SM 9, 150\n140 NX\n150 RT"
    assert ran(text).counters == {1: 2}


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("10 RC 4\n20 IC 1\n30 ED", 10),
        ("10 RC 4", 10),
        ("10 IC 1\n20 RC 2\n30 RC 3\n40 IC 2\n50 NX\n60 ED", 20),
        ("10 NX\n20 RC 2\n30 IC 1", 20),
        ("10 GS 100\n20 ED\n100 RC 3\n110 IC 1\n120 RT\n130 NX", 100),
        ("10 RC 3\n20 GS 100\n30 ED\n100 NX\n110 RT", 10),
        ("10 RC 3\n20 IC 1\n30 GT 50\n40 NX\n50 ED", 10),
    ],
)
def test_rc_without_nx_is_refused_before_anything_moves(refused: Refused, text: str, line: int) -> None:
    at = [each.split()[0] for each in text.splitlines()].index(str(line)) + 1
    said = (
        f"a.rvm:{at}:{len(str(line)) + 2}: error: program line {line}: RC without an NX: nothing closes this "
        "loop [program-nesting]\n"
    )
    assert refused(text).startswith(said)


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("10 GT 40\n20 NX\n30 ED\n40 RC 3\n50 IC 1\n60 GT 20", 3),  # NX stands before its RC
        ("10 EQ 0, 40\n20 RC 2\n30 GT 50\n40 RC 5\n50 IC 1\n60 NX", 5),  # two RCs, one NX
        ("10 RC 9\n20 IC 1\n30 CP 1\n40 EQ 4, 60\n50 NX\n60 ED", 4),  # left before its end
    ],
)
def test_a_loop_that_some_way_closes_is_not_refused(ran: Ran, text: str, count: int) -> None:
    assert ran(text).counters[1] == count


def test_rn_to_a_line_within_a_loop_has_no_nx_and_other_loops_do_not_matter(
    ran: Ran, refused: Refused
) -> None:
    program = "10 RC 2\n20 IC 1\n30 IC 2\n40 NX\n"
    assert "program line 10: RC without an NX" in refused(program + "RN 10, 30")
    assert ran(program + "RN 20, 30").counters == {1: 1}


def test_the_longest_program_is_searched_for_nx(refused: Refused) -> None:
    lines = "".join(f"{number} RC 2\n" for number in range(1, 2049))
    assert "RC without an NX" in refused(lines.replace("2048 RC 2", "2048 NX"))


def test_gt_goes_on_there_and_a_comment_line_is_a_target(ran: Ran) -> None:
    assert ran("10 GT 30\n20 IC 1\n30 ' here\n40 IC 2").counters == {2: 1}


def test_ed_ends_the_program(ran: Ran) -> None:
    assert ran("10 IC 1\n20 ED\n30 IC 2").counters == {1: 1}


def test_rn_runs_from_a_line_up_to_not_including_another(ran: Ran) -> None:
    program = "10 IC 1\n20 IC 2\n30 IC 3\n40 IC 4\n"
    assert ran(program + "RN 20, 40").counters == {2: 1, 3: 1}
    assert ran(program + "RN 30").counters == {3: 1, 4: 1}
    assert ran(program + "RN 10, 20\nRN 10, 20").counters == {1: 2}


def test_no_program_runs_before_rn() -> None:
    mover = Mover(manipulator(arm("rv-m1")), None, Fraction(1, 50), Fraction(10))
    with pytest.raises(InputError, match=r"no program is running \[no-program\]$"):
        _ = Controller(mover, InputPort((), Fraction(1, 50)), 10).flow


def test_direct_lines_are_carried_out_in_order(ran: Ran) -> None:
    assert ran("SC 1, 5\n10 IC 1\nIC 1\nRN 10\nIC 1").counters == {1: 8}


def test_program_lines_behind_rn_are_not_run_and_it_is_said(ran: Ran) -> None:
    run = ran("10 IC 1\nRN 10\n20 IC 2\n30 IC 2")
    assert run.counters == {1: 1}
    assert [(each.code, str(each.location)) for each in run.warnings] == [
        ("lines-not-run", "a.rvm:3:4: program line 20")
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("10 GT 30\n20 ED", "a.rvm:1:4: error: program line 10: there is no program line 30 to go to"),
        ("10 ED\n20 EQ 1, 33", "a.rvm:2:4: error: program line 20: there is no program line 33 to go to"),
        ("10 ED\nRN 11",
            "a.rvm:2:1: error: there is no program line 11 [unknown-line]\n  near it are the lines 10"),
        ("10 ED\nRN 10, 5", "a.rvm:2:1: error: there is no program line 5 [unknown-line]\n"),
        ("RN 10\n10 ED",
            "a.rvm:1:1: error: there is no program line 10 [unknown-line]\n  put the program before RN"),
        ("10 RT", "a.rvm:1:4: error: program line 10: RT without a GS [program-nesting]\n"),
        ("10 NX", "a.rvm:1:4: error: program line 10: NX without an RC [program-nesting]\n"),
        ("10 GS 10", "a.rvm:1:4: error: program line 10: subroutines are called 10 deep: 9 is the maximum "
            "[program-nesting]\n"),
        ("10 IC 1\n10 IC 2",
            "a.rvm:2:4: error: program line 10: program line 10 is given twice [duplicate-name]\n  "
            "the other one"),
        ("10 CP 1\n20 PT 3",
            "a.rvm:2:4: error: program line 20: pallet 3 has no grid [undefined-position]\n  PA 3, "
            "columns, rows"),
        ("10 IN",
            "a.rvm:1:4: error: program line 10: IN waits for a strobe that never comes [program-argument]\n"),
    ],
)  # fmt: skip
def test_what_cannot_run_is_refused_at_its_line(refused: Refused, text: str, message: str) -> None:
    assert refused(text).startswith(message)


def test_loops_deeper_than_nine_are_refused(refused: Refused) -> None:
    loops = "\n".join(f"{10 * level} RC 2\n{1000 + level} NX" for level in range(1, 11))
    assert "program line 100: loops are nested deeper than 9" in refused(loops)


@pytest.mark.parametrize("text", ["10 GT 10", "10 IC 1\n20 DC 1\n30 GT 10"])
def test_a_program_that_does_not_end_is_stopped_after_so_many_commands(refused: Refused, text: str) -> None:
    said = refused(text, budget=Budget(commands=500))
    assert "the program has not ended after 500 commands [program-too-long]\n  end it with ED" in said
    assert said.startswith("a.rvm:")


def test_a_program_that_does_not_end_is_stopped_after_so_much_time(refused: Refused) -> None:
    said = refused("10 TI 10\n20 GT 10", budget=Budget(seconds=Fraction(60)))
    assert said.startswith(
        "a.rvm:1:4: error: program line 10: the program would take longer than 60 s [program-too-long]\n"
    )


@pytest.mark.parametrize("repeat", [False, True])
def test_a_program_may_take_all_of_its_time_and_commands(ran: Ran, refused: Refused, repeat: bool) -> None:
    budget = Budget(commands=3, seconds=Fraction(1))
    ran("10 TI 4\n20 TI 5\n30 TI 1", budget=budget, repeat=repeat)
    assert "would take longer than 1 s" in refused("10 TI 11", budget=budget, repeat=repeat)
    assert "after 3 commands" in refused("10 IC 1\n20 IC 1\n30 IC 1\n40 IC 1", budget=budget, repeat=repeat)
    tiny = Budget(seconds=Fraction(1, 1000))
    assert refused("10 TI 1", budget=tiny).startswith("a.rvm:1:4: error: program line 10: ")


# Pallets -------------------------------------------------------------------------------------------------

PALLET = (
    "PD 20, 0, 0, 100, -90, 10\nPD 21, 90, 0, 100, -90, 10\n"
    "PD 22, 10, 60, 130, -90, 40\nPD 23, 100, 60, 130, -90, 40\nPA 2, 4, 3\n"
)


@pytest.mark.parametrize(
    ("column", "row", "expected"),
    [
        (1, 1, (0, 0, 100, -90, 10)), (4, 1, (90, 0, 100, -90, 10)), (1, 3, (10, 60, 130, -90, 40)),
        (4, 3, (100, 60, 130, -90, 40)), (2, 1, (30, 0, 100, -90, 10)), (1, 2, (5, 30, 115, -90, 25)),
        (3, 2, (65, 30, 115, -90, 25)),
    ],
)  # fmt: skip
def test_grid_points_of_a_leaning_pallet(
    ran: Ran, column: int, row: int, expected: tuple[float, ...]
) -> None:
    run = ran(PALLET + f"10 SC 21, {column}\n20 SC 22, {row}\n30 PT 2")
    assert run.positions[2].pose.values == pytest.approx(expected)


def test_a_pallet_of_one_row_needs_no_more_than_its_first_row(ran: Ran) -> None:
    run = ran(PALLET + "PA 2, 4, 1\n10 SC 21, 4\n20 SC 22, 1\n30 PT 2")
    assert run.positions[2].pose.values == pytest.approx((90, 0, 100, -90, 10))


@pytest.mark.parametrize(
    ("column", "row", "message"),
    [
        (0, 1, "counter 21 names column 0 of 4"),
        (5, 1, "names column 5 of 4"),
        (1, 4, "counter 22 names row 4 of 3"),
    ],
)
def test_a_point_outside_of_the_grid_is_refused(
    refused: Refused, column: int, row: int, message: str
) -> None:
    assert message in refused(PALLET + f"10 SC 21, {column}\n20 SC 22, {row}\n30 PT 2")


def test_a_pallet_needs_its_four_corners(refused: Refused) -> None:
    assert "position 23 is not defined" in refused(
        PALLET.replace("PD 23", "PD 24") + "10 SC 21, 1\n20 SC 22, 1\n30 PT 2"
    )


# Ports ---------------------------------------------------------------------------------------------------

INPUTS = (PortInput(Fraction(1), 3), PortInput(Fraction(2), 9))


def read_as(ran: Ran, text: str) -> list[int]:
    """The comparison values that a program finds, as bits 0 to 3 counted into the counters 1 to 4."""
    tests = "\n".join(
        f"{at} TB -{bit}, {at + 20}\n{at + 10} SC {bit + 1}, 1\n{at + 20} ' off"
        for bit, at in enumerate(range(100, 220, 30))
    )
    found = ran(f"{text}\n{tests}", inputs=INPUTS).counters
    return [found.get(bit + 1, 0) for bit in range(4)]


def test_id_reads_what_stands_at_the_port_then(ran: Ran) -> None:
    assert read_as(ran, "10 ID") == [0, 0, 0, 0]
    assert read_as(ran, "10 TI 10\n20 ID") == [1, 1, 0, 0]
    assert read_as(ran, "10 TI 19\n20 ID") == [1, 1, 0, 0]
    assert read_as(ran, "10 TI 20\n20 ID") == [1, 0, 0, 1]


def test_in_waits_for_the_next_strobe(ran: Ran) -> None:
    run = ran("10 IN\n20 IN", inputs=INPUTS)
    assert [(step.frame, step.frames) for step in run.steps] == [(1, 49), (50, 50)]
    assert read_as(ran, "10 IN\n20 IN") == [1, 0, 0, 1]


def test_a_strobe_that_came_before_in_is_not_lost(ran: Ran) -> None:
    assert read_as(ran, "10 TI 50\n20 IN") == [1, 1, 0, 0]


def test_outputs_are_recorded_with_their_frames(ran: Ran) -> None:
    run = ran("10 OD &F0\n20 TI 10\n30 OB +1\n40 OB -7\n50 OT 5")
    assert [(each.frame, each.value, each.strobe) for each in run.outputs] == [
        (1, 0xF0, False),
        (51, 0xF2, False),
        (51, 0x72, False),
        (51, 5, True),
    ]


@pytest.mark.parametrize(
    ("text", "at", "value"), [("1.5=3", "3/2", 3), ("0=&1F", "0", 31), (" .5 = 255 ", "1/2", 255)]
)
def test_an_input_is_written_as_seconds_and_value(text: str, at: str, value: int) -> None:
    assert input_of(text) == PortInput(Fraction(at), value)


@pytest.mark.parametrize("text", ["", "3", "1=256", "1=&100", "-1=3", "1=x"])
def test_other_inputs_are_refused(text: str) -> None:
    with pytest.raises(InputError, match="is not an input"):
        input_of(text)


def test_a_program_of_too_many_frames_is_refused_however_long_it_may_take(refused: Refused) -> None:
    # TI 32767 waits 3276.7 s, 163 835 frames of 20 ms; the fourth goes beyond 500 000.
    text = "10 TI 32767\n20 TI 32767\n30 TI 32767\n40 TI 32767"
    said = refused(text, budget=Budget(seconds=Fraction(10**6)))
    assert "program line 40: the program is more than 500000 frames long, 10000 s" in said
