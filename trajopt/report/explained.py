"""Why a motion takes as long as it does."""

from __future__ import annotations

from typing import Any

from trajopt.report.motion import limit_use, most
from trajopt.timing.engines import ENGINES
from trajopt.timing.sensitivity import sensitivities
from trajopt.timing.trajectory import Trajectory

_ROUNDING = 1e-9  # of a limit, by which one that binds may seem broken


def explained(trajectory: Trajectory) -> dict[str, Any]:
    """Which limit binds on which stretch, the least margin of each and where, what 1 % more of it
    would save, what is largest on the way, and how near the least time the motion is.

    Units stand in the names; shares are of the limit or of the duration. What a limit costs can be
    said of motions that are as fast as possible only; elsewhere it is None.

    >>> import trajopt
    >>> path = trajopt.Path.through([[0, 0], [1, 0]])
    >>> found = explained(trajopt.time_scale(path, [trajopt.Speed(0.5)]))
    >>> [part["limit"] for part in found["stretches"]]
    ['speed']
    """
    optimal = trajectory.engine in ENGINES
    savings = sensitivities(trajectory) if optimal else {}
    times, used = limit_use(trajectory)
    tightest = times[used.argmax(axis=0), range(used.shape[1])]
    names = [limit.name for limit in trajectory.limits]
    places = dict(zip(names, trajectory.along(tightest)[0].tolist(), strict=True))
    margins = sorted(
        trajectory.margins().items(), key=lambda item: (-savings.get(item[0], 0.0), item[1])
    )
    return {
        "duration_s": trajectory.duration,
        "length_m": trajectory.path.length,
        "engine": trajectory.engine,
        "slowdown": trajectory.slowdown,
        "least_time_s": trajectory.bound,
        "gap": trajectory.gap,
        "why_gap": trajectory.why_gap,
        "stretches": [
            {"from_m": part.start, "to_m": part.end, "limit": part.limit}
            for part in trajectory.active
        ],
        "limits": [
            {
                "limit": name,
                "margin": margin if margin < -_ROUNDING else max(margin, 0.0),
                "at_m": places[name],
                "one_percent_saves_s": savings[name] if optimal else None,
            }
            for name, margin in margins
        ],
        "on_the_way": [
            {"what": name, "up_to": value, "at_m": place} for name, value, place in most(trajectory)
        ],
    }
