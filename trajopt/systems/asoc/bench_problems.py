"""The design search of ASOC modules as problems of the optimizer benchmark: ``asoc/<soil>``."""

from __future__ import annotations

from pathlib import Path

from trajopt.arrays import Array
from trajopt.bench.problems import Family
from trajopt.objectives.base import Objective
from trajopt.systems.asoc.design import AsocDesign
from trajopt.systems.asoc.soil import soil_named


def design_on(text: str, _root: Path) -> tuple[Objective, Array]:
    """The design for the soil called ``text``."""
    design = AsocDesign(soil_named(text))
    return design, design.bounds


FAMILIES = {"asoc": Family(design_on, {"ASOC design, constrained": r"asoc/.*"})}
