"""Links of wheels with a plain tyre, and of balls; how soft they are."""

from __future__ import annotations

import math
from dataclasses import replace

from trajopt.robots.description import WheelSection
from trajopt.robots.robot import STANDARD_GRAVITY
from trajopt.simulate import looks
from trajopt.simulate.model import Joint, Link, Model, Pose, Shape, cylinder, sphere
from trajopt.simulate.rollers import disc_inertia

# A castor's fork and a steered wheel's knuckle, of the wheel's mass; chosen.
FORK_SHARE = 0.2
# Tyres on smooth ground give way by this much under the robot's weight, m, at this share of critical
# damping, and on slopes and hills so does each part of a rim of rollers, of which three touch at once
# (1 mm together); chosen: contacts that are equally soft share the load as the limits assume. Hard
# rollers on four wheels leave two of them without load; on level ground soft ones lose 0.3 % more
# sideways than a tilting axis costs (measured). Parts of a turning rim come down on the ground at
# speed: they are damped as they come and not as they go, where they cannot pull, and damping lifts the
# wheels that turn (measured: at 0.2 they bear 60 % of a robot that moves diagonally, at 0.8 3/4;
# at 0.05 a tall robot rocks, once put down, until it tips).
TYRE_SAG, TYRE_DAMPING = 0.0005, 0.8
ROLLER_SAG, ROLLER_DAMPING = 0.003, 0.1
RIM_SAG = ROLLER_SAG / 3.0
_ACROSS = Pose.along((0.0, 1.0, 0.0))


def tyre(wheel: WheelSection, spin: Joint, parent: int, *, disc: bool, share: float = 1.0) -> Link:
    """The wheel, ``share`` of its mass.

    On smooth ground a sphere touches it: one point right below the axle, where a cylinder's two
    would resist turning. A ``disc`` is what it looks like: on broken ground and at steps a sphere
    would meet what is beside the wheel.
    """
    about, across = disc_inertia(share * wheel.mass, wheel.radius, wheel.width)
    drum = cylinder(wheel.radius, wheel.width, _ACROSS)
    return Link(
        wheel.name,
        parent,
        spin,
        share * wheel.mass,
        (across, about, across),
        shapes=(replace(drum, kind="disc") if disc else sphere(wheel.radius),),
        looks=(drum, _spoke(wheel)),
    )


def ball(wheel: WheelSection) -> Link:
    """A ball that carries load and passes on nothing else: without friction, fixed to the body."""
    x, y = wheel.position
    moment = 0.4 * wheel.mass * wheel.radius**2
    shape = (sphere(wheel.radius),)
    return Link(
        wheel.name, 0, Joint("fixed", Pose((x, y, wheel.radius))), wheel.mass, (moment,) * 3,
        shapes=shape, looks=shape, grip=0.0,
    )  # fmt: skip


def fork(wheel: WheelSection, joint: Joint, parent: int) -> Link:
    """What turns with a castor or a steered wheel and does not spin; its mass is where the wheel
    is."""
    mass = FORK_SHARE * wheel.mass
    about, across = disc_inertia(mass, wheel.radius, wheel.width)
    cog = (-wheel.trail, wheel.lateral, 0.0)
    return Link(
        f"{wheel.name}/fork", parent, joint, mass, (across, about, across), cog,
        looks=looks.fork(wheel),
    )  # fmt: skip


def _spoke(wheel: WheelSection) -> Shape:
    """A bar across the wheel, so that pictures show how it has turned."""
    return Shape("box", (0.1 * wheel.radius, 0.51 * wheel.width, 0.9 * wheel.radius))


def give(model: Model, link: Link) -> tuple[float, float] | None:
    """Stiffness (N/m) and damping (N s/m) of what of a link touches smooth ground; None: hard."""
    ball = link.wheel >= 0 and link.shapes[:1] and link.shapes[0].kind == "sphere"
    if not (ball or link.joint.role == "roller"):
        return None
    load = model.mass / len(model.feet)
    stiffness, share = load * STANDARD_GRAVITY / TYRE_SAG, TYRE_DAMPING
    if link.joint.role == "roller":
        stiffness, share = load * STANDARD_GRAVITY / ROLLER_SAG, ROLLER_DAMPING
    return stiffness, share * 2.0 * math.sqrt(stiffness * load)
