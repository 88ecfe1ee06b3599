"""What only the pages beside [guzman2015] need: a step met by a point cloud, Table 4.4 from
deviations alone."""

from __future__ import annotations

import math

import numpy as np

from trajopt.arrays import Array, fold
from trajopt.systems.smdw.geometry import (
    DoubleWheel,
    Meeting,
    contact_offset,
    faces,
    roles,
)

CLOUD_POINTS = 36_000  # points a contour; spacing 1.8e-5 m on a 0.1 m wheel


def meet_step_cloud(
    wheel: DoubleWheel, theta: float, yaw: float, height: float, points: int = CLOUD_POINTS
) -> Meeting:
    """The same from the point cloud Gamma(theta, alpha) (Eqns. 4.1-4.7), one wheel angle and yaw at
    a time."""
    _, _, nx, ny, facing_lifted, carrying, lifted = roles(wheel, theta, yaw, height)
    near, far = (float(v) for v in faces(wheel, facing_lifted))
    a, b = float(nx), float(ny)
    level = height - wheel.radius
    x, z = _turned(outline(wheel, points), float(carrying))
    k = int(np.argmax(np.where(z <= level, a * x, -np.inf)))
    foremost = float(x[k])
    for j in (
        (k - 1) % points,
        (k + 1) % points,
    ):  # farther where the contour crosses the step's height
        if z[j] > level:
            foremost = max(
                foremost,
                float(x[k] + (x[j] - x[k]) * (level - z[k]) / (z[j] - z[k])),
                key=lambda v: a * v,
            )
    line = a * foremost + b * near
    x, z = _turned(outline(wheel, points), float(lifted))
    beyond = np.flatnonzero(a * x + b * far >= line)
    zero = np.zeros(())
    if beyond.size == 0:
        return Meeting(np.array(False), np.array(np.inf), zero, zero, zero, np.array(line))
    i = int(beyond[np.argmin(z[beyond])])
    at_x, at_z, rise = float(x[i]), float(z[i]), 0.0
    if i != int(
        np.argmin(z)
    ):  # cut off by the line: interpolate to it, along the edge that crosses it
        j = next(
            (k for k in ((i - 1) % points, (i + 1) % points) if a * x[k] + b * far < line),
            (i + 1) % points,
        )
        rise = math.atan((z[j] - z[i]) / (x[j] - x[i])) * math.copysign(1.0, a)
        at_x = (line - b * far) / a
        at_z = float(z[i] + (z[j] - z[i]) * (at_x - x[i]) / (x[j] - x[i]))
    return Meeting(
        np.array(True),
        np.array(wheel.radius + at_z),
        np.array(at_x),
        np.array(math.hypot(at_x, at_z)),
        np.array(-max(rise, 0.0)),
        np.array(line),
    )


def outline(wheel: DoubleWheel, points: int = CLOUD_POINTS) -> Array:
    """(2, points): x and z (m) of one hub's contour, ellipse down (Eqns. 4.1, 4.2)."""
    t = np.arange(points) * (2 * np.pi / points)
    return np.stack(
        [
            wheel.radius * np.cos(t),
            np.where(t < np.pi, wheel.radius, wheel.minor_radius) * np.sin(t),
        ]
    )


def terminal_cost(
    pose_deviation: Array,
    wheel_deviation: Array,
    pose_gains: Array,
    wheel_gains: Array,
    period: float = 2 * np.pi,
) -> float:
    """Table 4.4 from deviations alone: pose (3,), wheels (4,), with gains (3,) and (4,)."""
    return float(
        np.dot(pose_gains, np.abs(pose_deviation))
        + np.dot(wheel_gains, np.abs(fold(np.asarray(wheel_deviation), period)))
    )


def _turned(points: Array, angle: float) -> tuple[Array, Array]:
    """Contour points turned forward by ``angle`` about the axle."""
    s, c = math.sin(angle), math.cos(angle)
    return c * points[0] + s * points[1], -s * points[0] + c * points[1]


def lifting_torque(wheel: DoubleWheel, theta: Array, load: float) -> Array:
    """Quasi-static torque (N m) that lifts ``load`` (N) with a hub on the step: load times contact
    offset."""
    return np.asarray(load * np.abs(contact_offset(wheel, theta)))
