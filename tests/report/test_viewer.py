"""The page of a run, in a real browser: what it shows is what the trajectory, the tables and the scene say."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import numpy as np
import pandas as pd
import pytest
from PIL import Image, ImageSequence
from typer.testing import CliRunner

import trajopt
from benchmarks.page_speed import FRAMES, SIZE, many_bodies
from tests.report.browser import need_browser, page_of
from trajopt.arrays import fold, rotation
from trajopt.cli import app
from trajopt.report.run_folder import write_solution, write_validation
from trajopt.report.viewer.motion import Motion, planned, recorded_columns, simulated
from trajopt.report.viewer.motion_page import view_data, write_view
from trajopt.report.viewer.pages import write_page
from trajopt.report.viewer.rollers import rim_velocity, rollers_data
from trajopt.report.viewer.scene_data import scene_data
from trajopt.robots.robot import Robot
from trajopt.simulate.build import build
from trajopt.solution import Solution
from trajopt.world.height_map import HeightMap
from trajopt.world.obstacles import Circle, Obstacle, Polygon, Wall
from trajopt.world.plane import Plane
from trajopt.world.ramp import Ramp, Ramps
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

MOMENTS = (0.3, 0.55, 0.9)  # of the duration


@pytest.fixture(scope="module")
def run(exact: Solution, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run before a step, checked in MuJoCo."""
    folder = write_solution(exact, tmp_path_factory.mktemp("run"), seed=0)
    assert exact.trajectory is not None
    report = trajopt.validate(exact.trajectory, exact.problem, engine="mujoco")
    write_validation(report, folder, exact.problem.robot)
    write_view(exact, folder)
    return folder


def test_it_plays_and_the_timeline_moves_it(run: Path, exact: Solution) -> None:
    with page_of(run / "view.html") as page:
        assert page.title() == exact.problem.title
        assert page.evaluate("view.duration") >= exact.duration - 1e-6
        page.click("#play")
        page.wait_for_function("view.player.time > 0.05", timeout=60_000)
        page.keyboard.press(" ")
        held = page.evaluate("view.player.time")
        assert not page.evaluate("view.player.playing")
        before = page.evaluate("view.place(0)")
        page.locator("#time").fill(str(round(0.8 * exact.duration, 3)))
        page.wait_for_function(
            "Math.abs(view.player.time - Number(document.getElementById('time').value)) < 1e-6"
        )
        page.evaluate("view.frame(view.player.time)")
        assert page.evaluate("view.player.time") == pytest.approx(0.8 * exact.duration, abs=1e-3)
        assert page.evaluate("view.player.time") != held
        assert np.linalg.norm(np.subtract(page.evaluate("view.place(0)"), before)) > 0.1
        assert f"{0.8 * exact.duration:.2f}" in page.inner_text("#clock")
        for key in "12345?":
            page.keyboard.press(key)
        assert page.locator("dialog[open] tr").count() > 10


def test_wheels_stand_at_the_angles_of_the_trajectory(run: Path, exact: Solution) -> None:
    trajectory = exact.trajectory
    assert trajectory is not None
    with page_of(run / "view.html") as page:
        for share in MOMENTS:
            time = share * trajectory.duration
            page.evaluate(f"view.frame({time})")
            for name, angle in zip(
                exact.problem.robot.wheel_names, trajectory.at(time).wheel_angles[0], strict=True
            ):
                shown = page.evaluate(f"view.angle(0, '{name}')")
                assert abs(fold(shown - angle)) < 1e-3


@pytest.mark.parametrize(("motion", "table"), [(0, "trajectory.csv"), (1, "simulated.csv")])
def test_robots_are_where_the_tables_say(run: Path, motion: int, table: str) -> None:
    rows = pd.read_csv(run / table)
    with page_of(run / "view.html") as page:
        for share in MOMENTS:
            row = rows.iloc[int(share * len(rows))]
            page.evaluate(f"view.frame({row['t_s']})")
            x, y, _ = page.evaluate(f"view.place({motion})")
            assert (x, y) == pytest.approx((row["x_m"], row["y_m"]), abs=2e-4)
            assert abs(fold(page.evaluate(f"view.yaw({motion})") - row["yaw_rad"])) < 1e-3
            shown = page.evaluate(f"view.angle({motion}, 'front-left')")
            assert abs(fold(shown - row["wheel_front_left_angle_rad"])) < 2e-3


