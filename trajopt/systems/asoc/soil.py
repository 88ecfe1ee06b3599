"""Deformable soils and the resistance of wheels that compact them ([bekker1969]; [udengaard2008],
section 3.2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from trajopt.errors import ArgumentError


@dataclass(frozen=True)
class Soil:
    """Pressure-sinkage p = (cohesive/width + frictional) z^exponent, SI units (Pa/m^(n-1),
    Pa/m^n)."""

    name: str
    exponent: float
    cohesive: float
    frictional: float

    def __post_init__(self) -> None:
        for name in ("exponent", "cohesive", "frictional"):
            if not getattr(self, name) > 0:
                raise ArgumentError(name, getattr(self, name), "a value > 0")

    def compaction(self, load: Any, width: Any, radius: Any, *, diameter_term: bool = True) -> Any:
        """Resistance (N) of one wheel under ``load`` (N); lengths m; numbers, arrays or symbols.

        Eq. 10 for one wheel, divided by diameter^(e/2), e = (2n + 2)/(2n + 1), which Bekker's
        sinkage needs and the thesis leaves out (``diameter_term`` False). lambda is the printed
        series in n.
        """
        n = self.exponent
        e = (2 * n + 2) / (2 * n + 1)
        series = (
            1
            - n / 3
            + n * (n - 1) / 10
            - n * (n - 1) * (n - 2) / 42
            + n * (n - 1) * (n - 2) * (n - 3) / 216
        )
        stiffness = (
            self.cohesive + self.frictional * width
        )  # N/m^(n+1), the soil under the whole width
        resistance = (load / series) ** e / (n + 1) / stiffness ** (1 / (2 * n + 1))
        return resistance / (2 * radius) ** (e / 2) if diameter_term else resistance


KILO = 1000.0
# [udengaard2008], Table III (kPa/m^(n-1), kPa/m^n there)
SOILS: Mapping[str, Soil] = MappingProxyType(
    {
        s.name: s
        for s in (
            Soil("dry_sand", 1.1, 0.9 * KILO, 1523.4 * KILO),
            Soil("sandy_loam", 0.7, 5.3 * KILO, 1515.0 * KILO),
            Soil("clayey_soil", 0.5, 13.2 * KILO, 692.2 * KILO),
            Soil("snow", 1.6, 4.4 * KILO, 196.7 * KILO),
        )
    }
)


def soil_named(name: str) -> Soil:
    """A soil of Table III. Raises ArgumentError for an unknown name."""
    if name not in SOILS:
        raise ArgumentError("soil", name, "one of " + ", ".join(SOILS))
    return SOILS[name]
