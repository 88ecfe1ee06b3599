"""Motions as the page plays them: poses and joint angles of every link at sampled times."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.ndimage import uniform_filter1d

from trajopt.arrays import Array, rotation
from trajopt.report.motion import column, given_columns, joint_columns
from trajopt.report.viewer.pages import packed
from trajopt.report.viewer.robot_data import wheel_of_joint
from trajopt.report.viewer.rollers import rim_velocity, rollers_data
from trajopt.robots.robot import Robot
from trajopt.simulate.build import build
from trajopt.timing.trajectory import Trajectory

if TYPE_CHECKING:
    from trajopt.simulate.engine import Recording

STEP = 0.01  # s between samples, chosen: a wheel that accelerates by 80 rad/s^2 is 1e-3 rad off between them
SMOOTH = 0.1  # s over which loads and slip are averaged for the eye, chosen
MOST = 1500  # samples of a motion; longer ones are thinned, chosen


@dataclass(frozen=True, eq=False)
class Motion:
    """``times`` (N,) s, ``place`` (N, 3) m and ``rotation`` (N, 3, 3) of the robot's frame, ``twist`` (N, 3) in it,
    angles and rates (N, K) of all wheels of the robot's file, rad; ``loads`` (N, K) N and ``sliding`` (N, K, 2) m/s ahead
    and to the left, where known, and ``given`` (N,) m or rad of links that give."""

    name: str
    times: Array
    place: Array
    rotation: Array
    twist: Array
    spin: Array
    spin_rate: Array
    steering: Array
    steering_rate: Array
    loads: Array | None = None
    sliding: Array | None = None
    given: Mapping[int, Array] = field(default_factory=dict)


def planned(trajectory: Trajectory, name: str = "planned") -> Motion:
    """A trajectory in equal steps."""
    count = min(MOST, max(2, int(np.ceil(trajectory.duration / STEP)) + 1))
    times = np.linspace(0.0, trajectory.duration, count)
    state = trajectory.at(times)
    return Motion(
        name, times, state.position, state.rotation, state.twist, state.spin_angles,
        state.spin_rates, state.steering_angles, state.steering_rates,
    )  # fmt: skip


def recorded_columns(recording: Recording, robot: Robot) -> dict[str, Array]:
    """The columns of ``simulated.csv`` that a page needs."""
    x, y, yaw = recording.pose.T
    table = {"t_s": recording.times, "x_m": x, "y_m": y, "z_m": recording.height, "yaw_rad": yaw}
    table |= {"roll_rad": recording.roll, "pitch_rad": recording.pitch}
    steering = build(robot).steering(recording.angles, recording.swivels)
    every = [wheel.name for wheel in robot.description.wheels]
    for quantity, values, names in (
        ("angle_rad", recording.wheel_angles, robot.wheel_names),
        ("speed_rad_s", recording.wheel_speeds, robot.wheel_names),
        ("steering_rad", steering, every),
        ("load_n", recording.loads, every),
    ):
        table |= {column(names[k], quantity): values[:, k] for k in range(len(names))}
    return table | given_columns(recording, robot)


def simulated(table: Mapping[str, Array], robot: Robot, name: str) -> Motion:
    """What ``simulated.csv`` holds, thinned where it is long."""
    count, loads, sliding = len(table["t_s"]), *_forces(table, robot)
    kept = np.unique(np.linspace(0, count - 1, min(count, MOST)).round().astype(int))
    table = {key: values[kept] for key, values in table.items()}
    joints = joint_columns(build(robot, outline=False))
    times = table["t_s"]
    none = np.zeros(len(times))
    yaw, pitch, roll = (table.get(f"{k}_rad", none) for k in ("yaw", "pitch", "roll"))
    place = np.column_stack([table["x_m"], table["y_m"], table.get("z_m", none)])
    velocity = np.gradient(place[:, :2], times, axis=0)
    ahead = np.einsum("nij,ni->nj", rotation(yaw), velocity)
    twist = np.column_stack([ahead, np.gradient(yaw, times)])
    wheels = robot.description.wheels
    steering = np.column_stack([table.get(column(w.name, "steering_rad"), none) for w in wheels])
    steering_rate = np.asarray(np.gradient(steering, times, axis=0))
    spin_rate = rim_velocity(robot, twist, steering, steering_rate, None)[1]
    for k, wheel in enumerate(wheels):
        spin_rate[:, k] = table.get(column(wheel.name, "speed_rad_s"), spin_rate[:, k])
    spin = np.vstack([np.zeros(len(wheels)), np.cumsum(
        (spin_rate[1:] + spin_rate[:-1]) / 2 * np.diff(times)[:, None], axis=0)])  # fmt: skip
    for k, wheel in enumerate(wheels):
        spin[:, k] = table.get(column(wheel.name, "angle_rad"), spin[:, k])
    return Motion(
        name, times, place, _attitude(roll, pitch, yaw), twist, spin, spin_rate, steering,
        steering_rate, None if loads is None else loads[kept], None if sliding is None else sliding[kept],
        {link: table[name] for name, link in joints.items() if name in table},
    )  # fmt: skip


def motion_data(motion: Motion, robot: Robot) -> dict[str, Any]:
    """A motion for the page: the robot's frame, every joint that turns, rollers, and forces as arrows."""
    model = build(robot, outline=False)
    joints = {}
    for link, wheel in wheel_of_joint(model).items():
        of_spin = model.links[link].joint.role == "spin"
        values = (motion.spin if of_spin else motion.steering)[:, wheel]
        if np.any(values):
            joints[str(link)] = packed(values)
    joints |= {str(link): packed(values) for link, values in motion.given.items()}
    found: dict[str, Any] = {
        "name": motion.name,
        "times": packed(motion.times),
        "base": packed(np.column_stack([motion.place, _quaternions(motion.rotation)])),
        "joints": joints,
        "rollers": rollers_data(motion, robot, model),
    }
    if motion.loads is not None:
        found["loads"] = packed(motion.loads)
    if motion.sliding is not None:
        found["slip"] = packed(motion.sliding)
    return found


