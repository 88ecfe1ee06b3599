"""A robot on four roller wheels as the roller engines build it, from its description."""

from __future__ import annotations

from trajopt.errors import ArgumentError
from trajopt.robots.description import WheelSection
from trajopt.robots.robot import Robot
from trajopt.simulate.engine import SimRobot
from trajopt.simulate.rollers import RollerWheel, mecanum_wheel
from trajopt.systems.smdw.wheel import smdw_wheel


def roller_robot(robot: Robot) -> SimRobot:
    """``robot`` for the roller engines: its chassis such that the whole has the described mass and
    centre of gravity.

    Raises ArgumentError naming the size that makes no robot, or a robot that does not stand on four
    roller wheels.
    """
    body, wheels = robot.description.body, robot.description.wheels
    chassis = body.mass - sum(wheel.mass for wheel in wheels)
    height = (body.mass * body.cog[2] - sum(w.mass * w.radius for w in wheels)) / chassis
    built: dict[WheelSection, RollerWheel] = {}  # equal wheels share their rollers
    for wheel in wheels:
        like = wheel.model_copy(update={"name": "", "position": (0.0, 0.0)})
        built.setdefault(like, _built(like))
    return SimRobot(
        name=robot.name,
        robot=robot,
        chassis_mass=chassis,
        chassis_size=body.chassis,
        chassis_clearance=body.clearance,
        cog_height=height,
        wheel_positions=tuple(wheel.position for wheel in wheels),
        wheels=tuple(
            built[w.model_copy(update={"name": "", "position": (0.0, 0.0)})] for w in wheels
        ),
        torque_limit=float(robot.motor_array("torque").max(initial=0.0)),
    )


def _built(wheel: WheelSection) -> RollerWheel:
    if wheel.rollers is None:
        raise ArgumentError("robot.wheels", wheel.kind, "four wheels with rollers (kind 'swedish')")
    if wheel.double is not None:
        return smdw_wheel(wheel)
    return mecanum_wheel(
        wheel.radius,
        rollers=wheel.rollers.count,
        roller_radius=wheel.rollers.radius,
        angle=wheel.rollers.angle,
        shape=wheel.rollers.shape,
        spheres=wheel.rollers.spheres,
        mass=wheel.mass,
        roller_mass=wheel.rollers.mass,
    )
