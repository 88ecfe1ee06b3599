"""``Slip`` on rigid wheels, for compiled rows: whose parts of the force are a matrix."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from trajopt.arrays import Array
from trajopt.limits.forces import least_norm
from trajopt.limits.grip import holds_of, wrench_of_forces
from trajopt.limits.slip import Slip, normals_of
from trajopt.robots.robot import Robot
from trajopt.robots.steering import steering_of
from trajopt.timing.made_up import made_up


def rigid(limit: Slip, robot: Robot) -> bool:
    """Whether every wheel that holds is fixed and driven, and its part of the force a matrix."""
    holds = holds_of(robot)
    swivels = np.isin(holds.wheels, steering_of(robot).castors).any()
    return holds.all_drive and not swivels and limit.rule_of(robot) != "capacity"


@lru_cache(maxsize=64)
def pushes(limit: Slip, robot: Robot) -> list[tuple[Array, Array, float]]:
    """For all wheels that hold, or each: rows (R, 3) on force and angular acceleration, friction
    (K,) of the wheels that hold them, else 0, and the friction that sizes the rows."""
    holds, normals, count = holds_of(robot), normals_of(limit.sides), len(robot.body.contacts)
    mu = np.broadcast_to(np.asarray(limit.friction, dtype=np.float64), count)
    one = np.eye(count)
    if limit.rule_of(robot) == "load":
        push = np.column_stack([normals, np.zeros(len(normals))])
        return [(push, mu * one[holds.wheels].sum(axis=0), float(mu[holds.wheels].mean()))]
    share = least_norm(wrench_of_forces(made_up(1)[0], robot))
    share = share * [1.0, 1.0, robot.body.yaw_inertia / robot.body.mass]
    return [
        (normals @ share[holds.columns(i)], mu * one[i], float(mu[i] / count))
        for i in map(int, holds.wheels)
    ]
