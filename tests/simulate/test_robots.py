"""Every robot in both engines: what it weighs, and 5 m on flat ground against kinematics."""

from __future__ import annotations

import math

import numpy as np
import pytest

from trajopt.errors import ArgumentError
from trajopt.robots import Robot, robot, robot_names
from trajopt.simulate.build import build
from trajopt.simulate.engine import ENGINES, Start, make_engine
from trajopt.simulate.model import Model, weigh
from trajopt.simulate.scene import stage
from trajopt.simulate.stepping import drive
from trajopt.simulate.straight import deviation, straight_command
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

pytest.importorskip("pybullet")
pytest.importorskip("mujoco")

SCENE = Scene(0.8, Flat())
BUILT = {
    "six-wheeled": {
        "name": "six-wheeled",
        "body": {
            "mass": 30.0, "cog": [0.0, 0.0, 0.15], "chassis": [0.8, 0.4, 0.15], "clearance": 0.08,
        },
        "wheels": [
            {
                "name": f"{side}-{i}", "kind": "fixed", "position": [0.3 * i, sign * 0.25],
                "radius": 0.1, "width": 0.05, "mass": 1.0,
            }
            for side, sign in (("left", 1), ("right", -1)) for i in (1, 0, -1)
        ],
        "motors": [
            {"name": "left", "wheels": ["left-1", "left-0", "left--1"], "torque": 4.0},
            {"name": "right", "wheels": ["right-1", "right-0", "right--1"], "torque": 4.0},
        ],
        "skid": {"effective_track": 0.8},
    },
    "ball": {
        "name": "ball",
        "body": {
            "mass": 4.0, "cog": [-0.02, 0.0, 0.05], "chassis": [0.25, 0.2, 0.08],
            "chassis_place": [-0.04, 0.0], "clearance": 0.02,
        },
        "wheels": [
            {
                "name": name, "kind": "fixed", "position": [0.0, y], "radius": 0.04,
                "width": 0.02, "mass": 0.1,
            }
            for name, y in (("left", 0.12), ("right", -0.12))
        ] + [{
            "name": "ball", "kind": "spherical", "position": [-0.12, 0.0], "radius": 0.015,
            "width": 0.03, "mass": 0.05,
        }],
        "motors": [{"name": n, "wheels": [n], "torque": 0.5, "speed": 20.0} for n in ("left", "right")],
    },
}  # fmt: skip
ROBOTS = {
    **{name: robot(name) for name in robot_names()},
    **{name: Robot.of(tables) for name, tables in BUILT.items()},
}
# m/s where the motors' speed is not given
SPEED = 0.5


def half_speed(machine: Robot) -> float:
    rims = machine.motor_array("speed") * [wheel.radius for wheel in machine.wheels]
    return min(0.5 * float(rims.min()), 3.0) if np.isfinite(rims).any() else SPEED


def directions(machine: Robot) -> list[float]:
    """Forward; sideways and between where it can; castors with motors only as they stand."""
    able = machine.holonomic and not machine.description.pivots
    return [0.0, math.pi / 2, 2.5] if able else [0.0]


def is_long(engine: str, machine: Robot, direction: float) -> bool:
    """Rollers and pivots in Bullet take as long as they drive; LOC8 forward stands for them."""
    parts = machine.description.pivots or machine.description.wheels[0].rollers
    return engine == "pybullet" and bool(parts) and (machine.name != "loc8" or direction != 0.0)


CASES = [
    pytest.param(
        engine, name, direction, id=f"{engine}-{name}-{math.degrees(direction):.0f}",
        marks=[pytest.mark.slow] if is_long(engine, machine, direction) else [],
    )
    for engine in ENGINES for name, machine in ROBOTS.items() for direction in directions(machine)
]  # fmt: skip


@pytest.mark.parametrize(("engine", "name", "direction"), CASES)
def test_five_metres_straight(engine: str, name: str, direction: float) -> None:
    machine = ROBOTS[name]
    speed = half_speed(machine)
    run = drive(machine, SCENE, straight_command(machine, direction, 5.0, speed), engine=engine)
    off = deviation(run, direction, 5.0)
    assert not run.exploded, run.reason
    limit = 0.03 if name == "loc8-smdw" else 0.02
    assert max(abs(off.along), abs(off.across)) <= limit, off
    assert abs(off.yaw) <= math.radians(2.0)
    assert run.hits == ()
    standing = (run.times > 1.0) & (run.times < run.times[-1] - 1.0)
    weight = machine.body.mass * 9.80665
    assert run.loads[standing].sum(axis=1).mean() == pytest.approx(weight, rel=0.03)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", ["loc8", "omni-3", "powerbot"])
