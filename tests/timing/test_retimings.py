"""Many random profiles against an independent check; the same bits in threads and after a fork."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

from tests.timing.retimings import compared, instances
from trajopt import Path, Speed, WheelAcceleration, robot, time_scale
from trajopt.timing.compiled import fastest_profiles


def test_profiles_are_those_of_the_corners_of_their_programs() -> None:
    differ, none, largest = compared(2_000, 1)
    assert differ == 0
    assert 200 < none < 1_800
    assert largest < 1e-9


@pytest.mark.slow
def test_a_million_profiles() -> None:
    assert compared(1_000_000, 2)[0] == 0


def timed(seed: int) -> bytes:
    """Bits of a profile and of a time scaling."""
    rng = np.random.default_rng(seed)
    x, _ = fastest_profiles(*instances(rng, 50))
    path = Path.through(np.cumsum(rng.uniform(0.2, 1.0, (5, 2)), axis=0))
    motion = time_scale(path, [Speed(1.0), WheelAcceleration(5.0)], robot=robot("powerbot"))
    return x.tobytes() + motion.sd.tobytes()


def test_threads_and_forks_give_the_same_bits() -> None:
    seeds = range(8)
    alone = [timed(seed) for seed in seeds]
    with ThreadPoolExecutor(4) as threads:
        assert list(threads.map(timed, seeds)) == alone
    with ProcessPoolExecutor(2, mp_context=get_context("fork")) as forks:
        assert list(forks.map(timed, seeds)) == alone
