"""`LiveTwin`: the bodies of a robot at any moment of a chip that runs, steps back and is acted upon.

In: a job, and the edges that its pins made up to a moment. Out: the bodies at the step of the physics that
begins at or before that moment.

    kept    ●─────────●─────────●─────────●──── …        a snapshot every 0.1 s of simulated time
    follow  restores the latest one before the moment and calculates from there, with the same pulses

Nothing is random: the same pulses lead to the same bodies, bit by bit, whichever way a moment is reached.
When the past is changed, `forget` drops what followed from it.
"""

from __future__ import annotations

import math
import time
from bisect import bisect_right, insort
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from servogen.edges import EdgeChunk
from servogen.errors import InputError
from servogen.job import PlannedJob
from servogen.pulses import PulseReader
from servogen.report.film import FilmPart
from servogen.twin.bodies import FOOT_RADIUS_M
from servogen.twin.pictures import lines_through
from servogen.twin.pulses import PulseReceiver, ReceivedPulse
from servogen.twin.run import TwinSettings, standing
from servogen.twin.world import World, WorldSnapshot, mujoco
from servogen.units import Clock

Floats = npt.NDArray[np.float64]

SPACING = 100
"""The number of steps between two snapshots."""
MAX_SNAPSHOTS = 5000
"""The maximum number of snapshots of a window, about 4 kB each; beyond it, older ones are thinned out."""
RECENT = 20_000
"""The number of steps before and after the current one in which all snapshots are kept."""
CHUNK = 20
"""The number of steps between two readings of the clock."""


