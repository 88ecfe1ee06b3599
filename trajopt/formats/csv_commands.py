"""Commands as CSV: ``t``, ``v_<wheel>``, ``steering_<wheel>``, ``vx``, ``vy``, ``wz``."""

from __future__ import annotations

from pathlib import Path

from trajopt.control.commands import Commands, export_commands
from trajopt.robots.robot import Robot


def write(orders: Commands, robot: Robot, file: Path) -> None:  # noqa: ARG001
    """As ``export_commands``."""
    export_commands(orders, file)
