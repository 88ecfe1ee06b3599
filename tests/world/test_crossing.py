"""Where an outline meets what stands on the ground, in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from trajopt.paths.path import Path
from trajopt.world.crossing import SPACING, Standing, crossings, outlines_at
from trajopt.world.obstacles import Circle, Obstacle, Polygon, Step, Wall

OUTLINE = (
    (0.5, 0.2),
    (-0.3, 0.2),
    (-0.3, -0.2),
    (0.5, -0.2),
)  # front 0.5, rear 0.3, half width 0.2
STEP = Step("step", 0.1, (2.0, 0.0), 0.0, 2.0, 1.0)
STRAIGHT = Path.through([[0.0, 0.0], [1.0, 0.0], [1.8, 0.0]])


def test_a_step_is_met_by_the_front_and_left_by_nothing() -> None:
    (found,) = crossings(STRAIGHT, OUTLINE, [STEP])
    assert found.obstacle == "step"
    assert found.start == pytest.approx(1.5, abs=SPACING)
    assert found.end == pytest.approx(1.8)
    assert found.depth == pytest.approx(0.3, abs=1e-9)
    assert "from s = 1.50" in str(found)


def test_depth_is_to_the_nearest_side() -> None:
    narrow = Step("step", 0.1, (2.0, 0.0), 0.0, 0.5, 1.0)
    (found,) = crossings(STRAIGHT, OUTLINE, [narrow])
    assert found.depth == pytest.approx(0.05, abs=1e-9)


@pytest.mark.parametrize(
    ("thing", "places"),
    [
        (Circle("post", 1.0, (1.0, 0.3), 0.15), (0.5 - 0.1118, 1.3 + 0.1118)),
        (Circle("post", 1.0, (1.0, -0.3), 0.15), (0.5 - 0.1118, 1.3 + 0.1118)),
        (Wall("wall", 1.0, (1.0, 0.1), (1.0, 2.0), 0.1), (0.45, 1.35)),
        (Polygon("box", 1.0, ((0.9, 0.1), (1.1, 0.1), (1.1, 0.5), (0.9, 0.5))), (0.4, 1.4)),
    ],
)
def test_outlines_pass_between_first_and_last_touch(
    thing: Obstacle, places: tuple[float, float]
) -> None:
    (found,) = crossings(STRAIGHT, OUTLINE, [thing])
    assert (found.start, found.end) == pytest.approx(places, abs=2 * SPACING)


@pytest.mark.parametrize(
    "thing",
    [
        Circle("post", 1.0, (1.0, 0.4), 0.1),
        Wall("wall", 1.0, (0.0, -0.5), (2.0, -0.5), 0.1),
        Step("step", 0.1, (2.3, 0.0), 0.0, 2.0, 1.0),  # touched at the end: no crossing
        Step("step", 0.1, (-0.3, 0.0), np.pi, 2.0, 1.0),  # touched at the start, from before it
    ],
)
def test_near_is_not_crossed(thing: Obstacle) -> None:
    assert crossings(STRAIGHT, OUTLINE, [thing]) == ()


def test_every_stretch_is_told() -> None:
    posts = [Circle(name, 1.0, (x, 0.0), 0.05) for name, x in (("a", 0.7), ("b", 1.9))]
    found = crossings(STRAIGHT, OUTLINE, posts)
    assert [c.obstacle for c in found] == ["a", "b"]
    assert found[0].depth == pytest.approx(0.2, abs=0.01)  # inside the outline, from its sides
    back = Path.through([[0, 0], [2, 0], [2, 2], [0, 2]])
    wall = Wall("wall", 1.0, (1.0, -1.0), (1.0, 3.0), 0.1)
    assert len(crossings(back, OUTLINE, [wall])) == 2


def test_outlines_turn_with_the_robot() -> None:
    (corners,) = outlines_at(np.array([[1.0, 2.0]]), np.array([np.pi / 2]), OUTLINE)
    assert corners == pytest.approx(np.array([[0.8, 2.5], [0.8, 1.7], [1.2, 1.7], [1.2, 2.5]]))


def test_margin_is_the_distance_or_minus_the_depth() -> None:
    ground = Standing(OUTLINE, (Step("step", 0.1, (2.0, 0.0), 0.0, 9.0, 9.0),))
    x = np.array([[1.0, 1.47], [1.6, 1.8]])
    found = ground.margin(x, np.zeros_like(x), np.zeros_like(x))
    assert found[0, 0] == pytest.approx(1.0 - np.hypot(0.5, 0.2))  # beyond reach: a lower bound
    assert found.ravel()[1:] == pytest.approx([0.03, -0.1, -0.3])
    turned = ground.margin(np.array([1.7]), np.zeros(1), np.array([np.pi / 2]))
    assert turned == pytest.approx([0.1])
