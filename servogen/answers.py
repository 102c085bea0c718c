"""What commands print with `--json`: the keys, types and meanings of each answer.

In: nothing. Out: types that the functions named `to_json` return, so that the checker of types holds them to
it, and of which `servogen schema output` is made. The end of a name is the unit of its numbers. Cycles are
instruction cycles; frames and addresses are counted from 0, lines and columns of files from 1.
"""

from typing import Annotated, Literal, NotRequired, TypedDict


class DiagnosticAnswer(TypedDict):
    """An error, a warning or a note, and where it is."""

    severity: Annotated[str, '"error", "warning" or "note".']
    code: Annotated[str, "Its stable name, a row of docs/diagnostics.md."]
    message: Annotated[str, "The sentence."]
    file: Annotated[str | None, "The file that it is about."]
    line: Annotated[int | None, "The line in the file, from 1."]
    column: Annotated[int | None, "The column in the line, from 1."]
    key: Annotated[str | None, "The key of the file, or the option."]
    cycle: Annotated[int | None, "The instruction cycle since reset."]
    address: Annotated[int | None, "The word of the program, or the file register."]
    hint: Annotated[str | None, "What to do."]


class PlanErrorAnswer(TypedDict):
    """How far a schedule is from the motion that it was rounded from, at most."""

    width_us: Annotated[float, "The greatest error of a width."]
    angle_deg: Annotated[float | None, "The greatest error of an angle."]
    speed_deg_s: Annotated[float | None, "The greatest error of a continuous-rotation servo's speed."]
    end: Annotated[str | None, "The foot, tool or base that is farthest from its place."]
    end_mm: Annotated[float | None, "How far it is."]


class WidthAnswer(TypedDict):
    """A width of a servo's pulses, rounded to whole cycles."""

    servo: Annotated[str, "The servo."]
    pulse: NotRequired[Annotated[str, 'Which pulse it is an example of, such as "longest".']]
    requested_us: Annotated[float, "The width of the planned angle."]
    cycles: Annotated[int, "The width of the pulse."]
    achieved_us: Annotated[float, "The same in microseconds."]
    error_us: Annotated[float, "Achieved minus requested."]
    frames: Annotated[int, "How many frames have it."]


class CoverageAnswer(TypedDict):
    """Which of a schedule's frames were seen completely."""

    different_frames: Annotated[int, "Different frames that count."]
    different_frames_seen: Annotated[int, "How many of them were seen."]
    lead_in_only_frames: Annotated[
        int, "Different frames that only the lead-in has, where they do not count."
    ]
    lead_in_only_frames_seen: Annotated[int, "How many of them were seen."]
    loop_frames: Annotated[int, "Frames of the loop."]
    loop_frames_seen: Annotated[int, "How many of them were seen."]


class SpanAnswer(TypedDict):
    """What was compared, from the first scheduled edge on."""

    asked_cycles: Annotated[int, "What was asked for."]
    compared_cycles: Annotated[int, "What was compared."]
    frames: Annotated[int, "Whole frames in it."]
    lead_in_frames: Annotated[int, "Those of the lead-in."]
    loop_repeats: Annotated[int, "Whole repeats of the loop."]


class WorstAnswer(TypedDict):
    """The largest of a set of errors."""

    error_cycles: Annotated[int, "The error, observed minus scheduled."]
    count: Annotated[int, "How many pulses have an error."]
    frame: Annotated[int | None, "The frame of the largest, from 0."]
    cycle: Annotated[int | None, "The cycle of the largest since reset."]


class ChannelAnswer(TypedDict):
    """One servo's pulses beside those of the schedule."""

    name: Annotated[str, "The servo."]
    pin: Annotated[str, "Its pin."]
    scheduled_pulses: Annotated[int, "Pulses of the schedule."]
    observed_pulses: Annotated[int, "Pulses of the pin."]
    missing_pulses: Annotated[int, "Scheduled pulses that are not there."]
    extra_pulses: Annotated[int, "Pulses that are not scheduled."]
    glitches: Annotated[int, "Levels of one or two cycles."]
    worst_width: Annotated[WorstAnswer, "Widths."]
    worst_period: Annotated[WorstAnswer, "Times from rise to rise."]
    worst_edge: Annotated[WorstAnswer, "Cycles of single edges."]


class DifferenceAnswer(TypedDict):
    """The first edge that is not as scheduled."""

    cycle: Annotated[int, "Where the two first differ, since reset."]
    pin: Annotated[str, "The pin."]
    channel: Annotated[str | None, "The servo on it."]
    frame: Annotated[int | None, "The frame, from 0."]
    level: Annotated[int, "The level that the pin goes to."]
    expected_cycle: Annotated[int | None, "The scheduled cycle."]
    observed_cycle: Annotated[int | None, "The observed cycle."]


class OverlapAnswer(TypedDict):
    """Two pins high together."""

    count: Annotated[int, "How often."]
    longest_cycles: Annotated[int, "The longest time."]
    first_cycle: Annotated[int, "The first time, since reset."]
    pins: Annotated[list[str], "The pins."]


class StrayPinAnswer(TypedDict):
    """A pin that changes although the schedule does not drive it."""

    pin: Annotated[str, "The pin."]
    edges: Annotated[int, "How often it changes."]
    first_cycle: Annotated[int, "When it first does, since reset."]


class ChipWarning(DiagnosticAnswer):
    """A warning of the simulated chip."""

    chip_dependent: Annotated[bool, "Whether another chip may do something else there."]


class VerdictAnswer(CoverageAnswer):
    """The verdict on one run of a program, or on its recorded edges."""

    exact: Annotated[bool, "Whether every edge is the schedule's."]
    verdict: Annotated[str, "The verdict in words."]
    reasons: Annotated[list[str], "Why it is not exact."]
    clock_hz: Annotated[int, "The clock of the schedule."]
    start_cycle: Annotated[int | None, "The cycle of the first edge since reset."]
    span: Annotated[SpanAnswer, "What was compared."]
    channels: Annotated[list[ChannelAnswer], "Each servo."]
    first_difference: Annotated[DifferenceAnswer | None, "The first edge that differs."]
    overlap: Annotated[OverlapAnswer | None, "Pins high together that never are in the schedule."]
    stray_pins: Annotated[list[StrayPinAnswer], "Pins that change although they are not driven."]
    warnings: Annotated[list[ChipWarning], "What the chip did that may differ from chip to chip."]
    plan_error: Annotated[PlanErrorAnswer | None, "How far the schedule is from its plan."]


class RunAnswer(TypedDict):
    """How a run was made."""

    held: Annotated[dict[str, int], "The level at which each input was held."]
    not_judged: Annotated[list[str], "What the verdict is not about."]


class VerifyAnswer(VerdictAnswer, RunAnswer):
    """`verify --against` of a program or of recorded edges."""


class ForeverFacts(TypedDict):
    """What is known of a program's edges for all time."""

    exact_for_all_time: Annotated[bool, "Whether every edge is the schedule's, for all time from this start."]
    reason: Annotated[str, "Why nothing is known of all time."]
    lead_in_frames: Annotated[int, "Frames before the chip's state repeats."]
    loop_frames: Annotated[int, "Frames from one repeat to the next."]
    verdict: Annotated[VerdictAnswer, "The verdict on the time up to the repeat."]


class ForeverAnswer(ForeverFacts, RunAnswer):
    """`verify --forever`."""


class SpreadAnswer(TypedDict):
    """The errors of a set of captured times."""

    worst_us: Annotated[float, "The worst, measured minus scheduled."]
    mean_us: Annotated[float, "Their mean."]
    not_allowed: Annotated[int, "How many are outside the tolerance."]


