"""A model on its stage as a MuJoCo specification (MjSpec)."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from trajopt.robots.robot import STANDARD_GRAVITY
from trajopt.simulate.model import Colour, Link, Model, Pose, Shape
from trajopt.simulate.scene import PLATE, Stage
from trajopt.world.height_map import HeightMap

# Collision bits (contype, conaffinity): the robot's parts meet the ground or what stands on it, and
# never each other.
WHEELS, GROUND, OUTLINE, OBSTACLES, NOTHING = (1, 2), (2, 1), (4, 8), (8, 4), (0, 0)
ROTOR = 1e5  # kg m^2, chosen: no torque of a wheel changes its speed
# On smooth ground friction is that much stiffer than the contact, chosen. Under soft contacts what has
# to hold creeps by less than 1 mm/s; with hard rollers the solver would let motors slip (measured).
FRICTION_IMPEDANCE, HARD_FRICTION_IMPEDANCE = 1e4, 10.0
NO_FRICTION = 1e-5  # the least that MuJoCo takes
SHORT = 1e-6  # m, half the length of a sphere as a capsule
STEERING_RATE = 100.0  # rad/s, natural frequency of a steering servo with its gear; chosen
GROUND_COLOUR: Colour = (0.75, 0.62, 0.42)


class Options(Protocol):
    """What of the engine's options goes into the specification."""

    @property
    def step(self) -> float: ...

    @property
    def iterations(self) -> int: ...

    @property
    def contact_time(self) -> float: ...

    @property
    def contact_damping(self) -> float: ...

    @property
    def motor_impedance(self) -> float: ...


class SpecBuilder:
    """Fills a specification: bodies ``link_<i>`` with joints of the same name, geoms ``solid_<i>``,
    and an actuator for each driven joint (spins, then targets)."""

    def __init__(self, mujoco: Any, options: Options, model: Model, stage: Stage) -> None:
        self.mujoco, self.options, self.friction = mujoco, options, stage.scene.friction
        self.spec = spec = mujoco.MjSpec()
        self.meshes: dict[Shape, str] = {}
        spec.compiler.balanceinertia, spec.compiler.degree = False, False
        spec.option.timestep, spec.option.iterations = options.step, options.iterations
        self.smooth, self.uneven = not stage.broken, stage.uneven
        if self.smooth:
            rollers = any(link.joint.role == "roller" for link in model.links)
            hard = rollers and not self.uneven
            spec.option.impratio = HARD_FRICTION_IMPEDANCE if hard else FRICTION_IMPEDANCE
        spec.option.gravity = [0.0, 0.0, -STANDARD_GRAVITY]
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET
        self.plates = len(model.feet) if stage.plates else 0
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
        world.add_light(pos=[0.0, 0.0, 4.0], dir=light)
        texture = self.spec.add_texture(
            name="checks", width=256, height=256, type=self.mujoco.mjtTexture.mjTEXTURE_2D,
            builtin=self.mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        )  # fmt: skip
        texture.rgb1, texture.rgb2 = [0.95, 0.95, 0.95], [0.62, 0.7, 0.92]
        floor = self.spec.add_material(name="floor", texrepeat=[1, 1], texuniform=True)
        floor.textures[self.mujoco.mjtTextureRole.mjTEXROLE_RGB] = "checks"
        kinds = self.mujoco.mjtGeom
        if stage.plane is not None:
            ground = self._geom(world, "ground", kinds.mjGEOM_PLANE, [0, 0, 1], GROUND)
            ground.material = "floor"
            ground.quat = Pose.along(stage.plane.normal).quaternion
        if stage.field is not None:
            self._field(stage.field)
        for k in range(self.plates):
            plate = world.add_body(name=f"plate_{k}", mocap=True)
            made = self._geom(plate, f"plate_{k}", kinds.mjGEOM_PLANE, [0, 0, 1], NOTHING)
            made.rgba = [0.0, 0.0, 0.0, 0.0]
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
        if link.wheel >= 0 and self.smooth:
            bits = NOTHING  # see _meet
        same = link.shapes == link.looks
        for i, shape in enumerate(link.shapes):
            colour = link.colour if same else None
            geom = self._shape(body, f"{name}_{i}", shape, bits, colour)
            geom.friction = [link.grip * self.friction, 0.0, 0.0]
            # friction is the larger of two, unless one has priority
            geom.priority = int(link.grip < 1.0)
            if link.wheel >= 0 and self.smooth:
                self._meet(geom, link, ball=shape.kind == "sphere")
        for i, shape in enumerate(() if same else link.looks):
            self._shape(body, f"{name}_look_{i}", shape, NOTHING, link.colour)
        return body

    def _meet(self, geom: Any, link: Link, *, ball: bool) -> None:
        """Contact of a wheel with the plane under it: a pair, whose friction has a time constant of
        its own. Where it has that of a soft contact, wheels slide outward in bends: MuJoCo leaves
        out that directions of friction turn, and brings the slip to rest at that rate only.

        Soft balls of a roller hold along its axis alone. They differ in radius, so that two which touch
        at once would slide against each other across it and have less left to hold along (measured:
        up to a third). A capsule without length is a ball whose contacts MuJoCo lays along its axis.
        """
        grip = across = link.grip * self.friction
        if ball and self.uneven and link.joint.role == "roller":
            geom.type, across = self.mujoco.mjtGeom.mjGEOM_CAPSULE, NO_FRICTION
            geom.size = [geom.size[0], SHORT, 0.0]
        pair = self.spec.add_pair(name=f"meet_{geom.name}")
        pair.geomname1 = f"plate_{link.wheel}" if self.plates else "ground"
        pair.geomname2, pair.condim = geom.name, 3
        pair.friction = [grip, across, 0.0, 0.0, 0.0]
        pair.solref = [self.options.contact_time, self.options.contact_damping]
        pair.solreffriction = pair.solref

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
