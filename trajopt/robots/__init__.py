"""Robots: one description (a TOML file or a builder) and what follows from it.

Public: ``robot`` (a shipped robot by name), ``robot_names``, ``Robot`` (``load``, ``replace``,
builders). Kinematics at steering angles stand in ``mobility``.
"""

from trajopt.robots.robot import Robot, robot, robot_names

__all__ = ["Robot", "robot", "robot_names"]
