"""`servogen rig`: a simulated bench on pseudo-terminals."""

from __future__ import annotations

import shutil
import signal
import sys
import threading
from contextlib import ExitStack
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Annotated

import typer

from servogen.bench.analysers.sigrok import PROGRAM, c_compiler, modem_lines_library
from servogen.bench.inputs.wiring import input_wiring
from servogen.bench.virtual.analyser import AnalyserOptions
from servogen.bench.virtual.board import BoardOptions
from servogen.bench.virtual.chip import SecondChip
from servogen.bench.virtual.debugger import VirtualDebugger
from servogen.bench.virtual.rig import RigOptions, with_fault
from servogen.bench.virtual.rig import rig as opened
from servogen.cli.options import JobFile, Json, baud_option, sampling_rate_option
from servogen.cli.page_server import serving
from servogen.cli.show import as_json, status, warn
from servogen.drive.on_command import line_baud
from servogen.engines.board import board_of, equal_rates, paired_machine
from servogen.engines.inputs.commands import CommandLine
from servogen.engines.inputs.serial import Stream
from servogen.job import PlannedJob, load, plan_job
from servogen.pic.image import Image
from servogen.programs import Program
from servogen.pulse import PulseSchedule
from servogen.simulator import PairedMachine, Stimulus
from servogen.simulator.sources import pin_number
from servogen.workflows.engines import planned
from servogen.workflows.job_program import played_program, read_program
from servogen.workflows.pair import planned_pair, read_job_pair


@dataclass(frozen=True, slots=True)
class RigLine:
    """The simulated bench's serial line."""

    serial_pin: Annotated[
        str | None, "The pin that receives the serial line (default: the job's, or RB7)."
    ] = None
    serial_out: Annotated[str | None, "The pin on which the chip sends (default: the job's, or none)."] = None
    baud: Annotated[int | None, baud_option("the job's, or 2400")] = None
    inverted: Annotated[bool, "The serial line idles low."] = False


@dataclass(frozen=True, slots=True)
class BenchOptions:
    """The faults, the analyser and the input board of the simulated bench."""

    crystal_ppm: Annotated[float, "Error of the chip's crystal in ppm; positive if it is fast."] = 0.0
    memory: Annotated[int, typer.Option(min=16, help="The analyser's memory in bytes.")] = 24 * 1024
    fastest: Annotated[int, sampling_rate_option("The analyser's maximum sampling rate in Hz.")] = 10**8
    glitches: Annotated[float, typer.Option("--noise", min=0, help="Wrong samples per second.")] = 0.0
    fault: Annotated[
        list[str] | None, "A fault, such as analyser:unplug-after=500 or programmer:silent (repeatable)."
    ] = None
    real_time: Annotated[bool, "Run the chip in real time, not as fast as possible."] = False
    inputs: Annotated[
        list[str] | None,
        typer.Option(
            "--input", help="How the input board is wired, such as RB0=2, RB0-RB4=22 or RA1=TX1 (repeatable)."
        ),
    ] = None
    scheduler: Annotated[
        bool,
        typer.Option(
            "--scheduler/--no-scheduler",
            help="Whether the input board runs ConfigurableFirmata, with its scheduler, or StandardFirmata.",
        ),
    ] = True
    debug: Annotated[bool, "Let an editor debug the chip: prints the url for 'servogen dap'."] = False


def rig(
    job: JobFile,
    bench: BenchOptions,
    line: RigLine,
    hex_file: Annotated[
        Path | None, typer.Option("--hex", help="The program on the chip at the start (default: the job's).")
    ] = None,
    json: Json = False,
) -> None:
    """Simulate a bench: a chip with programmer, analyser, input board and serial line on pseudo-terminals."""
    loaded = plan_job(load(job))
    stream = loaded.stream or Stream(receive_pin="RB7")
    if isinstance(loaded.commands, CommandLine):
        stream = Stream(line_baud(loaded), loaded.commands.pin)
    out = line.serial_out or stream.transmit_pin
    options = RigOptions(
        ppm=Fraction(str(bench.crystal_ppm)),
        real_time=bench.real_time,
        serial_pin=pin_number(line.serial_pin or stream.receive_pin),
        serial_out=pin_number(out) if out else None,
        baud=line.baud or stream.baud,
        inverted=line.inverted,
        analyser=AnalyserOptions(memory=bench.memory, fastest=bench.fastest, glitches_per_s=bench.glitches),
        board=BoardOptions(bench.scheduler),
        inputs=input_wiring(bench.inputs or ()),
    )
    for text in bench.fault or ():
        options = with_fault(options, text)
    with status(f"{loaded.name}: planning and compiling"):
        schedule, program, second = (paired_rig if loaded.chips else _single_chip)(loaded, hex_file)
    levels = {pin_number(source.pin): source.level for source in schedule.inputs}
    levels.pop(options.serial_pin, None)
    ended = threading.Event()
    with ExitStack() as stack:
        debugger, places = None, {}
        if bench.debug:
            debugger = VirtualDebugger(hex_file or job, program)
            places["debugger"] = stack.enter_context(serving(debugger.attach))
        terminals = stack.enter_context(
            opened(program.image, loaded.clock, board_of(schedule), options, levels, second, debugger)
        )
        places = {**terminals.paths, **places}
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, lambda *_: ended.set())
        if json:
            as_json(places)
        else:
            for name, path in places.items():
                print(f"{name}: {path}")
            _tell_sigrok(stack, terminals.paths["analyser"])
            print("end it with Ctrl-C")
        sys.stdout.flush()
        terminals.serve(ended.is_set)


def _single_chip(job: PlannedJob, file: Path | None) -> tuple[PulseSchedule, Program, None]:
    """Return a job's schedule and its program, or that in a file."""
    played = planned(job)
    program = read_program(file) if file else played_program(played)
    for remark in program.remarks:
        warn(remark)
    return played.plan.schedule, program, None


def paired_rig(job: PlannedJob, folder: Path | None) -> tuple[PulseSchedule, Program, SecondChip]:
    """Return the first chip's schedule and program, and the second chip; the programs are the job's, or those
    in the folder of a build. Says if the crystals of both are not what the job states.
    """
    if folder is not None:
        schedules, (first, second) = read_job_pair(job, folder)
    else:
        played = planned_pair(job)
        schedules, (first, second) = played.schedules, played.images()
    for text in equal_rates(schedules[1]):
        print(f"note: {text}", file=sys.stderr)

    def beside(first: Image, second: Image, stimulus: Stimulus | None) -> PairedMachine:
        return paired_machine(schedules, (first, second), stimulus=stimulus)

    return schedules[0], Program(first), SecondChip(second, beside)


def _tell_sigrok(stack: ExitStack, port: str) -> None:
    """Print how to run sigrok-cli, if installed, on the analyser; keep its library while the bench runs."""
    if shutil.which(PROGRAM) and c_compiler():
        lines = stack.enter_context(modem_lines_library())
        print(f"sigrok: LD_PRELOAD={lines} {PROGRAM} --driver ols:conn={port}")
