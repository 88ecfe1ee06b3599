"""One client of Bullet, a stage and a robot in it, and pictures of them."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.errors import ArgumentError, SimulationError
from trajopt.simulate.engine import Camera, Start
from trajopt.simulate.model import Model, Shape, Vector, quaternion_of
from trajopt.simulate.scene import MOST_POINTS, Solid, Stage
from trajopt.simulate.urdf import model_urdf
from trajopt.world.height_map import HeightMap

# Collision filters (group, mask; bits): the robot's parts meet the ground or what stands on it, and
# never each other.
WHEELS, GROUND, OUTLINE, OBSTACLES = (2, 1), (1, 2), (8, 4), (4, 8)
# Rounded margin that Bullet adds around convex hulls of a URDF [m] (gUrdfDefaultCollisionMargin).
HULL_MARGIN = 0.001
# Functions of the module that compute and know no client.
_PURE = (
    "computeProjectionMatrixFOV",
    "computeViewMatrixFromYawPitchRoll",
    "getMatrixFromQuaternion",
)


class Client:
    """One physics client: every call of the pybullet module, with its number added."""

    def __init__(self, module: Any) -> None:
        self._module, self._number = module, module.connect(module.DIRECT)
        if self._number < 0:
            raise SimulationError("pybullet could not open another physics client in this process")

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._module, name)
        if not callable(found) or isinstance(found, type) or name in _PURE:
            return found

        def call(*arguments: Any, **options: Any) -> Any:
            return found(*arguments, **options, physicsClientId=self._number)

        self.__dict__[name] = call
        return call


def build_stage(bullet: Client, stage: Stage, visible: bool) -> dict[int, int]:
    """The stage's bodies: number of the solid (-1: plane or field) by Bullet's number."""
    found: dict[int, int] = {}
    if stage.plane is not None:
        shape = bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=stage.plane.normal)
        found[bullet.createMultiBody(0.0, shape)] = -1
    if stage.field is not None:
        found[_field(bullet, stage.field)] = -1
    for i, solid in enumerate(stage.solids):
        found[_solid(bullet, solid, visible)] = i
    for body, i in found.items():
        # Bullet multiplies friction: the robot carries it all
        bullet.changeDynamics(body, -1, lateralFriction=1.0, restitution=0.0)
        thing = i >= 0 and stage.solids[i].meets == "obstacles"
        bullet.setCollisionFilterGroupMask(body, -1, *(OBSTACLES if thing else GROUND))
    return found


def add_plates(bullet: Client, count: int) -> list[int]:
    """Planes that a wheel each meets."""
    found = []
    for wheel in range(count):
        shape = bullet.createCollisionShape(bullet.GEOM_PLANE)
        found.append(int(bullet.createMultiBody(0.0, shape)))
        bullet.changeDynamics(found[-1], -1, lateralFriction=1.0, restitution=0.0)
        bullet.setCollisionFilterGroupMask(found[-1], -1, *plate_filter(wheel))
    return found


def plate_filter(wheel: int) -> tuple[int, int]:
    """Group and mask of a wheel and its plate."""
    return 1 << (5 + wheel), 1 << (5 + wheel)


def _field(bullet: Client, field: HeightMap) -> int:
    """The height field, turned by a quarter, since Bullet cuts cells along the other diagonal
    than the map does. Data are Z[y, x].ravel() with "rows" counting x, and the wrong order
    loads silently; Bullet puts the middle of its extent and of its heights at the body's
    origin."""
    rows, columns = field.heights.shape
    if field.heights.size > MOST_POINTS:
        raise ArgumentError(
            "scene.ground", field.heights.shape,
            f"at most {MOST_POINTS} points in pybullet; crop the map",
        )  # fmt: skip
    shape = bullet.createCollisionShape(
        bullet.GEOM_HEIGHTFIELD,
        meshScale=[field.spacing, field.spacing, 1.0],
        heightfieldData=field.heights.T[::-1].ravel().tolist(),
        numHeightfieldRows=rows,
        numHeightfieldColumns=columns,
    )
    if shape < 0:
        raise SimulationError(
            f"pybullet could not build a height field of {rows} x {columns} points"
        )
    middle = (
        field.origin[0] + field.size[0] / 2,
        field.origin[1] + field.size[1] / 2,
        float(field.heights.min() + field.heights.max()) / 2,
    )
    quarter = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
    return int(bullet.createMultiBody(0.0, shape, -1, middle, quarter))


def _solid(bullet: Client, solid: Solid, visible: bool) -> int:
    at = solid.shape.pose
    kind, sizes = _geometry(bullet, solid.shape)
    shape, seen = bullet.createCollisionShape(kind, **sizes), -1
    if visible and solid.shape.kind != "hull":
        looks = {"length" if key == "height" else key: v for key, v in sizes.items()}
        seen = bullet.createVisualShape(kind, rgbaColor=[0.75, 0.62, 0.42, 1.0], **looks)
    w, x, y, z = at.quaternion
    return int(bullet.createMultiBody(0.0, shape, seen, at.place, (x, y, z, w)))


def _geometry(bullet: Client, shape: Shape) -> tuple[int, dict[str, Any]]:
    """Kind and sizes of a solid as Bullet takes them."""
    x, _, z = shape.size
    sizes: dict[str, tuple[int, dict[str, Any]]] = {
        "sphere": (bullet.GEOM_SPHERE, {"radius": x}),
        "cylinder": (bullet.GEOM_CYLINDER, {"radius": x, "height": 2.0 * z}),
        "box": (bullet.GEOM_BOX, {"halfExtents": list(shape.size)}),
        "hull": (bullet.GEOM_MESH, {"vertices": [list(corner) for corner in shape.corners]}),
    }
    return sizes[shape.kind]


def load_robot(bullet: Client, model: Model, start: Start, visible: bool) -> int:
    w, *vector = quaternion_of(start.rotation)
    turn = (*vector, w)
    arm = start.rotation @ np.array(model.links[0].cog)
    with tempfile.TemporaryDirectory(prefix="trajopt-") as folder:
        path = Path(folder) / "robot.urdf"
        text = model_urdf(model, Path(folder), margin=HULL_MARGIN, visible=visible)
        path.write_text(text, encoding="utf-8")
        try:
            return int(
                bullet.loadURDF(
                    str(path),
                    basePosition=(start.place + arm).tolist(),
                    baseOrientation=turn,
                    flags=bullet.URDF_USE_INERTIA_FROM_FILE | bullet.URDF_USE_IMPLICIT_CYLINDER,
                )
            )
        except bullet.error as error:
            raise SimulationError(
                f"pybullet could not build the robot {model.name!r}: {error}"
            ) from error


def shoot(bullet: Client, camera: Camera, target: Vector) -> NDArray[np.uint8]:
    """Picture (H, W, 3)."""
    view = bullet.computeViewMatrixFromYawPitchRoll(
        target, camera.distance, math.degrees(camera.yaw), math.degrees(camera.pitch), 0.0, 2
    )
    lens = bullet.computeProjectionMatrixFOV(45.0, camera.width / camera.height, 0.05, 20.0)
    shot = bullet.getCameraImage(
        camera.width, camera.height, view, lens,
        lightDirection=(1.0, -1.5, 3.0), shadow=1, renderer=bullet.ER_TINY_RENDERER,
    )  # fmt: skip
    image = np.array(shot[2], dtype=np.uint8).reshape(camera.height, camera.width, 4)
    return image[:, :, :3].copy()
