"""``trajopt robot``: what a described robot is, what its wheels allow, what is wrong with it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from trajopt.cli.shared import (
    FAULTY,
    Force,
    Overrides,
    console,
    overrides,
    require_free,
    simple_table,
)
from trajopt.errors import ArgumentError
from trajopt.report.words import words

if TYPE_CHECKING:
    from trajopt.robots import Robot

_FRICTIONS = (0.4, 0.8)  # chosen: wet and dry floors


def robot(
    name: Annotated[
        str | None,
        typer.Argument(
            help="robot file (*.toml, *.urdf, MJCF *.xml) or name of a shipped robot; without: "
            "lists these",
            show_default=False,
        ),
    ] = None,
    set_: Overrides = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="file for a view from above (*.png, *.pdf, *.svg), or for the robot (*.toml, "
            "*.urdf, MJCF *.xml)",
        ),
    ] = None,
    wheels: Annotated[
        str | None,
        typer.Option("--wheels", help="of *.urdf and *.xml: the joints of the wheels, a,b,c"),
    ] = None,
    force: Force = False,
) -> None:
    """What a robot is: wheels, mobility, checks, and a view from above; robots of other programs
    read and written."""
    from trajopt.robots import Robot, robot_names
    from trajopt.robots import robot as shipped
    from trajopt.robots.checks import findings

    if name is None:
        if set_ or out is not None or wheels is not None:
            expected = "a file or a shipped name, for --set, --out and --wheels"
            raise ArgumentError("robot", None, expected)
        _list([shipped(known) for known in robot_names()])
        return
    require_free("--out", out, force)
    changes = overrides(set_)
    foreign = name.endswith((".urdf", ".xml"))
    if foreign != (wheels is not None):
        raise ArgumentError(
            "--wheels", wheels, "joints a,b,c with a *.urdf or *.xml file, only there"
        )
    if wheels is not None:
        from trajopt.formats import read_robot

        found = read_robot(name, [joint.strip() for joint in wheels.split(",")], changes)
    else:
        file = name.endswith(".toml") or "/" in name
        found = Robot.load(name, changes) if file else shipped(name, changes)
    _describe(found)
    faults = False
    for finding in findings(found):
        mark = ("fault: " if finding.fault else "", "red")
        console.print(words(mark, f"{finding.about}: {finding.text}"))
        faults |= finding.fault
    for about, text in _slopes(found).items():
        console.print(f"{about}: {text}", highlight=False, soft_wrap=True)
    if out is not None:
        console.print(f"written to {_write(found, out)}", soft_wrap=True)
    if faults:
        raise typer.Exit(FAULTY)


def _write(robot: Robot, out: Path) -> Path:
    """A picture, or a file of the robot."""
    if out.suffix == ".toml":
        from trajopt.report.files import robot_toml, write_text

        write_text(out, robot_toml(robot))
    elif out.suffix in (".urdf", ".xml"):
        from trajopt.formats import write_robot

        write_robot(robot, out)
    else:
        from trajopt.report.robot_picture import save_robot_picture

        return save_robot_picture(robot, out)
    return out


def _list(robots: list[Robot]) -> None:
    from trajopt.robots.mobility import mobility_of

    table = simple_table()
    for column in ("robot", "kg", "wheels", "mobility, steerability", "about"):
        table.add_column(column, justify="right" if column == "kg" else "left")
    for one in robots:
        degrees = mobility_of(one)
        allowed = f"{degrees.mobility}, {degrees.steerability}"
        about = one.description.about
        table.add_row(one.name, f"{one.body.mass:g}", _wheels(one), allowed, about)
    console.print(table)


def _describe(robot: Robot) -> None:
    from trajopt.robots.mobility import mobility_of

    degrees, size = mobility_of(robot), robot.description
    console.print(words((robot.name, "bold"), f": {size.about or 'no description'}"))
    lines = [
        f"{size.body.mass:g} kg, wheels: {_wheels(robot)}; driven: "
        + (", ".join(robot.driven) or "none"),
        f"mobility {degrees.mobility}, steerability {degrees.steerability}, manoeuvrability "
        f"{degrees.manoeuvrability}" + (" (skid steering)" if size.skid else ""),
    ]
    for line in lines:
        console.print(line, soft_wrap=True)


def _slopes(robot: Robot) -> dict[str, str]:
    """The steepest slopes straight ahead, and what is not known of them."""
    from trajopt.limits.gradeability import grade_by_friction, grade_by_torque
    from trajopt.limits.torques import knows_torques

    if not knows_torques(robot):
        return {"torque": "not counted in time scaling: no motors, or wheels that slide to turn"}
    try:
        torque = f"{math.degrees(grade_by_torque(robot)):.1f} deg by the torque of its motors"
        grip = [
            f"{math.degrees(grade_by_friction(robot, mu)):.1f} deg by friction {mu}"
            for mu in _FRICTIONS
        ]
    except ArgumentError as error:
        return {"climbs": str(error)}
    return {"climbs": ", ".join([torque, *grip])}


def _wheels(robot: Robot) -> str:
    kinds = ["double" if wheel.double else wheel.kind for wheel in robot.description.wheels]
    return ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
