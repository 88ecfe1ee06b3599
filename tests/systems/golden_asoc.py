"""Golden figures of [udengaard2008] and [wheels-lecture]: every call into the package that they
need."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.theses.asoc_study import (
    best_ratio,
    best_width,
    constant_speed,
    full_factorial,
    square_corners,
)
from benchmarks.theses.asoc_suspension import POINT_DESIGN, FourBar, Linkage, suspension_travel
from benchmarks.theses.textbook import TEXTBOOK
from tests.systems.golden_data import Figures
from trajopt.robots.mobility import mobility_of
from trajopt.systems.asoc.design import TERMS, AsocDesign, Model
from trajopt.systems.asoc.isotropy import Contact, mean_isotropy, spread_modules
from trajopt.systems.asoc.modules import AsocGeometry, largest_pivot
from trajopt.systems.asoc.soil import SOILS
from trajopt.systems.asoc.tracking import Knowledge, track_many
from trajopt.world.rough import rough_ground

# Table V, m: offset, split and radius as printed; the range's best width goes with them
PRINTED_SIZES = {
    "dry_sand": (0.144, 0.325, 0.148),
    "sandy_loam": (0.134, 0.306, 0.139),
    "clayey_soil": (0.134, 0.306, 0.139),
    "snow": (0.144, 0.325, 0.148),
}
# Table I, modules:lost:partial, module numbers one digit each
CONTACTS = (
    "2:: 2::0 2::01 3:: 3::0 3::01 3::012 3:0: 3:0:1 3:0:12 4:: 4::0 4::01 4::02 4::012 4::0123 "
    "4:0: 4:0:1 4:0:2 4:0:12 4:0:123 4:01: 4:01:2 4:01:23"
)


def _mean(places: np.ndarray, ratio: float, **options: Any) -> float:
    return mean_isotropy(places, ratio, rng=np.random.default_rng(0), **options).value


def asoc_isotropy() -> Figures:
    """Table I, Figures 9 and 11."""
    found = {}
    for cell in CONTACTS.split():
        modules, lost, partial = (tuple(map(int, part)) for part in cell.split(":"))
        value = _mean(spread_modules(*modules), 2.0, contact=Contact(lost, partial))
        gone = f"lost {list(lost)}, partial {list(partial)}"
        found[f"Table I, {modules[0]} modules, {gone}"] = value
    for ratio in (1.0, 1.5, 2.0, 2.5, 3.0):
        found[f"Figure 9, ratio {ratio:g}"] = _mean(spread_modules(3), ratio)
    for degrees in (120, 90, 60, 30, 0):
        angles = np.radians([0.0, degrees, 2 * degrees])
        places = np.column_stack([np.cos(angles), np.sin(angles)])
        found[f"Figure 11, modules {degrees} deg apart"] = _mean(places, 2.0)
    return found


def asoc_terrain() -> Figures:
    """Table II: best isotropy and ratio by terrain angle, on a coarse quadrature."""
    found = {}
    for degrees in (15, 30, 45):
        tilt, ratios = math.radians(degrees), np.arange(1.9, 3.2, 0.1)
        values = [
            _mean(
                spread_modules(4),
                float(ratio),
                tilts=(-tilt, 0.0, tilt),
                jacobian="forward",
                points=256,
                shifts=4,
            )
            for ratio in ratios
        ]
        top, value = best_ratio(np.array(values), ratios)
        found[f"Table II, {degrees} deg, isotropy"] = value
        found[f"Table II, {degrees} deg, ratio"] = top
    return found


def asoc_design() -> Figures:
    """Tables IV, V and VI: widths and gains at the printed other sizes, optima of J."""
    found = {}
    for model in Model:
        for soil, (offset, split, radius) in PRINTED_SIZES.items():
            design = AsocDesign(SOILS[soil], model=model)
            width = best_width(design, offset, split, radius)
            base = design.terms(0.15, 0.20, 1e-9, 0.03)[3]
            gain = design.terms(offset, split, radius - offset, width)[3] / base - 1
            best, total = full_factorial(design)
            label = f"{soil}, {model.value}"
            found[f"Table V, {label}, width, m"] = width
            found[f"Table VI, {label}, gain of d_max, %"] = 100 * float(gain)
            for name, value in zip(("offset", "split", "gap", "width"), best, strict=True):
                found[f"optimum of J, {label}, {name}, m"] = float(value)
            found[f"optimum of J, {label}, J"] = total
        few = AsocDesign(SOILS["sandy_loam"], 3, model)
        least = few.describe(full_factorial(few)[0])
        for modules in (4, 5):
            design = AsocDesign(SOILS["sandy_loam"], modules, model)
            terms = design.describe(full_factorial(design)[0])
            for term in TERMS:
                change = 100 * (terms[term] / least[term] - 1)
                found[f"Table IV, {model.value}, {modules} modules, {term}, %"] = change
    return found


def asoc_geometry() -> Figures:
    """Equation 8's example, section 3.5's point design and section 3.4's linkages."""
    point = POINT_DESIGN
    found = {
        "eq. 8, largest pivot, deg": math.degrees(largest_pivot(0.1, 0.2, 0.2)),
        "point design, largest pivot, deg": math.degrees(
            largest_pivot(point.offset, point.split, point.wheel_radius)
        ),
    }
    for kind in Linkage:
        travel = suspension_travel(kind, FourBar(), point)
        found[f"{kind.value} linkage, travel up, m"] = travel.up
        found[f"{kind.value} linkage, travel down, m"] = travel.down
    return found


def asoc_tracking() -> Figures:
    """Table X without slip: RMS error, % of the body's length, on three rough fields."""
    found, fields, side = {}, 3, 9.0
    ground = replace(
        rough_ground(0.03, rng=np.random.default_rng(11), size=2 * side), origin=(-2.0, -2.0)
    )
    starts = side * np.column_stack(np.divmod(np.arange(fields), 2))
    for position, rate in (("0.5 Hz", 2.0), ("dead reckoning", np.inf)):
        for terrain in (True, False):
            runs = track_many(
                AsocGeometry(4),
                ground,
                constant_speed(square_corners()),
                [Knowledge(terrain, rate)] * fields,
                starts,
                friction=np.inf,
            )
            label = f"Table X, {position}, ground {'known' if terrain else 'unknown'}"
            found[f"{label}, % of body"] = 100 * float(np.mean([r.rms for r in runs]))
    return found


def lecture_mobility() -> Figures:
    """Mobility and steerability of the textbook platforms."""
    found = {}
    for name, robot in TEXTBOOK.items():
        classes = mobility_of(robot)
        found[f"{name}, mobility"] = float(classes.mobility)
        found[f"{name}, steerability"] = float(classes.steerability)
    return found