class CapturedChannelAnswer(TypedDict):
    """One servo's pulses in a capture."""

    name: Annotated[str, "The servo."]
    pin: Annotated[str, "Its pin."]
    connected: Annotated[bool, "Whether the capture has the pin."]
    scheduled_pulses: Annotated[int, "Pulses of the schedule in that time."]
    captured_pulses: Annotated[int, "Complete pulses of the capture."]
    missing_pulses: Annotated[int, "Scheduled pulses that are not there."]
    extra_pulses: Annotated[int, "Pulses that are not scheduled."]
    glitches: Annotated[int, "Pulses and gaps that are too short."]
    width_error: Annotated[SpreadAnswer, "Widths."]
    period_error: Annotated[SpreadAnswer, "Times from rise to rise."]
    edge_error: Annotated[SpreadAnswer, "Single edges."]
    mean_period_us: Annotated[float | None, "The mean time from rise to rise."]
    jitter_us: Annotated[float, "The root mean square error of the rises."]


class MismatchAnswer(DiagnosticAnswer):
    """Where a capture is first not as scheduled."""

    time_us: Annotated[float, "The time since its beginning, by the analyser's clock."]
    pin: Annotated[str, "The pin."]
    channel: Annotated[str, "The servo."]
    frame: Annotated[int | None, "The frame, from 0."]


class PieceAnswer(TypedDict):
    """One of several captures in one file."""

    begin_us: Annotated[float, "Where it begins in the file."]
    duration_us: Annotated[float, "How long it is."]
    first_frame: Annotated[int | None, "The schedule's frame of its first whole pulse."]
    frames: Annotated[int, "Its frames."]
    crystal_ppm: Annotated[float | None, "The deviation of the chip's clock."]
    crystal_error_ppm: Annotated[float | None, "Its standard error."]


class TolerancesAnswer(TypedDict):
    """What a capture may be off, beside one sample."""

    width_us: Annotated[float, "A width."]
    period_us: Annotated[float, "A time from rise to rise."]
    edge_us: Annotated[float, "A single edge."]
    crystal_ppm: Annotated[float, "The chip's clock against the analyser's."]
    glitch_us: Annotated[float, "Shorter levels are glitches."]


class CaptureVerdictAnswer(CoverageAnswer):
    """The verdict on a capture."""

    agrees: Annotated[
        bool, "Whether every different frame was captured, and everything matches within the tolerances."
    ]
    verdict: Annotated[str, "The verdict in words."]
    reasons: Annotated[list[str], "Why it does not agree."]
    tolerances: Annotated[TolerancesAnswer, "What is allowed."]
    sample_us: Annotated[float, "The time of one sample."]
    duration_us: Annotated[float, "The length of the capture."]
    crystal_ppm: Annotated[float | None, "The deviation of the chip's clock by the analyser's."]
    crystal_error_ppm: Annotated[float | None, "Its standard error."]
    first_frame: Annotated[int | None, "The schedule's frame of the first whole pulse."]
    frames: Annotated[int, "Frames from the first to the last pulse."]
    pieces: Annotated[list[PieceAnswer], "The captures, if they are several."]
    channels: Annotated[list[CapturedChannelAnswer], "Each servo."]
    first_mismatch: Annotated[MismatchAnswer | None, "Where it is first not as scheduled."]
    stray_pins: Annotated[list[str], "Pins that change although they are not driven."]
    plan_error: Annotated[PlanErrorAnswer | None, "How far the schedule is from its plan."]


class VerifyCaptureAnswer(CaptureVerdictAnswer, RunAnswer):
    """`verify --against` of a capture."""


class JitterAnswer(TypedDict):
    """Where the pulses of a second chip with a crystal of its own are, after their places."""

    crystal_ppm: Annotated[int, "By how much each crystal may be off."]
    runs: Annotated[int, "The runs, at the limits of both crystals and at equal frequencies."]
    seen_us: Annotated[list[float], "The least and the most in these runs."]
    allowed_us: Annotated[list[float], "The least and the most that crystals and looks make."]


class PairVerdictAnswer(TypedDict):
    """The verdict on the programs of two chips in one time."""

    exact: Annotated[bool, "Whether every edge of both is the schedules'."]
    apart_cycles: Annotated[int | None, "How far they are from the time that they should have to each other."]
    jitter: Annotated[JitterAnswer | None, "With a crystal each; null: with one."]
    chips: Annotated[list[VerdictAnswer], "The verdict on each."]


class PairCaptureAnswer(TypedDict):
    """The verdict on a recording of two chips."""

    agrees: Annotated[bool, "Whether both agree, and the second one's frame is where the wire puts it."]
    apart_cycles: Annotated[float | None, "How far the second one's frame is from there, if that is known."]
    allowed_cycles: Annotated[float, "What a sample and the tolerance of an edge account for."]
    chips: Annotated[list[CaptureVerdictAnswer], "The verdict on each."]


class ClauseAnswer(TypedDict):
    """What a run or a recording shows of one clause."""

    clause: Annotated[str, "The clause."]
    line: Annotated[int | None, "Its line in the contract."]
    verdict: Annotated[str, "The verdict in words."]
    seen: Annotated[int, "How often it applied."]
    breaches: Annotated[int, "How often it was violated."]
    first_breach_cycle: Annotated[int | None, "When first, in cycles."]
    first_breach_us: Annotated[float | None, "The same in microseconds."]
    message: Annotated[str | None, "What was wrong then."]


class ContractVerdictAnswer(TypedDict):
    """What a run or a recording shows of a contract."""

    verdict: Annotated[str, '"kept", "violated" or "not seen".']
    exact: Annotated[bool, "Whether one run of the simulator shows every clause kept."]
    agrees: Annotated[bool, "Whether a capture does."]
    clock_hz: Annotated[int, "The chip's clock."]
    end_cycle: Annotated[int, "Where the run or the recording ends."]
    clauses: Annotated[list[ClauseAnswer], "Each clause."]
    not_judged: Annotated[list[str], "What it cannot show."]


class VerifyContractAnswer(ContractVerdictAnswer):
    """`verify --contract`."""

    file: Annotated[str, "The program or the recording."]
    contract: Annotated[str, "The contract."]


class PulseRunAnswer(TypedDict):
    """Consecutive pulses of one width."""

    first_cycle: Annotated[int, "The first rise since reset."]
    pulses: Annotated[int, "How many."]
    width_cycles: Annotated[int, "Their width."]
    shortest_period_cycles: Annotated[int | None, "The shortest time from rise to rise among them."]
    longest_period_cycles: Annotated[int | None, "The longest one."]


class FrameKindAnswer(TypedDict):
    """The frames of one width."""

    width_cycles: Annotated[int, "The width."]
    frames: Annotated[int, "How many."]
    period_cycles: Annotated[int, "Their most frequent length."]


class PauseAnswer(TypedDict):
    """Times without pulses."""

    begin_cycle: Annotated[int, "The fall before the first, since reset."]
    length_cycles: Annotated[int, "How long each is."]
    count: Annotated[int, "How many follow each other."]


class WidthCount(TypedDict):
    """How many pulses have a width."""

    cycles: Annotated[int, "The width."]
    pulses: Annotated[int, "How many."]


class PeriodCount(TypedDict):
    """How many frames have a length."""

    cycles: Annotated[int, "The length."]
    frames: Annotated[int, "How many."]


class PinAnswer(TypedDict):
    """The pulses of one pin."""

    pin: Annotated[str, "The pin."]
    pulses: Annotated[int, "Complete pulses."]
    first_cycle: Annotated[int, "The first rise since reset."]
    widths: Annotated[list[WidthCount], "Their widths."]
    periods: Annotated[list[PeriodCount], "The times from rise to rise, without pauses."]
    period_cycles: Annotated[int | None, "The median one."]
    frame_kinds: Annotated[list[FrameKindAnswer], "The kinds of frame."]
    frame_difference_cycles: Annotated[int, "By how much they differ in length."]
    pauses: Annotated[list[PauseAnswer], "Longer times without pulses."]
    runs: Annotated[list[PulseRunAnswer], "The pulses in order."]
    open_rise_cycle: Annotated[int | None, "The rise of a pulse that the end cuts off."]


