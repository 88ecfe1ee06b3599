"""[ground] and [start] of problem files: shapes are those of world/, and what is wrong is said in
one line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from trajopt import Path as RobotPath
from trajopt import Slip, Speed, robot, solve, time_scale
from trajopt.errors import ProblemError, TrajoptError
from trajopt.limits.friction import FrictionAlong, FrictionMap
from trajopt.limits.speed_bound import SpeedZones
from trajopt.problem import Problem, load_problem
from trajopt.report.files import as_toml
from trajopt.report.run_folder import read_solution, write_solution
from trajopt.world.height_map import HeightMap
from trajopt.world.mesh import Mesh
from trajopt.world.plane import Plane
from trajopt.world.ramp import Ramps

ROOT = Path(__file__).parents[2]
RAMP = {"foot": [1.0, 0.0], "direction": 0.0, "length": 2.0, "height": 0.1, "rounding": 0.3}
MAP = {"file": "heights.npy", "spacing": 1.0, "origin": [-2.0, -2.0]}
ROUGH = {"sigma": 0.02, "correlation": 1.0, "size": 8.0, "spacing": 0.2, "seed": 5}
TABLES: dict[str, Any] = {
    "title": "on the ground",
    "robot": {"name": "powerbot"},
    "path": {"points": [[0.0, 0.0], [1.0, 0.1], [2.0, 0.0]]},
    "ground": {"friction": 0.4},
    "limits": {"speed": 1.0, "acceleration": 0.5, "deceleration": 0.5, "slip": True},
}
SEARCH = {
    "title": "search",
    "robot": {"name": "loc8"},
    "start": {"pose": [0.0, 0.0, 0.0]},
    "goal": {"pose": [2.0, 0.5, 0.0]},
    "space": {"x": [-1.0, 3.0], "y": [-1.0, 2.0]},
    "spline": {"free": ["p1"]},
    "objective": {"kind": "duration"},
    "ground": {"friction": 0.4},
    "limits": {"speed": 1.0, "acceleration": 0.5, "deceleration": 0.5, "slip": True},
}
HEIGHTS = 0.02 * np.arange(36.0).reshape(6, 6) ** 0.5


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("ground")
    np.save(place / "heights.npy", HEIGHTS)
    np.save(place / "line.npy", HEIGHTS[0])
    np.save(place / "holes.npy", np.where(HEIGHTS > 0.1, np.nan, HEIGHTS))
    np.save(place / "names.npy", np.array([["a", "b"], ["c", "d"]]))
    np.save(place / "slippery.npy", HEIGHTS - 0.05)
    (place / "empty.npy").touch()
    (place / "broken.png").write_text("no picture", encoding="utf-8")
    (place / "notes.txt").write_text("1 2 3", encoding="utf-8")
    (place / "empty.obj").write_text("# nothing\n", encoding="utf-8")
    (place / "hill.obj").write_text(
        "v -2 -2 0\nv 4 -2 0.3\nv 4 4 0.6\nv -2 4 0.3\nf 1 2 3 4\n", encoding="utf-8"
    )
    grey = np.round(HEIGHTS[::-1] * 1000).astype(np.uint8)
    Image.fromarray(grey).save(place / "grey.png")
    Image.fromarray(HEIGHTS[::-1].astype(np.float32)).save(place / "metres.tif")
    return place


def problem_in(folder: Path, base: dict[str, Any] | None = None, **sections: Any) -> Problem:
    file = folder / "problem.toml"
    file.write_text(as_toml({**(base or TABLES), **sections}), encoding="utf-8")
    return load_problem(file)


def ground(**shape: Any) -> dict[str, Any]:
    return {"ground": {"friction": 0.4, **shape}}


def test_every_shape_is_that_of_the_world(folder: Path) -> None:
    def shape(**given: Any) -> Any:
        return problem_in(folder, **ground(**given)).scene.ground

    assert shape().level
    assert shape(plane={"slope": 0.1, "direction": 0.5}) == Plane(0.1, 0.5)
    ramps = shape(ramps=[RAMP, {**RAMP, "direction": 1.0, "edge": "smooth"}], grade=0.2)
    assert isinstance(ramps, Ramps)
    assert [ramp.edge for ramp in ramps.ramps] == ["mean", "smooth"]
    for given in (
        MAP,
        {**MAP, "file": "metres.tif"},
        {**MAP, "file": "grey.png", "relief": 0.255},
    ):
        found = shape(height_map=given, grade=0.3)
        assert isinstance(found, HeightMap)
        assert found.grade == 0.3
        assert found.origin == (-2.0, -2.0)
        np.testing.assert_allclose(found.heights, HEIGHTS, atol=6e-4)
    mesh = shape(mesh={"file": "hill.obj", "spacing": 0.5}, grade=0.3)
    assert isinstance(mesh, Mesh)
    assert float(mesh.height(1.0, 0.0)) == pytest.approx(0.05 * 3 + 0.05 * 2)
    rough = shape(rough=ROUGH, grade=0.3)
    same = shape(rough=ROUGH, grade=0.3)
    other = shape(rough={**ROUGH, "seed": 6}, grade=0.3)
    np.testing.assert_array_equal(rough.heights, same.heights)
    assert not np.array_equal(rough.heights, other.heights)


def test_solving_a_file_is_time_scaling_on_that_ground(folder: Path) -> None:
    given = problem_in(folder, **ground(plane={"slope": 0.15, "direction": 1.2}))
    solution = solve(given)
    path = RobotPath.through(TABLES["path"]["points"])
    timed = time_scale(path, given.limits, robot=robot("powerbot"), ground=Plane(0.15, 1.2))
    assert solution.duration == timed.duration
    assert solution.path is not None
    assert solution.path.position(solution.path.end)[0, 2] == pytest.approx(
        2 * np.tan(0.15) * np.cos(1.2)
    )
    flat = solve(problem_in(folder))
    assert solution.duration > flat.duration


def test_friction_that_varies(folder: Path) -> None:
    along = {"places": [0.0, 1.0], "values": [0.4, 0.03]}
    one = problem_in(folder, ground={"friction_along": along})
    limits = {**TABLES["limits"], "slip_share": 0.5}
    half = problem_in(folder, ground={"friction_along": along}, limits=limits)
    each = problem_in(folder, **ground(friction=[0.4, 0.4, 0.2, 0.2]))
    for problem, wanted in (
        (one, FrictionAlong((0.0, 1.0), (0.4, 0.03))),
        (half, FrictionAlong((0.0, 1.0), (0.2, 0.015))),
        (each, (0.4, 0.4, 0.2, 0.2)),
    ):
        slip = next(limit for limit in problem.limits if isinstance(limit, Slip))
        assert slip.friction == wanted
        assert problem.scene.friction_varies
    assert solve(one).duration > solve(problem_in(folder)).duration
    given = {"file": "grey.png", "spacing": 1.0, "origin": [-2.0, -2.0], "white": 2.55}
    np.save(folder / "friction.npy", HEIGHTS + 0.1)
    mapped = problem_in(folder, ground={"friction_map": {**MAP, "file": "friction.npy"}})
    slip = next(limit for limit in mapped.limits if isinstance(limit, Slip))
    assert isinstance(slip.friction, FrictionMap)
    np.testing.assert_array_equal(slip.friction.values, HEIGHTS + 0.1)
    with pytest.raises(ProblemError, match=r"friction_map\.file"):  # its lowest grey is 0
        problem_in(folder, ground={"friction_map": given})


def test_the_robots_steering_bounds_a_problem_and_a_file_asks_for_less(folder: Path) -> None:
    car = {"name": "car", "steering": {"front": {"rate": 0.5, "acceleration": 2.0}}}

    def largest(**limits: Any) -> tuple[Any, Any]:
        made = problem_in(folder, robot=car, limits={**TABLES["limits"], **limits}).limits
        named = {limit.name: limit for limit in made}
        return named["steering_rate"].largest, named["steering_acceleration"].largest  # type: ignore[attr-defined]

    assert largest() == (0.5, 2.0)
    assert largest(steering_rate=0.2, steering_acceleration=[3.0]) == (0.2, 2.0)
    free = problem_in(folder, robot={"name": "car"}).limits
    assert not any(limit.name.startswith("steering") for limit in free)


def test_speed_zones(folder: Path) -> None:
    zones = [{"start": 0.5, "end": 1.0, "speed": 0.2}]
    problem = problem_in(folder, limits={**TABLES["limits"], "speed_zones": zones})
    assert SpeedZones(((0.5, 1.0, 0.2),)) in problem.limits
    timed = solve(problem).trajectory
    assert timed is not None
    inside = (timed.s > 0.5) & (timed.s < 1.0)
    assert timed.sd[inside].max() <= 0.2 + 1e-9
    assert timed.sd.max() > 0.5


def test_a_swerve_turns_its_wheels_at_a_stop(folder: Path) -> None:
    """A corner that none can drive through: at rest the wheels turn by a quarter turn."""
    given = {
        "robot": {"name": "swerve", "steering": {"all": {"rate": 2.0}}},
        "path": {"points": [[0.0, 0.0], [2.0, 1.0]], "heading": "free", "headings": [0.0, 0.0]},
        "start": {"steering": dict.fromkeys(("front-left", "rear-right"), 0.0)},
    }
    solution = solve(problem_in(folder, **given))
    assert solution.trajectory is not None
    first = solution.trajectory.rests[0]
    turned = np.arctan2(1.0, 2.0)
    assert (first.s, first.duration) == (0.0, pytest.approx(turned / 2.0))
    still = {**TABLES["path"], "stops": [1.0]}
    stopped = solve(problem_in(folder, path=still)).trajectory
    assert stopped is not None
    at = np.interp(1.0, stopped.s, stopped.sd)
    assert at == pytest.approx(0.0, abs=1e-9)


def test_castors_start_as_the_file_says(folder: Path) -> None:
    problem = problem_in(folder, start={"steering": {"castor-left": 1.0, "castor-right": -0.5}})
    solution = solve(problem)
    assert solution.trajectory is not None
    first = solution.trajectory.at(0.0).steering_angles[0]
    np.testing.assert_allclose(first, [0.0, 0.0, 1.0, -0.5], atol=1e-12)
    back = read_solution(write_solution(solution, folder / "castors", seed=0))
    assert back.trajectory is not None
    half = solution.duration / 2
    np.testing.assert_array_equal(
        back.trajectory.at(half).steering_angles, solution.trajectory.at(half).steering_angles
    )


def test_a_run_folder_on_a_map_stands_alone(folder: Path, tmp_path: Path) -> None:
    place = folder / "moved"
    place.mkdir()
    np.save(place / "map.npy", HEIGHTS)
    given = ground(height_map={**MAP, "file": "map.npy"}, grade=0.5)
    solution = solve(problem_in(place, **given))
    out = write_solution(solution, tmp_path / "run", seed=0)
    (place / "map.npy").unlink()
    back = read_solution(out)
    assert back.trajectory is not None
    assert solution.trajectory is not None
    assert dict(back.trajectory.margins()) == dict(solution.trajectory.margins())
    half = solution.duration / 2
    np.testing.assert_array_equal(
        back.trajectory.at(half).position, solution.trajectory.at(half).position
    )
    again = write_solution(solve(load_problem(out / "problem.toml")), out, seed=0)
    np.testing.assert_array_equal(np.load(again / "height_map.npy"), HEIGHTS)
    other = {**MAP, "file": "grey.png", "relief": 0.255}
    write_solution(solve(problem_in(folder, **ground(height_map=other, grade=0.5))), out, seed=0)
    assert {file.name for file in out.glob("height_map.*")} == {"height_map.png"}
    assert read_solution(out).holds
    (out / "height_map.png").write_bytes((folder / "metres.tif").read_bytes())
    with pytest.raises(TrajoptError, match=r"height_map\.png"):
        read_solution(out)


def test_a_path_that_leaves_its_map_does_not_hold(folder: Path) -> None:
    given = ground(height_map={**MAP, "origin": [-4.0, -4.0]}, grade=0.5)
    solution = solve(problem_in(folder, **given))
    assert not solution.holds
    assert "leaves the height map at (1." in solution.faults[0]
    assert solution.path is not None
    write_solution(solution, folder / "left", seed=0)
    assert read_solution(folder / "left").faults == solution.faults


WRONG: dict[str, tuple[dict[str, Any], str, str]] = {
    "no friction": ({"ground": {}}, "ground.friction", "friction_along or friction_map"),
    "friction of words": (ground(friction="ice"), "ground.friction", "a number > 0, or an array"),
    "no friction at all": (ground(friction=0.0), "ground.friction", "a number > 0"),
    "friction of no wheel": (ground(friction=[]), "ground.friction", "a number > 0, or an array"),
    "friction of two": (ground(friction=[0.4, 0.4]), "ground.friction", "or 4: one a wheel (left"),
    "friction below zero": (ground(friction=[0.4, -1, 0.4, 0.4]), "ground.friction", "number > 0"),
    "two frictions": (
        ground(friction_along={"places": [0.0], "values": [0.3]}),
        "ground.friction_along",
        "one of them",
    ),
    "places that fall": (
        {"ground": {"friction_along": {"places": [1.0, 0.5], "values": [0.3, 0.4]}}},
        "ground.friction_along.places",
        "increasing",
    ),
    "values that lack": (
        {"ground": {"friction_along": {"places": [0.0, 0.5], "values": [0.3]}}},
        "ground.friction_along.values",
        "a finite value > 0 a place",
    ),
    "places beyond the path": (
        {"ground": {"friction_along": {"places": [0.0, 50.0], "values": [0.3, 0.4]}}},
        "ground.friction_along.places",
        "up to the path's length",
    ),
    "friction that nothing uses": (
        {
            "ground": {"friction_along": {"places": [0.0], "values": [0.3]}},
            "limits": {"speed": 1.0},
        },
        "ground.friction_along",
        "limits.slip = true",
    ),
    "friction map with ice": (
        {"ground": {"friction_map": {**MAP, "file": "slippery.npy"}}},
        "ground.friction_map.file",
        "> 0",
    ),
    "friction map, grey": (
        {"ground": {"friction_map": {**MAP, "file": "grey.png"}}},
        "ground.friction_map.white",
        "of white",
    ),
    "two shapes": (
        ground(plane={"slope": 0.1, "direction": 0.0}, rough=ROUGH, grade=0.3),
        "ground.rough",
        "one shape of the ground: plane or rough",
    ),
    "a wall": (ground(plane={"slope": 1.6, "direction": 0.0}), "ground.plane.slope", "less than"),
    "a plane without direction": (
        ground(plane={"slope": 0.1}),
        "ground.plane.direction",
        "this key to be given",
    ),
    "a plane's grade": (
        ground(plane={"slope": 0.1, "direction": 0.0}, grade=0.3),
        "ground.grade",
        "none: plane ground",
    ),
    "level ground's grade": (ground(grade=0.3), "ground.grade", "none: level ground"),
    "no grade": (ground(height_map=MAP), "ground.grade", "along a path, rad, with height_map"),
    "unknown key": (
        ground(height_map={**MAP, "spacng": 1.0}, grade=0.3),
        "ground.height_map.spacng",
        "nearest is 'spacing'",
    ),
    "unknown shape": (ground(hill={"height": 1.0}), "ground.hill", "nearest is"),
    "no file": (
        ground(height_map={**MAP, "file": "nowhere.npy"}, grade=0.3),
        "ground.height_map.file",
        "an existing .npy, .png or .tif",
    ),
    "an empty file": (
        ground(height_map={**MAP, "file": "empty.npy"}, grade=0.3),
        "ground.height_map.file",
        "not empty",
    ),
    "a text": (
        ground(height_map={**MAP, "file": "notes.txt"}, grade=0.3),
        "ground.height_map.file",
        "ends in .npy, .png or .tif",
    ),
    "no picture": (
        ground(height_map={**MAP, "file": "broken.png", "relief": 1.0}, grade=0.3),
        "ground.height_map.file",
        "readable picture",
    ),
    "one row": (
        ground(height_map={**MAP, "file": "line.npy"}, grade=0.3),
        "ground.height_map.file",
        "at least 2 x 2",
    ),
    "holes": (
        ground(height_map={**MAP, "file": "holes.npy"}, grade=0.3),
        "ground.height_map.file",
        "finite heights",
    ),
    "names": (
        ground(height_map={**MAP, "file": "names.npy"}, grade=0.3),
        "ground.height_map.file",
        "real numbers",
    ),
    "grey without relief": (
        ground(height_map={**MAP, "file": "grey.png"}, grade=0.3),
        "ground.height_map.relief",
        "the height of white",
    ),
    "no spacing": (
        ground(height_map={**MAP, "spacing": 0.0}, grade=0.3),
        "ground.height_map.spacing",
        "greater than 0",
    ),
    "a mesh of nothing": (
        ground(mesh={"file": "empty.obj", "spacing": 0.5}, grade=0.3),
        "ground.mesh.file",
        "at least one triangle",
    ),
    "a mesh of heights": (
        ground(mesh={"file": "heights.npy", "spacing": 0.5}, grade=0.3),
        "ground.mesh.file",
        ".obj or .stl",
    ),
    "a mesh too fine": (
        ground(mesh={"file": "hill.obj", "spacing": 1e-4}, grade=0.3),
        "ground.mesh.spacing",
        "at most 4000000 points",
    ),
    "rough below zero": (
        ground(rough={**ROUGH, "sigma": -1.0}, grade=0.3),
        "ground.rough.sigma",
        "greater than or equal to 0",
    ),
    "rough and coarse": (
        ground(rough={**ROUGH, "spacing": 9.0}, grade=0.3),
        "ground.rough.spacing",
        "between 0 and 8 m, the size",
    ),
    "a seed of words": (
        ground(rough={**ROUGH, "seed": "now"}, grade=0.3),
        "ground.rough.seed",
        "valid integer",
    ),
    "a ramp of words": (
        ground(ramps=[{**RAMP, "edge": "round"}], grade=0.3),
        "ground.ramps[0].edge",
        "'mean' or 'smooth'",
    ),
    "a start angle of no wheel": (
        {"start": {"steering": {"front": 0.1}}},
        "start.steering",
        "wheels among castor-left, castor-right",
    ),
    "a start angle of a fixed wheel": (
        {"start": {"steering": {"left": 0.1}}},
        "start.steering",
        "wheels among castor-left, castor-right",
    ),
    "start angles as an array": ({"start": {"steering": [0.1]}}, "start.steering", "a table"),
    "a start angle of words": (
        {"start": {"steering": {"castor-left": "left"}}},
        "start.steering.castor-left",
        "valid number",
    ),
    "a steering rate without steering": (
        {"limits": {"steering_rate": 1.0}},
        "limits.steering_rate",
        "none: 'powerbot' does not steer",
    ),
    "a zone backwards": (
        {"limits": {"speed": 1.0, "speed_zones": [{"start": 1.0, "end": 0.5, "speed": 0.1}]}},
        "limits.speed_zones[0].end",
        "after start = 1.0 m",
    ),
    "a zone beyond the path": (
        {"limits": {"speed": 1.0, "speed_zones": [{"start": 1.0, "end": 9.0, "speed": 0.1}]}},
        "limits.speed_zones[0].end",
        "up to the path's length",
    ),
    "stops that fall": (
        {"path": {**TABLES["path"], "stops": [1.0, 0.5]}},
        "path.stops",
        "increasing",
    ),
    "a stop beyond the path": (
        {"path": {"points": [[0.0, 0.0], [2.0, 0.0]], "stops": [2.0]}},
        "path.stops",
        "before the path's end, 2 m",
    ),
    "a stop with a profile": (
        {
            "path": {**TABLES["path"], "stops": [1.0]},
            "profile": {"places": [0.0], "speeds": [0.5]},
        },
        "path.stops",
        "none with [profile]",
    ),
    "a share of all the load": ({"limits": {"contact": 1.0}}, "limits.contact", "less than 1"),
}


@pytest.mark.parametrize("case", WRONG)
def test_one_line_says_what_is_wrong(case: str, folder: Path) -> None:
    sections, key, words = WRONG[case]
    with pytest.raises(ProblemError) as caught:
        problem_in(folder, **sections)
    message = str(caught.value)
    assert "\n" not in message
    assert caught.value.key == key
    assert re.match(rf".*problem\.toml: {re.escape(key)} = .*: expected ", message)
    assert words in message


@pytest.mark.parametrize(
    ("sections", "key", "words"),
    [
        (ground(plane={"slope": 0.1, "direction": 0.0}), "ground.plane", "need level ground"),
        (ground(rough=ROUGH, grade=0.3), "ground.rough", "need level ground"),
        (
            {"ground": {"friction_along": {"places": [0.0], "values": [0.3]}}},
            "ground.friction_along",
            "a given [path]",
        ),
        (
            {"limits": {"speed": 1.0, "speed_zones": [{"start": 0.0, "end": 1.0, "speed": 0.1}]}},
            "limits.speed_zones",
            "a given [path]",
        ),
    ],
)
def test_what_a_search_cannot_use_is_refused(
    sections: dict[str, Any], key: str, words: str, folder: Path
) -> None:
    assert problem_in(folder, SEARCH).job.name == "search"
    with pytest.raises(ProblemError) as caught:
        problem_in(folder, SEARCH, **sections)
    assert caught.value.key == key
    assert words in str(caught.value)


def test_physics_refuses_friction_that_varies(folder: Path) -> None:
    from trajopt import validate
    from trajopt.errors import ArgumentError

    problem = problem_in(folder, **ground(friction=[0.4, 0.4, 0.2, 0.2]))
    solution = solve(problem)
    assert solution.trajectory is not None
    with pytest.raises(ArgumentError, match=r"scene\.friction.*one number"):
        validate(solution.trajectory, problem)


def test_speed_is_kept_on_every_shape(folder: Path) -> None:
    """Speed is that in space, not in the ground plan."""
    for given in (
        ground(plane={"slope": 0.2, "direction": 0.0}),
        ground(height_map=MAP, grade=0.5),
        ground(rough=ROUGH, grade=0.5),
    ):
        problem = problem_in(folder, **given, limits={"speed": 0.5})
        timed = solve(problem).trajectory
        assert timed is not None
        t = np.linspace(0.3, timed.duration - 0.3, 50)
        step = 1e-5
        moved = timed.at(t + step).position - timed.at(t - step).position
        speed = np.linalg.norm(moved, axis=1) / (2 * step)
        np.testing.assert_allclose(speed, 0.5, rtol=1e-3)
        assert Speed(0.5) in problem.limits
