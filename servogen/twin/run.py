"""The coupling: a program on the simulated chip, its edges into servos, the servos into bodies.

In: a job as its engine plays it, an image, settings. Out: `Record`, what happened, every `SAMPLE_S`.

A pulse takes effect at the first step of the physics at or after its falling edge. So the chip may run ahead
in chunks of any length: the result is the same. With sensors the chip waits for the physics at every
millisecond: the levels that it sees from t on are those of the bodies at t.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from servogen.edges import PINS
from servogen.engines.board import board_of, equal_rates, paired_machine
from servogen.errors import InputError
from servogen.job import PlannedJob
from servogen.job.schema import SensorTable
from servogen.pic.image import Image
from servogen.pulse import PulseSchedule
from servogen.simulator import LevelChange, Levels, Machine, Stimuli
from servogen.simulator.sources import pin_number
from servogen.twin.bodies import FOOT_RADIUS_M, Bodies, bodies
from servogen.twin.drive import MAX_STEPS_PER_MS
from servogen.twin.ground import Ground
from servogen.twin.mjcf import Variation
from servogen.twin.pulses import PulseReceiver, ReceivedPulse
from servogen.twin.rig import TwinRig, twin_rig, unplugged_servos
from servogen.twin.sensors import Feed, Sensor
from servogen.twin.world import Energies, World

Floats = npt.NDArray[np.float64]

SAMPLE_S = 0.005
ROUNDING_S = 1e-9
"""More than the rounding of any time of a run, and far less than a step of the physics."""
MAX_SAMPLES = 400_000
"""The maximum number of samples of a record: more than half an hour."""

MIN_S = 0.02
"""The minimum time of a run; a shorter one has hardly any samples."""

SILENT_S = 2.0
"""The time from reset within which a program has to make its first pulse."""


@dataclass(frozen=True, slots=True)
class TwinSettings:
    """The settings of a run. `seconds` None: until the motion was done `loops` times."""

    ground: Ground = field(default_factory=Ground)
    variation: Variation = field(default_factory=Variation)
    broken: tuple[str, ...] = ()
    """Servos whose gear is broken."""
    unplugged: tuple[str, ...] = ()
    """Servos whose signal wire is off."""
    seconds: float | None = None
    loops: int = 1
    chunk_ms: int = 20
    steps_per_ms: int = 1
    """At least so many steps of the physics per millisecond; more where a servo's loop needs them."""
    contacts: bool = True
    energies: bool = False
    """Whether the motors' energies are added up, which takes time."""

    def following(self, rig: TwinRig) -> TwinSettings:
        """Return the settings with steps that follow the fastest servo of a rig."""
        return replace(self, steps_per_ms=max(self.steps_per_ms, rig.steps_per_ms))

    @property
    def step_s(self) -> Fraction:
        """Return the physics' step."""
        return Fraction(1, 1000 * self.steps_per_ms)

    def __post_init__(self) -> None:
        """Raise InputError for values that no run can have."""
        if self.seconds is not None and not self.seconds >= MIN_S:
            raise InputError("out-of-range", f"seconds = {self.seconds:g} is less than {MIN_S:g}")
        for name, value, low, high in (
            ("loops", self.loops, 1, 1000),
            ("chunk_ms", self.chunk_ms, 1, 1000),
            ("steps_per_ms", self.steps_per_ms, 1, MAX_STEPS_PER_MS),
        ):
            if not low <= value <= high:
                raise InputError("out-of-range", f"{name} = {value} is not between {low} and {high}")


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """What happened, one row per sample; a column per servo of `rig`, per leg or per end.

    `pose` is x, y, z and yaw (unwrapped) of the body, `tilt` its angle from the ground's normal; `angle` and
    `target` are the servos', radians at the shaft, NaN before the first pulse; `pulsed` whether pulses drive
    them; `torque` N·m at the shaft, `speed` its speed. `feet` (legs, 3) and `force` (N) are the feet's,
    `tool` is that of an arm. `motion` is the span in seconds in which the job's motion was played.
    """

    rig: TwinRig
    bodies: Bodies
    time: Floats
    pose: Floats
    tilt: Floats
    angle: Floats
    target: Floats
    pulsed: npt.NDArray[np.bool_]
    duty: Floats
    torque: Floats
    speed: Floats
    voltage: Floats
    current: Floats
    feet: Floats
    force: Floats
    tool: Floats
    places: Mapping[str, Floats]
    """The position of the origin of each body, (samples, 3)."""
    motion: tuple[float, float]
    floating: bool
    """Whether the body is free; an arm, and a robot with one or two legs, are fixed."""
    held_from: float = 0.0
    """The second from which pulses have to hold the robot; two chips have none while the second one waits."""
    energies: Energies | None = None
    changes: tuple[LevelChange, ...] = ()
    """The changes of the sensors' pins."""
    settings: TwinSettings = field(default_factory=TwinSettings)

    def digest(self) -> bytes:
        """Return all numbers as bytes: equal for equal runs."""
        parts = (self.pose, self.angle, self.torque, self.voltage, self.current, self.feet, self.tool)
        return b"".join(np.ascontiguousarray(part).tobytes() for part in parts)

    @property
    def first(self) -> int:
        """Return the sample at which the motion begins."""
        return min(int(np.searchsorted(self.time, self.motion[0] - ROUNDING_S)), len(self.time) - 1)


