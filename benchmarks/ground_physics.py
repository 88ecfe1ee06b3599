"""Robots of five kinds on slopes and rough ground, in both physics engines, beside their plans.

Run from the repository: ``python -m benchmarks.ground_physics``. Prints four tables: motions
planned with 80 % of the friction, open and closed loop; motions planned with 120 % of what all wheels
hold together; the slopes at which robots tip over; and the worst of the first two. ``--robots``, ``--engines``, ``--frictions`` leave some out.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np

from benchmarks.common import ResultTable, publish
from trajopt.errors import SimulationError
from trajopt.limits.contact import Contact
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.tip import Tip
from trajopt.paths.path import Path
from trajopt.robots import Robot, robot
from trajopt.robots.description import Sharing
from trajopt.robots.robot import STANDARD_GRAVITY
from trajopt.simulate.check import ValidationReport, validate
from trajopt.simulate.engine import ENGINES, make_engine
from trajopt.simulate.stepping import open_session
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory
from trajopt.world.ground import Ground
from trajopt.world.laid import lay
from trajopt.world.plane import Plane
from trajopt.world.posture import samples_on
from trajopt.world.rough import rough_ground
from trajopt.world.scene import Scene

# Robots and the tangent of the slopes they drive on, over the friction; PowerBot's drive wheels
# alone hold it across and carry 5/8 of it.
ROBOTS = {"powerbot": 0.17, "loc8": 0.3, "asoc-4": 0.3, "car": 0.3, "swerve": 0.3}
GROUNDS = ("contour", "diagonal", "rough")
FRICTIONS = (0.4, 0.6, 0.8)
SPEED, LENGTH, BEND = 1.0, 2.0, 0.08  # m/s, m, m: a slight S in two metres
# m, standard deviation and correlation length of heights: a robot of half a metre without springs
# stands on all its wheels within their give of 1 mm; on sharper ground two carry it and the limits,
# which know a suspension, are too hopeful
HILLS, HILL = 0.3, 20.0
# Of an even share, left on every wheel: PowerBot would brake with its castors in the air. At 0.1 they
# bear 2.5 % of the weight, and tyres that give let them bounce off the ground as braking begins
LOAD = 0.2
SAFE, BEYOND = 0.8, 1.2  # shares of the friction
FAST = (
    1.2  # m/s, beyond: at 1 m/s braking is so short that the mean over ``SLIP_TIME`` hides the slip
)
LEFT = "left physics"
# Tall robots: centres of gravity raised until they tip before they slide. Springs are left out, for
# on them a robot leans before it tips, which the limit does not know. Castors are blocked, for else PowerBot turns about its lower
# drive wheel, which alone is loaded, before it tips across.
TALL: dict[str, dict[str, Any]] = {
    "powerbot": {
        "body.cog": [-0.132, 0.0, 0.7],
        **{
            f"wheels.castor-{side}.{key}": value
            for side, y in (("left", 0.22), ("right", -0.22))
            for key, value in (("kind", "fixed"), ("trail", None), ("position", [-0.35, y]))
        },
    },
    "loc8": {"body.cog": [0.0, 0.0, 0.7]},
    "asoc-4": {
        "body.cog": [0.0, 0.0, 0.9],
        "pivots.all.sag": None,
        "motors.all.torque": 200.0,  # one module has to hold it all
    },
    "car": {"body.cog": [0.17145, 0.0, 0.3]},
    "swerve": {"body.cog": [0.0, 0.0, 0.6]},
}
TIPS = {"downhill": 0.0, "across": math.pi / 2}
FIRM = 2.0  # friction at which none slides
FALL, LEAN = 2.0, math.radians(3.0)  # s in which a robot leans by that much when it tips over
WITHIN, RESOLUTION = math.radians(4.0), math.radians(0.3)

Rows = Iterator[tuple[str, ...]]


def ground_of(name: str, place: str, friction: float) -> Ground:
    """A slope that rises along y, or hills."""
    if place == "rough":
        rng = np.random.default_rng(4)
        return rough_ground(HILLS, rng=rng, size=8.0, correlation=HILL, spacing=0.2)
    return Plane(math.atan(ROBOTS[name] * friction), math.pi / 2)


def plan(
    name: str,
    place: str,
    friction: float,
    share: float,
    rule: Sharing | None = None,
    speed: float = SPEED,
) -> Trajectory:
    """A slight bend along the contour or, on the other grounds, between it and uphill; robots that
    can keep their heading. The slip limit has ``share`` of the friction, by the ``rule`` or, None,
    the robot's own."""
    machine, turn = robot(name), 0.0 if place == "contour" else math.pi / 4
    points = np.array([[0.0, 0.0], [LENGTH / 2, BEND], [LENGTH, 0.0]])
    cos, sin = math.cos(turn), math.sin(turn)
    keeps = machine.drivable.shape[1] == 3
    path = Path.through(
        points @ np.array([[cos, sin], [-sin, cos]]), heading=[0.0, 0.0, 0.0] if keeps else None
    )
    limits = (Speed(speed), Slip(share * friction, rule=rule), Tip(), Contact(LOAD))
    return time_scale(path, limits, robot=machine, ground=ground_of(name, place, friction))