@dataclass(frozen=True, slots=True, eq=False)
class _Kept:
    """A snapshot of the world, of the wires, and the pulses that take effect in its step."""

    world: WorldSnapshot
    wires: PulseReader
    waiting: tuple[ReceivedPulse, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """The bodies at a step, metres and newtons; `pose` is x, y, z and yaw of a free body, else zeros.

    The last lines are the legs', from body to foot.
    """

    seconds: float
    pose: Floats
    lines: tuple[FilmPart, ...]
    feet: Floats
    force: Floats


class FollowedWorld:
    """A world that follows a chip's edges to any moment, by snapshots of what led there.

    `edges` gives what the pins did from one cycle to another.
    """

    def __init__(self, world: World, receiver: PulseReceiver, edges: Callable[[int, int], EdgeChunk]) -> None:
        self.world, self._receiver, self._edges = world, receiver, edges
        self._waiting: list[ReceivedPulse] = []
        self._coarse = SPACING
        self._snapshots: dict[int, _Kept] = {}
        self.kept: list[int] = []
        """The steps of which a snapshot is kept, in order."""
        self._keep()

    @property
    def step(self) -> int:
        return self.world.step

    @property
    def cycle(self) -> int:
        """Return the first cycle of the step that was reached."""
        return self._receiver.first_cycle(self.step)

    @property
    def snapshots(self) -> int:
        return len(self.kept)

    def follow(self, cycle: int, seconds: float = math.inf) -> bool:
        """Go to the moment of a cycle, or calculate for about so many seconds on the way there.

        Return whether it got there. The edges before the cycle have to be known. Raises InputError where the
        physics diverges.
        """
        goal = self._receiver.step_at(cycle)
        place = bisect_right(self.kept, goal) - 1
        if self.step > goal or self.kept[place] > self.step:
            self._restore(self.kept[place])
        end = time.monotonic() + seconds
        while self.step < goal:
            self._calculate(min(goal, self.step + CHUNK, (self.step // SPACING + 1) * SPACING))
            if self.step % SPACING == 0 and self.step not in self._snapshots:
                self._keep()
            if time.monotonic() >= end:
                break
        return self.step == goal

    def forget(self, cycle: int) -> None:
        """Drop what was calculated from the edges of a cycle and of later ones."""
        last = bisect_right(self.kept, self._receiver.step_at(cycle))
        for step in self.kept[last:]:
            del self._snapshots[step]
        del self.kept[last:]
        if self.step > self._receiver.step_at(cycle):
            self._restore(self.kept[-1])

    def _calculate(self, until: int) -> None:
        world, receiver = self.world, self._receiver
        begin, end = receiver.first_cycle(world.step), receiver.first_cycle(until)
        self._waiting += receiver.pulses(self._edges(begin, end))
        count = 0
        while world.step < until:
            while count < len(self._waiting) and self._waiting[count].step <= world.step:
                world.pulse(self._waiting[count])
                count += 1
            world.advance()
        del self._waiting[:count]
        if world.diverged:
            raise InputError("unstable", f"the physics diverged before {world.seconds:g} s")

    def _keep(self) -> None:
        snapshot = _Kept(self.world.snapshot(), self._receiver.snapshot(), tuple(self._waiting))
        self._snapshots[self.step] = snapshot
        insort(self.kept, self.step)
        if len(self.kept) > MAX_SNAPSHOTS:
            self._thin()

    def _thin(self) -> None:
        """Drop snapshots that are not recent until a quarter of the room is free."""
        while len(self.kept) > MAX_SNAPSHOTS * 3 // 4:
            self.kept = [
                step for step in self.kept if step % self._coarse == 0 or abs(step - self.step) <= RECENT
            ]
            self._coarse *= 2
        self._snapshots = {step: self._snapshots[step] for step in self.kept}

    def _restore(self, step: int) -> None:
        snapshot = self._snapshots[step]
        self.world.restore(snapshot.world)
        self._receiver.restore(snapshot.wires)
        self._waiting = list(snapshot.waiting)


class LiveTwin:
    """A robot in its world that follows a chip."""

    def __init__(
        self,
        job: PlannedJob,
        clock: Clock,
        edges: Callable[[int, int], EdgeChunk],
        settings: TwinSettings = TwinSettings(),  # noqa: B008 - frozen
        shown: int = 0,
    ) -> None:
        """Begin at power-up; of two chips `shown` is the one whose pins come first.

        Raises InputError, and ToolError where MuJoCo is missing.
        """
        self.rig, _, self.world = standing(job, settings)
        self.settings = settings = settings.following(self.rig)
        receiver = PulseReceiver(self.rig.pins(job, shown), clock, settings.step_s)
        self.history = FollowedWorld(self.world, receiver, edges)
        model = self.world.model
        self._shown = mujoco().MjData(model)
        self.legs = [limb.name for limb in self.rig.robot.limbs if limb.mount is not None]
        self._sites = [model.site(f"{name}_foot").id for name in self.legs]
        self._tool = next((at for at in range(model.nsite) if model.site(at).name == "tool"), None)
        self._names = [model.body(index).name for index in range(1, model.nbody)]
        self.floating = bool(model.njnt) and model.joint(0).name == "body"

    def moment(self) -> Moment:
        """Return the bodies at the step that was reached."""
        engine, world, data = mujoco(), self.world, self._shown
        whole = engine.mjtState.mjSTATE_INTEGRATION
        engine.mj_setState(world.model, data, world.snapshot().physics, whole)
        engine.mj_forward(world.model, data)
        pose = np.zeros(4)
        if self.floating:
            w, x, y, z = data.qpos[3:7]
            pose = np.array([*data.qpos[:3], math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))])
        feet = data.site_xpos[self._sites].reshape(1, -1, 3) - [0.0, 0.0, FOOT_RADIUS_M]
        places = {name: data.xpos[[index]] for index, name in enumerate(self._names, 1)}
        tool = np.zeros((1, 0)) if self._tool is None else data.site_xpos[[self._tool]]
        lines = lines_through(self.rig.robot, places, feet, tool, pose[[0, 1, 3]].reshape(1, 3))
        return Moment(world.seconds, pose, tuple(lines), feet[0], data.sensordata[: len(self._sites)].copy())
