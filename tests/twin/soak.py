"""The twin's long figures: `python -m tests.twin.soak [TABLE ...]`.

Prints one table per name, those of docs/twin.md: way, turn, specimens, lost_motion, causes, oracle, rough,
steps; and servos, that of docs/servos.md. The tests of this folder hold a part of it.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable

import numpy as np

from servogen.errors import InputError
from servogen.robot.servo import servo
from servogen.robot.servo_models import names, servo_model
from servogen.twin import Ground, TwinSettings, TwinVerdict, Variation
from servogen.twin.drive import servo_drive
from tests.twin.bench import on_the_bench, speed_against
from tests.twin.walking import CURVE, SUPPLIED, TURN, WALK, Firmware, rigid_end, walking

FRICTIONS = (0.3, 0.5, 0.8, 1.0)


def shown(verdict: TwinVerdict) -> str:
    """Return where a run ended."""
    x, y, yaw = verdict.done
    return f"{1000 * x:7.1f} {1000 * y:6.1f} mm {math.degrees(yaw):7.1f}°"


def way() -> None:
    """Straight walks of 160 mm: gaits, heights of the body, frictions."""
    print("gait    height  friction     forward left      turn   of rigid legs' way")
    for gait in ("tripod", "ripple", "wave"):
        for height in (110, 120, 130):
            made = walking(WALK, gait, height, SUPPLIED)
            for friction in FRICTIONS:
                seen = made.twin(TwinSettings(ground=Ground(friction)))
                rigid = seen.planned.rigid
                assert rigid is not None
                share = seen.done[0] / float(rigid[-1, 0])
                print(f"{gait:8}{height:4} mm {friction:8} {shown(seen)} {100 * share:6.1f} %", flush=True)


def turn() -> None:
    """Turns on the spot by 180° at 130 mm, with motors and sag."""
    for friction in FRICTIONS:
        twin = walking(TURN, extra=SUPPLIED).twin(TwinSettings(Ground(friction)))
        print(f"friction {friction}: {shown(twin)}")


def specimens() -> None:
    """Sixteen specimens: each foot's friction ± 30 %, the centre of mass ± 10 mm."""
    made, rng, turns = walking(TURN, extra=SUPPLIED), np.random.default_rng(15), []
    for _ in range(16):
        factors = tuple(rng.uniform(0.7, 1.3, 6).tolist())
        x, y = rng.uniform(-0.01, 0.01, 2).tolist()
        seen = made.twin(TwinSettings(variation=Variation(factors, (x, y))))
        turns.append(math.degrees(seen.done[2]))
    print(f"turn {np.mean(turns):.1f}°, standard deviation {np.std(turns, ddof=1):.1f}°")
    print(np.round(turns, 1))


def lost_motion() -> None:
    """The servos' dead band and its compensation, which expects 2 µs: ripple at 110 mm, turn at 130 mm."""
    for name, rows, gait, height, bands in (
        ("ripple", WALK, "ripple", 110, (0.0, 2.0, 4.0)),
        ("turn", TURN, "tripod", 130, (0.0, 2.0)),
    ):
        for compensate in (True, False):
            made = walking(rows, gait, height, SUPPLIED, compensate=compensate)
            for band in bands:
                servos = made.with_motor(dead_band_us=band)
                seen = [servos.twin(TwinSettings(ground=Ground(friction))) for friction in FRICTIONS]
                word = "compensated" if compensate else "plain"
                print(f"{name}, {band:g} µs, {word}: {' |'.join(map(shown, seen))}", flush=True)


def causes() -> None:
    """What must fail, and the first cause that is named."""
    expect = "\n[expect]\nrobot_within_mm = 12\nturn_within_deg = 5\n"
    limited = expect + "\n[supply]\nvoltage_v = 5.0\nresistance_ohm = 0.05\nlimit_a = 3.5\n"
    heavy = {"mass": 2.24}
    runs: list[tuple[str, Firmware, TwinSettings, dict[str, float]]] = [
        ("2.24 kg at 120 mm", walking(WALK, height=120, extra=expect), TwinSettings(), heavy),
        ("R2-lift without pulses", walking(WALK, extra=expect), TwinSettings(unplugged=("R2-lift",)), {}),
        ("a broken leg", walking(WALK, extra=expect), TwinSettings(broken=("L1-turn", "L1-lift")), {}),
        ("a supply of 3.5 A, 2.24 kg", walking(WALK, height=120, extra=limited), TwinSettings(), heavy),
        (
            "twelve stalled servos",
            walking(WALK, height=120, extra=limited),
            TwinSettings(Ground(1.0), seconds=2.5),
            {"mass": 15.0},
        ),
        ("beta at full height", walking(WALK, height=140, extra=expect), TwinSettings(), {}),
    ]
    for name, made, settings, robot in runs:
        seen = made.twin(settings, **robot)
        lowest = 1000 * seen.record.pose[:, 2].min()
        reasons = "; ".join(seen.reasons())
        print(f"{name}: {shown(seen)}, lowest {lowest:.0f} mm, {seen.word}: {reasons}")


