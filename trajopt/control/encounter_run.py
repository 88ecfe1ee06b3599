"""An encounter, driven: the robot along its path, the obstacles of a world, a planner at every
scan."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from trajopt.arrays import Array, rotation
from trajopt.control.encounter import Course, Obstacle, World
from trajopt.control.replan import (
    PLACE,
    TIME_STEP,
    Sensor,
    SpeedPlan,
    at_rest,
    gaps,
    replan,
    stops_in_time,
)
from trajopt.errors import ArgumentError

_STILL = 0.02  # m/s, chosen: a real robot below it counts as standing (contacts give way by less)


@dataclass(frozen=True, eq=False)
class Run:
    """What an encounter was like, every TIME_STEP. ``pose`` (N, 3) is where the robot was and
    ``s``, ``v`` what the plan asked for; ``gap`` (m) is the distance to the nearest obstacle there
    was (inf without one), ``hit`` whether it closed while the robot moved; ``kept`` whether every
    plan passed its own check and, at every instant, the rest of the plan from where the robot
    really was came to rest clear of all that any obstacle could do by then; ``slowest_replan`` the
    longest planning time, s of processor time."""

    times: Array
    s: Array
    v: Array
    pose: Array
    gap: Array
    hit: bool
    kept: bool
    arrived: bool
    slowest_replan: float


Planner = Callable[[Course, Sensor, SpeedPlan, float, Sequence[Obstacle]], SpeedPlan]
Body = Callable[[SpeedPlan, float, Sequence[Obstacle]], Array]


def run_encounter(
    where: Course,
    sensor: Sensor,
    world: World,
    *,
    planner: Planner = replan,
    longest: float,
    knows_velocity: bool = False,
    body: Body | None = None,
    allowance: float = 0.0,
    settle: float = 0.0,
) -> Run:
    """Drive ``where`` among the obstacles of ``world(time, pose)`` until arrival, or for
    ``longest`` seconds.

    ``world`` gives the true obstacles; each may move at most its deviation + |velocity|. The robot
    sees those within reach at every scan, and with ``knows_velocity`` also their velocity; without
    it the whole speed becomes deviation. ``body(plan, now, obstacles)`` moves the real robot one
    TIME_STEP on and returns its pose (3,); None: it follows exactly. The planner keeps
    ``allowance`` (m) for how far it strays from the plan; ``settle`` (s) is how long it is still
    driven after the plan has arrived. Raises ArgumentError for a ``longest`` that is not positive,
    or an allowance that leaves nothing of the reach.
    """
    if not longest > 0:
        raise ArgumentError("longest", longest, "a time > 0 s")
    if not 0 <= allowance < sensor.reach:
        raise ArgumentError(
            "allowance", allowance, f"a length in [0, {sensor.reach:g}) m, the reach"
        )
    planned = replace(sensor, reach=sensor.reach - allowance)
    plan, slowest, kept, hit, settled = at_rest(0.0), 0.0, True, False, 0.0
    cycle = max(round(sensor.scan_time / TIME_STEP), 1)
    pose = where.poses(np.zeros(1))[0]
    things = world(0.0, pose)
    log = [(0.0, 0.0, pose, _gap(where, pose, things))]
    for i in range(int(np.ceil(longest / TIME_STEP))):
        now = i * TIME_STEP
        if i % cycle == 0:
            seen = [
                _as_seen(o, knows_velocity, allowance)
                for o in things
                if _gap(where, pose, [o]) <= sensor.reach
            ]
            begun = time.thread_time()
            plan = planner(where, planned, plan, now, seen)
            slowest = max(slowest, time.thread_time() - begun)
            kept = kept and stops_in_time(where, planned, plan, seen)
        if kept:
            known = [_as_seen(o, knows_velocity, 0.0) for o in things]
            kept = _stops_from(where, plan, now, pose, log[-1][3], known)
        (s,), (v,) = plan.sampled(now + TIME_STEP, 1)
        pose = where.poses(np.array([s]))[0] if body is None else body(plan, now, things)
        things = world(now + TIME_STEP, pose)
        gap = _gap(where, pose, things)
        log.append((float(s), float(v), pose, gap))
        hit = hit or (gap <= 0 and _moved(log))
        settled = settled + TIME_STEP if s >= where.length - PLACE and v == 0 else 0.0
        if settled > settle:
            break
    s_all, v_all, poses, nearest = (np.array(column) for column in zip(*log, strict=True))
    times: Array = TIME_STEP * np.arange(len(log), dtype=np.float64)
    arrived = bool(s_all[-1] >= where.length - 1e-3)
    return Run(times, s_all, v_all, poses, nearest, hit, kept, arrived, slowest)


def _moved(log: list[tuple[float, float, Array, float]]) -> bool:
    """Whether the robot moves: by plan, or by more than a creep since the sample before."""
    return log[-1][1] > 0 or float(np.hypot(*(log[-1][2] - log[-2][2])[:2])) > _STILL * TIME_STEP


def _stops_from(
    where: Course, plan: SpeedPlan, now: float, pose: Array, gap: float, things: Sequence[Obstacle]
) -> bool:
    """Whether the rest of ``plan``, driven from where the robot really is, stays clear of
    ``things``."""
    s = plan.rest(now).moving
    if not len(s) or not things:
        return True
    t: Array = TIME_STEP * np.arange(len(s), dtype=np.float64)
    travel = where.travelled(s)
    fastest = max(thing.deviation + float(np.hypot(*thing.velocity)) for thing in things)
    if gap > travel[-1] - travel[0] + fastest * t[-1]:
        return True
    poses = where.poses(s)
    turn = pose[2] - poses[0, 2]  # the rest of the plan, moved to where the robot is
    places = pose[:2] + (poses[:, :2] - poses[0, :2]) @ rotation(turn).T
    real = np.column_stack([places, poses[:, 2] + turn])
    return all(np.all(gaps(where, real, thing, t) > 0) for thing in things)


def _as_seen(thing: Obstacle, knows_velocity: bool, allowance: float) -> Obstacle:
    grown = replace(thing, radius=thing.radius + allowance)
    if knows_velocity:
        return grown
    bound = thing.deviation + float(np.hypot(*thing.velocity))
    return replace(grown, velocity=(0.0, 0.0), deviation=bound)


def _gap(where: Course, pose: Array, things: Sequence[Obstacle]) -> float:
    """m to the nearest of ``things`` now; inf without any."""
    now = np.zeros(1)
    return min((float(gaps(where, pose[None], o, now)[0]) for o in things), default=float("inf"))
