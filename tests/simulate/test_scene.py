"""What stands in a scene: solids against closed forms, contacts that are reported, refusals."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from trajopt.errors import ArgumentError
from trajopt.robots import robot
from trajopt.simulate.build import build
from trajopt.simulate.engine import ENGINES, Camera, Command, Recording, Start, make_engine
from trajopt.simulate.measure import observe
from trajopt.simulate.model import convex_pieces, prisms
from trajopt.simulate.scene import stage
from trajopt.simulate.stepping import drive, open_session
from trajopt.simulate.straight import straight_command
from trajopt.world.height_map import HeightMap
from trajopt.world.mesh import Mesh
from trajopt.world.obstacles import Circle, Polygon, Step, Wall
from trajopt.world.ramp import Ramp, Ramps
from trajopt.world.rough import rough_ground
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

pytest.importorskip("pybullet")
pytest.importorskip("mujoco")

SMALL = robot("small-differential")
FRONT, SIDE = 0.21, 0.2125  # m, of its outline
NOTCHED = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (1.0, 0.5), (0.0, 2.0))


def corners(scene: Scene) -> np.ndarray:
    (solid,) = stage(scene).solids
    signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    at = solid.shape.pose
    return np.array(at.place) + (signs * np.array(solid.shape.size)) @ at.rotation.T


def test_step_has_its_front_edge_where_asked() -> None:
    step = Step("s", 0.05, (1.0, -0.5), math.radians(30.0), width=2.0, depth=1.0)
    points = corners(Scene(0.8, Flat(), (step,)))
    top = points[points[:, 2] > 0.0]
    np.testing.assert_allclose(top[:, 2], 0.05)
    front = np.array([math.cos(step.direction), math.sin(step.direction)])
    depth = (top[:, :2] - np.array(step.place)) @ front
    np.testing.assert_allclose(np.sort(depth), [0.0, 0.0, 1.0, 1.0], atol=1e-12)


def test_ramps_are_plates_through_their_rounded_profile() -> None:
    up = Ramp((1.0, 0.5), math.radians(30.0), 2.0, 0.3, 0.4)
    down = Ramp((6.0, 3.5), math.radians(210.0), 1.0, 0.2, 0.2)
    ground = Ramps((up, down), grade=0.5)
    plates = stage(Scene(0.8, ground)).solids
    along = np.array([math.cos(up.direction), math.sin(up.direction)])
    for plate in plates:
        at, half = plate.shape.pose, np.array(plate.shape.size)
        ends = np.array([[-half[0], 0.0, half[2]], [half[0], 0.0, half[2]]])
        top = np.array(at.place) + ends @ at.rotation.T
        np.testing.assert_allclose(top[:, 2], ground.height(top[:, 0], top[:, 1]), atol=1e-9)
        assert abs((top[1] - top[0])[:2] @ [-along[1], along[0]]) < 1e-9
    heights = [plate.shape.pose.place[2] for plate in plates]
    assert len(set(np.round(heights, 6))) > 15


def test_every_other_ground_is_a_height_field_of_its_smooth_surface() -> None:
    """Off by less than 1 mm anywhere; a map's own points are points of the field."""
    ramps = Ramps((Ramp((1.0, 0.0), 0.0, 2.0, 0.3, 0.4), Ramp((0.0, 1.0), 1.0, 2.0, 0.2, 0.3)), 0.5)
    rng = np.random.default_rng(1)
    hills = rough_ground(0.02, rng=rng, size=6.0, correlation=0.8, spacing=0.1)
    corners = np.array([[x, y, z] for x, y in ((-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0))
                        for z in [0.1 * x + 0.05 * y]])  # fmt: skip
    mesh = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]), 0.1)
    x, y = rng.uniform(-1.4, 1.4, (2, 500))
    for ground in (ramps, hills, mesh):
        stand = stage(Scene(0.8, ground), ((-1.5, -1.5), (1.5, 1.5)))
        field = stand.field
        assert field is not None
        assert not stand.solids
        assert stand.plane is None
        assert not stand.broken
        assert field.spacing <= 0.02 + 1e-9
        np.testing.assert_allclose(
            field.height(x, y),
            ground.partial(x, y, 0, 0),
            atol=1e-3 if ground is not mesh else 1e-9,
        )
    every = round(hills.spacing / field.spacing)
    assert every == 5
    steep = rough_ground(0.2, rng=rng, size=6.0, correlation=0.2, spacing=0.1)
    with pytest.raises(ArgumentError, match=r"(?s)scene\.ground.*m off it"):
        stage(Scene(0.8, steep), ((-1.5, -1.5), (1.5, 1.5)))


def test_unknown_ground_is_refused_by_name() -> None:
    @dataclass(frozen=True)
    class Crater:
        def height(self, x, y):
            return -np.hypot(x, y)

        def check(self, path):
            pass

    for area in (None, ((-1.0, -1.0), (1.0, 1.0))):
        with pytest.raises(ArgumentError, match=r"scene\.ground.*Crater.*Flat"):
            stage(Scene(0.8, Crater()), area)


