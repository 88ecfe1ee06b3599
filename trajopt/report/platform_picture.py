"""Any platform from above: body, wheels, axles, and where its axles meet: the centre of
rotation."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from numpy.typing import ArrayLike

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.report.style import BLACK, BLUE, GREY, LIGHT, ORANGE, VERMILION, new_figure
from trajopt.robots.mobility import mobility_of, rotation_centre
from trajopt.robots.robot import Robot
from trajopt.robots.wheel import Wheel, WheelKind

_WIDTH_SHARE = 0.35  # drawn wheel width over diameter, chosen
_NEAREST_INFINITY = (
    5.0  # centres further away than this many footprint radii are drawn as a direction, chosen
)


def platform_figure(
    platform: Robot, *, steering: ArrayLike | None = None, twist: ArrayLike | None = None
) -> Figure:
    """Figure of a platform at steering angles (W,), rad; with a body ``twist`` (vx, vy, wz) also
    the velocity of each wheel and the instantaneous centre of rotation. Raises ArgumentError for
    wrong shapes."""
    angles = (
        np.array([w.beta for w in platform.wheels])
        if steering is None
        else np.asarray(steering, dtype=float)
    )
    if angles.shape != (len(platform.wheels),):
        raise ArgumentError("steering", angles.shape, f"one angle a wheel ({len(platform.wheels)})")
    motion = None if twist is None else np.asarray(twist, dtype=np.float64)
    if motion is not None and motion.shape != (3,):
        raise ArgumentError("twist", motion.shape, "(vx, vy, wz)")
    figure = new_figure(5.2, 5.6)
    axes = figure.add_subplot()
    axes.set_aspect("equal")
    axes.add_patch(
        Polygon(np.array(platform.footprint), closed=True, facecolor="#f6f6f6", edgecolor=GREY)
    )
    size = float(np.max(np.abs(np.array(platform.footprint))))
    for wheel, beta in zip(platform.wheels, angles.tolist(), strict=True):
        place, heading = _wheel_place(wheel, beta)
        ahead, left = (
            np.array([np.cos(heading), np.sin(heading)]),
            np.array([-np.sin(heading), np.cos(heading)]),
        )
        if wheel.kind is not WheelKind.SWEDISH and wheel.kind is not WheelKind.CASTOR:
            line = place + np.outer([-2 * size, 2 * size], left)
            axes.plot(*line.T, color=LIGHT, linewidth=0.8, linestyle="--", zorder=1)
        if wheel.kind is WheelKind.CASTOR:
            pivot = np.array(wheel.position)
            axes.plot(
                *np.array([pivot, pivot + wheel.offset * ahead, place]).T,
                color=GREY,
                linewidth=1.2,
                zorder=2,
            )
            axes.add_patch(
                Circle((float(pivot[0]), float(pivot[1])), 0.02 * size, color=GREY, zorder=3)
            )
        half, thick = wheel.radius * ahead, _WIDTH_SHARE * wheel.radius * left
        axes.add_patch(
            Polygon(
                np.array(
                    [
                        place + half + thick,
                        place - half + thick,
                        place - half - thick,
                        place + half - thick,
                    ]
                ),
                facecolor=BLACK,
                edgecolor=BLACK,
                zorder=3,
            )
        )
        if wheel.kind is WheelKind.SWEDISH:  # the axis of the roller on the ground
            axis = heading + wheel.gamma
            roller = place + np.outer(
                [-1, 1], wheel.radius * np.array([np.cos(axis), np.sin(axis)])
            )
            axes.plot(*roller.T, color=ORANGE, linewidth=2.0, zorder=4)
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
    axes.plot(0, 0, marker="+", color=BLACK)
    reach = 1.4 * size
    if motion is not None and np.any(motion):
        reach = max(reach, _draw_centre(axes, motion, size))
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    found = mobility_of(platform)
    axes.set_title(
        f"{platform.name}: mobility {found.mobility}, steerability {found.steerability}, "
        f"manoeuvrability {found.manoeuvrability}"
    )
    axes.set_xlabel("x forward, m")
    axes.set_ylabel("y left, m")
    return figure


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
