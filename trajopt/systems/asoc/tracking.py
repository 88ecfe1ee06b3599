"""Path tracking of a robot on split offset casters over rough ground ([udengaard2008], sections 4.2
and 4.3).

Wheels stand on the triangulated ground; module tilt beta and wheel inclination gamma follow from
the contacts (eq. 20). The body is taken to stay level on its suspension (chosen). What the wheels
do to it is in trajopt.systems.asoc.grip: friction holds them wheel by wheel, and where a command
asks for more, as in a corner at full speed, they slide, which odometry does not know. A wheel that
the ground leaves faster than its suspension can follow is in the air and pushes nothing, which
odometry does not know either. Several robots run at once, each on its own place on the ground.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array, require_positive
from trajopt.errors import ArgumentError
from trajopt.robots.robot import STANDARD_GRAVITY
from trajopt.systems.asoc.grip import Footing, Motion, next_motion
from trajopt.systems.asoc.modules import (
    AsocGeometry,
    link_velocities,
    module_inverse,
    wheel_positions,
)
from trajopt.systems.asoc.reference import Reference
from trajopt.world.height_map import HeightMap
from trajopt.world.wheel_contact import wheel_contact

FRICTION = 0.6  # [udengaard2008], section 4.3
UPDATE_PERIOD = 2.0  # s, position updates at 0.5 Hz (section 4.3)
POSITION_GAIN = 2.0  # 1/s, feedback of the pose error onto the commanded body velocity, chosen
PRELOAD = 3.0  # downward acceleration of a wheel that lost the ground over g: spring over wheel mass, chosen
STEEPEST = np.radians(
    75.0
)  # rad, inclination beyond which the controller's cosines stop helping, chosen
STEP = 0.01  # s between two commands, as in the physics engines; half of it moves the RMS error at
# 1.5 m/s by 0.3 % of body length on level ground and 0.7 % at sigma 3 cm, with planned corners by
# 0.1 %


@dataclass(frozen=True)
class Knowledge:
    """What the controller knows (Table X): local ground inclination, and absolute pose every
    ``update_period`` s (0: always, inf: never; dead reckoning in between)."""

    terrain: bool = True
    update_period: float = 0.0

    def __post_init__(self) -> None:
        if not self.update_period >= 0:
            raise ArgumentError(
                "update_period", self.update_period, "a period >= 0 s (0: always, inf: never)"
            )


@dataclass(frozen=True, eq=False)
class Tracking:
    """What happened at times (n,): true ``pose`` and the controller's ``estimate`` (n, 3), the
    ``wanted`` position (n, 2), wheel inclinations (n, W) and module tilts (n, N), rad, which wheels
    were ``airborne`` (n, W), and the distance from the path, m."""

    times: Array
    pose: Array
    estimate: Array
    wanted: Array
    inclination: Array
    tilt: Array
    airborne: Array
    cross_track: Array

    @property
    def rms(self) -> float:
        """RMS distance (m) from the point of the path that was due at the time: our reading of the
        thesis's "RMS path tracking error" of a commanded velocity profile."""
        return float(np.sqrt(np.mean(np.sum((self.pose[:, :2] - self.wanted) ** 2, axis=1))))

    @property
    def rms_across(self) -> float:
        """RMS distance (m) from the nearest point of the path. It rewards a robot that comes late
        to a sharp corner, so it does not order controllers by what they know."""
        return float(np.sqrt(np.mean(self.cross_track**2)))

    @property
    def speed(self) -> Array:
        """(n - 1,): speed of the robot's centre, m/s (Figure 30)."""
        return np.asarray(np.hypot(*np.diff(self.pose[:, :2], axis=0).T) / np.diff(self.times))


def wheel_commands(
    geometry: AsocGeometry, alpha: Array, twist: Array, tilt: Array, inclination: Array
) -> Array:
    """(..., N, 2): wheel speeds (m/s) for a body twist (..., 3), eqs. 17 and 20. ``alpha`` and
    ``tilt`` (..., N), ``inclination`` (..., N, 2), rad; zeros give the flat-ground eq. 19."""
    links = link_velocities(geometry.positions, twist)
    along = np.einsum(
        "...nij,...nj->...ni", module_inverse(alpha, geometry.split, geometry.offset, tilt), links
    )
    return np.asarray(along / np.cos(inclination))