def test_polygons_are_cut_into_convex_pieces_that_fill_them() -> None:
    def area(points) -> float:
        a, b = np.array(points), np.roll(points, -1, axis=0)
        return float(np.sum(a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1])) / 2

    square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    assert convex_pieces(square) == [square]
    pieces = convex_pieces(NOTCHED)
    assert all(area(piece) > 0 for piece in pieces)
    assert sum(map(area, pieces)) == pytest.approx(area(NOTCHED))
    (cx, cy) = np.array(NOTCHED).mean(axis=0)
    assert (cx, cy) == pytest.approx((1.0, 0.9))  # beside the notch's tip: outside of every piece
    for piece in pieces:
        edge = np.roll(piece, -1, axis=0) - piece
        rel = np.array([1.0, 1.2]) - piece
        assert (edge[:, 0] * rel[:, 1] - edge[:, 1] * rel[:, 0]).min() < 0
    assert len(prisms(NOTCHED, 0.0, 1.0)) == len(pieces)


@pytest.mark.parametrize("engine", ENGINES)
def test_height_fields_are_the_maps_triangles(engine: str) -> None:
    """Rays from above, on a map that is not square and has nothing the same twice."""
    rng = np.random.default_rng(0)
    ground = HeightMap(rng.normal(0.0, 0.2, (12, 17)), 0.3, (-2.0, -1.5))
    model = build(SMALL, discs=True, outline=False)
    start = Start(np.array((0.0, 0.0, 50.0)), np.eye(3), {})
    places = rng.uniform([-1.9, -1.4], [2.6, 1.6], (60, 2))
    with make_engine(engine).open(model, stage(Scene(0.8, ground)), start, None) as session:
        if engine == "mujoco":
            import mujoco

            geom = np.zeros(1, dtype=np.int32)
            found = [
                10.0
                - mujoco.mj_ray(
                    session.compiled, session.data, np.array([x, y, 10.0]),
                    np.array([0.0, 0.0, -1.0]), None, 1, -1, geom,
                )
                for x, y in places
            ]  # fmt: skip
        else:
            (field,) = session.solids
            session.bullet.setCollisionFilterGroupMask(field, -1, 1, -1)  # as rays have it
            found = [
                session.bullet.rayTest([x, y, 10.0], [x, y, -10.0])[0][3][2] for x, y in places
            ]
    np.testing.assert_allclose(found, ground.height(*places.T), atol=1e-6)


THINGS = {
    "wall": Wall("thing", 0.4, (1.0, -0.5), (1.0, 0.5), 0.1),
    "circle": Circle("thing", 0.4, (1.15, 0.0), 0.2),
    "polygon": Polygon("thing", 0.4, ((0.95, -0.3), (1.4, -0.3), (1.4, 0.3), (0.95, 0.3))),
    "low": Wall("thing", 0.03, (1.0, -0.5), (1.0, 0.5), 0.1),
    "step": Step("thing", 0.3, (0.95, 0.0), 0.0, width=1.0, depth=0.5),
}


def forward(scene: Scene, engine: str, distance: float = 1.5, **options) -> Recording:
    return drive(
        SMALL, scene, straight_command(SMALL, 0.0, distance, 0.5), engine=engine, **options
    )


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", list(THINGS))
def test_a_thing_in_the_way_stops_the_outline_and_is_reported(kind: str, engine: str) -> None:
    """All fronts are at x = 0.95. A high step stops the chassis, whose front is at 0.165 m."""
    reach = 0.165 if kind == "step" else FRONT
    run = forward(Scene(0.5, Flat(), (THINGS[kind],)), engine)
    (hit,) = run.hits
    assert hit.name == "thing"
    assert hit.place[0] == pytest.approx(0.95, abs=0.01)
    assert abs(hit.place[1]) <= SIDE + 0.01
    at = float(np.interp(hit.time, run.times, run.pose[:, 0]))
    assert at + reach == pytest.approx(0.95, abs=0.015)
    assert run.pose[-1, 0] + reach < 0.97
    assert run.slip[-50:].max() > 0.05 or kind == "low"  # the wheels spin on


@pytest.mark.parametrize("engine", ENGINES)
def test_what_is_beside_or_absent_is_not_met(engine: str) -> None:
    beside = Wall("beside", 0.4, (-1.0, SIDE + 0.06), (3.0, SIDE + 0.06), 0.1)
    assert forward(Scene(0.5, Flat(), (beside,)), engine).hits == ()
    post = Circle("post", 0.4, (0.5, 0.0), 0.1)
    scene = Scene(0.5, Flat(), (post,))
    with open_session(SMALL, scene, make_engine(engine), absent=["post"]) as session:
        for _ in range(20):
            session.advance(np.zeros(2), np.zeros(0))
        assert observe(session).hits == ()
        session.move("post", (FRONT + 0.097, 0.0))
        met = []
        for _ in range(5):
            session.advance(np.zeros(2), np.zeros(0))
            met += observe(session).hits
        assert {name for name, _ in met} == {"post"}
        assert met[0][1] == pytest.approx((FRONT, 0.0), abs=0.01)
        session.move("post", None)
        for _ in range(20):
            session.advance(np.zeros(2), np.zeros(0))
        assert observe(session).hits == ()


