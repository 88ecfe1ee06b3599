"""Robots as URDF and MJCF: ours out and in again, those of others in, opened by other readers."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from typer.testing import CliRunner

from trajopt import Path as RobotPath
from trajopt import Robot, Speed, WheelSpeed, robot, time_scale
from trajopt.cli import app
from trajopt.errors import ArgumentError, ProblemError
from trajopt.formats import read_robot, write_robot
from trajopt.report.files import robot_toml

mujoco = pytest.importorskip("mujoco")
RACECAR = (
    "left_rear_wheel_joint", "right_rear_wheel_joint",
    "left_front_wheel_joint", "right_front_wheel_joint",
)  # fmt: skip
HUSKY = ("front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel")
UNSAID = {
    "body.chassis": [0.5, 0.2, 0.1],
    "body.chassis_place": [0.16, 0.0],
    "body.clearance": 0.03,
}
BESIDE = {
    "wheels.left_front_wheel_joint.position": [0.325, 0.1225],
    "wheels.right_front_wheel_joint.position": [0.325, -0.1225],
}


@pytest.mark.parametrize("suffix", [".urdf", ".xml"])
@pytest.mark.parametrize("name", ["car", "powerbot", "small-differential", "swerve", "tricycle"])
def test_out_and_in_is_the_same_robot(name: str, suffix: str, tmp_path: Path) -> None:
    mine, file = robot(name), tmp_path / f"mine{suffix}"
    write_robot(mine, file)
    found = read_robot(file, [wheel.name for wheel in mine.description.wheels])
    assert found.inverse == pytest.approx(mine.inverse, rel=1e-5, abs=1e-9)
    assert found.body.mass == pytest.approx(mine.body.mass)
    assert found.yaw_inertia == pytest.approx(mine.yaw_inertia, rel=1e-9)
    shift = np.subtract(found.body.contacts, mine.body.contacts)
    assert shift == pytest.approx(np.broadcast_to(shift[0], shift.shape), abs=2e-6)
    assert np.subtract(found.body.cog, mine.body.cog)[:2] == pytest.approx(shift[0], abs=2e-6)
    for here, there in zip(mine.description.wheels, found.description.wheels, strict=True):
        assert there.kind == here.kind
        for key in ("radius", "width", "mass", "trail", "lateral", "angle"):
            assert getattr(there, key) == pytest.approx(getattr(here, key)), key
    ranges = [group.range for group in mine.description.steering for _ in group.wheels]
    assert [group.range for group in found.description.steering] == ranges
    assert found.driven == mine.driven
    for key in ("torque", "speed"):
        assert found.motor_array(key) == pytest.approx(mine.motor_array(key))
    again = tmp_path / "again.toml"
    again.write_text(robot_toml(found), encoding="utf-8")
    loaded = Robot.load(again).description
    assert loaded.model_dump() == found.description.model_dump()


@pytest.mark.parametrize("suffix", [".urdf", ".xml"])
def test_mujoco_opens_what_is_written(suffix: str, tmp_path: Path) -> None:
    """Rollers of Mecanum wheels are there, and all of the mass."""
    mine = Robot.load(_shipped("omni-3"), {"wheels.all.rollers.shape": "barrel"})
    write_robot(mine, tmp_path / f"mine{suffix}")
    spec = mujoco.MjSpec.from_file(str(tmp_path / f"mine{suffix}"))
    spec.compiler.fusestatic = False  # else what stands still is the world's, without mass
    model = spec.compile()
    hinges = int((model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE).sum())
    rollers = sum(wheel.rollers.count for wheel in mine.description.wheels if wheel.rollers)
    assert hinges == len(mine.wheels) + rollers
    assert model.body_mass.sum() == pytest.approx(mine.body.mass, rel=1e-6)


def test_wheels_of_a_written_model_turn_the_right_way(tmp_path: Path) -> None:
    """MuJoCo drives the MJCF of the differential robot: equal wheel speeds go ahead, a faster right
    wheel turns left."""
    write_robot(robot("small-differential"), tmp_path / "mine.xml")
    spec = mujoco.MjSpec.from_file(str(tmp_path / "mine.xml"))
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    model = spec.compile()
    for speeds, sign in (((2.0, 2.0), 0), ((1.0, 2.0), 1), ((2.0, 1.0), -1)):
        data = mujoco.MjData(model)
        data.ctrl[:] = speeds if model.actuator_biastype.any() else np.multiply(speeds, 0.02)
        mujoco.mj_step(model, data, nstep=500)
        x, *_, w, _, _, z = data.qpos[:7]
        turn = 2 * math.atan2(z, w)
        assert x > 0.01
        assert np.sign(round(turn, 2)) == sign


def test_racecar_is_read_and_asked() -> None:
    data = pytest.importorskip("pybullet_data").getDataPath()
    file = Path(data) / "racecar" / "racecar.urdf"
    with pytest.raises(
        ProblemError, match=r"body\.chassis=.*left_front_wheel_joint\.position"
    ) as e:
        read_robot(file, RACECAR)
    assert "[0.325, 0.1225]" in e.value.expected
    found = read_robot(file, RACECAR, {**UNSAID, **BESIDE})
    ours = found.description
    assert [w.position for w in ours.wheels] == [
        (0, 0.1225),
        (0, -0.1225),
        (0.325, 0.1225),
        (0.325, -0.1225),
    ]
    assert {(w.radius, w.width) for w in ours.wheels} == {(0.05, 0.045)}
    assert ours.steering[0].range == (-1.0, 1.0)
    mass, cog, yaw = _by_pybullet(file)
    assert ours.body.mass == pytest.approx(mass)
    assert ours.body.cog[:2] == pytest.approx(cog, abs=1e-5)
    assert found.yaw_inertia == pytest.approx(yaw, rel=1e-4)
    path = RobotPath.through([[0, 0], [2, 0.5], [4, 0]])
    assert time_scale(path, [Speed(1.0), WheelSpeed(20.0)], robot=found).duration > 4.0


def test_husky_skids_by_name_or_is_refused() -> None:
    data = pytest.importorskip("pybullet_data").getDataPath()
    file = Path(data) / "husky" / "husky.urdf"
    with pytest.raises(ProblemError, match=r"motors\.all\.torque.*skid\.effective_track"):
        read_robot(file, HUSKY)
    found = read_robot(file, HUSKY, {"motors.all.torque": 20.0, "skid.effective_track": 0.9})
    body = found.description.body
    assert body.chassis == (1.0074, 0.5709, 0.2675)
    assert body.clearance == pytest.approx(0.14493 + 0.12498 - 0.2675 / 2, abs=1e-6)
    mass, cog, yaw = _by_pybullet(file)
    assert body.mass == pytest.approx(mass)
    assert body.cog[:2] == pytest.approx(cog, abs=1e-5)
    assert found.yaw_inertia == pytest.approx(yaw, rel=1e-4)


TURNED = """<robot name="r"><link name="base"><inertial><mass value="9"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 0.2"/><geometry><box size="1 0.4 0.2"/></geometry></collision></link>
{links}</robot>"""
LINK = """<link name="{name}"><inertial><mass value="1"/>
<inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>{solid}</link>"""
DRUM = """<collision><origin rpy="1.5707963 0 0"/><geometry><cylinder radius="0.1" length="0.04"/>
</geometry></collision>"""
JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{name}"/>
<origin xyz="{xyz}"/><axis xyz="{axis}"/>{limit}</joint>"""
LIMIT = '<limit lower="-0.2" upper="0.6" effort="3" velocity="5"/>'