def test_the_step_stands_where_the_scene_says(run: Path, exact: Solution) -> None:
    (step,) = exact.problem.scene.obstacles
    with page_of(run / "view.html") as page:
        low, high = page.evaluate(f"view.corners('{step.name}')")
    assert_covers(low, high, step, 0.0)


def assert_covers(low: list[float], high: list[float], thing: Obstacle, ground: float) -> None:
    corners = np.array(thing.outline)
    assert low[:2] == pytest.approx(corners.min(axis=0), abs=1e-5)
    assert high[:2] == pytest.approx(corners.max(axis=0), abs=1e-5)
    assert high[2] == pytest.approx(ground + thing.height, abs=1e-5)
    assert low[2] < ground


HILLS = HeightMap(
    0.1 * np.sin(np.arange(60)[:, None] / 5) + 0.004 * np.arange(70)[None, :], 0.1, (-1.5, -2.0)
)
RAMPS = Ramps(
    (Ramp((1.0, 0.2), 0.4, 1.2, 0.2, 0.3), Ramp((3.5, 0.2), 0.4 + np.pi, 0.8, 0.1, 0.2)), 0.5
)
THINGS = (
    Wall("door", 0.8, (2.0, 1.2), (3.0, 1.9), 0.1),
    Circle("post", 1.0, (1.0, -1.2), 0.2),
    Polygon("crate", 0.4, ((0.2, 1.0), (0.8, 0.9), (0.9, 1.5))),
)


@pytest.mark.parametrize(
    "ground", [Flat(), Plane(0.1, 0.7), RAMPS, HILLS], ids=["flat", "plane", "ramps", "map"]
)
def test_ground_and_things_are_those_of_the_scene(ground: Any, tmp_path: Path) -> None:
    robot = trajopt.robot("small-differential")
    path = trajopt.Path.through([[0.0, 0.0], [1.5, 0.5], [3.0, 0.3]])
    trajectory = trajopt.time_scale(
        path, [trajopt.Speed(0.5), trajopt.Acceleration(0.5, 0.5)], robot=robot, ground=ground
    )
    data = view_data(robot, Scene(0.6, ground, THINGS), [planned(trajectory)], "a scene", "")
    with page_of(write_page("motion", data, tmp_path / "view.html")) as page:
        for x, y in np.random.default_rng(1).uniform((-0.5, -0.8), (3.5, 1.2), (12, 2)).tolist():
            shown = page.evaluate(f"view.height({x}, {y})")
            assert shown == pytest.approx(float(ground.height(x, y)), abs=2e-3)
        for thing in THINGS:
            corners = np.array(thing.outline)
            highest = float(np.max(ground.height(corners[:, 0], corners[:, 1])))
            low, high = page.evaluate(f"view.corners('{thing.name}')")
            assert high[2] == pytest.approx(highest + thing.height, abs=1e-5)
            assert_covers(low, [*high[:2], thing.height], thing, 0.0) if isinstance(
                ground, Flat
            ) else None
        page.evaluate("view.frame(view.duration / 2)")
        at = trajectory.at(trajectory.duration / 2)
        assert page.evaluate("view.place(0)") == pytest.approx(at.position[0], abs=1e-4)