def oracle() -> None:
    """The quasi-static model against the physics: planned, and with the joint angles that the physics had."""
    for name, rows in (("straight", WALK), ("turn", TURN), ("curve", CURVE)):
        seen = walking(rows, extra=SUPPLIED).twin()
        rigid = seen.planned.rigid
        assert rigid is not None
        x, y, yaw = rigid_end(seen)
        planned = f"{1000 * rigid[-1, 0]:.1f} {1000 * rigid[-1, 1]:.1f} mm {math.degrees(rigid[-1, 2]):.1f}°"
        print(
            f"{name}: physics {shown(seen)}; rigid legs as planned {planned}, "
            f"with the simulated angles {1000 * x:.1f} {1000 * y:.1f} mm {math.degrees(yaw):.1f}°"
        )


def rough() -> None:
    """Thirty rough grounds, five gaits: falls, way, slip."""
    gaits: dict[str, Callable[[], Firmware]] = {
        "tripod": lambda: walking(WALK, "tripod", 120, SUPPLIED),
        "ripple": lambda: walking(WALK, "ripple", 120, SUPPLIED),
        "wave": lambda: walking(WALK, "wave", 120, SUPPLIED),
        "tripod, half the stride": lambda: walking(
            "{ forward_mm = 20, cycles = 8 }", "tripod", 120, SUPPLIED
        ),
        "ripple, half the stride": lambda: walking(
            "{ forward_mm = 20, cycles = 8 }", "ripple", 120, SUPPLIED
        ),
    }
    for name, make in gaits.items():
        made = make()
        for height in (0.004, 0.008, 0.012):
            runs = [made.twin(TwinSettings(Ground(0.8, rough=height, seed=seed))) for seed in range(10)]
            ways = [1000 * seen.done[0] for seen in runs]
            falls = sum(not check.passed for seen in runs for check in seen.checks if check.name == "falls")
            yaw = max(abs(math.degrees(seen.done[2])) for seen in runs)
            drag = np.mean([1000 * seen.drag for seen in runs])
            span = f"way {min(ways):.0f} to {max(ways):.0f} (mean {np.mean(ways):.0f}) mm"
            print(f"{name}, {1000 * height:.0f} mm: {falls} falls of 10, {span}, ", end="")
            print(f"turned by up to {yaw:.0f}°, longest drag {drag:.1f} mm", flush=True)


def steps() -> None:
    """The step of the physics halved twice."""
    for name, rows in (("straight", WALK), ("turn", TURN)):
        for per_ms in (1, 2, 4):
            seen = walking(rows, extra=SUPPLIED).twin(TwinSettings(steps_per_ms=per_ms, energies=True))
            account = seen.record.energies
            assert account is not None
            lost = 1 - (account.heat + account.taken + account.gained) / account.electric
            print(
                f"{name}, {1 / per_ms:g} ms: {shown(seen)}, {account.electric:.2f} J from the supply, "
                f"contacts took {account.taken:.3f} J, the bodies gained {account.gained:.3f} J, "
                f"missing {100 * lost:.3f} %"
            )


def servos() -> None:
    """Every servo of the catalogue on the bench: its speed without load, and the torque at which it stops."""
    for name in names():
        model = servo_model(name)
        arm, assumed = servo("arm", "RB0", model), model.motor.assumed
        drive = servo_drive(arm)
        speed, stall = on_the_bench(arm).speed, drive.stall_torque
        low, high = 0.9 * stall, 1.1 * stall
        while high - low > 1e-4 * stall:
            load = (low + high) / 2
            low, high = (load, high) if speed_against(arm, load) > 1e-3 * speed else (low, load)
        stated = model.speed or max(model.calibration.angles)
        row = (
            f"{model.supply_v:g}",
            f"{math.degrees(stated):.4g}",
            f"{math.degrees(speed):.4g}",
            f"{100 * (model.torque_nm or stall):.4g}",
            f"{100 * low:.4g}",
            f"{drive.steps_per_ms}",
            ", ".join(f"`{key}`" for key in assumed) or "none",
        )
        print(f"| `{name}` | {' | '.join(row)} |", flush=True)


TABLES = {
    each.__name__: each for each in (way, turn, specimens, lost_motion, causes, oracle, rough, steps, servos)
}


def main(wanted: list[str]) -> None:
    """Print the tables of these names, or all."""
    for name in wanted or TABLES:
        if name not in TABLES:
            raise InputError("unknown-name", f"there is no table '{name}'", hint=", ".join(TABLES))
        start = time.process_time()
        print(f"## {name}: {(TABLES[name].__doc__ or '').strip()}")
        TABLES[name]()
        print(f"{time.process_time() - start:.0f} s\n", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