def body_twist(
    geometry: AsocGeometry, alpha: Array, speeds: Array, tilt: Array, inclination: Array
) -> Array:
    """(..., 3): body twist that fits the rolling wheels best (eqs. 17, 20 backwards, least
    squares): odometry."""
    inverse = module_inverse(alpha, geometry.split, geometry.offset, tilt)
    p = geometry.positions
    turn = -p[:, 1, None] * inverse[..., 0] + p[:, 0, None] * inverse[..., 1]
    rows = np.concatenate([inverse, turn[..., None]], axis=-1)  # (..., N, 2, 3)
    right = np.einsum("...nwi,...nw->...i", rows, speeds * np.cos(inclination))
    gram = np.einsum("...nwi,...nwj->...ij", rows, rows)
    return np.asarray(np.linalg.solve(gram, right[..., None])[..., 0])


def ground_angles(
    geometry: AsocGeometry, ground: HeightMap, pose: Array, alpha: Array
) -> tuple[Array, Array, Array]:
    """Module tilts beta (..., N), wheel inclinations gamma (..., N, 2), rad, and heights of the
    wheel centres (..., N, 2), m, of robots standing at poses (..., 3).

    The tilt is that of the axle between the two wheel centres, at most ``STEEPEST``.
    """
    c, s = np.cos(pose[..., 2])[..., None, None], np.sin(pose[..., 2])[..., None, None]
    local = wheel_positions(geometry, alpha)
    x = pose[..., 0][..., None, None] + c * local[..., 0] - s * local[..., 1]
    y = pose[..., 1][..., None, None] + s * local[..., 0] + c * local[..., 1]
    heading = np.broadcast_to((alpha + pose[..., 2:])[..., None], x.shape)
    contact = wheel_contact(ground, x.ravel(), y.ravel(), heading.ravel(), geometry.wheel_radius)
    heights = contact.centre_height.reshape(x.shape)
    tilt = np.arctan((heights[..., 1] - heights[..., 0]) / geometry.split)
    inclination = np.clip(contact.inclination, -STEEPEST, STEEPEST).reshape(x.shape)
    return np.clip(tilt, -STEEPEST, STEEPEST), inclination, heights


def track(
    geometry: AsocGeometry,
    ground: HeightMap,
    reference: Reference,
    knowledge: Knowledge,
    *,
    friction: float = FRICTION,
    step: float = STEP,
) -> Tracking:
    """One robot from the reference's start; see ``track_many``."""
    return track_many(
        geometry, ground, reference, [knowledge], np.zeros((1, 2)), friction=friction, step=step
    )[0]


def track_many(
    geometry: AsocGeometry,
    ground: HeightMap,
    reference: Reference,
    knowledge: Sequence[Knowledge],
    origins: Array,
    *,
    friction: float = FRICTION,
    step: float = STEP,
) -> list[Tracking]:
    """M robots drive along ``reference``, robot k moved by ``origins[k]`` (M, 2) m; heading 0,
    modules trailing the first motion. Deterministic: the ground carries all randomness.

    ``friction`` inf is the reading without slip: wheels that never slide, only creep. A corner at
    full speed then costs next to nothing, so what the robot knows decides the error alone; with
    finite friction the slide in the corners covers it.

    Raises ArgumentError for a friction or step <= 0, a step that is not finite, or not one origin a
    robot.
    """
    if not friction > 0:
        raise ArgumentError("friction", friction, "a value > 0 (inf: wheels never slide)")
    require_positive("step", step, "s")
    if np.shape(origins) != (len(knowledge), 2) or len(knowledge) == 0:
        raise ArgumentError(
            "origins", np.shape(origins), f"shape ({len(knowledge)}, 2): one place a robot"
        )
    rows = _driven(geometry, ground, reference, knowledge, origins, friction, step)
    pose, estimate, wanted, inclination, tilt, airborne = (
        np.array(c) for c in zip(*rows, strict=True)
    )
    times = np.asarray(step * np.arange(len(rows)), dtype=np.float64)
    shift = np.column_stack([origins, np.zeros(len(origins))])
    return [
        Tracking(
            times,
            pose[:, k] - shift[k],
            estimate[:, k] - shift[k],
            wanted,
            inclination[:, k].reshape(len(times), -1),
            tilt[:, k],
            airborne[:, k].reshape(len(times), -1),
            reference.distance(pose[:, k, :2] - origins[k]),
        )
        for k in range(len(knowledge))
    ]


