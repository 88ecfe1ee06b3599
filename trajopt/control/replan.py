"""On-line replanning among moving obstacles: slow down, stop, resume, along an unchanged path.

Every scan the replanner chooses the speeds of one more cycle and, behind them, a full brake to
rest. A choice is accepted only if the outline, driven through committed motion, cycle and brake,
meets none of the places that a seen obstacle can reach by then, and if nothing that was beyond the
sensor's range can be met either. Otherwise the brake accepted one cycle earlier is executed: so if
the first state is safe, every state is (passive safety: nothing is hit while the robot moves). The
path never changes, so the distance is conserved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array, require_not_negative, require_positive
from trajopt.control.encounter import Course, Obstacle, clearance

TIME_STEP = 0.02  # s between samples of a plan; chosen
# Shares of full braking (< 0) and full acceleration (> 0) tried a cycle; chosen: fine near a
# constant speed, so that the safe speed is approached and not jumped across at every scan.
_LEVELS = np.array([-1.0, -0.5, -0.25, -0.1, -0.03, 0.0, 0.1, 0.4, 1.0])
PLACE = 1e-6  # m; nearer than this to the end counts as arrived


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

    def rest(self, now: float) -> SpeedPlan:
        """What is left of it at time ``now``, s."""
        left = len(self.s) - round((now - self.start) / TIME_STEP)
        return SpeedPlan(now, *self.sampled(now, max(left, 1)))

    @property
    def moving(self) -> Array:
        """(M,): path parameters up to the first sample of the last rest; none where nothing
        moves."""
        rolling = np.flatnonzero(self.v > 0)
        return self.s[: int(rolling[-1]) + 2] if len(rolling) else self.s[:0]


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
    for s, v in choices:
        plan = SpeedPlan(now, np.concatenate([committed_s, s]), np.concatenate([committed_v, v]))
        if stops_in_time(where, sensor, plan, seen):
            return plan
    return current.rest(now)


def stops_in_time(where: Course, sensor: Sensor, plan: SpeedPlan, seen: Sequence[Obstacle]) -> bool:
    """Whether ``plan``, from its start to rest, is clear of all that it knows and of all that it
    cannot see."""
    s = plan.moving
    if not len(s):
        return True
    t: Array = TIME_STEP * np.arange(len(s), dtype=np.float64)
    travel = where.travelled(s)
    if travel[-1] - travel[0] + sensor.unseen_speed * t[-1] > sensor.reach:
        return False
    poses, steps = where.poses(s), np.append(np.diff(travel), 0.0)
    for thing in seen:
        drift = (float(np.hypot(*thing.velocity)) + thing.deviation) * TIME_STEP
        margin = steps + drift  # what may happen between two samples
        if np.any(gaps(where, poses, thing, t) < margin):
            return False
    return True


def gaps(where: Course, poses: Array, thing: Obstacle, t: Array) -> Array:
    """(N,): least distance, m, of the outline at poses (N, 3) from where ``thing`` may be ``t``
    (N,) s after it was seen."""
    centres = np.asarray(thing.centre) + t[:, None] * np.asarray(thing.velocity)
    return clearance(poses, where.outline, centres, thing.radius + thing.deviation * t)


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
        speed = np.where(place >= where.length - PLACE, 0.0, fresh)
        places.append(place)
        speeds.append(speed)
        if i >= cycle and not speed.any():
            break
    s_all, v_all = np.array(places), np.array(speeds)
    return [(s_all[:, k], v_all[:, k]) for k in range(len(u) - 1, -1, -1)]