@pytest.mark.parametrize("name", ["car", "swerve", "small-differential"])
def test_steered_wheels_and_castors_swing(name: str, tmp_path: Path) -> None:
    robot = trajopt.robot(name)
    path = trajopt.Path.through([[0.0, 0.0], [2.0, 0.6], [4.0, 0.0]])
    trajectory = trajopt.time_scale(
        path, [trajopt.Speed(0.5), trajopt.Acceleration(0.5, 0.5)], robot=robot
    )
    data = view_data(robot, Scene(0.6, Flat()), [planned(trajectory)], name, "")
    model = build(robot, outline=False)
    time, turning = 0.6 * trajectory.duration, 0
    state = trajectory.at(time)
    with page_of(write_page("motion", data, tmp_path / "view.html")) as page:
        page.evaluate(f"view.frame({time})")
        for k, wheel in enumerate(robot.description.wheels):
            if wheel.kind in ("steered", "castor"):
                shown = page.evaluate(f"view.angle(0, '{wheel.name}/fork')")
                assert abs(fold(shown - state.steering_angles[0, k])) < 1e-3
                turning += abs(state.steering_angles[0, k]) > 0.02
            if wheel.kind != "spherical":
                shown = page.evaluate(f"view.angle(0, '{wheel.name}')")
                assert abs(fold(shown - state.spin_angles[0, k])) < 1e-3
        assert page.evaluate("view.bodies") == len(model.links)
    assert turning


def test_wheels_stand_where_physics_has_them_on_axles_that_tilt(tmp_path: Path) -> None:
    """Modules over bumps, 1 mm: without the tilt of their axles some wheels would be 5 mm off."""
    robot = trajopt.robot("asoc-4")
    x, y = np.meshgrid(np.arange(-20, 41), np.arange(-20, 21))
    ground = HeightMap(0.03 * np.sin(1.1 * x) * np.cos(0.9 * y), 0.1, (-2.0, -2.0))
    limits = [trajopt.Speed(0.4), trajopt.Acceleration(0.5, 0.5)]
    trajectory = trajopt.time_scale(
        trajopt.Path.through([[0.0, 0.0], [0.4, 0.0]]), limits, robot=robot
    )
    scene = Scene(0.8, ground)
    recording = trajopt.validate(trajectory, scene, engine="mujoco").recording
    driven = simulated(recorded_columns(recording, robot), robot, "driven")
    file = write_page("motion", view_data(robot, scene, [driven], "bumps", ""), tmp_path / "a.html")
    links = build(robot, outline=False).suspension
    assert len(links) == recording.suspension.shape[1] == 8  # a strut and an axle each
    assert np.abs(recording.suspension).max() > 0.05
    with page_of(file) as page:
        for share in MOMENTS:
            k = int(share * len(recording.times))
            page.evaluate(f"view.frame({recording.times[k]})")
            shown = [page.evaluate(f"view.place(0, '{name}')")[2] for name in robot.wheel_names]
            np.testing.assert_allclose(shown, recording.wheel_heights[k], atol=1e-3)


def test_a_run_is_recorded(run: Path, tmp_path: Path) -> None:
    """Eight times as fast: frames of the size that was asked for, over the motion's time, and it moves."""
    need_browser()
    files = [tmp_path / "a.gif", tmp_path / "a.mp4"]
    wanted = ["view", str(run), "--gif", str(files[0]), "--mp4", str(files[1])]
    told = CliRunner().invoke(app, [*wanted, "--size", "160", "100", "--speed", "8"])
    assert told.exit_code == 0, told.output
    duration = pd.read_csv(run / "simulated.csv")["t_s"].iloc[-1] / 8
    with Image.open(files[0]) as picture:
        frames = [
            np.asarray(frame.convert("L"), dtype=float) for frame in ImageSequence.Iterator(picture)
        ]
    assert {frame.shape for frame in frames} == {(100, 160)}
    assert abs(len(frames) - 15 * duration) <= 2
    moved = [np.abs(frame - frames[0]).max() for frame in frames[1:]]
    assert min(moved) > 40
    film = np.stack(list(imageio.imiter(files[1])))
    assert film.shape[1:] == (100, 160, 3)
    assert abs(len(film) - 30 * duration) <= 2
    assert np.abs(film[-1].astype(float) - film[0]).max() > 40
    for wrong in (["--gif", "a.png"], ["--mp4", "a.gif"], ["--gif", str(files[0]), "--speed", "0"]):
        assert CliRunner().invoke(app, ["view", str(run), *wrong]).exit_code != 0