class MeasureAnswer(TypedDict):
    """`measure`."""

    clock_hz: Annotated[int, "The chip's clock."]
    end_cycle: Annotated[int, "Where the measurement ends."]
    complete: Annotated[bool, "Whether that is the end of the run or the recording."]
    pins: Annotated[list[PinAnswer], "Each pin that pulses."]
    overlap: Annotated[OverlapAnswer | None, "Pins high together."]


class CheckAnswer(TypedDict):
    """`check`."""

    job: Annotated[str, "The job's name."]
    device: Annotated[str, "The chip."]
    clock_hz: Annotated[int, "Its clock."]
    period_cycles: Annotated[int, "The length of a frame."]
    lead_in_frames: Annotated[int, "Frames before the loop."]
    loop_frames: Annotated[int, "Frames of the loop."]
    plan_error: Annotated[PlanErrorAnswer | None, "How far the pulses are from the plan."]
    widths: Annotated[list[WidthAnswer], "The widths of each servo."]


class PairCheckAnswer(TypedDict):
    """`check` of a job of two chips."""

    job: Annotated[str, "The job's name."]
    chips: Annotated[list[CheckAnswer], "The plan of each."]


class ServoFactsAnswer(TypedDict):
    """A servo in a plan."""

    name: Annotated[str, "The servo."]
    pin: Annotated[str, "Its pin."]
    model: Annotated[str, "Its model."]
    continuous: Annotated[bool, "Whether its width is a speed."]
    minimum_deg: Annotated[float, "Its least angle."]
    maximum_deg: Annotated[float, "Its greatest angle."]
    lower_limit_deg: Annotated[float, "The least one allowed."]
    upper_limit_deg: Annotated[float, "The greatest one allowed."]
    peak_speed_deg_s: Annotated[float | None, "Its highest speed on a ramp."]
    peak_speed_frame: Annotated[int | None, "The frame that it leads to."]
    speed_limit_deg_s: Annotated[float | None, "The speed of its model."]
    largest_step_deg: Annotated[float | None, "Its greatest step."]
    step_needs_s: Annotated[float | None, "The time that the servo needs for it."]
    step_has_s: Annotated[float | None, "The time that it has."]


class EndErrorAnswer(TypedDict):
    """The error at a foot, tool or base."""

    worst_m: Annotated[float, "The largest distance."]
    rms_m: Annotated[float, "The root mean square distance."]
    frame: Annotated[int, "The frame of the largest."]
    jacobian_worst_m: Annotated[float, "The largest one to first order."]
    jacobian_rms_m: Annotated[float, "The root mean square one to first order."]


class TimedEndErrorAnswer(EndErrorAnswer):
    """The same with its time."""

    time_s: Annotated[float, "When it is largest."]


class EndAnswer(TypedDict):
    """A foot, tool or base in a plan."""

    name: Annotated[str, "Its name."]
    kind: Annotated[str, '"foot", "tool" or "base".']
    minimum_m: Annotated[list[float], "The least x, y, z."]
    maximum_m: Annotated[list[float], "The greatest x, y, z."]
    error: Annotated[TimedEndErrorAnswer, "The error of its pulses."]


class WayAnswer(TypedDict):
    """The way of a body."""

    forward_m: Annotated[float, "Forward."]
    left_m: Annotated[float, "To the left."]
    turn_deg: Annotated[float, "Counter-clockwise."]


class HornAnswer(TypedDict):
    """Which part of its travel a servo uses."""

    servo: Annotated[str, "The servo."]
    used_deg: Annotated[list[float], "From and to."]
    whole_deg: Annotated[list[float], "From and to, of the whole travel."]
    zero_deg: Annotated[float, "The job's."]
    spline_teeth: Annotated[int, "The teeth of its spline: a horn goes on in steps of 360° / teeth."]
    centred_zero_deg: Annotated[float, "The zero on the tooth that centres best what is used."]
    off_centre_deg: Annotated[float, "How far what is used is then from the middle of the travel."]


class PlanFactsAnswer(TypedDict):
    """The facts of a plan."""

    job: Annotated[str, "The job's name."]
    device: Annotated[str, "The chip."]
    clock_hz: Annotated[int, "Its clock."]
    period_s: Annotated[float, "The length of a frame."]
    lead_in_frames: Annotated[int, "Frames before the loop."]
    loop_frames: Annotated[int, "Frames of the loop."]
    lead_in_s: Annotated[float, "How long they take."]
    loop_s: Annotated[float, "How long the loop takes."]
    servos: Annotated[list[ServoFactsAnswer], "Each servo."]
    error_of: Annotated[str, 'Whether errors are those of "rounding" or of the "engine".']
    ends: Annotated[list[EndAnswer], "Each foot, tool or base."]
    rigid_legs_end: Annotated[
        WayAnswer | None,
        "Where rigid legs take a walking body in each loop, or in the whole of a motion that ends.",
    ]


class PlanAnswer(PlanFactsAnswer):
    """`plan`."""

    horns: Annotated[list[HornAnswer], "The servos that turn joints."]


class ScriptAnswer(TypedDict):
    """Where a script is stored."""

    flash_bytes: Annotated[int, "Bytes in flash."]
    eeprom_bytes: Annotated[int, "Bytes in the EEPROM."]
    eeprom_first: Annotated[int | None, "The first of those."]


class RoomAnswer(TypedDict):
    """The time that C has between two pulses."""

    between: Annotated[str, "Between which."]
    worst_cycles: Annotated[int | None, "The time of the C at most, if it has a bound."]
    room_cycles: Annotated[int, "The time that it has."]
    left_cycles: Annotated[int | None, "What is left."]
    late_is_seen_up_to_cycles: Annotated[int | None, "Up to where the program notices that it is late."]


class ProgramAnswer(TypedDict):
    """A program of a build."""

    dialect: Annotated[str, "The dialect of its C."]
    words: Annotated[int, "Its words."]
    words_left: Annotated[int, "What is left of 1024."]
    ram_bytes: Annotated[int, "Its bytes of RAM."]
    ram_left: Annotated[int, "What is left of 68."]
    script: Annotated[ScriptAnswer | None, "Where its script is."]
    c_between_pulses: Annotated[list[RoomAnswer], "The times of its C."]
    overrun_cycle: Annotated[int | None, "Where its C was first late."]
    exact: Annotated[bool, "Whether its edges are exact in one run."]
    verdict: Annotated[VerdictAnswer, "The verdict on them."]


class BuildFactsAnswer(TypedDict):
    """The facts of a build."""

    job: Annotated[str, "The job's name."]
    exact: Annotated[bool, "Whether every program is exact in one run."]
    frames: Annotated[int, "Frames compared."]
    plan_error: Annotated[PlanErrorAnswer | None, "How far the schedule is from its plan."]
    widths: Annotated[list[WidthAnswer], "The widths of each servo."]
    programs: Annotated[list[ProgramAnswer], "The program of each dialect."]


class BuildAnswer(BuildFactsAnswer):
    """`build`."""

    folder: Annotated[str, "What it wrote to."]
    proven: Annotated[bool, "Whether every program is proven for every power-up, input and chip."]
    all_runs: Annotated[list[str], "What is known of each for all runs."]


class PairBuildFacts(TypedDict):
    """The builds of both chips of a job."""

    job: Annotated[str, "The job's name."]
    exact: Annotated[bool, "Whether every program is exact in one run."]
    chips: Annotated[list[BuildFactsAnswer], "The build of each."]
    pairs: Annotated[dict[str, PairVerdictAnswer], "The verdict on both, by dialect."]


