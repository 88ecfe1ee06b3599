"""An encounter driven in pybullet: the replanner's plan, the tracker's wheel speeds, discs that
stand in the way.

The planner sees where the simulated robot is; contact is Bullet's own, between the robot and a
cylinder for every obstacle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from trajopt.arrays import Array, fold
from trajopt.control.encounter import Course, Obstacle, World
from trajopt.control.replan import TIME_STEP, Planner, Run, Sensor, SpeedPlan, replan, run_encounter
from trajopt.control.tracking import Tracker
from trajopt.systems.powerbot.differential import (
    DriveOptions,
    DriveSession,
    Floor,
    drive_session,
    slip_share,
)
from trajopt.systems.powerbot.model import DriveRobot

_HEIGHT = 1.0  # m, of an obstacle; chosen: higher than the robot
_STILL = 0.02  # m/s, chosen: below it the robot counts as standing


@dataclass(frozen=True, eq=False)
class DrivenEncounter:
    """``run`` with the simulated poses; every TIME_STEP: ``speed`` (N,) along the heading, m/s,
    ``off`` (N,) distance from the plan, m, ``slip`` (N, 2) of the drive wheels, m/s; ``contact``
    whether Bullet found contact with an obstacle while the robot moved; at the end ``goal_offset``
    (m) and ``heading_error`` (rad)."""

    run: Run
    speed: Array
    off: Array
    slip: Array
    contact: bool
    goal_offset: float
    heading_error: float

    @property
    def slip_ratio(self) -> float:
        """Root mean square of the wheels' slip over that of the speed."""
        return slip_share(self.slip, self.speed)


def drive_encounter(
    where: Course,
    robot: DriveRobot,
    floor: Floor,
    sensor: Sensor,
    world: World,
    *,
    tracker: Tracker | None = None,
    planner: Planner = replan,
    longest: float,
    allowance: float = 0.05,
    start_error: Sequence[float] = (0.0, 0.0, 0.0),
) -> DrivenEncounter:
    """Drive ``where`` (level ground) among the obstacles of ``world`` in Bullet, closed loop.

    ``allowance`` (m) is what the planner keeps for the distance between robot and plan: compare
    ``off``. ``start_error`` (m, m, rad) is in the frame of the first pose. Raises as
    ``run_encounter``, and MissingDependencyError without pybullet, SimulationError when the numbers
    leave physics.
    """
    used = Tracker() if tracker is None else tracker
    start = where.poses(np.zeros(1))[0]
    cos, sin = np.cos(start[2]), np.sin(start[2])
    dx, dy, turn = start_error
    shift = np.array([cos * dx - sin * dy, sin * dx + cos * dy, turn])
    options = DriveOptions(control=TIME_STEP)
    with drive_session(robot, floor, options, start + shift) as session:
        driver = _Driver(where, session, used, max(round(TIME_STEP / options.step), 1))
        run = run_encounter(
            where,
            sensor,
            world,
            planner=planner,
            longest=longest,
            body=driver.move,
            allowance=allowance,
            settle=used.settle,
        )
    planned = where.poses(run.s)
    off = np.hypot(*(run.pose - planned)[:, :2].T)
    heading = fold(run.pose[-1, 2] - planned[-1, 2])
    return DrivenEncounter(
        run,
        np.array([0.0, *driver.speeds]),
        off,
        np.array([np.zeros(2), *driver.slips]),
        driver.contact,
        float(off[-1]),
        float(abs(heading)),
    )


@dataclass(eq=False)
class _Driver:
    """Moves the simulated robot along a plan, one TIME_STEP a call, and the cylinders with the
    obstacles."""

    where: Course
    session: DriveSession
    tracker: Tracker
    steps: int
    last: tuple[float, float] = (0.0, 0.0)
    contact: bool = False
    speeds: list[float] = field(default_factory=list)
    slips: list[Array] = field(default_factory=list)
    cylinders: list[tuple[int, float]] = field(default_factory=list)

    def move(self, plan: SpeedPlan, now: float, things: Sequence[Obstacle]) -> Array:
        """The pose (3,) after one more TIME_STEP."""
        self._place(things)
        s, v = plan.sampled(now, 2)
        reference, after = self.where.poses(s)
        pose, _, _ = self.session.pose()
        width = 2 * abs(self.session.robot.platform.body.contacts[0][1])
        order = self.tracker.wheel_speeds(
            reference, (float(v[1]), float(after[2] - reference[2]) / TIME_STEP), pose, width
        )
        slip, _, _ = self.session.interval(self.last, order, self.steps)
        self.last = order
        pose, speed, _ = self.session.pose()
        self.contact = self.contact or (abs(speed) > _STILL and self._touches())
        self.speeds.append(speed)
        self.slips.append(slip)
        return pose

    def _place(self, things: Sequence[Obstacle]) -> None:
        """A cylinder for every obstacle, where it is now."""
        bullet, client = self.session.bullet, self.session.client
        if [thing.radius for thing in things] != [radius for _, radius in self.cylinders]:
            for body, _ in self.cylinders:
                bullet.removeBody(body, physicsClientId=client)
            self.cylinders = []
            for thing in things:
                shape = bullet.createCollisionShape(
                    bullet.GEOM_CYLINDER,
                    radius=thing.radius,
                    height=_HEIGHT,
                    physicsClientId=client,
                )
                self.cylinders.append(
                    (int(bullet.createMultiBody(0.0, shape, physicsClientId=client)), thing.radius)
                )
        for (body, _), thing in zip(self.cylinders, things, strict=True):
            bullet.resetBasePositionAndOrientation(
                body, (*thing.centre, _HEIGHT / 2), (0.0, 0.0, 0.0, 1.0), physicsClientId=client
            )

    def _touches(self) -> bool:
        bullet, session = self.session.bullet, self.session
        return any(
            point[9] > 0
            for body, _ in self.cylinders
            for point in bullet.getContactPoints(
                bodyA=session.body, bodyB=body, physicsClientId=session.client
            )
        )