def driven(
    trajectory: Trajectory, friction: float, engine: str, *, closed: bool = False
) -> ValidationReport:
    scene = Scene(friction, trajectory.ground)
    return validate(trajectory, scene, engine=engine, control="pose" if closed else None, seed=1)


def tip_slope(machine: Robot, direction: float) -> float:
    """Slope (rad) at which ``Tip`` has the robot, at rest on a plane that falls along ``direction``
    in the body, tip over."""
    ahead = Path.through([[0.0, 0.0], [1.0, 0.0]])

    def stands(slope: float) -> bool:
        plane, place = Plane(slope, direction + math.pi), np.array([0.5])
        path = lay(ahead, plane)
        at_rest = samples_on(plane, path, place, path.locate(place))
        return bool(np.all(Tip().rows(at_rest, machine).c > 0.0))

    low, high = 0.0, math.pi / 2
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if stands(middle) else (low, middle)
    return low


def tipped(machine: Robot, direction: float, slope: float, engine: str) -> bool:
    """Whether the robot, its wheels held, tips over on a plane of ``slope`` (rad) that falls along
    ``direction`` (rad) in its body."""
    plane = Plane(slope, direction + math.pi)
    chosen = make_engine(engine)
    with open_session(machine, Scene(FIRM, plane), chosen) as session:
        still = np.zeros(len(machine.wheels)), np.zeros(len(session.model.targets))
        for _ in range(round(FALL / chosen.step / 50)):
            for _ in range(50):
                session.advance(*still)
            if session.base().rotation[0][:, 2] @ plane.normal < math.cos(LEAN):
                return True
    return False


def physics_tip_slope(machine: Robot, direction: float, engine: str) -> float:
    """Slope (rad) at which it does, within WITHIN of the model's, to RESOLUTION."""
    expected = tip_slope(machine, direction)
    low, high = expected - WITHIN, expected + WITHIN
    while high - low > RESOLUTION:
        middle = (low + high) / 2
        low, high = (low, middle) if tipped(machine, direction, middle, engine) else (middle, high)
    return (low + high) / 2


def safe_rows(names: Sequence[str], engines: Sequence[str], frictions: Sequence[float]) -> Rows:
    """Motions planned with SAFE of the friction."""
    for name, place, friction in product(names, GROUNDS, frictions):
        trajectory = plan(name, place, friction, SAFE)
        for engine in engines:
            opened = driven(trajectory, friction, engine)
            closed = driven(trajectory, friction, engine, closed=True)
            moving = opened.recording.times < trajectory.duration
            off = np.abs(opened.recording.loads - opened.wheel_plan.loads)[moving].mean(axis=0)
            weight = robot(name).body.mass * STANDARD_GRAVITY
            yield (
                name, place, f"{friction:g}", engine, f"{trajectory.duration:.2f}",
                f"{100 * opened.final_distance / opened.length:.2f}",
                f"{1e3 * closed.final_distance:.1f}", f"{100 * opened.slip_share:.1f}",
                f"{100 * closed.slip_share:.1f}", f"{opened.steering_error.max():.4f}",
                f"{100 * off.max() / weight:.1f}",
            )  # fmt: skip