def _driven(
    geometry: AsocGeometry,
    ground: HeightMap,
    reference: Reference,
    knowledge: Sequence[Knowledge],
    origins: Array,
    friction: float,
    step: float,
) -> list[tuple[Array, ...]]:
    """State of all robots before each step."""
    robots, modules = len(knowledge), geometry.modules
    period, due = np.array([k.update_period for k in knowledge]), np.zeros(robots)
    sees = np.array([k.terrain for k in knowledge], dtype=np.float64)[:, None]
    first = reference.at(step)[1]
    alpha = np.full((robots, modules), float(np.arctan2(first[1], first[0])))
    pose = np.column_stack([origins + reference.at(0.0)[0], np.zeros(robots)])
    estimate, motion, still = (
        pose.copy(),
        Motion.rest(robots, modules),
        np.zeros((robots, modules, 2)),
    )
    wheel = _Wheels(ground_angles(geometry, ground, pose, alpha)[2], still, still)
    rows: list[tuple[Array, ...]] = []
    for moment in np.arange(0.0, reference.duration + step / 2, step):
        tilt, slope, heights = ground_angles(geometry, ground, pose, alpha)
        wheel = wheel.follow(heights, step)
        updated = moment >= due - 1e-9
        estimate = np.where(updated[:, None], pose, estimate)
        due = np.where(updated, due + period, due)
        place, velocity = reference.at(float(moment))
        rows.append((pose, estimate, place, slope, tilt, wheel.airborne))
        known = tilt * sees, slope * sees[..., None]
        wanted = wheel_commands(
            geometry, alpha, commanded_twist(estimate, place + origins, velocity), *known
        )
        motion = next_motion(
            geometry,
            alpha,
            motion,
            wanted,
            Footing(slope, tilt, 1.0 - wheel.airborne),
            friction,
            step,
        )
        guess = body_twist(geometry, alpha, motion.rims, *known)
        pose, estimate = moved_poses(pose, motion.twist, step), moved_poses(estimate, guess, step)
        alpha = alpha + step * (motion.turning - motion.twist[:, 2:])
    return rows


@dataclass(frozen=True, eq=False)
class _Wheels:
    """Height (m) and vertical speed (m/s) of the wheel centres."""

    height: Array
    speed: Array
    airborne: Array

    def follow(self, ground: Array, step: float) -> _Wheels:
        """After a step: on the ground, or in the air where it falls away faster than the suspension
        pushes."""
        speed = self.speed - PRELOAD * STANDARD_GRAVITY * step
        free = self.height + speed * step
        flies = free > ground
        return _Wheels(
            np.where(flies, free, ground),
            np.where(flies, speed, (ground - self.height) / step),
            flies.astype(np.float64),
        )


def commanded_twist(estimate: Array, place: Array, velocity: Array) -> Array:
    """(M, 3): body twist from the wanted world velocity and the pose error as the controller sees
    it."""
    world = velocity + POSITION_GAIN * (place - estimate[:, :2])
    c, s = np.cos(estimate[:, 2]), np.sin(estimate[:, 2])
    return np.column_stack(
        [
            c * world[:, 0] + s * world[:, 1],
            -s * world[:, 0] + c * world[:, 1],
            -POSITION_GAIN * estimate[:, 2],
        ]
    )


def moved_poses(pose: Array, twist: Array, step: float) -> Array:
    """Poses (M, 3) after a step with constant body twists (midpoint heading)."""
    middle = pose[:, 2] + twist[:, 2] * step / 2
    c, s = np.cos(middle), np.sin(middle)
    return pose + step * np.column_stack(
        [c * twist[:, 0] - s * twist[:, 1], s * twist[:, 0] + c * twist[:, 1], twist[:, 2]]
    )
