"""The loop that drives a robot through a scene in any engine and records it."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from trajopt.arrays import Array
from trajopt.control.measured import Controller, Targets
from trajopt.errors import ArgumentError, SimulationError
from trajopt.provenance import versions
from trajopt.robots.robot import Robot
from trajopt.simulate.build import build
from trajopt.simulate.engine import (
    Camera,
    Command,
    Engine,
    Hit,
    Observation,
    Recording,
    Session,
    Start,
    make_engine,
)
from trajopt.simulate.measure import observe
from trajopt.simulate.model import Model, Vector
from trajopt.simulate.scene import Area, Stage, stage
from trajopt.simulate.sensors import Sense, exact
from trajopt.simulate.standing import beyond, standing
from trajopt.world.scene import Scene

SETTLE, SETTLE_ON_SPRINGS = (
    0.2,
    0.5,
)  # s at rest before the command starts, chosen; the second also on
# bent ground, where the robot falls by some millimetres
# A run has left physics beyond these (chosen: an order above anything that a wheeled robot shows).
MAX_SPEED = 20.0  # m/s of the robot frame
MAX_HEIGHT = 1.0  # m of the robot frame above or below the ground
MAX_PENETRATION = 0.02  # m of a wheel into the ground
MAX_WHEEL_SPEED = 600.0  # rad/s
MAX_LEAN = 1.2  # rad of roll or pitch beyond which a robot has tipped over, chosen


@dataclass(frozen=True)
class Pace:
    """Time grid of a run: engine ``step`` [s] and how many steps lie between two records."""

    step: float
    stride: int

    def __post_init__(self) -> None:
        """Raise ArgumentError for a step outside (0, 20 ms] or a stride below 1."""
        if not 0.0 < self.step <= 0.02:
            raise ArgumentError(
                "step", self.step, "a time step in (0, 0.02] s; 0.002 s is accurate"
            )
        if self.stride < 1:
            raise ArgumentError("stride", self.stride, "at least 1 step a record")


@contextmanager
def open_session(
    robot: Robot,
    scene: Scene,
    engine: Engine,
    *,
    pose: Vector = (0.0, 0.0, 0.0),
    wheel_angles: Array | None = None,
    angles: Array | None = None,
    swivels: Array | None = None,
    settle: float | None = None,
    absent: Sequence[str] = (),
    picture: Camera | None = None,
    area: Area | None = None,
) -> Iterator[Session]:
    """The robot in the scene at ``pose``, in its posture on the ground, at rest after ``settle``
    seconds (None: as long as its springs need); obstacles called ``absent`` are out of the world
    until moved. ``area``: see ``scene.stage``. Raises ArgumentError for a bad ``settle`` or angles
    of another number, and what ``stage`` and ``Engine.open`` raise."""
    stand = stage(scene, area)
    model = build(robot, discs=stand.broken, outline=stand.has_obstacles)
    if settle is None:
        settle = SETTLE_ON_SPRINGS if model.springs or stand.plates else SETTLE
    if not (math.isfinite(settle) and settle >= 0.0):
        raise ArgumentError("settle", settle, "a time of at least 0 s")
    joints: dict[int, float] = {}
    for name, links, values in (
        ("start_wheel_angles", model.spins, wheel_angles),
        ("angles", model.targets, angles),
        ("start_swivels", model.swivels, swivels),
    ):
        if values is not None and np.shape(values) != (len(links),):
            raise ArgumentError(name, np.shape(values), f"shape ({len(links)},), rad")
        joints |= dict(zip(links, np.zeros(len(links)) if values is None else values, strict=True))
    turned = (np.array([joints[k] for k in links]) for links in (model.targets, model.swivels))
    start = Start(*standing(stand, robot, pose, model.steering(*turned)), joints)
    with engine.open(model, stand, start, picture) as session:
        for name in absent:
            session.move(name, None)
        held = Targets(np.zeros(len(model.spins)), np.array([joints[k] for k in model.targets]))
        for _ in range(round(settle / engine.step)):
            session.advance(held.wheel_speeds, held.angles)
        yield session


def interval(session: Session, before: Targets, after: Targets, steps: int) -> None:
    """Targets go evenly from ``before`` to ``after`` in ``steps`` steps: a jump would tear wheels
    loose. They are taken in the middle of each step, so that the commanded angle is the integral of
    the command."""
    share = ((np.arange(steps) + 0.5) / steps)[:, None]
    still = np.zeros(len(session.model.targets))
    first, last = (t.angles if np.size(t.angles) else still for t in (before, after))
    speeds = before.wheel_speeds + share * (after.wheel_speeds - before.wheel_speeds)
    rows = _within(session.model, speeds, first + share * (last - first))
    for row in zip(*rows, strict=True):
        session.advance(*row)


def _within(model: Model, speeds: Array, angles: Array) -> tuple[Array, Array]:
    """Wheel speeds (M, W) and angles (M, S) that motors and steering can do."""
    top = np.array(model.top_speed)
    low, high = np.array(model.target_reach).reshape(-1, 2).T
    return np.clip(speeds, -top, top), np.clip(angles, low, high)


def drive(
    robot: Robot,
    scene: Scene,
    command: Command,
    *,
    engine: str | Engine = "auto",
    controller: Controller | None = None,
    sense: Sense = exact,
    settle: float | None = None,
    picture: Camera | None = None,
    area: Area | None = None,
) -> Recording:
    """Hold still until settled, then execute the command, at most as fast as the motors turn, and
    record every ``engine.stride`` steps. ``area``: see ``scene.stage``.

    A ``controller``, told what ``sense`` measures, replaces the command's speeds and angles at
    every record. Raises ArgumentError for a command of another number of wheels or drives, and as
    ``open_session``.
    """
    chosen = make_engine(engine, picture=picture is not None)
    wheels = len(robot.wheels)
    if np.shape(command.wheel_speeds)[1] != wheels:
        raise ArgumentError(
            "wheel_speeds", np.shape(command.wheel_speeds), f"{wheels} columns, one a wheel"
        )
    with open_session(
        robot,
        scene,
        chosen,
        pose=command.start_pose,
        wheel_angles=command.start_wheel_angles,
        angles=None if command.angles is None else command.angles[0],
        swivels=command.start_swivels,
        settle=settle,
        picture=picture,
        area=area,
    ) as session:
        begun = time.perf_counter()
        times, rows, reason = _driven(session, command, chosen, controller, sense)
        wall = time.perf_counter() - begun
        image, no_picture = _drawn(session, picture)
    label = (chosen.name, versions([chosen.name]).get(chosen.name, ""))  # "": a user's own engine
    recording = _assembled(label, np.array(times), rows, reason, wall)
    return replace(recording, picture=image, no_picture=no_picture)


def _drawn(session: Session, camera: Camera | None) -> tuple[NDArray[np.uint8] | None, str]:
    """The picture, or why there is none: a motion is not lost for want of graphics."""
    try:
        return (None if camera is None else session.render(camera)), ""
    except SimulationError as error:
        return None, str(error)


def _driven(
    session: Session, command: Command, pace: Engine, controller: Controller | None, sense: Sense
) -> tuple[list[float], list[Observation], str]:
    """Times, what was seen, and why the run was stopped (empty: it was not)."""
    model = session.model
    times, rows = [0.0], [observe(session)]
    reason = explosion(rows[0], session.stage)
    steps = math.ceil(command.duration / pace.step - 1e-9)
    middles = pace.step * (np.arange(-0.5, steps) if controller is None else np.zeros(1))
    speeds, angles = _within(model, *command.at(middles, len(model.targets)))
    last = Targets(np.zeros(len(model.spins)), angles[0])
    for first in range(0, steps, pace.stride):
        if reason:
            break
        span = min(pace.stride, steps - first)
        if controller is None:
            for i in range(first + 1, first + span + 1):
                session.advance(speeds[i], angles[i])
        else:
            asked = controller.step(times[-1], sense(times[-1], rows[-1]))
            interval(session, last, asked, span)
            last = asked
        times.append((first + span) * pace.step)
        rows.append(observe(session))
        reason = explosion(rows[-1], session.stage)
    return times, rows, reason


def _assembled(
    label: tuple[str, str],
    times: Array,
    rows: list[Observation],
    reason: str,
    wall: float,
) -> Recording:
    def column(name: str) -> Array:
        return np.array([getattr(row, name) for row in rows])

    rotation, position, velocity = column("rotation"), column("position"), column("velocity")
    yaw = np.unwrap(np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0]))
    return Recording(
        engine=label[0],
        version=label[1],
        times=times,
        pose=np.column_stack([position[:, 0], position[:, 1], yaw]),
        height=position[:, 2],
        roll=np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2]),
        pitch=-np.arcsin(np.clip(rotation[:, 2, 0], -1.0, 1.0)),
        speed=np.einsum("ni,ni->n", velocity, rotation[:, :, 0]),
        wheel_angles=column("wheel_angles"),
        wheel_speeds=column("wheel_speeds"),
        wheel_torques=column("wheel_torques"),
        wheel_heights=column("wheel_places")[:, :, 2],
        angles=column("angles"),
        swivels=column("swivels"),
        loads=column("loads"),
        slip=column("slip"),
        sliding=column("sliding"),
        spin_angles=column("spin_angles"),
        suspension=column("suspension"),
        contacts=column("contacts").astype(np.int64),
        hits=_collected(times, rows),
        exploded=bool(reason),
        reason=reason,
        wall_time=wall,
        real_time_factor=float(times[-1]) / wall,
    )


def _collected(times: Array, rows: list[Observation]) -> tuple[Hit, ...]:
    """Each obstacle once, in the order of first contact."""
    found: dict[str, Hit] = {}
    for moment, row in zip(times, rows, strict=True):
        for name, place in row.hits:
            old = found.get(name, Hit(name, float(moment), place, 0))
            found[name] = replace(old, records=old.records + 1)
    return tuple(found.values())


def explosion(seen: Observation, stand: Stage) -> str:
    """Why this state is not physics any more, or no engine has ground for it; empty when it is."""
    numbers = (seen.position, seen.rotation, seen.velocity, seen.wheel_angles, seen.wheel_speeds)
    if not all(np.all(np.isfinite(values)) for values in numbers):
        return "the state is not finite"
    speed = float(np.linalg.norm(seen.velocity))
    if speed > MAX_SPEED:
        return f"the robot moves at {speed:.3g} m/s, more than {MAX_SPEED:g} m/s"
    above = float(seen.position[2] - stand.height(seen.position[:2]))
    if abs(above) > MAX_HEIGHT:
        return f"the robot is {above:.3g} m above the ground, more than {MAX_HEIGHT:g} m"
    if seen.penetration > MAX_PENETRATION:
        return f"a contact is {seen.penetration:.3g} m deep, more than {MAX_PENETRATION:g} m"
    fastest = float(np.max(np.abs(seen.wheel_speeds), initial=0.0))
    if fastest > MAX_WHEEL_SPEED:
        return f"a wheel turns at {fastest:.3g} rad/s, more than {MAX_WHEEL_SPEED:g} rad/s"
    lean = math.acos(min(float(seen.rotation[2, 2]), 1.0))
    if lean > MAX_LEAN:
        return f"the robot tipped over at ({seen.position[0]:.3g}, {seen.position[1]:.3g}) m"
    off = beyond(stand, seen.wheel_places[:, :2])
    return f"the robot left the height map: {off}" if off else ""
