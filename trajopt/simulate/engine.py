"""The contract that every physics engine fulfils, and the registry of engines.

Wheel arrays are over ``robot.wheel_names`` (W) unless said otherwise; arrays over every wheel of
the robot's file, castors and balls included, have A columns.
"""

from __future__ import annotations

import importlib
import importlib.util
import math
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from trajopt.arrays import Array, IntArray
from trajopt.errors import ArgumentError, MissingDependencyError
from trajopt.simulate.model import Model, Vector
from trajopt.simulate.scene import Stage

# A new engine is one file and one line here: name -> where its class is. "auto" takes the first
# that is installed, for a picture the last, which draws without a graphics driver.
ENGINES: Mapping[str, str] = MappingProxyType(
    {
        "mujoco": "trajopt.simulate.mujoco:MuJoCo",
        "pybullet": "trajopt.simulate.pybullet:PyBullet",
    }
)


@dataclass(frozen=True, eq=False)
class Command:
    """Wheel speeds over time, linear between samples, zero before and after.

    ``times`` (N,) s from 0, rising; ``wheel_speeds`` (N, W) rad/s; ``angles`` (N, S) rad of steered
    wheels, then of driven axles (None: 0), held after the end. The robot starts at ``start_pose``
    (x, y, yaw), with ``start_wheel_angles`` (W,) and castors at ``start_swivels`` (C,), rad; None:
    0.
    """

    times: Array
    wheel_speeds: Array
    angles: Array | None = None
    start_pose: Vector = (0.0, 0.0, 0.0)
    start_wheel_angles: Array | None = None
    start_swivels: Array | None = None

    def __post_init__(self) -> None:
        """Raise ArgumentError for wrong shapes, times that do not rise from 0, or values not
        finite."""
        times = np.asarray(self.times)
        if times.ndim != 1 or len(times) < 2 or times[0] != 0.0 or not np.all(np.diff(times) > 0.0):
            raise ArgumentError("times", times, "at least two rising times in s, the first 0")
        for name in ("wheel_speeds", "angles"):
            rows = getattr(self, name)
            if rows is not None and (np.ndim(rows) != 2 or len(rows) != len(times)):
                raise ArgumentError(name, np.shape(rows), f"shape ({len(times)}, drives)")
        for name, values in vars(self).items():
            if values is not None and not np.all(np.isfinite(values)):
                raise ArgumentError(name, values, "finite numbers")

    @property
    def duration(self) -> float:
        """Last time [s]."""
        return float(self.times[-1])

    def at(self, moments: Array, angles: int) -> tuple[Array, Array]:
        """Wheel speeds (M, W) and ``angles`` angles (M, S) at ``moments`` (M,), s."""
        rows = np.zeros((len(self.times), angles)) if self.angles is None else self.angles
        inside = (moments >= 0.0) & (moments <= self.times[-1])
        return _between(self, self.wheel_speeds, moments) * inside[:, None], _between(
            self, rows, moments
        )


def _between(command: Command, rows: Array, moments: Array) -> Array:
    return (
        np.array([np.interp(moments, command.times, column) for column in rows.T])
        .reshape(rows.shape[1], len(moments))
        .T
    )


@dataclass(frozen=True, eq=False)
class Start:
    """Where a session begins: origin of the robot frame (m), its axes as columns of ``rotation``
    (3, 3), and joint ``angles`` (rad) by link."""

    place: Array
    rotation: Array
    angles: Mapping[int, float]


@dataclass(frozen=True)
class Camera:
    """View for a picture at the end of a run: the camera looks at the robot (or ``target``, m).

    ``distance`` [m], ``yaw`` and ``pitch`` [rad] (yaw 0 looks along +y, negative pitch looks down),
    size in pixels.
    """

    width: int = 640
    height: int = 480
    distance: float = 1.8
    yaw: float = math.radians(35.0)
    pitch: float = math.radians(-25.0)
    target: Vector | None = None


@dataclass(frozen=True, eq=False)
class Contacts:
    """n contacts that carry force: the robot's ``link`` and the stage's ``solid`` (-1: plane or
    field) (n,), ``place`` (n, 3) m, ``normal`` (n, 3) towards the robot, ``force`` (n,) N along it,
    ``depth`` (n,) m."""

    link: IntArray
    solid: IntArray
    place: Array
    normal: Array
    force: Array
    depth: Array


@dataclass(frozen=True, eq=False)
class Motion:
    """Of k rigid bodies: ``place`` (k, 3) m of the frame, ``rotation`` (k, 3, 3), ``velocity``
    (k, 3) m/s of the frame's origin, ``spin`` (k, 3) rad/s."""

    place: Array
    rotation: Array
    velocity: Array
    spin: Array