def unpacked(data: dict[str, str]) -> np.ndarray:
    return np.frombuffer(base64.b64decode(data["f32"]), "<f4")


def sideways(robot: Robot) -> Motion:
    """Ahead, sideways and turning at once, as the kinematics say."""
    twist = np.array([0.3, 0.4, 0.5])
    times = np.linspace(0.0, 2.0, 2001)
    yaw = twist[2] * times
    velocity = np.einsum("nij,j->ni", rotation(yaw), twist[:2])
    place = np.zeros((len(times), 3))
    place[1:, :2] = np.cumsum((velocity[1:] + velocity[:-1]) / 2 * np.diff(times)[:, None], axis=0)
    turn = np.tile(np.eye(3), (len(times), 1, 1))
    turn[:, :2, :2] = rotation(yaw)
    rates = np.tile(robot.inverse @ twist, (len(times), 1))
    none = np.zeros_like(rates)
    spin = rates * times[:, None]
    return Motion("", times, place, turn, np.tile(twist, (len(times), 1)), spin, rates, none, none)


def test_the_lowest_roller_rolls_without_slip_across_its_axis() -> None:
    """Where it touches, the roller's own turning cancels the rim's velocity across the roller's axis."""
    robot = trajopt.robot("loc8")
    motion, model = sideways(robot), build(robot, outline=False)
    rim, _ = rim_velocity(
        robot, motion.twist, motion.steering, motion.steering_rate, motion.spin_rate
    )
    found = rollers_data(motion, robot, model)
    assert len(found) == len(robot.wheels)
    for wheel, data in enumerate(found):
        lowest, turned = (unpacked(data[k]) for k in ("lowest", "turned"))
        for i in (100, 700, 1500):
            link = model.links[data["first"] + int(lowest[i])]
            c, s = np.cos(motion.spin[i, wheel]), np.sin(motion.spin[i, wheel])
            about = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
            base = model.frames[model.feet[wheel]][1]
            axis = base @ about @ link.joint.pose.rotation[:, 2]
            radius = max(
                np.hypot(x, y)
                for shape in link.shapes
                for x, y, _ in shape.corners or ((shape.size[0], 0.0, 0.0),)
            )
            own = np.cross(turned[i] / 1e-3 * axis, [0.0, 0.0, -radius])
            total = own[:2] + rim[i, wheel]
            across = np.array([axis[1], -axis[0]]) / np.hypot(*axis[:2])
            assert abs(total @ across) < 0.02 * np.linalg.norm(rim[i, wheel]) + 1e-6


def test_long_motions_are_thinned_and_kept_to_the_end() -> None:
    robot = trajopt.robot("small-differential")
    path = trajopt.Path.through([[0.0, 0.0], [30.0, 0.0], [60.0, 0.0]])
    trajectory = trajopt.time_scale(
        path, [trajopt.Speed(0.5), trajopt.Acceleration(0.5, 0.5)], robot=robot
    )
    motion = planned(trajectory)
    assert len(motion.times) <= 1500 < 100 * trajectory.duration
    assert motion.times[-1] == pytest.approx(trajectory.duration)
    assert scene_data(Scene(0.6, Flat()), motion.place[:, :2])["high"][0] > 60


def test_eight_hundred_bodies_play(tmp_path: Path) -> None:
    """Planned and driven, 10 s: below 3 MB, and every frame can be drawn; how fast tells the benchmark."""
    file = tmp_path / "view.html"
    assert many_bodies(file) >= 794
    assert file.stat().st_size < 3e6
    with page_of(file, SIZE) as page:
        assert page.evaluate("view.duration") == pytest.approx(10.0, abs=0.5)
        page.evaluate(FRAMES, 30)