def _turned(file: Path, steer: str, wheel: str, arm: str, kind: str = "revolute") -> Robot:
    """Two rear wheels and one on an upright joint with these axes."""
    parts = [
        LINK.format(name=n, solid="" if n == "fork" else DRUM)
        for n in ("left", "right", "fork", "front")
    ]
    parts += [
        JOINT.format(name=n, kind="continuous", parent="base", xyz=f"0 {y} 0.1", axis="0 1 0", limit=LIMIT)
        for n, y in (("left", 0.3), ("right", -0.3))
    ]  # fmt: skip
    parts.append(
        JOINT.format(
            name="fork", kind=kind, parent="base", xyz="0.5 0 0.1", axis=steer, limit=LIMIT
        )
    )
    parts.append(
        JOINT.format(name="front", kind="continuous", parent="fork", xyz=arm, axis=wheel, limit="")
    )
    file.write_text(TURNED.format(links="".join(parts)), encoding="utf-8")
    return read_robot(file, ["left", "right", "front"])


def test_axes_that_point_the_other_way(tmp_path: Path) -> None:
    file = tmp_path / "turned.urdf"
    for wheel in ("0 1 0", "0 -1 0"):
        up, down = (_turned(file, f"0 0 {z}", wheel, "0 0 0") for z in (1, -1))
        assert up.description.steering[0].range == (-0.2, 0.6)
        assert down.description.steering[0].range == (-0.6, 0.2)
        assert down.description.wheels[2].angle == 0.0
    assert up.description.motors[0].torque == 3.0
    assert up.driven == ("left", "right")