class PairProofFacts(TypedDict):
    """What is proven of two chips, and of both together."""

    answer: Annotated[str, '"proven", or why it is not.']
    proven: Annotated[bool, "Whether it is proven and checked."]
    misfits: Annotated[list[str], "Why what is proven of each makes no theorem about both."]
    second_begins_late_cycles: Annotated[
        int | None, "By how much the second chip may begin later; null: at any time."
    ]
    chips: Annotated[list[str], "What is proven of each."]


class PairProofAnswer(PairProofFacts):
    """`prove` of the job or the build of two chips."""

    file: Annotated[str, "The job, or the folder of the build."]


class PairBuildAnswer(PairBuildFacts):
    """`build` of a job of two chips."""

    folder: Annotated[str, "What it wrote to."]
    proofs: NotRequired[Annotated[dict[str, PairProofFacts], "With `--prove`: what is proven, by dialect."]]


class DemoAnswer(TypedDict):
    """`demo`."""

    jobs: Annotated[list[BuildAnswer], "The build of each job."]


class TwinCheckAnswer(TypedDict):
    """One expectation of the twin; what it measures has the unit in its name."""

    name: Annotated[str, "The expectation."]
    measured_mm: NotRequired[Annotated[float | None, "What was measured."]]
    measured_deg: NotRequired[Annotated[float | None, "What was measured."]]
    measured_nm: NotRequired[Annotated[float | None, "What was measured."]]
    measured_a: NotRequired[Annotated[float | None, "What was measured."]]
    measured_s: NotRequired[Annotated[float | None, "What was measured."]]
    measured_count: NotRequired[Annotated[float | None, "What was measured."]]
    allowed_mm: NotRequired[Annotated[float, "What is allowed."]]
    allowed_deg: NotRequired[Annotated[float, "What is allowed."]]
    allowed_nm: NotRequired[Annotated[float, "What is allowed."]]
    allowed_a: NotRequired[Annotated[float, "What is allowed."]]
    allowed_s: NotRequired[Annotated[float, "What is allowed."]]
    allowed_count: NotRequired[Annotated[float, "What is allowed."]]
    passed: Annotated[bool, "Whether it is met."]
    seconds: Annotated[float | None, "Since when it is not."]


class TwinEvent(TypedDict):
    """Something that happened in the twin."""

    seconds: Annotated[float, "When."]
    kind: Annotated[str, "What kind it is."]
    text: Annotated[str, "What happened."]


class TwinVerdictAnswer(TypedDict):
    """What the robot of the physics does beside its plan."""

    verdict: Annotated[str, "The verdict in words."]
    passed: Annotated[bool, "Whether every expectation is met."]
    missed: Annotated[str | None, "Which is not."]
    asked: Annotated[WayAnswer | None, "The way that the job asks for."]
    rigid_legs: Annotated[WayAnswer | None, "The way of rigid legs."]
    simulated: Annotated[WayAnswer, "The way of the simulated robot."]
    drag_m: Annotated[float, "How far a foot on the ground slid."]
    drag_leg: Annotated[str | None, "Which one."]
    tool_error_m: Annotated[float | None, "The largest error of the tool."]
    tool_rest_error_m: Annotated[float | None, "The largest one where it stands."]
    minimum_height_m: Annotated[float | None, "The least height of the body."]
    torque_nm: Annotated[dict[str, float], "The largest torque of each servo."]
    current_a: Annotated[float, "The largest current of all servos."]
    voltage_v: Annotated[float, "The least voltage of the supply."]
    charge_as: Annotated[float, "The charge that was used."]
    seconds: Annotated[float, "The simulated time."]
    motion_s: Annotated[list[float], "From when to when the motion was."]
    not_guaranteed_from_s: Annotated[float | None, "From when on the chip's voltage is too low."]
    checks: Annotated[list[TwinCheckAnswer], "Each expectation."]
    events: Annotated[list[TwinEvent], "What happened."]
    assumptions: Annotated[list[str], "What is assumed of robot and servos."]


class TwinAnswer(TwinVerdictAnswer):
    """`twin`."""

    job: Annotated[str, "The job's name."]


class ReportFactsAnswer(TypedDict):
    """The verdicts of a report."""

    exact: Annotated[bool, "Whether every program is exact in one run."]
    plan_error: Annotated[PlanErrorAnswer | None, "How far the schedule is from its plan."]
    capture: Annotated[CaptureVerdictAnswer | None, "The verdict on the capture."]
    twin: Annotated[TwinVerdictAnswer | None, "The verdict of the twin."]


class ReportAnswer(ReportFactsAnswer):
    """`report`."""

    file: Annotated[str, "The page."]


class PairReportAnswer(PairBuildFacts):
    """`report` of a job of two chips."""

    file: Annotated[str, "The page."]


class AddedAnswer(TypedDict):
    """What another compiler takes beside the delays."""

    path: Annotated[str, "Between which edges."]
    their_cycles: Annotated[int, "The other compiler's time."]
    servogen_cycles: Annotated[int, "That of servogen's."]


class TunedAnswer(TypedDict):
    """The result of tuning."""

    exact: Annotated[bool, "Whether the HEX is exact."]
    added: Annotated[list[AddedAnswer], "The time on each path."]
    verdict: Annotated[VerdictAnswer, "The verdict on the HEX."]


class TuneAnswer(TunedAnswer):
    """`tune`."""

    job: Annotated[str, "The job's name."]
    dialect: Annotated[str, "The dialect of the C."]
    next_c: Annotated[str | None, "The C to compile next."]


class CompileAnswer(TypedDict):
    """`compile`."""

    hex: Annotated[str, "The program."]
    dialect: Annotated[str, "The dialect of the C."]
    words: Annotated[int, "Its words."]
    ram_bytes: Annotated[int, "Its bytes of RAM."]
    clock_hz: Annotated[int | None, "The clock that the C states."]
    saved_by_pass: Annotated[dict[str, int], "The words that each pass of the compiler saved."]
    ir: NotRequired[Annotated[str, "The intermediate form."]]


class LineProfile(TypedDict):
    """The time in a line."""

    file: Annotated[str, "The file."]
    line: Annotated[int, "The line."]
    cycles: Annotated[int, "The time."]
    executions: Annotated[int, "How many instructions were executed."]


class ProfileAnswer(TypedDict):
    """Where a program's time was spent."""

    cycles: Annotated[int, "The time."]
    idle_cycles: Annotated[int, "The part of it in SLEEP."]
    coverage: Annotated[float, "The part of the program's words that were executed."]
    unexecuted: Annotated[list[int], "The addresses of the others."]
    function_cycles: Annotated[dict[str, int], "The time of each function."]
    lines: Annotated[list[LineProfile], "The time of each line."]
    deepest_stack: Annotated[int, "The most return addresses."]
    ram_high_water: Annotated[int, "Bytes of RAM that were written."]
    read_unwritten: Annotated[list[int], "Registers that were read before they were written."]


class StateAnswer(TypedDict):
    """The state of the chip after a run."""

    cycles: Annotated[int, "The time since reset."]
    pc: Annotated[int, "The program counter."]
    w: Annotated[int, "W."]
    status: Annotated[int, "STATUS."]
    ram: Annotated[list[int], "The general purpose registers."]
    registers: Annotated[dict[str, int], "The special function registers."]
    eeprom: Annotated[list[int], "The data EEPROM."]
    resets: Annotated[dict[str, int], "How many resets of each cause there were."]
    stack_wraps: Annotated[int, "How often the stack wrapped."]
    deepest_stack: Annotated[int, "The most return addresses."]
    edges: Annotated[int, "Changes of the pins."]
    sleeping: Annotated[bool, "Whether it is in SLEEP."]


class SimulateAnswer(StateAnswer):
    """`simulate`."""

    profile: NotRequired[Annotated[ProfileAnswer, "Where the time was spent."]]


class FindingAnswer(TypedDict):
    """A place that a question was answered by."""

    address: Annotated[int, "The word of the program."]
    source: Annotated[str | None, "Its file and line."]
    text: Annotated[str, "What is there."]


