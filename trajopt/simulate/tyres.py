"""Links of wheels with a plain tyre, and of balls."""

from __future__ import annotations

from dataclasses import replace

from trajopt.robots.description import WheelSection
from trajopt.simulate import looks
from trajopt.simulate.model import Joint, Link, Pose, Shape, cylinder, sphere
from trajopt.simulate.rollers import disc_inertia

# A castor's fork and a steered wheel's knuckle, of the wheel's mass; chosen.
FORK_SHARE = 0.2
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
