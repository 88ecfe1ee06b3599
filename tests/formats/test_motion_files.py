"""Motions for other programs, read back by readers that are not ours."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from trajopt import Path as RobotPath
from trajopt import Speed, Trajectory, robot, time_scale
from trajopt.cli import app
from trajopt.errors import ArgumentError
from trajopt.formats import FORMATS, export
from trajopt.limits.acceleration import Acceleration
from trajopt.paths.race_line import read_race_line

SCHEMA = Path(__file__).parents[1] / "data" / "formats" / "choreo-traj-3.schema.json"
POINTS = [[0.0, 0.0], [2.0, 0.8], [4.0, -0.3]]
LIMITS = [Speed(0.8), Acceleration(0.5, 1.0)]


def motion(name: str, heading: list[float] | None = None) -> Trajectory:
    return time_scale(RobotPath.through(POINTS, heading=heading), LIMITS, robot=robot(name))


@pytest.fixture(scope="module")
def car() -> Trajectory:
    return motion("car")


@pytest.fixture(scope="module")
def free() -> Trajectory:
    return motion("swerve", [0.3, 1.2, -0.4])


@pytest.mark.parametrize("name", ["small-differential", "swerve", "omni-3"])
def test_csv_and_json_say_the_same_for_every_robot(name: str, tmp_path: Path) -> None:
    """The mean twists of the body go with the mean speeds of the wheels."""
    heading = None if name == "small-differential" else [0.3, 1.2, -0.4]
    timed = motion(name, heading)
    for suffix in ("csv", "json"):
        export(timed, tmp_path / f"c.{suffix}", sample_time=0.1)
    table = pd.read_csv(tmp_path / "c.csv")
    content = json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))
    body = np.column_stack(list(content["body"].values()))
    assert table[["vx", "vy", "wz"]].to_numpy()[:-1] == pytest.approx(body, abs=1e-8)
    assert (table[["vx", "vy", "wz"]].iloc[-1] == 0).all()
    for wheel, values in content["wheels"].items():
        assert table[f"v_{wheel}"].to_numpy()[:-1] == pytest.approx(values["speed_m_s"], abs=1e-8)
    turned = body[:, 2].sum() * 0.1
    assert turned == pytest.approx(np.diff(timed.at([0.0, timed.duration]).pose[:, 2])[0], abs=1e-9)
    if name != "swerve":  # wheels that do not steer: the same linear map of both
        speeds = np.column_stack([w["speed_m_s"] for w in content["wheels"].values()])
        radii = np.array([w["radius_m"] for w in content["wheels"].values()])
        assert speeds / radii == pytest.approx(body @ timed.robot.inverse.T, abs=1e-6)


def test_mcap_is_read_by_its_own_reader(car: Trajectory, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    decoder = pytest.importorskip("mcap_ros2.decoder").DecoderFactory()
    from mcap.reader import make_reader

    export(car, tmp_path / "m.mcap", sample_time=0.05)
    found: dict[str, list[tuple[float, object]]] = {}
    with (tmp_path / "m.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[decoder])
        for _, channel, raw, message in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((raw.log_time / 1e9, message))
    assert set(found) == {"/plan", "/odom", "/joint_states", "/cmd_vel"}
    times = np.array([t for t, _ in found["/odom"]])
    assert times[-1] == pytest.approx(car.duration, abs=1e-8)
    state = car.at(np.minimum(times, car.duration))
    for i in (0, len(times) // 3, len(times) - 1):
        odometry, twist, joints = (found[t][i][1] for t in ("/odom", "/cmd_vel", "/joint_states"))
        pose, q = odometry.pose.pose, odometry.pose.pose.orientation
        assert [pose.position.x, pose.position.y] == pytest.approx(state.pose[i, :2], abs=1e-7)
        assert 2 * np.arctan2(q.z, q.w) == pytest.approx(state.pose[i, 2], abs=1e-7)
        assert [twist.linear.x, twist.angular.z] == pytest.approx(state.twist[i, ::2], abs=1e-7)
        told = dict(zip(joints.name, joints.position, strict=True))
        assert told["rear-left"] == pytest.approx(state.spin_angles[i, 2], abs=1e-6)
        assert told["front-left_steering"] == pytest.approx(state.steering_angles[i, 0], abs=1e-7)
        rates = dict(zip(joints.name, joints.velocity, strict=True))
        assert rates["rear-right"] == pytest.approx(state.spin_rates[i, 3], abs=1e-6)
    ((_, plan),) = found["/plan"]
    assert [p.pose.position.x for p in plan.poses] == pytest.approx(state.pose[:, 0], abs=1e-7)
    assert plan.poses[-1].header.stamp.sec == int(car.duration)


def test_rosbag_is_read_back(car: Trajectory, tmp_path: Path) -> None:
    reading = pytest.importorskip("rosbags.highlevel")
    export(car, tmp_path / "bag", "rosbag", sample_time=0.5)
    with reading.AnyReader([tmp_path / "bag"]) as bag:
        kinds = {c.topic: (c.msgtype, c.msgcount) for c in bag.connections}
    assert kinds["/plan"] == ("nav_msgs/msg/Path", 1)
    assert kinds["/odom"][1] == kinds["/joint_states"][1] == kinds["/cmd_vel"][1] > 5
    with pytest.raises(ArgumentError, match="not there yet"):
        export(car, tmp_path / "bag", "rosbag")


def test_choreo_swerve_holds_the_motion_and_its_forces(free: Trajectory, tmp_path: Path) -> None:
    export(free, tmp_path / "m.traj", sample_time=0.02)
    content = json.loads((tmp_path / "m.traj").read_text(encoding="utf-8"))
    jsonschema.validate(content, json.loads(SCHEMA.read_text(encoding="utf-8")))
    assert content["trajectory"]["sampleType"] == "Swerve"
    table = pd.DataFrame(content["trajectory"]["samples"])
    dt = np.diff(table.t)[:-1]
    for place, speed in (("x", "vx"), ("y", "vy"), ("heading", "omega")):  # of the field
        v = table[speed].to_numpy()
        moved = np.diff(table[place])[:-1]
        assert moved == pytest.approx((v[:-2] + v[1:-1]) / 2 * dt, abs=2e-4)
    fx, fy = (np.array(table[name].to_list()) for name in ("fx", "fy"))
    body, here = free.robot.body, table.heading.to_numpy()
    assert fx.sum(axis=1) == pytest.approx(body.mass * table.ax, abs=1e-9)  # cog at the origin
    assert fy.sum(axis=1) == pytest.approx(body.mass * table.ay, abs=1e-9)
    # front left, rear left, rear right, front right, turned into the field
    x, y = np.array([[0.25, -0.25, -0.25, 0.25], [0.25, 0.25, -0.25, -0.25]])[:, None]
    cos, sin = np.cos(here)[:, None], np.sin(here)[:, None]
    moment = ((cos * x - sin * y) * fy - (sin * x + cos * y) * fx).sum(axis=1)
    assert moment == pytest.approx(body.yaw_inertia * table.alpha, abs=1e-9)


def test_choreo_differential(tmp_path: Path) -> None:
    """Wheel speeds are those of the robot; forces make the work that its motion has."""
    timed = motion("small-differential")
    export(timed, tmp_path / "m.traj", sample_time=0.005)
    content = json.loads((tmp_path / "m.traj").read_text(encoding="utf-8"))
    jsonschema.validate(content, json.loads(SCHEMA.read_text(encoding="utf-8")))
    table = pd.DataFrame(content["trajectory"]["samples"])
    state = timed.at(table.t.to_numpy())
    radius = timed.robot.wheels[0].radius
    assert table[["vl", "vr"]].to_numpy() == pytest.approx(state.wheel_speeds * radius, abs=1e-9)
    body, (vx, _, wz) = timed.robot.body, state.twist.T
    side = wz * body.cog[0]  # of the centre of gravity, whose y is 0
    energy = (body.mass * (vx**2 + side**2) + body.yaw_inertia * wz**2) / 2
    means = [(v[:-1] + v[1:]) / 2 for v in (table.vl.to_numpy(), table.vr.to_numpy())]
    power = table.fl.to_numpy()[:-1] * means[0] + table.fr.to_numpy()[:-1] * means[1]
    work = np.cumsum(power * np.diff(table.t))
    assert body.cog[1] == 0
    assert work == pytest.approx(energy[1:] - energy[0], abs=0.005 * energy.max())


def test_choreo_by_its_own_library(free: Trajectory, tmp_path: Path) -> None:
    choreo = pytest.importorskip("choreo")
    export(free, tmp_path / "m.traj")
    found = choreo.load_swerve_trajectory_string((tmp_path / "m.traj").read_text(encoding="utf-8"))
    assert found.get_total_time() == pytest.approx(free.duration)
    middle = found.sample_at(free.duration / 2)
    assert middle.x == pytest.approx(free.at(free.duration / 2).pose[0, 0], abs=1e-2)


def test_race_line_out_and_in(car: Trajectory, tmp_path: Path) -> None:
    export(car, tmp_path / "line.csv", "tum", sample_time=0.02)
    table = pd.read_csv(tmp_path / "line.csv", sep="; ", engine="python")
    assert list(table.columns)[1:] == ["x_m", "y_m", "psi_rad", "kappa_radpm", "vx_mps", "ax_mps2"]
    line = read_race_line(tmp_path / "line.csv")
    assert line is not None
    s, x, y, psi, kappa, v, a = table.to_numpy().T
    assert np.diff(s) == pytest.approx(np.hypot(np.diff(x), np.diff(y)), rel=1e-3)
    ahead = (-np.sin(psi), np.cos(psi))  # from the y axis, counter-clockwise
    assert np.diff(x) == pytest.approx((ahead[0][:-1] + ahead[0][1:]) / 2 * np.diff(s), abs=1e-4)
    assert np.diff(y) == pytest.approx((ahead[1][:-1] + ahead[1][1:]) / 2 * np.diff(s), abs=1e-4)
    assert np.diff(psi) == pytest.approx((kappa[:-1] + kappa[1:]) / 2 * np.diff(s), abs=1e-4)
    assert v[1:] ** 2 == pytest.approx(v[:-1] ** 2 + 2 * a[:-1] * np.diff(s), abs=1e-9)
    again = RobotPath.through(line.points)
    assert again.length == pytest.approx(car.path.length, rel=1e-4)
    assert line.heading == pytest.approx(psi + np.pi / 2)


def test_a_problem_takes_a_race_line(car: Trajectory, tmp_path: Path) -> None:
    export(car, tmp_path / "line.csv", "tum")
    (tmp_path / "p.toml").write_text(
        'title = "t"\n[robot]\nname = "car"\n[path]\nfile = "line.csv"\n[limits]\nspeed = 0.5\n[ground]\nfriction = 0.8\n',
        encoding="utf-8",
    )
    told = CliRunner().invoke(
        app, ["export", str(tmp_path / "p.toml"), "--out", str(tmp_path / "o.json")]
    )
    assert told.exit_code == 0, told.output
    broken = (tmp_path / "line.csv").read_text().replace("; ", ", ", 30)
    (tmp_path / "line.csv").write_text(broken.replace("# s_m, x_m", "# s_m; x_m"))
    told = CliRunner().invoke(
        app, ["export", str(tmp_path / "p.toml"), "--out", str(tmp_path / "again.json")]
    )
    assert "line.csv" in str(told.exception)


def test_what_a_format_cannot_hold_is_refused(
    car: Trajectory, free: Trajectory, tmp_path: Path
) -> None:
    for timed, name, told in (
        (car, "choreo", "four wheels"),
        (motion("omni-3", [0.0, 0.1, 0.2]), "choreo", "four wheels"),
        (free, "tum", "along its path"),
        (car, "xls", "csv, json"),
    ):
        with pytest.raises(ArgumentError, match=told):
            export(timed, tmp_path / "file", name)
    with pytest.raises(ArgumentError, match=r"\.csv, \.json"):
        export(car, tmp_path / "file.txt")
    with pytest.raises(ArgumentError, match="holds no motion"):
        export(car, tmp_path / "car.urdf", sample_time=0.1)
    with pytest.raises(ArgumentError, match="csv or json only"):
        export(car, tmp_path / "car.mcap", rule="held")


def test_the_page_names_every_format() -> None:
    page = (Path(__file__).parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")
    assert all(f"| `{name}` |" in page for name in FORMATS)