class FactAnswer(TypedDict):
    """The answer to a question about every path of a program."""

    question: Annotated[str, "The question."]
    status: Annotated[str, "Whether it is decided."]
    text: Annotated[str, "The answer."]
    over: Annotated[str, "The cases for which it holds."]
    findings: Annotated[list[FindingAnswer], "Where."]
    levels: NotRequired[Annotated[int | None, "Return addresses on the stack."]]
    unreachable_words: NotRequired[Annotated[int | None, "Words that nothing reaches."]]
    cycles: NotRequired[Annotated[int | None, "The longest time between two clears of the watchdog."]]
    minimum_cycles: NotRequired[Annotated[int | None, "The least time."]]
    maximum_cycles: NotRequired[Annotated[int | None, "The greatest time."]]


class FactsAnswer(TypedDict):
    """`prove`."""

    file: Annotated[str, "The program."]
    answers: Annotated[list[FactAnswer], "Each answer."]


class CheckedAnswer(TypedDict):
    """What the checker of certificates checked."""

    states: Annotated[int, "Listed states."]
    frames: Annotated[int, "Frames that it ran."]
    cycles: Annotated[int, "Cycles that it ran."]
    forks: Annotated[int, "Ways that were split."]
    over: Annotated[list[str], "What the theorem is over."]
    restrictions: Annotated[list[str], "The pins for whose held level alone it was checked."]


class CounterexampleAnswer(TypedDict):
    """A run that is not as claimed."""

    message: Annotated[str, "What is wrong."]
    cycle: Annotated[int, "When, since reset."]
    command: Annotated[str, "The command that shows it."]
    stimulus: Annotated[str | None, "Its inputs."]
    eeprom: NotRequired[Annotated[dict[str, int] | None, "Its content of the EEPROM."]]


class ProofAnswer(TypedDict):
    """`prove --against`."""

    file: Annotated[str, "The program."]
    answer: Annotated[str, '"proven", "counterexample", "not decided", or that one engine shows it.']
    reason: Annotated[str, "Why it is not decided."]
    states: Annotated[int, "States that were searched."]
    runs: Annotated[int, "Runs between them."]
    cycles: Annotated[int, "Their time together."]
    checked: Annotated[CheckedAnswer | None, "What the checker checked."]
    not_covered: Annotated[str, "What the checker does not cover."]
    any_line: NotRequired[Annotated[list[str], "What holds for every waveform on the line."]]
    assumptions: Annotated[list[str], "What is assumed."]
    counterexample: Annotated[CounterexampleAnswer | None, "A run that is not the schedule's."]


class ContractProofAnswer(TypedDict):
    """`prove --contract`."""

    file: Annotated[str, "The program."]
    contract: Annotated[str, "The contract."]
    proven: Annotated[bool, "Whether one engine shows that every clause is kept."]
    checked: Annotated[bool, "Whether the checker shows it, too."]
    reason: Annotated[str, "Why it is not decided, or not checked."]
    counterexample: Annotated[CounterexampleAnswer | None, "A run that violates it."]
    states: Annotated[int, "States that were searched."]
    runs: Annotated[int, "Runs between them."]
    simulated_cycles: Annotated[int, "Their time together."]
    assumptions: Annotated[list[str], "What is assumed."]


class ValidCertificate(CheckedAnswer):
    """`check-certificate` of a valid one."""

    valid: Annotated[Literal[True], "It proves that every edge is the schedule's."]
    held: Annotated[dict[str, int], "The level at which inputs are held in it."]


class RefusedCertificate(TypedDict):
    """`check-certificate` of another one."""

    valid: Annotated[Literal[False], "It proves nothing."]
    covered: Annotated[bool, "Whether the checker covers it."]
    reason: Annotated[str, "Why it is refused."]
    held: Annotated[dict[str, int], "The level at which inputs are held in it."]


class RobotFacts(TypedDict):
    """What every robot has."""

    name: Annotated[str, "Its short name."]
    title: Annotated[str, "What it is."]
    kind: Annotated[str, "The kind of its file."]
    dimensions: Annotated[str, "Whether its dimensions are given or assumed."]
    source: Annotated[str, "Where they come from."]


class RobotEntry(RobotFacts):
    """A robot of the catalogue."""

    joints: Annotated[int, "The number of joints or wheels that are driven."]


class RobotsAnswer(TypedDict):
    """`robots`."""

    robots: Annotated[list[RobotEntry], "Each robot of the catalogue."]


class JointFactsAnswer(TypedDict):
    """A joint; what turns has degrees, what slides metres."""

    name: Annotated[str, "The joint."]
    kind: Annotated[str, '"turning" or "sliding".']
    lower_deg: NotRequired[Annotated[float, "Its lower limit."]]
    upper_deg: NotRequired[Annotated[float, "Its upper limit."]]
    home_deg: NotRequired[Annotated[float, "Its home position."]]
    speed_deg_s: NotRequired[Annotated[float | None, "Its speed."]]
    lower_m: NotRequired[Annotated[float, "Its lower limit."]]
    upper_m: NotRequired[Annotated[float, "Its upper limit."]]
    home_m: NotRequired[Annotated[float, "Its home position."]]
    speed_m_s: NotRequired[Annotated[float | None, "Its speed."]]


class DhRow(TypedDict):
    """A row of the Denavit-Hartenberg table."""

    joint: Annotated[str | None, "The joint that moves it."]
    ratio: Annotated[float, "How far it turns or slides for one of the joint's."]
    theta_deg: Annotated[float, "θ."]
    d: Annotated[str, "d, as in the robot's file."]
    a: Annotated[str, "a, as in the robot's file."]
    alpha_deg: Annotated[float, "α."]


class FrameAnswer(TypedDict):
    """A fixed frame."""

    position_m: Annotated[list[float], "x, y, z."]
    rz_ry_rx_deg: Annotated[list[float], "Its rotations about z, y and x."]


class ArmFacts(TypedDict):
    """What every arm and leg has."""

    convention: Annotated[str, "The convention of its table."]
    closed_form: Annotated[str, "Its inverse kinematics."]
    target: Annotated[list[str], "What `ik` takes."]
    lengths_m: Annotated[dict[str, float], "Its lengths."]
    joints: Annotated[list[JointFactsAnswer], "Its joints."]
    rows: Annotated[list[DhRow], "Its table."]
    base: Annotated[FrameAnswer, "The frame before the first row."]
    tool: Annotated[FrameAnswer, "The frame after the last row."]


class ArmAnswer(RobotFacts, ArmFacts):
    """`robots` of an arm."""


class MountAnswer(TypedDict):
    """Where a leg is mounted."""

    name: Annotated[str, "The leg."]
    position_m: Annotated[list[float], "x, y, z in the body."]
    heading_deg: Annotated[float, "Where it points to."]
    mirrored: Annotated[bool, "Whether it is the mirror image."]


class HexapodAnswer(RobotFacts):
    """`robots` of a walking robot."""

    mounts: Annotated[list[MountAnswer], "Its legs."]
    centre_of_mass_m: Annotated[list[float], "x, y, z in the body."]
    leg: Annotated[ArmFacts, "Each leg."]


class WheelsRow(TypedDict):
    """What wheels of equal speed do."""

    wheels: Annotated[list[str], "The direction of each."]
    motion: Annotated[str, "How the base moves."]
    direction_deg: Annotated[int | None, "Where to."]
    turning: Annotated[int, "1: counter-clockwise, -1: clockwise, 0: not at all."]
    radius_in_wheel_distances: Annotated[int | None, "The radius of the circle."]
    size: Annotated[str | None, "The circle in words."]


