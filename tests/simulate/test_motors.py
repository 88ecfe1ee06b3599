"""Motors whose torque falls with speed, in both engines."""

from __future__ import annotations

import numpy as np
import pytest

from trajopt.robots import Robot, robot
from trajopt.simulate.build import build
from trajopt.simulate.engine import ENGINES, Observation, make_engine
from trajopt.simulate.measure import observe
from trajopt.simulate.motors import Motors
from trajopt.simulate.stepping import open_session
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

STALL, FREE = 6.0, 15.0  # N m, rad/s


def with_curve(**more: object) -> Robot:
    changes = {"motors.all.curve": [[0.0, STALL], [FREE, 0.0]], "motors.all.speed": None, **more}
    return robot(
        "powerbot", {"body.cog": [-0.132, 0.0, 0.1], "motors.all.torque": STALL, **changes}
    )


def driven(machine: Robot, engine: str, wanted: float, seconds: float) -> list[Observation]:
    """On level ground with much friction, wheels told to turn at ``wanted`` rad/s at once."""
    chosen = make_engine(engine)
    found = []
    with open_session(machine, Scene(2.0, Flat()), chosen) as session:
        for _ in range(round(seconds / chosen.step)):
            session.advance(np.full(2, wanted), np.zeros(0))
            found.append(observe(session))
    return found


@pytest.mark.parametrize("engine", ENGINES)
def test_a_robot_on_dc_motors_speeds_up_as_an_exponential(engine: str) -> None:
    """[closed form] v = r w0 (1 - exp(-t / tau)), tau = w0 m r^2 / (2 T) with m the mass and
    half of that of the wheels, which roll as discs."""
    machine = with_curve()
    r = machine.rolling[0].radius
    mass = machine.body.mass + sum(w.mass / 2 for w in machine.description.wheels)
    tau = FREE * mass * r**2 / (2 * STALL)
    # in Bullet a wheel's contact trails by a millimetre, which pushes it on: as much without a curve
    close = 0.005 if engine == "mujoco" else 0.09
    seen = driven(machine, engine, 40.0, 2 * tau)
    for share in (0.5, 1.0, 2.0):
        now = seen[round(share * tau / make_engine(engine).step) - 1]
        assert now.velocity[0] == pytest.approx(r * FREE * (1 - np.exp(-share)), rel=close)
        torque = STALL * (1 - now.wheel_speeds / FREE)
        np.testing.assert_allclose(now.wheel_torques, torque, atol=0.01 * STALL)
    plain = driven(with_curve(**{"motors.all.curve": None}), engine, 40.0, tau)[-1]
    assert plain.velocity[0] == pytest.approx(r * FREE, rel=close)  # at full torque all along


def test_most_torque_follows_curve_gear_and_way_of_working() -> None:
    geared = {"motors.all.curve": [[0.0, 0.2], [100.0, 0.2], [300.0, 0.0]], "motors.all.gear": 20.0}
    motors = Motors(build(with_curve(**geared)))
    speeds, least = np.array([2.0, -10.0]), 1e-6
    np.testing.assert_allclose(motors.most(speeds, np.array([3.0, -11.0])), [4.0, 2.0])
    np.testing.assert_allclose(motors.most(speeds, np.array([1.0, 0.0])), [STALL, STALL])
    np.testing.assert_allclose(
        motors.most(np.array([20.0, 0.0]), np.array([30.0, 1.0])), [least, 4]
    )
    braking = Motors(build(with_curve(**geared, **{"motors.all.braking": "curve"})))
    np.testing.assert_allclose(braking.most(speeds, np.zeros(2)), [4.0, 2.0])
    assert not Motors(build(robot("powerbot"))).curves
