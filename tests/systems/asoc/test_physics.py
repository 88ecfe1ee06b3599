"""The robot on split offset casters in both engines: masses, flat ground, contact loss, bad
input."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.theses.asoc_study import constant_speed, square_corners
from trajopt.errors import ArgumentError, ProblemError, SimulationError
from trajopt.systems.asoc.bullet import asoc_in_pybullet, asoc_urdf
from trajopt.systems.asoc.modules import TOTAL_MASS, AsocGeometry
from trajopt.systems.asoc.mujoco import asoc_in_mujoco, asoc_mjcf
from trajopt.systems.asoc.reference import planned_speed
from trajopt.systems.asoc.run import AsocBody, _pose
from trajopt.systems.asoc.tracking import Knowledge
from trajopt.world.height_map import HeightMap
from trajopt.world.rough import rough_ground

pytest.importorskip("pybullet")
pytest.importorskip("mujoco")

GEOMETRY = AsocGeometry(4)
ENGINES = {"pybullet": asoc_in_pybullet, "mujoco": asoc_in_mujoco}


def level() -> HeightMap:
    return HeightMap(np.zeros((40, 41)), 0.25, (-3.0, -3.0))


def test_masses_add_up_to_65_kg() -> None:
    import mujoco

    model = mujoco.MjModel.from_xml_string(asoc_mjcf(AsocBody(GEOMETRY), level()))
    assert model.body_mass.sum() == pytest.approx(TOTAL_MASS)
    text = asoc_urdf(AsocBody(GEOMETRY))
    masses = [float(part.split('"')[1]) for part in text.split("<mass value=")[1:]]
    assert sum(masses) == pytest.approx(TOTAL_MASS)


@pytest.mark.parametrize("engine", list(ENGINES))
def test_planned_corners_keep_the_path_on_level_ground(engine) -> None:
    run = ENGINES[engine](GEOMETRY, level(), planned_speed(square_corners(1.0)))
    assert run.rms < 0.02
    assert run.pose[-1] == pytest.approx([0.0, 0.0, 0.0], abs=0.03)
    assert np.all(np.isfinite(run.pose))
    assert run.airborne_share < 0.05


def test_a_step_in_the_ground_lies_where_the_map_has_it() -> None:
    """Asymmetric maps catch swapped axes: a plateau under the robot lifts it, beside it does
    not."""
    heights = np.zeros((40, 30))
    heights[20:, :] = 0.08  # y >= 2 m
    reference = planned_speed([[0.0, 0.0], [0.2, 0.0]])
    for drive in ENGINES.values():
        low = drive(GEOMETRY, HeightMap(heights, 0.25, (-3.0, -3.0)), reference)
        assert abs(low.roll_pitch).max() < 0.06
        assert abs(low.roll_pitch[-1, 0]) < 0.01
        ramped = replace(
            HeightMap(np.tile(0.1 * np.arange(40)[:, None] * 0.25, (1, 30)), 0.25),
            origin=(-3.0, -3.0),
        )
        tilted = drive(GEOMETRY, ramped, reference)
        assert tilted.roll_pitch[-1, 0] == pytest.approx(
            np.arctan(0.1), abs=0.03
        )  # rises along +y: rolls
        assert abs(tilted.roll_pitch[-1, 1]) < 0.06


@pytest.mark.parametrize("engine", list(ENGINES))
def test_odometry_knows_the_pose_on_level_ground_at_planned_speed(engine) -> None:
    run = ENGINES[engine](
        GEOMETRY,
        level(),
        planned_speed(square_corners(1.0)),
        knowledge=Knowledge(terrain=False, update_period=np.inf),
    )
    assert run.rms < 0.04
    assert run.pose[-1] == pytest.approx([0.0, 0.0, 0.0], abs=0.08)


@pytest.mark.slow
@pytest.mark.parametrize("engine", list(ENGINES))
def test_square_on_level_and_rough_ground(engine) -> None:
    drive, square = ENGINES[engine], square_corners()
    planned = drive(GEOMETRY, level(), planned_speed(square))
    fast = drive(GEOMETRY, level(), constant_speed(square))
    assert planned.rms < 0.02 < fast.rms_across < fast.rms < 0.3
    rough = replace(rough_ground(0.03, rng=np.random.default_rng(3), size=9.0), origin=(-2.0, -2.0))
    bumpy = drive(GEOMETRY, rough, planned_speed(square))
    assert bumpy.losses > planned.losses
    assert bumpy.rms > planned.rms


@pytest.mark.slow
@pytest.mark.parametrize("engine", list(ENGINES))
def test_driven_pivots_run_too(engine) -> None:
    rough = replace(
        rough_ground(0.015, rng=np.random.default_rng(3), size=6.0), origin=(-2.0, -2.0)
    )
    run = ENGINES[engine](GEOMETRY, rough, planned_speed(square_corners(1.0)), driven_pivots=True)
    assert run.rms < 0.05


@pytest.mark.parametrize("engine", list(ENGINES))
def test_leaving_the_map_is_an_error_with_its_place(engine) -> None:
    small = HeightMap(np.zeros((9, 9)), 0.25, (-1.0, -1.0))
    with pytest.raises(SimulationError, match=r"left the height map .* take a larger map"):
        ENGINES[engine](GEOMETRY, small, planned_speed([[0.0, 0.0], [2.0, 0.0]]))


def test_bad_input_is_refused() -> None:
    with pytest.raises(ArgumentError, match="friction"):
        AsocBody(GEOMETRY, friction=0.0)
    with pytest.raises(ProblemError, match=r"body\.mass"):
        AsocBody(AsocGeometry(4, wheel_radius=0.3, wheel_width=0.2))
    with pytest.raises(ArgumentError, match="ground"):
        asoc_in_pybullet(
            GEOMETRY, HeightMap(np.zeros((600, 600)), 0.1), planned_speed(square_corners(1.0))
        )


def test_a_state_that_left_physics_is_an_error() -> None:
    from trajopt.systems.asoc.run import AsocState

    upside, none = (
        np.diag([1.0, -1.0, -1.0]),
        (np.zeros(4), np.zeros((4, 2)), np.zeros((4, 2), dtype=bool)),
    )
    with pytest.raises(SimulationError, match="tipped"):
        _pose(AsocState(np.zeros(3), upside, *none), 1.0)
    with pytest.raises(SimulationError, match="finite"):
        _pose(AsocState(np.full(3, np.nan), np.eye(3), *none), 1.0)