class OmniAnswer(RobotFacts):
    """`robots` of a base on wheels."""

    wheel_radius_m: Annotated[float, "The radius of its wheels."]
    wheel_distance_m: Annotated[float, "Their distance from its middle."]
    gear: Annotated[float, "Turns of a motor for one of its wheel."]
    counts_per_turn: Annotated[int, "Counts of an encoder for one turn of its motor."]
    sensor_angles_deg: Annotated[list[float], "Where its sensors point to."]
    table: Annotated[list[WheelsRow], "Its motions with wheels of equal speed."]


class ServoEntry(TypedDict):
    """A servo of the catalogue."""

    name: Annotated[str, "Its short name."]
    supply_v: Annotated[float, "The voltage of its figures."]
    speed_deg_s: Annotated[float | None, "Its speed."]
    torque_ncm: Annotated[float | None, "Its torque."]
    mass_g: Annotated[float | None, "Its mass."]
    title: Annotated[str, "What it is."]


class ServosAnswer(TypedDict):
    """`servos`."""

    servos: Annotated[list[ServoEntry], "Each servo of the catalogue."]


class FigureAnswer(TypedDict):
    """A figure of a servo."""

    key: Annotated[str, "Its key in the servo's file."]
    value: Annotated[str, "The figure with its unit."]
    origin: Annotated[str, "Whether it is the maker's, a seller's or assumed."]
    source: Annotated[str, "Where it stands."]


class ServoAnswer(TypedDict):
    """`servos` of one."""

    name: Annotated[str, "Its short name."]
    title: Annotated[str, "What it is."]
    figures: Annotated[list[FigureAnswer], "Each figure."]


class ArmPose(TypedDict):
    """`fk` of an arm."""

    position_m: Annotated[list[float], "The tool."]
    rotation: Annotated[list[list[float]], "Its orientation."]
    configuration_vector: Annotated[list[float] | None, "Metres, and the approach vector times e^(roll/π)."]
    beyond_limits: Annotated[list[str], "Joints that are beyond their limits."]


class FeetAnswer(TypedDict):
    """`fk` of a walking robot."""

    feet_m: Annotated[dict[str, list[float]], "Each foot in the body."]


class BodySpeed(TypedDict):
    """`fk` of a base on wheels."""

    vx_m_s: Annotated[float, "Forward."]
    vy_m_s: Annotated[float, "To the left."]
    turn_deg_s: Annotated[float, "Counter-clockwise."]
    speed_m_s: Annotated[float, "How fast."]
    direction_deg: Annotated[float | None, "Where to."]
    radius_m: Annotated[float | None, "The radius of its circle."]


class SymbolicPose(TypedDict):
    """`fk --symbolic`."""

    links: Annotated[list[str], "The matrix of each link."]
    product: Annotated[str, "Their product."]
    position: Annotated[str, "The tool."]


class SolutionsAnswer(TypedDict):
    """`ik` of an arm."""

    solutions: Annotated[list[dict[str, float]], "Joint positions, each with its unit in its name."]
    found: Annotated[int, "How many solutions there are."]
    free: Annotated[list[str], "Joints that can move while the tool stays."]
    complete: Annotated[bool, "Whether these are all solutions."]
    missed_m: Annotated[float, "The distance from the target."]


class WheelSpeeds(TypedDict):
    """`ik` of a base on wheels."""

    wheel_speeds_deg_s: Annotated[list[float], "Each wheel."]
    rim_speeds_m_s: NotRequired[Annotated[list[float], "Their rims."]]
    motor_turns_per_s: NotRequired[Annotated[list[float], "Their motors."]]
    encoder_counts_per_s: NotRequired[Annotated[list[float], "Their encoders."]]


class JacobianAnswer(TypedDict):
    """`jacobian` of an arm."""

    frame: Annotated[int | str, "The frame of reference."]
    jacobian: Annotated[list[list[float]], "The matrix."]
    velocity_m_s: NotRequired[Annotated[list[float], "The tool's velocity."]]
    angular_velocity_deg_s: NotRequired[Annotated[list[float], "Its angular velocity."]]
    manipulability: Annotated[float, "√det(J Jᵀ)."]
    rank: Annotated[int, "The rank."]
    singular: Annotated[bool, "Whether it is less than it can be."]
    lost_directions: Annotated[list[list[float]], "Where the tool cannot move to."]


class BaseJacobian(TypedDict):
    """`jacobian` of a base on wheels."""

    frame: Annotated[int | str, "The frame of reference."]
    jacobian: Annotated[list[list[float]], "The matrix from wheel speeds to vx, vy, Ω."]
    inverse: Annotated[list[list[float]], "Its inverse."]
    rank: Annotated[int, "The rank."]


class SymbolicJacobian(TypedDict):
    """`jacobian --symbolic`."""

    frame: Annotated[int | str, "The frame of reference."]
    jacobian: Annotated[str, "The matrix."]


class JointLoad(TypedDict):
    """The load of a joint; of what turns a torque, of what slides a force."""

    name: Annotated[str, "The joint."]
    load_nm: NotRequired[Annotated[float, "What force and moment put on it."]]
    weight_nm: NotRequired[Annotated[float, "What holds its links."]]
    motor_nm: NotRequired[Annotated[float, "What its motor gives."]]
    load_n: NotRequired[Annotated[float, "What force and moment put on it."]]
    weight_n: NotRequired[Annotated[float, "What holds its links."]]
    motor_n: NotRequired[Annotated[float, "What its motor gives."]]


class StaticsAnswer(TypedDict):
    """`statics`."""

    joints: Annotated[list[JointLoad], "Each joint."]
    beyond_limits: Annotated[list[str], "Joints that are beyond their limits."]


class MobilityAnswer(TypedDict):
    """`mobility`."""

    elements: Annotated[int, "The elements, with the base."]
    joints: Annotated[list[str], "The kind of each joint."]
    closed_loops: Annotated[int, "Closed loops."]
    passive_joints: Annotated[int, "Joints that are not driven."]
    mobility: Annotated[int, "The mobility M."]
    manoeuvrability: Annotated[int, "M - 6."]
    verdict: Annotated[str, "What that means."]
    note: Annotated[str, "What is to be known of it."]


class TransformAnswer(TypedDict):
    """`transform`."""

    matrix: Annotated[list[list[float]], "The product."]
    point: NotRequired[Annotated[list[float], "Where it moves the point."]]


class OrientationAnswer(TypedDict):
    """`orientation`."""

    angles_deg: Annotated[dict[str, list[float]], "The angles in each order."]
    second_deg: Annotated[dict[str, list[float]], "The other solution in each order."]
    axis: Annotated[list[float], "The axis."]
    angle_deg: Annotated[float, "The angle about it."]
    quaternion: Annotated[list[float], "w, x, y, z."]
    matrix: Annotated[list[list[float]], "The rotation."]


class SmallMotion(TypedDict):
    """A small motion."""

    translation: Annotated[list[float], "d, in the product's unit of length."]
    rotation_rad: Annotated[list[float], "δ."]


class DifferentialAnswer(TypedDict):
    """`differential`."""

    matrix: Annotated[list[list[float]], "T."]
    delta: Annotated[list[list[float]], "Δ."]
    change: Annotated[list[list[float]], "dT."]
    fixed: Annotated[SmallMotion, "The motion along the fixed axes."]
    moving: Annotated[SmallMotion, "The same along the axes of T."]


class EquationAnswer(TypedDict):
    """`equation`."""

    amplitude: Annotated[float, "√(a² + b²)."]
    solutions_deg: Annotated[list[float], "Every x in (-180°, 180°]."]
    every_angle: Annotated[bool, "Whether every x is a solution."]


class PhaseChangeAnswer(TypedDict):
    """A time of a gait that was rounded to frames."""

    what: Annotated[str, "Which."]
    asked: Annotated[float, "The part of a cycle that was asked for."]
    used: Annotated[float, "The part that is used."]
    frames: Annotated[float, "The frames of what was asked for."]


