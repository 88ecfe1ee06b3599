"""The robot on split offset casters in MuJoCo, on a height field."""

from __future__ import annotations

import importlib.metadata
from dataclasses import dataclass
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import SimulationError
from trajopt.robots.robot import STANDARD_GRAVITY
from trajopt.simulate.mujoco import load_mujoco
from trajopt.systems.asoc.modules import AsocGeometry
from trajopt.systems.asoc.reference import Reference
from trajopt.systems.asoc.run import (
    ALPHA_DAMPING,
    PIVOT_GAIN,
    STEP,
    WHEEL_GAIN,
    AsocBody,
    AsocRun,
    AsocState,
    run_asoc,
)
from trajopt.systems.asoc.tracking import Knowledge
from trajopt.world.height_map import HeightMap

CONTACT = "0.004 1"  # s and damping ratio: the shortest contact time that 2 ms steps allow
BASE = 0.5  # m of solid below the lowest point, chosen


def asoc_in_mujoco(
    geometry: AsocGeometry,
    ground: HeightMap,
    reference: Reference,
    *,
    friction: float = 0.6,
    driven_pivots: bool = False,
    knowledge: Knowledge | None = None,
) -> AsocRun:
    """Drive the robot along ``reference`` on ``ground``, everything known unless ``knowledge`` says
    otherwise. Raises ArgumentError, SimulationError (the model cannot be built, explosion,
    tip-over) and MissingDependencyError without mujoco."""
    mujoco = load_mujoco()
    robot = AsocBody(geometry, friction, driven_pivots)
    try:
        model = mujoco.MjModel.from_xml_string(asoc_mjcf(robot, ground))
    except ValueError as error:
        raise SimulationError(f"mujoco could not build the robot: {error}") from error
    low, high = float(ground.heights.min()), float(ground.heights.max())
    model.hfield_data[:] = (
        ((ground.heights - low) / max(high - low, 1e-3)).astype(np.float32).ravel()
    )
    data = mujoco.MjData(model)
    place, velocity = reference.at(0.0)
    lift = _start_height(robot, ground, place)
    data.qpos[:3] = (*place, robot.body_height + lift)
    for i in range(geometry.modules):
        data.joint(f"alpha{i}").qpos[0] = np.arctan2(velocity[1], velocity[0])
    mujoco.mj_forward(model, data)
    session = _Session(
        mujoco,
        model,
        data,
        robot,
        tuple(model.geom(f"wheel{i}{w}").id for i in range(geometry.modules) for w in (1, 2)),
        model.geom("ground").id,
    )
    return run_asoc(
        session,
        robot,
        ground,
        reference,
        label=("mujoco", importlib.metadata.version("mujoco")),
        knowledge=knowledge,
    )


def _start_height(robot: AsocBody, ground: HeightMap, place: Array) -> float:
    """Highest ground under the robot: it falls onto its springs from there."""
    reach = np.linspace(-1.0, 1.0, 41) * (
        robot.geometry.module_radius
        + robot.geometry.offset
        + robot.geometry.wheel_radius
        + robot.geometry.split
    )
    return float(ground.height(place[0] + reach[:, None], place[1] + reach[None, :]).max())


def asoc_mjcf(robot: AsocBody, ground: HeightMap) -> str:
    """The model as MJCF text; the height field's data are set after loading."""
    rows, columns = ground.heights.shape
    (width, depth), low = ground.size, float(ground.heights.min())
    span = max(float(ground.heights.max()) - low, 1e-3)
    middle = (ground.origin[0] + width / 2, ground.origin[1] + depth / 2, low)
    modules = "".join(_module(robot, i) for i in range(robot.geometry.modules))
    motors = "".join(
        f'<velocity name="drive{i}{w}" joint="spin{i}{w}" kv="{WHEEL_GAIN}" forcerange="{-robot.torque} {robot.torque}"/>'
        for i in range(robot.geometry.modules)
        for w in (1, 2)
    )
    gain = PIVOT_GAIN if robot.driven_pivots else 0.0
    pivots = "".join(
        f'<position name="tilt{i}" joint="beta{i}" kp="{gain}"/>'
        for i in range(robot.geometry.modules)
    )
    x, y, z = (size / 2 for size in robot.body_size)
    return f"""<mujoco><compiler angle="radian"/>
<option timestep="{STEP}" integrator="implicitfast" cone="elliptic" solver="Newton"
 gravity="0 0 {-STANDARD_GRAVITY}"/>
<asset><hfield name="h" nrow="{rows}" ncol="{columns}" size="{width / 2} {depth / 2} {span} {BASE}"/></asset>
<default><geom contype="0" conaffinity="0" friction="{robot.friction} 0 0" condim="3" solref="{CONTACT}"/></default>
<worldbody><geom name="ground" type="hfield" hfield="h" pos="{middle[0]} {middle[1]} {middle[2]}" contype="1"
 conaffinity="2"/>
<body name="body" pos="0 0 {robot.body_height}"><freejoint/>
<geom type="box" size="{x} {y} {z}" mass="{robot.body_mass}" contype="2" conaffinity="1"/>
{modules}</body></worldbody><actuator>{motors}{pivots}</actuator></mujoco>"""


