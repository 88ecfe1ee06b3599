"""A path executed at uniform spline speed in a given time, limits or not: what [guzman2015]
commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import as_numbers, require_positive
from trajopt.errors import ArgumentError
from trajopt.limits.limit import Limit
from trajopt.paths.path import Path
from trajopt.robots.robot import Robot
from trajopt.timing.grid import initial_grid
from trajopt.timing.job import FASTEST, require_given
from trajopt.timing.track import track
from trajopt.timing.trajectory import Trajectory
from trajopt.world.ground import Ground


def nominal_timing(
    path: Path,
    duration: float,
    limits: Sequence[Limit],
    *,
    robot: Robot | None = None,
    ground: Ground | None = None,
    start_wheels: ArrayLike = (),
    start_steering: Mapping[str, float] | None = None,
) -> Trajectory:
    """Trajectory along ``path`` in ``duration`` s with the spline parameter uniform in time.

    Nothing is scaled: ``margins()`` of the result say by how much ``limits`` are kept or broken.
    The motion neither starts nor ends at rest. ``start_wheels`` (W,): wheel angles at the start,
    rad; () for zeros; ``start_steering`` as in ``time_scale``. Raises ArgumentError for a duration that is not positive.
    """
    require_given(path, limits, robot, ground)
    if require_positive("duration", duration, "s") < path.length / FASTEST:
        raise ArgumentError("duration", duration, f"{path.length / FASTEST:.3g} s or more")
    along = track(path, robot, ground, start_steering)
    path = along.path
    u = initial_grid(path, None)
    s = path.parameter(u)
    sd2 = path.rate(u) ** 2  # the spline parameter runs uniformly
    unscaled = float(np.sum(2 * np.diff(s) / (np.sqrt(sd2[:-1]) + np.sqrt(sd2[1:]))))
    sd2 = sd2 * (unscaled / duration) ** 2
    return Trajectory(
        path,
        tuple(limits),
        robot,
        along.ground,
        u,
        s,
        np.sqrt(sd2),
        np.diff(sd2) / (2 * np.diff(s)),
        "nominal",
        1.0,
        as_numbers("start_wheels", start_wheels, "wheel angles, rad"),
        along.start_steering,
    )
