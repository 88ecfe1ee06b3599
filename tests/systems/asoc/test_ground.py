"""Height maps, random rough ground, contact of thin wheels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.paths.path import Path
from trajopt.world.height_files import load_height_map
from trajopt.world.height_map import HeightMap
from trajopt.world.rough import rough_ground
from trajopt.world.wheel_contact import wheel_contact


def plane(a: float, b: float, spacing: float = 0.1) -> HeightMap:
    axis = np.arange(-20, 21) * spacing
    return HeightMap(
        a * axis[None, :] + b * axis[:, None], spacing, (float(axis[0]), float(axis[0]))
    )


@settings(max_examples=30, deadline=None)
@given(
    st.floats(-0.8, 0.8),
    st.floats(-0.8, 0.8),
    st.floats(-1.5, 1.5),
    st.floats(-1.5, 1.5),
    st.floats(-3, 3),
)
def test_on_a_plane_everything_is_closed_form(a, b, x, y, heading) -> None:
    ground = plane(a, b)
    assert float(ground.height(x, y)) == pytest.approx(a * x + b * y, abs=1e-12)
    assert [float(g) for g in ground.gradient(x, y)] == pytest.approx([a, b])
    along = a * np.cos(heading) + b * np.sin(heading)
    contact = wheel_contact(ground, x, y, heading, 0.1)
    assert contact.inclination[0] == pytest.approx(np.arctan(along), abs=1e-9)
    assert contact.centre_height[0] == pytest.approx(
        a * x + b * y + 0.1 * np.sqrt(1 + along**2), abs=1e-9
    )


def test_contact_equals_dense_sampling_on_rough_ground() -> None:
    ground = rough_ground(0.03, rng=np.random.default_rng(4), size=4.0)
    rng = np.random.default_rng(1)
    x, y, heading = rng.uniform(-1.5, 1.5, 40), rng.uniform(-1.5, 1.5, 40), rng.uniform(-4, 4, 40)
    found = wheel_contact(ground, x, y, heading, 0.1)
    s = np.linspace(-0.1, 0.1, 40001)
    for i in range(40):
        z = ground.height(x[i] + s * np.cos(heading[i]), y[i] + s * np.sin(heading[i]))
        assert found.centre_height[i] == pytest.approx(
            np.max(z + np.sqrt(np.maximum(0.01 - s**2, 0.0))), abs=2e-6
        )


def test_inclination_is_the_slope_of_the_centres_path() -> None:
    ground = rough_ground(0.03, rng=np.random.default_rng(4), size=4.0)
    x = np.linspace(-1.0, 1.0, 50)
    step = 1e-6
    low, high = (wheel_contact(ground, x + d, 0.2, 0.0, 0.1).centre_height for d in (-step, step))
    np.testing.assert_allclose(
        np.tan(wheel_contact(ground, x, 0.2, 0.0, 0.1).inclination),
        (high - low) / (2 * step),
        atol=1e-3,
    )


@pytest.mark.parametrize("correlation", [0.0, 0.4])
def test_rough_ground_has_the_statistics_asked_for(correlation) -> None:
    ground = rough_ground(
        0.03, rng=np.random.default_rng(2), size=30.0, spacing=0.1, correlation=correlation
    )
    assert np.std(ground.heights) == pytest.approx(0.03, rel=0.05)
    shifted = np.mean(ground.heights[:, 4:] * ground.heights[:, :-4]) / 0.03**2  # 0.4 m apart
    assert shifted == pytest.approx(np.exp(-1.0) if correlation else 0.0, abs=0.06)
    again = rough_ground(
        0.03, rng=np.random.default_rng(2), size=30.0, spacing=0.1, correlation=correlation
    )
    assert np.array_equal(ground.heights, again.heights)


def test_start_area_is_level() -> None:
    ground = rough_ground(0.05, rng=np.random.default_rng(0), flat_radius=1.0)
    angles = np.linspace(0, 6, 50)
    assert np.all(ground.height(0.7 * np.cos(angles), 0.7 * np.sin(angles)) == 0)


def test_beyond_the_edge_the_ground_goes_on_level() -> None:
    ground = plane(0.5, 0.0)
    assert float(ground.height(5.0, 0.0)) == pytest.approx(1.0)
    assert [float(g) for g in ground.gradient(5.0, 0.0)] == [0.0, 0.0]


def test_a_path_too_steep_is_reported_with_place_and_angle() -> None:
    heights = np.zeros((21, 21))
    heights[:, 12:] = 0.1
    ground = HeightMap(heights, 0.1, (-1.0, -1.0), grade=np.radians(30))
    with pytest.raises(InfeasibleError, match=r"45 deg") as caught:
        ground.check(Path.through([[-0.8, 0.0], [0.8, 0.0]]))
    assert caught.value.place == pytest.approx(0.95, abs=0.1)
    ground.check(Path.through([[-0.8, 0.0], [0.0, 0.3]]))


def test_files_round_trip(tmp_path) -> None:
    heights = np.random.default_rng(0).uniform(0, 1, (12, 9))
    np.save(tmp_path / "a.npy", heights)
    np.testing.assert_array_equal(load_height_map(tmp_path / "a.npy", 0.1).heights, heights)
    Image.fromarray(np.round(heights[::-1] * 255).astype(np.uint8)).save(tmp_path / "a.png")
    np.testing.assert_allclose(
        load_height_map(tmp_path / "a.png", 0.1, relief=1.0).heights, heights, atol=0.002
    )
    Image.fromarray(np.round(heights[::-1] * 65535).astype(np.uint16)).save(tmp_path / "b.png")
    np.testing.assert_allclose(
        load_height_map(tmp_path / "b.png", 0.1, relief=2.0).heights, 2 * heights, atol=4e-5
    )


def bad_files(folder):
    (folder / "empty.npy").touch()
    (folder / "text.npy").write_text("no array")
    (folder / "text.png").write_text("no picture")
    (folder / "a.csv").write_text("1,2")
    np.save(folder / "nan.npy", np.array([[0.0, np.nan], [0.0, 0.0]]))
    np.save(folder / "line.npy", np.zeros(5))
    np.save(folder / "words.npy", np.array([["a", "b"], ["c", "d"]]))
    np.save(folder / "none.npy", np.zeros((0, 5)))
    np.lib.format.open_memmap(
        folder / "huge.npy", mode="w+", dtype=np.uint8, shape=(3000, 3000)
    ).flush()
    Image.new("L", (3000, 3000)).save(folder / "huge.png")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("missing.npy", "existing"),
        ("empty.npy", "not empty"),
        ("text.npy", "array of numbers"),
        ("text.png", "readable picture"),
        ("a.csv", "ends in"),
        ("nan.npy", "row 0, column 1"),
        ("line.npy", "2 x 2"),
        ("words.npy", "real numbers"),
        ("none.npy", "2 x 2"),
        ("huge.npy", "coarsen"),
        ("huge.png", "coarsen"),
    ],
)
def test_bad_files_give_a_clear_message(tmp_path, name, message) -> None:
    bad_files(tmp_path)
    with pytest.raises(ArgumentError, match=message):
        load_height_map(tmp_path / name, 0.1, relief=1.0)


@pytest.mark.parametrize(
    "call",
    [
        lambda: HeightMap(np.zeros((3, 3)), 0.0),
        lambda: HeightMap(np.zeros((3, 3)), 0.1, (np.nan, 0.0)),
        lambda: plane(0, 0).height(np.nan, 0.0),
        lambda: rough_ground(-1.0, rng=np.random.default_rng()),
        lambda: rough_ground(0.1, rng=np.random.default_rng(), spacing=0.001),
        lambda: wheel_contact(plane(0, 0), 0.0, 0.0, 0.0, -1.0),
    ],
)
def test_bad_input_is_refused(call) -> None:
    with pytest.raises(ArgumentError):
        call()
