"""How rollers turn: the one below its wheel rolls on the ground, the others keep still."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt.arrays import Array, IntArray, rotation
from trajopt.report.viewer.pages import packed
from trajopt.robots.robot import Robot
from trajopt.robots.steering import steering_of
from trajopt.simulate.model import Model, Shape

if TYPE_CHECKING:
    from trajopt.report.viewer.motion import Motion


def rim_velocity(
    robot: Robot, twist: Array, steering: Array, steering_rate: Array, spin_rate: Array | None
) -> tuple[Array, Array]:
    """Velocity (N, K, 2), body frame, m/s, of the lowest point of every wheel's rim, and spin rates (N, K), rad/s;
    where these are None, those with which wheels roll."""
    wheels = steering_of(robot)
    place, turn = wheels.place, twist[:, 2:]
    pivot = np.stack(
        [twist[:, :1] - turn * place[:, 1], twist[:, 1:2] + turn * place[:, 0]], axis=2
    )
    angle = wheels.angle + steering
    ahead = np.stack([np.cos(angle), np.sin(angle)], axis=2)
    left = np.stack([-ahead[..., 1], ahead[..., 0]], axis=2)
    swing = turn + steering_rate
    velocity = (
        pivot
        - (swing * wheels.trail)[..., None] * left
        - (swing * wheels.lateral)[..., None] * ahead
    )
    if spin_rate is None:
        spin_rate = np.sum(velocity * ahead, axis=2) / wheels.radius
    return velocity - (spin_rate * wheels.radius)[..., None] * ahead, spin_rate


@dataclass(frozen=True, eq=False)
class Ring:
    """The rollers of a wheel (number in the file): ``links``, which of them is ``lowest`` at each time (N,), and that
    one's level ``axis`` (N, 2), body frame, and ``radius`` (N,), m."""

    wheel: int
    links: list[int]
    lowest: IntArray
    axis: Array
    radius: Array


def rings(motion: Motion, robot: Robot, model: Model) -> list[Ring]:
    """Every wheel that has rollers."""
    found = []
    for wheel, foot in enumerate(model.feet):
        links = [
            i for i, link in enumerate(model.links) if link.parent == foot and model.is_roller[i]
        ]
        if not links:
            continue
        frames = [model.links[i].joint.pose for i in links]
        centres = np.array([frame.place for frame in frames])
        axes = np.array([frame.rotation[:, 2] for frame in frames])
        radii = np.array([max(map(_radius, model.links[i].shapes)) for i in links])
        cos, sin = np.cos(motion.spin[:, wheel]), np.sin(motion.spin[:, wheel])
        down = np.outer(cos, centres[:, 2]) - np.outer(sin, centres[:, 0]) - radii
        lowest = np.argmin(down, axis=1)
        x, y, z = axes[lowest].T
        level = np.column_stack([cos * x + sin * z, y])
        level = level / np.linalg.norm(level, axis=1, keepdims=True)
        angle = robot.description.wheels[wheel].angle
        found.append(Ring(wheel, links, lowest, level @ rotation(angle).T, radii[lowest]))
    return found


def rollers_data(motion: Motion, robot: Robot, model: Model) -> list[dict[str, Any]]:
    """Of each wheel with rollers: its first roller's link, how many there are, which one is lowest at each time, and
    the angle (rad) by which that one turns until the next time."""
    rim, _ = _rim(motion, robot)
    found = []
    for ring in rings(motion, robot, model):
        along = rim[:, ring.wheel]
        across = ring.axis[:, 1] * along[:, 0] - ring.axis[:, 0] * along[:, 1]
        turned = across / ring.radius * np.gradient(motion.times)
        found.append(
            {
                "first": ring.links[0],
                "count": len(ring.links),
                "lowest": packed(ring.lowest),
                "turned": packed(turned),
            }
        )
    return found


def _rim(motion: Motion, robot: Robot) -> tuple[Array, Array]:
    return rim_velocity(
        robot, motion.twist, motion.steering, motion.steering_rate, motion.spin_rate
    )


def _radius(shape: Shape) -> float:
    """Of a roller's shape about its axis, m."""
    return max((float(np.hypot(x, y)) for x, y, _ in shape.corners), default=shape.size[0])
