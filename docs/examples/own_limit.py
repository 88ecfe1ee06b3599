"""A limit of one's own: the centripetal acceleration that a passenger bears."""

from dataclasses import dataclass

import numpy as np

import trajopt
from trajopt.limits.limit import Rows, linear_rows


@dataclass(frozen=True)
class Comfort:
    """|yaw rate x speed| <= ``largest``, m/s^2."""

    largest: float
    name: str = "comfort"

    def rows(self, path, robot) -> Rows:
        speed = np.hypot(path.twist[:, 0], path.twist[:, 1])  # per m of path
        sideways = np.abs(path.twist[:, 2]) * speed  # times s'^2
        return linear_rows(
            self.name,
            np.zeros((len(sideways), 1)),
            sideways[:, None],
            np.full((len(sideways), 1), self.largest),
            self.largest,
        )


path = trajopt.Path.through([[0, 0], [2, 1], [4, -1], [6, 0]])
limits = [trajopt.Speed(3.0), trajopt.Acceleration(1.0, 1.0)]
print(f"{trajopt.time_scale(path, limits).duration:.3f} s without, ", end="")
calm = trajopt.time_scale(path, [*limits, Comfort(0.5)])
print(f"{calm.duration:.3f} s with; it binds on", [s.limit for s in calm.active].count("comfort"))