@dataclass(frozen=True, eq=False)
class Observation:
    """The truth at one moment.

    ``position`` (3,) m and ``rotation`` (3, 3) of the robot frame, ``velocity`` (3,) m/s, ``spin``
    (3,) rad/s; ``wheel_angles`` counted on, ``wheel_speeds`` rad/s, ``wheel_torques`` N m (W,),
    ``wheel_places`` (W, 3) m of the centres; ``angles`` (S,) of steered wheels and driven axles,
    ``swivels`` (C,) rad; ``loads`` (A,) N on the wheels, ``slip`` (A,) m/s: speed of a wheel over
    the ground in the directions in which it holds, ``sliding`` (A, 2) m/s: that velocity ahead and to the left, in the
    robot's frame; ``spin_angles`` (A,) rad, counted on, 0 for balls; ``suspension`` (G,): how far springs (m) and axles
    that tilt (rad) have given, as ``model.suspension``; ``contacts`` with the ground, the deepest one's ``penetration`` (m), and ``hits``: names
    and places (x, y) of obstacles touched.
    """

    position: Array
    rotation: Array
    velocity: Array
    spin: Array
    wheel_angles: Array
    wheel_speeds: Array
    wheel_torques: Array
    wheel_places: Array
    angles: Array
    swivels: Array
    loads: Array
    slip: Array
    sliding: Array
    spin_angles: Array
    suspension: Array
    contacts: int
    penetration: float
    hits: tuple[tuple[str, tuple[float, float]], ...]

    @property
    def pose(self) -> Array:
        """(3,): x, y (m) and yaw (rad, in (-pi, pi])."""
        yaw = math.atan2(self.rotation[1, 0], self.rotation[0, 0])
        return np.array([self.position[0], self.position[1], yaw])


@dataclass(frozen=True)
class Hit:
    """The obstacle called ``name`` was touched at ``place`` (x, y, m), first at ``time`` (s), in
    ``records`` of the recording. Of a step the face counts, not the top."""

    name: str
    time: float
    place: tuple[float, float]
    records: int


@dataclass(frozen=True, eq=False)
class Recording:
    """What happened, from the start of the command (after settling).

    ``times`` (N,) s; ``pose`` (N, 3) x, y (m) and yaw (rad), counted on; ``height`` (m), ``roll``,
    ``pitch`` (rad) (N,) of the robot frame, its ``speed`` (N,) m/s along the heading;
    ``wheel_angles`` rad, counted on, ``wheel_speeds`` rad/s, ``wheel_torques`` N m and
    ``wheel_heights`` m of the wheel centres, all (N, W); ``angles`` (N, S), ``swivels`` (N, C) rad;
    ``loads`` N, ``slip`` m/s and ``spin_angles`` rad (N, A), ``sliding`` m/s (N, A, 2), ``suspension`` (N, G) m and rad,
    as ``Observation`` has them; ``contacts`` (N,); ``hits`` of obstacles. ``exploded`` with
    its ``reason`` when the run was stopped because the numbers left physics. ``wall_time`` s of
    stepping, ``real_time_factor`` simulated over wall time, ``picture`` (H, W, 3) uint8 when asked;
    where the engine found no graphics to draw it, ``no_picture`` says why.
    """

    engine: str
    version: str
    times: Array
    pose: Array
    height: Array
    roll: Array
    pitch: Array
    speed: Array
    wheel_angles: Array
    wheel_speeds: Array
    wheel_torques: Array
    wheel_heights: Array
    angles: Array
    swivels: Array
    loads: Array
    slip: Array
    sliding: Array
    spin_angles: Array
    suspension: Array
    contacts: IntArray
    hits: tuple[Hit, ...]
    exploded: bool
    reason: str
    wall_time: float
    real_time_factor: float
    picture: NDArray[np.uint8] | None = None
    no_picture: str = ""


class Session(Protocol):
    """One running simulation of a model on a stage."""

    @property
    def model(self) -> Model: ...

    @property
    def stage(self) -> Stage: ...

    def advance(self, wheel_speeds: Array, angles: Array) -> None:
        """One time step towards wheel speeds (W,) rad/s and angles (S,) rad of
        ``model.targets``."""
        ...

    def base(self) -> Motion:
        """Of the robot frame (k = 1)."""
        ...

    def motion(self, links: tuple[int, ...]) -> Motion:
        """Of links."""
        ...

    def joints(self, links: tuple[int, ...]) -> tuple[Array, Array, Array]:
        """Angles, counted on, speeds and motor torques (k,) of the joints of links."""
        ...

    def contacts(self) -> Contacts:
        """Contacts of the last step."""
        ...

    def move(self, name: str, place: tuple[float, float] | None) -> None:
        """Put the middle of an obstacle at ``place`` (x, y, m); None: out of the world."""
        ...

    def render(self, camera: Camera) -> NDArray[np.uint8]:
        """Picture (H, W, 3)."""
        ...


class Engine(Protocol):
    """A physics engine: a frozen dataclass of options, each with unit, default and source."""

    @property
    def name(self) -> str:
        """Name in the registry."""
        ...

    @property
    def step(self) -> float:
        """Time step, s."""
        ...

    @property
    def stride(self) -> int:
        """Steps between two records and between two calls of a controller."""
        ...

    def open(
        self, model: Model, stage: Stage, start: Start, picture: Camera | None
    ) -> AbstractContextManager[Session]:
        """A session at ``start``. Raises MissingDependencyError without the engine's package,
        SimulationError or ArgumentError for what it cannot build."""
        ...


def make_engine(engine: str | Engine, *, picture: bool = False) -> Engine:
    """The engine called ``engine`` with its default options; "auto": one whose package is
    installed, for a ``picture`` one that draws everywhere. Raises ArgumentError for an unknown
    name."""
    if not isinstance(engine, str):
        return engine
    if engine == "auto":
        installed = [name for name in ENGINES if importlib.util.find_spec(name) is not None]
        if not installed:
            raise MissingDependencyError("mujoco", "simulate", "a check in physics")
        engine = installed[-1 if picture else 0]
    if engine not in ENGINES:
        raise ArgumentError("engine", engine, "one of " + ", ".join(["auto", *ENGINES]))
    module, _, name = ENGINES[engine].partition(":")
    made: Any = getattr(importlib.import_module(module), name)()
    return made  # type: ignore[no-any-return]
