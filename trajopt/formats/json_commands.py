"""Commands as JSON: an object with the robot's wheels, the times and a list a quantity."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from trajopt.control.commands import Commands
from trajopt.report.files import write_json
from trajopt.robots.robot import Robot


def write(orders: Commands, robot: Robot, file: Path) -> None:
    """Each command holds from its time for ``sample_time_s``; steering angles are those at the
    times, and one more at the end."""
    content: dict[str, Any] = {
        "robot": robot.name,
        "sample_time_s": orders.sample_time,
        "t_s": orders.times,
        "body": dict(zip(("vx_m_s", "vy_m_s", "wz_rad_s"), orders.body.T, strict=True)),
        "wheels": {
            wheel.name: {"radius_m": wheel.radius, "speed_m_s": speeds}
            for wheel, speeds in zip(robot.rolling, orders.speeds.T, strict=True)
        },
    }
    for name, angles in zip(orders.steered, orders.steering.T, strict=True):
        content["wheels"][name]["steering_rad"] = angles
    write_json(file, content)
