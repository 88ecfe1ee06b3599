"""The robot of a problem: a shipped one or a file, with changed keys, or all of its tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path as FilePath
from typing import Any

from pydantic import Field

from trajopt.errors import ProblemError
from trajopt.robots.robot import DATA, Robot, robot_names
from trajopt.schema import Section, broken_rule, read_tables, set_key

Changes = Field(None, description="changed keys, elements of arrays by name or all")


class RobotSection(Section):
    """Which robot moves. Any key of its file may be changed: ``body.mass = 20.0``,
    ``motors.all.torque = 4.0``, ``wheels.left.radius = 0.1``."""

    name: str | None = Field(None, description="of a shipped robot, or of the one in these tables")
    file: str | None = Field(None, description="robot file, from the folder of the problem file")
    about: str | None = Field(None, description="a sentence for people")
    body: dict[str, Any] | None = Changes
    wheels: dict[str, Any] | list[dict[str, Any]] | None = Field(
        None, description="changed keys by name or all; an array: the whole robot stands here"
    )
    pivots: dict[str, Any] | list[dict[str, Any]] | None = Changes
    motors: dict[str, Any] | list[dict[str, Any]] | None = Changes
    steering: dict[str, Any] | list[dict[str, Any]] | None = Changes
    skid: dict[str, Any] | None = Changes


def robot_tables(section: Mapping[str, Any], folder: FilePath) -> dict[str, Any]:
    """All tables of the robot that a section describes. Raises the broken rule of the section."""
    given = {key: value for key, value in section.items() if value is not None}
    file, name = given.pop("file", None), given.get("name")
    if file is None and isinstance(given.get("wheels"), list):
        return given
    if file is not None:
        base = _tables(folder / str(file))
    elif name in robot_names():
        base = _shipped(str(name))
        del given["name"]
    else:
        expected = "one of " + ", ".join(robot_names()) + ", or file = a robot file"
        raise broken_rule("robot.name", name, expected)
    try:
        for dotted, value in _leaves(given):
            set_key(base, dotted, value, "")
    except ProblemError as error:
        raise broken_rule(f"robot.{error.key}", error.value, error.expected) from None
    return base


def robot_of(section: Mapping[str, Any], folder: FilePath) -> Robot:
    """The robot. Raises the broken rule, with keys as in the problem file."""
    tables = robot_tables(section, folder)
    try:
        return Robot.of(tables, "robot")
    except ProblemError as error:
        raise broken_rule(f"robot.{error.key}", error.value, error.expected) from None


def _tables(file: FilePath) -> dict[str, Any]:
    try:
        return read_tables(file)
    except ProblemError as error:
        raise broken_rule("robot.file", str(file), error.expected) from None


@cache
def _text(name: str) -> dict[str, Any]:
    return read_tables(DATA / f"{name}.toml")


def _shipped(name: str) -> dict[str, Any]:
    from copy import deepcopy

    return deepcopy(_text(name))


def _leaves(table: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys and values; an empty table is a value."""
    for key, value in table.items():
        if isinstance(value, Mapping) and value:
            yield from _leaves(value, f"{before}{key}.")
        else:
            yield before + key, value
