"""The ground: its friction, and one shape."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from trajopt.errors import ArgumentError
from trajopt.limits.friction import Friction, FrictionAlong, FrictionMap
from trajopt.schema import NonNegative, OneOrEach, Point, Positive, Section, broken_rule
from trajopt.world.ground import Ground
from trajopt.world.height_files import load_height_map
from trajopt.world.mesh import load_mesh
from trajopt.world.plane import Plane
from trajopt.world.ramp import Edge, Ramp, Ramps
from trajopt.world.rough import rough_ground
from trajopt.world.terrain import Flat

FILES = ("height_map", "mesh", "friction_map")  # tables that name a file
SHAPES = ("plane", "ramps", "height_map", "mesh", "rough")
Grade = Annotated[float, Field(gt=0, lt=1.57)]
Origin = Field((0.0, 0.0), description="x, y of the lower left grid point, m")


class PlaneSection(Section):
    """A tilted plane through the origin."""

    slope: float = Field(description="rad, < 0 falls", gt=-1.57, lt=1.57)
    direction: float = Field(description="in which it rises, rad")

    def shape(self, folder: FilePath, grade: float) -> Plane:  # noqa: ARG002
        return Plane(self.slope, self.direction)


class RampSection(Section):
    """A ramp on the floor."""

    foot: Point = Field(description="a point of the foot line, x, y, m")
    direction: float = Field(description="in which it rises, rad")
    length: Positive = Field(description="along the slope, m")
    height: float = Field(description="m")
    rounding: Positive = Field(description="edges are rounded over this length, m (axle distance)")
    edge: Edge = Field(
        "mean",
        description="mean: an arc, for robots that cross it straight; smooth: curvature without a "
        "jump, which steered wheels need",
    )

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if not abs(self.height) < self.length:
            raise broken_rule("height", self.height, f"a height below the length {self.length} m")
        return self

    @property
    def ramp(self) -> Ramp:
        run = math.sqrt(self.length**2 - self.height**2)
        return Ramp(self.foot, self.direction, run, self.height, self.rounding, self.edge)


class HeightMapSection(Section):
    """Heights on a grid, from a file."""

    file: str = Field(
        description=".npy array or .tif of floats: heights, m, row 0 at the least y (.npy) or at the "
        "largest (.tif); .png or .tif of grey levels: see relief. From the problem file's folder"
    )
    spacing: Positive = Field(description="between grid points, m")
    origin: Point = Origin
    relief: float | None = Field(None, description="height of white, m; with grey levels only")

    def shape(self, folder: FilePath, grade: float) -> Ground:
        file = folder / self.file
        return load_height_map(
            file, self.spacing, origin=self.origin, relief=self.relief, grade=grade
        )


class MeshSection(Section):
    """Triangles, from a file."""

    file: str = Field(description=".obj or .stl, z up, m; from the problem file's folder")
    spacing: Positive = Field(description="of the height map taken from it, m")

    def shape(self, folder: FilePath, grade: float) -> Ground:
        mesh = load_mesh(folder / self.file, self.spacing, grade=grade)
        _ = mesh.map  # made here, so that what is wrong with it is said here
        return mesh


class RoughSection(Section):
    """Random heights on a square grid around the origin, the same for the same seed."""

    sigma: NonNegative = Field(description="standard deviation of the heights, m")
    correlation: NonNegative = Field(
        description="heights correlate as exp(-d^2 / correlation^2), m; 0: not at all"
    )
    size: Positive = Field(description="side of the square, m")
    spacing: Positive = Field(description="between grid points, m")
    flat_radius: NonNegative = Field(0.0, description="level within it around the origin, m")
    seed: int = Field(description="of the heights", ge=0)

    def shape(self, folder: FilePath, grade: float) -> Ground:  # noqa: ARG002
        sizes = self.model_dump(exclude={"sigma", "seed"})
        made = rough_ground(self.sigma, rng=np.random.default_rng(self.seed), **sizes)
        return replace(made, grade=grade)


class FrictionAlongSection(Section):
    """Friction along the path: linear between places, constant before and after them."""

    places: tuple[NonNegative, ...] = Field(
        description="path parameters, m, increasing", min_length=1
    )
    values: tuple[Positive, ...] = Field(description="coefficients, one a place")

    def friction(self, folder: FilePath) -> FrictionAlong:  # noqa: ARG002
        return FrictionAlong(self.places, self.values)


class FrictionMapSection(Section):
    """Friction on a grid, from a file; linear in each direction between its points."""

    file: str = Field(
        description=".npy array or .tif of floats: coefficients, rows as a height map's; .png or .tif "
        "of grey levels: see white. From the problem file's folder"
    )
    spacing: Positive = Field(description="between grid points, m")
    origin: Point = Origin
    white: Positive | None = Field(None, description="coefficient of white; with grey levels only")

    def friction(self, folder: FilePath) -> FrictionMap:
        file = folder / self.file
        grid = load_height_map(file, self.spacing, origin=self.origin, relief=self.white)
        return FrictionMap(grid.heights, self.spacing, self.origin)


class GroundSection(Section):
    """The ground: its friction, and its shape: level, or one of plane, ramps, height_map, mesh and
    rough."""

    friction: OneOrEach | None = Field(
        None, description="coefficient between wheels and ground: one, or one a wheel of the robot"
    )
    friction_along: FrictionAlongSection | None = Field(None, description="instead of friction")
    friction_map: FrictionMapSection | None = Field(None, description="instead of friction")
    plane: PlaneSection | None = None
    ramps: tuple[RampSection, ...] = Field((), description="ramps on level ground")
    height_map: HeightMapSection | None = None
    mesh: MeshSection | None = None
    rough: RoughSection | None = None
    grade: Grade | None = Field(
        None, description="steepest slope along a path, rad; with ramps, height_map, mesh, rough"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        frictions = ("friction", "friction_along", "friction_map")
        given = [name for name in frictions if getattr(self, name) is not None]
        if len(given) != 1:
            expected = "this key, friction_along or friction_map, one of them"
            key = given[-1] if given else "friction"
            raise broken_rule(key, " and ".join(given) or "missing", expected)
        shapes = [name for name in SHAPES if getattr(self, name)]
        if len(shapes) > 1:
            expected = "one shape of the ground: " + " or ".join(shapes)
            raise broken_rule(shapes[-1], "given", expected)
        if (self.grade is not None) != (self.kind not in ("level", "plane")):
            expected = f"none: {self.kind} ground has no other slope"
            if self.grade is None:
                expected = f"the steepest slope along a path, rad, with {self.kind}"
            raise broken_rule("grade", self.grade, expected)
        return self

    @property
    def kind(self) -> str:
        """``level``, or the key of its shape."""
        return next((name for name in SHAPES if getattr(self, name)), "level")

    @property
    def files(self) -> dict[str, str]:
        """Files that the section names, by the key of their table."""
        found = {name: getattr(self, name) for name in FILES}
        return {name: section.file for name, section in found.items() if section is not None}

    def shape(self, folder: FilePath) -> Ground:
        """Files are looked for in ``folder``. Raises the broken rule."""
        if self.kind == "level":
            return Flat()
        if self.kind == "ramps":
            assert self.grade is not None
            return Ramps(tuple(ramp.ramp for ramp in self.ramps), self.grade)
        section, grade = getattr(self, self.kind), self.grade or math.pi / 3
        try:
            made: Ground = section.shape(folder, grade)
        except ArgumentError as error:
            raise _broken(error, self.kind, section) from None
        return made

    def coefficient(self, folder: FilePath) -> Friction:
        """The friction, with files from ``folder``. Raises the broken rule."""
        if self.friction is not None:
            return self.friction
        key = "friction_map" if self.friction_along is None else "friction_along"
        section = getattr(self, key)
        try:
            found: Friction = section.friction(folder)
        except ArgumentError as error:
            raise _broken(error, key, section) from None
        return found


def _broken(error: ArgumentError, key: str, section: Section) -> Exception:
    """The broken rule for what a shape of the ground refuses, in the words of its table."""
    name = error.argument.removeprefix("ground.").removeprefix("friction.").split()[0]
    if key == "friction_map" and name == "relief":
        name = "white"
    fields: Any = type(section).model_fields
    return broken_rule(
        f"ground.{key}.{name if name in fields else 'file'}", error.value, error.expected
    )


def scaled(friction: Friction, share: float) -> Friction:
    """A share of the friction, everywhere."""
    if isinstance(friction, FrictionAlong):
        return replace(friction, values=tuple(share * value for value in friction.values))
    if isinstance(friction, FrictionMap):
        return replace(friction, values=share * np.asarray(friction.values))
    if isinstance(friction, tuple):
        return tuple(share * value for value in friction)
    return share * friction


def least(friction: Friction) -> float:
    """The least coefficient there is."""
    if isinstance(friction, (FrictionAlong, FrictionMap)):
        return float(np.min(friction.values))
    return float(np.min(friction))