def _module(robot: AsocBody, i: int) -> str:
    """One module: spring, module axis, axle pivot, two wheels (thin ellipsoids touch at one
    point)."""
    g = robot.geometry
    px, py = g.positions[i]
    drop = g.wheel_radius - robot.body_height  # of the axle below the plate's middle
    wheels = "".join(
        f'<body pos="0 {side * g.split / 2} 0"><joint name="spin{i}{w}" axis="0 1 0" damping="0.001"/>'
        f'<inertial pos="0 0 0" mass="{robot.wheel_mass}" diaginertia="'
        f'{_wheel_inertia(robot, 1):.6g} {_wheel_inertia(robot, 0):.6g} {_wheel_inertia(robot, 1):.6g}"/>'
        f'<geom name="wheel{i}{w}" type="ellipsoid" size="{g.wheel_radius} {g.wheel_width / 2} {g.wheel_radius}"'
        ' contype="2" conaffinity="1"/></body>'
        for w, side in ((1, -1), (2, 1))
    )
    half = robot.link_mass
    return f"""<body pos="{px} {py} {drop + robot.sag}">
<joint name="lift{i}" type="slide" axis="0 0 1" stiffness="{robot.stiffness}" damping="{robot.damping}"
 springref="{-robot.sag}" limited="true" range="{-robot.pivot.travel} {robot.pivot.travel}"/>
<joint name="alpha{i}" axis="0 0 1" damping="{ALPHA_DAMPING}"/>
<geom type="sphere" size="0.05" mass="{half}"/>
<body pos="{-g.offset} 0 0"><joint name="beta{i}" axis="1 0 0" limited="true" damping="0.1"
 range="{-robot.pivot.tilt_range} {robot.pivot.tilt_range}"/>
<geom type="capsule" fromto="0 {-g.split / 2} 0 0 {g.split / 2} 0" size="0.02" mass="{half}"/>{wheels}</body></body>
"""


def _wheel_inertia(robot: AsocBody, across: int) -> float:
    """kg m^2 of a solid cylinder about its axle (0) or across it (1)."""
    g = robot.geometry
    square = g.wheel_radius**2
    return robot.wheel_mass * (square / 4 + g.wheel_width**2 / 12 if across else square / 2)


@dataclass(frozen=True, eq=False)
class _Session:
    """Model and state in MuJoCo."""

    mujoco: Any
    model: Any
    data: Any
    robot: AsocBody
    wheels: tuple[int, ...]
    ground: int

    def advance(self, wheel_speeds: Array, pivots: Array) -> None:
        self.data.ctrl[:] = np.concatenate([wheel_speeds.ravel(), pivots])
        self.mujoco.mj_step(self.model, self.data)

    def state(self) -> AsocState:
        body = self.data.body("body")
        alpha = np.array(
            [
                float(self.data.joint(f"alpha{i}").qpos[0])
                for i in range(self.robot.geometry.modules)
            ]
        )
        spins = np.array(
            [
                float(self.data.joint(f"spin{i}{w}").qvel[0])
                for i in range(self.robot.geometry.modules)
                for w in (1, 2)
            ]
        ).reshape(-1, 2)
        pairs = self.data.contact.geom
        near = pairs[self.data.contact.dist <= 0.0]
        touched = np.unique(near[np.any(near == self.ground, axis=1)]) if len(near) else np.zeros(0)
        touch = np.isin(self.wheels, touched).reshape(-1, 2)
        return AsocState(body.xpos.copy(), body.xmat.reshape(3, 3).copy(), alpha, spins, touch)
