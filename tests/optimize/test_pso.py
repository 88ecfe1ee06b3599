"""The swarm: rules, topologies, saved state, compiled iteration, boundary rules."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.optimize import swarm as swarm_module
from trajopt.optimize.base import Budget, Status
from trajopt.optimize.pso import (
    ParticleSwarm,
    constriction,
    falling_inertia,
    local_best,
    ring,
    thesis_enhanced,
    thesis_first,
)
from trajopt.optimize.search import minimize
from trajopt.optimize.swarm import Swarm

BOX = np.array([[-4.0, 5.0], [-3.0, 6.0], [-1.0, 2.0]])
OPTIONS = [
    constriction(),
    ring(),
    falling_inertia(),
    thesis_first(),
    thesis_enhanced(),
    ParticleSwarm(boundary="absorb", start="sobol"),
    local_best(),
    ParticleSwarm(boundary="mirror"),
    ParticleSwarm(boundary="invisible", velocity_limit=0.2),
]


def rastrigin(x: Array) -> Array:
    return np.asarray(10.0 * x.shape[1] + (x * x - 10.0 * np.cos(2.0 * np.pi * x)).sum(axis=1))


def constrained(x: Array) -> tuple[Array, Array]:
    return rastrigin(x), np.maximum(1.0 - x[:, 0], 0.0)


def run(swarm: Swarm, iterations: int) -> Swarm:
    for _ in range(iterations):
        swarm.tell(*constrained(swarm.ask()))
    return swarm


def same_bits(a: Swarm, b: Swarm) -> bool:
    names = ("x", "v", "own", "own_cost", "own_violation")
    return (
        all(getattr(a, n).tobytes() == getattr(b, n).tobytes() for n in names) and a.idle == b.idle
    )


@settings(max_examples=40, deadline=None)
@given(
    before=st.integers(0, 12),
    after=st.integers(0, 12),
    seed=st.integers(0, 1000),
    option=st.sampled_from(range(len(OPTIONS))),
    kind=st.sampled_from(["PCG64", "Philox", "MT19937", "SFC64"]),
)
def test_saved_and_resumed_at_any_iteration_gives_the_same_bits(
    before: int,
    after: int,
    seed: int,
    option: int,
    kind: str,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    path = tmp_path_factory.mktemp("swarm") / "state.npz"
    options = replace(OPTIONS[option], particles=12)

    def fresh() -> Swarm:
        return options.swarm(BOX, np.random.Generator(getattr(np.random, kind)(seed)))

    whole = run(fresh(), before + after)
    part = run(fresh(), before)
    part.save(path)
    assert same_bits(run(Swarm.load(path), after), whole)


@pytest.mark.parametrize("options", OPTIONS)
def test_compiled_iteration_gives_the_bits_of_the_readable_one(
    options: ParticleSwarm, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("numba")
    compiled = run(options.swarm(BOX, np.random.default_rng(4)), 60)
    monkeypatch.setattr(swarm_module, "_kernel", lambda: None)
    readable = run(options.swarm(BOX, np.random.default_rng(4)), 60)
    assert compiled._kernel is not None
    assert readable._kernel is None
    assert same_bits(compiled, readable)


def test_one_iteration_is_the_documented_update() -> None:
    options = ParticleSwarm(particles=5, boundary="none")
    swarm = options.swarm(BOX, np.random.default_rng(1))
    rng = np.random.default_rng(1)
    x = BOX[:, 0] + (BOX[:, 1] - BOX[:, 0]) * rng.random((5, 3))
    v, own, own_cost = np.zeros((5, 3)), x.copy(), np.full(5, np.inf)
    for _ in range(4):
        assert np.array_equal(swarm.ask(), x)
        cost = rastrigin(x)
        swarm.tell(cost)
        better = cost < own_cost
        own[better], own_cost[better] = x[better], cost[better]
        r = rng.random((2, 5, 3))
        leader = own[np.argmin(own_cost)]
        v = (
            options.inertia * v
            + options.cognitive * r[0] * (own - x)
            + options.social * r[1] * (leader - x)
        )
        x = x + v
        np.testing.assert_allclose(swarm.x, x, rtol=1e-13, atol=1e-13)
        x = swarm.x.copy()


def test_ring_leaders_are_the_best_of_three_neighbours() -> None:
    swarm = replace(ring(), particles=6).swarm(BOX, np.random.default_rng(0))
    swarm.own_cost[:] = [5.0, 1.0, 4.0, 2.0, 9.0, 8.0]
    swarm.own_violation[:] = [0.0, 1.0, 0.0, 0.0, 0.0, 2.0]  # particles 1 and 5 are infeasible
    assert swarm._ring_leaders().tolist() == [0, 2, 3, 3, 3, 0]


@pytest.mark.parametrize("boundary", ["reset", "reflect", "mirror", "absorb"])
def test_boundary_rules_keep_candidates_inside(boundary: str) -> None:
    swarm = ParticleSwarm(boundary=boundary, inertia=1.1).swarm(BOX, np.random.default_rng(2))  # type: ignore[arg-type]
    for _ in range(50):
        x = swarm.ask()
        assert np.all(x >= BOX[:, 0])
        assert np.all(x <= BOX[:, 1])
        swarm.tell(rastrigin(x))


def test_invisible_particles_are_not_evaluated_and_a_lost_swarm_ends() -> None:
    swarm = ParticleSwarm(boundary="invisible").swarm(BOX, np.random.default_rng(2))
    swarm.v[:3] = 100.0
    swarm.tell(rastrigin(swarm.ask()))
    assert len(swarm.ask()) <= 47
    lost = ParticleSwarm(boundary="invisible", inertia=2.0, cognitive=0.0, social=10.0)
    result = minimize(rastrigin, BOX, optimizer=lost, budget=Budget(evaluations=20_000))
    assert result.status in (Status.CONVERGED, Status.EVALUATIONS)
    assert np.all((result.x >= BOX[:, 0]) & (result.x <= BOX[:, 1]))


def test_stagnation_target_and_saved_nonsense() -> None:
    flat = minimize(
        lambda x: np.zeros(len(x)),
        BOX,
        optimizer=ParticleSwarm(stagnation=7),
        budget=Budget(10_000),
    )
    assert flat.status is Status.CONVERGED
    assert "7 iterations" in flat.message
    assert (
        minimize(rastrigin, BOX, optimizer="pso-ring", budget=Budget(100_000, target=1.0)).status
        is Status.TARGET
    )


def test_bad_input_is_named(tmp_path: Path) -> None:
    (tmp_path / "no.npz").write_bytes(b"nothing")
    for wrong in (tmp_path / "no.npz", tmp_path / "missing.npz"):
        with pytest.raises(ArgumentError, match=r"Swarm\.save"):
            Swarm.load(wrong)
    for options in (
        {"boundary": "glue"},
        {"topology": "star"},
        {"neighbours": 0},
        {"velocity_limit": -1.0},
        {"horizon": 0},
        {"stagnation": 0},
        {"particles": 1},
        {"start": "here"},
    ):
        with pytest.raises(ArgumentError, match=next(iter(options))):
            ParticleSwarm(**options)  # type: ignore[arg-type]
    swarm = ParticleSwarm().swarm(BOX, np.random.default_rng(0))
    with pytest.raises(ArgumentError, match="50"):
        swarm.tell(np.zeros(3))
    swarm.tell(np.full(50, np.nan))
    assert swarm.best[2] == np.inf


def test_numba_is_not_loaded_for_the_swarm_alone() -> None:
    assert "numba" in sys.modules or swarm_module._kernel() is None


@pytest.mark.parametrize("option", range(len(OPTIONS)))
def test_restarts_use_the_whole_budget_and_lose_nothing(option: int) -> None:
    once = replace(OPTIONS[option], particles=10, stagnation=5)
    bounds, budget = BOX, Budget(evaluations=3_000)
    plain = minimize(rastrigin, bounds, optimizer=once, seed=4, budget=budget)
    again = minimize(
        rastrigin, bounds, optimizer=replace(once, restart=True), seed=4, budget=budget
    )
    assert plain.nfev < again.nfev == 3_000
    assert again.status is Status.EVALUATIONS
    assert again.fun <= plain.fun
    same = minimize(rastrigin, bounds, optimizer=replace(once, restart=True), seed=4, budget=budget)
    assert same.x.tobytes() == again.x.tobytes()


def test_the_thesis_swarm_starts_and_resets_as_its_table_says() -> None:
    """[guzman2015], Table 5.4 on a space of 2 m: P2 starts from x = 1.17 to 1.83 m and is reset into 1.0 to
    1.9 m."""
    swarm = thesis_enhanced().swarm([[0.0, 2.0], [-1.5, 1.5]], np.random.default_rng(0))
    np.testing.assert_allclose(np.unique(swarm.x[:, 0]), 1 + np.arange(1, 6) / 6)
    assert np.ptp(swarm.x[:, 1]) > 2.0
    swarm.x[:] = 9.0
    swarm.v[:] = 0.0
    swarm.own[:] = 9.0
    swarm.tell(np.zeros(50))
    assert 1.0 <= swarm.x[:, 0].min() < 1.1
    assert 1.8 < swarm.x[:, 0].max() <= 1.9
    assert -1.35 <= swarm.x[:, 1].min() < -1.1
    assert np.all(swarm.v == 0.0)
