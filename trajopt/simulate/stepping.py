"""The loop that drives any engine's session through a command and records it."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.simulate.engine import (
    Camera,
    Command,
    Controller,
    Observation,
    Recording,
    Session,
    SimRobot,
)

# A run has left physics beyond these (chosen: an order above anything a robot that drives at 5 km/h
# and climbs 5 cm shows).
MAX_SPEED = 10.0  # m/s of the robot frame
MAX_HEIGHT = 1.0  # m of the robot frame above the ground
MAX_PENETRATION = 0.02  # m of a roller into the terrain
MAX_WHEEL_SPEED = 300.0  # rad/s


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


def drive(
    session: Session,
    robot: SimRobot,
    command: Command,
    pace: Pace,
    *,
    label: tuple[str, str],
    settle: float,
    picture: Camera | None,
    controller: Controller | None,
) -> Recording:
    """Hold still for ``settle`` seconds, then execute the command and record every ``pace.stride``
    steps.

    Targets are taken in the middle of each step, so that the commanded angle is the integral of the
    command. ``controller`` (time, observation) -> wheel speeds (4,) replaces the command's speeds
    at every record. ``label`` is the engine's name and version. Raises ArgumentError for a bad
    ``settle``.
    """
    if not (math.isfinite(settle) and settle >= 0.0):
        raise ArgumentError("settle", settle, "a time of at least 0 s")
    begun = time.perf_counter()
    still = np.zeros(4)
    for _ in range(round(settle / pace.step)):
        session.advance(still)
    times, rows = [0.0], [session.observe()]
    reason = explosion(rows[0])
    steps = math.ceil(command.duration / pace.step - 1e-9)
    targets = still
    for index in range(steps):
        if reason:
            break
        moment = index * pace.step
        if controller is None:
            targets = command.at(moment + 0.5 * pace.step)
        elif index % pace.stride == 0:
            targets = controller(moment, rows[-1])
        session.advance(targets)
        if (index + 1) % pace.stride == 0 or index + 1 == steps:
            times.append((index + 1) * pace.step)
            rows.append(session.observe())
            reason = explosion(rows[-1])
    wall = time.perf_counter() - begun
    image = session.render(picture) if picture is not None else None
    return _assembled(robot, label, np.array(times), rows, reason, (wall, settle), image)


def _assembled(
    robot: SimRobot,
    label: tuple[str, str],
    times: Array,
    rows: list[Observation],
    reason: str,
    clock: tuple[float, float],
    image: NDArray[np.uint8] | None,
) -> Recording:
    """Recording from observations; ``clock`` is the wall time and the settling time [s]."""
    rotation = np.array([row.rotation for row in rows])
    position = np.array([row.position for row in rows])
    yaw = np.unwrap(np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0]))
    centres = position[:, None, :] + np.einsum("nij,kj->nki", rotation, robot.wheel_centres())
    return Recording(
        engine=label[0],
        version=label[1],
        times=times,
        pose=np.column_stack([position[:, 0], position[:, 1], yaw]),
        height=position[:, 2],
        roll=np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2]),
        pitch=-np.arcsin(np.clip(rotation[:, 2, 0], -1.0, 1.0)),
        wheel_angles=np.array([row.wheel_angles for row in rows]),
        wheel_speeds=np.array([row.wheel_speeds for row in rows]),
        wheel_torques=np.array([row.wheel_torques for row in rows]),
        wheel_heights=centres[:, :, 2],
        contacts=np.array([row.contacts for row in rows], dtype=np.int64),
        exploded=bool(reason),
        reason=reason,
        wall_time=clock[0],
        real_time_factor=(clock[1] + float(times[-1])) / clock[0],
        picture=image,
    )


def explosion(seen: Observation) -> str:
    """Why this state is not physics any more; empty when it is."""
    numbers = (seen.position, seen.rotation, seen.velocity, seen.wheel_angles, seen.wheel_speeds)
    if not all(np.all(np.isfinite(values)) for values in numbers):
        return "the state is not finite"
    speed = float(np.linalg.norm(seen.velocity))
    if speed > MAX_SPEED:
        return f"the robot moves at {speed:.3g} m/s, more than {MAX_SPEED:g} m/s"
    if abs(float(seen.position[2])) > MAX_HEIGHT:
        return f"the robot is {float(seen.position[2]):.3g} m above the ground, more than {MAX_HEIGHT:g} m"
    if seen.penetration > MAX_PENETRATION:
        return f"a contact is {seen.penetration:.3g} m deep, more than {MAX_PENETRATION:g} m"
    fastest = float(np.max(np.abs(seen.wheel_speeds)))
    if fastest > MAX_WHEEL_SPEED:
        return f"a wheel turns at {fastest:.3g} rad/s, more than {MAX_WHEEL_SPEED:g} rad/s"
    return ""
