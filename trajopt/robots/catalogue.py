"""The robots that problem files can name: one line a robot."""

from __future__ import annotations

from collections.abc import Callable

from trajopt.errors import ArgumentError
from trajopt.robots.loc8 import loc8
from trajopt.robots.platform import Platform
from trajopt.robots.powerbot import powerbot

ROBOTS: dict[str, Callable[[], Platform]] = {
    "loc8": loc8,
    "powerbot": powerbot,
}


def robot_named(name: str) -> Platform:
    """The robot called ``name``. Raises ArgumentError for an unknown one."""
    if name not in ROBOTS:
        raise ArgumentError("robot.name", name, "one of " + ", ".join(ROBOTS))
    return ROBOTS[name]()
