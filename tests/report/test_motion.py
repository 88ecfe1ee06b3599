"""Columns of a motion on sloping ground: posture, and the states of wheels that turn."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from trajopt import Path, Speed, robot, time_scale
from trajopt.limits.acceleration import Acceleration
from trajopt.report.motion import MOST_ROWS, posture, sampled, table_times, trajectory_table
from trajopt.world.plane import Plane

LIMITS = [Speed(1.0), Acceleration(1.0, 1.0)]


@pytest.mark.parametrize(
    ("end", "roll", "pitch"),
    [((2.0, 0.0), 0.0, -0.2), ((-2.0, 0.0), 0.0, 0.2), ((0.0, 2.0), -0.2, 0.0)],
    ids=["up", "down", "along the contour, the slope on the right"],
)
def test_roll_and_pitch_on_a_slope(end: tuple[float, float], roll: float, pitch: float) -> None:
    path = Path.through([(0.0, 0.0), end])
    timed = time_scale(path, LIMITS, robot=robot("powerbot"), ground=Plane(0.2, 0.0))
    table = pd.DataFrame(trajectory_table(timed))
    assert table["roll_rad"].to_numpy() == pytest.approx(roll, abs=1e-9)
    assert table["pitch_rad"].to_numpy() == pytest.approx(pitch, abs=1e-9)
    assert table["z_m"].iloc[-1] == pytest.approx(np.tan(0.2) * end[0], abs=1e-9)


def test_posture_undoes_turns() -> None:
    yaw, pitch, roll = 0.4, -0.3, 0.2
    c, s = np.cos, np.sin
    about_z = np.array([[c(yaw), -s(yaw), 0], [s(yaw), c(yaw), 0], [0, 0, 1]])
    about_y = np.array([[c(pitch), 0, s(pitch)], [0, 1, 0], [-s(pitch), 0, c(pitch)]])
    about_x = np.array([[1, 0, 0], [0, c(roll), -s(roll)], [0, s(roll), c(roll)]])
    found = posture((about_z @ about_y @ about_x)[None])
    np.testing.assert_allclose(np.ravel(found), [roll, pitch], atol=1e-15)


def test_castors_and_steered_wheels_have_their_columns() -> None:
    """Their rates integrate to their angles."""
    path = Path.through([(0.0, 0.0), (2.0, 0.3), (4.0, 0.0)])
    for name, turning in (
        ("powerbot", ["castor_left", "castor_right"]),
        ("car", ["front_left", "front_right"]),
    ):
        timed = time_scale(path, LIMITS, robot=robot(name))
        table = pd.DataFrame(trajectory_table(timed))
        steered = [c for c in table.columns if c.endswith("_steering_rad")]
        assert steered == [f"wheel_{wheel}_steering_rad" for wheel in turning]
        assert len([c for c in table.columns if c.endswith("_angle_rad")]) == 4
        for wheel in turning:
            for angle, rate in (
                ("steering_rad", "steering_rate_rad_s"),
                ("angle_rad", "speed_rad_s"),
            ):
                turned = np.trapezoid(table[f"wheel_{wheel}_{rate}"], table["t_s"])
                ends = table[f"wheel_{wheel}_{angle}"].iloc[[0, -1]].to_numpy()
                assert ends[1] - ends[0] == pytest.approx(turned, abs=2e-3), (wheel, angle)


def test_slow_motions_have_rows_by_the_cells_of_the_profile() -> None:
    """As many as 20,000 and no step of 10 ms; all gridpoints are among them, and the exact motion."""
    path = Path.through([(0.0, 0.0), (2.0, 0.3), (4.0, 0.0)])
    timed = time_scale(path, [Speed(1.0), Acceleration(1e-6, 1e-6)], robot=robot("loc8"))
    assert timed.duration > 3000
    times = table_times(timed)
    assert times[0] == 0
    assert times[-1] == timed.duration
    assert np.all(np.diff(times) > 0)
    assert 10_000 < len(times) <= MOST_ROWS + 1
    assert np.isin(timed.times, times).all()
    table = pd.DataFrame(trajectory_table(timed))
    np.testing.assert_allclose(table["x_m"], timed.at(times).pose[:, 0], atol=0)
    assert f"{len(times)} rows" in sampled(timed)
    assert "equal steps" in sampled(time_scale(path, LIMITS, robot=robot("loc8")))
