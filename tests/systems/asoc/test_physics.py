"""The robot on split offset casters in both engines: flat ground, contact loss, bad input."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.theses.asoc_study import constant_speed, square_corners
from trajopt.errors import ArgumentError, ProblemError, SimulationError
from trajopt.simulate.engine import ENGINES
from trajopt.systems.asoc.modules import AsocGeometry
from trajopt.systems.asoc.reference import planned_speed
from trajopt.systems.asoc.run import drive_asoc
from trajopt.systems.asoc.tracking import Knowledge
from trajopt.world.height_map import HeightMap
from trajopt.world.rough import rough_ground

pytest.importorskip("pybullet")
pytest.importorskip("mujoco")

GEOMETRY = AsocGeometry(4)


def level() -> HeightMap:
    return HeightMap(np.zeros((40, 41)), 0.25, (-3.0, -3.0))


@pytest.mark.parametrize("engine", ENGINES)
def test_planned_corners_keep_the_path_on_level_ground(engine) -> None:
    run = drive_asoc(GEOMETRY, level(), planned_speed(square_corners(1.0)), engine=engine)
    assert run.rms < 0.02
    assert run.recording.pose[-1] == pytest.approx([0.0, 0.0, 0.0], abs=0.03)
    assert np.all(np.isfinite(run.recording.pose))
    assert run.airborne_share < 0.05


@pytest.mark.parametrize("engine", ENGINES)
def test_a_step_in_the_ground_lies_where_the_map_has_it(engine: str) -> None:
    """Asymmetric maps catch swapped axes: a plateau under the robot lifts it, beside it does
    not."""
    heights = np.zeros((40, 30))
    heights[20:, :] = 0.08  # y >= 2 m
    reference = planned_speed([[0.0, 0.0], [0.2, 0.0]])
    beside = HeightMap(heights, 0.25, (-3.0, -3.0))
    low = drive_asoc(GEOMETRY, beside, reference, engine=engine).recording
    assert max(abs(low.roll).max(), abs(low.pitch).max()) < 0.06
    assert abs(low.roll[-1]) < 0.01
    tilted = np.tile(0.1 * np.arange(40)[:, None] * 0.25, (1, 30))
    rising = HeightMap(tilted, 0.25, (-3.0, -3.0))
    run = drive_asoc(GEOMETRY, rising, reference, engine=engine).recording
    assert run.roll[-1] == pytest.approx(np.arctan(0.1), abs=0.03)  # rises along +y: rolls
    assert abs(run.pitch[-1]) < 0.06


@pytest.mark.parametrize("engine", ENGINES)
def test_odometry_knows_the_pose_on_level_ground_at_planned_speed(engine) -> None:
    run = drive_asoc(
        GEOMETRY,
        level(),
        planned_speed(square_corners(1.0)),
        knowledge=Knowledge(terrain=False, update_period=np.inf),
        engine=engine,
    )
    assert run.rms < 0.04
    assert run.recording.pose[-1] == pytest.approx([0.0, 0.0, 0.0], abs=0.08)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_square_on_level_and_rough_ground(engine) -> None:
    square = square_corners()
    planned = drive_asoc(GEOMETRY, level(), planned_speed(square), engine=engine)
    fast = drive_asoc(GEOMETRY, level(), constant_speed(square), engine=engine)
    assert planned.rms < 0.02 < fast.rms_across < fast.rms < 0.3
    rough = replace(rough_ground(0.03, rng=np.random.default_rng(3), size=9.0), origin=(-2.0, -2.0))
    bumpy = drive_asoc(GEOMETRY, rough, planned_speed(square), engine=engine)
    assert bumpy.losses > planned.losses
    assert bumpy.rms > planned.rms


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_driven_pivots_run_too(engine) -> None:
    rough = replace(
        rough_ground(0.015, rng=np.random.default_rng(3), size=6.0), origin=(-2.0, -2.0)
    )
    reference = planned_speed(square_corners(1.0))
    run = drive_asoc(GEOMETRY, rough, reference, driven_pivots=True, engine=engine)
    assert np.abs(run.recording.angles).max() > 0.02
    assert run.rms < 0.05


@pytest.mark.parametrize("engine", ENGINES)
def test_leaving_the_map_is_an_error_with_its_place(engine) -> None:
    small = HeightMap(np.zeros((9, 9)), 0.25, (-1.0, -1.0))
    with pytest.raises(SimulationError, match=r"left the height map: .* take a larger map"):
        drive_asoc(GEOMETRY, small, planned_speed([[0.0, 0.0], [2.0, 0.0]]), engine=engine)


def test_bad_input_is_refused() -> None:
    reference = planned_speed(square_corners(1.0))
    with pytest.raises(ArgumentError, match="friction"):
        drive_asoc(GEOMETRY, level(), reference, friction=0.0)
    with pytest.raises(ProblemError, match=r"body\.mass"):
        drive_asoc(AsocGeometry(4, wheel_radius=0.3, wheel_width=0.2), level(), reference)
