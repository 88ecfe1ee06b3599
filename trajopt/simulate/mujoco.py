"""MuJoCo, built through MjSpec: the same model, stage and session as any other engine."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.arrays import Array, IndexArray, fold
from trajopt.errors import ArgumentError, MissingDependencyError, SimulationError
from trajopt.robots.robot import STANDARD_GRAVITY
from trajopt.simulate.engine import Camera, Contacts, Motion, Start
from trajopt.simulate.model import Colour, Link, Model, Shape, cross
from trajopt.simulate.scene import PLATE, Stage
from trajopt.simulate.stepping import Pace
from trajopt.world.height_map import HeightMap

# Collision bits (contype, conaffinity): the robot's parts meet the ground or what stands on it, and
# never each other.
WHEELS, GROUND, OUTLINE, OBSTACLES, NOTHING = (1, 2), (2, 1), (4, 8), (8, 4), (0, 0)
ROTOR = 1e5  # kg m^2, chosen: no torque of a wheel changes its speed
STEERING_RATE = 100.0  # rad/s, natural frequency of a steering servo with its gear; chosen
GROUND_COLOUR: Colour = (0.75, 0.62, 0.42)
AWAY = (0.0, 0.0, -100.0)  # m, where an obstacle is that is out of the world


@dataclass(frozen=True)
class MuJoCo:
    """Options of the MuJoCo engine (values measured on the LOC8 over 5 m unless said otherwise)."""

    step: float = 0.002  # s; at 10 ms the robot drifts by 5-13 %
    stride: int = 5  # steps between two records; 10 ms, the thesis's step
    contact_time: float = 0.004  # s; solref time constant, the shortest that 2 ms steps allow
    contact_damping: float = 1.0  # solref damping ratio, critical
    motor_impedance: float = 0.999  # solimp of a motor: its lag is what is missing to 1
    iterations: int = 100  # at most, of the Newton solver; MuJoCo's default

    def __post_init__(self) -> None:
        """Raise ArgumentError for options that MuJoCo cannot use."""
        Pace(self.step, self.stride)
        if not self.contact_time >= 2.0 * self.step:
            raise ArgumentError(
                "contact_time", self.contact_time, f"at least two steps = {2 * self.step:g} s"
            )
        for name in ("contact_damping", "iterations"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ArgumentError(name, getattr(self, name), "a positive number")
        if not 0.0 < self.motor_impedance < 1.0:
            raise ArgumentError("motor_impedance", self.motor_impedance, "a share in (0, 1)")

    @property
    def name(self) -> str:
        """Name in the registry."""
        return "mujoco"

    @contextmanager
    def open(
        self, model: Model, stage: Stage, start: Start, picture: Camera | None
    ) -> Iterator[_Session]:
        """See ``engine.Engine``; SimulationError where MuJoCo cannot compile the model."""
        mujoco = load_mujoco()
        built = _Builder(mujoco, self, model, stage)
        if picture is not None:
            built.spec.visual.global_.offwidth = picture.width
            built.spec.visual.global_.offheight = picture.height
        try:
            compiled = built.spec.compile()
        except ValueError as error:
            raise SimulationError(
                f"mujoco could not build the robot {model.name!r}: {error}"
            ) from error
        session = _Session(mujoco, compiled, model, stage)
        session.place(start)
        yield session


def load_mujoco() -> Any:
    """The mujoco module. Raises MissingDependencyError without it."""
    try:
        import mujoco
    except ImportError as error:
        raise MissingDependencyError("mujoco", "simulate", "the physics engine 'mujoco'") from error
    return mujoco


class _Builder:
    """Fills a specification: bodies ``link_<i>`` with joints of the same name, geoms ``solid_<i>``,
    and an actuator for each driven joint (spins, then targets)."""

    def __init__(self, mujoco: Any, options: MuJoCo, model: Model, stage: Stage) -> None:
        self.mujoco, self.options, self.friction = mujoco, options, stage.scene.friction
        self.spec = spec = mujoco.MjSpec()
        self.meshes: dict[Shape, str] = {}
        spec.compiler.balanceinertia, spec.compiler.degree = False, False
        spec.option.timestep, spec.option.iterations = options.step, options.iterations
        spec.option.gravity = [0.0, 0.0, -STANDARD_GRAVITY]
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET
        self._add_stage(stage)
        bodies: list[Any] = []
        for i, link in enumerate(model.links):
            parent = spec.worldbody if link.parent < 0 else bodies[link.parent]
            bodies.append(self._body(parent, f"link_{i}", link))
        for spin, driven in zip(model.spins, model.driven, strict=True):
            if driven:
                self._motor(f"link_{spin}", model.links[spin].joint.effort)
        for i in model.targets:
            self._servo(f"link_{i}", model.links[i])

    def _add_stage(self, stage: Stage) -> None:
        world, light = self.spec.worldbody, [0.2, 0.3, -1.0]
        world.add_light(pos=[0.0, 0.0, 4.0], dir=light, type=1)
        texture = self.spec.add_texture(name="checks", type=0, builtin=2, width=256, height=256)
        texture.rgb1, texture.rgb2 = [0.95, 0.95, 0.95], [0.62, 0.7, 0.92]
        floor = self.spec.add_material(name="floor", texrepeat=[1, 1], texuniform=True)
        floor.textures[self.mujoco.mjtTextureRole.mjTEXROLE_RGB] = "checks"
        kinds = self.mujoco.mjtGeom
        if stage.plane:
            ground = self._geom(world, "ground", kinds.mjGEOM_PLANE, [0, 0, 1], GROUND)
            ground.material = "floor"
        if stage.field is not None:
            self._field(stage.field)
        for i, solid in enumerate(stage.solids):
            bits, body = GROUND, world
            if solid.meets == "obstacles":
                # a static geom that is moved leaves its collision bounds behind; a mocap body not
                bits, body = OBSTACLES, world.add_body(name=f"solid_{i}", mocap=True)
            self._shape(body, f"solid_{i}", solid.shape, bits, GROUND_COLOUR)

    def _field(self, field: HeightMap) -> None:
        """The height field; MuJoCo cuts its cells along the same diagonal as the map does."""
        rows, columns = field.heights.shape
        low, high = float(field.heights.min()), float(field.heights.max())
        span, (width, depth) = max(high - low, 1e-3), field.size
        self.spec.add_hfield(
            name="field", nrow=rows, ncol=columns, size=[width / 2.0, depth / 2.0, span, PLATE],
            userdata=((field.heights - low) / span).ravel().tolist(),
        )  # fmt: skip
        geom = self._geom(
            self.spec.worldbody, "ground", self.mujoco.mjtGeom.mjGEOM_HFIELD, None, GROUND
        )
        geom.hfieldname = "field"
        geom.pos = [field.origin[0] + width / 2.0, field.origin[1] + depth / 2.0, low]
        geom.rgba = [*GROUND_COLOUR, 1.0]

    def _body(self, parent: Any, name: str, link: Link) -> Any:
        joint, kinds = link.joint, self.mujoco.mjtJoint
        body = parent.add_body(name=name, pos=joint.pose.place, quat=joint.pose.quaternion)
        body.explicitinertial, body.mass = True, link.mass
        body.ipos, body.inertia = link.cog, link.inertia
        if link.parent < 0:
            body.add_freejoint(name=name)
        elif joint.role != "fixed":
            made = body.add_joint(
                name=name, axis=joint.axis,
                type=kinds.mjJNT_SLIDE if joint.role == "spring" else kinds.mjJNT_HINGE,
            )  # fmt: skip
            _set_linear(made, "damping", joint.damping)
            if joint.reach is not None:
                made.limited, made.range = 1, joint.reach
                made.solref_limit = [self.options.contact_time, 1.0]
            if joint.role == "spring":
                _set_linear(made, "stiffness", joint.stiffness)
                made.springref = joint.rest
            if joint.drive == "position":
                made.armature = joint.stiffness / STEERING_RATE**2
        bits = WHEELS if link.meets == "ground" else OUTLINE
        same = link.shapes == link.looks
        for i, shape in enumerate(link.shapes):
            colour = link.colour if same else None
            geom = self._shape(body, f"{name}_{i}", shape, bits, colour)
            geom.friction = [link.grip * self.friction, 0.0, 0.0]
            # friction is the larger of two, unless one has priority
            geom.priority = int(link.grip < 1.0)
        for i, shape in enumerate(() if same else link.looks):
            self._shape(body, f"{name}_look_{i}", shape, NOTHING, link.colour)
        return body

    def _motor(self, name: str, effort: float) -> None:
        """Holds a wheel at the speed of a heavy rotor, which the session sets, with at most
        ``effort``: as friction of a tendon between them, which is solved with the contacts. A servo
        on the speed is either soft or, where a wheel loses its grip, chatters. The rotor hangs on
        the world, so that the reaction is the chassis'."""
        rotor = self.spec.worldbody.add_body(name=f"rotor_{name}")
        rotor.explicitinertial, rotor.mass, rotor.inertia = True, 1.0, [1.0, 1.0, 1.0]
        joint = rotor.add_joint(name=f"rotor_{name}", axis=[0.0, 0.0, 1.0])
        joint.armature = ROTOR
        tendon = self.spec.add_tendon(name=f"motor_{name}", frictionloss=effort)
        tendon.wrap_joint(name, 1.0)
        tendon.wrap_joint(f"rotor_{name}", -1.0)
        tendon.solref_friction = [self.options.contact_time, 1.0]
        share = self.options.motor_impedance
        tendon.solimp_friction = [share, share, 0.001, 0.5, 2.0]

    def _servo(self, name: str, link: Link) -> None:
        joint, kinds = link.joint, self.mujoco
        made = self.spec.add_actuator(name=name, target=name)
        made.trntype = kinds.mjtTrn.mjTRN_JOINT
        made.biastype = kinds.mjtBias.mjBIAS_AFFINE
        made.forcelimited, made.forcerange = 1, [-joint.effort, joint.effort]
        made.gainprm[0], made.biasprm[1] = joint.stiffness, -joint.stiffness
        if joint.drive == "position":
            made.biasprm[2] = -2.0 * joint.stiffness / STEERING_RATE

    def _shape(
        self, body: Any, name: str, shape: Shape, bits: tuple[int, int], colour: Colour | None
    ) -> Any:
        kinds = self.mujoco.mjtGeom
        kind = {
            "sphere": kinds.mjGEOM_SPHERE, "cylinder": kinds.mjGEOM_CYLINDER,
            # the two edges of a cylinder jump on height fields: an ellipsoid touches at one point
            "disc": kinds.mjGEOM_ELLIPSOID,
            "box": kinds.mjGEOM_BOX, "ellipsoid": kinds.mjGEOM_ELLIPSOID,
            "hull": kinds.mjGEOM_MESH,
        }[shape.kind]  # fmt: skip
        size = {"cylinder": [shape.size[0], shape.size[2], 0.0], "hull": None}
        geom = self._geom(body, name, kind, size.get(shape.kind, list(shape.size)), bits)
        geom.pos, geom.quat = shape.pose.place, shape.pose.quaternion
        geom.rgba = [*(colour or (0.0, 0.0, 0.0)), 0.0 if colour is None else 1.0]
        if shape.kind == "hull":
            if shape not in self.meshes:
                self.meshes[shape] = f"mesh_{len(self.meshes)}"
                self.spec.add_mesh(
                    name=self.meshes[shape], uservert=np.ravel(shape.corners).tolist()
                )
            geom.meshname = self.meshes[shape]
        return geom

    def _geom(
        self, body: Any, name: str, kind: Any, size: list[float] | None, bits: tuple[int, int]
    ) -> Any:
        geom = body.add_geom(name=name, type=kind, contype=bits[0], conaffinity=bits[1])
        if size is not None:
            geom.size = size
        geom.condim, geom.mass = 3, 0.0
        geom.friction = [self.friction, 0.0, 0.0]
        geom.solref = [self.options.contact_time, self.options.contact_damping]
        return geom


