"""An encounter driven in physics: the replanner's plan, the tracker's wheel speeds, discs that
stand in the way.

The planner sees where the simulated robot is; contact is the engine's own, between the robot's
outline and a cylinder for every visitor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from trajopt.arrays import Array, fold
from trajopt.control.encounter import Course, Obstacle, Visitor, visited_world
from trajopt.control.encounter_run import Planner, Run, run_encounter
from trajopt.control.measured import Targets
from trajopt.control.replan import TIME_STEP, Sensor, SpeedPlan, replan
from trajopt.control.tracking import Tracker, require_turning
from trajopt.errors import SimulationError
from trajopt.robots.robot import Robot
from trajopt.simulate.engine import Engine, Session, make_engine
from trajopt.simulate.measure import observe
from trajopt.simulate.stepping import explosion, interval, open_session
from trajopt.systems.powerbot.drive import shifted, slip_share
from trajopt.world.obstacles import Circle
from trajopt.world.scene import Scene

_HEIGHT = 1.0  # m, of an obstacle; chosen: higher than the robot
_STILL = 0.02  # m/s, chosen: below it the robot counts as standing


@dataclass(frozen=True, eq=False)
class DrivenEncounter:
    """``run`` with the simulated poses; every TIME_STEP: ``speed`` (N,) along the heading, m/s,
    ``off`` (N,) distance from the plan, m, ``slip`` (N, D) of the driven wheels, m/s; ``contact``
    whether the engine found contact with an obstacle while the robot moved; at the end
    ``goal_offset`` (m) and ``heading_error`` (rad)."""

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
    robot: Robot,
    scene: Scene,
    sensor: Sensor,
    visitors: Sequence[Visitor],
    *,
    tracker: Tracker | None = None,
    planner: Planner = replan,
    longest: float,
    allowance: float = 0.05,
    start_error: Sequence[float] = (0.0, 0.0, 0.0),
    engine: str | Engine = "pybullet",
) -> DrivenEncounter:
    """Drive ``where`` (level ground) among ``visitors`` in physics, closed loop.

    ``allowance`` (m) is what the planner keeps for the distance between robot and plan: compare
    ``off``. ``start_error`` (m, m, rad) is in the frame of the first pose. Raises as
    ``run_encounter`` and ``simulate.drive``, SimulationError when the numbers leave physics.
    """
    require_turning(robot)
    used, chosen = Tracker() if tracker is None else tracker, make_engine(engine)
    start = shifted(where.poses(np.zeros(1))[0], start_error)
    discs = tuple(
        Circle(f"visitor {i}", _HEIGHT, (0.0, 0.0), visitor.radius)
        for i, visitor in enumerate(visitors)
    )
    peopled = replace(scene, obstacles=(*scene.obstacles, *discs))
    pose = (float(start[0]), float(start[1]), float(start[2]))
    with open_session(robot, peopled, chosen, pose=pose, absent=[d.name for d in discs]) as session:
        steps = max(round(TIME_STEP / chosen.step), 1)
        driver = _Driver(where, session, robot, used, discs, steps)
        run = run_encounter(
            where,
            sensor,
            visited_world(visitors, where.outline),
            planner=planner,
            longest=longest,
            body=driver.move,
            allowance=allowance,
            settle=used.settle,
        )
    planned = where.poses(run.s)
    off = np.hypot(*(run.pose - planned)[:, :2].T)
    columns = [i for i, w in enumerate(robot.description.wheels) if w.name in robot.driven]
    return DrivenEncounter(
        run,
        np.array([0.0, *driver.speeds]),
        off,
        np.array([np.zeros(len(driver.slips[0])), *driver.slips])[:, columns],
        driver.contact,
        float(off[-1]),
        float(abs(fold(float(run.pose[-1, 2] - planned[-1, 2])))),
    )


@dataclass(eq=False)
class _Driver:
    """Moves the simulated robot along a plan, one TIME_STEP a call, and the cylinders with the
    obstacles."""

    where: Course
    session: Session
    robot: Robot
    tracker: Tracker
    discs: tuple[Circle, ...]
    steps: int
    contact: bool = False
    speeds: list[float] = field(default_factory=list)
    slips: list[Array] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.last = Targets(np.zeros(len(self.robot.wheels)))
        self.seen = observe(self.session)

    def move(self, plan: SpeedPlan, now: float, things: Sequence[Obstacle]) -> Array:
        """The pose (3,) after one more TIME_STEP."""
        self._place(things)
        s, v = plan.sampled(now, 2)
        reference, after = self.where.poses(s)
        speed = (float(v[1]), float(after[2] - reference[2]) / TIME_STEP)
        order = Targets(self.tracker.wheel_speeds(reference, speed, self.seen.pose, self.robot))
        interval(self.session, self.last, order, self.steps)
        self.last, self.seen = order, observe(self.session)
        reason = explosion(self.seen, self.session.stage)
        if reason:
            raise SimulationError(reason)
        along = float(self.seen.velocity @ self.seen.rotation[:, 0])
        self.contact = self.contact or (abs(along) > _STILL and bool(self.seen.hits))
        self.speeds.append(along)
        self.slips.append(self.seen.slip)
        return self.seen.pose

    def _place(self, things: Sequence[Obstacle]) -> None:
        """A cylinder for every obstacle, where it is now; the others out of the world."""
        free = list(self.discs)
        for thing in things:
            disc = next(d for d in free if d.radius == thing.radius)
            free.remove(disc)
            self.session.move(disc.name, thing.centre)
        for disc in free:
            self.session.move(disc.name, None)
