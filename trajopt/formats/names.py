"""What joints and links are called in files of other programs."""

from __future__ import annotations

from trajopt.robots.robot import Robot

BASE = "base_footprint"  # the body's origin on the ground, as ROS calls it
CHASSIS = "base_link"


def spin_joint(wheel: str) -> str:
    """Joint about which a wheel rolls: the wheel's own name."""
    return wheel


def turning_joints(robot: Robot) -> dict[str, int]:
    """Joints that steer or swivel, each with the first wheel of the file that it turns."""
    wheels = robot.description.wheels
    number = {wheel.name: i for i, wheel in enumerate(wheels)}
    pivoted = {name for pivot in robot.description.pivots for name in pivot.wheels}
    found = {
        link_joint(f"{wheel.name}/fork"): i
        for i, wheel in enumerate(wheels)
        if wheel.kind in ("steered", "castor") and wheel.name not in pivoted
    }
    for pivot in robot.description.pivots:
        found[link_joint(f"pivot {pivot.name}")] = number[pivot.wheels[0]]
    return found


def link_joint(link: str) -> str:
    """Joint that carries the link of the model called so."""
    return link.replace("/fork", "_steering").replace("/", "_roller_").replace(" ", "_")
