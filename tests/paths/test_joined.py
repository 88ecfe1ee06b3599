"""Paths of several pieces, driven forward and backward."""

from __future__ import annotations

import numpy as np
import pytest

from trajopt import (
    Acceleration,
    Arc,
    ArgumentError,
    Clothoid,
    Path,
    Slip,
    Speed,
    Straight,
    Tip,
    WheelAcceleration,
    YawRate,
    limit_jerk,
    robot,
    time_scale,
)
from trajopt.limits.speed_bound import SpeedProfile
from trajopt.refine.profile import follow
from trajopt.timing.track import track
from trajopt.world.ramp import Ramp, Ramps

SPEEDS = [Speed(1.0), Acceleration(0.8, 0.8)]
HILL = Ramps((Ramp((0.5, -3.0), 0.3, 2.0, 0.3, 1.0, "smooth"),), 1.0)
AHEAD = [Clothoid(1.0, 0.0, 0.9), Arc(1 / 0.9, 0.4), Clothoid(1.0, 0.9, -0.3)]


def end_of(path):
    x, y, _ = path.position([path.end])[0]
    return float(x), float(y), float(path.yaw([path.end])[0])


def there_and_back():
    """A path, and the same curve driven back the other way."""
    ahead = Path.segments(AHEAD, start=(0.0, 0.0, 0.2))
    x, y, yaw = end_of(ahead)
    back = [Clothoid(1.0, 0.3, -0.9), Arc(1 / 0.9, -0.4), Clothoid(1.0, -0.9, 0.0)]
    return ahead, Path.segments(back, start=(x, y, yaw + np.pi)).backward()


def bent():
    """Splines that meet in a cusp."""
    ahead = Path.through(
        [[0.0, 0.0], [1.0, 0.1], [2.0, 0.6]], start_direction=[1, 0], end_direction=[0.8, 0.6]
    )
    back = Path.through(
        [[2.0, 0.6], [1.2, 0.2], [0.3, 0.4]], start_direction=[-0.8, -0.6], end_direction=[-1, 0]
    )
    return Path.join([ahead, back.backward()])


def test_pieces_keep_their_geometry():
    ahead, back = there_and_back()
    both = Path.join([ahead, back])
    assert both.length == pytest.approx(ahead.length + back.length, rel=1e-15)
    np.testing.assert_allclose(both.joints, [ahead.length])
    u = np.array([0.0, 0.7, 2.0])
    for order in range(4):
        np.testing.assert_array_equal(both.position(u, order), ahead.position(u, order))
        np.testing.assert_allclose(
            both.position(ahead.end + u, order), back.position(u, order), atol=1e-12
        )
    np.testing.assert_allclose(both.locate(both.parameter(ahead.end + u)), ahead.end + u)
    np.testing.assert_allclose(end_of(both), (0.0, 0.0, 0.2), atol=1e-12)
    np.testing.assert_array_equal(both.facing([0.0, ahead.end - 1e-9, ahead.end, both.end]),
                                  [1, 1, -1, -1])  # fmt: skip
    assert both.backward().facing([0.0, both.end]).tolist() == [-1, 1]


def test_knots_of_pieces_count_to_the_right():
    """Also where pieces are shifted by what doubles do not hold."""
    first = Path.through([[0.0, 0.0], [0.1, 0.0]])
    segments = [Straight(1 / 3), Arc(1.0, 0.7), Clothoid(0.2, 1.0, 0.0), Arc(3.0, 0.1)]
    path = Path.join([first, Path.segments(segments, start=(0.1, 0.0, 0.0))])
    np.testing.assert_allclose(path.jumps, [0.1 + 1 / 3, 0.1 + 1 / 3 + 0.9])
    knots = path.basis.knots
    place = [knots.index(u) for u in path.jumps.tolist()]
    curvature = path.yaw(np.array(knots), 1)
    np.testing.assert_allclose(curvature[place], [1.0, 1 / 3], rtol=1e-12)


