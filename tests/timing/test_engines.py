"""Engines against each other and against a convex solver, on the same rows."""

from __future__ import annotations

import numpy as np
import pytest
from scaling_cases import PATHS, ROBOTS, limit, random_limits, random_path

from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.paths.samples import sample_path
from trajopt.timing.compiled import compiled_profile, controllable_sets, fastest_profiles
from trajopt.timing.scaling import time_scale
from trajopt.timing.stages import Stages, assemble
from trajopt.timing.toppra import toppra_profile

CASES, BATCH = 500, 50  # random paths and limit sets, and how many a test


def duration(stages: Stages, sd2: np.ndarray) -> float:
    sd = np.sqrt(sd2)
    return float(np.sum(2 * np.diff(stages.s) / (sd[:-1] + sd[1:])))


def outcome(engine, *arguments):
    """The profile, or limit and place of the error."""
    try:
        return engine(*arguments)
    except InfeasibleError as error:
        return error.limit, error.place


def random_stages(seed: int, points: int) -> tuple[Stages, float, float]:
    rng = np.random.default_rng(seed)
    free = bool(rng.random() < 0.5)
    path = random_path(rng, free_heading=free, knots=int(rng.integers(3, 7)))
    robot = ROBOTS["loc8" if free or rng.random() < 0.3 else "rear_cog"]
    s = np.linspace(0, path.length, points)
    stages = assemble(sample_path(path, s), random_limits(rng), robot)
    start, end = rng.choice([0.0, 0.2], 2) * np.sqrt(stages.sd2_max[[0, -1]])
    return stages, float(start**2), float(end**2)


@pytest.mark.parametrize("first", range(0, CASES, BATCH))
def test_compiled_is_toppra_on_random_paths_and_limits(first):
    infeasible = 0
    for seed in range(first, first + BATCH):
        stages, start, end = random_stages(seed, points=60)
        ours, theirs = (
            outcome(compiled_profile, stages, start, end),
            outcome(toppra_profile, stages, start, end),
        )
        if isinstance(ours, tuple):
            infeasible += 1
            assert ours == theirs, seed
            continue
        assert duration(stages, ours) == pytest.approx(duration(stages, theirs), rel=1e-6), seed
        np.testing.assert_allclose(
            ours, theirs, atol=1e-5 * max(1.0, ours.max()), err_msg=str(seed)
        )
    assert infeasible < BATCH // 5


def clarabel_profile(stages: Stages, start: float, end: float) -> np.ndarray:
    """min sum 4 d / (sd_i + sd_(i+1)) over x = s'^2 with the interval rows, as second-order cones.

    Variables x, r <= sqrt(x), t >= 1/(r_i + r_(i+1)): minimise sum 2 d t.
    """
    import clarabel
    from scipy import sparse

    n, m = len(stages.s), len(stages.s) - 1
    d = np.diff(stages.s)
    size = 2 * n + m
    blocks, right = [], []
    ends = sparse.csc_matrix((np.ones(2), ([0, 1], [0, n - 1])), shape=(2, size))
    for side in (
        0,
        1,
    ):  # rows at the left and right end of each interval, s'' = (x_(i+1) - x_i)/(2 d)
        a, b, c = (v[side : m + side] for v in (stages.a, stages.b, stages.c))
        for r in range(a.shape[1]):
            here, there = -a[:, r] / (2 * d), a[:, r] / (2 * d)
            here, there = (here + b[:, r], there) if side == 0 else (here, there + b[:, r])
            i = np.arange(m)
            blocks.append(
                sparse.csc_matrix(
                    (np.concatenate([here, there]), (np.tile(i, 2), np.concatenate([i, i + 1]))),
                    shape=(m, size),
                )
            )
            right.append(c[:, r])
    blocks.append(sparse.hstack([sparse.eye(n), sparse.csc_matrix((n, n + m))]).tocsc())
    right.append(np.minimum(stages.sd2_max, 1e4))
    cones, inequality = [], sum(len(v) for v in right)
    cone_rows, cone_right = [], []
    for i in range(n):  # r^2 <= x: (x + 1, x - 1, 2 r)
        cone_rows += [[(i, -1.0)], [(i, -1.0)], [(n + i, -2.0)]]
        cone_right += [1.0, -1.0, 0.0]
    for i in range(m):  # 1 <= t (r_i + r_(i+1)): (t + q, t - q, 2)
        q = [(n + i, -1.0), (n + i + 1, -1.0)]
        cone_rows += [[(2 * n + i, -1.0), *q], [(2 * n + i, -1.0), *[(k, -v) for k, v in q]], []]
        cone_right += [0.0, 0.0, 2.0]
    entries = [(row, k, v) for row, items in enumerate(cone_rows) for k, v in items]
    rows, columns, values = zip(*entries, strict=True)
    blocks.append(sparse.csc_matrix((values, (rows, columns)), shape=(len(cone_rows), size)))
    matrix = sparse.vstack([ends, *blocks]).tocsc()
    offsets = np.concatenate([[start, end], *right, cone_right])
    cones = [
        clarabel.ZeroConeT(2),
        clarabel.NonnegativeConeT(inequality),
        *[clarabel.SecondOrderConeT(3) for _ in range(n + m)],
    ]
    cost = np.concatenate([np.zeros(2 * n), 2 * d])
    options = clarabel.DefaultSettings()
    options.verbose = False
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix((size, size)), cost, matrix, offsets, cones, options
    )
    return np.array(solver.solve().x)[:n]


