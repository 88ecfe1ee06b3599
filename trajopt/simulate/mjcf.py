"""A SimRobot in its Scene as MJCF text (MuJoCo's model format); meshes are written inline."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from trajopt.simulate.engine import GRAVITY, Camera, SimRobot
from trajopt.simulate.rollers import (
    Ellipsoid,
    Revolved,
    Roller,
    RollerWheel,
    SphereChain,
    disc_inertia,
    hub_drum,
    is_cylinder,
    revolve,
    roller_size,
)
from trajopt.simulate.scene import Block, Scene, blocks

# Collision bits: parts of the robot meet the terrain and never each other.
ROBOT_BITS = 'contype="1" conaffinity="2"'
TERRAIN_BITS = 'contype="2" conaffinity="1"'
UNSEEN_BITS = 'contype="0" conaffinity="0" mass="0"'
ROLLER_COLOURS = (
    "0.15 0.15 0.15 1",
    "0.85 0.45 0.1 1",
)  # every other roller: turning shows in pictures


@dataclass(frozen=True)
class Solver:
    """What of the engine's options goes into the model text."""

    step: float  # s
    contact_time: float  # s, time constant of a contact (solref)
    contact_damping: float  # damping ratio of a contact (solref)
    wheel_gain: float  # N m s/rad, velocity servo of a wheel
    iterations: int


def scene_mjcf(robot: SimRobot, scene: Scene, solver: Solver, camera: Camera | None) -> str:
    """MJCF of robot and terrain: a free base, wheel joints ``wheel_0`` to ``wheel_3``, actuators
    likewise."""
    names = _mesh_names(robot)
    meshes = "".join(_mesh(profile, name) for profile, name in names.items())
    size = (camera.width, camera.height) if camera is not None else (64, 64)
    ground = f'<geom name="ground" type="plane" size="0 0 1" material="floor" {TERRAIN_BITS}/>'
    solids = "".join(_block(block) for block in blocks(scene.terrain))
    return (
        f'<mujoco><compiler angle="radian" autolimits="true" balanceinertia="false"/>'
        f'<option timestep="{solver.step!r}" gravity="0 0 {-GRAVITY!r}" cone="elliptic" solver="Newton" '
        f'integrator="implicitfast" iterations="{solver.iterations}"><flag autoreset="disable"/></option>'
        f'<visual><global offwidth="{size[0]}" offheight="{size[1]}"/></visual>'
        f'<default><geom condim="3" friction="{scene.friction!r} 0 0" '
        f'solref="{solver.contact_time!r} {solver.contact_damping!r}"/></default>'
        f'<asset><texture name="checks" type="2d" builtin="checker" rgb1="0.95 0.95 0.95" '
        f'rgb2="0.62 0.7 0.92" width="256" height="256"/>'
        f'<material name="floor" texture="checks" texrepeat="1 1" texuniform="true"/>{meshes}</asset>'
        f'<worldbody><light pos="0 0 4" dir="0.2 0.3 -1" directional="true"/>{ground}{solids}'
        f"{_robot(robot, names)}</worldbody>"
        f"<actuator>{_motors(robot, solver)}</actuator></mujoco>"
    )


def _block(block: Block) -> str:
    x, y, z, w = block.quaternion()
    half = _numbers(extent / 2.0 for extent in block.size)
    place = f'pos="{_numbers(block.centre)}" quat="{_numbers((w, x, y, z))}"'
    return f'<geom type="box" size="{half}" {place} rgba="0.75 0.62 0.42 1" {TERRAIN_BITS}/>'


def _robot(robot: SimRobot, names: dict[Revolved, str]) -> str:
    middle = robot.chassis_clearance + robot.chassis_size[2] / 2.0
    half = _numbers(extent / 2.0 for extent in robot.chassis_size)
    wheels = "".join(_wheel(robot, index, names) for index in range(4))
    return (
        f'<body name="robot"><freejoint name="base"/><inertial pos="0 0 {robot.cog_height!r}" '
        f'mass="{robot.chassis_mass!r}" diaginertia="{_numbers(robot.inertia)}"/>'
        f'<geom type="box" size="{half}" pos="0 0 {middle!r}" rgba="0.25 0.35 0.55 1" {ROBOT_BITS}/>'
        f"{wheels}</body>"
    )


