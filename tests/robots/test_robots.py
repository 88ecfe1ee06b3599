"""Shipped robots: rolling against finite differences, mobility, derived outline and inertia, checks
and the command."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks.theses.textbook import TEXTBOOK, planar, wheel
from trajopt.cli import app
from trajopt.errors import ArgumentError, InfeasibleError, ProblemError
from trajopt.robots import Robot, robot, robot_names
from trajopt.robots.checks import findings, support_margin, top_speed
from trajopt.robots.mobility import (
    admissible_at,
    generic_steering,
    inverse_at,
    mobility_of,
    steering_rates,
)
from trajopt.systems.asoc.modules import AsocGeometry, asoc_robot

STEP = 1e-6  # s, of the finite differences
DEGREES = {
    "asoc-3": (3, 0, 3),
    "asoc-4": (3, 0, 3),
    "car": (1, 1, 2),
    "loc8": (3, 0, 3),
    "loc8-smdw": (3, 0, 3),
    "omni-3": (3, 0, 3),
    "powerbot": (2, 0, 2),
    "small-differential": (2, 0, 2),
    "swerve": (1, 2, 3),
    "tricycle": (1, 1, 2),
}


@pytest.mark.parametrize("name", robot_names())
def test_degrees_of_mobility(name: str) -> None:
    found = mobility_of(robot(name))
    assert (found.mobility, found.steerability, found.manoeuvrability) == DEGREES[name]


def contact_speed(found: Robot, index: int, twist: np.ndarray, angle: float, rate: float) -> Any:
    """Velocity (2,) of a wheel's axle over the ground along and across its rolling direction, from
    the places of the file alone: the body moves by ``twist``, the wheel is turned by ``angle`` from
    the file's direction and turns on at ``rate``."""
    section = found.rolling[index]

    def place(t: float) -> np.ndarray:
        heading = section.angle + angle + rate * t
        ahead = np.array([math.cos(heading), math.sin(heading)])
        left = np.array([-math.sin(heading), math.cos(heading)])
        centre = np.array(section.position) - section.trail * ahead + section.lateral * left
        cos, sin = math.cos(twist[2] * t), math.sin(twist[2] * t)
        return twist[:2] * t + np.array([[cos, -sin], [sin, cos]]) @ centre

    velocity = (place(STEP) - place(-STEP)) / (2 * STEP)
    heading = section.angle + angle
    return np.array(
        [
            math.cos(heading) * velocity[0] + math.sin(heading) * velocity[1],
            -math.sin(heading) * velocity[0] + math.cos(heading) * velocity[1],
        ]
    )