def _forces(table: Mapping[str, Array], robot: Robot) -> tuple[Array | None, Array | None]:
    """Loads (N, K), N, and how wheels slide (N, K, 2), m/s, in the mean over ``SMOOTH``: contacts of rollers chatter. A
    wheel slides as it does under load."""
    loads, ahead, left = (
        _every_wheel(table, robot, unit) for unit in ("load_n", "slip_ahead_m_s", "slip_left_m_s")
    )
    if loads is None or ahead is None or left is None:
        return None, None
    count = max(1, round(SMOOTH * (len(loads) - 1) / float(np.ptp(table["t_s"]))))

    def mean(values: Array) -> Array:
        return np.asarray(uniform_filter1d(values, count, axis=0, mode="nearest"))

    weight = np.maximum(mean(loads), 1e-9)
    sliding = np.stack([mean(loads * part) / weight for part in (ahead, left)], axis=2)
    return mean(loads), sliding


def _every_wheel(table: Mapping[str, Array], robot: Robot, unit: str) -> Array | None:
    keys = [column(wheel.name, unit) for wheel in robot.description.wheels]
    return np.column_stack([table[key] for key in keys]) if all(k in table for k in keys) else None


def _attitude(roll: Array, pitch: Array, yaw: Array) -> Array:
    """(N, 3, 3): turned by roll about x, then by pitch about y, then by yaw about z."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(a), np.sin(a)) for a in (roll, pitch, yaw))
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _quaternions(turns: Array) -> Array:
    """(N, 4): x, y, z, w of rotation matrices, without jumps of sign."""
    from scipy.spatial.transform import Rotation

    found = Rotation.from_matrix(turns).as_quat()
    flips = np.sign(np.sum(found[1:] * found[:-1], axis=1))
    found[1:] *= np.cumprod(np.where(flips < 0, -1.0, 1.0))[:, None]
    return np.asarray(found)