def simulate(
    job: PlannedJob,
    schedule: PulseSchedule,
    image: Image,
    lead_in_frames: int,
    settings: TwinSettings = TwinSettings(),
    stimuli: Stimuli | None = None,
    second: tuple[PulseSchedule, Image] | None = None,
) -> Record:
    """Run a program in its robot from power-up on.

    `job` has the trajectory that the engine plays; its first `lead_in_frames` come before the job's own
    motion. `stimuli` are applied to the pins besides the job's sensors. A job of two chips, which read
    neither, has a `second` program.

    Raises InputError, and ToolError where MuJoCo is missing.
    """
    rig, built, world = standing(job, settings)
    if second is not None:
        rig = replace(rig, assumptions=(*rig.assumptions, *equal_rates(second[0])))
    settings = settings.following(rig)
    world.energies = Energies() if settings.energies else None
    return TwinRun(job, schedule, image, lead_in_frames, settings, stimuli, rig, world, built, second).run()


def standing(job: PlannedJob, settings: TwinSettings) -> tuple[TwinRig, Bodies, World]:
    """Return a job's robot in its world at power-up, where its first pulses will hold it.

    Raises InputError, and ToolError where MuJoCo is missing.
    """
    rig = twin_rig(job, settings.broken)
    step_s = float(settings.following(rig).step_s)
    built = bodies(rig.robot, rig.actuators, settings.ground, settings.variation, step_s, _stand_height(job))
    world = World(built, rig.wirings, rig.supply, step_s, contacts=settings.contacts)
    _stand(world, job, rig, settings.ground)
    return rig, built, world


def _stand_height(job: PlannedJob) -> float:
    """Return the height at which the lowest planned foot just touches the ground."""
    feet = [end.points(job.trajectory.angles)[:, 2] for end in job.ends if end.kind == "foot"]
    lowest = min((float(np.nanmin(heights)) for heights in feet if not np.isnan(heights).all()), default=0.0)
    return -lowest


def _stand(world: World, job: PlannedJob, rig: TwinRig, ground: Ground) -> None:
    """Put the robot where its first pulses will hold it, with its lowest foot on the ground."""
    angles = job.trajectory.angles
    start = {}
    for column, servo, binding in zip(rig.columns, rig.servos, rig.bindings, strict=True):
        if servo.model.continuous:
            continue
        known = angles[~np.isnan(angles[:, column]), column]
        position = float(binding.position(known[0] if len(known) else servo.neutral))
        start[binding.joint] = position
    names = {world.model.joint(index).name for index in range(world.model.njnt)}
    for name in tuple(start):
        level = name.removesuffix("_beta") + "_level"
        if name.endswith("_beta") and level in names:
            start[level] = -start[name]
    world.place(start)
    if "body" in names:  # the joint of a free body
        feet = [
            world.data.site(index).xpos[2] - FOOT_RADIUS_M
            for index in range(world.model.nsite)
            if world.model.site(index).name.endswith("_foot")
        ]
        lowest = min(feet, default=0.0)
        world.place(start, float(world.data.qpos[2]) - lowest + ground.rough)


