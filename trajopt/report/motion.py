"""A motion as columns: over time, and its exact speed profile."""

from __future__ import annotations

from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.robots.robot import Robot
from trajopt.robots.steering import steering_of
from trajopt.timing.trajectory import Trajectory

SAMPLE_TIME = 0.01  # s, largest step of trajectory.csv; chosen: 100 rows a second


def trajectory_table(trajectory: Trajectory) -> dict[str, Any]:
    """The motion in equal steps of at most 10 ms, a column a name; units in the names.

    Place and posture of the body in the world (``posture``); speeds in the body frame; angles and
    speeds of all wheels, from the trajectory's ``start_wheels`` on, and steering angles and rates
    of those that turn, castors included; ``limit`` names what binds ("" for nothing).
    """
    count = max(2, int(np.ceil(trajectory.duration / SAMPLE_TIME)) + 1)
    times = np.linspace(0.0, trajectory.duration, count)
    state, (s, speed, acceleration) = trajectory.at(times), trajectory.along(times)
    columns: dict[str, Any] = {"t_s": times}
    columns |= dict(zip(("x_m", "y_m", "yaw_rad"), state.pose.T, strict=True))
    roll, pitch = posture(state.rotation)
    columns |= {"z_m": state.position[:, 2], "roll_rad": roll, "pitch_rad": pitch}
    columns |= dict(zip(("vx_m_s", "vy_m_s", "yaw_rate_rad_s"), state.twist.T, strict=True))
    if trajectory.robot is not None:
        steering = steering_of(trajectory.robot)
        wheels = trajectory.robot.description.wheels
        spins = [i for i, wheel in enumerate(wheels) if wheel.kind != "spherical"]
        turns = sorted((*steering.steered, *steering.castors))
        for quantity, values, which in (
            ("angle_rad", state.spin_angles, spins),
            ("speed_rad_s", state.spin_rates, spins),
            ("steering_rad", state.steering_angles, turns),
            ("steering_rate_rad_s", state.steering_rates, turns),
        ):
            columns |= {column(wheels[i].name, quantity): values[:, i] for i in which}
    columns |= {"s_m": s, "s_dot_m_s": speed, "s_ddot_m_s2": acceleration}
    columns["limit"] = binding_at(trajectory, times)
    return columns


def posture(rotation: Array) -> tuple[Array, Array]:
    """Roll and pitch (N,), rad, of axes (N, 3, 3) that are turned by the yaw about the vertical,
    then by the pitch about the body's y axis (> 0: nose down), then by the roll about its x axis
    (> 0: left side up)."""
    roll = np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2])
    return np.asarray(roll), -np.arcsin(np.clip(rotation[:, 2, 0], -1.0, 1.0))


def binding_at(trajectory: Trajectory, times: Array) -> list[str]:
    """Name of the limit that binds at each time (s), "" where none does."""
    interval = np.clip(
        np.searchsorted(trajectory.times, times, side="right") - 1, 0, len(trajectory.sdd) - 1
    )
    return [trajectory.binding[i] for i in interval]


def binding_shares(trajectory: Trajectory) -> dict[str, float]:
    """Share of the duration in which each limit binds, most first; "" for the rest is left out."""
    steps, names = np.diff(trajectory.times) / trajectory.duration, np.array(trajectory.binding)
    shares = {limit.name: float(steps[names == limit.name].sum()) for limit in trajectory.limits}
    return dict(sorted(((k, v) for k, v in shares.items() if v > 0), key=lambda item: -item[1]))


def wheel_columns(quantity: str, values: Array, robot: Robot) -> dict[str, Array]:
    """Columns wheel_<name>_<quantity> of an array (N, W)."""
    return {column(name, quantity): values[:, i] for i, name in enumerate(robot.wheel_names)}


def column(wheel: str, quantity: str) -> str:
    """Name of a column of a wheel."""
    return f"wheel_{wheel.replace('-', '_')}_{quantity}"


def timing_table(trajectory: Trajectory) -> dict[str, Array]:
    """Gridpoints of the speed profile; s'' belongs to the interval after a gridpoint, so the last
    has none."""
    return {
        "u": trajectory.u,
        "s_m": trajectory.s,
        "s_dot_m_s": trajectory.sd,
        "s_ddot_m_s2": np.append(trajectory.sdd, np.nan),
    }
