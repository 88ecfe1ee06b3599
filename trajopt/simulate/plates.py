"""Smooth ground as wheels meet it: a plane under each wheel that moves along with it.

An engine's own height field has facets. A soft wheel touches several at once, each of which holds
it up by itself, and their normals differ (measured in MuJoCo: 3 to 6 contacts a wheel, loads off by
a quarter of the weight where the field is 0.1 mm off the surface). So each wheel alone meets the
tangent plane at the place that it touches: curvature is left out only within a step's way.
"""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array
from trajopt.simulate.model import Model
from trajopt.simulate.scene import Stage


class Plates:
    """Of the wheels (A) of a model on a stage."""

    def __init__(self, model: Model, stage: Stage) -> None:
        self.ground = stage.scene.ground
        self.radius = np.array([[model.frames[foot][0][2]] for foot in model.feet])
        self.normal = np.tile([0.0, 0.0, 1.0], (len(model.feet), 1))
        self.place = np.zeros((len(model.feet), 3))

    def move(self, centres: Array) -> None:
        """Puts ``place`` (A, 3), m, and unit ``normal`` (A, 3) under wheels at centres (A, 3)."""
        x, y, _ = (centres - self.radius * self.normal).T
        height, along, across = (self.ground.partial(x, y, *k) for k in ((0, 0), (1, 0), (0, 1)))
        self.place = np.stack([x, y, height], axis=1)
        normal = np.stack([-along, -across, np.ones(len(x))], axis=1)
        self.normal = normal / np.linalg.norm(normal, axis=1)[:, None]

    def quaternions(self) -> Array:
        """(A, 4): w, x, y, z of the shortest turn of the vertical into each normal."""
        x, y, z = self.normal.T
        found = np.stack([1.0 + z, -y, x, np.zeros(len(x))], axis=1)
        return np.asarray(found / np.linalg.norm(found, axis=1)[:, None])