@pytest.mark.parametrize(
    ("arm", "contact"), [("-0.05 0.02 0", (0.45, 0.02)), ("0.05 0.02 0", (0.55, 0.02))]
)
def test_a_castor_trails(tmp_path: Path, arm: str, contact: tuple[float, float]) -> None:
    found = _turned(tmp_path / "castor.urdf", "0 0 1", "0 1 0", arm, "continuous")
    wheel = found.description.wheels[2]
    assert (wheel.kind, wheel.trail) == ("castor", pytest.approx(0.05))
    assert wheel.contact == pytest.approx(contact)


def test_what_makes_no_wheel_is_refused_by_name(tmp_path: Path) -> None:
    file = tmp_path / "turned.urdf"
    _turned(file, "0 0 1", "0 1 0", "0 0 0")
    for wheels, told in (
        (["left", "spare"], "'spare'.*left, right, fork, front"),
        (["fork"], "level axle"),
    ):
        with pytest.raises(ArgumentError, match=told):
            read_robot(file, wheels)
    file.write_text(
        file.read_text().replace('name="fork" type="revolute"', 'name="fork" type="prismatic"')
    )
    with pytest.raises(ArgumentError, match=r"'fork'.*suspension"):
        read_robot(file, ["left", "right", "front"])
    file.write_text("<sdf/>")
    with pytest.raises(ArgumentError, match="<robot>"):
        read_robot(file, ["left"])


def test_command_line_reads_and_writes(tmp_path: Path) -> None:
    out, toml = tmp_path / "car.urdf", tmp_path / "again.toml"
    assert CliRunner().invoke(app, ["robot", "car", "--out", str(out)]).exit_code == 0
    names = {joint.get("name") for joint in ElementTree.parse(out).getroot().iter("joint")}
    assert {"front-left", "front-left_steering", "rear-left"} <= names
    wheels = "front-left,front-right,rear-left,rear-right"
    told = CliRunner().invoke(app, ["robot", str(out), "--wheels", wheels, "--out", str(toml)])
    assert told.exit_code == 0, told.output
    assert Robot.load(toml).body.mass == pytest.approx(robot("car").body.mass)
    refused = CliRunner().invoke(app, ["robot", str(out)])
    assert isinstance(refused.exception, ArgumentError)


def _shipped(name: str) -> Path:
    from trajopt.robots.robot import DATA

    return DATA / f"{name}.toml"


def _by_pybullet(file: Path) -> tuple[float, list[float], float]:
    """Mass, centre of gravity (x, y) and yaw inertia by Bullet's own reader."""
    bullet = pytest.importorskip("pybullet")
    client = bullet.connect(bullet.DIRECT)
    try:
        flags = bullet.URDF_USE_INERTIA_FROM_FILE
        body = bullet.loadURDF(str(file), flags=flags, physicsClientId=client)
        start = bullet.getBasePositionAndOrientation(body, physicsClientId=client)
        links = ElementTree.parse(file).getroot().findall("link")
        heavy = [x.get("name") for x in links if x.find("inertial") is not None]
        rows = []
        for link in range(-1, bullet.getNumJoints(body, physicsClientId=client)):
            named = (
                bullet.getBodyInfo(body, physicsClientId=client)[0]
                if link < 0
                else bullet.getJointInfo(body, link, physicsClientId=client)[12]
            )
            if named.decode() not in heavy:
                continue  # Bullet makes them weigh 1 kg
            info = bullet.getDynamicsInfo(body, link, physicsClientId=client)
            at = start if link < 0 else bullet.getLinkState(body, link, physicsClientId=client)[:2]
            turn = bullet.multiplyTransforms(
                [0, 0, 0], at[1], [0, 0, 0], info[4] if link < 0 else [0, 0, 0, 1]
            )[1]
            frame = np.array(bullet.getMatrixFromQuaternion(turn)).reshape(3, 3)
            rows.append((info[0], *at[0][:2], frame[2] ** 2 @ np.array(info[2])))
    finally:
        bullet.disconnect(client)
    mass, x, y, own = np.array(rows).T
    cog = np.array([mass @ x, mass @ y]) / mass.sum()
    return (
        float(mass.sum()),
        cog.tolist(),
        float(own.sum() + mass @ ((x - cog[0]) ** 2 + (y - cog[1]) ** 2)),
    )
