"""Postures along a path, against finite differences in space and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from world.shapes import GROUNDS, HILLS, PATHS, TILTED, mesh_of

from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.paths.path import Path
from trajopt.paths.samples import sample_path
from trajopt.world.laid import lay
from trajopt.world.mesh import Mesh
from trajopt.world.posture import frame_on, samples_of, samples_on, twist_bend
from trajopt.world.terrain import Flat

CORNERS = np.array([[0.3, 0.2], [0.3, -0.2], [-0.3, 0.2], [-0.3, -0.2]])
PLACES = np.array([0.333, 1.234, 2.2])


def vee(m: np.ndarray) -> np.ndarray:
    return np.column_stack([m[:, 2, 1], m[:, 0, 2], m[:, 1, 0]])


def require_derivatives(at) -> None:
    """Samples at s +- h against each other: rotation, position, twist."""
    h = 1e-4
    before, here, after = (at(PLACES + k * h) for k in (-1, 0, 1))
    r = here.rotation
    np.testing.assert_allclose(r @ r.transpose(0, 2, 1), np.tile(np.eye(3), (3, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(r), 1.0)
    turning = vee(r.transpose(0, 2, 1) @ (after.rotation - before.rotation)) / (2 * h)
    np.testing.assert_allclose(here.turning, turning, atol=3e-7)
    tangent = (after.position - before.position) / (2 * h)
    np.testing.assert_allclose(here.tangent, tangent, atol=1e-7)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", r, here.velocity), tangent, atol=1e-7)
    second = (after.position - 2 * here.position + before.position) / h**2
    np.testing.assert_allclose(
        np.einsum("nij,ni->nj", r, second), here.acceleration_rate, atol=3e-7
    )
    np.testing.assert_allclose(here.twist_rate, (after.twist - before.twist) / (2 * h), atol=1e-6)
    rate = (after.turning - before.turning) / (2 * h)
    np.testing.assert_allclose(here.turning_rate, rate, atol=1e-6)
    np.testing.assert_array_equal(here.twist[:, :2], here.velocity[:, :2])
    np.testing.assert_array_equal(here.twist[:, 2], here.turning[:, 2])
    np.testing.assert_allclose(here.gravity, -r[:, 2, :], atol=1e-12)
    bend = np.einsum("ni,ni->n", r[:, :, 2], np.cross(tangent, second))
    pace = np.linalg.norm(tangent, axis=1)
    np.testing.assert_allclose(here.curvature, bend / pace**3, atol=1e-6)
    np.testing.assert_allclose(here.slope, np.arcsin(tangent[:, 2] / pace), atol=1e-6)


@pytest.mark.parametrize("contacts", [None, CORNERS], ids=["tangent", "contacts"])
@pytest.mark.parametrize("kind", PATHS)
@pytest.mark.parametrize("name", GROUNDS)
def test_samples_are_derivatives_of_poses(name, kind, contacts):
    ground = GROUNDS[name]
    path = lay(PATHS[kind], ground)
    require_derivatives(lambda s: samples_on(ground, path, s, path.locate(s), contacts))


@pytest.mark.parametrize("kind", ["plane", "climbing", "own"])
def test_samples_without_ground_are_derivatives_of_poses(kind):
    climbing = Path.through([[0, 0, 0], [1, 0.4, 0.2], [2, -0.2, 0.1], [3, 0.5, 0.4]])
    path = {"plane": PATHS["along"], "climbing": climbing, "own": PATHS["own"]}[kind]
    require_derivatives(lambda s: sample_path(path, s))
    flat = lambda s: samples_on(Flat(), path, s, path.locate(s))  # noqa: E731
    require_derivatives(flat)
    one, other = sample_path(path, PLACES), flat(PLACES)
    for name in ("rotation", "twist", "twist_rate", "turning_rate", "acceleration_rate"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), atol=1e-9)


@pytest.mark.parametrize("contacts", [None, CORNERS], ids=["tangent", "contacts"])
@pytest.mark.parametrize("kind", PATHS)
@pytest.mark.parametrize("name", ["plane", "hills", "smooth ramp"])
def test_second_derivative_of_the_twist(name, kind, contacts):
    ground, h = GROUNDS[name], 1e-4
    path = lay(PATHS[kind], ground)
    frame = frame_on(ground, path, path.locate(PLACES), contacts, 4)
    before, after = (
        samples_on(ground, path, s, path.locate(s), contacts) for s in (PLACES - h, PLACES + h)
    )
    expected = (after.twist_rate - before.twist_rate) / (2 * h)
    np.testing.assert_allclose(twist_bend(frame), expected, atol=1e-5 * np.abs(expected).max())
    low = samples_on(ground, path, PLACES, path.locate(PLACES), contacts)
    np.testing.assert_allclose(samples_of(frame, PLACES, path.locate(PLACES)).twist, low.twist)


def test_posture_on_a_plane_by_hand():
    """Along the contour the body leans by the slope, uphill it pitches by it."""
    slope, direction = 0.3, 0.7
    for turn, expected in (
        (0.0, [np.sin(slope), 0.0]),
        (np.pi / 2, [0.0, -np.sin(slope)]),
        (np.pi, [-np.sin(slope), 0.0]),
    ):
        d = direction + turn
        path = lay(Path.through([[0, 0], [2 * np.cos(d), 2 * np.sin(d)]]), TILTED)
        found = samples_on(TILTED, path, PLACES[:1], path.locate(PLACES[:1]))
        np.testing.assert_allclose(-found.gravity[0], [*expected, np.cos(slope)], atol=1e-12)
        np.testing.assert_allclose(found.turning, 0.0, atol=1e-12)
        np.testing.assert_allclose(found.slope, np.arcsin(expected[0]), atol=1e-12)


def test_wheels_that_stand_lower_tilt_the_robot():
    """Over the crest of a ridge the plane through the wheels lies below the crest."""
    path = lay(Path.through([[0.0, 0.0], [3.0, 0.0]]), HILLS)
    s = np.linspace(0.5, 2.5, 9)
    found = samples_on(HILLS, path, s, path.locate(s), CORNERS)
    x = found.position[:, 0]
    heights = np.array([HILLS.partial(x + a, 0 * x + b, 0, 0) for a, b in CORNERS])
    np.testing.assert_allclose(found.position[:, 2], heights.mean(axis=0), atol=1e-12)
    pitch = (heights[:2].mean(axis=0) - heights[2:].mean(axis=0)) / 0.6
    up = -found.gravity
    np.testing.assert_allclose(up[:, 0] / np.hypot(up[:, 1], up[:, 2]), pitch, rtol=2e-2, atol=2e-4)
    with pytest.raises(ArgumentError, match="line"):
        samples_on(HILLS, path, s, path.locate(s), CORNERS * [1, 0])


@pytest.mark.parametrize("kind", PATHS)
@pytest.mark.parametrize("contacts", [CORNERS, CORNERS[:3] - [0.1, 0.05]], ids=["four", "three"])
def test_wheels_stand_on_the_plane_nearest_to_the_ground_under_them(kind, contacts):
    path, s = lay(PATHS[kind], HILLS), np.linspace(0.2, 2.8, 9)
    u = path.locate(s)
    found = samples_on(HILLS, path, s, u, contacts)
    plan = path.position(u)[:, :2]
    ahead = path.position(u, 1)
    yaw = path.yaw(u) if kind == "own" else np.arctan2(ahead[:, 1], ahead[:, 0])
    for i in range(len(s)):
        cos, sin = np.cos(yaw[i]), np.sin(yaw[i])
        at = plan[i] + contacts @ np.array([[cos, sin], [-sin, cos]])
        basis = np.column_stack([np.ones(len(at)), at - plan[i]])
        z, a, b = np.linalg.lstsq(basis, HILLS.partial(at[:, 0], at[:, 1], 0, 0))[0]
        assert found.position[i, 2] == pytest.approx(z, abs=1e-12)
        up = np.array([-a, -b, 1.0]) / np.sqrt(1 + a * a + b * b)
        np.testing.assert_allclose(found.rotation[i, :, 2], up, atol=1e-12)


def test_wheels_that_leave_the_ground_are_refused_with_place():
    """Though the robot's origin stays on it: past each edge of a map, and over a hole of a mesh."""
    size = HILLS.size
    (x0, y0), (x1, y1) = HILLS.origin, np.add(HILLS.origin, size)
    for start, end in (
        ([x0 + 0.25, 0.0], [x0 + 1.0, 0.0]),
        ([x1 - 1.0, 0.0], [x1 - 0.25, 0.0]),
        ([0.0, y0 + 0.15], [1.0, y0 + 0.15]),
        ([0.0, y1 - 0.15], [1.0, y1 - 0.15]),
    ):
        path = lay(Path.through([start, end]), HILLS)
        with pytest.raises(InfeasibleError, match="none under a wheel") as caught:
            samples_on(HILLS, path, *(2 * [np.linspace(path.start, path.end, 30)]), CORNERS)
        assert caught.value.place in (0.0, pytest.approx(path.length, abs=0.06))
        inner = lay(Path.through(np.array([start, end]) * 0.9), HILLS)
        samples_on(HILLS, inner, *(2 * [np.linspace(inner.start, inner.end, 30)]), CORNERS)
    whole = mesh_of(HILLS)
    centres = whole.vertices[whole.faces].mean(axis=1)
    hole = np.hypot(centres[:, 0] - 1.0, centres[:, 1] - 0.2) > 0.15
    torn = Mesh(whole.vertices, whole.faces[hole], whole.spacing)
    path = lay(Path.through([[0.0, 0.0], [2.5, 0.0]]), torn)
    u = np.linspace(path.start, path.end, 60)
    samples_on(whole, path, u, u, CORNERS)
    with pytest.raises(InfeasibleError, match="none under a wheel") as caught:
        samples_on(torn, path, u, u, CORNERS)
    x = float(path.position(path.locate([caught.value.place]))[0, 0])
    assert x + 0.3 == pytest.approx(0.85, abs=0.15)
