"""The physics: bodies, servos and supply together, one step at a time.

In: `Bodies`, the drives of its actuators, the supply, pulses. Out: the state at each step. MuJoCo (the extra
`twin`) integrates; the servos' electronics and the supply are calculated here before each of its steps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from servogen.errors import ToolError
from servogen.twin.bodies import Bodies
from servogen.twin.drive import ServoDrive, bank
from servogen.twin.pulses import ReceivedPulse
from servogen.twin.supply import Supply

Floats = npt.NDArray[np.float64]

NEVER, FOREVER = -(1 << 60), 1 << 60
"""Steps before and after all others."""


def mujoco() -> Any:
    """Return the module. Raises ToolError where it is not installed."""
    try:
        import mujoco as found
    except ImportError as error:
        raise ToolError(
            "tool-missing", "the twin needs MuJoCo", hint="pip install 'servogen[twin]'"
        ) from error
    return found


@dataclass(frozen=True, slots=True)
class ServoWiring:
    """A servo between its pulses and its actuator.

    `angles` gives the shaft's angle that a width commands (`width_us` -> radians; of a continuous servo a
    speed), `zero` the shaft's angle at the joint's position 0.
    """

    drive: ServoDrive
    angle_of: Any
    zero: float
    broken: bool = False
    """Whether its gear is broken, so that it turns nothing."""


@dataclass(slots=True)
class WorldState:
    """What changes from step to step, one element per servo."""

    target: Floats
    last: npt.NDArray[np.int64]
    lost_after: npt.NDArray[np.int64]
    driven: Floats
    wake: int = FOREVER
    """The step at which the next servo may be without pulses for too long."""


@dataclass(frozen=True, slots=True, eq=False)
class WorldSnapshot:
    """All that the following steps depend on."""

    step: int
    physics: Floats
    target: Floats
    last: npt.NDArray[np.int64]
    driven: Floats
    wake: int


@dataclass(slots=True)
class Energies:
    """Energies so far, J: from the supply, into copper and gears, to the joints; of the work at the joints,
    what contacts, stops, springs and dry friction took, and what the bodies have gained.
    """

    electric: float = 0.0
    heat: float = 0.0
    work: float = 0.0
    taken: float = 0.0
    gained: float = 0.0


class World:
    """A robot in its world, from its start on."""

    def __init__(
        self,
        bodies: Bodies,
        wirings: Sequence[ServoWiring],
        supply: Supply,
        step_s: float,
        *,
        contacts: bool = True,
    ) -> None:
        engine = mujoco()
        self.model = engine.MjModel.from_xml_string(bodies.text)
        self.data = engine.MjData(self.model)
        self._step_once = engine.mj_step
        self._forward = engine.mj_forward
        self.step_s = step_s
        self.step = 0
        self.supply = supply
        self.voltage, self.current = supply.volts, 0.0
        self._wirings = tuple(wirings)
        self._bank = bank(tuple(wiring.drive for wiring in wirings))
        count = len(self._wirings)
        self.state = WorldState(
            np.zeros(count),
            np.full(count, NEVER, np.int64),
            np.array([round(wiring.drive.lost_s / step_s) for wiring in wirings], np.int64),
            np.zeros(count),
        )
        self._unbroken = np.array([float(not wiring.broken) for wiring in wirings])
        self._continuous = np.array([wiring.drive.continuous for wiring in wirings], bool)
        self._any_continuous = bool(self._continuous.any())
        self._top = np.array([wiring.drive.no_load_speed for wiring in wirings])
        self.duty = np.zeros(count)
        # MuJoCo would put bodies that diverged back where they started and go on, with a warning on standard
        # output and in a file; `diverged` tells the callers instead.
        self.model.opt.disableflags |= int(engine.mjtDisableBit.mjDSBL_AUTORESET)
        engine.set_mju_user_warning(lambda text: None)
        self._largest = float(engine.mjMAXVAL)
        if not contacts:
            self.model.opt.disableflags |= int(engine.mjtDisableBit.mjDSBL_CONTACT)
        b = self._bank
        self._gain = b.torque_constant / b.resistance
        self._per_resistance = 1.0 / b.resistance
        self._emf = b.speed_constant / b.resistance * self._unbroken
        self._per_band = 1.0 / b.band
        # MuJoCo's arrays stay where they are: looking each up again in every step takes a microsecond.
        joints = self.model.actuator_trnid[:, 0]
        self._places = self.model.jnt_qposadr[joints]
        self._speeds = self.model.jnt_dofadr[joints]
        self._gear: Floats = self.model.actuator_gear[:, 0].copy()
        self._position: Floats = self.data.qpos
        self._motion: Floats = self.data.qvel
        self._ctrl: Floats = self.data.ctrl
        if count:
            self.model.actuator_gainprm[:, 0] = self._gain * self._unbroken
        self._half_emf = b.speed_constant / 2
        self._set_driven()
        self.energies: Energies | None = None
        """The energies so far; added up only if a caller sets them before the first step."""

    def _set_driven(self) -> None:
        """Tell MuJoCo which motors' circuits are closed: only those brake by their own voltage.

        Half of that voltage is of the speed at the end of the step, which MuJoCo solves for; the other half,
        of the speed at its beginning, is part of the control. With the speed at the end alone each step would
        take Ke i Δω/2 more from the supply than it turns into heat and work: 2.6 % of all in a walk.
        """
        self._braking = self._half_emf * self.state.driven
        if len(self._wirings):
            self.model.actuator_biasprm[:, 2] = -self._gain * self._braking * self._unbroken

    def place(self, positions: dict[str, float], height: float | None = None) -> None:
        """Put joints (or the free body's height) in their starting positions, at rest."""
        for name, value in positions.items():
            self.data.qpos[self.model.joint(name).qposadr[0]] = value
        if height is not None:
            self.data.qpos[2] = height
        self._forward(self.model, self.data)

    def pulse(self, pulse: ReceivedPulse) -> None:
        """Let a servo receive a pulse in this step."""
        hot, wiring = self.state, self._wirings[pulse.servo]
        hot.target[pulse.servo] = wiring.angle_of(pulse.width_us) - wiring.zero
        hot.last[pulse.servo] = self.step
        hot.wake = min(hot.wake, self.step + int(hot.lost_after[pulse.servo]) + 1)
        if not hot.driven[pulse.servo]:
            hot.driven[pulse.servo] = 1.0
            self._set_driven()

    def advance(self) -> None:
        """Do one step: electronics, supply, bodies."""
        hot, data, b = self.state, self.data, self._bank
        if self.step >= hot.wake:
            hot.driven = (self.step - hot.last <= hot.lost_after).astype(float)
            self._set_driven()
            ends = (hot.last + hot.lost_after + 1)[hot.driven > 0]
            hot.wake = int(ends.min(initial=FOREVER))
        speed = self._motion.take(self._speeds)  # MuJoCo's own list is that before its last step
        speed *= self._gear
        duty = self._next_duty(speed)
        a = float((duty * duty) @ self._per_resistance)
        back = float((duty * speed) @ self._emf)
        self.voltage, self.current = self.supply.under(b.idle_a, a, back)
        self.duty = duty
        np.multiply(duty, self.voltage, out=self._ctrl)
        self._ctrl -= self._braking * speed
        if self.energies is None:
            self._step_once(self.model, data)
        else:
            before = self._motion.copy()
            self._step_once(self.model, data)
            self._keep_account(self.energies, (before + self._motion) / 2)
        self.step += 1

    def _next_duty(self, speed: Floats) -> Floats:
        """Return the bridges' duties for the errors that the electronics see now."""
        state, b = self.state, self._bank
        error = self._position.take(self._places)
        error *= self._gear
        np.subtract(state.target, error, out=error)
        error -= b.damping * speed
        duty: Floats = np.abs(error)
        duty -= b.dead_band
        duty *= self._per_band
        np.maximum(duty, 0.0, out=duty)
        np.minimum(duty, 1.0, out=duty)
        np.copysign(duty, error, out=duty)
        if self._any_continuous:
            open_loop = np.clip(state.target / self._top, -1.0, 1.0)
            duty = np.where(self._continuous, open_loop, duty)
        duty *= state.driven
        return duty

    def _keep_account(self, account: Energies, motion: Floats) -> None:
        """Add this step's energies, with the mean speeds in it."""
        b, mean = self._bank, self._gear * motion[self._speeds]
        resisting = self.data.qfrc_constraint + self.data.qfrc_passive
        account.taken -= float(resisting @ motion) * self.step_s
        terminal = self.duty * self.voltage * self._unbroken
        amperes = (terminal - b.speed_constant * mean) * self._per_resistance * self.state.driven
        copper = b.resistance * amperes**2
        gear = (b.speed_constant - b.torque_constant) * amperes * mean
        account.electric += float(terminal @ amperes) * self.step_s
        account.heat += float((copper + gear).sum()) * self.step_s
        account.work += float((b.torque_constant * amperes) @ mean) * self.step_s

    def snapshot(self) -> WorldSnapshot:
        """Return the state between two steps."""
        engine, hot = mujoco(), self.state
        whole = engine.mjtState.mjSTATE_INTEGRATION
        physics = np.empty(engine.mj_stateSize(self.model, whole))
        engine.mj_getState(self.model, self.data, physics, whole)
        return WorldSnapshot(
            self.step, physics, hot.target.copy(), hot.last.copy(), hot.driven.copy(), hot.wake
        )

    def restore(self, snapshot: WorldSnapshot) -> None:
        """Go back to a state of this world: the steps from there are the same again."""
        engine, hot = mujoco(), self.state
        engine.mj_setState(self.model, self.data, snapshot.physics, engine.mjtState.mjSTATE_INTEGRATION)
        self.step = snapshot.step
        hot.target, hot.last, hot.driven = (
            snapshot.target.copy(),
            snapshot.last.copy(),
            snapshot.driven.copy(),
        )
        hot.wake = snapshot.wake
        self._set_driven()

    @property
    def seconds(self) -> float:
        """Return the time since the start."""
        return self.step * self.step_s

    @property
    def diverged(self) -> bool:
        """Whether a position or speed is no number, or beyond mjMAXVAL, up to which MuJoCo calculates."""
        state = np.concatenate((self._position, self._motion))
        return not bool((np.abs(state) <= self._largest).all())

    def energy(self) -> float:
        """Return kinetic and potential energy of the bodies, J."""
        engine = mujoco()
        engine.mj_energyPos(self.model, self.data)
        engine.mj_energyVel(self.model, self.data)
        return float(self.data.energy.sum())

    @property
    def tilt(self) -> float:
        """Return the angle of the first body's z axis from the ground's normal."""
        return math.acos(min(1.0, max(-1.0, float(self.data.xmat[1][8]))))
