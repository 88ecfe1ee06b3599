"""Time scaling against an independent sampler, toppra and its own bound, on random motions of all
kinds (``wild``)."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from time import process_time

import numpy as np
import pytest
from graded import shares
from wild import FAR, Wild, wild

from trajopt.errors import TrajoptError
from trajopt.limits.limit import is_linear
from trajopt.timing.scaling import time_scale
from trajopt.timing.stages import assemble
from trajopt.timing.toppra import toppra_profile
from trajopt.timing.track import track
from trajopt.timing.trajectory import Trajectory

BROKEN = 5e-5
LONGEST = 30.0  # s of one core, of one call
SLOWER = 1e-3


@dataclass(frozen=True)
class Judged:
    """What one case came to: the error, or gap, share of places where the sampler could tell, what
    is wrong, and the time by toppra where its motion keeps the limits."""

    error: str = ""
    gap: float = np.nan
    told: float = np.nan
    wrong: tuple[str, ...] = ()
    slower: float = np.nan


def judge(seed: int, peer: bool = False) -> Judged:
    """Case ``seed``; with ``peer`` beside toppra. Raises what no call may raise."""
    case, began = wild(seed), process_time()
    try:
        found = time_scale(case.path(), case.limits, robot=case.robot)
    except TrajoptError as error:
        return Judged(error=str(error))
    wrong = []
    if process_time() - began > LONGEST:
        wrong.append("it takes too long")
    used, told = shares(found, case.limits)
    wrong += [f"{name} used by {share!r}" for name, share in used.items() if share > 1 + BROKEN]
    if min(found.margins().values()) < -1e-9:
        wrong.append(f"margins {dict(found.margins())}")
    gap = found.gap
    if gap is None or not 0 <= gap < 1:
        wrong.append(f"gap {gap}")
    if gap is not None and gap > 1e-3 and not found.why_gap:
        wrong.append(f"gap {gap} and no reason")
    slower = np.nan
    if peer and all(map(is_linear, case.limits)):
        other = by_toppra(case, found.u)
        if other is not None:
            slower = found.duration / other.duration - 1
            if slower > SLOWER:
                wrong.append(f"toppra takes {other.duration} s of {found.duration} s")
    return Judged("", np.nan if gap is None else gap, told, tuple(wrong), slower)


def by_toppra(case: Wild, graded: np.ndarray, count: int = 4000) -> Trajectory | None:
    """The motion of toppra on evenly spread gridpoints, where it keeps the limits everywhere: it is
    sampled between spline parameters ``graded`` as well, as tight turns lie between gridpoints."""
    path = case.path()
    along = track(path, case.robot)
    s = np.linspace(0, path.length, count)
    u = path.locate(s)
    ends = np.stack([u[:-1], np.nextafter(u[1:], -np.inf)], axis=1).ravel()
    try:
        rows = assemble(along.samples(np.repeat(s, 2)[1:-1], ends), case.limits, case.robot)
        squares = toppra_profile(rows, 0.0, 0.0)
    except TrajoptError:
        return None
    places = np.union1d(u, graded)
    reached = path.parameter(places)
    moves = np.append(True, np.diff(reached) > 1e-15 * path.length)
    places, reached = places[moves], reached[moves]
    squares = np.interp(reached, s, squares)
    found = Trajectory(
        path,
        case.limits,
        case.robot,
        along.ground,
        places,
        reached,
        np.sqrt(squares),
        np.diff(squares) / (2 * np.diff(reached)),
        "toppra",
        1.0,
    )
    if not np.isfinite(found.duration):
        return None
    # Where poses run out of digits (a needle) the sampler tells nothing, but rows do.
    if min(found.margins().values()) < -BROKEN:
        return None
    used, told = shares(found, case.limits)
    return found if max(used.values()) <= 1 + BROKEN and told > 0.9 else None


def run(seeds: range, peers: int) -> tuple[int, int, Counter[str]]:
    """How many were timed, how many of them within the gap, and reasons of errors; beside toppra
    every so many."""
    timed = near = 0
    errors: Counter[str] = Counter()
    for seed in seeds:
        found = judge(seed, seed % peers == 0)
        assert not found.wrong, (seed, found.wrong)
        if found.error:
            errors[found.error.split(" at s =")[0]] += 1
        else:
            timed += 1
            near += found.gap <= 1e-3
    return timed, near, errors


def test_wild_motions_keep_all_limits_wherever_they_are_sampled():
    timed, near, errors = run(range(80), 16)
    assert timed >= 70, errors
    assert near >= 0.97 * timed


@pytest.mark.slow
def test_ten_thousand_wild_motions():
    timed, near, errors = run(range(1000, 11_000), 8)
    assert timed >= 9_000, errors
    assert near >= 0.99 * timed


@pytest.mark.parametrize("seed", range(4))
def test_far_from_zero_motions_are_the_same(seed):
    """Coordinates of 1,000 km keep 1e-10 m: no duration may change by more than that tells."""
    case = next(c for k in range(50) if (c := wild(500 + 50 * seed + k)).kind == "walk")
    points = case.points - case.points.mean(axis=0)
    points = points * (5 / np.abs(points).max())
    times = []
    for away in (0.0, FAR):
        moved = Wild(case.kind, points + away, case.heading, case.limits, case.robot)
        times.append(time_scale(moved.path(), moved.limits, robot=moved.robot).duration)
    assert times[1] == pytest.approx(times[0], rel=1e-5)
