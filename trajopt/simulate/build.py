"""From a robot's description to the links and joints that engines build.

The description's mass, centre of gravity and yaw inertia are those of the whole robot: the chassis
gets what wheels and pivots leave. Moments about the other axes are those of the chassis box, in
proportion.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.limits.motor_curve import at_wheel
from trajopt.robots.description import PivotSection, WheelSection
from trajopt.robots.robot import STANDARD_GRAVITY, Robot
from trajopt.simulate.double import double_rollers
from trajopt.simulate.looks import axle, mounts
from trajopt.simulate.model import (
    Joint,
    Link,
    Model,
    Pose,
    Shape,
    Vector,
    prisms,
    weigh,
)
from trajopt.simulate.rollers import disc_inertia, ring, roller_wheel
from trajopt.simulate.tyres import FORK_SHARE, ball, fork, tyre

CHASSIS_COLOUR = (0.25, 0.35, 0.55)
OUTLINE_SHARE = 0.01  # of the chassis' mass, carried by the outline's link; chosen
# Servo of a steered wheel, chosen: N m a radian and at most, over the wheel's load times its radius
STEERING_STIFFNESS = 20.0
SWIVEL_TIME = 1.0  # s in which a castor's turning dies out in the air, chosen
TILT_TIME = 0.3  # s, the same for a tilting axle, chosen
# Servo of a driven axle, chosen: N m a radian and at most, over its load times half its length
TILT_STIFFNESS, TILT_EFFORT = 4.0, 1.25
STRUT_SHARE, AXLE_SHARE = 0.03, 0.5  # of a pivot's mass, chosen; the rest is its fork


@lru_cache(maxsize=8)  # the rollers of a robot take as long as half a second of its motion
def build(robot: Robot, *, discs: bool = False, outline: bool = True) -> Model:
    """The robot as links and joints. ``discs``: tyres are cylinders, for broken ground. With
    ``outline`` it has the prism that meets obstacles.

    Raises ArgumentError, naming the key, for wheels that cannot be built, and for a mass, centre of
    gravity or yaw inertia that wheels and pivots leave no chassis for.
    """
    parts = _Parts(robot, discs)
    described = robot.description
    pivoted = {name for pivot in described.pivots for name in pivot.wheels}
    for wheel in described.wheels:
        if wheel.name not in pivoted:
            parts.add_wheel(wheel)
    for pivot in described.pivots:
        parts.add_pivot(pivot)
    root = _chassis(robot, parts.links[1:])
    parts.links[0] = root
    if outline:
        corners, top = robot.footprint, described.body.clearance + described.body.chassis[2]
        rest = 1.0 - OUTLINE_SHARE
        parts.links[0] = replace(root, mass=rest * root.mass, inertia=_scaled(root.inertia, rest))
        parts.links.append(
            Link(
                "outline", 0, Joint("fixed", Pose()), OUTLINE_SHARE * root.mass,
                _scaled(root.inertia, OUTLINE_SHARE), root.cog,
                shapes=prisms(corners, 0.0, top), meets="obstacles",
            )
        )  # fmt: skip
    number = {wheel.name: i for i, wheel in enumerate(described.wheels)}
    links = tuple(
        replace(link, wheel=number.get(link.name.split("/")[0], -1)) for link in parts.links
    )
    return Model(
        robot.name,
        links,
        tuple(parts.feet[wheel.name] for wheel in described.wheels),
        tuple(parts.feet[name] for name in robot.wheel_names),
        tuple(name in robot.driven for name in robot.wheel_names),
        tuple(robot.motor_array("speed").tolist()),
    )


class _Parts:
    """Links so far; the first stands for the chassis, whose mass comes last."""

    def __init__(self, robot: Robot, discs: bool) -> None:
        self.robot, self.discs = robot.description, discs
        self.links = [Link("chassis", -1, Joint("fixed", Pose()), 0.0, (0.0, 0.0, 0.0))]
        self.feet: dict[str, int] = {}
        self.motor = {name: m for m in self.robot.motors for name in m.wheels}
        self.reach = {name: s.range for s in self.robot.steering for name in s.wheels}
        self.load = self.robot.body.mass * STANDARD_GRAVITY / len(self.robot.wheels)  # N a wheel

    def add(self, link: Link) -> int:
        self.links.append(link)
        return len(self.links) - 1

    def spin(self, wheel: WheelSection, pose: Pose) -> Joint:
        """What turns a wheel: its motor, or nothing."""
        motor = self.motor.get(wheel.name)
        if motor is None:
            return Joint("spin", pose, (0.0, 1.0, 0.0))
        return Joint(
            "spin", pose, (0.0, 1.0, 0.0), "velocity", motor.torque,
            curve=at_wheel(motor), brakes=motor.braking == "curve",
        )  # fmt: skip

    def add_wheel(self, wheel: WheelSection) -> None:
        at = Pose((*wheel.position, wheel.radius), yaw=wheel.angle)
        if wheel.kind == "spherical":
            self.feet[wheel.name] = self.add(ball(wheel))
        elif wheel.kind == "swedish":
            self._add_rollers(wheel, at)
        elif wheel.kind == "fixed":
            self.feet[wheel.name] = self.add(tyre(wheel, self.spin(wheel, at), 0, disc=self.discs))
        else:
            steered = wheel.kind == "steered"
            joint = self._steering(wheel, at) if steered else self._swivel(at, wheel)
            holder = self.add(fork(wheel, joint, 0))
            arm = Pose((-wheel.trail, wheel.lateral, 0.0))
            self.feet[wheel.name] = self.add(
                tyre(wheel, self.spin(wheel, arm), holder, disc=self.discs, share=1.0 - FORK_SHARE)
            )

    def _add_rollers(self, wheel: WheelSection, at: Pose) -> None:
        section = wheel.rollers
        assert section is not None  # the description's rule for this kind
        try:
            found = (
                ring(wheel, section)
                if wheel.double is None
                else double_rollers(wheel, section, wheel.double)
            )
            number = self.feet[wheel.name] = len(self.links)
            self.links += roller_wheel(wheel, section, found, self.spin(wheel, at), 0, number)
        except ArgumentError as error:
            where = "" if "." in error.argument else "rollers."
            key = f"wheels.{wheel.name}.{where}{error.argument}"
            raise ArgumentError(key, error.value, error.expected) from None

    def _steering(self, wheel: WheelSection, at: Pose) -> Joint:
        stiffness = STEERING_STIFFNESS * self.load * wheel.radius
        return Joint(
            "steer", at, drive="position", effort=stiffness, stiffness=stiffness,
            reach=self.reach[wheel.name],
        )  # fmt: skip

    def _swivel(self, at: Pose, wheel: WheelSection, mass: float | None = None) -> Joint:
        swung = (mass or wheel.mass) * (wheel.trail**2 + wheel.lateral**2 + wheel.radius**2 / 4.0)
        return Joint("swivel", at, damping=swung / SWIVEL_TIME)

    def add_pivot(self, pivot: PivotSection) -> None:
        """Strut on a spring, fork on the swivel, axle on the tilt, wheels; parts that the pivot
        has not are left out."""
        wheels = [wheel for wheel in self.robot.wheels if wheel.name in pivot.wheels]
        first = wheels[0]
        for key in ("trail", "angle", "radius"):
            values = [getattr(wheel, key) for wheel in wheels]
            if len(set(values)) > 1:
                raise ArgumentError(f"pivots.{pivot.name}", values, f"wheels of the same {key}")
        at, parent, fork_share = Pose((*first.position, first.radius), yaw=first.angle), 0, 0.5
        if pivot.sag is not None:
            fork_share -= STRUT_SHARE
            parent, at = self.add(self._strut(pivot, at, pivot.sag)), Pose()
        mass, half = fork_share * pivot.mass, 0.5 * first.radius
        swung = pivot.mass + sum(wheel.mass for wheel in wheels)
        moment = 0.4 * mass * half**2
        holder = self.add(
            Link(f"pivot {pivot.name}", parent, self._swivel(at, first, swung), mass, (moment,) * 3)
        )
        axle = self.add(self._axle(pivot, wheels, holder))
        for wheel in wheels:
            place = Pose((0.0, wheel.lateral, 0.0))
            self.feet[wheel.name] = self.add(
                tyre(wheel, self.spin(wheel, place), axle, disc=self.discs)
            )

    def _strut(self, pivot: PivotSection, at: Pose, sag: float) -> Link:
        """A spring that the weight above it presses in by ``sag``."""
        described = self.robot
        sprung = described.body.mass - sum(w.mass for w in described.wheels)
        sprung -= sum(other.mass for other in described.pivots)
        rigid = len(described.wheels) - sum(len(p.wheels) for p in described.pivots)
        share = sprung / (len(described.pivots) + rigid)
        stiffness = share * STANDARD_GRAVITY / sag
        joint = Joint(
            "spring", at, drive="spring", stiffness=stiffness, rest=-sag,
            damping=2.0 * pivot.damping_ratio * math.sqrt(stiffness * share),
            reach=(-pivot.travel, pivot.travel),
        )  # fmt: skip
        mass = STRUT_SHARE * pivot.mass
        return Link(f"strut {pivot.name}", 0, joint, mass, (1e-3 * mass,) * 3)

    def _axle(self, pivot: PivotSection, wheels: list[WheelSection], parent: int) -> Link:
        at, load = Pose((-wheels[0].trail, 0.0, 0.0)), self.load * len(wheels)
        half = max(abs(wheel.lateral) for wheel in wheels) or wheels[0].radius
        mass = AXLE_SHARE * pivot.mass
        about, across = disc_inertia(mass, 0.2 * wheels[0].radius, 2.0 * half)
        moved = sum(wheel.mass * wheel.lateral**2 for wheel in wheels) + across
        driven = pivot.tilt == "driven"
        joint = (
            Joint("fixed", at)
            if pivot.tilt == "rigid"
            else Joint(
                "tilt", at, (1.0, 0.0, 0.0), "spring" if driven else None,
                effort=TILT_EFFORT * load * half,
                stiffness=TILT_STIFFNESS * load * half if driven else 0.0,
                damping=moved / TILT_TIME, reach=(-pivot.tilt_range, pivot.tilt_range),
            )
        )  # fmt: skip
        looks = axle(wheels[0].radius, half, wheels[0].trail)
        return Link(f"axle {pivot.name}", parent, joint, mass, (across, about, across), looks=looks)


def _chassis(robot: Robot, others: list[Link]) -> Link:
    """The box that makes the whole robot weigh what its description says; where castors point
    counts as evenly spread."""
    body = robot.description.body
    mass, middle, turning = _parts_moments(others)
    rest, whole = body.mass - mass, np.array(body.cog)
    cog = (body.mass * whole - mass * middle) / rest
    if not cog[2] > 0.0:
        low = f"a height at which the chassis' own is above the ground, not at {cog[2]:.3g} m"
        raise ArgumentError("body.cog", list(body.cog), low)
    theirs = turning + mass * float(np.sum((middle - whole)[:2] ** 2))
    own = robot.yaw_inertia - theirs - rest * float(np.sum((cog - whole)[:2] ** 2))
    if not own > 0.0:
        least = robot.yaw_inertia - own
        expected = f"more than its wheels, pivots and places account for, {least:.4g} kg m^2"
        raise ArgumentError("body.yaw_inertia", robot.yaw_inertia, expected)
    x, y, z = body.chassis
    box: Vector = (y * y + z * z, x * x + z * z, x * x + y * y)
    px, py = body.chassis_place
    shape = Shape("box", (x / 2.0, y / 2.0, z / 2.0), Pose((px, py, body.clearance + z / 2.0)))
    return Link(
        "chassis", -1, Joint("fixed", Pose()), rest, _scaled(box, own / box[2]),
        (float(cog[0]), float(cog[1]), float(cog[2])),
        shapes=(shape,), looks=(shape, *mounts(robot.description)), colour=CHASSIS_COLOUR,
    )  # fmt: skip


def _parts_moments(others: list[Link]) -> tuple[float, Array, float]:
    """Mass (kg), centre of gravity (3,) m and moment of inertia (kg m^2) about the vertical through
    it: the mean of all swivels at 0 and at half a turn, which is that over all their angles."""
    root = Link("", -1, Joint("fixed", Pose()), 0.0, (0.0, 0.0, 0.0))
    found = []
    for half_turn in (0.0, math.pi):
        links = [root]
        for link in others:
            at = link.joint.pose
            if link.joint.role == "swivel":
                at = replace(at, yaw=at.yaw + half_turn)
            links.append(replace(link, joint=replace(link.joint, pose=at)))
        frames = Model("", tuple(links), (), (), (), ()).frames
        mass, x, y, z, turning = weigh(links, frames)
        about_origin = turning + mass * (x**2 + y**2)
        found.append([mass, x, y, z, about_origin])
    mass, x, y, z, about_origin = np.mean(found, axis=0).tolist()
    return mass, np.array([x, y, z]), about_origin - mass * (x**2 + y**2)


def _scaled(moments: Vector, share: float) -> Vector:
    x, y, z = (float(share * moment) for moment in moments)
    return x, y, z