@pytest.mark.parametrize("seed", [0, 7, 21, 33])
def test_compiled_is_the_convex_optimum(seed):
    stages, start, end = random_stages(seed, points=200)
    expected = np.maximum(clarabel_profile(stages, start, end), 0.0)
    ours = compiled_profile(stages, start, end)
    assert duration(stages, ours) == pytest.approx(duration(stages, expected), rel=1e-3)
    np.testing.assert_allclose(ours, expected, atol=1e-3 * ours.max())


def test_a_batch_is_its_members_and_marks_the_impossible_ones():
    limits, robot = random_limits(np.random.default_rng(5)), ROBOTS["loc8"]
    members = []
    for seed in range(6):
        path = random_path(np.random.default_rng(seed), free_heading=True, knots=4)
        members.append(assemble(sample_path(path, np.linspace(0, path.length, 80)), limits, robot))
    start = np.zeros(6)
    start[4] = 1e4  # nothing brakes from 100 m/s
    s, a, b, c, top = (
        np.stack([getattr(m, f) for m in members]) for f in ("s", "a", "b", "c", "sd2_max")
    )
    sd2, failed = fastest_profiles(s, a, b, c, top, start, np.zeros(6))
    for k, member in enumerate(members):
        if k == 4:
            assert failed[k] == 0
            assert np.isnan(sd2[k]).all()
        else:
            assert failed[k] == -1
            np.testing.assert_allclose(sd2[k], compiled_profile(member, 0.0, 0.0), rtol=1e-12)
    with pytest.raises(ArgumentError):
        fastest_profiles(s, a[:, :-1], b, c, top, start, np.zeros(6))


def test_controllable_sets_tell_the_highest_start_speed():
    limits = [limit("speed", largest=9.0), limit("acceleration", forward=1.0, braking=0.5)]
    path = PATHS["straight"]
    stages = assemble(sample_path(path, np.linspace(0, 2, 50)), limits, None)
    sets = controllable_sets(stages, 0.0, 0.0)
    np.testing.assert_allclose(sets[:, 1], 2 * 0.5 * (2 - stages.s), atol=1e-12)
    np.testing.assert_allclose(sets[:, 0], 0.0)


def test_engines_agree_through_time_scale():
    """toppra holds s'' constant between gridpoints, which costs up to some 1e-3; none is faster
    than the bound."""
    limits = [limit(n) for n in ("speed", "acceleration", "wheel_acceleration", "slip", "tip")]
    for shape in ("slalom", "hairpin", "ramp"):
        best = time_scale(PATHS[shape], limits, robot=ROBOTS["rear_cog"])
        theirs = time_scale(PATHS[shape], limits, robot=ROBOTS["rear_cog"], engine="toppra")
        assert best.gap <= 1e-3
        assert best.bound <= best.duration
        assert best.duration <= theirs.duration * (1 + 1e-4)
        assert theirs.duration == pytest.approx(best.duration, rel=2e-3)
        assert theirs.duration >= best.bound * (1 - 5e-5)


def test_gridpoints_may_stand_at_one_place():
    """As where a curvature jumps: both have the same speed."""
    s = np.array([[0.0, 0.5, 0.5, 1.0]])
    rows = np.broadcast_to(np.array([1.0, -1.0]), (1, 4, 2))
    zero, one = np.zeros((1, 4, 2)), np.ones((1, 4, 2))
    sd2, failed = fastest_profiles(
        s, rows, zero, one, np.full((1, 4), 10.0), np.zeros(1), np.zeros(1)
    )
    assert failed[0] == -1
    np.testing.assert_allclose(sd2[0], [0.0, 1.0, 1.0, 0.0], atol=1e-9)
