"""On-line replanning among moving obstacles: slow down, stop, resume, along an unchanged path.

Every scan the replanner chooses the speeds of one more cycle and, behind them, a full brake to
rest. A choice is accepted only if the outline, driven through committed motion, cycle and brake,
meets none of the places that a seen obstacle can reach by then, and if nothing that was beyond the
sensor's range can be met either. Otherwise the brake accepted one cycle earlier is executed: so if
the first state is safe, every state is (passive safety: nothing is hit while the robot moves). The
path never changes, so the distance is conserved.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from trajopt.arrays import Array, require_not_negative, require_positive
from trajopt.control.encounter import Course, Obstacle, World, clearance
from trajopt.errors import ArgumentError

TIME_STEP = 0.02  # s between samples of a plan; chosen
# Shares of full braking (< 0) and full acceleration (> 0) tried a cycle; chosen: fine near a
# constant speed, so that the safe speed is approached and not jumped across at every scan.
_LEVELS = np.array([-1.0, -0.5, -0.25, -0.1, -0.03, 0.0, 0.1, 0.4, 1.0])
_STILL = 0.02  # m/s, chosen: a real robot below it counts as standing (contacts give way by less)
_PLACE = 1e-6  # m; nearer than this to the end counts as arrived


@dataclass(frozen=True)
class Sensor:
    """``reach`` (m) around the outline, a scan every ``scan_time`` (s), effect after
    ``reaction_time`` (s).

    ``unseen_speed`` (m/s) bounds how fast something that is not yet seen may come.
    """

    reach: float
    scan_time: float
    reaction_time: float
    unseen_speed: float = 0.0

    def __post_init__(self) -> None:
        for name in ("reach", "scan_time"):
            require_positive(f"sensor.{name}", getattr(self, name))
        for name in ("reaction_time", "unseen_speed"):
            require_not_negative(f"sensor.{name}", getattr(self, name))


@dataclass(frozen=True, eq=False)
class SpeedPlan:
    """Path parameter ``s`` (m) and speed ``v`` (m/s), arrays (N,), every TIME_STEP from time
    ``start`` (s).

    It ends at rest and stays there.
    """

    start: float
    s: Array
    v: Array

    def sampled(self, first: float, count: int) -> tuple[Array, Array]:
        """s and v at ``count`` samples from time ``first`` on."""
        index = np.clip(
            round((first - self.start) / TIME_STEP) + np.arange(count), 0, len(self.s) - 1
        )
        return self.s[index], self.v[index]


def at_rest(now: float, s: float = 0.0) -> SpeedPlan:
    """Standing still at path parameter ``s``."""
    return SpeedPlan(now, np.array([s]), np.zeros(1))


def replan(
    where: Course, sensor: Sensor, current: SpeedPlan, now: float, seen: Sequence[Obstacle]
) -> SpeedPlan:
    """The plan from time ``now`` (a scan) on; ``current`` is the one under way, ``seen`` what the
    scan shows.

    The fastest accepted choice for the cycle that starts after the reaction time; else ``current``
    itself, which ends in a brake. ``seen`` must hold every obstacle within reach of the outline.
    """
    delay = round(sensor.reaction_time / TIME_STEP)
    cycle = max(round(sensor.scan_time / TIME_STEP), 1)
    committed_s, committed_v = current.sampled(now, delay + 1)
    choices = _choices(where, float(committed_s[-1]), float(committed_v[-1]), cycle)
    for tail_s, tail_v in choices:
        s = np.concatenate([committed_s, tail_s])
        v = np.concatenate([committed_v, tail_v])
        if _accepted(where, sensor, s, v, seen):
            return SpeedPlan(now, s, v)
    rest = len(current.s) - round((now - current.start) / TIME_STEP)
    s, v = current.sampled(now, max(rest, 1))
    return SpeedPlan(now, s, v)


def stops_in_time(where: Course, sensor: Sensor, plan: SpeedPlan, seen: Sequence[Obstacle]) -> bool:
    """Whether ``plan``, from its start to rest, is clear of all that it knows and of all that it
    cannot see."""
    return _accepted(where, sensor, plan.s, plan.v, seen)


def _choices(where: Course, s: float, v: float, cycle: int) -> list[tuple[Array, Array]]:
    """Continuations of (s, v), fastest first: one cycle at constant acceleration below the plan's
    speed, then a full brake. Samples after the first."""
    top = where.top_speed
    reach = (
        top * cycle * TIME_STEP + top**2 / (2 * where.braking.min()) + 0.1
    )  # m, beyond cycle and brake
    ahead = (where.s >= s - 0.1) & (where.s <= s + reach)
    braking = float(where.braking[ahead].min())
    forward = float(where.acceleration[ahead].min())
    u = np.where(_LEVELS < 0, braking, forward) * _LEVELS
    place, speed = np.full(len(u), s), np.full(len(u), v)
    places, speeds = [], []
    longest = cycle + int(np.ceil(top / braking / TIME_STEP)) + 2
    for i in range(longest):
        rate = u if i < cycle else np.full(len(u), -braking)
        fresh = np.maximum(speed + rate * TIME_STEP, 0.0)
        beyond = place + fresh * TIME_STEP
        allowed = where.speed(beyond)  # 0 at the end of the path, so the last step is free of it
        fresh = np.where(beyond < where.length, np.minimum(fresh, allowed), fresh)
        place = np.minimum(place + (speed + fresh) / 2 * TIME_STEP, where.length)
        speed = np.where(place >= where.length - _PLACE, 0.0, fresh)
        places.append(place)
        speeds.append(speed)
        if i >= cycle and not speed.any():
            break
    s_all, v_all = np.array(places), np.array(speeds)
    return [(s_all[:, k], v_all[:, k]) for k in range(len(u) - 1, -1, -1)]


def _accepted(where: Course, sensor: Sensor, s: Array, v: Array, seen: Sequence[Obstacle]) -> bool:
    """Whether the motion from the scan (first sample) to rest is clear of everything possible."""
    moving = np.flatnonzero(v > 0)
    last = int(moving[-1]) + 1 if len(moving) else 0
    if last == 0:
        return True
    t: Array = TIME_STEP * np.arange(last + 1, dtype=np.float64)
    travel = where.travelled(s[: last + 1])
    steps = np.diff(travel)
    if travel[-1] - travel[0] + sensor.unseen_speed * t[-1] > sensor.reach:
        return False
    poses = where.poses(s[: last + 1])
    for thing in seen:
        centres = np.asarray(thing.centre) + t[:, None] * np.asarray(thing.velocity)
        radii = thing.radius + thing.deviation * t
        drift = (float(np.hypot(*thing.velocity)) + thing.deviation) * TIME_STEP
        margin = np.concatenate([steps, [0.0]]) + drift  # what may happen between two samples
        if np.any(clearance(poses, where.outline, centres, radii) < margin):
            return False
    return True


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
        settled = settled + TIME_STEP if s >= where.length - _PLACE and v == 0 else 0.0
        if settled > settle:
            break
    s_array, v_array, poses, gaps = (np.array(column) for column in zip(*log, strict=True))
    times: Array = TIME_STEP * np.arange(len(log), dtype=np.float64)
    return Run(
        times,
        s_array,
        v_array,
        poses,
        gaps,
        hit,
        kept,
        bool(s_array[-1] >= where.length - 1e-3),
        slowest,
    )


def _moved(log: list[tuple[float, float, Array, float]]) -> bool:
    """Whether the robot moves: by plan, or by more than a creep since the sample before."""
    return log[-1][1] > 0 or float(np.hypot(*(log[-1][2] - log[-2][2])[:2])) > _STILL * TIME_STEP


def _stops_from(
    where: Course, plan: SpeedPlan, now: float, pose: Array, gap: float, things: Sequence[Obstacle]
) -> bool:
    """Whether the rest of ``plan``, driven from where the robot really is, stays clear of
    ``things``."""
    rest = len(plan.s) - round((now - plan.start) / TIME_STEP)
    s, v = plan.sampled(now, max(rest, 1))
    moving = np.flatnonzero(v > 0)
    if not len(moving) or not things:
        return True
    s = s[: int(moving[-1]) + 2]
    t: Array = TIME_STEP * np.arange(len(s), dtype=np.float64)
    travel = where.travelled(s)
    fastest = max(thing.deviation + float(np.hypot(*thing.velocity)) for thing in things)
    if gap > travel[-1] - travel[0] + fastest * t[-1]:
        return True
    poses = where.poses(s)
    turn = pose[2] - poses[0, 2]  # the rest of the plan, moved to where the robot is
    cos, sin = np.cos(turn), np.sin(turn)
    d = poses[:, :2] - poses[0, :2]
    real = np.column_stack(
        [
            pose[0] + cos * d[:, 0] - sin * d[:, 1],
            pose[1] + sin * d[:, 0] + cos * d[:, 1],
            poses[:, 2] + turn,
        ]
    )
    return not any(
        np.any(
            clearance(
                real,
                where.outline,
                np.asarray(thing.centre) + t[:, None] * np.asarray(thing.velocity),
                thing.radius + thing.deviation * t,
            )
            <= 0
        )
        for thing in things
    )


def _as_seen(thing: Obstacle, knows_velocity: bool, allowance: float) -> Obstacle:
    if knows_velocity:
        return replace(thing, radius=thing.radius + allowance)
    return Obstacle(
        thing.centre,
        thing.radius + allowance,
        (0.0, 0.0),
        thing.deviation + float(np.hypot(*thing.velocity)),
    )


def _gap(where: Course, pose: Array, things: Sequence[Obstacle]) -> float:
    if not things:
        return float("inf")
    poses = np.repeat(pose[None], len(things), axis=0)
    return float(
        clearance(
            poses,
            where.outline,
            np.array([o.centre for o in things]),
            np.array([o.radius for o in things]),
        ).min()
    )