def _set_linear(joint: Any, name: str, value: float) -> None:
    """Newer versions take a polynomial's coefficients, the linear one first."""
    setattr(joint, name, [value, 0.0, 0.0] if np.ndim(getattr(joint, name)) else value)


class _Session:
    """Model and state; fulfils ``engine.Session``."""

    def __init__(self, mujoco: Any, compiled: Any, model: Model, stage: Stage) -> None:
        self.mujoco, self.compiled, self.model, self.stage = mujoco, compiled, model, stage
        self.data = mujoco.MjData(compiled)
        body = [compiled.body(f"link_{i}").id for i in range(len(model.links))]
        joint = {
            i: compiled.joint(f"link_{i}").id
            for i, link in enumerate(model.links)
            if link.parent >= 0 and link.joint.role != "fixed"
        }
        self.body: IndexArray = np.array(body, dtype=np.intp)
        self.angle = {i: int(compiled.jnt_qposadr[j]) for i, j in joint.items()}
        self.rate = {i: int(compiled.jnt_dofadr[j]) for i, j in joint.items()}
        self.offset = dict.fromkeys(joint, 0.0)
        self.driven = np.array(model.driven, dtype=bool)
        self.motors = [s for s, driven in zip(model.spins, model.driven, strict=True) if driven]
        self.rotors = [int(compiled.joint(f"rotor_link_{s}").dofadr[0]) for s in self.motors]
        # of every geom: the robot's link, the stage's solid; -1 for none
        owner = {b: i for i, b in enumerate(body)}
        self.link_of = np.array([owner.get(int(b), -1) for b in compiled.geom_bodyid])
        self.solid_of = np.full(compiled.ngeom, -1)
        for i in range(len(stage.solids)):
            self.solid_of[compiled.geom(f"solid_{i}").id] = i

    def place(self, start: Start) -> None:
        """Put the robot where it begins. Small angles keep their digits: whole turns are added
        when reading."""
        half = start.yaw / 2.0
        self.data.qpos[:7] = (*start.place, math.cos(half), 0.0, 0.0, math.sin(half))
        for link, angle in start.angles.items():
            self.data.qpos[self.angle[link]] = fold(angle)
            self.offset[link] = angle - fold(angle)
        self.mujoco.mj_forward(self.compiled, self.data)

    def advance(self, wheel_speeds: Array, angles: Array) -> None:
        """See ``engine.Session``."""
        self.data.qvel[self.rotors] = wheel_speeds[self.driven]
        self.data.ctrl[:] = angles
        self.mujoco.mj_step(self.compiled, self.data)

    def base(self) -> Motion:
        """See ``engine.Session``."""
        turn = np.empty(9)
        self.mujoco.mju_quat2Mat(turn, self.data.qpos[3:7])
        rotation = turn.reshape(1, 3, 3)
        spin = rotation[0] @ self.data.qvel[3:6]  # MuJoCo gives it in the body's axes
        return Motion(
            self.data.qpos[:3].copy()[None], rotation, self.data.qvel[:3].copy()[None], spin[None]
        )

    def motion(self, links: tuple[int, ...]) -> Motion:
        """See ``engine.Session``; as of the start of the last step, like ``contacts``."""
        data, bodies = self.data, self.body[list(links)]
        place, spatial = data.xpos[bodies].copy(), data.cvel[bodies]
        spin = spatial[:, :3].copy()
        # cvel is that of the point at the centre of gravity of the whole robot
        arm = place - data.subtree_com[self.compiled.body_rootid[bodies]]
        velocity = spatial[:, 3:] + cross(spin, arm)
        return Motion(place, data.xmat[bodies].reshape(-1, 3, 3).copy(), velocity, spin)

    def joints(self, links: tuple[int, ...]) -> tuple[Array, Array, Array]:
        """See ``engine.Session``."""
        rates = [self.rate[i] for i in links]
        turns = np.array([self.offset[i] for i in links])
        angles = self.data.qpos[[self.angle[i] for i in links]] + turns
        # rows of friction come first after equalities, which there are none of
        motors = dict(zip(self.motors, self.data.efc_force[: self.data.nf], strict=True))
        torques = np.array([motors.get(i, 0.0) for i in links])
        return angles, self.data.qvel[rates].copy(), torques

    def contacts(self) -> Contacts:
        """See ``engine.Session``."""
        found, data = self.data.contact, self.data
        used = np.flatnonzero(found.efc_address >= 0)
        pair = found.geom[used]
        mine = self.link_of[pair]
        first = mine[:, 0] >= 0  # MuJoCo's normal points from the first geom to the second
        other = np.where(first, pair[:, 1], pair[:, 0])
        normal = found.frame[used, :3] * np.where(first, -1.0, 1.0)[:, None]
        return Contacts(
            mine.max(axis=1, initial=-1),
            self.solid_of[other],
            found.pos[used].copy(),
            normal,
            data.efc_force[found.efc_address[used]].copy(),  # elliptic cone: its first is normal
            np.maximum(-found.dist[used], 0.0),
        )

    def move(self, name: str, place: tuple[float, float] | None) -> None:
        """See ``engine.Session``."""
        for i, solid in enumerate(self.stage.solids):
            if solid.name == name and solid.meets == "obstacles":
                at = self.compiled.body(f"solid_{i}").mocapid[0]
                x, y, _ = solid.shape.pose.place
                to = AWAY if place is None else (place[0] - x, place[1] - y, 0.0)
                self.data.mocap_pos[at] = to

    def render(self, camera: Camera) -> NDArray[np.uint8]:
        """Picture (H, W, 3) by MuJoCo's OpenGL renderer. Raises SimulationError without
        graphics."""
        place = self.data.qpos[:3]
        view = self.mujoco.MjvCamera()
        view.lookat[:] = camera.target or (place[0], place[1], place[2] + 0.08)
        view.distance = camera.distance
        view.azimuth = 90.0 + math.degrees(camera.yaw)
        view.elevation = math.degrees(camera.pitch)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # what is missing is said below, in one line
                renderer = self.mujoco.Renderer(self.compiled, camera.height, camera.width)
        except Exception as error:  # the OpenGL back ends raise what they like
            advice = "set MUJOCO_GL=egl or osmesa, or take the picture with pybullet"
            raise SimulationError(
                f"mujoco found no graphics for a picture ({error}): {advice}"
            ) from error
        try:
            renderer.update_scene(self.data, view)
            image: NDArray[np.uint8] = renderer.render().copy()
        finally:
            renderer.close()
        return image