class TwinRun:
    """One run: the chip, the physics and the record as they go."""

    def __init__(
        self,
        job: PlannedJob,
        schedule: PulseSchedule,
        image: Image,
        lead_in_frames: int,
        settings: TwinSettings,
        stimuli: Stimuli | None,
        rig: TwinRig,
        world: World,
        built: Bodies,
        second: tuple[PulseSchedule, Image] | None,
    ) -> None:
        self.job, self.schedule, self.settings = job, schedule, settings
        self.rig, self.world, self.bodies = rig, world, built
        self.lead_in_frames = lead_in_frames
        self.receiver = PulseReceiver(rig.pins(job), job.clock, settings.step_s)
        self.off = unplugged_servos(rig, settings.unplugged)
        self.sensors = [sensor_reader(row, world, rig) for row in job.sensors]
        held = [Levels(pin_number(input_.pin), ((0, input_.level),)) for input_ in schedule.inputs]
        scripted = Stimuli([*held, *(stimuli.sources if stimuli else ())])
        self.feed = Feed(scripted, job.clock) if self.sensors else None
        source = self.feed or (scripted if scripted.sources else None)
        self.machine = (
            Machine(image, job.clock, board_of(schedule), source)
            if second is None
            else paired_machine((schedule, second[0]), (image, second[1]))
        )
        self.chunk = settings.steps_per_ms * (1 if self.sensors else settings.chunk_ms)
        self.every = max(1, round(SAMPLE_S / float(settings.step_s)))
        self.limbs = [limb.name for limb in rig.robot.limbs if limb.mount is not None]
        self.sites = [world.model.site(f"{name}_foot").id for name in self.limbs]
        model = world.model
        self.tool = next((i for i in range(model.nsite) if model.site(i).name == "tool"), None)
        self.floating = bool(model.njnt) and model.joint(0).name == "body"
        self.rows: list[Floats] = []
        self.first_pulse: int | None = None

    def run(self) -> Record:
        """Run to the end and return the record."""
        waiting: list[ReceivedPulse] = []
        before = self.world.energy() if self.world.energies else 0.0
        end = self.end_after(None)
        step = 0
        self.set_levels(0)
        while step < end:
            until = min(step + self.chunk, end)
            if self.feed is not None:
                self.feed.know(self.receiver.first_cycle(until + 1))
            waiting += self._edges(self.receiver.first_cycle(until))
            count = 0
            for step in range(step, until):  # noqa: B020 - continues where it was
                while count < len(waiting) and waiting[count].step <= step:
                    self._receive(waiting[count], step)
                    count += 1
                if step % self.every == 0:
                    self.sample(step)
                self.world.advance()
            del waiting[:count]
            if self.world.diverged:
                message = f"the physics diverged before {self.world.seconds:g} s"
                raise InputError("unstable", f"{self.job.name}: {message}")
            step = until
            self.set_levels(step)
            if self.first_pulse is not None:
                end = self.end_after(self.first_pulse)
        if self.world.energies:
            self.world.energies.gained = self.world.energy() - before
        return self.record()

    def _edges(self, cycle: int) -> Iterator[ReceivedPulse]:
        """Run the chip to a cycle and yield the pulses that ended."""
        if cycle > self.machine.cycles:
            yield from self.receiver.pulses(self.machine.run(cycle - self.machine.cycles))

    def _receive(self, pulse: ReceivedPulse, step: int) -> None:
        if pulse.servo in self.off:
            return
        if self.first_pulse is None:
            self.first_pulse = step
        self.world.pulse(pulse)

    def set_levels(self, step: int) -> None:
        """Give the sensors' levels at the beginning of a step to the chip."""
        if self.feed is None:
            return
        for sensor in self.sensors:
            level = sensor.active if sensor.reads() else 1 - sensor.active
            self.feed.push(self.receiver.first_cycle(step), sensor.pin, level)

    def end_after(self, first_pulse: int | None) -> int:
        """Return the step at which the run ends."""
        per_second = 1000 * self.settings.steps_per_ms
        if self.settings.seconds is not None:
            steps = round(self.settings.seconds * per_second)
        elif first_pulse is None:
            steps = round(SILENT_S * per_second)
        else:
            frames = self.lead_in_frames + self._frames()
            steps = first_pulse + round(frames * self._frame_s() * per_second)
        if steps // self.every > MAX_SAMPLES:
            raise InputError("too-many-frames", f"{self.job.name}: the run is longer than half an hour")
        return steps

    def _frames(self) -> int:
        """Return the frames of the motion: the lead-in of its own and its loop as often as asked."""
        trajectory = self.job.trajectory
        own = trajectory.loop_start - self.lead_in_frames
        return own + self.settings.loops * (len(trajectory.angles) - trajectory.loop_start)

    def _frame_s(self) -> float:
        return float(self.schedule.clock.seconds(self.schedule.period))

    def sample(self, step: int) -> None:
        world, data = self.world, self.world.data
        hot = world.state
        pose = data.qpos[:7] if self.floating else _AT_REST
        row = (
            [step * world.step_s, world.voltage, world.current],
            pose,
            data.actuator_length,
            hot.target,
            hot.driven,
            world.duty,
            data.actuator_force,
            data.actuator_velocity,
            data.site_xpos[self.sites].ravel() if self.sites else (),
            data.sensordata[: len(self.sites)],
            () if self.tool is None else data.site_xpos[self.tool],
            data.xpos[1:].ravel(),
        )
        self.rows.append(np.concatenate(row))

    def record(self) -> Record:
        count, legs, rig = len(self.rig.servos), len(self.sites), self.rig
        table = np.array(self.rows)
        cuts = np.cumsum([3, 7, *[count] * 6, 3 * legs, legs, 0 if self.tool is None else 3])
        head, pose, angle, target, driven, duty, torque, speed, feet, force, tool, places = np.split(
            table, cuts, axis=1
        )
        model = self.world.model
        names = [model.body(index).name for index in range(1, model.nbody)]
        zero = np.array([binding.zero for binding in rig.bindings])
        w, x, y, z = pose[:, 3:7].T
        yaw = np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
        tilt = np.arccos(np.clip(1 - 2 * (x * x + y * y), -1, 1))
        pulsed = driven > 0
        seen = np.maximum.accumulate(pulsed, axis=0)
        begin = (self.first_pulse or 0) * self.world.step_s + self.lead_in_frames * self._frame_s()
        return Record(
            rig=rig,
            bodies=self.bodies,
            time=head[:, 0],
            pose=np.column_stack([pose[:, :3], yaw]),
            tilt=tilt,
            angle=angle + zero,
            target=np.where(seen, target + zero, np.nan),
            pulsed=pulsed,
            duty=duty,
            torque=torque,
            speed=speed,
            voltage=head[:, 1],
            current=head[:, 2],
            feet=feet.reshape(len(table), legs, 3) - [0.0, 0.0, FOOT_RADIUS_M],
            force=force,
            tool=tool,
            places={name: places[:, 3 * at : 3 * at + 3] for at, name in enumerate(names)},
            motion=(begin, begin + self._frames() * self._frame_s()),
            floating=self.floating,
            held_from=begin if self.job.chips else 0.0,
            energies=self.world.energies,
            changes=tuple(self.feed.seen) if self.feed else (),
            settings=self.settings,
        )


_AT_REST = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def sensor_reader(row: SensorTable, world: World, rig: TwinRig) -> Sensor:
    """Return a sensor of the job in this world."""
    pin, active = PINS.index(row.pin), int(row.level == "high")
    if row.kind == "foot":
        address = world.model.sensor(f"{row.of}_touch").adr[0]
        return Sensor(
            pin, active, lambda: bool(world.data.sensordata[address] >= row.force_n), f"foot {row.of}"
        )
    if row.kind == "stall":
        limit = row.above_a or math.inf
        return Sensor(pin, active, lambda: world.current > limit, "stall comparator")
    joint = world.model.joint(row.of)
    address = joint.qposadr[0]
    place = math.radians(row.at_deg) if row.at_deg is not None else (row.at_mm or 0.0) / 1000
    sign = 1.0 if row.side == "above" else -1.0
    return Sensor(
        pin, active, lambda: bool(sign * (world.data.qpos[address] - place) >= 0), f"end stop {row.of}"
    )
