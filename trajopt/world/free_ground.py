"""Ground that a robot's footprint may cover: a rectangular space before a step.

Both are convex, so a footprint lies inside exactly when its corners do.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.paths.path import Path
from trajopt.world.crossing import Standing

FINE_STEPS = 360  # steps along a path when it is checked, chosen: 6 mm on a 2 m path


@dataclass(frozen=True)
class FreeGround:
    """Where a footprint may be, m: ``x`` and ``y`` intervals, and n . p <= ``step_distance`` with
    the step's unit normal ``step_normal``; ``footprint`` (K, 2) corners in the body frame."""

    x: tuple[float, float]
    y: tuple[float, float]
    step_normal: tuple[float, float]
    step_distance: float
    footprint: tuple[tuple[float, float], ...]

    def rooms(self, x: Any, y: Any, yaw: Any) -> list[Any]:
        """Distance (m, negative outside) of each corner from each border, at poses of any shape or
        symbols."""
        cos, sin, (a, b) = np.cos(yaw), np.sin(yaw), self.step_normal
        found = []
        for cx, cy in self.footprint:
            px, py = x + cx * cos - cy * sin, y + cx * sin + cy * cos
            found += [
                px - self.x[0],
                self.x[1] - px,
                py - self.y[0],
                self.y[1] - py,
                self.step_distance - a * px - b * py,
            ]
        return found

    def margin(self, x: Array, y: Array, yaw: Array) -> Array:
        """Least distance (m) of the footprint from any border at each pose; negative outside."""
        return np.asarray(np.min(self.rooms(x, y, yaw), axis=0))

    def complaint(self, x: float, y: float, yaw: float) -> str:
        """Which border the footprint crosses at one pose, and by how much; empty where it is
        free."""
        names = ("x from", "x to", "y from", "y to", "the step")
        rooms = np.reshape(self.rooms(x, y, yaw), (-1, len(names))).min(axis=0)
        worst = int(np.argmin(rooms))
        if rooms[worst] >= 0:
            return ""
        where = names[worst] if worst == 4 else f"the space's border '{names[worst]}'"
        return f"the footprint crosses {where} by {-rooms[worst]:.3g} m"


def path_margin(path: Path, ground: FreeGround | Standing, steps: int = FINE_STEPS) -> float:
    """Least distance (m) of the footprint from any border along a path; negative where it crosses
    one."""
    u = np.linspace(path.start, path.end, steps + 1)
    p = path.position(u)
    return float(ground.margin(p[:, 0], p[:, 1], path.yaw(u)).min())