@pytest.mark.parametrize(
    ("second", "words"),
    [
        (Path.through([[1.0, 0.5], [2.0, 0.0]]), r"pieces\[1\].*\(1, 0.5, 0\).*0.5 m away"),
        (Path.through([[1.0, 0.0], [0.0, 0.0]]), r"faces 3.14159265 rad.*backward"),
        (Path.through([[1.0, 0.0], [2.0, 0.0]], heading=[0, 0]), "kind of heading"),
        (Path.through([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), "points of 2"),
        (1.0, r"pieces\[1\]"),
    ],
)
def test_refuses_what_does_not_meet(second, words):
    with pytest.raises(ArgumentError, match=words):
        Path.join([Path.through([[0.0, 0.0], [1.0, 0.0]]), second])


def test_a_heading_of_its_own_is_not_driven_backward():
    path = Path.through([[0.0, 0.0], [1.0, 0.0]], heading=[0, 1])
    with pytest.raises(ArgumentError, match="faces"):
        path.backward()


def test_the_robot_rests_where_pieces_meet_and_turns_back():
    path = bent()
    trajectory = time_scale(path, [*SPEEDS, WheelAcceleration(30.0)], robot=robot("powerbot"))
    assert trajectory.gap < 1e-3
    assert min(trajectory.margins().values()) > -1e-9
    rest = trajectory.times[np.searchsorted(trajectory.u, path.joints[0])]
    assert np.abs(trajectory.at(rest).twist).max() < 1e-12
    t = np.linspace(0.0, trajectory.duration, 400)
    pose, h = trajectory.at(t).pose, 1e-6
    assert np.abs(np.diff(pose[:, 2])).max() < 0.05  # no jump of the heading
    t = t[(t > h) & (t < trajectory.duration - h) & (np.abs(t - rest) > h)]
    rate = (trajectory.at(t + h).pose - trajectory.at(t - h).pose) / (2 * h)
    state = trajectory.at(t)
    cos, sin = np.cos(state.pose[:, 2]), np.sin(state.pose[:, 2])
    ahead = cos * rate[:, 0] + sin * rate[:, 1]
    np.testing.assert_allclose(state.twist[:, 0], ahead, atol=1e-6)
    np.testing.assert_allclose(state.twist[:, 2], rate[:, 2], atol=1e-6)
    assert (ahead[t > rest] < 0).all()
    assert (ahead[t < rest] > 0).all()


@pytest.mark.parametrize("ground", [None, HILL], ids=["level", "hill"])
@pytest.mark.parametrize("name", ["car", "swerve"])
def test_a_way_back_takes_as_long_as_the_way_there(name, ground):
    """A motion run backwards in time is the same curve driven back: forces are the same."""
    ahead, back = there_and_back()
    limits = [Speed(1.5), Acceleration(1.2, 0.7), Slip(0.5), Tip(), YawRate(0.9)]
    turned = [Speed(1.5), Acceleration(0.7, 1.2), Slip(0.5), Tip(), YawRate(0.9)]
    there, again = (
        time_scale(path, rows, robot=robot(name), ground=ground)
        for path, rows in ((ahead, limits), (back, turned))
    )
    assert again.duration == pytest.approx(there.duration, rel=1e-5)
    margins = again.margins()
    for limit, margin in there.margins().items():
        assert margins[limit] == pytest.approx(margin, abs=2e-3)


def test_samples_of_a_robot_that_reverses_on_a_hill():
    """All of them by finite differences of its place and axes."""
    _, back = there_and_back()
    along = track(back, robot("car"), HILL)
    path, h = along.path, 1e-5
    s = np.linspace(0.3, path.length - 0.3, 7)

    def at(places):
        return along.samples(places, path.locate(places))

    here, before, after = at(s), at(s - h), at(s + h)
    axes = here.rotation
    velocity = (after.position - before.position) / (2 * h)
    local = np.einsum("nji,nj->ni", axes, velocity)
    np.testing.assert_allclose(here.velocity, local, atol=1e-7)
    assert (local[:, 0] < -0.9).all()
    spin = np.einsum("nji,njk->nik", axes, (after.rotation - before.rotation) / (2 * h))
    turning = np.column_stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]])
    np.testing.assert_allclose(here.turning, turning, atol=1e-7)
    for name in ("twist", "turning"):
        rate = (getattr(after, name) - getattr(before, name)) / (2 * h)
        np.testing.assert_allclose(getattr(here, f"{name}_rate"), rate, atol=1e-6)
    second = (after.position - 2 * here.position + before.position) / h**2
    bend = np.einsum("nji,nj->ni", axes, second)
    np.testing.assert_allclose(here.acceleration_rate, bend, atol=1e-4)


def test_free_headings_join_too():
    legs = [Path.through(p, heading=h) for p, h in (
        ([[0, 0], [1, 0]], [0.0, 0.5]), ([[1, 0], [1, 1]], [0.5, 0.5]))]  # fmt: skip
    trajectory = time_scale(Path.join(legs), SPEEDS, robot=robot("loc8"))
    pose = trajectory.at(np.linspace(0.0, trajectory.duration, 41)).pose
    np.testing.assert_allclose(pose[-1], [1.0, 1.0, 0.5], atol=1e-9)
    apart = [time_scale(leg, SPEEDS, robot=robot("loc8")).duration for leg in legs]
    assert trajectory.duration == pytest.approx(sum(apart), rel=1e-4)


def test_what_does_not_stop_on_the_way_refuses_pieces():
    path = bent()
    trajectory = time_scale(path, SPEEDS)
    with pytest.raises(ArgumentError, match="does not stop"):
        limit_jerk(trajectory, 1.0)
    with pytest.raises(ArgumentError, match="several pieces"):
        follow(path, SpeedProfile((0.0,), (0.5,)), SPEEDS, manner="least_squares")
    with pytest.raises(ArgumentError, match="one piece"):
        time_scale(path, SPEEDS, engine="linear")


@pytest.mark.parametrize("engine", ["toppra", "segments"])
def test_engines_of_first_order_stop_too(engine):
    trajectory = time_scale(bent(), SPEEDS, engine=engine)
    assert trajectory.sd[np.searchsorted(trajectory.u, bent().joints[0])] == 0.0
