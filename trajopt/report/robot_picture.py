"""Any robot from above: body, wheels, axles, and where its axles meet: the centre of rotation."""

from __future__ import annotations

from pathlib import Path as FilePath

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle
from numpy.typing import ArrayLike

from trajopt.arrays import Array, rotation
from trajopt.errors import ArgumentError
from trajopt.report.style import (
    BLACK,
    BLUE,
    GREY,
    LIGHT,
    ORANGE,
    VERMILION,
    in_style,
    new_figure,
    save_figure,
)
from trajopt.robots.description import WheelSection
from trajopt.robots.mobility import mobility_of, rotation_centre
from trajopt.robots.robot import Robot
from trajopt.robots.wheel import Wheel, WheelKind, kinematic

_NEAREST_INFINITY = (
    5.0  # centres further away than this many footprint radii are drawn as a direction, chosen
)


def robot_figure(
    robot: Robot, *, steering: ArrayLike | None = None, twist: ArrayLike | None = None
) -> Figure:
    """Figure of a robot at steering angles (W,), rad; with a body ``twist`` (vx, vy, wz) also the
    velocity of each wheel and the instantaneous centre of rotation. Driven wheels are black, free
    ones grey. Raises ArgumentError for wrong shapes."""
    angles = np.array([w.beta for w in robot.wheels])
    if steering is not None:
        angles = np.asarray(steering, dtype=np.float64)
    if angles.shape != (len(robot.wheels),):
        raise ArgumentError("steering", angles.shape, f"one angle a wheel ({len(robot.wheels)})")
    motion = None if twist is None else np.asarray(twist, dtype=np.float64)
    if motion is not None and motion.shape != (3,):
        raise ArgumentError("twist", motion.shape, "(vx, vy, wz)")
    figure = new_figure(5.2, 5.6)
    axes = figure.add_subplot()
    axes.set_aspect("equal")
    size = float(np.max(np.abs(np.array(robot.footprint))))
    _draw_body(axes, robot)
    turned = dict(zip(robot.wheel_names, angles.tolist(), strict=True))
    for section in robot.description.wheels:
        wheel = kinematic(section)
        place = _draw_wheel(axes, robot, section, turned.get(section.name, wheel.beta), size)
        if motion is not None:
            v = motion[:2] + motion[2] * np.array([-place[1], place[0]])
            scale = 0.5 * size / max(float(np.hypot(*motion[:2]) + abs(motion[2]) * size), 1e-12)
            axes.annotate(
                "",
                tuple(place + scale * v),
                tuple(place),
                zorder=5,
                arrowprops={"arrowstyle": "->", "color": BLUE},
            )
    reach = 1.4 * size
    if motion is not None and np.any(motion):
        reach = max(reach, _draw_centre(axes, motion, size))
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    found = mobility_of(robot)
    axes.set_title(
        f"{robot.name}: mobility {found.mobility}, steerability {found.steerability}, "
        f"manoeuvrability {found.manoeuvrability}"
    )
    axes.set_xlabel("x forward (m)")
    axes.set_ylabel("y left (m)")
    return figure


def save_robot_picture(robot: Robot, file: FilePath) -> FilePath:
    """Write the robot from above, PNG, PDF or SVG. Returns ``file``. Raises ArgumentError for another kind."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with in_style():
        return save_figure(robot_figure(robot), file)


def _draw_body(axes: Axes, robot: Robot) -> None:
    """Outline, chassis, origin and centre of gravity."""
    axes.add_patch(
        Polygon(np.array(robot.footprint), closed=True, facecolor="#f6f6f6", edgecolor=GREY)
    )
    body = robot.description.body
    (x, y), (length, width, _) = body.chassis_place, body.chassis
    corner = (x - length / 2, y - width / 2)
    axes.add_patch(Rectangle(corner, length, width, fill=False, edgecolor=LIGHT))
    axes.plot(0, 0, marker="+", color=BLACK, zorder=6)
    axes.plot(*body.cog[:2], marker="x", color=VERMILION, zorder=6)
    axes.annotate(
        "centre of gravity",
        body.cog[:2],
        (6, -12),
        textcoords="offset points",
        color=VERMILION,
        zorder=6,
    )


def _draw_wheel(axes: Axes, robot: Robot, section: WheelSection, beta: float, size: float) -> Array:
    """One wheel with its axle and arm; its place (2,), m."""
    wheel = kinematic(section)
    place, heading = _wheel_place(wheel, beta)
    ahead, left = rotation(heading).T
    colour = BLACK if section.name in robot.driven else GREY
    if wheel.kind in (WheelKind.FIXED, WheelKind.STEERED):
        line = place + np.outer([-2 * size, 2 * size], left)
        axes.plot(*line.T, color=LIGHT, linewidth=0.8, linestyle="--", zorder=1)
    if wheel.kind is WheelKind.CASTOR:
        pivot = np.array(wheel.position)
        arm = np.array([pivot, pivot + wheel.offset * ahead, place])
        axes.plot(*arm.T, color=GREY, linewidth=1.2, zorder=2)
        axes.add_patch(Circle(wheel.position, 0.02 * size, color=GREY, zorder=3))
    if wheel.kind is WheelKind.SPHERICAL:
        axes.add_patch(Circle(wheel.position, wheel.radius, color=colour, zorder=3))
        return place
    half, thick = wheel.radius * ahead, section.width / 2 * left
    corners = [place + half + thick, place - half + thick, place - half - thick]
    axes.add_patch(
        Polygon(np.array([*corners, place + half - thick]), color=colour, zorder=3),
    )
    if wheel.kind is WheelKind.SWEDISH:  # the axis of the roller on the ground
        axis = heading + wheel.gamma
        across = wheel.radius * np.array([np.cos(axis), np.sin(axis)])
        axes.plot(*(place + np.outer([-1, 1], across)).T, color=ORANGE, linewidth=2.0, zorder=4)
    return place


def _draw_centre(axes: Axes, motion: Array, size: float) -> float:
    """Mark the centre of rotation; how far the picture must reach."""
    x, y, w = rotation_centre(motion)
    far = abs(w) * _NEAREST_INFINITY * size < float(np.hypot(x, y))
    plot, text = axes.plot, axes.annotate
    if far:
        direction = np.array([x, y]) / np.hypot(x, y) * size
        text(
            "",
            tuple(1.45 * direction),
            tuple(1.05 * direction),
            arrowprops={"arrowstyle": "->", "color": VERMILION},
        )
        text(
            "centre at infinity",
            tuple(1.25 * direction),
            (0, 8),
            textcoords="offset points",
            color=VERMILION,
            ha="center",
        )
        return 1.6 * size
    plot(x / w, y / w, marker="o", color=VERMILION, zorder=6)
    text("centre of rotation", (x / w, y / w), (6, 6), textcoords="offset points", color=VERMILION)
    return 1.15 * float(np.hypot(x / w, y / w))


def _wheel_place(wheel: Wheel, beta: float) -> tuple[Array, float]:
    """Centre of a wheel (m) and the direction it rolls in (rad), body frame."""
    heading = wheel.alpha + beta - np.pi / 2
    ahead, left = (
        np.array([np.cos(heading), np.sin(heading)]),
        np.array([-np.sin(heading), np.cos(heading)]),
    )
    arm = wheel.offset if wheel.kind is WheelKind.CASTOR else 0.0
    return np.array(wheel.position) + arm * ahead + wheel.lateral * left, heading