@pytest.mark.parametrize("engine", ENGINES)
def test_a_footprint_with_a_notch_lets_a_post_in(engine: str) -> None:
    """The outline that meets obstacles is the described one, not its hull."""
    notch = [[0.21, 0.2125], [-0.301, 0.2125], [-0.301, -0.2125], [0.21, -0.2125], [0.02, 0.0]]
    machine = robot("small-differential", {"body.footprint": notch})
    post = Scene(0.5, Flat(), (Circle("post", 0.4, (0.6, 0.0), 0.02),))
    runs = [
        drive(m, post, straight_command(m, 0.0, 1.0, 0.4), engine=engine) for m in (SMALL, machine)
    ]
    first = [float(np.interp(r.hits[0].time, r.times, r.pose[:, 0])) for r in runs]
    assert first[0] == pytest.approx(0.58 - FRONT, abs=0.015)
    assert first[1] - first[0] > 0.12


@pytest.mark.parametrize("engine", ENGINES)
def test_a_ramp_lifts_and_pitches_the_robot(engine: str) -> None:
    ramp = Ramp((0.6, 0.0), 0.0, 2.0, 0.2, 0.3)
    ground = Ramps((ramp,), grade=0.5)
    run = forward(Scene(0.8, ground), engine, 1.9)
    # all wheels stand on the plate at the end (nose up is negative about +y)
    assert run.pitch[-1] == pytest.approx(-math.atan(0.1), abs=math.radians(0.3))
    expected = float(ground.height(run.pose[-1:, 0], run.pose[-1:, 1])[0])
    assert run.height[-1] == pytest.approx(expected, abs=3e-3)
    falls = Ramps((replace(ramp, height=-0.2),), grade=0.5)
    down = forward(Scene(0.8, falls), engine, 4.0)
    assert down.height[-1] == pytest.approx(-0.2, abs=3e-3)
    assert down.hits == ()


@pytest.mark.parametrize("engine", ENGINES)
def test_friction_acts(engine: str) -> None:
    """Braking with locked wheels takes v^2 / (2 mu g) for the share that the drive wheels carry,
    which braking loads further: by mu share h / L of the weight."""
    height, base = SMALL.body.cog[2], 0.21  # m, of the centre of gravity; axle to castor
    way = []
    for friction in (0.1, 0.2):
        command = Command(
            np.array([0.0, 2.0, 2.001, 4.0]), np.array([0.0, 1.0, 0.0, 0.0])[:, None] * [5.1, 5.1]
        )
        run = drive(SMALL, Scene(friction, Flat()), command, engine=engine)
        at = float(np.interp(2.0, run.times, run.pose[:, 0]))
        way.append(float(run.pose[-1, 0]) - at)
        speed = (at - float(np.interp(1.9, run.times, run.pose[:, 0]))) / 0.1
        share = run.loads[-1, :2].sum() / run.loads[-1].sum() / (1 - friction * height / base)
        assert way[-1] == pytest.approx(speed**2 / (2 * friction * 9.81 * share), rel=0.08)


@pytest.mark.parametrize("engine", ENGINES)
def test_leaving_a_map_ends_the_run_and_starting_off_it_is_refused(engine: str) -> None:
    small = Scene(0.8, HeightMap(np.zeros((9, 9)), 0.25, (-1.0, -1.0)))
    run = forward(small, engine)
    assert run.exploded
    assert "take a larger map" in run.reason
    command = replace(straight_command(SMALL, 0.0, 1.5, 0.5), start_pose=(0.95, 0.0, 0.0))
    with pytest.raises(ArgumentError, match="start pose"):
        drive(SMALL, small, command, engine=engine)


def test_bullet_refuses_huge_maps() -> None:
    huge = Scene(0.8, HeightMap(np.zeros((600, 600)), 0.1))
    command = replace(straight_command(SMALL, 0.0, 1.5, 0.5), start_pose=(20.0, 20.0, 0.0))
    with pytest.raises(ArgumentError, match=r"scene\.ground.*250000 points"):
        drive(SMALL, huge, command, engine="pybullet")


def test_a_picture_shows_the_scene() -> None:
    scene = Scene(0.6, Flat(), (THINGS["wall"],))
    run = forward(scene, "pybullet", 0.3, picture=Camera(width=160, height=120))
    assert run.picture is not None
    assert run.picture.shape == (120, 160, 3)
    assert run.picture.dtype == np.uint8
    assert len(np.unique(run.picture.reshape(-1, 3), axis=0)) > 25
