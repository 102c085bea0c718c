"""Commands of robots: robots, fk, ik, jacobian, statics, mobility, transform, orientation, differential,
equation.

Arguments are degrees and millimetres; JSON has the unit in each name.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from math import degrees
from pathlib import Path
from typing import Annotated, Any

import typer

from servogen.cli.options import Json, number
from servogen.cli.show import as_json, next_step, status, table
from servogen.errors import InputError, rendered
from servogen.inputs import count_in
from servogen.kinematics import queries
from servogen.kinematics.catalogue import arm, robot
from servogen.kinematics.protocol import WalkingRobot
from servogen.kinematics.urdf import to_urdf
from servogen.outputs import write_text
from servogen.report.scheme import scheme_plot
from servogen.robot.servo_models import catalogued_as, figures, names, servo_model
from servogen.twin.bodies import bodies

RobotName = Annotated[
    str, typer.Argument(help="A name listed by `servogen robots`, or a TOML or URDF file (arm.urdf#tip).")
]
JointValues = Annotated[
    list[float] | None,
    typer.Argument(help="Joint positions in degrees or mm.", parser=number, show_default=False),
]
Vector = tuple[float, float, float]
NO_VECTOR: Vector = (0.0, 0.0, 0.0)
Symbolic = Annotated[bool, "Print simplified symbolic expressions."]
Style = Annotated[str, "Notation of symbolic expressions: text, latex or c."]


SHOWN_M = 1e-9
"""A distance from the target that is shown: smaller ones are rounding noise."""


def robots(
    name: Annotated[str | None, typer.Argument(help="The robot to show.", show_default=False)] = None,
    urdf: Annotated[Path | None, "Write this arm as URDF, the robot description of ROS."] = None,
    mjcf: Annotated[Path | None, "Write its bodies as MJCF, a model for MuJoCo."] = None,
    picture: Annotated[
        Path | None, typer.Option("--plot", help="Draw its kinematic scheme: .png, .svg or .pdf.")
    ] = None,
    json: Json = False,
) -> None:
    """List the robots of the catalogue, or show everything about one of them."""
    if urdf is not None:
        _write_urdf(name, urdf)
    elif mjcf is not None:
        _write_mjcf(name, mjcf)
    elif picture is not None:
        _draw_scheme(name, picture)
    elif name is None:
        entries = queries.robot_list()
        if json:
            as_json({"robots": entries})
        else:
            rows = [(entry["name"], entry["kind"], entry["joints"], entry["title"]) for entry in entries]
            table("Robots", ("name", "kind", "joints", "title"), rows)
    elif json:
        as_json(queries.robot_details(name))
    else:
        _print_details(queries.robot_details(name))
        notes = getattr(robot(name), "notes", ())
        if notes:
            print(rendered(notes))


def servos(
    name: Annotated[
        str | None, typer.Argument(help="The servo to show, or a servo file.", show_default=False)
    ] = None,
    json: Json = False,
) -> None:
    """List the servos of the catalogue, or show every figure of one of them and where it comes from."""
    if name is None:
        keys = ("name", "supply_v", "speed_deg_s", "torque_ncm", "mass_g", "title")
        rows = [
            (
                model.name,
                model.supply_v,
                _in(model.speed, degrees(1)),
                _in(model.torque_nm, 100),
                _in(model.mass_kg, 1000),
                model.title,
            )
            for model in map(servo_model, names())
        ]
        if json:
            as_json({"servos": [dict(zip(keys, row, strict=True)) for row in rows]})
        else:
            shown = [["" if cell is None else cell for cell in row] for row in rows]
            table("Servos", ("name", "V", "°/s", "N·cm", "g", "title"), shown)
            print("servogen servos NAME says where each figure comes from")
        return
    model = servo_model(catalogued_as(name))
    found = figures(catalogued_as(name))
    if json:
        as_json({"name": model.name, "title": model.title, "figures": [asdict(figure) for figure in found]})
        return
    cells = [(figure.key, figure.value, figure.origin, figure.source) for figure in found]
    table(model.title, ("figure", "value", "from", "source"), cells)


def _in(value: float | None, parts: float) -> float | None:
    """Return a value in the unit of which it has `parts`, in the digits of a data sheet."""
    return None if value is None else float(f"{value * parts:.4g}")


def _write_urdf(name: str | None, path: Path) -> None:
    if name is None:
        raise InputError(
            "missing-option", "which robot should be written?", hint="servogen robots scara --urdf scara.urdf"
        )
    write_text(path, to_urdf(arm(name)))
    print(next_step("fk", path))


def _draw_scheme(name: str | None, path: Path) -> None:
    if name is None:
        raise InputError(
            "missing-option", "which robot should be drawn?", hint="servogen robots scara --plot scara.png"
        )
    chosen = robot(name)
    scheme_plot(chosen, path)
    print(next_step("gait" if isinstance(chosen, WalkingRobot) else "fk", name))


def _write_mjcf(name: str | None, path: Path) -> None:
    if name is None:
        raise InputError(
            "missing-option",
            "which robot should be written?",
            hint="servogen robots hexapod --mjcf hexapod.xml",
        )
    model = bodies(robot(name))
    write_text(path, model.text)
    for text in model.assumptions:
        print(f"assumed: {text}")
    print(path)
    print(next_step("fk" if not isinstance(robot(name), WalkingRobot) else "gait", name))


def fk(
    name: RobotName,
    values: Annotated[
        list[float] | None,
        typer.Argument(
            help="Joint positions in degrees or mm; the wheel speeds of a base on wheels in °/s.",
            parser=number,
            show_default=False,
        ),
    ] = None,
    symbolic: Symbolic = False,
    style: Style = "text",
    json: Json = False,
) -> None:
    """Compute forward kinematics: where the tool is at given joint positions, or how fast a base on wheels
    moves.
    """
    if symbolic:
        with status("simplifying"):
            answer = queries.fk_symbolic(name, style)
        if json:
            as_json(answer)
            return
        for index, link in enumerate(answer["links"], 1):
            print(f"link {index}:\n{link}\n")
        print(f"product:\n{answer['product']}\n\nposition:\n{answer['position']}")
        return
    answer = queries.fk_answer(name, values or ())
    if json:
        as_json(answer)
        return
    for foot, point in answer.get("feet_m", {}).items():
        print(f"{foot}: {_millimetres(point)}")
    if "position_m" in answer:
        print(f"position {_millimetres(answer['position_m'])}")
        _print_matrix(answer["rotation"])
    if answer.get("configuration_vector"):
        x, y, z, *approach = answer["configuration_vector"]
        print(f"configuration vector {_millimetres((x, y, z))}  " + _numbers(approach, 6))
    if "vx_m_s" in answer:
        _print_body_speed(answer)
    _print_beyond(answer)


def _print_body_speed(answer: dict[str, Any]) -> None:
    vx, vy = (1000 * answer[key] for key in ("vx_m_s", "vy_m_s"))
    print(f"vx {vx:z.4f} mm/s  vy {vy:z.4f} mm/s  Ω {answer['turn_deg_s']:z.4f} °/s")
    direction, radius = answer["direction_deg"], answer["radius_m"]
    if direction is None:
        print("it stands" if radius is None else "it turns on the spot")
    else:
        path = "straight" if radius is None else f"on a circle of radius {1000 * radius:z.4f} mm"
        print(f"{1000 * answer['speed_m_s']:z.4f} mm/s towards {direction % 360:z.4f}°, {path}")


def ik(
    name: RobotName,
    target: Annotated[
        list[float],
        typer.Argument(
            help="x y z in mm, then the orientation in degrees; for a base on wheels vx vy in mm/s "
            "and Ω in °/s.",
            parser=number,
        ),
    ],
    everything: Annotated[
        bool, typer.Option("--all", help="Print every solution, the chosen one first.")
    ] = False,
    configuration: Annotated[
        bool, "The target is a configuration vector: x y z in mm, the approach vector times e^(roll/π)."
    ] = False,
    json: Json = False,
) -> None:
    """Compute inverse kinematics: the joint positions that reach a target, or the wheel speeds of a base."""
    ask = queries.configuration_answer if configuration else queries.ik_answer
    answer = ask(name, target, everything)
    if json:
        as_json(answer)
        return
    if "wheel_speeds_deg_s" in answer:
        _print_wheel_speeds(answer)
        return
    for solution in answer["solutions"]:
        print(queries.joint_text(solution))
    if answer["missed_m"] > SHOWN_M:
        print(f"for the nearest reachable point, {1000 * answer['missed_m']:.6f} mm away")
    hidden = answer["found"] - len(answer["solutions"])
    if hidden:
        print(f"and {hidden} more: --all")
    if answer["free"]:
        free = " and ".join(answer["free"])
        print(f"{free} can move while the tool stays there: there are infinitely many solutions")
    elif not answer["complete"]:
        print("found by a numerical search: there may be more solutions")


def _print_wheel_speeds(answer: dict[str, Any]) -> None:
    columns = {
        "°/s": [f"{speed:z.4f}" for speed in answer["wheel_speeds_deg_s"]],
        "rim mm/s": [f"{1000 * speed:z.4f}" for speed in answer.get("rim_speeds_m_s", ())],
        "motor turns/s": [f"{turns:z.4f}" for turns in answer.get("motor_turns_per_s", ())],
        "encoder counts/s": [f"{counts:z.1f}" for counts in answer.get("encoder_counts_per_s", ())],
    }
    shown = {title: column for title, column in columns.items() if column}
    rows = [(index, *row) for index, row in enumerate(zip(*shown.values(), strict=True), 1)]
    table("Wheels", ("wheel", *shown), rows)


def jacobian(
    name: RobotName,
    values: JointValues = None,
    frame: Annotated[str, "The reference frame: 0 (base), n (tool) or a frame's number."] = "0",
    rates: Annotated[
        str | None, "Joint speeds, such as '10 0 …' in °/s and mm/s: also print the tool's velocity."
    ] = None,
    analytic: Annotated[
        str | None,
        typer.Option(metavar="ORDER", help="The analytic one: its lower rows are the rates of these angles."),
    ] = None,
    symbolic: Symbolic = False,
    style: Style = "text",
    json: Json = False,
) -> None:
    """Compute the geometric Jacobian at joint positions, and how well the robot moves there."""
    index = count_in(frame)
    wanted: Any = frame if index is None else index
    if symbolic and analytic is not None:
        raise InputError("conflicting-options", "--symbolic shows the geometric Jacobian: omit --analytic")
    if symbolic:
        with status("simplifying"):
            answer = queries.jacobian_symbolic(name, wanted, style)
        print(answer["jacobian"]) if not json else as_json(answer)
        return
    speeds = [number(rate) for rate in (rates or "").replace(",", " ").split()]
    answer = queries.jacobian_answer(name, values or (), wanted, speeds, analytic)
    if json:
        as_json(answer)
        return
    _print_matrix(answer["jacobian"])
    if "inverse" in answer:
        print("inverse")
        _print_matrix(answer["inverse"])
        return
    if "velocity_m_s" in answer:
        print(f"v {_numbers([1000 * component for component in answer['velocity_m_s']])} mm/s")
        print(f"ω {_numbers(answer['angular_velocity_deg_s'])} °/s")
    print(f"manipulability {answer['manipulability']:.6g}, rank {answer['rank']}")
    if answer["singular"]:
        print("singular: the tool cannot move along")
        _print_matrix(answer["lost_directions"])


def statics(
    name: RobotName,
    values: JointValues = None,
    force_n: Annotated[Vector, "The force on the tool or foot in N, in the frame that fk uses."] = NO_VECTOR,
    moment_nm: Annotated[Vector, "The moment on it in N·m, in the same frame."] = NO_VECTOR,
    leg: Annotated[
        str | None, "The leg of a walking robot; the force is then in the frame of its body."
    ] = None,
    json: Json = False,
) -> None:
    """Compute the joint torques of a force on the tool or foot: τ = Jᵀ F, and what the motors must give."""
    answer = queries.statics_answer(name, values or (), force_n, moment_nm, leg)
    if json:
        as_json(answer)
        return
    rows = [
        (
            joint["name"],
            *(f"{joint[f'{part}_{unit}']:z.4f}" for part in ("load", "weight", "motor")),
            {"nm": "N·m", "n": "N"}[unit],
        )
        for joint in answer["joints"]
        for unit in (("nm" if "load_nm" in joint else "n"),)
    ]
    table("Joint loads", ("joint", "load", "own weight", "motor gives", "unit"), rows)
    _print_beyond(answer)


def mobility(
    name: Annotated[
        str | None,
        typer.Argument(
            help="A robot; for a mechanism use --elements and --joint instead.", show_default=False
        ),
    ] = None,
    elements: Annotated[
        int | None, typer.Option(min=1, help="The number of elements of a mechanism, the base included.")
    ] = None,
    joint: Annotated[
        list[str] | None, "KIND or KIND:NUMBER: turning, sliding, screw, cylindrical, universal, spherical."
    ] = None,
    plane: Annotated[bool, "The mechanism is planar: use Grübler's formula instead of Kutzbach's."] = False,
    json: Json = False,
) -> None:
    """Compute the mobility and manoeuvrability of a robot, or of a mechanism of elements and joints."""
    if (name is None) == (elements is None) or (name is not None and (joint or plane)):
        raise InputError(
            "missing-option",
            "give a robot, or the elements and joints of a mechanism",
            hint="servogen mobility --elements 4 --joint turning:4 --plane",
        )
    if elements is not None:
        answer = queries.mechanism_answer(elements, joint or (), plane=plane)
    else:
        answer = queries.mobility_answer(str(name))
    if json:
        as_json(answer)
        return
    kinds: Counter[str] = Counter(answer["joints"])
    counts = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
    print(f"{answer['elements']} elements, joints: {counts or 'none'}")
    print(f"mobility {answer['mobility']}, manoeuvrability {answer['manoeuvrability']}: {answer['verdict']}")
    if answer["note"]:
        print(answer["note"])


def transform(
    text: Annotated[
        str,
        typer.Argument(
            help="A product such as 'Ry(30) Tx(50) Rot(1, 1, 1, 60)', in degrees; inv(…), (…)^-1: inverses."
        ),
    ],
    point: Annotated[
        list[float] | None,
        typer.Argument(help="The point: x y z, or homogeneous X Y Z W.", parser=number, show_default=False),
    ] = None,
    json: Json = False,
) -> None:
    """Compute the matrix of a product of rotations and translations, and where it moves a point."""
    answer = queries.transform_answer(text, point or ())
    if json:
        as_json(answer)
        return
    _print_matrix(answer["matrix"])
    if "point" in answer:
        print("point  " + "  ".join(f"{value:z.4f}" for value in answer["point"]))


def orientation(
    form: Annotated[
        str, typer.Argument(help="rpy, zyz or another order of three axes, axis-angle, quaternion or matrix.")
    ],
    values: Annotated[
        list[float],
        typer.Argument(
            help="Degrees; axis-angle: x y z angle; quaternion: w x y z; matrix: nine numbers, by rows.",
            parser=number,
        ),
    ],
    json: Json = False,
) -> None:
    """Convert an orientation to all other forms."""
    answer = queries.orientation_answer(form, values)
    if json:
        as_json(answer)
        return
    rows = [
        (
            order.lower() + (" (rpy)" if order == "ZYX" else ""),
            *map(_degrees, (first, answer["second_deg"][order])),
        )
        for order, first in answer["angles_deg"].items()
    ]
    table("Angles, degrees", ("order", "angles", "second solution"), rows)
    print("axis        " + "  ".join(f"{value:z.6f}" for value in answer["axis"]))
    print(f"angle       {answer['angle_deg']:z.4f}°")
    print("quaternion  " + "  ".join(f"{value:z.6f}" for value in answer["quaternion"]))
    _print_matrix(answer["matrix"])


def differential(
    text: Annotated[str, typer.Argument(help="The frame T as a product such as 'Trans(10,5,0) Rx(90)'.")],
    translation: Annotated[Vector, "The small translation d, in the product's unit of length."] = NO_VECTOR,
    rotation_rad: Annotated[Vector, "The small rotation δ about x, y, z in radians."] = NO_VECTOR,
    moving: Annotated[bool, "Take d and δ along the axes of T instead of the fixed axes."] = False,
    json: Json = False,
) -> None:
    """Compute how a small motion changes a frame, dT = Δ T, and the same motion seen from the frame."""
    answer = queries.differential_answer(text, translation, rotation_rad, moving=moving)
    if json:
        as_json(answer)
        return
    for title, key in (("T", "matrix"), ("Δ", "delta"), ("dT = Δ T", "change")):
        print(title)
        _print_matrix(answer[key])
    for title, key in (("fixed axes: ", "fixed"), ("axes of T:  ", "moving")):
        d, delta = answer[key]["translation"], answer[key]["rotation_rad"]
        print(f"{title}d {_numbers(d, 6)}  δ {_numbers(delta, 6)} rad")


Coefficient = Annotated[float, typer.Argument(help="A number.", parser=number, show_default=False)]


def equation(a: Coefficient, b: Coefficient, c: Coefficient, json: Json = False) -> None:
    """Solve a cos x + b sin x + c = 0 for x, which inverse kinematics leads to: every solution in degrees."""
    answer = queries.equation_answer(a, b, c)
    if json:
        as_json(answer)
        return
    for x in answer["solutions_deg"]:
        print(f"x = {x:z.6f}°")
    if answer["every_angle"]:
        print("a = b = c = 0: every x is a solution")
    elif answer["amplitude"] == 0.0:
        print("no solution: a = b = 0, and c is not 0")
    elif answer["solutions_deg"]:
        print("and these ± every multiple of 360°")
    else:
        print(f"no solution: |c| = {abs(c):.10g} is greater than √(a² + b²) = {answer['amplitude']:.10g}")


def _numbers(values: Sequence[float], places: int = 4) -> str:
    return "  ".join(f"{value:z.{places}f}" for value in values)


def _print_beyond(answer: dict[str, Any]) -> None:
    if answer.get("beyond_limits"):
        print(f"beyond their limits: {', '.join(answer['beyond_limits'])}")


def _degrees(angles: Sequence[float]) -> str:
    return "  ".join(f"{angle:z9.4f}" for angle in angles)


def _print_matrix(rows: Sequence[Sequence[float]]) -> None:
    for row in rows:
        print("  ".join(f"{value:z10.5f}" for value in row))


def _millimetres(point: Sequence[float]) -> str:
    return "x {:z.4f}  y {:z.4f}  z {:z.4f} mm".format(*(1000 * value for value in point))


def _print_details(details: dict[str, Any]) -> None:
    title = f": {details['title']}" if details["title"] else ""
    source = f"; source: {details['source']}" if details["source"] else ""
    print(f"{details['name']}{title} ({details['kind']})")
    print(f"dimensions: {details['dimensions']}{source}")
    for name, value in details.items():
        if isinstance(value, int | float):
            print(f"{name}: {value:g}")
    arm = details.get("leg", details)
    if "joints" in arm:
        table(
            "Joints",
            ("name", "kind", "from", "to", "home"),
            [
                (
                    joint["name"],
                    joint["kind"],
                    *(_joint_value(joint, key) for key in ("lower", "upper", "home")),
                )
                for joint in arm["joints"]
            ],
        )
        rows = [
            (
                row["joint"] or "fixed",
                f"{row['theta_deg']:zg}°",
                row["d"],
                row["a"],
                f"{row['alpha_deg']:zg}°",
            )
            for row in arm["rows"]
        ]
        table(f"DH rows ({arm['convention']})", ("joint", "theta", "d", "a", "alpha"), rows)
        lengths = [(name, f"{1000 * value:zg} mm") for name, value in arm["lengths_m"].items()]
        if lengths:
            table("Lengths", ("name", "value"), lengths)
    if "mounts" in details:
        mounts = [
            (mount["name"], _millimetres(mount["position_m"]), f"{mount['heading_deg']:zg}°")
            for mount in details["mounts"]
        ]
        table("Mounts", ("leg", "position", "heading"), mounts)
    if "table" in details:
        rows = [
            (
                ", ".join(row["wheels"]),
                row["motion"],
                "–" if row["direction_deg"] is None else row["direction_deg"],
                {1: "counter-clockwise", 0: "–", -1: "clockwise"}[row["turning"]],
                "–" if row["size"] is None else f"{row['size']}, {row['radius_in_wheel_distances']} l",
            )
            for row in details["table"]
        ]
        table("Wheels at equal speed", ("wheels", "motion", "direction °", "turns", "circle, radius"), rows)


def _joint_value(joint: dict[str, Any], key: str) -> str:
    turning = joint["kind"] == "turning"
    return f"{joint[f'{key}_deg']:zg}°" if turning else f"{1000 * joint[f'{key}_m']:zg} mm"
