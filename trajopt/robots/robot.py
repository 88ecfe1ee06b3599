"""A robot: the only kinematics and body data in the package, all from one description.

From the rolling and sliding rows of its wheels a robot gets its inverse kinematics (body twist ->
wheel rates) and its forward kinematics (wheel rates -> body twist, least squares). Per-wheel arrays
are over ``wheels``: every wheel whose spin follows from the body's motion, in the order of the
file. Castors that no motor drives and balls carry load only and are not among them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.robots.description import RobotDescription, WheelSection
from trajopt.robots.wheel import Row, Wheel, WheelKind, kinematic, null_space, outline, wheel_rates
from trajopt.schema import changes_of, read_tables, set_key, validated
from trajopt.shown import Shown

STANDARD_GRAVITY = 9.80665  # m/s^2, [iso80000-3]
DATA = Path(__file__).parent / "data"  # the shipped robots


@dataclass(frozen=True)
class Body:
    """Rigid body data for slip and tip limits, SI units. Inertias are about the centre of gravity,
    products of inertia left out.

    ``contacts`` (C, 2) are the points on the ground that carry load, in the body frame (m); ``cog``
    is the centre of gravity (x, y, height) in the same frame. ``roller_axis`` (C,) is the angle
    (rad, body frame) of the ground roller's axis at each contact, NaN where the tyre transmits
    force in every direction. ``driven`` (C,) says which contacts transmit traction at all (a free
    castor carries load only).
    """

    mass: float
    yaw_inertia: float
    cog: tuple[float, float, float]
    contacts: tuple[tuple[float, float], ...]
    roller_axis: tuple[float, ...]
    driven: tuple[bool, ...]
    roll_inertia: float
    pitch_inertia: float


@dataclass(frozen=True, repr=False)
class Robot(Shown):
    """Wheels on a body, from a ``description`` (see ``trajopt.robots.description``).

    Made by ``robot("car")``, ``Robot.load("mine.toml")`` or a builder such as
    ``Robot.differential``.

    >>> from trajopt.robots import robot
    >>> robot("car").inverse.shape
    (4, 3)
    """

    description: RobotDescription

    def __repr__(self) -> str:
        kinds = [wheel.kind for wheel in self.description.wheels]
        counts = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
        return f"Robot({self.name!r}, {self.body.mass:g} kg, wheels: {counts})"

    @classmethod
    def load(cls, file: str | Path, overrides: Mapping[str, Any] | None = None) -> Robot:
        """Robot of a TOML file; ``overrides`` maps dotted keys to values, where an element of an
        array is named (``{"motors.all.torque": 4.0, "wheels.left.radius": 0.1}``).

        Raises ProblemError in one line: file, key, value, and what would be right.
        """
        return cls(validated(RobotDescription, read_tables(file, overrides), str(file)))

    @classmethod
    def of(cls, tables: Mapping[str, Any], source: str = "<robot>") -> Robot:
        """Robot of the tables that a file would hold. Raises ProblemError."""
        return cls(validated(RobotDescription, tables, source))

    def replace(self, changes: Mapping[str, Any]) -> Robot:
        """Copy with changed dotted keys ({"body.mass": 20.0}), checked like a file; None takes a
        key out. Raises ProblemError."""
        data = self.description.model_dump(mode="json", exclude_none=True)
        for key, value in changes_of(changes, self.description.source):
            set_key(data, key, value, self.description.source)
        return Robot.of(data, self.description.source)

    # -- what the description says ---------------------------------------------------------------

    @property
    def name(self) -> str:
        return self.description.name

    @cached_property
    def driven(self) -> tuple[str, ...]:
        """Names of the wheels that a motor drives, in the order of ``wheels``."""
        motors = {name for motor in self.description.motors for name in motor.wheels}
        return tuple(name for name in self.wheel_names if name in motors)

    @cached_property
    def rolling(self) -> tuple[WheelSection, ...]:
        """Descriptions of ``wheels``."""
        motors = {name for motor in self.description.motors for name in motor.wheels}
        kinds = ("fixed", "steered", "swedish")
        return tuple(w for w in self.description.wheels if w.kind in kinds or w.name in motors)

    @property
    def wheel_names(self) -> tuple[str, ...]:
        """Names of ``wheels``."""
        return tuple(wheel.name for wheel in self.rolling)

    @cached_property
    def wheels(self) -> tuple[Wheel, ...]:
        """Rolling and sliding rows of the wheels, in the order of every per-wheel array."""
        return tuple(kinematic(wheel) for wheel in self.rolling)

    def motor_array(self, key: str) -> Array:
        """(W,): ``torque``, ``speed`` or ``acceleration`` of each wheel's motor, inf without."""
        found = dict.fromkeys(self.wheel_names, math.inf)
        for motor in self.description.motors:
            value = getattr(motor, key)
            found.update(dict.fromkeys(motor.wheels, math.inf if value is None else value))
        return np.array([found[name] for name in self.wheel_names])

    @cached_property
    def body(self) -> Body:
        """Masses and contacts for the limits: a contact a wheel, in the order of the file."""
        motors = {name for motor in self.description.motors for name in motor.wheels}
        wheels, section = self.description.wheels, self.description.body
        axes = tuple(w.angle + w.rollers.angle if w.rollers else math.nan for w in wheels)
        return Body(
            section.mass,
            self.yaw_inertia,
            section.cog,
            tuple(wheel.contact for wheel in wheels),
            axes,
            tuple(wheel.name in motors for wheel in wheels),
            *self._inertias[:2],
        )

    @property
    def yaw_inertia(self) -> float:
        """About the centre of gravity, kg m^2; what the file leaves out follows from masses."""
        given = self.description.body.yaw_inertia
        return self._inertias[2] if given is None else given

    @cached_property
    def _inertias(self) -> tuple[float, float, float]:
        """Of roll, pitch and yaw about the centre of gravity, kg m^2, from masses: the chassis as a
        box of the mass that remains, wheels and pivots as points at the height of their axles."""
        section = self.description.body
        wheels = {w.name: w for w in self.description.wheels}
        parts = [(w.mass, *w.contact, w.radius) for w in wheels.values()]
        for pivot in self.description.pivots:
            first = wheels[pivot.wheels[0]]
            parts.append((pivot.mass, *first.position, first.radius))
        rest = section.mass - sum(part[0] for part in parts)
        parts.append((rest, *section.chassis_place, section.clearance + section.chassis[2] / 2))
        x, y, z = (d**2 * rest / 12 for d in section.chassis)  # of the box about its own middle
        for m, *place in parts:
            a, b, c = (m * (p - q) ** 2 for p, q in zip(place, section.cog, strict=True))
            x, y, z = x + a, y + b, z + c
        return y + z, x + z, x + y

    @cached_property
    def footprint(self) -> tuple[tuple[float, float], ...]:
        """(K, 2): corners of the outline in the body frame, counter-clockwise, m."""
        section = self.description.body
        if section.footprint is not None:
            return section.footprint
        (px, py), (length, width, _) = section.chassis_place, section.chassis
        box = [(px + i * length / 2, py + j * width / 2) for i in (-1, 1) for j in (-1, 1)]
        points = np.vstack([np.array(box), *self.reached.values()])
        (x0, y0), (x1, y1) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
        return ((x1, y1), (x0, y1), (x0, y0), (x1, y0))

    @property
    def reached(self) -> dict[str, Array]:
        """(K, 2) a wheel, by name: places seen from above that it reaches when it turns, m."""
        turns = {name: group.range for group in self.description.steering for name in group.wheels}
        return {w.name: outline(w, turns.get(w.name)) for w in self.description.wheels}

    # -- kinematics --------------------------------------------------------------------------------

    @property
    def holonomic(self) -> bool:
        """Whether every body twist is possible without turning a wheel first."""
        return int(self.admissible.shape[1]) == 3

    @cached_property
    def _rows(self) -> list[Row]:
        if self.description.skid is None:
            return [wheel.driving() for wheel in self.wheels]
        half = self.description.skid.effective_track / 2
        return [
            Row(1.0, 0.0, -half if wheel.position[1] > 0 else half, wheel.radius)
            for wheel in self.wheels
        ]

    @cached_property
    def inverse(self) -> Array:
        """(W, 3): wheel rates (rad/s) = inverse @ (vx, vy, wz), from the rolling rows.

        Steered wheels and castors stand at their own ``beta``; mobility.inverse_at takes other
        angles.
        """
        return wheel_rates(self._rows)

    @cached_property
    def forward(self) -> Array:
        """(3, W): body twist = forward @ wheel rates; exact when wheels agree, least squares
        otherwise. The constrained directions (sliding rows of wheels that may not slide) are
        imposed exactly."""
        allowed = self.admissible
        return np.asarray(allowed @ np.linalg.pinv(self.inverse @ allowed), dtype=np.float64)

    @cached_property
    def admissible(self) -> Array:
        """(3, m): orthonormal basis of the body twists that no sliding row forbids (m =
        mobility)."""
        if self.description.skid is not None:
            return np.eye(3)[:, [0, 2]]
        rows = [w.sliding() for w in self.wheels]
        # a castor gives way by steering
        return null_space(
            np.array([[r.x, r.y, r.yaw] for r in rows if not r.free and r.steer == 0])
        )

    @cached_property
    def turning_length(self) -> float:
        """m; weighs yaw against translation in the path parameter of robots that can turn on the
        spot, sqrt(dx^2 + dy^2 + (L dpsi)^2): the largest distance of a wheel from the origin."""
        if not self.wheels:
            expected = "at least one wheel whose spin follows from the motion"
            raise ArgumentError("robot.wheels", self.name, expected)
        return float(max(w.l for w in self.wheels))

    @cached_property
    def drivable(self) -> Array:
        """(3, m): orthonormal basis of the body twists that no wheel forbids once steered wheels
        stand as the twist needs."""
        if self.description.skid is not None:
            return np.eye(3)[:, [0, 2]]
        rows = [w.sliding() for w in self.wheels if w.kind is WheelKind.FIXED]
        return null_space(np.array([[r.x, r.y, r.yaw] for r in rows]))

    def require_rolling(self, twist: Array, places: Array) -> None:
        """Raises InfeasibleError where the wheels forbid a body twist (N, 3) at path parameters
        (N,), m."""
        slipping = twist - twist @ self.drivable @ self.drivable.T
        bad = np.abs(slipping).max(axis=1) > 1e-6 * np.abs(twist).max(axis=1)
        if not bad.any():
            return
        why = f"the wheels of '{self.name}' cannot roll along this path; "
        if self.drivable.shape[1] == 1:
            why += "they forbid every turn: give [skid] with an effective track"
        elif abs(self.drivable[1]).max() > 1e-9:
            why += (
                "it must be that of a point on the line of its fixed axle: move the body's origin"
            )
        else:
            why += "leave its heading to the direction of travel"
        raise InfeasibleError("rolling", float(places[int(np.argmax(bad))]), why)

    # -- builders ----------------------------------------------------------------------------------

    @classmethod
    def differential(cls, **sizes: Any) -> Robot:
        """Two driven wheels on one axle and a free castor; see ``builders.differential``."""
        return cls.of(_builders().tables("differential", sizes))

    @classmethod
    def car(cls, **sizes: Any) -> Robot:
        """Two fixed rear wheels, two steered front wheels; see ``builders.car``."""
        return cls.of(_builders().tables("car", sizes))

    @classmethod
    def mecanum(cls, **sizes: Any) -> Robot:
        """Four Mecanum wheels; see ``builders.mecanum``."""
        return cls.of(_builders().tables("mecanum", sizes))

    @classmethod
    def omni(cls, **sizes: Any) -> Robot:
        """Omni wheels evenly around the centre; see ``builders.omni``."""
        return cls.of(_builders().tables("omni", sizes))

    @classmethod
    def swerve(cls, **sizes: Any) -> Robot:
        """Four driven, steered wheels; see ``builders.swerve``."""
        return cls.of(_builders().tables("swerve", sizes))


def robot(name: str, overrides: Mapping[str, Any] | None = None) -> Robot:
    """The shipped robot called ``name``, with changed keys as in ``Robot.load``.

    Raises ArgumentError for an unknown name, ProblemError for a wrong key.
    """
    if name not in robot_names():
        raise ArgumentError("robot.name", name, "one of " + ", ".join(robot_names()))
    found = _shipped(name)
    return found.replace(overrides) if overrides else found


@lru_cache
def _shipped(name: str) -> Robot:
    return Robot.load(DATA / f"{name}.toml")


def robot_names() -> tuple[str, ...]:
    """Names of the shipped robots."""
    return tuple(sorted(file.stem for file in DATA.glob("*.toml")))


def _builders() -> Any:
    from trajopt.robots import builders

    return builders