def plan_beyond(name: str, place: str, friction: float) -> Trajectory:
    """A motion planned with BEYOND of the friction that all wheels have together."""
    return plan(name, place, friction, BEYOND, "capacity", FAST)


def beyond_rows(names: Sequence[str], engines: Sequence[str], frictions: Sequence[float]) -> Rows:
    """Motions of ``plan_beyond``."""
    for name, place, friction in product(names, GROUNDS, frictions):
        trajectory = plan_beyond(name, place, friction)
        for engine in engines:
            share, off = LEFT, ""
            try:
                report = driven(trajectory, friction, engine)
                share = f"{100 * report.slip_share:.1f}"
                off = f"{100 * report.final_distance / report.length:.2f}"
            except SimulationError as error:
                off = str(error)
            yield name, place, f"{friction:g}", engine, share, off


def tip_rows(names: Sequence[str], engines: Sequence[str]) -> Rows:
    """Tall robots, downhill and across."""
    for name, (word, direction) in product(names, TIPS.items()):
        machine = robot(name, TALL[name])
        expected = math.degrees(tip_slope(machine, direction))
        found = [math.degrees(physics_tip_slope(machine, direction, e)) for e in engines]
        yield (
            name,
            f"{TALL[name]['body.cog'][2]:g}",
            word,
            f"{expected:.1f}",
            *(f"{v:.1f}" for v in found),
        )


def worst_rows(safe: Sequence[tuple[str, ...]], beyond: Sequence[tuple[str, ...]]) -> Rows:
    """Of all grounds and frictions, for every robot and engine: largest figures of ``safe_rows``,
    least slip of ``beyond_rows``; a motion that left physics slid."""
    for name, engine in dict.fromkeys((row[0], row[3]) for row in safe):
        mine = [row for row in safe if (row[0], row[3]) == (name, engine)]
        slid = [row[4] for row in beyond if (row[0], row[3]) == (name, engine)]
        least = min((float(share) for share in slid if share != LEFT), default=math.inf)
        columns = (5, 6, 7, 9)
        worst = (max((row[k] for row in mine), key=float) for k in columns)
        yield name, engine, *worst, f"{least:g}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", nargs="+", default=list(ROBOTS), choices=list(ROBOTS))
    parser.add_argument("--engines", nargs="+", default=list(ENGINES), choices=list(ENGINES))
    parser.add_argument("--frictions", nargs="+", type=float, default=list(FRICTIONS))
    asked = parser.parse_args()
    cases = (asked.robots, asked.engines, asked.frictions)
    motion = ("robot", "ground", "friction", "engine")
    safe, beyond = list(safe_rows(*cases)), list(beyond_rows(*cases))
    tables = [
        ResultTable(
            f"Planned with {SAFE:.0%} of the friction, by each robot's own rule",
            (*motion, "duration [s]", "open loop: off [% of way]", "closed loop: off [mm]",
             "slip, open [% of speed]", "slip, closed [%]", "steering off [rad]",
             "loads off [% of weight]"),
            safe,
        ),
        ResultTable(
            f"Planned with {BEYOND:.0%} of the friction of all wheels together",
            (*motion, "slip [% of speed]", "off [% of way]"),
            beyond,
        ),
        ResultTable(
            "Slope at which a tall robot tips over",
            ("robot", "centre of gravity [m]", "facing", "model [deg]",
             *(f"{e} [deg]" for e in asked.engines)),
            list(tip_rows(asked.robots, asked.engines)),
        ),
        ResultTable(
            "Worst of all grounds and frictions",
            ("robot", "engine", "open loop: off [% of way]", "closed loop: off [mm]",
             "slip [% of speed]", "steering off [rad]", f"slip at {BEYOND:.0%} [%], at least"),
            list(worst_rows(safe, beyond)),
        ),
    ]  # fmt: skip
    publish("ground_physics", tables, packages=("trajopt", "numpy", *ENGINES))


if __name__ == "__main__":
    main()
