"""Loads of the contacts, and the places that hold the robot up.

Wheels bear where they touch the ground. The axle of a pivot with ``tilt = "passive"`` turns freely
about its fore-aft axis, which passes through the axle's middle as high as the wheels' centres. No
moment acts about that axis: sum l N + r F = 0, with l the wheels' places to the left of the middle,
N their loads, r their radius and F the force across on all of them. The robot stands on the axle's
middle, and what acts across there acts at the height of the axis.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.errors import ArgumentError
from trajopt.limits.forces import Affine, contact_arms, least_norm, load_demand
from trajopt.limits.grip import contact_forces, holds_of
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot
from trajopt.robots.steering import steering_of


def contact_loads(path: PathSamples, robot: Robot) -> Affine:
    """(N, K): normal force on every contact, m/s^2 (times the mass: N).

    Force along the normal, pitch and roll balance give three equations, and every axle that tilts
    one. Where more contacts share the load, ground and suspension are equally stiff everywhere: the
    distribution of least norm. Raises ArgumentError when what holds the body up lies on one line.
    """
    arms, demand, axles = contact_arms(path, robot), load_demand(path, robot.body), _axles(robot)
    balance = np.concatenate([np.ones((*arms.shape[:-1], 1)), arms], axis=-1).swapaxes(-1, -2)
    if axles:
        lateral = np.zeros((len(axles), arms.shape[-2]))
        for row, axle in zip(lateral, axles, strict=True):
            row[axle] = steering_of(robot).lateral[axle]
        shape = (*balance.shape[:-2], *lateral.shape)
        balance = np.concatenate([balance, np.broadcast_to(lateral, shape)], axis=-2)
        demand = Affine.beside(demand, _axle_moments(path, robot))
    first = balance[0] if balance.ndim == 3 else balance
    if np.linalg.matrix_rank(first) < len(first):
        raise ArgumentError(
            "robot.body.contacts", robot.body.contacts, "three or more contacts not on one line"
        )
    return demand.through(least_norm(balance))


def supports(path: PathSamples, robot: Robot) -> tuple[Array, Affine]:
    """Places (S, 2), or (N, S, 2) where castors swivel, from the centre of gravity, m: wheels, and
    the middles of axles that tilt. And (N, 3): what the loads M there, at x, y, must sum to:
    sum M, sum x M, sum y M."""
    arms, demand, axles = contact_arms(path, robot), load_demand(path, robot.body), _axles(robot)
    if not axles:
        return arms, demand
    steering, tilting = steering_of(robot), [axle[0] for axle in axles]
    angle = steering.angle if path.wheels is None else steering.angle + path.wheels.steering
    left = np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
    middles = arms - steering.lateral[:, None] * left
    alone = np.setdiff1d(np.arange(len(steering.names)), np.concatenate(axles))
    places = np.concatenate([arms[..., alone, :], middles[..., tilting, :]], axis=-2)
    off = -left[..., tilting, :].swapaxes(-1, -2)
    rows = np.concatenate([np.zeros((*off.shape[:-2], 1, len(axles))), off], axis=-2)
    return places, demand + _axle_moments(path, robot).through(rows)


@lru_cache(maxsize=64)
def _axles(robot: Robot) -> tuple[IndexArray, ...]:
    """The wheels on each axle that tilts freely."""
    names = steering_of(robot).names
    return tuple(
        np.array([names.index(name) for name in pivot.wheels], dtype=np.intp)
        for pivot in robot.description.pivots
        if pivot.tilt == "passive"
    )


def _axle_moments(path: PathSamples, robot: Robot) -> Affine:
    """(N, P): what sum l N has to be for each of ``_axles``, m^2/s^2."""
    axles, count = _axles(robot), len(path.s)
    if not robot.driven:  # castors that nothing drives hold nothing across
        return Affine(*np.zeros((3, count, len(axles))))
    holds, radius = holds_of(robot), steering_of(robot).radius
    across = -radius[holds.wheel] * np.sin(holds.direction)
    lever = np.array([np.where(np.isin(holds.wheel, axle), across, 0.0) for axle in axles])
    return contact_forces(path, robot).through(lever)