class StabilityAnswer(TypedDict):
    """Where a walk is least stable."""

    minimum_m: Annotated[float | None, "The least margin."]
    frame: Annotated[int, "The frame."]
    feet: Annotated[list[str], "The feet on the ground."]


class LegFigure(TypedDict):
    """The largest of a figure of the legs."""

    largest_m: Annotated[float, "The figure."]
    leg: Annotated[str, "The leg."]
    frame: Annotated[int, "The frame."]


class LostMotion(TypedDict):
    """What a slack of the servos takes."""

    angle_deg: Annotated[float, "The slack."]
    swing_beyond: Annotated[float, "The part of the swing beyond it."]


class HeldBackAnswer(TypedDict):
    """A servo that is held back."""

    leg: Annotated[str, "The leg."]
    angle_deg: Annotated[float, "By how much."]


class TorqueAnswer(TypedDict):
    """The largest torque of a walk."""

    largest_nm: Annotated[float, "The torque."]
    leg: Annotated[str, "The leg."]
    frame: Annotated[int, "The frame."]
    foot_n: Annotated[float, "The force on its foot."]


class JointRange(TypedDict):
    """A joint of a walk."""

    name: Annotated[str, "The joint."]
    minimum_deg: Annotated[float, "Its least angle."]
    maximum_deg: Annotated[float, "Its greatest angle."]
    lower_limit_deg: Annotated[float, "The least one allowed."]
    upper_limit_deg: Annotated[float, "The greatest one allowed."]
    peak_speed_deg_s: Annotated[float, "Its highest speed."]


class GaitAnswer(TypedDict):
    """`gait`."""

    robot: Annotated[str, "The robot."]
    gait: Annotated[str, "The gait."]
    duty: Annotated[float, "The part of a cycle that a foot is on the ground."]
    lifts: Annotated[dict[str, float], "When each foot is lifted, as a part of the cycle."]
    frames: Annotated[int, "Frames of the walk."]
    loop_start: Annotated[int, "The first frame of the loop."]
    frames_per_cycle: Annotated[int, "Frames of a cycle."]
    cycle_s: Annotated[float, "The time of a cycle."]
    phase_changes: Annotated[list[PhaseChangeAnswer], "Times that were rounded to frames."]
    stability: Annotated[StabilityAnswer | None, "Where it is least stable."]
    spring: Annotated[LegFigure, "Where a spring gives most."]
    slip: Annotated[LegFigure, "Where a foot slides most."]
    lost_motion: Annotated[LostMotion, "What the servos' slack takes."]
    centres_of_rotation_m: Annotated[list[list[float] | None], "x and y that the body turns about."]
    held_back: Annotated[list[HeldBackAnswer], "Servos that are held back."]
    first_millimetre_m: Annotated[float, "How far a foot slides in the first millimetre of its lift."]
    torque: Annotated[TorqueAnswer | None, "The largest torque."]
    lift_m: Annotated[float, "How high feet are lifted."]
    clearance_m: Annotated[float, "The least height of everything but the feet."]
    body_height_m: Annotated[float, "The height of the body."]
    joints: Annotated[list[JointRange], "Each joint."]


class ToolPoseAnswer(TypedDict):
    """A pose of the tool."""

    position_m: Annotated[list[float], "x, y, z."]
    pitch_deg: Annotated[float, "Its pitch."]
    roll_deg: Annotated[float, "Its roll."]


class StepAnswer(ToolPoseAnswer):
    """A move of an arm program."""

    line: Annotated[int | None, "The number of its line."]
    command: Annotated[str, "The command."]
    start_s: Annotated[float, "When it begins."]
    duration_s: Annotated[float, "How long it takes."]
    hand: Annotated[str, '"open" or "closed".']


class PortOutput(TypedDict):
    """What an arm program writes to its port."""

    time_s: Annotated[float, "When."]
    value: Annotated[int, "The value."]
    strobe: Annotated[bool, "Whether it is strobed."]


class ProgramRunAnswer(TypedDict):
    """A run of an arm program."""

    period_s: Annotated[float, "The length of a frame."]
    frames: Annotated[int, "Frames of the motion."]
    loop_start: Annotated[int, "The first frame of what repeats."]
    steps: Annotated[list[StepAnswer], "Each move."]
    outputs: Annotated[list[PortOutput], "What it writes to its port."]
    positions: Annotated[dict[str, ToolPoseAnswer], "Its stored positions, by number."]
    counters: Annotated[dict[str, int], "Its counters, by number."]


class RunProgramAnswer(ProgramRunAnswer):
    """`run-program`."""

    robot: Annotated[str, "The arm."]
    final_joints: Annotated[dict[str, float], "Joint positions at the end, each with its unit in its name."]


class PositionAnswer(TypedDict):
    """A position of the task, and how the program holds it."""

    position: Annotated[str, "The position."]
    visits: Annotated[int, "How often."]
    widths_us: Annotated[list[list[float]], "The shortest and the longest pulse of each servo."]
    angles_deg: Annotated[list[list[float]], "The angles of those."]
    periods_ms: Annotated[list[float] | None, "The shortest and the longest frame."]
    stays_s: Annotated[list[float] | None, "The shortest and the longest stay."]
    silent_s: Annotated[list[float] | None, "The shortest and the longest time without pulses."]
    asked_pause_s: Annotated[float | None, "The pause that the task requires."]


class GradeFacts(TypedDict):
    """What a program does beside its task."""

    lab: Annotated[str, "The lab."]
    passed: Annotated[bool, "Whether it does what the lab requires."]
    reasons: Annotated[list[str], "Why not, the most helpful one first."]
    remarks: Annotated[list[DiagnosticAnswer], "What is good to know."]
    pins: Annotated[dict[str, str], "The pin of each servo."]
    positions: Annotated[list[PositionAnswer], "Each position of the task."]
    seen: Annotated[str, "The program's order of positions."]
    watched_s: Annotated[float, "How long it was watched."]
    repeats: Annotated[bool, "Whether it was seen to go on endlessly."]
    chips: Annotated[int, "On how many different chips it was powered up."]


class PointsAnswer(TypedDict):
    """A check of a lab."""

    state: Annotated[str, "Whether it passed."]
    points: Annotated[float, "Its points."]
    max_points: Annotated[float, "The points that it can have."]


class GradedAnswer(GradeFacts):
    """A student's program."""

    program: Annotated[str, "Its name."]
    file: Annotated[str, "Its file."]
    points: Annotated[float, "Its points."]
    max_points: Annotated[float, "The points that it can have."]
    checks: Annotated[dict[str, PointsAnswer], "Each check."]
    page: NotRequired[Annotated[str, "Its page."]]


class GradeAnswer(TypedDict):
    """`grade`."""

    lab: Annotated[str, "The lab."]
    title: Annotated[str, "Its title."]
    task: Annotated[str, "Its task."]
    programs: Annotated[list[GradedAnswer], "Each program."]
    same_code: Annotated[list[list[str]], "Programs with the same machine code."]


class PortAnswer(TypedDict):
    """A serial port."""

    port: Annotated[str, "Its path."]
    description: Annotated[str, "What it is."]


class InputBoard(TypedDict):
    """An input board."""

    firmware: Annotated[str, "Its firmware."]
    pins: Annotated[int, "Its pins."]
    serial_ports: Annotated[list[int], "The numbers of its serial ports."]
    scheduler: Annotated[bool, "Whether it plays runs by its own clock."]


class DoctorAnswer(TypedDict):
    """`doctor`."""

    servogen: Annotated[str, "Its version."]
    python: Annotated[str, "The version of Python."]
    system: Annotated[str, "The system."]
    libraries: Annotated[dict[str, str], "The version of each library that is needed."]
    tools: Annotated[dict[str, str | None], "Where each tool is."]
    ports: Annotated[list[PortAnswer], "The serial ports."]
    inputs: NotRequired[Annotated[InputBoard, "The input board."]]


