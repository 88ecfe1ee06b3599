"""The robot of docs/robots.md is one file, and that file is all it takes."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from typer.testing import CliRunner

from trajopt import Path as RobotPath
from trajopt import Slip, Speed, WheelSpeed, time_scale
from trajopt.cli import app
from trajopt.robots import Robot

PAGE = Path(__file__).parents[2] / "docs" / "robots.md"


def written(folder: Path) -> list[Path]:
    """The robot files of the page."""
    files = []
    for text in re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL):
        name = re.search(r'^name = "(.*)"', text, re.MULTILINE)
        assert name is not None
        files.append(folder / f"{name.group(1)}.toml")
        files[-1].write_text(text, encoding="utf-8")
    return files


def test_a_roller_robot_costs_one_file(tmp_path: Path) -> None:
    (file,) = written(tmp_path)
    shown = CliRunner().invoke(app, ["robot", str(file), "--out", str(tmp_path / "view.png")])
    assert shown.exit_code == 0, shown.output
    assert "mobility 3, steerability 0, manoeuvrability 3" in shown.output
    assert (tmp_path / "view.png").stat().st_size > 1000


def test_it_is_planned_with_its_own_sizes(tmp_path: Path) -> None:
    robot = Robot.load(written(tmp_path)[0])
    path = RobotPath.through([[0, 0], [1, 1]], heading=[0.3, 0.3])
    timed = time_scale(path, [Speed(1.0), Slip(0.7), WheelSpeed(20.0)], robot=robot)
    turned = timed.at(timed.duration).wheel_angles[0]
    # straight on at a fixed heading: each wheel turns by (dx -+ dy) / radius in the body frame
    c, s = np.cos(0.3), np.sin(0.3)
    dx, dy = c + s, c - s
    wanted = np.array([dx - dy, dx + dy, dx + dy, dx - dy]) / 0.076
    np.testing.assert_allclose(turned, wanted, atol=1e-9)
