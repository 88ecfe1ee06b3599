"""Wheel slip: the ground force of every contact stays inside its friction cone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array, BoolArray, require_positive
from trajopt.errors import ArgumentError
from trajopt.limits.forces import Affine, contact_arms, contact_loads, ground_wrench, specific_force
from trajopt.limits.limit import Rows, linear_rows, require_robot
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import STANDARD_GRAVITY, Body, Robot


@dataclass(frozen=True)
class Slip:
    """Friction coefficient ``friction`` between wheels and ground, with load transfer, slope and
    curvature.

    Robots whose driven wheels all have plain tyres: ||(f_x, f_y)|| <= friction times the load on
    the driven wheels, as the inscribed polygon of ``sides`` sides (16 of them cost 0.07 % of the
    time). The tyres share the force as their loads allow, and the yaw moment is not
    counted. With ``per_wheel`` each tyre gets its own polygon: forces are the least-norm ones with
    the right sum and yaw moment. This is stricter, as two wheels on one axle also have to hold the
    body on its curve.

    Swedish wheels pass force only along the axis of the ground roller: |f_i| <= friction N_i with
    the least-norm wheel forces f_i. Two rows a wheel, no polygon needed.

    Raises ArgumentError for a friction that is not > 0, fewer than 4 sides, a robot whose wheels
    cannot supply the wrench, or no robot.
    """

    friction: float  # dimensionless
    sides: int = 16
    per_wheel: bool = False
    name: str = "slip"

    def __post_init__(self) -> None:
        require_positive(f"{self.name}.friction", self.friction, "(friction coefficient)")
        if self.sides < 4:
            raise ArgumentError(
                f"{self.name}.sides", self.sides, "4 or more sides of the friction polygon"
            )

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:
        body = require_robot(self.name, robot).body
        driven = np.asarray(body.driven, dtype=bool)
        if not driven.any():
            raise ArgumentError(
                "robot.body.driven", body.driven, "at least one contact that passes traction"
            )
        plain = np.isnan(np.asarray(body.roller_axis, dtype=np.float64))
        loads = contact_loads(path, body)
        if not self.per_wheel and plain[driven].all():
            total = loads.through(driven[None, :].astype(np.float64))
            force = specific_force(path, body).through(np.eye(2, 3))
            return self._collect([self._polygon(force, total)], 1.0)
        forces = ground_wrench(path, body).through(_distribution(body, driven, plain))
        blocks, column = [], 0
        for i in np.flatnonzero(driven):
            width = 2 if plain[i] else 1
            force = _columns(forces, slice(column, column + width))
            load = _columns(loads, slice(i, i + 1))
            blocks.append(
                self._polygon(force, load) if plain[i] else self._along_roller(force, load)
            )
            column += width
        return self._collect(blocks, 1.0 / len(body.contacts))

    def _polygon(self, force: Affine, load: Affine) -> Affine:
        """Rows (N, sides) <= 0 of the inscribed polygon: force (N, 2), load (N, 1)."""
        angles = 2 * np.pi * np.arange(self.sides) / self.sides
        directions = np.column_stack([np.cos(angles), np.sin(angles)])
        inside = np.cos(np.pi / self.sides) * self.friction
        f = force.through(directions)
        return Affine(f.a - inside * load.a, f.b - inside * load.b, f.c - inside * load.c)

    def _along_roller(self, force: Affine, load: Affine) -> Affine:
        """Rows (N, 2) <= 0 of a Swedish wheel: force (N, 1) along its roller, load (N, 1)."""
        f, mu = force.through(np.array([[1.0], [-1.0]])), self.friction
        return Affine(f.a - mu * load.a, f.b - mu * load.b, f.c - mu * load.c)

    def _collect(self, blocks: list[Affine], share: float) -> Rows:
        return linear_rows(
            self.name,
            np.hstack([k.a for k in blocks]),
            np.hstack([k.b for k in blocks]),
            -np.hstack([k.c for k in blocks]),
            share * self.friction * STANDARD_GRAVITY,
        )


def _columns(value: Affine, which: slice) -> Affine:
    return Affine(value.a[:, which], value.b[:, which], value.c[:, which])


def _distribution(body: Body, driven: BoolArray, plain: BoolArray) -> Array:
    """(F, 3): least-norm contact forces from the wrench; one column of force a roller, two a plain
    tyre."""
    arms, columns = contact_arms(body), []
    for i in np.flatnonzero(driven):
        angles = [0.0, np.pi / 2] if plain[i] else [body.roller_axis[i]]
        for angle in angles:
            ex, ey = np.cos(angle), np.sin(angle)
            columns.append([ex, ey, arms[i, 0] * ey - arms[i, 1] * ex])
    wrench: Array = np.array(columns, dtype=np.float64).T
    if np.linalg.matrix_rank(wrench, tol=1e-9) < 3:
        raise ArgumentError(
            "robot.body", body.contacts, "driven contacts that can push along x, y and turn"
        )
    return np.asarray(np.linalg.pinv(wrench), dtype=np.float64)