def test_turning_on_the_spot(engine: str, name: str) -> None:
    machine = ROBOTS[name]
    speeds = machine.inverse @ np.array([0.0, 0.0, 1.0])
    command = straight_command(ROBOTS["loc8"], 0.0, 1.3, 1.0, ramp=0.3)
    share = command.wheel_speeds[:, :1] / command.wheel_speeds.max()
    command = type(command)(command.times, share * speeds)
    run = drive(machine, SCENE, command, engine=engine)
    assert run.pose[-1, 2] == pytest.approx(1.3, rel=0.03)
    assert np.hypot(*run.pose[-1, :2]) < 0.03


def whole(machine: Robot, weighed: list[np.ndarray]) -> None:
    """Mean over castors at 0 and at half a turn against the description."""
    mass, x, y, z, turning = np.mean(
        [[m, m * x, m * y, m * z, i + m * (x * x + y * y)] for m, x, y, z, i in weighed], axis=0
    )
    body = machine.description.body
    assert mass == pytest.approx(body.mass)
    assert np.array([x, y, z]) / mass == pytest.approx(np.array(body.cog), abs=1e-7)
    x, y = x / mass, y / mass
    assert turning - mass * (x * x + y * y) == pytest.approx(machine.yaw_inertia, rel=1e-6)


def turned(model: Model, angle: float) -> dict[int, float]:
    return dict.fromkeys(model.swivels, angle)


@pytest.mark.parametrize("name", list(ROBOTS))
def test_mujoco_has_the_described_mass_and_inertia(name: str) -> None:
    machine = ROBOTS[name]
    model, found = build(machine), []
    for angle in (0.0, math.pi):
        start = Start(np.array((0.0, 0.0, 0.0)), np.eye(3), turned(model, angle))
        with make_engine("mujoco").open(model, stage(SCENE), start, None) as session:
            body, compiled, data = session.body, session.compiled, session.data
            masses, turns = compiled.body_mass[body], data.ximat[body].reshape(-1, 3, 3)
            places = data.xipos[body]
            own = np.einsum("nij,nj->ni", turns**2, compiled.body_inertia[body])[:, 2]
            middle = masses @ places / masses.sum()
            apart = np.sum((places - middle)[:, :2] ** 2, axis=1)
            found.append(np.array([masses.sum(), *middle, own.sum() + masses @ apart]))
    whole(machine, found)


@pytest.mark.parametrize("name", list(ROBOTS))
def test_bullet_has_the_described_mass_and_inertia(name: str) -> None:
    machine = ROBOTS[name]
    model, found = build(machine), []
    for angle in (0.0, math.pi):
        start = Start(np.array((0.0, 0.0, 0.0)), np.eye(3), turned(model, angle))
        with make_engine("pybullet").open(model, stage(SCENE), start, None) as session:
            bullet, rows = session.bullet, []
            for joint in session.joint:
                facts = bullet.getDynamicsInfo(session.robot, joint)
                if joint < 0:
                    place, turn = bullet.getBasePositionAndOrientation(session.robot)
                else:
                    state = bullet.getLinkState(session.robot, joint, computeForwardKinematics=1)
                    place, turn = state[0], state[1]
                axes = np.array(bullet.getMatrixFromQuaternion(turn)).reshape(3, 3)
                rows.append([facts[0], *place, axes[2] ** 2 @ np.array(facts[2])])
            masses, places, own = (np.array(rows)[:, k] for k in (0, slice(1, 4), 4))
            middle = masses @ places / masses.sum()
            apart = np.sum((places - middle)[:, :2] ** 2, axis=1)
            found.append(np.array([masses.sum(), *middle, own.sum() + masses @ apart]))
    whole(machine, found)


def test_the_model_itself_weighs_what_it_should() -> None:
    for machine in ROBOTS.values():
        if not machine.description.pivots and not any(
            wheel.kind == "castor" for wheel in machine.description.wheels
        ):
            model = build(machine)
            whole(machine, [weigh(model.links, model.frames)])


def test_impossible_masses_are_refused_by_name() -> None:
    with pytest.raises(ArgumentError, match=r"body\.yaw_inertia = 0\.5.*more than"):
        build(robot("loc8", {"body.yaw_inertia": 0.5}))
    with pytest.raises(ArgumentError, match=r"body\.cog"):
        build(robot("loc8", {"body.cog": [0.0, 0.0, 0.01]}))
    uneven = {"wheels.module-1-left.trail": 0.05}
    with pytest.raises(ArgumentError, match=r"pivots\.module-1.*same trail"):
        build(robot("asoc-4", uneven))