class DrivenPosition(TypedDict):
    """A line of `drive`: what is sent."""

    s: Annotated[float, "The time."]
    servo: NotRequired[Annotated[str, "The servo."]]
    number: NotRequired[Annotated[int, "Its number on the line."]]
    position: NotRequired[Annotated[int, "Its position on the line."]]
    width_us: NotRequired[Annotated[float, "The width."]]
    bytes: Annotated[str, "The bytes."]


class DriveCommand(TypedDict):
    """A line of `drive`: a command."""

    s: Annotated[float, "The time."]
    command: Annotated[str, "The command."]


class DriveEvent(TypedDict):
    """A line of `drive`: an event of the line."""

    s: Annotated[float, "The time."]
    event: Annotated[str, "The event."]
    text: NotRequired[Annotated[str, "Its reason."]]
    away_s: NotRequired[Annotated[float, "How long the line was gone."]]


class DriveAnswer(TypedDict):
    """`drive`."""

    seconds: Annotated[float, "How long it took."]
    moving_s: Annotated[float, "The part of it after the first pose."]
    commands: Annotated[int, "Positions that were sent."]
    rounds: Annotated[int, "Poses in which a servo changed."]
    slowest_s: Annotated[float, "The time of the slowest one."]
    outages: Annotated[int, "How often the port was gone."]
    away_s: Annotated[float, "For how long."]
    stopped: Annotated[bool, "Whether the robot was stopped."]
    poses_per_second: Annotated[float, "Poses a second while it moved."]


class CommandedFrameAnswer(TypedDict):
    """A line of `drive` of a robot that walks on command: what is new."""

    s: Annotated[float, "The time."]
    frame: Annotated[int, "The frame."]
    direction: Annotated[str, "Where it walks."]
    part: Annotated[str, "Which part of the walk it is."]
    widths_us: Annotated[dict[str, float], "The width of each servo."]


class CommandedAnswer(TypedDict):
    """`drive` of a robot that walks on command."""

    seconds: Annotated[float, "How long it took."]
    commands: Annotated[int, "Commands that were sent."]


class CalibrateAnswer(TypedDict):
    """`calibrate`."""

    file: Annotated[str, "The job or servo file that was written."]
    kept: Annotated[str | None, "Where its former content is."]
    zero_us: Annotated[float, "The width at 0°."]
    us_per_deg: Annotated[float, "The slope."]
    rms_deg: Annotated[float, "The root mean square residual."]
    worst_deg: Annotated[float, "The largest residual."]
    bend_us: Annotated[float, "How far the third point, where there is one, is off a straight line."]
    residuals_deg: Annotated[list[float], "Each residual."]
    taken_by_job: Annotated[bool, "Whether the job can use it."]


class DeviationPlace(TypedDict):
    """Where a motion differs from its recording most."""

    time_s: Annotated[float, "When."]
    file: Annotated[str | None, "The recording."]
    line: Annotated[int | None, "Its line."]
    key: Annotated[str | None, "Its key."]


class ServoDeviation(DeviationPlace):
    """A servo's difference from a recording."""

    servo: Annotated[str, "The servo."]
    error_deg: Annotated[float, "The angle."]
    error_us: Annotated[float, "The width."]


class EndDeviation(DeviationPlace):
    """A tool's or a foot's difference from a recording."""

    end: Annotated[str, "The tool or the foot."]
    error_mm: Annotated[float, "The distance."]


class ComparedMotion(TypedDict):
    """`import --against`."""

    within_max_error: Annotated[bool, "Whether every servo is within the job's max_error_us."]
    deviations: Annotated[list[ServoDeviation | EndDeviation], "Each servo, tool and foot."]


class ImportAnswer(ComparedMotion):
    """`import`."""

    file: Annotated[str, "The job."]
    poses: Annotated[int, "Its poses."]
    duration_s: Annotated[float, "How long the recording is."]


class CaptureAnswer(TypedDict):
    """`capture`."""

    file: Annotated[str, "The capture."]
    analyser: Annotated[str, "The logic analyser."]
    memory_bytes: Annotated[int, "Its memory."]
    samples_per_second: Annotated[int, "The sampling rate."]
    rle: Annotated[bool, "Whether it compressed equal samples."]
    seconds: Annotated[float, "How long it is."]
    captures: Annotated[int, "How many captures it consists of."]


class SigrokAnswer(TypedDict):
    """`capture --sigrok`."""

    file: Annotated[str, "The capture."]
    analyser: Annotated[str, "The driver."]
    samples_per_second: Annotated[float, "The sampling rate."]
    seconds: Annotated[float, "How long it is."]
    wanted_seconds: Annotated[float, "How long it was to be."]


class FlashCommand(TypedDict):
    """`flash --dry-run`."""

    command: Annotated[list[str], "The programmer's command."]
    programmer: Annotated[str, "The programmer."]


class FlashAnswer(TypedDict):
    """`flash`."""

    programmer: Annotated[str, "The programmer."]
    words: Annotated[int, "Words that were programmed."]
    compared: Annotated[list[str], "Memories that were read back and compared."]


class RigAnswer(TypedDict):
    """`rig`."""

    programmer: Annotated[str, "The programmer's port."]
    analyser: Annotated[str, "The analyser's port."]
    inputs: Annotated[str, "The input board's port."]
    serial: NotRequired[Annotated[str, "The serial line's port."]]
    programmer2: NotRequired[Annotated[str, "The port of the second chip's programmer."]]
    debugger: NotRequired[Annotated[str, "The address at which an editor attaches."]]


class ShareAnswer(TypedDict):
    """What a part of a motion takes of the player's tables."""

    part: Annotated[str, "The part."]
    bytes: Annotated[int, "Its bytes."]
    rows: Annotated[int, "Its rows."]
    script: Annotated[int, "Its bytes of the script."]
    timings: Annotated[int, "Its bytes of the timings."]
    laws: Annotated[int, "Its bytes of the laws."]
    error_us: Annotated[float | None, "Its largest error."]


class UseAnswer(TypedDict):
    """What a job takes of the chip."""

    motion_bytes: Annotated[int, "Bytes of its motion."]
    words: Annotated[int, "Words of its program."]
    error_us: Annotated[float, "Its error."]


class ProposalAnswer(UseAnswer):
    """A change with which a job fits."""

    change: Annotated[str, "The change."]


class SegmentAnswer(TypedDict):
    """A part of a motion that was left out."""

    segment: Annotated[str, "The part."]
    fits: Annotated[UseAnswer | None, "What the job takes without it, if it fits."]


class SlotAnswer(TypedDict):
    """A part of a frame."""

    servos: Annotated[list[str], "The servos whose pulses begin with it."]
    us: Annotated[float, "How long it is."]


class ShortestFrame(TypedDict):
    """What a frame needs at least, where that is too much."""

    slots: Annotated[list[SlotAnswer], "Its parts with pulses."]
    c_us: Annotated[float, "The time of its C."]
    minimum_us: Annotated[float, "Both together."]
    period_us: Annotated[float, "What the job allows."]


class AdviceAnswer(TypedDict):
    """Why a job does not fit, and what would."""

    parts: Annotated[list[ShareAnswer], "The parts of its motion."]
    motion_bytes: Annotated[int | None, "Bytes of its motion."]
    words: Annotated[int | None, "Words of its program."]
    frame: Annotated[ShortestFrame | None, "What a frame needs at least."]
    proposals: Annotated[list[ProposalAnswer], "Changes with which it fits."]
    segments: Annotated[list[SegmentAnswer], "What becomes of it without some part."]
    stopped_early: Annotated[bool, "Whether changes were not tried because time was up."]


class Refusal(TypedDict):
    """What every command prints instead if it fails."""

    advice: NotRequired[Annotated[AdviceAnswer, "Why a job does not fit, and what would."]]
    needed_words: NotRequired[Annotated[int, "Words that a program too large for flash needs."]]