def _wheel(robot: SimRobot, index: int, names: dict[Revolved, str]) -> str:
    wheel = robot.wheels[index]
    x, y = robot.wheel_positions[index]
    about, across = disc_inertia(wheel.hub_mass, 0.8 * wheel.radius, wheel.width)
    drum = hub_drum(wheel)
    disc = f'type="cylinder" size="{drum.radii[0]!r} {drum.stations[1]!r}" euler="1.5707963 0 0"'
    rollers = "".join(
        _roller(number, wheel, roller, names) for number, roller in enumerate(wheel.rollers)
    )
    return (
        f'<body name="hub_{index}" pos="{_numbers((x, y, wheel.radius))}">'
        f'<joint name="wheel_{index}" type="hinge" axis="0 1 0"/>'
        f'<inertial pos="0 0 0" mass="{wheel.hub_mass!r}" diaginertia="{_numbers((across, about, across))}"/>'
        f'<geom {disc} rgba="0.7 0.7 0.72 1" {UNSEEN_BITS}/>{rollers}</body>'
    )


def _roller(number: int, wheel: RollerWheel, roller: Roller, names: dict[Revolved, str]) -> str:
    about, across = disc_inertia(wheel.roller_mass, *roller_size(roller))
    colour = f'rgba="{ROLLER_COLOURS[number % 2]}"'
    shapes = "".join(f"<geom {shape} {colour} {ROBOT_BITS}/>" for shape in _shapes(roller, names))
    return (
        f'<body pos="{_numbers(roller.centre)}" zaxis="{_numbers(roller.axis)}">'
        f'<joint type="hinge" axis="0 0 1"/>'
        f'<inertial pos="0 0 0" mass="{wheel.roller_mass!r}" '
        f'diaginertia="{_numbers((across, across, about))}"/>'
        f"{shapes}</body>"
    )


def _shapes(roller: Roller, names: dict[Revolved, str]) -> list[str]:
    profile = roller.profile
    if isinstance(profile, SphereChain):
        pairs = zip(profile.stations, profile.radii, strict=True)
        return [
            f'type="sphere" size="{radius!r}" pos="0 0 {station!r}"' for station, radius in pairs
        ]
    if isinstance(profile, Ellipsoid):
        return [
            f'type="ellipsoid" size="{_numbers((profile.radius, profile.radius, profile.half_length))}"'
        ]
    if is_cylinder(profile):
        low, high = profile.stations
        size = _numbers((profile.radii[0], (high - low) / 2.0))
        return [f'type="cylinder" size="{size}" pos="0 0 {(low + high) / 2.0!r}"']
    return [f'type="mesh" mesh="{names[profile]}"']


def _mesh_names(robot: SimRobot) -> dict[Revolved, str]:
    """A mesh name for every different profile that needs one."""
    profiles = [roller.profile for wheel in robot.wheels for roller in wheel.rollers]
    needed = [p for p in profiles if isinstance(p, Revolved) and not is_cylinder(p)]
    return {profile: f"roller_{index}" for index, profile in enumerate(dict.fromkeys(needed))}


def _mesh(profile: Revolved, name: str) -> str:
    """Convex mesh. MuJoCo moves it to its own principal frame and back."""
    return f'<mesh name="{name}" vertex="{_numbers(revolve(profile).ravel().tolist())}"/>'


def _motors(robot: SimRobot, solver: Solver) -> str:
    limit = robot.torque_limit
    return "".join(
        f'<velocity name="wheel_{index}" joint="wheel_{index}" kv="{solver.wheel_gain!r}" '
        f'forcerange="{-limit!r} {limit!r}"/>'
        for index in range(4)
    )


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
