"""Random rough ground with a given standard deviation of elevation and correlation length."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from trajopt.arrays import require_between, require_not_negative, require_positive
from trajopt.errors import ArgumentError
from trajopt.world.height_map import LARGEST_GRID, HeightMap

# m between mesh points; chosen so that sigma 4.5 cm gives about 45 deg ([udengaard2008], section
# 4.3)
MESH = 0.15


def rough_ground(
    sigma: float,
    *,
    rng: Generator,
    size: float = 8.0,
    correlation: float = 0.0,
    spacing: float = MESH,
    flat_radius: float = 0.0,
) -> HeightMap:
    """Square of side ``size`` (m) around the origin with normal heights of standard deviation
    ``sigma`` (m).

    ``correlation`` (m): heights correlate as exp(-d^2 / correlation^2); 0 draws each mesh point by
    itself, as the thesis's mesh. Within ``flat_radius`` (m) of the origin the ground is level, to
    start on. Raises ArgumentError for a negative sigma, correlation or radius, or a mesh that is
    empty or huge.
    """
    for name, value in (
        ("sigma", sigma),
        ("correlation", correlation),
        ("flat_radius", flat_radius),
    ):
        require_not_negative(name, value, "m")
    require_positive("size", size, "m")
    require_between("spacing", spacing, 0.0, size, "m, the size")
    count = round(size / spacing) + 1
    if count**2 > LARGEST_GRID:
        raise ArgumentError("spacing", spacing, f"at most {LARGEST_GRID} mesh points in {size:g} m")
    margin = int(np.ceil(2 * correlation / spacing))
    noise = rng.standard_normal((count + 2 * margin, count + 2 * margin))
    if correlation > 0:
        offsets = np.arange(-margin, margin + 1) * spacing
        kernel = np.exp(
            -2 * offsets**2 / correlation**2
        )  # convolved with itself: exp(-d^2/correlation^2)
        kernel /= np.sqrt(np.sum(kernel**2))
        noise = np.apply_along_axis(np.convolve, 0, noise, kernel, "valid")
        noise = np.apply_along_axis(np.convolve, 1, noise, kernel, "valid")
    axis = (np.arange(count) - (count - 1) / 2) * spacing
    near = np.hypot(axis[:, None], axis[None, :]) < flat_radius
    heights = np.where(near, 0.0, sigma * noise)
    return HeightMap(heights, spacing, (float(axis[0]), float(axis[0])), grade=np.radians(80.0))