@pytest.mark.parametrize("name", robot_names())
def test_every_wheel_rolls_as_its_place_in_the_file_moves(name: str) -> None:
    """At angles that the motion needs, the tyre stands still on the ground: along the roller's axis
    of a Swedish wheel, in both directions of the others, whose castors turn as they must."""
    found = robot(name)
    angles = generic_steering(found)
    castors = np.array([w.kind == "castor" for w in found.rolling])
    angles = (
        angles + castors * np.repeat(np.linspace(0.3, -0.8, len(angles) // 2 + 1), 2)[: len(angles)]
    )
    allowed = admissible_at(found, angles)
    twist = allowed @ np.array([0.7, -0.4, 0.9])[: allowed.shape[1]]
    spins = inverse_at(found, angles) @ twist
    rates = steering_rates(found, angles, twist)
    for i, section in enumerate(found.rolling):
        turned = float(angles[i] - found.wheels[i].beta)
        along, across = contact_speed(found, i, twist, turned, float(rates[i]))
        slip = np.array([along - section.radius * spins[i], across])
        if section.rollers is not None:
            axis = [math.cos(section.rollers.angle), math.sin(section.rollers.angle)]
            assert slip @ axis == pytest.approx(0.0, abs=1e-8)
        else:
            np.testing.assert_allclose(slip, 0.0, atol=1e-8)


@pytest.mark.parametrize("name", ["asoc-3", "asoc-4"])
def test_shipped_split_casters_are_those_of_the_geometry(name: str) -> None:
    shipped = robot(name)
    made = asoc_robot(AsocGeometry(modules=len(shipped.description.pivots)))
    np.testing.assert_allclose(made.inverse, shipped.inverse, atol=1e-12)
    np.testing.assert_allclose(made.body.contacts, shipped.body.contacts, atol=1e-12)
    np.testing.assert_allclose(made.footprint, shipped.footprint, atol=1e-6)
    assert made.body.yaw_inertia == pytest.approx(shipped.body.yaw_inertia)

    def rest(one: Robot) -> dict[str, Any]:
        tables = one.description.model_dump()
        del tables["body"]["footprint"], tables["about"]
        for section in tables["wheels"]:
            section["position"] = tuple(round(v, 12) for v in section["position"])
        return tables

    mine, theirs = rest(made), rest(shipped)
    for pivot in (*mine["pivots"], *theirs["pivots"]):
        pivot["tilt_range"] = round(pivot["tilt_range"], 3)
    assert mine == theirs


def skid(**changes: Any) -> Robot:
    places = [(x, y) for x in (0.2, -0.2) for y in (0.25, -0.25)]
    wheels = (wheel("fixed", x, y) for x, y in places)
    return planar("skid", *wheels, skid={"effective_track": 0.8, **changes})


def test_skid_steering_is_a_differential_drive_of_its_effective_track() -> None:
    found = skid()
    v, w = 0.6, 0.9
    left, right = (v - 0.4 * w) / 0.1, (v + 0.4 * w) / 0.1
    np.testing.assert_allclose(found.inverse @ [v, 0.0, w], [left, right, left, right])
    np.testing.assert_allclose(found.forward @ [left, right, left, right], [v, 0.0, w], atol=1e-12)
    np.testing.assert_allclose(inverse_at(found, np.zeros(4)), found.inverse)
    assert (mobility_of(found).mobility, mobility_of(found).steerability) == (2, 0)
    assert not found.holonomic
    found.require_rolling(np.array([[v, 0.0, w]]), np.zeros(1))
    with pytest.raises(InfeasibleError, match="direction of travel"):
        found.require_rolling(np.array([[v, 0.1, w]]), np.zeros(1))


@pytest.mark.parametrize(
    ("found", "twist", "words"),
    [
        (skid().replace({"skid": None}), [0.5, 0.0, 0.3], r"give \[skid\] with an effective track"),
        (robot("car"), [0.5, 0.2, 0.3], "leave its heading to the direction of travel"),
        (robot("powerbot"), [0.5, 0.2, 0.0], "leave its heading to the direction of travel"),
    ],
    ids=["skid", "car", "powerbot"],
)
def test_motions_that_wheels_forbid_are_refused_with_place_and_reason(
    found: Robot, twist: list[float], words: str
) -> None:
    straight = [0.5, 0.0, 0.0]
    found.require_rolling(np.array([straight]), np.zeros(1))
    with pytest.raises(InfeasibleError, match=words) as caught:
        found.require_rolling(np.array([straight, twist]), np.array([0.0, 1.5]))
    assert caught.value.place == 1.5


def test_outline_and_yaw_inertia_that_are_not_given_follow_from_sizes_and_masses() -> None:
    loc8 = robot("loc8")
    plate = 14.5 * (0.6**2 + 0.4**2) / 12
    assert loc8.body.yaw_inertia == pytest.approx(plate + 4 * 1.44 * (0.376**2 + 0.316**2))
    x, y = 0.376 + 0.098, 0.316 + 0.043 / 2
    np.testing.assert_allclose(loc8.footprint, [(x, y), (-x, y), (-x, -y), (x, -y)])
    # beside the axle: Steiner's rule about the centre of gravity, castors at their contacts
    drive = robot("small-differential").replace({"body.footprint": None})
    parts = [(1.0, 0.0, 0.165), (1.0, 0.0, -0.165), (0.2, -0.21, 0.0), (6.8, -0.045, 0.0)]
    inertia = 6.8 * (0.42**2 + 0.28**2) / 12
    inertia += sum(m * ((x + 0.04) ** 2 + y**2) for m, x, y in parts)
    assert drive.body.yaw_inertia == pytest.approx(inertia)
    reach = 0.18 + math.hypot(0.03 + 0.0375, 0.01)  # of the castor, whichever way it swings
    assert min(x for x, _ in drive.footprint) == pytest.approx(-max(reach, 0.045 + 0.21))
    assert max(y for _, y in drive.footprint) == pytest.approx(0.165 + 0.0474 / 2)
    # a steered wheel at full lock, and one that turns all round
    car = robot("car", {"body.footprint": None})
    lock = 0.114 + 0.05 * math.sin(0.4189) + 0.0225 * math.cos(0.4189)
    assert max(y for _, y in car.footprint) == pytest.approx(lock)
    free = car.replace({"steering.front.range": None})
    assert max(y for _, y in free.footprint) == pytest.approx(0.114 + math.hypot(0.05, 0.0225))


def test_support_of_the_centre_of_gravity_whichever_way_castors_point() -> None:
    assert support_margin(robot("powerbot")) == pytest.approx(0.132)  # the drive axle
    behind = robot("powerbot", {"body.cog": [-0.3, 0.0, 0.2]})
    assert support_margin(behind) == pytest.approx(0.27 - 0.3)  # castors leading: -0.31 + 0.04
    assert support_margin(robot("loc8")) == pytest.approx(0.316)
    aside = robot("small-differential", {"body.cog": [-0.1, 0.05, 0.1]})
    nearest = (0.165 * (0.15 - 0.1) - 0.05 * 0.15) / math.hypot(0.15, 0.165)  # castor leading
    assert support_margin(aside) == pytest.approx(nearest)


@pytest.mark.parametrize(
    ("found", "about", "words"),
    [
        (TEXTBOOK["bicycle"], "stand", "2 contacts"),
        (planar("line", *(wheel("fixed", x, 0.0) for x in (0.3, 0.0, -0.3))), "stand", "one line"),
        (robot("loc8", {"body.cog": [0.5, 0.0, 0.1]}), "stand", "0.124 m outside"),
        (robot("powerbot", {"wheels.left.position": [0.0, 0.5]}), "outline", "left reaches"),
        (robot("car", {"steering.front.range": [-0.6, 0.6]}), "outline", "front-left reaches"),
        (robot("loc8", {"wheels.all.rollers.count": 8}), "rollers", "front-left: 8 around it"),
        (skid().replace({"skid": None}), "motion", "give [skid]"),
        (robot("loc8", {"motors": []}), "motors", "motors rule 0 of 3 free motions"),
        (
            robot("powerbot", {"motors": [{"name": "one", "wheels": ["left"], "torque": 3.0}]}),
            "motors",
            "motors rule 1 of 2",
        ),
    ],
)
def test_faults_are_found(found: Robot, about: str, words: str) -> None:
    faults = [finding for finding in findings(found) if finding.fault]
    assert any(fault.about == about and words in fault.text for fault in faults), faults


@pytest.mark.parametrize("name", robot_names())
def test_shipped_robots_are_without_fault(name: str) -> None:
    assert not [finding for finding in findings(robot(name)) if finding.fault]


def test_notes_say_what_follows_from_the_file() -> None:
    notes = {note.about: note.text for note in findings(robot("loc8"))}
    assert "2.018 kg m^2" in notes["yaw inertia"]
    assert "0.948 x 0.675 m" in notes["outline"]
    assert "4 driven wheels for 3 free motions" in notes["motors"]
    given = [note.about for note in findings(robot("powerbot"))]
    assert "yaw inertia" not in given
    assert "outline" not in given


def test_top_speed_is_that_of_the_first_motor_at_its_limit() -> None:
    assert top_speed(robot("car")) == pytest.approx(146.0 * 0.05)
    assert top_speed(robot("omni-3")) == pytest.approx(25.0 * 0.04 / math.cos(math.pi / 6))
    assert top_speed(robot("powerbot")) == math.inf
    assert top_speed(robot("loc8", {"motors.front-left.speed": 10.0})) == pytest.approx(0.98)


def run(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["robot", *arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.output


def test_command_lists_describes_changes_and_draws(tmp_path: Path) -> None:
    code, text = run()
    assert code == 0
    assert all(name in text for name in robot_names())
    code, text = run("swerve", "--out", str(tmp_path / "sub" / "top.png"))
    assert code == 0
    assert "mobility 1, steerability 2, manoeuvrability 3" in text
    assert (tmp_path / "sub" / "top.png").stat().st_size > 5000
    mine = tmp_path / "mine.toml"
    source = Path(robot("car").description.source)
    mine.write_text(source.read_text(encoding="utf-8"), encoding="utf-8")
    code, text = run(str(mine), "--set", "body.cog=[0.5, 0.0, 0.1]")
    assert code == 1
    assert "fault" in text
    with pytest.raises(ProblemError, match=r"mine\.toml: body\.weight"):
        run(str(mine), "--set", "body.weight=3")
    with pytest.raises(ArgumentError, match="for --set, --out and --wheels"):
        run("--set", "body.mass=3.0")
    with pytest.raises(ArgumentError, match=r"ends in \.png"):
        run("car", "--out", str(tmp_path / "top.gif"))


def test_loc8_is_one_robot_on_two_kinds_of_wheels() -> None:
    """Body, places, radii and masses of wheels and drives are the same in both files."""
    mecanum, double = robot("loc8").description, robot("loc8-smdw").description
    assert mecanum.body == double.body
    assert [(w.name, w.position, w.radius, w.mass) for w in mecanum.wheels] == [
        (w.name, w.position, w.radius, w.mass) for w in double.wheels
    ]
    assert mecanum.motors == double.motors
    assert robot("loc8").yaw_inertia == robot("loc8-smdw").yaw_inertia
