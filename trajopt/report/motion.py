"""A motion as columns: over time, and its exact speed profile."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.limits.torques import knows_torques
from trajopt.robots.robot import Robot
from trajopt.simulate.build import build
from trajopt.simulate.engine import Recording
from trajopt.simulate.model import Model
from trajopt.timing.trajectory import Trajectory

_MOMENTS = 2001  # at which the largest is looked for, chosen
SAMPLE_TIME = 0.01  # s, largest step of trajectory.csv; chosen: 100 rows a second
MOST_ROWS = 20_000  # of trajectory.csv: 200 s in such steps, some 10 MB; chosen
_INSIDE = (
    0.001,
    0.5,
    0.999,
)  # of an interval: where limits are read; not on its ends, rows jump at knots. Chosen


def trajectory_table(trajectory: Trajectory) -> dict[str, Any]:
    """The motion at ``table_times``, a column a name; units in the names.

    Place and posture of the body in the world (``posture``); speeds in the body frame; angles and
    speeds of all wheels, from the trajectory's ``start_wheels`` on, and steering angles and rates
    of those that turn, castors included; ``energy_j``: work of the motors so far; ``limit`` names what binds ("" for nothing).
    """
    times = table_times(trajectory)
    state, (s, speed, acceleration) = trajectory.at(times), trajectory.along(times)
    columns: dict[str, Any] = {"t_s": times}
    columns |= dict(zip(("x_m", "y_m", "yaw_rad"), state.pose.T, strict=True))
    roll, pitch = posture(state.rotation)
    columns |= {"z_m": state.position[:, 2], "roll_rad": roll, "pitch_rad": pitch}
    columns |= dict(zip(("vx_m_s", "vy_m_s", "yaw_rate_rad_s"), state.twist.T, strict=True))
    if trajectory.robot is not None:
        wheels = trajectory.robot.description.wheels
        spins = [i for i, wheel in enumerate(wheels) if wheel.kind != "spherical"]
        names = turning_wheels(trajectory.robot)
        turns = [i for i, wheel in enumerate(wheels) if wheel.name in names]
        for quantity, values, which in (
            ("angle_rad", state.spin_angles, spins),
            ("speed_rad_s", state.spin_rates, spins),
            ("steering_rad", state.steering_angles, turns),
            ("steering_rate_rad_s", state.steering_rates, turns),
        ):
            columns |= {column(wheels[i].name, quantity): values[:, i] for i in which}
    columns |= {"s_m": s, "s_dot_m_s": speed, "s_ddot_m_s2": acceleration}
    if knows_torques(trajectory.robot):
        columns["energy_j"] = np.interp(s, trajectory.s, trajectory.energies)
    columns["limit"] = binding_at(trajectory, times)
    return columns


def table_times(trajectory: Trajectory) -> Array:
    """(N,): equal steps of at most 10 ms; where those were more than 20,001 rows, every cell of the
    speed profile in equal parts instead (cells are short where the motion varies), as many as stay
    below that, so that rows are at least as many as gridpoints."""
    count = max(2, int(min(np.ceil(trajectory.duration / SAMPLE_TIME), MOST_ROWS + 1.0)) + 1)
    if count <= MOST_ROWS + 1:
        return np.linspace(0.0, trajectory.duration, count)
    ends = np.unique(np.concatenate([trajectory.times, trajectory.times - trajectory.waits]))
    ends = np.unique(np.append(0.0, ends))
    parts = max(1, MOST_ROWS // (len(ends) - 1))
    inside = ends[:-1, None] + np.diff(ends)[:, None] * (np.arange(parts) / parts)
    return np.append(inside.ravel(), trajectory.duration)


def sampled(trajectory: Trajectory) -> str:
    """How the rows of ``trajectory_table`` are spread over time, in words."""
    if trajectory.duration <= SAMPLE_TIME * MOST_ROWS:
        return f"equal steps of at most {SAMPLE_TIME:g} s"
    rows = len(table_times(trajectory))
    return f"{rows} rows, parts of the speed profile's cells: steps of {SAMPLE_TIME:g} s were more than {MOST_ROWS} rows"


def posture(rotation: Array) -> tuple[Array, Array]:
    """Roll and pitch (N,), rad, of axes (N, 3, 3) that are turned by the yaw about the vertical,
    then by the pitch about the body's y axis (> 0: nose down), then by the roll about its x axis
    (> 0: left side up)."""
    roll = np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2])
    return np.asarray(roll), -np.arcsin(np.clip(rotation[:, 2, 0], -1.0, 1.0))


def most(trajectory: Trajectory) -> list[tuple[str, str, float]]:
    """What is largest on the way, with its unit, and where (m): pitch and roll on ground that is
    not level, angle and rate of the wheel that steers or swivels most; and rests in which wheels
    turn."""
    times = np.linspace(0.0, trajectory.duration, _MOMENTS)
    state, s = trajectory.at(times), trajectory.along(times)[0]
    found = []
    if not trajectory.ground.level:
        for name, tilt in zip(("roll", "pitch"), posture(state.rotation), strict=True):
            i = int(np.abs(tilt).argmax())
            found.append((name, f"{np.degrees(tilt[i]):.2f} deg", float(s[i])))
    wheels = [] if trajectory.robot is None else list(trajectory.robot.description.wheels)
    for kind, word in (("steered", "steering"), ("castor", "castor")):
        which = [i for i, wheel in enumerate(wheels) if wheel.kind == kind]
        for quantity, values, unit in (
            ("angle", state.steering_angles, "rad"),
            ("rate", state.steering_rates, "rad/s"),
        ):
            if which:
                at, k = divmod(int(np.abs(values[:, which]).argmax()), len(which))
                value, wheel = values[at, which[k]], wheels[which[k]].name
                found.append((f"{word} {quantity}, {wheel}", f"{value:.3f} {unit}", float(s[at])))
    for rest in trajectory.rests:
        found.append(("rest, while wheels turn", f"{rest.duration:.3f} s", rest.s))
    return found


def binding_at(trajectory: Trajectory, times: Array) -> list[str]:
    """Name of the limit that binds at each time (s), "" where none does, or where the robot rests
    while wheels turn."""
    interval = np.clip(
        np.searchsorted(trajectory.times, times, side="right") - 1, 0, len(trajectory.sdd) - 1
    )
    left = trajectory.times[interval + 1] - times
    waits = (left < trajectory.waits[interval + 1]) | (times < trajectory.times[0])
    return ["" if w else trajectory.binding[i] for i, w in zip(interval, waits, strict=True)]


def binding_shares(trajectory: Trajectory) -> dict[str, float]:
    """Share of the duration in which each limit binds, most first; "" for the rest is left out."""
    moving = np.diff(trajectory.times) - trajectory.waits[1:]  # at a rest nothing binds
    steps, names = moving / trajectory.duration, np.array(trajectory.binding)
    shares = {limit.name: float(steps[names == limit.name].sum()) for limit in trajectory.limits}
    return dict(sorted(((k, v) for k, v in shares.items() if v > 0), key=lambda item: -item[1]))


def limit_use(trajectory: Trajectory) -> tuple[Array, Array]:
    """Most of each limit in use between gridpoints, and when: times (s) and shares, both (N + 2,
    L).

    The first and last rows belong to the ends of the motion, the N between to the intervals.

    A share of 1 is all of the limit, more is broken. From the limits' own rows: 1 minus the
    relative margin, as ``Trajectory.margins`` defines it.
    """
    moving = np.diff(trajectory.times) - trajectory.waits[1:]
    shares = np.zeros((len(_INSIDE), len(moving), len(trajectory.limits)))
    times = np.empty((len(_INSIDE), len(moving), 1))
    for j, part in enumerate(_INSIDE):
        times[j, :, 0] = trajectory.times[:-1] + part * moving
        u, s, speed, sdd = trajectory.inside(part)
        sd2 = speed**2
        samples = replace(trajectory.track.samples(s, u), sd2=sd2)
        for k, limit in enumerate(trajectory.limits):
            rows = limit.rows(samples, trajectory.robot)
            with np.errstate(divide="ignore", invalid="ignore"):
                shares[j, :, k] = np.nan_to_num(np.sqrt(sd2 / rows.sd2_max))
            if rows.a.shape[1]:
                beyond = (rows.a * sdd[:, None] + rows.b * sd2[:, None] - rows.c) / rows.scale
                shares[j, :, k] = np.maximum(shares[j, :, k], 1.0 + beyond.max(axis=1))
    times = np.broadcast_to(times, shares.shape)
    most = shares.argmax(axis=0)[None]
    curves = (
        np.vstack([v[0, :1], np.take_along_axis(v, most, axis=0)[0], v[-1, -1:]])
        for v in (times, shares)
    )
    return next(curves), next(curves)


def turning_wheels(robot: Robot) -> list[str]:
    """Names of its steered wheels and castors."""
    return [w.name for w in robot.description.wheels if w.kind in ("steered", "castor")]


def wheel_columns(quantity: str, values: Array, robot: Robot) -> dict[str, Array]:
    """Columns wheel_<name>_<quantity> of an array (N, W)."""
    return {column(name, quantity): values[:, i] for i, name in enumerate(robot.wheel_names)}


def column(wheel: str, quantity: str) -> str:
    """Name of a column of a wheel."""
    return f"wheel_{wheel.replace('-', '_')}_{quantity}"


def given_columns(recording: Recording, robot: Robot) -> dict[str, Array]:
    """What a check's recording tells of how wheels slide, ahead and to the left, m/s, and of joints that give: springs
    (m) and axles that tilt (rad)."""
    wheels, model = robot.description.wheels, build(robot, outline=False)
    found = {
        column(wheel.name, f"slip_{way}_m_s"): recording.sliding[:, i, k]
        for i, wheel in enumerate(wheels)
        for k, way in enumerate(("ahead", "left"))
    }
    joints = joint_columns(model)
    return found | {name: recording.suspension[:, k] for k, name in enumerate(joints)}


def joint_columns(model: Model) -> dict[str, int]:
    """Names of the columns of joints that give, and the links they carry."""
    links = {i: model.links[i] for i in model.suspension}
    return {
        f"joint_{link.name.replace('-', '_').replace('/', '_')}_{'m' if link.joint.role == 'spring' else 'rad'}": i
        for i, link in links.items()
    }


def timing_table(trajectory: Trajectory) -> dict[str, Array]:
    """Gridpoints of the speed profile; s'' belongs to the interval after a gridpoint, so the last
    has none. Where it is not constant there, the motion is told by sigma' and by sigma'' at both
    ends of the interval (sigma: ``timing/spread.py``)."""
    table = {
        "u": trajectory.u,
        "s_m": trajectory.s,
        "s_dot_m_s": trajectory.sd,
        "s_ddot_m_s2": np.append(trajectory.sdd, np.nan),
    }
    profile = trajectory.profile
    empty = np.full(len(trajectory.u), np.nan)
    table["sigma_dot_squared_m2_s2"] = empty if profile is None else profile.y
    for end in ("first", "last"):
        pull = empty if profile is None else np.append(getattr(profile, end), np.nan)
        table[f"sigma_ddot_{end}_m_s2"] = pull
    return table
