"""Design of a robot on split offset casters as an objective ([udengaard2008], sections 3.2 and
3.3).

Decision variables, m: offset, split, gap, width, with gap = wheel radius - offset. The gap replaces
the radius so that the condition "offset below the radius" is a bound: eq. 8's root never sees a
negative number. Five terms are to be large: isotropy K, pivot angle beta_max (rad), obstacle height
h (m; the wheel radius, since h is linear in it), range d_max (m) and stability S (m). J is their
sum, each over its largest value in the design space (eq. 9); the cost is -J. Constraints: workspace
circles (eq. 5) and battery mass >= 0.

PHYSICAL is the default: cylinder mass with pi, Bekker's resistance with the wheel diameter, and the
true inner distance of the support polygon. THESIS is the thesis's reading that gives its printed
numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.objectives.base import Capability, Evaluation, SymbolicProblem
from trajopt.robots.robot import STANDARD_GRAVITY
from trajopt.systems.asoc.isotropy_curve import IsotropyCurve, isotropy_curve
from trajopt.systems.asoc.modules import BODY_LENGTH, TOTAL_MASS, envelope
from trajopt.systems.asoc.soil import Soil

FIXED_SHARE = 0.15  # of the total mass, structure and electronics ([udengaard2008], section 3.2)
MODULE_SHARE = 0.05  # of the total mass, one module without wheels (section 3.2)
RUBBER = 920.0  # kg/m^3, wheels (section 3.2)
BATTERY_ENERGY = 576e3  # J/kg, lithium-ion (section 3.2)
LARGEST_TILT = float(np.radians(30.0))  # rad, terrain angles 0-30 deg of Table V
LEAST_GAP = (
    0.004  # m, wheel radius - offset; below, eq. 8's root becomes singular (Table V keeps 4-5 mm)
)
THESIS_SPACING = 1.0  # m between module axes in the thesis's stability (inferred: Table VI's S fits 0.577 - offset)
LEVELS = 31  # of the full factorial: 31^4 = 923,521 designs
TERMS = ("K", "beta_max", "h", "d_max", "S")
VARIABLES = ("offset", "split", "gap", "width")
# m; chosen: hold Table V, the baseline of Table VI and the point design with room around
BOUNDS: tuple[tuple[float, float], ...] = (
    (0.05, 0.20),
    (0.10, 0.50),
    (LEAST_GAP, 0.12),
    (0.01, 0.25),
)


class Model(Enum):
    """Which reading of section 3.2 to compute."""

    PHYSICAL = "physical"
    THESIS = "thesis"


@dataclass(frozen=True)
class AsocDesign:
    """The design objective for N modules on a soil. ``provides`` batches and symbols."""

    soil: Soil
    modules: int = 3
    model: Model = Model.PHYSICAL
    tilt: float = LARGEST_TILT

    def __post_init__(self) -> None:
        if self.modules < 3:
            raise ArgumentError(
                "modules", self.modules, "at least 3 modules: fewer have no support polygon"
            )
        if not 0 <= self.tilt < np.pi / 2:
            raise ArgumentError("tilt", self.tilt, "a terrain angle in [0, 90) deg, rad")

    @property
    def dimension(self) -> int:
        return len(VARIABLES)

    @property
    def provides(self) -> frozenset[Capability]:
        return frozenset({Capability.BATCH, Capability.SYMBOLIC})

    @property
    def constrained(self) -> bool:
        return True

    @property
    def bounds(self) -> Array:
        """(4, 2): the design space, m."""
        return np.array(BOUNDS)

    @property
    def axis_distance(self) -> float:
        """Distance of neighbouring module axes, m (section 3.1.1)."""
        if self.model is Model.THESIS:
            return THESIS_SPACING
        return BODY_LENGTH * float(np.sin(np.pi / self.modules))

    def terms(self, offset: Any, split: Any, gap: Any, width: Any) -> tuple[Any, ...]:
        """K, beta_max, h, d_max, S of designs given as component arrays or symbols."""
        radius = offset + gap
        pivot = np.arctan(0.5 * split / np.sqrt(gap * (gap + 2 * offset)))  # eq. 8
        load = TOTAL_MASS * STANDARD_GRAVITY / (2 * self.modules)
        resistance = (
            2
            * self.modules
            * self.soil.compaction(load, width, radius, diameter_term=self.model is Model.PHYSICAL)
        )
        distance = self.battery_mass(radius, width) * BATTERY_ENERGY / resistance  # eq. 11
        return self.curve.at(split / offset), pivot, radius, distance, self.stability(offset)

    def battery_mass(self, radius: Any, width: Any) -> Any:
        """kg left for batteries out of the total mass; the thesis's wheels lack pi."""
        round_ = np.pi if self.model is Model.PHYSICAL else 1.0
        wheels = 2 * self.modules * RUBBER * round_ * radius * radius * width
        return TOTAL_MASS * (1 - FIXED_SHARE - MODULE_SHARE * self.modules) - wheels

    def stability(self, offset: Any) -> Any:
        """Least distance (m) from the centre to the support polygon over all module angles.

        Two neighbours that both trail inwards move their edge in by the offset. The thesis's column
        S fits the corner distance 1/(2 sin(pi/N)) - offset with axes 1 m apart instead (inferred).
        """
        if self.model is Model.THESIS:
            return THESIS_SPACING / (2 * np.sin(np.pi / self.modules)) - offset
        return BODY_LENGTH / 2 * np.cos(np.pi / self.modules) - offset

    def slack(self, offset: Any, split: Any, gap: Any, width: Any) -> tuple[Any, Any]:
        """Constraints, >= 0 where kept: half the room between workspace circles (eq. 5), m; the
        battery's share of the total mass."""
        room = self.axis_distance / 2 - envelope(offset, split, offset + gap, width)
        return room, self.battery_mass(offset + gap, width) / TOTAL_MASS

    @cached_property
    def curve(self) -> IsotropyCurve:
        """K over split/offset."""
        return isotropy_curve(self.modules, self.tilt)

    @cached_property
    def peaks(self) -> Mapping[str, float]:
        """Largest value of each term over the feasible designs of the 31-level factorial (eq. 9's
        stars)."""
        columns = grid(self.bounds, LEVELS)
        feasible = np.minimum(*self.slack(*columns)) >= 0
        return MappingProxyType(
            {
                name: float(
                    np.max(np.where(feasible, np.broadcast_to(term, feasible.shape), -np.inf))
                )
                for name, term in zip(TERMS, self.terms(*columns), strict=True)
            }
        )

    def total(self, offset: Any, split: Any, gap: Any, width: Any) -> Any:
        """J of eq. 9."""
        found = self.terms(offset, split, gap, width)
        return sum(term / self.peaks[name] for name, term in zip(TERMS, found, strict=True))

    def evaluate(self, candidates: Array) -> Evaluation:
        """Cost -J and violation of candidates (n, 4).

        Formulas end at the edge of the design space (no lengths below 0 there), so candidates
        outside are judged at the nearest design inside; the optimizers' runs add the distance to
        the violation.
        """
        low, high = self.bounds.T
        columns = tuple(np.clip(np.asarray(candidates, dtype=np.float64), low, high).T)
        slack = np.column_stack(self.slack(*columns))
        violation = np.maximum(-slack, 0.0).sum(axis=1)
        limits = np.array([[0.0, 0.0], [np.inf, np.inf]])
        return Evaluation(-np.asarray(self.total(*columns)), violation, slack, limits)

    def term_values(self, candidates: Array) -> tuple[Array, Array]:
        """Terms (n, 5), in the order of TERMS, and violations (n,) of candidates (n, 4): for Pareto
        fronts."""
        low, high = self.bounds.T
        columns = tuple(np.clip(np.asarray(candidates, dtype=np.float64), low, high).T)
        return np.column_stack(self.terms(*columns)), self.evaluate(candidates).violation

    def score(self, candidate: Array) -> Evaluation:
        """As ``evaluate``: the formulas have no grid that could be finer."""
        return self.evaluate(np.asarray(candidate, dtype=np.float64)[None])

    def symbolic(self, z: Any, parameters: Any) -> SymbolicProblem:  # noqa: ARG002 - the protocol's signature
        """The same formulas on symbols."""
        parts = (z[0], z[1], z[2], z[3])
        room, battery = self.slack(*parts)
        constraints = type(z).zeros(2, 1)
        constraints[0], constraints[1] = room, battery
        return SymbolicProblem(-self.total(*parts), constraints, np.zeros(2), np.full(2, np.inf))

    def parameters_at(self, start: Array) -> Array:  # noqa: ARG002
        return np.zeros(0)

    def slacks_at(self, start: Array) -> Array:  # noqa: ARG002
        return np.zeros(0)

    def describe(self, candidate: ArrayLike) -> Mapping[str, float]:
        """The five terms of one design (4,), by name."""
        values = self.terms(*np.asarray(candidate, dtype=np.float64))
        return MappingProxyType({name: float(v) for name, v in zip(TERMS, values, strict=True)})


def grid(bounds: Array, levels: int) -> tuple[Array, ...]:
    """Component arrays of a full factorial, shaped to broadcast against each other (open grid)."""
    axes = [np.linspace(low, high, levels) for low, high in bounds]
    return tuple(
        axis.reshape([-1 if k == i else 1 for k in range(len(axes))]) for i, axis in enumerate(axes)
    )
