"""Geometric constraints of [udengaard2008], sections 3.1, 3.4 and 3.5."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.theses.asoc_study import wheel_frame, workspaces_clear
from benchmarks.theses.asoc_suspension import (
    POINT_DESIGN,
    POINT_TRAVEL,
    FourBar,
    Linkage,
    step_travel,
    suspension_travel,
)
from trajopt.errors import ArgumentError
from trajopt.systems.asoc.modules import (
    AsocGeometry,
    largest_pivot,
    wheel_positions,
    workspace_radius,
)


def test_workspace_circle_holds_every_point_of_the_wheels() -> None:
    """Eq. 5 from sampled wheels: the furthest tyre point, seen from above, at any module angle."""
    geometry = AsocGeometry(4, 0.21, 0.10, 0.16, 0.04)
    rng = np.random.default_rng(0)
    furthest = 0.0
    for alpha in rng.uniform(-np.pi, np.pi, 50):
        centres = wheel_positions(geometry, np.full(4, alpha))[0]
        ahead, left = (
            np.array([np.cos(alpha), np.sin(alpha)]),
            np.array([-np.sin(alpha), np.cos(alpha)]),
        )
        for centre, side in zip(centres, (-1, 1), strict=True):
            corners = [
                centre + s * 0.16 * ahead + side * w * left for s in (-1, 1) for w in (0.0, 0.04)
            ]
            furthest = max(
                furthest, *(float(np.linalg.norm(c - geometry.positions[0])) for c in corners)
            )
    assert workspace_radius(geometry) == pytest.approx(furthest, rel=1e-12)


def test_circles_touch_exactly_at_twice_the_radius() -> None:
    free = AsocGeometry(4, 0.2, 0.1, 0.15, 0.03)
    touching = 2 * workspace_radius(free) / (2 * np.sin(np.pi / 4))
    assert workspaces_clear(AsocGeometry(4, 0.2, 0.1, 0.15, 0.03, touching * 1.0001))
    assert not workspaces_clear(AsocGeometry(4, 0.2, 0.1, 0.15, 0.03, touching * 0.9999))


def test_equation_8_and_the_point_design() -> None:
    assert np.degrees(largest_pivot(0.10, 0.20, 0.20)) == pytest.approx(30.0, abs=1e-9)
    assert np.degrees(largest_pivot(0.10, 0.21, 0.163)) == pytest.approx(
        39.2, abs=0.05
    )  # printed: 30
    assert largest_pivot(0.2, 0.2, 0.15) == pytest.approx(np.pi / 2)


def test_at_the_largest_pivot_the_rim_meets_the_shaft() -> None:
    """In the tilted axle frame, the rim point above the shaft's line lies on the module's vertical
    axis."""
    geometry = AsocGeometry(3, 0.24, 0.11, 0.15)
    beta = float(largest_pivot(0.11, 0.24, 0.15))
    frame = wheel_frame(geometry, 0, 1, 0.0, beta)
    effective = np.sqrt(0.15**2 - 0.11**2)
    gaps = [
        np.linalg.norm((frame @ [0.0, side * effective, -0.11, 1.0])[:2] - geometry.positions[0])
        for side in (-1, 1)
    ]
    assert min(gaps) == pytest.approx(0.0, abs=1e-9)


def test_shaped_bars_lift_further_and_the_split_ones_drop_further() -> None:
    bars, geometry = FourBar(), POINT_DESIGN
    straight, shaped, split = (suspension_travel(kind, bars, geometry) for kind in Linkage)
    assert (straight.up_end, shaped.down_end) == ("wheel", "bars")
    assert straight.up < shaped.up <= split.up  # Figure 19
    assert shaped.down < straight.down <= split.down  # Figure 20
    assert split.total >= POINT_TRAVEL


def test_travel_grows_with_clearance_and_ends_where_a_gap_closes() -> None:
    travels = [
        suspension_travel(Linkage.STRAIGHT, FourBar(clearance=c), POINT_DESIGN).up
        for c in (0.02, 0.04, 0.08)
    ]
    assert travels == sorted(travels)
    assert travels[0] < travels[-1]
    angle = np.arcsin(travels[1] / FourBar().length)
    reach = workspace_radius(POINT_DESIGN)
    assert 0.04 - reach * np.tan(angle) - 0.01 / np.cos(angle) == pytest.approx(0.0, abs=1e-9)


def test_rule_for_steps() -> None:
    assert step_travel(0.3, 0.15) == pytest.approx(0.2)
    assert step_travel(0.05, 0.15) == 0.0


@pytest.mark.parametrize(
    "call",
    [
        lambda: FourBar(length=-1.0),
        lambda: FourBar(arch=np.nan),
        lambda: FourBar(spacing=0.01),
        lambda: step_travel(-1.0, 0.1),
    ],
)
def test_bad_input_is_refused(call) -> None:
    with pytest.raises(ArgumentError):
        call()
