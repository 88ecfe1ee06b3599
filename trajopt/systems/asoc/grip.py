"""How the wheels of a robot on split offset casters push it: motors, friction wheel by wheel,
slopes.

One implicit step in time. The unknowns are the body's twist and the turning rates of the modules;
mass, wheel motors (the PD loop of [udengaard2008], section 4.3) and ground are in balance:

- a motor pushes with K_p e + K_d e', so a loaded wheel runs behind its command by force over
  stiffness;
- rubber creeps: a wheel that pushes loses a share of its travel, force over load over
  ``SLIP_STIFFNESS``;
- no wheel pushes with more than friction times its load (Coulomb). Beyond that it slides, and the
  force points against the sliding, along the wheel and across it together;
- a wheel that stands on a slope is pushed down it by its load times the slope.

Wheels on the ground carry equal shares of the weight, on a body that stays level; modules have no
mass (both chosen). Friction may be infinite: such wheels creep, but never slide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array
from trajopt.robots.robot import STANDARD_GRAVITY
from trajopt.systems.asoc.modules import TOTAL_MASS, AsocGeometry

PROPORTIONAL = 7.3  # N m s/rad, K_p of [udengaard2008], section 4.3 (unit inferred)
DERIVATIVE = 0.02  # N m s^2/rad, K_d of section 4.3 (unit inferred)
SLIP_STIFFNESS = 12.0  # force over load per share of travel lost, chosen: 5 % at friction 0.6
SIDE_STIFFNESS = (
    100.0  # of a wheel across its plane over that of its motor along it, chosen: nearly rigid
)
FREE_TURNING = 1e-6  # N m s^2/rad over s: a module in the air turns on as it did, chosen
SWEEPS = 15  # of the friction iteration at most; 60 move the error of a whole run by 0.1 % of body length
SETTLED = 1e-4  # m/s and rad/s, change between sweeps that ends the iteration, chosen
OVER = 1.01  # largest force over what friction allows that ends it, chosen


@dataclass(frozen=True, eq=False)
class Motion:
    """Body ``twist`` (M, 3) in body axes, m/s and rad/s; ``turning`` (M, N) of the modules in the
    world, rad/s; speeds of the wheel ``rims`` (M, N, 2), m/s."""

    twist: Array
    turning: Array
    rims: Array

    @classmethod
    def rest(cls, robots: int, modules: int) -> Motion:
        """M robots at rest."""
        return cls(
            np.zeros((robots, 3)), np.zeros((robots, modules)), np.zeros((robots, modules, 2))
        )


@dataclass(frozen=True, eq=False)
class Footing:
    """What the wheels stand on: their inclination ``slope`` (M, N, 2) and the axles' ``tilt`` (M,
    N), rad, and ``touch`` (M, N, 2), 1 for wheels on the ground, 0 for those in the air."""

    slope: Array
    tilt: Array
    touch: Array


def wheel_lag(geometry: AsocGeometry) -> float:
    """Time constant (s) of the PD loop of a wheel that moves its share of the robot: (inertia +
    K_d)/K_p."""
    inertia = TOTAL_MASS * geometry.wheel_radius**2 / (2 * geometry.modules)
    return (inertia + DERIVATIVE) / PROPORTIONAL


def next_motion(
    geometry: AsocGeometry,
    alpha: Array,
    before: Motion,
    wanted: Array,
    footing: Footing,
    friction: float,
    step: float,
) -> Motion:
    """Motion ``step`` s later of M robots whose modules stand at ``alpha`` (M, N), wheel speeds
    ``wanted`` (M, N, 2), m/s; ``friction`` > 0, may be inf.

    Each sweep replaces friction by dampers that give its force at the speeds of the sweep before.
    """
    robots, modules = alpha.shape
    rows = _sliding_rows(geometry, alpha, footing.tilt)
    stiff = PROPORTIONAL / geometry.wheel_radius**2
    held = DERIVATIVE / geometry.wheel_radius**2 / step
    target = (stiff * wanted + held * before.rims) / (stiff + held)
    level = np.cos(footing.slope)
    load = (
        TOTAL_MASS
        * STANDARD_GRAVITY
        / np.maximum(footing.touch.sum(axis=(1, 2)), 1.0)[:, None, None]
    )
    creep = np.abs(before.rims) * level / (SLIP_STIFFNESS * load)
    give = np.stack([level / (stiff + held) + creep, 1 / (SIDE_STIFFNESS * stiff) + creep], axis=-1)
    rolled = np.stack([target * level, np.zeros_like(target)], axis=-1).reshape(robots, -1)
    inertia = (
        np.array(
            [TOTAL_MASS, TOTAL_MASS, TOTAL_MASS * geometry.module_radius**2 / 2]
            + [FREE_TURNING * step] * modules
        )
        / step
    )
    downhill = np.stack(
        [-load * footing.touch * np.tan(footing.slope), np.zeros_like(target)], axis=-1
    )
    state = np.concatenate([_turned(before.twist, step), before.turning], axis=1)
    right = inertia * state + np.einsum("mwi,mw->mi", rows, downhill.reshape(robots, -1))
    most, sliding = (friction * load)[..., None], np.zeros((robots, modules, 2, 1))
    force, done = np.zeros_like(give), np.zeros(robots, dtype=bool)
    for _ in range(SWEEPS):
        damping = footing.touch[..., None] / (give + sliding)
        flat = damping.reshape(robots, -1)
        matrix = inertia * np.eye(3 + modules) + np.einsum("mwi,mw,mwj->mij", rows, flat, rows)
        vector = right + np.einsum("mwi,mw->mi", rows, flat * rolled)
        found = np.linalg.solve(matrix, vector[..., None])[..., 0]
        slip = (np.einsum("mwi,mi->mw", rows, found) - rolled).reshape(give.shape)
        pull = damping * slip
        size = np.linalg.norm(pull, axis=-1, keepdims=True)
        # travel beyond what gives, over the largest force: 0 where friction holds
        sliding = (
            np.linalg.norm(
                slip - give * pull / np.maximum(size / most, 1.0), axis=-1, keepdims=True
            )
            / most
        )
        settled = (np.abs(found - state).max(axis=1) < SETTLED) & np.all(
            size <= OVER * most, axis=(1, 2, 3)
        )
        state = np.where(
            done[:, None], state, found
        )  # a robot that is done stays so, whatever the others need
        force = np.where(done[:, None, None, None], force, pull)
        done |= settled
        if done.all():
            break
    return Motion(state[:, :3], state[:, 3:], target + force[..., 0] / (stiff + held))


def _sliding_rows(geometry: AsocGeometry, alpha: Array, tilt: Array) -> Array:
    """(M, 4 N, 3 + N): speeds of the wheels' contact points along and across their planes, level,
    from body twist and turning rates; wheel 1 at -y of its module, the axle ``offset`` behind the
    module's axis."""
    robots, modules = alpha.shape
    p, c, s = geometry.positions, np.cos(alpha), np.sin(alpha)
    rows = np.zeros((robots, modules, 2, 2, 3 + modules))
    for across, (x, y) in enumerate(((c, s), (-s, c))):
        rows[..., across, :3] = np.stack([x, y, -p[:, 1] * x + p[:, 0] * y], axis=-1)[:, :, None]
    reach = geometry.split / 2 * np.cos(tilt)
    each = np.arange(modules)
    rows[:, each, 0, 0, 3 + each] = reach
    rows[:, each, 1, 0, 3 + each] = -reach
    rows[:, each, :, 1, 3 + each] = -geometry.offset
    return rows.reshape(robots, 4 * modules, 3 + modules)


def _turned(twist: Array, step: float) -> Array:
    """The same velocity in the axes of a body that has turned for a step."""
    angle = twist[:, 2] * step
    c, s = np.cos(angle), np.sin(angle)
    return np.column_stack(
        [c * twist[:, 0] + s * twist[:, 1], c * twist[:, 1] - s * twist[:, 0], twist[:, 2]]
    )
